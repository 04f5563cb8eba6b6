"""Public names are documented in numpydoc's form, with sections that are true."""

import dataclasses
import doctest
import importlib
import inspect
import pkgutil
from pathlib import Path

import pytest
from numpydoc.validate import validate

import netsp

MODULES = (
    "netsp.base.errors",
    "netsp.online.execute.execution_log",
    "netsp.world.mission.run_log",
    "netsp.world.mission.mission",
    "netsp.plan.space.visit_order",
    "netsp.world.simulator.mission_run",
    "netsp.base.registry",
    "netsp.plan.solver_table",
    "netsp.gtsp.limits",
    "netsp.gtsp.travel.result",
    "netsp.plan.random_worlds",
)
"""Modules that docs import from by name, beside the packages with an `__all__`."""

WANTED = {
    "GL08": "a docstring",
    "SS01": "a summary",
    "SS03": "a full stop after the summary",
    "PR02": "no parameters that are none",
    "PR07": "a description of each parameter in the section",
    "RT03": "a description of what is returned",
    "YD01": "what is yielded",
}
"""Codes of numpydoc. Sections are written where they say more than the signature."""


def _public():
    """Names of all public classes, functions and methods, with the objects."""
    packages = [
        module
        for found in pkgutil.walk_packages(netsp.__path__, "netsp.")
        if found.ispkg
        for module in (importlib.import_module(found.name),)
        if hasattr(module, "__all__")
    ]
    own = [netsp, *packages]
    named = [getattr(module, name) for module in own for name in module.__all__]
    for name in MODULES:
        module = importlib.import_module(name)
        named += [
            value
            for key, value in vars(module).items()
            if not key.startswith("_") and getattr(value, "__module__", "") == name
        ]
    out = {}
    for value in named:
        if not (inspect.isclass(value) or inspect.isfunction(value)):
            continue
        name = f"{value.__module__}.{value.__qualname__}"
        out[name] = value
        if inspect.isclass(value):
            for key, member in vars(value).items():
                function = getattr(member, "__func__", member)
                if not key.startswith("_") and inspect.isfunction(function):
                    out[f"{name}.{key}"] = function
    return out


PUBLIC = _public()


@pytest.mark.filterwarnings("ignore:.* is now :DeprecationWarning")  # numpydoc reads all attributes
@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_sections_of_public_docstrings_are_true_and_complete_in_themselves(name):
    value = PUBLIC[name]
    missing = {}
    for code, message in validate(name)["errors"]:
        private = dataclasses.is_dataclass(value) and "{'_" in message
        if code in WANTED and not private:
            missing[code] = f"expected {WANTED[code]}: {message}"
    assert not missing


def test_there_is_a_public_interface_to_document():
    assert {"netsp.plan.solve_problem.solve", "netsp.roadmap.travel_graph.TravelGraph.path"} <= set(
        PUBLIC
    )
    assert len(PUBLIC) > 150


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_what_a_docstring_says_is_raised_is_an_error_that_exists(name):
    from numpydoc.docscrape import FunctionDoc

    if inspect.isclass(PUBLIC[name]):
        return
    import netsp.base.errors
    import netsp.plan.random_worlds

    raised = [row.type for row in FunctionDoc(PUBLIC[name])["Raises"]]
    assert all(
        hasattr(netsp.base.errors, r) or hasattr(netsp.plan.random_worlds, r) for r in raised
    ), raised


def _with_examples():
    """Modules that show examples."""
    names = [m.name for m in pkgutil.walk_packages(netsp.__path__, "netsp.")]
    files = {n: Path(netsp.__file__).parent.joinpath(*n.split(".")[1:]) for n in names}
    return [
        n for n, file in files.items()
        if any(">>>" in line and "+SKIP" not in line
               for f in (file.with_suffix(".py"), file / "__init__.py") if f.exists()
               for line in f.read_text().splitlines())
    ]  # fmt: skip


@pytest.mark.parametrize("name", _with_examples())
def test_examples_give_what_they_say(name, monkeypatch):
    monkeypatch.chdir(Path(__file__).parent.parent)  # they read files of the repository
    found = doctest.testmod(importlib.import_module(name))
    assert found.attempted
    assert not found.failed

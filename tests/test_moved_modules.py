"""Modules that have moved are found under their old names, as the same modules, with a warning."""

import importlib
import subprocess
import sys
import warnings

import pytest

from netsp.base.moved_modules import MOVED, new_name


def test_every_new_name_is_a_module():
    for old, new in MOVED.items():
        assert importlib.import_module(f"netsp.{new}"), old


def test_no_old_name_is_a_module_of_today():
    assert [old for old in MOVED if old in MOVED.values()] == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("netsp.site", "netsp.exchange.maps"),
        ("netsp.site.contract", "netsp.exchange.maps.contract"),
        ("netsp.solvers.solve", "netsp.plan.solve_problem"),
        ("netsp.online.scene.field", "netsp.world.scene.field"),
        ("netsp.online.tether", "netsp.world.tether"),
        ("netsp.problem", "netsp.model.problem"),
        ("netsp.mip.solve", "netsp.mip.mip_solver"),
    ],
)
def test_an_old_module_is_the_new_one_and_keeps_its_spec(old, new):
    module = importlib.import_module(new)
    sys.modules.pop(old, None)
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        assert importlib.import_module(old) is module
    assert [str(w.message) for w in seen].count(f"{old} is now {new}") == 1
    assert {w.category for w in seen} == {DeprecationWarning}
    assert module.__spec__.name == new
    assert new_name(new) is None


def test_a_program_that_imports_old_names_runs_and_is_warned_at_its_own_line(tmp_path):
    program = tmp_path / "old.py"
    program.write_text(
        "from netsp.problem import Circle\n"
        "from netsp.online import Scene\n"
        "import netsp, netsp.site.contract\n"
        "assert Circle is netsp.Circle and Scene.__module__ == 'netsp.world.scene.scene'\n"
        "assert netsp.site.contract.__name__ == 'netsp.exchange.maps.contract'\n"
    )
    run = subprocess.run(
        [sys.executable, "-W", "always", str(program)], capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    for line, old in enumerate(("netsp.problem", "netsp.online.Scene", "netsp.site"), 1):
        assert f"old.py:{line}: DeprecationWarning: {old} is now" in run.stderr, run.stderr

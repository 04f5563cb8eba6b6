"""docs/architecture.md says how the modules depend on one another; here it is checked."""

import ast
import functools
import graphlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "architecture.md").read_text()
MODULES = {
    ".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): p
    for p in (ROOT / "netsp").rglob("*.py")
}


@functools.cache
def layers():
    """Names in the layers of the page's first table, from the ground up."""
    table = PAGE.split("| layer | modules | job |")[1].split("\n\n")[0]
    rows = [line.split("|")[2] for line in table.splitlines() if line.startswith("| ")]
    return [[n.strip("/") for n in re.findall(r"`([\w/]+)`", row)] for row in rows]


@functools.cache
def layer_of(module):
    """The layer that names a module, or its nearest package that is named."""
    place = module.removeprefix("netsp.").replace(".", "/")
    fits = [
        (len(name), k)
        for k, names in enumerate(layers())
        for name in names
        if place == name or place.startswith(name + "/")
    ]
    return max(fits)[1] if fits else None


@functools.cache
def imports(path):
    """(module of netsp, whether it is imported when the file is loaded)."""
    found = []

    def visit(node, at_load):
        for child in ast.iter_child_nodes(node):
            now = at_load and not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef)
            if isinstance(child, ast.ImportFrom) and (child.module or "").startswith("netsp"):
                for alias in child.names:
                    whole = f"{child.module}.{alias.name}"
                    found.append((whole if whole in MODULES else child.module, now))
            visit(child, now)

    visit(ast.parse(path.read_text()), True)
    return found


def test_every_module_has_its_layer():
    assert [m for m in MODULES if m != "netsp" and layer_of(m) is None] == []


def test_every_name_in_the_table_exists():
    for name in (n for names in layers() for n in names):
        place = ROOT / "netsp" / name
        assert place.is_dir() or place.with_suffix(".py").is_file(), name


def test_every_file_that_the_page_names_exists():
    for name in re.findall(r"`([\w/]+\.py)`", PAGE):
        assert (ROOT / "netsp" / name).is_file() or (ROOT / name).is_file(), name


@pytest.mark.parametrize("module", sorted(set(MODULES) - {"netsp"}))
def test_imports_go_down(module):
    for other, _ in imports(MODULES[module]):
        if other == "netsp":
            continue
        assert layer_of(other) <= layer_of(module), f"{module} imports {other}"


def test_nothing_is_imported_in_a_circle():
    graph = {m: {o for o, at_load in imports(p) if at_load and o != m} for m, p in MODULES.items()}
    list(graphlib.TopologicalSorter(graph).static_order())


def test_the_judge_sees_no_roadmap_and_no_solver():
    for module, path in MODULES.items():
        if module.startswith("netsp.judge"):
            seen = {o.split(".")[1] for o, _ in imports(path)}
            assert not seen & {"roadmap", "solving", "solvers", "mip", "dp", "lns", "anneal"}

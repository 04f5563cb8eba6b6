"""docs/contributing/architecture says how the modules depend on one another; here it is checked."""

import ast
import functools
import graphlib
import re
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs/contributing/architecture.md").read_text()
MODULES = {
    ".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): p
    for p in (ROOT / "netsp").rglob("*.py")
}


TABLE = PAGE.split("| room | job |")[1].split("\n\n")[0]
ROOMS = re.findall(r"^\| `(\w+)/`", TABLE, re.MULTILINE)
"""Rooms in the order of the page's table, lowest first."""


def room_of(module):
    """Index of a module's room; `netsp.__main__` stands with the commands."""
    name = module.split(".")[1]
    return ROOMS.index("command" if name == "__main__" else name)


@functools.cache
def imports(path):
    """Modules of netsp that a file imports, at once, later or for its annotations."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        is_ours = isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "netsp"
        if is_ours:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                found.append(whole if whole in MODULES else node.module)
    return found


def test_the_table_lists_every_room_and_there_are_at_most_sixteen():
    rooms = {m.split(".")[1] for m in MODULES if m not in ("netsp", "netsp.__main__")}
    assert set(ROOMS) == rooms
    assert len(ROOMS) == len(rooms) <= 16


def test_every_basename_is_unique():
    names = Counter(p.stem for p in MODULES.values() if p.stem != "__init__")
    assert [name for name, count in names.items() if count > 1] == []


def test_every_file_that_the_page_names_exists():
    for name in re.findall(r"`([\w/]+\.py)`", PAGE):
        assert (ROOT / "netsp" / name).is_file() or (ROOT / name).is_file(), name


@pytest.mark.parametrize("module", sorted(set(MODULES) - {"netsp"}))
def test_imports_go_down(module):
    for other in imports(MODULES[module]):
        if other == "netsp":
            continue
        assert room_of(other) <= room_of(module), f"{module} imports {other}"


def test_nothing_is_imported_in_a_circle():
    graph = {m: {o for o in imports(p) if o != m} for m, p in MODULES.items()}
    list(graphlib.TopologicalSorter(graph).static_order())


def test_the_judge_sees_no_roadmap_and_no_solver():
    for module, path in MODULES.items():
        if module.startswith("netsp.judge"):
            seen = {o.split(".")[1] for o in imports(path)}
            assert not seen & {"roadmap", "gtsp", "mip", "anneal", "plan"}

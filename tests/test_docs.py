"""What the pages say is so: snippets run, links lead somewhere, tables are the kept rows."""

import importlib
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import netsp
from netsp import Problem, Solution
from netsp.command.schema import FORMATS
from netsp.world.mission.mission import Mission

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "benchmarks"))

from pages import PAGES, blocks, run_page  # noqa: E402

QUICK = ("docs/reference/solvers.md", "docs/theory/tether.md")
"""Pages that take seconds; `make accept` runs the others, too."""


@pytest.mark.parametrize("page", QUICK)
def test_commands_and_snippets_run_as_written(page, tmp_path):
    assert run_page(page, tmp_path)


def test_a_broken_command_and_a_broken_snippet_are_seen(tmp_path, monkeypatch):
    """The check itself: a page with an error must not pass."""
    import pages

    monkeypatch.setattr(pages, "ROOT", tmp_path)
    for name in pages.SHIPPED:
        (tmp_path / name).mkdir()
    work = tmp_path / "work"
    work.mkdir()
    for text in (
        "```sh\nnetsp solve no-such-file.json\n```\n",
        "```python\nprint(undefined)\n```\n",
        "```\nnetsp solve no-such-file.json -o x\n```\n",
    ):
        (tmp_path / "page.md").write_text(text)
        with pytest.raises(AssertionError, match=r"page\.md:1: exit"):
            run_page("page.md", work)


def test_links_lead_somewhere():
    for page in PAGES:
        text = (ROOT / page).read_text()
        for target in re.findall(r"\]\(([^)#\s]+)", text):
            if "://" not in target:
                assert ((ROOT / page).parent / target).exists(), f"{page}: {target}"


@pytest.mark.parametrize("name", FORMATS)
def test_every_field_of_a_file_says_what_it_is(name):
    module, model = FORMATS[name].split(":")
    schema = getattr(importlib.import_module(module), model).model_json_schema()
    kinds = {name: schema, **schema.get("$defs", {})}
    fields = [
        (kind, field, what) for kind, of in kinds.items()
        for field, what in of.get("properties", {}).items()
    ]  # fmt: skip
    assert fields
    assert not [(kind, field) for kind, field, what in fields if not what.get("description")]


UNIT = re.compile(
    r"\b(m|s|kg|N|m/s|rad|degrees|seconds|metres|units?|share|GiB|%)\b|kg/m³|/s\b|\(length - "
)
"""What says the unit of a number, or that it is a share."""

WITHOUT = {
    "drag_coefficient", "friction", "max_tension_ratio",  # ratios
    "normal", "axis", "start",  # directions
    "goals", "add_goal",  # whose own fields say it
}  # fmt: skip


def is_of_numbers(field):
    """Whether a field of a schema is a number, or made of numbers."""
    parts = [field.get("items"), *field.get("prefixItems", ())]
    parts += [part for kind in ("anyOf", "oneOf", "allOf") for part in field.get(kind, ())]
    return field.get("type") == "number" or any(
        is_of_numbers(part) for part in parts if isinstance(part, dict)
    )


@pytest.mark.parametrize("name", FORMATS)
def test_every_number_of_a_file_says_its_unit(name):
    module, model = FORMATS[name].split(":")
    schema = getattr(importlib.import_module(module), model).model_json_schema()
    fields = [
        (field, what["description"])
        for of in (schema, *schema.get("$defs", {}).values())
        for field, what in of.get("properties", {}).items()
        if is_of_numbers(what)
    ]
    assert not [(f, d) for f, d in fields if f not in WITHOUT and not UNIT.search(d)]


def test_the_version_is_the_same_wherever_it_is_said():
    said = re.search(r'^version = "(.*)"$', (ROOT / "pyproject.toml").read_text(), re.M).group(1)
    cited = (ROOT / "CITATION.cff").read_text()
    assert netsp.__version__ == said
    assert f"\nversion: {said}\n" in cited
    released = re.search(r"^date-released: (\S+)$", cited, re.M).group(1)
    newest = re.search(r"^## (\d\S*), (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert newest.groups() == (said, released)


def test_the_site_has_every_page_every_public_name_and_every_field():
    """What is named is found when the site is built (`make docs`): there a warning is an error."""
    site = (ROOT / "mkdocs.yml").read_text()
    pages = [p.relative_to(ROOT / "docs").as_posix() for p in (ROOT / "docs").rglob("*.md")]
    assert all(f": {page}\n" in site for page in pages)
    reference = (ROOT / "docs/reference/python.md").read_text()
    errors = vars(importlib.import_module("netsp.base.errors"))
    for name in netsp.__all__:
        assert re.search(rf"^::: netsp[\w.]*\.{name}$", reference, re.M) or name in errors, name
    hook = runpy.run_path(str(ROOT / "docs" / "hooks" / "format_reference.py"))
    shown = "\n".join(hook["sections"]())
    for model in (Problem, Solution, Mission):
        assert all(f"| `{field}` |" in shown for field in model.model_fields)


def test_pictures_of_a_notebook_lie_beside_its_page():
    linked_from = runpy.run_path(str(ROOT / "docs" / "hooks" / "pages.py"))["linked_from"]
    text = "![png](tour_5_0.png) [next](own-solver.ipynb) [fly](../docs/guide/fly-it.md)"
    page = linked_from("tutorials/tour.md", text, Path("examples"), kept={"tour_5_0.png"})
    assert page == "![png](tour_5_0.png) [next](own-solver.md) [fly](../guide/fly-it.md)"


def test_tables_are_the_rows_that_benchmarks_kept():
    done = subprocess.run(
        [sys.executable, "benchmarks/tables.py", "--check"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout


def test_the_table_of_mavlink_messages_names_all_that_the_code_uses():
    hook = runpy.run_path(str(ROOT / "docs" / "hooks" / "mavlink.py"))
    assert "| LOCAL_POSITION_NED |" in "\n".join(hook["table"]())


def test_every_page_has_what_it_shows():
    assert sum(1 for page in PAGES for _ in blocks(page)) >= 10


def test_every_option_of_a_solver_says_what_it_is():
    done = subprocess.run(
        [sys.executable, "docs/hooks/solver_options.py"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    rows = [line for line in done.stdout.splitlines() if line.startswith("| `")]
    assert len(rows) > 100
    assert [row for row in rows if row.endswith("|  |")] == []

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
from netsp.online.mission import Mission

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "benchmarks"))

from pages import PAGES, blocks, run_page  # noqa: E402

QUICK = ("docs/roadmaps.md", "docs/solvers.md", "docs/tether.md", "docs/comparing.md")
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


def test_the_site_has_every_page_every_public_name_and_every_field():
    """What is named is found when the site is built (`make docs`): there a warning is an error."""
    site = (ROOT / "mkdocs.yml").read_text()
    assert all(f": {page.name}\n" in site for page in (ROOT / "docs").glob("*.md"))
    reference = (ROOT / "docs" / "reference.md").read_text()
    errors = vars(importlib.import_module("netsp.errors"))
    for name in netsp.__all__:
        assert re.search(rf"^::: netsp[\w.]*\.{name}$", reference, re.M) or name in errors, name
    pages = runpy.run_path(str(ROOT / "docs" / "hooks" / "pages.py"))
    shown = "\n".join(pages["formats"]())
    for model in (Problem, Solution, Mission):
        assert all(f"| `{field}` |" in shown for field in model.model_fields)


def test_tables_are_the_rows_that_benchmarks_kept():
    done = subprocess.run(
        [sys.executable, "benchmarks/tables.py", "--check"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout


def test_every_page_has_what_it_shows():
    assert sum(1 for page in PAGES for _ in blocks(page)) >= 10

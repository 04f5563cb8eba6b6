"""What the pages say is so: snippets run, links lead somewhere, tables are the kept rows."""

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import netsp
from netsp import Problem
from netsp.command.schema import FORMATS

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


def test_the_site_shows_every_page_every_public_name_and_every_field(tmp_path):
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir"]
    env = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    subprocess.run([*build, str(tmp_path)], cwd=ROOT, check=True, env=env)
    for page in (ROOT / "docs").glob("*.md"):
        assert (tmp_path / page.with_suffix(".html").name).exists()
    reference = (tmp_path / "reference.html").read_text()
    for name in netsp.__all__:
        assert re.search(rf'id="netsp\.[\w.]*\.{name}"', reference), name
    formats = (tmp_path / "formats.html").read_text()
    for name in FORMATS:
        assert f'id="{name}"' in formats
    for field in Problem.model_fields:
        assert f"<code>{field}</code>" in formats


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

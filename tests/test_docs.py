"""What the pages say is so: snippets run, links lead somewhere, tables are the kept rows."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

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

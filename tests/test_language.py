"""Code, changelog and commits keep the language rules; places that break them do not grow."""

import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

from benchmarks.structure import ROWS, UNSAID, Tree, phrases, said

ROOT = Path(__file__).resolve().parent.parent

FIRST_COMMIT = "01e50a9b"
"""Commits after this one keep the rule of subjects."""

CEILINGS = {
    "basenames": 0,
    "rooms": 16,
    "constants": 0,
    "ambiguous": 0,
    "long": 150,
    "parameters": 68,
    "openings": 0,
    "unsaid": 0,
    "phrases": 0,
    "undocumented": 0,
    "identifiers": 35,
    "pronouns": 8,
    "skips": 29,
}
"""Places that may break each rule, as counted by `python benchmarks/structure.py`. A change may
lower a ceiling, and lowers it where it mends places; no change raises one."""


@cache
def tree():
    """All modules of netsp."""
    return Tree(ROOT / "netsp")


@pytest.mark.parametrize("row", CEILINGS)
def test_no_more_places_break_a_rule_than_the_ceiling_says(row):
    text, places = ROWS[row]
    found = places(tree())
    assert len(found) <= CEILINGS[row], f"{text}: python benchmarks/structure.py --list {row}"


@pytest.mark.parametrize("row", CEILINGS)
def test_ceilings_follow_what_has_been_mended(row):
    found = len(ROWS[row][1](tree()))
    assert found >= 0.9 * CEILINGS[row] - 5, f"lower the ceiling of {row} to {found}"


def glossary():
    """Return the glossary's terms that are not to be said, without their exceptions."""
    rows = (ROOT / "docs/reference/glossary.md").read_text().splitlines()
    cells = [row.strip("| ").split(" | ") for row in rows if row.count("|") == 4]
    return {term.strip() for c in cells[2:] if len(c) > 2 for term in c[2].split(",")}


HOMONYMS = {
    "base", "goal", "obstacle", "run", "trial", "skipped", "given up", "except of GPX files",
    "most", "least",
}  # fmt: skip
"""Terms of the glossary that no pattern can find, because they are right for other things."""


def test_patterns_find_all_terms_that_the_glossary_says_not_to_use():
    assert glossary() - HOMONYMS == UNSAID.keys()


@pytest.mark.parametrize(
    "text",
    [
        "the shortest way home",
        "a depot",
        "at every stop",
        "a goal that was lost",
        "wound around it",
    ],
)
def test_the_rule_of_terms_finds_those_that_break_it(text):
    assert said(text)


@pytest.mark.parametrize(
    "text",
    ["on the way home", "under way", "the best ng-route", "`ways`", "a stop flag", "GPX route"],
)
def test_the_rule_of_terms_lets_other_senses_pass(text):
    assert not said(text)


PAGES = [page for page in sorted((ROOT / "docs").rglob("*.md")) if page.name != "glossary.md"]


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.stem)
def test_pages_keep_to_the_terms_of_the_glossary_and_to_plain_phrases(page):
    kept = r"^```.*?^```|^<!-- table .*?^<!-- end -->"  # examples, and tables of measured rows
    text = re.sub(kept, "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    assert [(t, p) for p in text.split("\n\n") for t in [*said(p), *phrases(p)]] == []


def subjects():
    """Subjects of the commits after the first one that keeps the rules, newest first."""
    known = subprocess.run(
        ["git", "cat-file", "-e", FIRST_COMMIT], cwd=ROOT, capture_output=True, check=False
    )
    if known.returncode:
        pytest.skip("the repository's history is not here")
    log = subprocess.run(
        ["git", "log", "--no-merges", "--format=%s", f"{FIRST_COMMIT}..HEAD"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return log.stdout.splitlines()


NOT_IMPERATIVE = re.compile(r"^(\w+(ed|ing)|The|A|An|Some|Now|It|This|Various|WIP\b.*)\s")


def is_good(subject):
    """Return whether a commit's subject is short and begins with a verb in the imperative."""
    return (
        len(subject) <= 72
        and subject[:1].isupper()
        and not subject.endswith(".")
        and not NOT_IMPERATIVE.match(subject + " ")
    )


def test_subjects_of_commits_are_short_and_imperative():
    assert [s for s in subjects() if not is_good(s)] == []


@pytest.mark.parametrize(
    "subject", ["WIP: move", "Moved modules", "fix it", "Name " + 20 * "long ", "Fix bugs."]
)
def test_the_rule_of_subjects_finds_those_that_break_it(subject):
    assert not is_good(subject)


def entries():
    """Entries of the changelog's section that is not released."""
    text = (ROOT / "CHANGELOG.md").read_text()
    section = re.split(r"^## ", text, flags=re.MULTILINE)[1]
    return re.findall(r"^- .*(?:\n  .*)*", section, flags=re.MULTILINE)


def test_entries_of_the_changelog_have_at_most_two_lines():
    assert entries()
    long = [e for e in entries() if e.count("\n") > 1 or max(map(len, e.splitlines())) > 150]
    assert long == []

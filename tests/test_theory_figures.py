"""The paper in docs/theory: figures check the lengths and words that they draw, propositions are
numbered without gaps, and the appendix names a test of each."""

import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "benchmarks"))

from theory import FIGURES


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_of_the_theory_is_drawn_from_what_it_says(name):
    figure = FIGURES[name]()
    assert (Path(__file__).parent.parent / "docs/pictures" / f"theory-{name}.png").exists()
    for ax in figure.axes:
        assert ax.get_xlabel()
        assert ax.get_ylabel()


PAPER = Path(__file__).parent.parent / "docs" / "theory"
PAGES = ("index", "classes", "solvers", "space-bounds", "roadmaps")


def text_of_paper():
    """Return the pages of the paper, in order."""
    return "\n".join((PAPER / f"{page}.md").read_text() for page in PAGES)


def test_propositions_sections_and_figures_are_numbered_without_gaps():
    text = text_of_paper()
    for pattern in (
        r"^\*\*(?:Lemma|Proposition|Theorem) (\d+)",
        r"^## (\d+)\. ",
        r"^!\[Figure (\d+)\.",
    ):
        numbers = [int(n) for n in re.findall(pattern, text, re.MULTILINE)]
        assert numbers == list(range(1, len(numbers) + 1)), pattern
    assert {int(n) for n in re.findall(r"Propositions? (\d+)", text)} <= set(range(1, 36))


def test_the_appendix_names_a_test_of_each_proposition():
    appendix = (PAPER / "index.md").read_text().split("## Appendix")[1].split("## References")[0]
    covered = set()
    for cell in re.findall(r"^\| ([\d, to]+) \|", appendix, re.MULTILINE):
        for part in cell.split(", "):
            first, _, last = part.partition(" to ")
            covered |= set(range(int(first), int(last or first) + 1))
    assert covered >= set(range(1, 36))
    for name in re.findall(r"`(test_\w+\.py)`", appendix):
        assert (Path(__file__).parent / name).exists(), name


def test_citations_are_in_the_list_of_references():
    text = text_of_paper()
    listed = set(re.findall(r"^- \[(\w+\d\d)\] ", text, re.MULTILINE))
    cited = {
        key for group in re.findall(r"\[((?:\w+\d\d(?:, )?)+)", text) for key in group.split(", ")
    }
    assert {key for key in cited if key} == listed

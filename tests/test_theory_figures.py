"""The figures of docs/theory show what they say: each checks the lengths and words it draws."""

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

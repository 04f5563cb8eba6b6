"""How pictures look: one colour for each role, wherever it is drawn, and one way to save.

The colours are those of Okabe and Ito (2008), told apart with any kind of colour vision; they are
helped by shape and line style, so that a print in grey can be read as well.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from netsp.errors import InputError

BASE = "#000000"
"""The anchor of the tether; drawn as a star."""

ROBOT, TETHER = "#e69f00", "#d55e00"
"""Orange and vermilion."""

PATH, PLAN = "#0072b2", "#56b4e9"
"""What is or will be travelled, in blue; what was planned instead, in sky blue and dashed."""

OBSTACLE, EDGE, WRAPPED = "#c5ccd3", "#5a6672", "#e5c1d5"
"""Greys; and what the tether winds about, in light purple."""

GOAL, VISITED, LEFT_OUT, CANCELLED = "#ffffff", "#009e73", "#cc79a7", "#8a939c"
"""A goal of a plan (its edge is the path's colour); visited (a disc), left out (a cross), cancelled
(a plus)."""

LIMIT, EVENT, RECOVERY = "#333333", "#8a939c", "#f7f0b8"
"""The tether's length; what happened; times of tether recovery."""

SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Solvers side by side, in their order."""

RUNS = (PATH, TETHER)
"""Two runs side by side."""

FORMATS = (".png", ".svg", ".pdf")


def check_format(path: str | Path, *more: str) -> None:
    """InputError unless a file name ends in a format that can be drawn.

    Parameters
    ----------
    more
        Further endings.
    """
    if Path(path).suffix.lower() not in (*FORMATS, *more):
        names = ", ".join((*FORMATS, *more))
        raise InputError(f"{path}: cannot draw this format; expected a name ending in {names}")


def save(figure: Any, path: str | Path, dpi: int = 150) -> None:
    """Write a matplotlib Figure by the file name's ending; the same figure gives the same bytes.

    Raises
    ------
    InputError
        Another ending, a file that cannot be written.
    """
    check_format(path)
    try:
        metadata = {"Date": None} if Path(path).suffix.lower() == ".svg" else None
        literal(figure).savefig(path, dpi=dpi, metadata=metadata)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def literal(figure: Any) -> Any:
    """The figure (Matplotlib's), its texts not read as mathematics but for the labels of ticks,
    which Matplotlib writes itself. To be called right before it is saved."""
    from matplotlib.text import Text

    ticks = set()
    for axes in figure.findobj(match=lambda artist: hasattr(artist, "_axis_map")):
        for axis in axes._axis_map.values():
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                ticks |= {id(tick.label1), id(tick.label2)}
            ticks.add(id(axis.get_offset_text()))
    for text in figure.findobj(match=Text):
        if id(text) not in ticks:
            text.set_parse_math(False)
    return figure

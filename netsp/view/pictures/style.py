"""Style of all pictures: one colour for each role, and one function to save them.

The colours are those of Okabe and Ito (2008), which people with any colour vision can distinguish.
Roles also differ in shape or line style, so that grey prints are legible.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from pathlib import Path
from typing import Any

from netsp.base import progress
from netsp.base.errors import InputError

BASE = "#000000"
"""Colour of the anchor of the tether, which is drawn as a star."""

ROBOT, TETHER = "#e69f00", "#d55e00"
"""Colours of robot and tether, orange and vermilion."""

PATH, PLAN = "#0072b2", "#56b4e9"
"""Colours of paths: travelled or planned in blue, abandoned plans in sky blue and dashed."""

OBSTACLE, EDGE, WRAPPED = "#c5ccd3", "#5a6672", "#e5c1d5"
"""Colours of obstacles, of their edges, and of obstacles that a path wraps."""

GOAL, VISITED, LEFT_OUT, CANCELLED = "#ffffff", "#009e73", "#cc79a7", "#8a939c"
"""Colours of goals: planned (with an edge in the colour of the path), visited (a disc), left out (a
cross), cancelled (a plus)."""

LIMIT, EVENT, RECOVERY = "#333333", "#8a939c", "#f7f0b8"
"""Colours of the tether's limit, of events, and of times of tether recovery."""

SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Colours of solvers side by side, in order."""

RUNS = (PATH, TETHER)
"""Colours of two runs side by side."""

FORMATS = (".png", ".svg", ".pdf")


def check_format(path: str | Path, *more: str) -> None:
    """Raise InputError unless a file name ends in a format that can be drawn.

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
        The name has another ending, or the file cannot be written.
    """
    check_format(path)
    if Path(path).exists() and not Path(path).is_file():
        raise InputError(f"{path}: cannot be written: expected a file, not a device or a folder")
    try:
        dates = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
        _write(figure, path, dpi=dpi, metadata=dates.get(Path(path).suffix.lower()))
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def load_matplotlib() -> None:
    """Load Matplotlib's figures without generating the docstrings of their setters.

    These docstrings take a fifth of the loading time, and commands never show them.
    """
    from matplotlib import artist as artists

    kwdoc = artists.kwdoc
    try:
        artists.kwdoc = lambda artist: ""
        import matplotlib.figure  # noqa: F401
    finally:
        artists.kwdoc = kwdoc


def halo() -> list[Any]:
    """Return the effect of a white edge around letters, so that they are legible over lines."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2.0, foreground="white")]


def svg(figure: Any, **more: Any) -> str:
    """Return a matplotlib Figure as the SVG element of a page.

    Parameters
    ----------
    more
        Options of Matplotlib's `savefig`.
    """
    out = io.StringIO()
    _write(figure, out, format="svg", metadata={"Date": None}, **more)
    text = out.getvalue()
    return text[text.index("<svg") :]


def _write(figure: Any, target: Any, **more: Any) -> None:
    """Save a figure without Matplotlib's warnings about missing letters and lack of room.

    Missing letters show as boxes, and texts without room are cut.
    """
    from matplotlib import rc_context

    # without a salt, the element ids of an SVG are random
    with warnings.catch_warnings(), rc_context({"svg.hashsalt": "netsp"}):
        warnings.filterwarnings("ignore", message=r"Glyph \d+|constrained_layout not applied")
        with _ticks_formatted(figure):
            literal(figure).savefig(target, **more)


@contextmanager
def _ticks_formatted(figure: Any) -> Iterator[None]:
    """While the body draws a figure, what it consists of is counted."""
    parts = [part for axes in figure.axes for part in axes.get_children()]
    done = 0

    def counting(draw: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(draw)
        def drawn(*args: Any, **more: Any) -> Any:
            nonlocal done
            done = min(done + 1, len(parts))
            out = draw(*args, **more)
            progress.report(done, len(parts))
            return out

        return drawn

    for part in parts:
        part.draw = counting(part.draw)
    try:
        yield
    finally:
        for part in parts:
            del part.draw


def literal(figure: Any, max_letters: int = 40) -> Any:
    """Make the texts of a figure plain, not mathematics, and cut words to `max_letters`; return it.

    Tick labels, which Matplotlib writes, do not change.
    """
    for text in _texts(figure):
        text.set_parse_math(False)
        content = text.get_text()
        if not content.isascii():
            text.set_fontfamily(["DejaVu Sans", *_fonts_of_other_scripts()])
        text.set_text(re.sub(rf"(\S{{{max_letters}}})\S+", r"\1…", content))
    return figure


def _texts(artist: Any) -> Iterator[Any]:
    """Yield all texts in a Matplotlib artist except tick labels, which Matplotlib would create on
    access although it draws few of them."""
    from matplotlib.axis import Axis
    from matplotlib.text import Text

    if isinstance(artist, Text):
        yield artist
    for part in [artist.label] if isinstance(artist, Axis) else artist.get_children():
        yield from _texts(part)


@cache
def _fonts_of_other_scripts() -> tuple[str, ...]:
    """Return the installed fonts with letters that Matplotlib's default font lacks."""
    from matplotlib import font_manager

    known_fonts = set(font_manager.get_font_names())
    wanted = (
        "Noto Sans CJK JP",
        "Noto Sans CJK SC",
        "WenQuanYi Zen Hei",
        "Droid Sans Fallback",
        "Noto Sans",
        "Unifont",
    )
    return tuple(name for name in wanted if name in known_fonts)

"""Texts in figures as they are: a `$` in a name is a dollar, not the beginning of a formula."""

from __future__ import annotations

from typing import Any


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

"""Log of a run on a page: its rows, and the tether over time."""

from __future__ import annotations

import html
from pathlib import Path

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.files import csv_rows, read_text
from netsp.view.pictures import style


def rows_of(file: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file of a run.

    Returns
    -------
    list of dict
        Cells as text, by column.
    """
    return csv_rows(read_text(file), str(file))


def over_time(t: Floats, length: Floats, limit: Floats, units: str) -> str:
    """Return the chart of the tether and its limit over time.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times, s.
    length : ndarray, shape (n,)
        Tether lengths.
    limit : ndarray, shape (n,)
        Limits of the tether length.
    units : str
        Unit of lengths.
    """
    thin = slice(None, None, max(1, len(t) // 1200))
    top = 1.05 * float(max(length.max(), limit.max()))
    span = float(t[-1]) or 1.0
    units = html.escape(units)

    def x(time: float) -> float:
        return 50 + 830 * time / span

    def y(value: float) -> float:
        return 180 - 165 * value / top

    def line(values: Floats) -> str:
        return " ".join(
            f"{x(a):.1f},{y(b):.1f}" for a, b in zip(t[thin], values[thin], strict=True)
        )

    grid = "".join(
        f'<line x1="50" y1="{y(v):.1f}" x2="880" y2="{y(v):.1f}" stroke="{style.OBSTACLE}"/>'
        f'<text x="44" y="{y(v) + 4:.1f}" font-size="12" text-anchor="end">{v:g}</text>'
        for v in _ticks(top)
    )
    times = "".join(
        f'<text x="{x(v):.1f}" y="198" font-size="12" text-anchor="middle">{v:g}</text>'
        for v in _ticks(span)
    )
    return (
        f'<svg class="chart" viewBox="0 0 900 222" role="img" aria-label="tether over time">{grid}'
        f'<polyline points="{line(limit)}" fill="none" stroke="{style.LIMIT}" '
        'stroke-dasharray="5 4"/>'
        f'<polyline points="{line(length)}" fill="none" stroke="{style.TETHER}" stroke-width="2"/>'
        f'<text x="465" y="216" font-size="12" text-anchor="middle">time (s)</text>{times}'
        f'<text x="12" y="98" font-size="12" text-anchor="middle" transform="rotate(-90 12 98)">'
        f"length ({units})</text></svg>"
        '<p class="note">Taut tether (solid) and its limit (dashed).</p>'
    )


def _ticks(top: float) -> list[float]:
    """Return four to eight round numbers from 0 to at most `top`."""
    step = 10.0 ** np.floor(np.log10(top / 4.0))
    step *= next(k for k in (10.0, 5.0, 2.0, 1.0) if k * step <= top / 3.0)
    return [float(v) for v in step * np.arange(int(top / step) + 1)]

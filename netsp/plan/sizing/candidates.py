"""Candidates for a base along a line or over a grid. Those of a table are read by
`netsp.exchange.maps.csv_table`."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.model.problem import Problem


def along_line(text: str) -> Floats:
    """Return places (N, 2) along a line given as ``X1,Y1,X2,Y2,N``.

    Raises
    ------
    InputError
        The text is something else.
    """
    try:
        x1, y1, x2, y2, count = (float(v) for v in text.split(","))
    except ValueError:
        raise InputError(f"--line: expected X1,Y1,X2,Y2,N, got {text!r}") from None
    if count != int(count) or not 2 <= count <= 10_000:
        raise InputError(f"--line: expected 2 to 10,000 places, got {count:g}")
    share = np.linspace(0.0, 1.0, int(count))[:, None]
    return np.asarray((1.0 - share) * [x1, y1] + share * [x2, y2])


def over_grid(text: str, problem: Problem) -> Floats:
    """Return places (NX * NY, 2) of a grid given as ``NX,NY`` over the problem's bounds, or over
    all its points and obstacles.

    Raises
    ------
    InputError
        The text is something else.
    """
    try:
        across, up = (int(v) for v in text.replace("x", ",").split(","))
    except ValueError:
        raise InputError(f"--grid: expected NX,NY, got {text!r}") from None
    if not (1 <= across <= 1000 and 1 <= up <= 1000):
        raise InputError(f"--grid: expected 1 to 1000 places to either side, got {text!r}")
    if problem.bounds is not None:
        low, high = np.array(problem.bounds[:2]), np.array(problem.bounds[2:])
    else:
        held = [problem.points[:, :2]]
        held += [
            np.array(o.shape(problem.clearance).bounds).reshape(2, 2) for o in problem.obstacles
        ]
        xy = np.vstack(held)
        low, high = xy.min(0), xy.max(0)
    x, y = np.meshgrid(np.linspace(low[0], high[0], across), np.linspace(low[1], high[1], up))
    return np.column_stack([x.ravel(), y.ravel()])

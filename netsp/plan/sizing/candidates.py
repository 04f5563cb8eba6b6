"""Candidates for a base along a line or over a grid; `netsp.exchange.maps.csv_table` reads those of
a table."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.model.problem import Problem


def along_line(text: str) -> Floats:
    """Places along a line given as ``X1,Y1,X2,Y2,N``.

    Parameters
    ----------
    text : str
        Both ends and the number of places.

    Returns
    -------
    ndarray, shape (N, 2)
        In the problem's units.

    Raises
    ------
    InputError
        Something else.
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
    """Places of a grid given as ``NX,NY`` over the problem's bounds, or over what it holds.

    Parameters
    ----------
    text : str
        Numbers of places to either side.
    problem : Problem
        Whose base is sought.

    Returns
    -------
    ndarray, shape (NX * NY, 2)
        In the problem's units.

    Raises
    ------
    InputError
        Something else.
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

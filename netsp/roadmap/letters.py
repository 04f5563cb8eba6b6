"""Ray crossings of segments and arcs, for kernels, by the rules of `netsp.hsignature.rays`.

Sides come from comparing the stored x of both ends of a piece with the x of the ray, so consecutive
pieces, which share an end, agree about its side.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel


@kernel
def segment_letters(
    ax: float,
    ay: float,
    bx: float,
    by: float,
    rays: Floats,
    order: Ints,
    out: npt.NDArray[np.integer[Any]],
    n: int,
) -> int:
    """Append the letters of a straight segment to `out`; return the new count."""
    k = len(order)
    rightward = bx > ax
    for step in range(k):
        i = order[step] if rightward else order[k - 1 - step]
        x = rays[i, 0]
        if (ax >= x) == (bx >= x):
            continue
        height = ay + (x - ax) / (bx - ax) * (by - ay)
        if height > rays[i, 1]:
            out[n] = i + 1 if rightward else -(i + 1)
            n += 1
    return n


@kernel
def arc_letters(
    cx: float,
    cy: float,
    r: float,
    ax: float,
    bx: float,
    start: float,
    turn: float,
    rays: Floats,
    order: Ints,
    out: npt.NDArray[np.int32],
    n: int,
) -> int:
    """Append the letters of an arc from angle `start` through the signed angle `turn`; return the
    new count.

    The arc is split at the quadrants into pieces that are monotone in x.

    Parameters
    ----------
    ax, bx
        Stored x of the two ends.
    """
    k = len(order)
    quarter = 0.5 * math.pi
    sign = 1.0 if turn >= 0.0 else -1.0
    end = start + turn
    angle, x0 = start, ax
    boundary = math.floor(sign * start / quarter) + 1.0
    while True:
        nxt = sign * boundary * quarter
        last = not sign * (end - nxt) > 0.0  # ends, too, if an angle is NaN
        if last:
            x1, stop = bx, end
        else:
            which = int(sign * boundary) % 4
            stop = nxt
            x1 = cx + r if which == 0 else (cx - r if which == 2 else cx)
        upper = math.sin(0.5 * (angle + stop)) > 0.0
        rightward = x1 > x0
        for step in range(k):
            i = order[step] if rightward else order[k - 1 - step]
            x = rays[i, 0]
            if (x0 >= x) == (x1 >= x):
                continue
            root = math.sqrt(max(r * r - (x - cx) * (x - cx), 0.0))
            height = cy + root if upper else cy - root
            if height > rays[i, 1]:
                out[n] = i + 1 if rightward else -(i + 1)
                n += 1
        if last:
            return n
        angle, x0 = stop, x1
        boundary += 1.0

"""Lower bounds on paths that are not of the class of the straight segment between their ends.

If a path cannot be deformed into the straight segment ab, then some point p of a core lies between
a point q of the path and the point of ab that is closest to q (docs/theory, Proposition 33). The
path stays away from the core, so q lies beyond p by at least that distance, and the path is at
least |aq| + |qb| long. The kernels bound the least such length over all p of a segment from below.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.compiled.kernel import kernel


class DetourEffort(NamedTuple):
    """Effort of bounds on detours.

    Attributes
    ----------
    longest
        Longest bound of interest, metres.
    tolerance
        Amount by which a bound may be less than it could be, metres.
    max_pieces
        Number of pieces of a segment after which the bound proven so far is taken.
    """

    longest: float
    tolerance: float
    max_pieces: int


@kernel
def detour_lengths(
    a: Floats, b: Floats, begins: Floats, ends: Floats, distances: Floats, effort: DetourEffort
) -> Floats:
    """Return lower bounds on paths from a to b around segments of cores.

    Parameters
    ----------
    a, b : ndarray of shape (3,)
        Ends of the paths, metres.
    begins, ends : ndarray of shape (m, 3)
        Ends of the segments, metres.
    distances : ndarray of shape (m,)
        Least distance of the paths from each segment, metres; not negative.
    effort : DetourEffort
        Longest bound of interest, and accuracy.

    Returns
    -------
    ndarray of shape (m,)
        A bound for each segment, metres: paths with a point p of the segment between a point of
        the path and the closest point of ab are no shorter. At most the longest of interest.
    """
    out = np.empty(len(begins))
    for k in range(len(begins)):
        out[k] = _segment_bound(a, b, begins[k], ends[k], distances[k], effort)
    return out


@kernel
def _segment_bound(
    a: Floats, b: Floats, c: Floats, d: Floats, away: float, effort: DetourEffort
) -> float:
    """Return the least bound over all pieces of a segment."""
    longest = effort.longest
    straight = _distance(a, b)
    if straight >= longest:
        return longest
    length = _distance(c, d)
    stack = np.empty((128, 2))
    stack[0, 0], stack[0, 1] = 0.0, 1.0
    count, best, found, pieces = 1, longest, longest, 0
    p = np.empty(3)
    while count > 0:
        count -= 1
        low, high = stack[count, 0], stack[count, 1]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        for k in range(3):
            p[k] = c[k] + middle * (d[k] - c[k])
        along, away_from_ab = _closest(a, b, straight, p)
        value = _length_over(straight, along, away_from_ab + away)
        found = min(found, value)
        # the pair (along, distance) of a point moves by no more than the point
        bound = max(straight, value - 2.0 * half * length)
        pieces += 1
        if (
            bound >= min(found - effort.tolerance, longest)
            or pieces > effort.max_pieces
            or count + 2 > len(stack)
            or half * length < 1e-9
        ):
            best = min(best, bound)
        else:
            stack[count, 0], stack[count, 1] = low, middle
            stack[count + 1, 0], stack[count + 1, 1] = middle, high
            count += 2
    return best


@kernel
def _closest(a: Floats, b: Floats, straight: float, p: Floats) -> tuple[float, float]:
    """Return the distance from a to the point of the segment ab that is closest to p, and the
    distance of p from it."""
    along = 0.0
    if straight > 0.0:
        for k in range(3):
            along += (p[k] - a[k]) * (b[k] - a[k]) / straight
        along = min(straight, max(0.0, along))
    squares = 0.0
    for k in range(3):
        foot = a[k]
        if straight > 0.0:
            foot += along / straight * (b[k] - a[k])
        squares += (p[k] - foot) ** 2
    return along, math.sqrt(squares)


@kernel
def _length_over(straight: float, along: float, height: float) -> float:
    """Return the length of the path from one end of a segment to the other over a point at a height
    above a point of the segment."""
    return math.hypot(along, height) + math.hypot(straight - along, height)


@kernel
def _distance(a: Floats, b: Floats) -> float:
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)

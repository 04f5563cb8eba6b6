"""Exact orientation of three points of the plane.

The sign of a cross product says on which side of a line a point lies. For nearly collinear points,
rounding may flip that sign, and two tests may contradict each other. Here the sign is exact: floats
decide if the error bound of Shewchuk (1997, "Adaptive precision floating-point arithmetic and fast
robust geometric predicates") allows it, and fractions otherwise.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from netsp.base.arrays import Floats, Ints

Point = tuple[float, float]

ERROR_BOUND = (3.0 + 16.0 * 2.0**-53) * 2.0**-53
"""Tolerance of the cross product p - q: its largest rounding error, as a share of |p| + |q|."""

UNDERFLOW_BOUND = 1e-280
"""Tolerance of |p| + |q|: below it, underflow may lose digits of the products."""


def orientation(a: Point, b: Point, c: Point) -> int:
    """Return 1 if c lies left of the line from a to b, -1 if right of it, 0 if on it."""
    p = (a[0] - c[0]) * (b[1] - c[1])
    q = (a[1] - c[1]) * (b[0] - c[0])
    size = abs(p) + abs(q)
    cross = p - q
    if abs(cross) > ERROR_BOUND * size and size > UNDERFLOW_BOUND:
        return 1 if cross > 0.0 else -1
    if a in (b, c) or b == c:
        return 0
    return _exact(a, b, c)


def orientations(a: Floats, b: Floats, c: Floats) -> Ints:
    """Return the `orientation` (n,) of each row of three arrays (n, 2) of points."""
    p = (a[:, 0] - c[:, 0]) * (b[:, 1] - c[:, 1])
    q = (a[:, 1] - c[:, 1]) * (b[:, 0] - c[:, 0])
    size = np.abs(p) + np.abs(q)
    cross = p - q
    sign = np.sign(cross).astype(np.int64)
    unsure = ~((np.abs(cross) > ERROR_BOUND * size) & (size > UNDERFLOW_BOUND))
    for k in np.flatnonzero(unsure).tolist():
        sign[k] = orientation(tuple(a[k].tolist()), tuple(b[k].tolist()), tuple(c[k].tolist()))
    return sign


def _exact(a: Point, b: Point, c: Point) -> int:
    ax, ay, bx, by, cx, cy = (Fraction(v) for v in (*a, *b, *c))
    cross = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
    return (cross > 0) - (cross < 0)

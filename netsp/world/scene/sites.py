"""Sites, whose distances a grid stores: triangles, or points with a radius. Compiled.

A site is a row of numbers. The row of a point holds its position (3) and a radius, which is
subtracted from the distance. The row of a triangle holds a corner (3), 0, the edges b and c from
that corner (3, 3), the vectors p and q (3, 3) in its plane that give a point's coordinates along
the edges (p · b = 1, p · c = 0, q · b = 0, q · c = 1), a unit normal (3), and 1 if it has no area.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.compiled.kernel import kernel

POINT = 4
"""Format of the row of a point: its length."""

TRIANGLE = 20
"""Format of the row of a triangle: its length."""


def point_sites(points: Floats, radii: npt.ArrayLike = 0.0) -> Floats:
    """Return the rows of points (n, 3) with radii (n,) or one radius."""
    return np.column_stack([points, np.broadcast_to(radii, len(points))]).astype(float, order="C")


def triangle_sites(triangles: Floats) -> Floats:
    """Return the rows of triangles (n, 3, 3)."""
    b, c = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    bb, bc, cc = ((u * v).sum(1) for u, v in ((b, b), (b, c), (c, c)))
    det = bb * cc - bc * bc
    flat = det <= 1e-14 * bb * cc
    det[flat] = 1.0
    rows = np.zeros((len(triangles), TRIANGLE))
    rows[:, 0:3], rows[:, 4:7], rows[:, 7:10] = triangles[:, 0], b, c
    rows[:, 10:13] = (cc[:, None] * b - bc[:, None] * c) / det[:, None]
    rows[:, 13:16] = (bb[:, None] * c - bc[:, None] * b) / det[:, None]
    rows[:, 16:19] = np.cross(b, c) / np.sqrt(det)[:, None]
    rows[:, 19] = flat
    return rows


@kernel
def site_distance(sites: Floats, s: int, x: float, y: float, z: float) -> float:
    """Return the distance of a place to a site.

    The closest point of a triangle is the foot of the perpendicular if it lies inside, else it is
    on an edge beyond which the foot lies. The row is not bound to a name, because counting the
    reference would take longer than the distance.
    """
    x, y, z = x - sites[s, 0], y - sites[s, 1], z - sites[s, 2]
    if sites.shape[1] == POINT:
        return float(math.sqrt(x * x + y * y + z * z) - sites[s, 3])
    v = sites[s, 10] * x + sites[s, 11] * y + sites[s, 12] * z
    w = sites[s, 13] * x + sites[s, 14] * y + sites[s, 15] * z
    flat = sites[s, 19] > 0.0
    if not flat and v >= 0.0 and w >= 0.0 and v + w <= 1.0:
        return float(abs(sites[s, 16] * x + sites[s, 17] * y + sites[s, 18] * z))
    bx, by, bz = sites[s, 4], sites[s, 5], sites[s, 6]
    cx, cy, cz = sites[s, 7], sites[s, 8], sites[s, 9]
    best = math.inf
    if flat or w < 0.0:
        best = _squared(x, y, z, bx, by, bz)
    if flat or v < 0.0:
        best = min(best, _squared(x, y, z, cx, cy, cz))
    if flat or v + w > 1.0:
        best = min(best, _squared(x - bx, y - by, z - bz, cx - bx, cy - by, cz - bz))
    return math.sqrt(best)


@kernel
def _squared(px: float, py: float, pz: float, ex: float, ey: float, ez: float) -> float:
    """Return the squared distance of a point p to the edge from the origin to e."""
    ee = ex * ex + ey * ey + ez * ez
    f = min(1.0, max(0.0, (px * ex + py * ey + pz * ez) / ee)) if ee > 0.0 else 0.0
    qx, qy, qz = px - f * ex, py - f * ey, pz - f * ez
    return qx * qx + qy * qy + qz * qz


@kernel
def extent(sites: Floats, s: int, axis: int) -> tuple[float, float]:
    """Return the minimum and maximum coordinate of a site along an axis, without its radius."""
    a = sites[s, axis]
    if sites.shape[1] == POINT:
        return a, a
    b, c = sites[s, 4 + axis], sites[s, 7 + axis]
    return a + min(0.0, b, c), a + max(0.0, b, c)

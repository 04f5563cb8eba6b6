"""Triangulation of free space on a grid, with circles replaced by inscribed polygons."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from netsp.base.arrays import Floats
from netsp_check.problem_file import Obstacle, Problem
from netsp_check.triangulation import RESOLUTION

if TYPE_CHECKING:
    import shapely

GRID_BITS = 36
"""Format constant: the size of a problem is between 2^35 and 2^36 grid units."""

INSET = 4.0
"""Tolerance: grid units by which polygons stay inside obstacles, so that rounding does not matter."""


def grid_of(size: float) -> int:
    """Return the exponent of the grid for a problem of a size."""
    return GRID_BITS - math.frexp(size)[1]


@dataclass(frozen=True)
class Mesh:
    """Triangles of the free space, as a proof holds them.

    Attributes
    ----------
    points
        Flat coordinates of corners.
    triangles
        Flat indices of corners, counter-clockwise.
    box
        Box (x0, y0, x1, y1) that was triangulated; None if it is the problem's bounds.
    bridges
        Segments (x0, y0, x1, y1) that close gaps.
    """

    points: list[int]
    triangles: list[int]
    box: list[int] | None
    bridges: list[list[int]]

    def to_fields(self) -> dict[str, Any]:
        """Return the fields of the proof."""
        out: dict[str, Any] = {"points": self.points, "triangles": self.triangles}
        if self.box is not None:
            out["box"] = self.box
        if self.bridges:
            out["bridges"] = self.bridges
        return out


def triangulate(problem: Problem, corners: int) -> Mesh:
    """Return a triangulation of the free space about the base.

    Parameters
    ----------
    corners
        Corners of the polygon inscribed in a circle.
    """
    import shapely

    box = _box(problem)
    frame = box if box is not None else [float(v) for v in problem.bounds or ()]
    shapes = [_inner_shape(o, corners) for o in problem.obstacles]
    near = [k for k, o in enumerate(problem.obstacles) if box is None or _is_within(o, box)]
    bridges = _bridges(problem, [shapes[k] for k in near])
    pieces = [shapes[k] for k in near] + [_thin_box(b, problem) for b in bridges]
    solid = shapely.union_all(pieces, grid_size=1.0)
    places = [shapely.Point(round(x), round(y)) for x, y in problem.places]
    delta = float(problem.size) / RESOLUTION
    free_ends = shapely.union_all([p.buffer(2.0 * delta, quad_segs=2) for p in places], grid_size=1.0)
    solid = shapely.difference(solid, free_ends, grid_size=1.0)
    outer = shapely.box(*(round(v) for v in _widened(frame, box is None)))
    free = shapely.difference(outer, solid, grid_size=1.0)
    parts = [g for g in shapely.get_parts(free) if g.geom_type == "Polygon"]
    base = next(g for g in parts if g.intersects(places[0]))
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(base))
    return _mesh(triangles, box, bridges)


def _mesh(triangles: Sequence[Any], box: list[int] | None, bridges: list[list[int]]) -> Mesh:
    import shapely

    rings = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3].astype(np.int64)
    a, b, c = rings[:, 0], rings[:, 1], rings[:, 2]
    is_clockwise = [
        int(q[0] - p[0]) * int(r[1] - p[1]) < int(q[1] - p[1]) * int(r[0] - p[0])
        for p, q, r in zip(a.tolist(), b.tolist(), c.tolist(), strict=True)
    ]
    rings[is_clockwise] = rings[is_clockwise][:, ::-1]
    points, index = np.unique(rings.reshape(-1, 2), axis=0, return_inverse=True)
    return Mesh(points.ravel().tolist(), index.ravel().tolist(), box, bridges)


def _box(problem: Problem) -> list[int] | None:
    """Return a box that holds the base, all goals and the obstacles within reach; None to
    triangulate the bounds."""
    reach = float(problem.tether)
    low = [min(float(p[i]) for p in problem.places) for i in (0, 1)]
    high = [max(float(p[i]) for p in problem.places) for i in (0, 1)]
    for o in problem.obstacles:
        first, last = ([float(v) for v in corner] for corner in o.span())
        if all(first[i] <= reach and -reach <= last[i] for i in (0, 1)):
            low = [min(low[i], first[i]) for i in (0, 1)]
            high = [max(high[i], last[i]) for i in (0, 1)]
    room = 0.01 * max(high[0] - low[0], high[1] - low[1])
    box = [math.floor(v - room) for v in low] + [math.ceil(v + room) for v in high]
    if problem.bounds is not None:
        x0, y0, x1, y1 = problem.bounds
        if not (x0 <= box[0] and y0 <= box[1] and box[2] <= x1 and box[3] <= y1):
            return None
    return box


def _is_within(o: Obstacle, box: Sequence[int]) -> bool:
    first, last = o.span()
    return all(box[i] <= first[i] and last[i] <= box[i + 2] for i in (0, 1))


def _widened(frame: Sequence[float], is_bounds: bool) -> list[float]:
    """Return a frame on the grid; that of bounds is not smaller than the bounds."""
    if not is_bounds:
        return list(frame)
    return [*(math.floor(v) for v in frame[:2]), *(math.ceil(v) for v in frame[2:])]


def _inner_shape(o: Obstacle, corners: int) -> shapely.Geometry:
    """Return a polygon inside a grown obstacle, whose corners are on its outline."""
    import shapely

    at = np.array([[float(x), float(y)] for x, y in o.corners])
    growth = float(o.growth) - INSET
    if len(at) == 1:
        return shapely.Polygon(_on_circle(at[0], growth, corners))
    plan = shapely.Polygon(at)
    if growth <= 0.0:
        return plan.buffer(-INSET, join_style="mitre")
    edges = zip(np.roll(at, 1, axis=0), at, strict=True)
    return shapely.union_all([plan, *(_stadium(a, b, growth, corners) for a, b in edges)], grid_size=1.0)


def _on_circle(center: Floats, radius: float, corners: int) -> Floats:
    angle = 2.0 * np.pi * np.arange(corners) / corners
    return np.rint(center + radius * np.column_stack([np.cos(angle), np.sin(angle)]))


def _stadium(a: Floats, b: Floats, radius: float, corners: int) -> Any:
    """Return the hull of two circles' corners, and of the ends of the tangents between."""
    import shapely

    d = (b - a) / np.hypot(*(b - a))
    side = radius * np.array([-d[1], d[0]])
    rims = [_on_circle(p, radius, corners) for p in (a, b)]
    ends = [np.rint(p + s * side) for p in (a, b) for s in (-1.0, 1.0)]
    return shapely.MultiPoint(np.vstack([*rims, *ends])).convex_hull


def _bridges(problem: Problem, shapes: Sequence[Any]) -> list[list[int]]:
    return []


def _thin_box(bridge: Sequence[int], problem: Problem) -> Any: ...

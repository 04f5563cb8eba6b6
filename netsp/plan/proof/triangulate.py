"""Triangulation of free space on a grid, with circles replaced by inscribed polygons."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp_check.problem_file import Obstacle, Problem, Refused
from netsp_check.triangulation import RESOLUTION

SLIVER = 2.5
"""Tolerance: half the width of the strip that closes a gap, in grid units; rounding may add 1."""

INSET = 4.0
"""Tolerance: grid units by which polygons stay inside obstacles, despite rounding."""


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

    Raises
    ------
    Refused
        The free space about the base is too narrow for the grid.
    """
    import shapely

    delta = float(problem.size) / RESOLUTION
    box = _box(problem)
    near = [o for o in problem.obstacles if box is None or _is_within(o, box)]
    shapes = _inner_shapes(near, corners, delta)
    if box is None:
        assert problem.bounds is not None
        shapes += _walls([float(v) for v in problem.bounds])
    bridges = _bridges(shapes, delta)
    slivers = [shapely.LineString(np.reshape(b, (2, 2))).buffer(SLIVER, 1) for b in bridges]
    solid = shapely.union_all([*shapes, *slivers], grid_size=1.0)
    places = [shapely.Point(round(x), round(y)) for x, y in problem.places]
    holes = shapely.union_all([p.buffer(2.0 * delta, 2) for p in places], grid_size=1.0)
    solid = shapely.difference(solid, holes, grid_size=1.0)
    frame = box if box is not None else shapely.bounds(shapely.union_all(shapes)).tolist()
    free = shapely.difference(shapely.box(*frame), solid, grid_size=1.0)
    parts = [g for g in shapely.get_parts(free) if g.geom_type == "Polygon"]
    base = next((g for g in parts if g.intersects(places[0])), None)
    if base is None:
        raise Refused("the free space about the base is narrower than the grid")
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
    # the size counts heights, too: a goal may be straight below the base
    room = 0.01 * max(high[0] - low[0], high[1] - low[1], float(problem.size))
    box = [math.floor(v - room) for v in low] + [math.ceil(v + room) for v in high]
    if problem.bounds is not None:
        x0, y0, x1, y1 = problem.bounds
        if not (x0 <= box[0] and y0 <= box[1] and box[2] <= x1 and box[3] <= y1):
            return None
    return box


def _is_within(o: Obstacle, box: Sequence[int]) -> bool:
    first, last = o.span()
    return all(box[i] <= first[i] and last[i] <= box[i + 2] for i in (0, 1))


def _walls(bounds: Sequence[float]) -> list[Any]:
    """Return four boxes that surround the bounds."""
    import shapely

    x0, y0, x1, y1 = (round(v) for v in bounds)
    # on the grid, and not within the bounds
    x0, y0 = x0 - (x0 > bounds[0]), y0 - (y0 > bounds[1])
    x1, y1 = x1 + (x1 < bounds[2]), y1 + (y1 < bounds[3])
    room = max(x1 - x0, y1 - y0)
    return [
        shapely.box(x0 - room, y0 - room, x0, y1 + room),
        shapely.box(x1, y0 - room, x1 + room, y1 + room),
        shapely.box(x0 - room, y0 - room, x1 + room, y0),
        shapely.box(x0 - room, y1, x1 + room, y1 + room),
    ]


def _inner_shapes(obstacles: Sequence[Obstacle], corners: int, delta: float) -> list[Any]:
    """Return polygons inside grown obstacles, with corners where obstacles touch or overlap."""
    import shapely

    plans = [np.array([[float(x), float(y)] for x, y in o.corners]) for o in obstacles]
    cores = [shapely.Polygon(p) if len(p) > 1 else shapely.Point(p[0]) for p in plans]
    growths = [float(o.growth) for o in obstacles]
    tree = shapely.STRtree(cores)
    facing: list[list[Floats]] = [[] for _ in obstacles]
    for i, core in enumerate(cores):
        reach = growths[i] + max(growths) + delta
        for j in tree.query(core.buffer(reach), predicate="intersects").tolist():
            near = shapely.shortest_line(core, cores[j])
            if j != i and near.length <= growths[i] + growths[j] + delta:
                a, b = shapely.get_coordinates(near)
                facing[i] += _contacts(a, b, growths[i], growths[j])
    return [
        _inner_shape(plan, growth - INSET, corners, contacts)
        for plan, growth, contacts in zip(plans, growths, facing, strict=True)
    ]


def _contacts(a: Floats, b: Floats, radius: float, other: float) -> list[Floats]:
    """Return the points of the rim about a that face b, and those where the rims cross."""
    distance = float(np.hypot(*(b - a)))
    if distance == 0.0:
        return []
    d = (b - a) / distance
    out = [a + radius * d]
    along = (distance**2 + radius**2 - other**2) / (2.0 * distance)
    if abs(along) < radius:
        across = math.sqrt(radius**2 - along**2) * np.array([-d[1], d[0]])
        out += [a + along * d + across, a + along * d - across]
    return out


def _inner_shape(plan: Floats, radius: float, corners: int, contacts: list[Floats]) -> Any:
    """Return a polygon inside a grown plan, whose corners are on its outline."""
    import shapely

    if len(plan) == 1:
        return shapely.MultiPoint(_on_circle(plan[0], radius, corners, contacts)).convex_hull
    core = shapely.Polygon(plan)
    if radius <= 0.0:
        return shapely.set_precision(core.buffer(-INSET, join_style="mitre"), 1.0)
    edges = zip(np.roll(plan, 1, axis=0), plan, strict=True)
    stadiums = [_stadium(a, b, radius, corners, contacts) for a, b in edges]
    return shapely.union_all([core, *stadiums], grid_size=1.0)


def _on_circle(center: Floats, radius: float, corners: int, contacts: list[Floats]) -> Floats:
    """Return grid points of a circle: evenly spaced ones, and those nearest to its contacts."""
    angle = 2.0 * np.pi * np.arange(corners) / corners
    rim = [np.column_stack([np.cos(angle), np.sin(angle)])]
    for p in contacts:
        d = float(np.hypot(*(p - center)))
        if abs(d - radius) < 2.0 * INSET + 1e-12 * radius:
            rim.append(((p - center) / d)[None])
    return np.asarray(np.rint(center + radius * np.vstack(rim)))


def _stadium(a: Floats, b: Floats, radius: float, corners: int, contacts: list[Floats]) -> Any:
    """Return the hull of two circles' corners, and of the ends of the tangents between."""
    import shapely

    d = (b - a) / np.hypot(*(b - a))
    side = radius * np.array([-d[1], d[0]])
    rims = [_on_circle(p, radius, corners, contacts) for p in (a, b)]
    ends = [np.rint(p + s * side) for p in (a, b) for s in (-1.0, 1.0)]
    return shapely.MultiPoint(np.vstack([*rims, *ends])).convex_hull


def _bridges(shapes: Sequence[Any], delta: float) -> list[list[int]]:
    """Return segments on the grid that close the gaps of at most δ between shapes."""
    import shapely

    out = []
    tree = shapely.STRtree(shapes)
    for i, shape in enumerate(shapes):
        near = tree.query(shape, predicate="dwithin", distance=0.9 * delta)
        for j in near[near > i].tolist():
            if shapely.intersection(shape, shapes[j]).area == 0.0:
                a, b = np.rint(shapely.get_coordinates(shapely.shortest_line(shape, shapes[j])))
                out.append([int(v) for v in (*a, *b)])
    return out

"""Obstacles as the judge sees them: a little smaller than they are, however thin they are.

A path may touch an obstacle, and rounding may put it a hair inside. So what must not be entered is
an *inset* obstacle: each circle's radius, and each corner of a polygon, is drawn in by the judge's
tolerance, or by a fifth of the room that there is at that place, if that is less. A wall thinner
than the tolerance keeps three fifths of its thickness, so nothing passes through it. Where two
obstacles touch, their insets do not, and a *bridge* shuts the gap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from netsp.arrays import Floats, Ints
from netsp.geometry.polygons import counterclockwise
from netsp.problem import Circle, Polygon, Problem

SHARE = 0.2
"""Of the room at a corner, or of a radius, the part that an inset may take."""

SIDES, SIDES_AT_CORNER = 64, 32
"""Edges of the polygon that stands in for a circle, and for the whole circle that a clearance would
draw around a corner. They decide which way a path goes round; lengths come from the disks."""

NO_ROOM = 10.0
"""In tolerances: with less clearance a polygon is not grown, for its rounded corners would be of
rounding themselves."""

PHASE = 0.2371
"""Of a side: a phase no drawing has, so that symmetric worlds give no degenerate triangles."""


@dataclass(frozen=True)
class Inset:
    """One obstacle, smaller by the tolerance, relative to an origin.

    Attributes
    ----------
    shape
        What a path must not enter (of a circle, an inscribed polygon).
    ring
        (k, 2) its corners, each of which stands on the disk `owner` (k,) of `disks` (d, 3), x, y,
        radius: the disks that a taut path may bend around.
    depth
        How far a path may reach into the obstacle.
    """

    shape: shapely.Polygon
    ring: Floats
    owner: Ints
    disks: Floats
    depth: float


def inset(problem: Problem, obstacle: Circle | Polygon, place: float, origin: Floats) -> Inset:
    """An obstacle, grown by the clearance, drawn in by a tolerance."""
    c = problem.clearance
    if isinstance(obstacle, Circle):
        radius = obstacle.radius + c
        by = min(place, SHARE * radius)
        centre = np.array(obstacle.center) - origin
        ring = centre + (radius - by) * _unit_ring()
        disks = np.array([[*centre, radius]])
        owner = np.zeros(len(ring), dtype=np.int64)
        return Inset(shapely.Polygon(ring), ring, owner, disks, by)
    v = counterclockwise(np.array(obstacle.polygon) - origin)
    disks = np.column_stack([v, np.full(len(v), c)])
    if c <= NO_ROOM * place:
        back = np.minimum(place, SHARE * room(v))
        shape = shapely.Polygon(v + back[:, None] * _inward(v))
        if not shape.is_valid:  # needles of rounding: better too strict than blind
            shape = shapely.Polygon(v)
        ring = shapely.get_coordinates(shape)[:-1]
        by = min(place, SHARE * c) if c else float(back.max())
        return Inset(shape, ring, np.arange(len(v)), disks, by)
    by = min(place, SHARE * c)
    shape = shapely.Polygon(v).buffer(c - by, quad_segs=SIDES_AT_CORNER // 4)
    ring = shapely.get_coordinates(shape.exterior)[:-1]
    away = np.hypot(ring[:, None, 0] - v[None, :, 0], ring[:, None, 1] - v[None, :, 1])
    return Inset(shapely.Polygon(ring), ring, np.argmin(away, axis=1), disks, by)


def room(v: Floats) -> Floats:
    """(k,) at each corner of a polygon, how near its two edges come to any other part of it."""
    k = len(v)
    w = np.roll(v, -1, axis=0)
    edges = shapely.linestrings(np.stack([v, w], axis=1))
    corners = shapely.points(v)
    far = shapely.distance(edges[:, None], corners[None, :])
    i = np.arange(k)
    far[i, i] = far[i, (i + 1) % k] = np.inf  # the ends of an edge are its own
    of_edge = far.min(axis=1)
    of_corner = far.min(axis=0)
    return np.asarray(np.minimum(np.minimum(of_edge, np.roll(of_edge, 1)), of_corner))


def _inward(v: Floats) -> Floats:
    """(k, 2) unit vectors into a counter-clockwise polygon along the bisectors of its corners."""
    ahead = np.roll(v, -1, axis=0) - v
    ahead /= np.hypot(*ahead.T)[:, None]
    behind = np.roll(ahead, 1, axis=0)
    left = np.column_stack([-ahead[:, 1] - behind[:, 1], ahead[:, 0] + behind[:, 0]])
    size = np.hypot(*left.T)
    # a corner that turns right back has no sum of normals: there it is behind the tip
    out = np.where(size[:, None] > 1e-6, left / np.maximum(size, 1e-300)[:, None], ahead - behind)
    return np.asarray(out / np.maximum(np.hypot(*out.T), 1e-300)[:, None])


def bridges(problem: Problem, insets: list[Inset], gap: float) -> list[tuple[int, int, Floats]]:
    """Pairs of obstacles that touch, to within a gap, with the (2, 2) segment between their insets
    that no path may cross."""
    if len(insets) < 2:
        return []
    shapes = np.array([s.shape for s in insets])
    # a circle's polygon stands back from it by its sagitta, whichever obstacle it is
    back = [s.depth + _sagitta(s) for s in insets]
    pairs = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=gap + 2 * max(back))
    out = []
    for i, j in sorted({(min(a, b), max(a, b)) for a, b in pairs.T.tolist() if a != b}):
        if shapes[i].intersects(shapes[j]):
            continue
        if _apart(problem, i, j) > gap:
            continue
        ends = shapely.get_coordinates(shapely.shortest_line(shapes[i], shapes[j]))
        if all(isinstance(problem.obstacles[k], Circle) for k in (i, j)):
            ends = np.array([insets[i].disks[0, :2], insets[j].disks[0, :2]])
        out.append((i, j, ends))
    return out


def _sagitta(solid: Inset) -> float:
    return float(solid.disks[:, 2].max() * (1.0 - np.cos(np.pi / SIDES)))


def _apart(problem: Problem, i: int, j: int) -> float:
    """How far two grown obstacles are from each other."""
    a, b = problem.obstacles[i], problem.obstacles[j]
    if isinstance(a, Circle) and isinstance(b, Circle):
        d = float(np.hypot(*(np.array(a.center) - b.center))) - a.radius - b.radius
    elif isinstance(a, Polygon) and isinstance(b, Polygon):
        d = float(shapely.Polygon(a.polygon).distance(shapely.Polygon(b.polygon)))
    else:
        circle, other = (a, b) if isinstance(a, Circle) else (b, a)
        assert isinstance(circle, Circle)
        assert isinstance(other, Polygon)
        d = float(other.signed_distance(np.array([circle.center]))[0]) - circle.radius
    return d - 2.0 * problem.clearance


def _unit_ring() -> Floats:
    angle = 2.0 * np.pi * (np.arange(SIDES) + PHASE) / SIDES
    return np.column_stack([np.cos(angle), np.sin(angle)])

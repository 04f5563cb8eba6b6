"""Obstacles of the judge: slightly smaller than in the problem.

A path may touch an obstacle, and rounding may put it slightly inside. So the judge forbids only the
*inset* of an obstacle: the radius of a circle, and each corner of a polygon, is moved inwards by
the judge's tolerance, or by a fifth of the room there if that is less. A wall thinner than the
tolerance keeps three fifths of its thickness, so no path passes through it. The insets of two
obstacles that touch are apart, and a *bridge* closes the gap between them. A path may reach the
contact of two obstacles, but not pass from one side of it to the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from netsp.base.arrays import Floats, Ints
from netsp.base.geometry.polygons import counterclockwise
from netsp.judge.judge_policy import JudgePolicy
from netsp.model.problem import Circle, Polygon, Problem

TOUCHING_TOLERANCE = 2e-10
"""Tolerance of the gap between obstacles that touch, as a share of the problem's size. Theory
assumes obstacles that are grown by half of this gap."""

Outline = tuple[shapely.Geometry, float]
"""Outline of an obstacle: a polygon and 0, or the centre and radius of a circle."""


@dataclass(frozen=True)
class Inset:
    """Obstacle that is smaller by the tolerance, in coordinates relative to an origin.

    Attributes
    ----------
    shape
        Polygon that a path must not enter; it is inscribed in a circle.
    ring
        (k, 2) corners of the polygon.
    owner
        (k,) row in `disks` of the disk that each corner lies on.
    disks
        (d, 3) x, y, radius of the disks that a taut path may bend around.
    depth
        Depth by which a path may enter the obstacle.
    """

    shape: shapely.Polygon
    ring: Floats
    owner: Ints
    disks: Floats
    depth: float


def inset(
    problem: Problem,
    obstacle: Circle | Polygon,
    place: float,
    origin: Floats,
    policy: JudgePolicy = JudgePolicy(),
) -> Inset:
    """Return the inset of an obstacle: grown by the clearance, and smaller by the tolerance
    `place`."""
    c, share = problem.clearance, policy.max_inset_share
    if isinstance(obstacle, Circle):
        radius = obstacle.radius + c
        by = min(place, share * radius)
        centre = np.array(obstacle.center) - origin
        ring = centre + (radius - by) * _unit_ring(policy)
        disks = np.array([[*centre, radius]])
        owner = np.zeros(len(ring), dtype=np.int64)
        return Inset(shapely.Polygon(ring), ring, owner, disks, by)
    v = counterclockwise(np.array(obstacle.polygon) - origin)
    disks = np.column_stack([v, np.full(len(v), c)])
    if c <= policy.min_clearance_ratio * place:
        offset = np.minimum(place, share * room(v, place / share))
        shape = shapely.Polygon(v + offset[:, None] * _inward(v))
        if not shape.is_valid:  # needles from rounding: the full polygon is stricter
            shape = shapely.Polygon(v)
        ring = shapely.get_coordinates(shape)[:-1]
        by = min(place, share * c) if c else float(offset.max())
        return Inset(shape, ring, np.arange(len(v)), disks, by)
    by = min(place, share * c)
    shape = shapely.Polygon(v).buffer(c - by, quad_segs=policy.corner_sides // 4)
    ring = shapely.get_coordinates(shape.exterior)[:-1]
    return Inset(shapely.Polygon(ring), ring, _nearest(v, ring), disks, by)


def _nearest(v: Floats, ring: Floats) -> Ints:
    """Return the index of the corner nearest to each point of a ring; ties take the first."""
    from scipy.spatial import cKDTree

    away, index = cKDTree(v).query(ring, k=2)
    index = np.where((away[:, 0] == away[:, 1])[:, None], np.sort(index, axis=1), index)
    return np.asarray(index[:, 0], dtype=np.int64)


def room(v: Floats, limit: float) -> Floats:
    """Return, for each corner (k, 2), the distance from its edges to the rest of the polygon.

    Parameters
    ----------
    limit : float
        Distances above the limit may be returned as infinite, which saves measuring all pairs.
    """
    k = len(v)
    edges = shapely.linestrings(np.stack([v, np.roll(v, -1, axis=0)], axis=1))
    corners = shapely.points(v)
    edge, corner = shapely.STRtree(corners).query(edges, predicate="dwithin", distance=limit)
    other = (corner != edge) & (corner != (edge + 1) % k)  # an edge touches its own ends
    edge, corner = edge[other], corner[other]
    far = shapely.distance(edges[edge], corners[corner])
    by_edge, by_corner = np.full(k, np.inf), np.full(k, np.inf)
    np.minimum.at(by_edge, edge, far)
    np.minimum.at(by_corner, corner, far)
    return np.asarray(np.minimum(np.minimum(by_edge, np.roll(by_edge, 1)), by_corner))


def _inward(v: Floats) -> Floats:
    """Return unit vectors (k, 2) into a counter-clockwise polygon along its corners' bisectors."""
    ahead = np.roll(v, -1, axis=0) - v
    ahead /= np.hypot(*ahead.T)[:, None]
    behind = np.roll(ahead, 1, axis=0)
    left = np.column_stack([-ahead[:, 1] - behind[:, 1], ahead[:, 0] + behind[:, 0]])
    size = np.hypot(*left.T)
    # where the outline turns by 180 degrees the normals cancel: point away from the tip
    out = np.where(size[:, None] > 1e-6, left / np.maximum(size, 1e-300)[:, None], ahead - behind)
    return np.asarray(out / np.maximum(np.hypot(*out.T), 1e-300)[:, None])


@dataclass(frozen=True)
class Bridge:
    """Contact of two obstacles, and the line that closes the gap between their insets.

    Attributes
    ----------
    first, second
        Indices of the obstacles.
    contact
        Point (2,) where they touch.
    line
        Polyline (k, 2) from inside one inset, through the contact, to inside the other.
    """

    first: int
    second: int
    contact: Floats
    line: Floats


def bridges(problem: Problem, insets: list[Inset], origin: Floats, place: float) -> list[Bridge]:
    """Return the bridges between obstacles that touch when grown by the clearance.

    Two obstacles may touch in several places. Insets that touch need no bridge.
    """
    if len(insets) < 2:
        return []
    outlines = [_outline(o, origin) for o in problem.obstacles]
    shapes = np.array([o if isinstance(o, shapely.Polygon) else o.buffer(r) for o, r in outlines])
    reach = 2.0 * problem.clearance + TOUCHING_TOLERANCE * problem.scale + 2.0 * place
    # distance between a circle and the polygon that stands for it
    gap = max(r for _, r in outlines) * (1.0 - np.cos(np.pi / 32.0))
    pairs = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=reach + 2.0 * gap)

    def _inside(i: int, point: Floats) -> Floats:
        """Return a point of the inset that a straight line within the obstacle joins to `point`."""
        outline, radius = outlines[i]
        if radius:
            return np.asarray(shapely.get_coordinates(outline)[0])
        line = shapely.shortest_line(shapely.Point(point), insets[i].shape)
        return np.asarray(shapely.get_coordinates(line)[-1])

    out = []
    for i, j in sorted({(min(a, b), max(a, b)) for a, b in pairs.T.tolist() if a != b}):
        for one, other in _contacts(problem, outlines[i], outlines[j], insets[i], insets[j], place):
            line = [_inside(i, one), one, other, _inside(j, other)]
            out.append(Bridge(i, j, 0.5 * (one + other), np.array(line)))
    return out


def _outline(obstacle: Circle | Polygon, origin: Floats) -> Outline:
    if isinstance(obstacle, Circle):
        return shapely.Point(np.array(obstacle.center) - origin), obstacle.radius
    return shapely.Polygon(np.array(obstacle.polygon) - origin), 0.0


def _contacts(
    problem: Problem, a: Outline, b: Outline, inset_a: Inset, inset_b: Inset, place: float
) -> list[tuple[Floats, Floats]]:
    """Return the contacts of two obstacles, each as a pair of points (2,), one on each obstacle."""
    gap = 2.0 * problem.clearance + TOUCHING_TOLERANCE * problem.scale
    (one, r), (other, q) = a, b
    if r and q:
        p, c = shapely.get_coordinates([one, other])
        far = float(np.hypot(*(c - p)))
        if far - r - q > gap or far <= abs(r - q):  # apart, or one within the other
            return []
        return [(p + r / far * (c - p), c + q / far * (p - c))]
    if r or q:
        circle, polygon, radius = (one, other, r) if r else (other, one, q)
        pairs = _contacts_with_circle(circle, radius, polygon, gap, place)
        return [(rim, foot) if r else (foot, rim) for rim, foot in pairs]
    return _contacts_of_polygons(one, other, inset_a, inset_b, gap, place)


def _contacts_with_circle(
    circle: shapely.Geometry, radius: float, polygon: shapely.Geometry, gap: float, place: float
) -> list[tuple[Floats, Floats]]:
    """Return the contacts of a circle and a polygon as pairs of points, on circle and polygon."""
    centre = shapely.get_coordinates(circle)[0]
    v = shapely.get_coordinates(polygon)
    step = np.diff(v, axis=0)
    along = ((centre - v[:-1]) * step).sum(1) / np.maximum((step * step).sum(1), 1e-300)
    feet = v[:-1] + np.clip(along, 0.0, 1.0)[:, None] * step
    far = np.hypot(*(feet - centre).T)
    # at a greater depth the insets overlap, too
    touched = (far - radius <= gap) & (far - radius >= -4.0 * place)
    out = []
    for foot in np.unique(feet[touched], axis=0):
        rim = centre + radius / np.hypot(*(foot - centre)) * (foot - centre)
        out.append((rim, foot))
    return out


def _contacts_of_polygons(
    one: shapely.Geometry,
    other: shapely.Geometry,
    inset_one: Inset,
    inset_other: Inset,
    gap: float,
    place: float,
) -> list[tuple[Floats, Floats]]:
    """Return a contact of two polygons, a pair of points, in each region near both polygons."""
    if one.distance(other) > gap:
        return []
    near = 0.5 * gap + place
    closed = inset_one.shape.intersection(inset_other.shape)
    out = []
    for part in shapely.get_parts(one.buffer(near).intersection(other.buffer(near))):
        if part.intersects(closed):
            continue
        region = part.buffer(place)
        p, c = one.intersection(region), other.intersection(region)
        if not p.is_empty and not c.is_empty and p.distance(c) <= gap:
            ends = shapely.get_coordinates(shapely.shortest_line(p, c))
            out.append((ends[0], ends[1]))
    return out


def _unit_ring(policy: JudgePolicy) -> Floats:
    sides = policy.circle_sides
    angle = 2.0 * np.pi * (np.arange(sides) + policy.phase) / sides
    return np.column_stack([np.cos(angle), np.sin(angle)])

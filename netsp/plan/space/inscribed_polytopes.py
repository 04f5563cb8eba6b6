"""Convex polytopes inside of solids that are grown by the robot's room.

A path that keeps its room from the solids stays out of these polytopes, and the shortest path
around them bends on their edges only (docs/theory, Section 21). Round parts are replaced by
polygons inside of them. Solids without a polytope are left out, which only shortens paths.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.plan.space.cross_sections import solid_rows
from netsp.plan.space.mission_policy import EdgePolicy
from netsp.world.scene import solids
from netsp.world.scene.field import DistanceField

FLAT_TOLERANCE = 1e-12
"""Tolerance for faces: two triangles are one face if the cosine of the angle between their normals
differs from one by less."""


OVERLAP = 0.1
"""Format of the pieces of a ring: the overlap of neighbours, as a share of their spacing."""


class Polytopes(NamedTuple):
    """Convex polytopes, their edges, and half-spaces that hold all paths.

    Attributes
    ----------
    normals, offsets
        (f, 3) outward unit normals n of all faces, and (f,) their offsets o: the points x of a
        polytope have n·x <= o.
    first
        (p + 1,) number of the first face of each polytope, and the number of faces.
    centres, radii
        (p, 3) centres and (p,) radii of balls around the polytopes, metres.
    begins, ends
        (e, 3) ends of the edges, metres.
    faces
        (e, 2) faces on both sides of each edge.
    walls
        (w, 4) half-spaces n·x >= o that hold all paths: n and o.
    is_complete
        Whether every solid of the scene has a polytope or is a wall.
    """

    normals: Floats
    offsets: Floats
    first: Ints
    centres: Floats
    radii: Floats
    begins: Floats
    ends: Floats
    faces: Ints
    walls: Floats
    is_complete: bool

    def nearest(self, a: Floats, b: Floats, max_edges: int) -> Polytopes:
        """Return the polytopes nearest to a segment that have at most `max_edges` edges in all.

        Parameters
        ----------
        a, b : ndarray of shape (3,)
            Ends of the segment, metres.
        max_edges : int
            Maximum number of edges.
        """
        if len(self.begins) <= max_edges:
            return self
        owner = np.searchsorted(self.first, self.faces[:, 0], side="right") - 1
        middles = 0.5 * (self.begins + self.ends)
        around = np.linalg.norm(middles - a, axis=1) + np.linalg.norm(middles - b, axis=1)
        order = np.lexsort((np.arange(len(owner)), around))
        closest = np.full(len(self.radii), np.inf)
        np.minimum.at(closest, owner[order], around[order])
        count = np.bincount(owner, minlength=len(closest))
        ranked = np.argsort(closest, kind="stable")
        chosen = np.sort(ranked[np.cumsum(count[ranked]) <= max_edges])
        sizes = np.diff(self.first)
        kept = np.isin(np.repeat(np.arange(len(sizes)), sizes), chosen)
        number = np.cumsum(kept) - 1
        on = np.isin(owner, chosen)
        return Polytopes(
            self.normals[kept],
            self.offsets[kept],
            np.concatenate([[0], np.cumsum(sizes[chosen])]).astype(np.int64),
            self.centres[chosen],
            self.radii[chosen],
            self.begins[on],
            self.ends[on],
            number[self.faces[on]],
            self.walls,
            False,
        )


def inscribed_polytopes(
    field: DistanceField, room: float, box: Floats, policy: EdgePolicy
) -> Polytopes:
    """Return polytopes none of whose inner points is as far from the solids as the room.

    Capsules, cylinders, boxes, tori, posts and convex prisms have polytopes. Half-spaces are walls.
    Other solids are left out.

    Parameters
    ----------
    room : float
        Least distance of paths from solids, metres; negative if paths may enter them.
    box : ndarray of shape (2, 3)
        Corners of a box that holds all paths, metres; posts and prisms end there.
    policy : EdgePolicy
        Number of sides of round solids.

    Returns
    -------
    Polytopes
        No polytopes if there are no solids that have one.

    Examples
    --------
    >>> import numpy as np
    >>> from netsp.world import Scene
    >>> solids = [{"box": {"center": [0, 0, 0], "size": [2, 2, 2]}}]
    >>> box = np.array([[-5.0] * 3, [5.0] * 3])
    >>> found = inscribed_polytopes(Scene(solids=solids).field(), 0.0, box, EdgePolicy())
    >>> len(found.offsets), len(found.begins)
    (6, 12)
    """
    walls, hulls = list[list[float]](), list[_Hull]()
    offset, is_complete = float(field.arrays.offset), field.voxel is None
    for kind, row in solid_rows(field):
        if kind == solids.HALF_SPACE:
            walls.append([*row[3:6], float(row[:3] @ row[3:6]) + offset + room])
            continue
        shapes = _shapes(kind, row, field.arrays.data, offset + room, box, policy)
        found = [hull for points in shapes if (hull := _hull(points)) is not None]
        is_complete = is_complete and bool(found)
        hulls += found
    return _packed(hulls, np.array(walls).reshape(-1, 4), is_complete)


def _shapes(
    kind: int, row: Floats, data: Floats, growth: float, box: Floats, policy: EdgePolicy
) -> Iterator[Floats]:
    """Yield points (n, 3) of a grown solid; the hull of each set lies within it."""
    sides = policy.sides
    if kind == solids.CAPSULE:
        if row[6] + growth > 0.0:
            yield _round_bar(row[:3], row[3:6], float(row[6]) + growth, sides)
    elif kind == solids.CYLINDER:
        yield from _cylinder(row, growth, sides)
    elif kind == solids.BOX:
        yield from _box(row, growth, sides)
    elif kind == solids.TORUS:
        yield from _torus(row, growth, sides)
    elif kind == solids.POST:
        if row[2] + growth > 0.0:
            circle = _circle(sides) * (row[2] + growth) + row[:2]
            yield _between_levels(circle, box)
    elif kind == solids.PRISM:
        corners = data[int(row[0]) : int(row[1])].reshape(-1, 2)
        grown = growth + float(row[2])
        if grown >= 0.0 and _is_convex(corners):
            circle = _circle(sides) * grown
            yield _between_levels((corners[:, None] + circle[None]).reshape(-1, 2), box)


def _circle(sides: int) -> Floats:
    """Return the corners (sides, 2) of a regular polygon in the unit circle."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _between_levels(outline: Floats, box: Floats) -> Floats:
    """Return points of an upright prism between the levels of a box."""
    levels = [np.column_stack([outline, np.full(len(outline), z)]) for z in box[:, 2]]
    return np.vstack(levels)


def _is_convex(corners: Floats) -> bool:
    """Return whether a polygon (n, 2) is convex."""
    edges = np.roll(corners, -1, axis=0) - corners
    after = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]
    return bool((turns >= 0.0).all() or (turns <= 0.0).all())


def _frame(axis: Floats) -> Floats:
    """Return two unit vectors (2, 3) perpendicular to a unit vector and to one another."""
    other = np.eye(3)[int(np.abs(axis).argmin())]
    side = np.cross(axis, other)
    side /= np.linalg.norm(side)
    return np.array([side, np.cross(axis, side)])


def _round_bar(a: Floats, b: Floats, radius: float, sides: int) -> Floats:
    """Return points of a capsule: two rings at each end of its axis, and its two tips."""
    length = float(np.linalg.norm(b - a))
    axis = (b - a) / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    circle = radius * _circle(sides) @ _frame(axis)
    half = math.sqrt(0.5)
    cap = half * circle + half * radius * axis
    far_cap, tips = a + cap - 2.0 * half * radius * axis, [b + radius * axis, a - radius * axis]
    return np.vstack([a + circle, b + circle, b + cap, far_cap, tips])


def _cylinder(row: Floats, growth: float, sides: int) -> Iterator[Floats]:
    """Yield the points of a cylinder with flat ends, whose rims are rounded by the growth."""
    radius, length, axis = float(row[6]), float(row[7]), row[3:6]
    inset, rounded = min(0.0, growth), max(0.0, growth)
    if radius + inset <= 0.0 or length + 2.0 * inset <= 0.0:
        return
    circle = _circle(sides) @ _frame(axis)
    quarter = _quarter(sides)
    rings = []
    for base, sign in ((row[:3] - inset * axis, -1.0), (row[:3] + (length + inset) * axis, 1.0)):
        for out, up in quarter * rounded:
            rings.append(base + (radius + inset + out) * circle + sign * up * axis)
    yield np.vstack(rings)


def _quarter(sides: int) -> Floats:
    """Return points (n, 2) of a quarter of the unit circle, with both ends."""
    angle = np.linspace(0.0, 0.5 * np.pi, max(2, sides // 4 + 1))
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    out[0], out[-1] = (1.0, 0.0), (0.0, 1.0)
    return out


def _torus(row: Floats, growth: float, sides: int) -> Iterator[Floats]:
    """Yield the points of pieces of a torus, or of the part of one about an arc.

    Each piece is the hull of two polygons in planes through the axis. The centres lie outside of
    the arc by the distance by which the middle of their chord lies inside of it, or by more, and
    the radii are less by the same distance; so the hull lies within the torus. Neighbours overlap,
    so that no path slips through between them. There are enough pieces that chords lose no more of
    the radius than the sides of the polygons do.
    """
    axis, start, bend, angle = row[3:6], row[6:9], float(row[9]), float(row[11])
    radius = float(row[10]) + growth
    if radius <= 0.0:
        return
    loss = radius * (1.0 - math.cos(math.pi / sides))
    longest = min(math.pi, 4.0 * math.atan(math.sqrt(loss / bend)))
    count = max(1, math.ceil((1.0 + OVERLAP) * angle / longest))
    step, is_closed = angle / count, angle >= 2.0 * math.pi * (1.0 - 1e-12)
    outside = bend * math.tan(0.25 * (1.0 + OVERLAP) * step) ** 2
    polygon, other = (radius - outside) * _circle(sides), np.cross(axis, start)
    for k in range(count):
        extended = 0.5 * OVERLAP * step
        ends = [k * step - extended, (k + 1) * step + extended]
        if not is_closed:
            ends = [max(0.0, ends[0]), min(angle, ends[1])]
        rings = []
        for at in ends:
            away = math.cos(at) * start + math.sin(at) * other
            rings.append((bend + outside + polygon[:, :1]) * away + polygon[:, 1:] * axis)
        yield row[:3] + np.vstack(rings)


def _box(row: Floats, growth: float, sides: int) -> Iterator[Floats]:
    """Yield the points of a box, whose edges are rounded by the growth."""
    axes = row[6:15].reshape(3, 3)
    halves = row[3:6] + min(0.0, growth)
    if (halves <= 0.0).any():
        return
    rounded = max(0.0, growth)
    corners = np.array(list(product((-1.0, 1.0), repeat=3)))
    if rounded == 0.0:
        yield row[:3] + (corners * halves) @ axes
        return
    directions = []
    for k in range(3):
        for u, v in _quarter(sides):
            d = np.zeros(3)
            d[k], d[(k + 1) % 3] = u, v
            directions.append(d)
    octant = np.unique(np.array(directions), axis=0)
    points = corners[:, None] * (halves + rounded * octant[None])
    yield row[:3] + points.reshape(-1, 3) @ axes


class _Hull(NamedTuple):
    """Faces and edges of one polytope, as in `Polytopes`; faces are numbered from 0."""

    normals: Floats
    offsets: Floats
    points: Floats
    begins: Floats
    ends: Floats
    faces: Ints


def _hull(points: Floats) -> _Hull | None:
    """Return the convex hull of points (n, 3); None if it is flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        return None
    face = np.arange(len(hull.simplices))
    normals = hull.equations[:, :3]
    crossed = []
    for k, neighbours in enumerate(hull.neighbors):
        for m, other in enumerate(neighbours):
            if other > k:
                p, q = np.delete(hull.simplices[k], m)
                if normals[k] @ normals[other] > 1.0 - FLAT_TOLERANCE:
                    _unite(face, k, int(other))
                else:
                    crossed.append((p, q, k, other))
    face = np.array([_root(face, k) for k in range(len(face))])
    kept, number = np.unique(face, return_inverse=True)
    edges = np.array(crossed, dtype=np.int64).reshape(-1, 4)
    return _Hull(
        normals[kept],
        (normals[kept] @ points.T).max(axis=1),
        points[hull.vertices],
        points[edges[:, 0]],
        points[edges[:, 1]],
        number[edges[:, 2:]],
    )


def _root(face: Ints, k: int) -> int:
    """Return the first of the triangles that are one face with triangle k."""
    while face[k] != k:
        k = int(face[k])
    return k


def _unite(face: Ints, k: int, other: int) -> None:
    """Make the faces of two triangles one."""
    a, b = _root(face, k), _root(face, other)
    face[max(a, b)] = min(a, b)


def _packed(hulls: list[_Hull], walls: Floats, is_complete: bool) -> Polytopes:
    """Return several polytopes in common arrays."""
    first: Ints = np.cumsum([0, *(len(h.offsets) for h in hulls)])
    centres = np.array([0.5 * (h.points.min(0) + h.points.max(0)) for h in hulls]).reshape(-1, 3)
    radii = [
        np.linalg.norm(h.points - c, axis=1).max() for h, c in zip(hulls, centres, strict=True)
    ]
    none = np.zeros((0, 3))
    return Polytopes(
        np.vstack([none, *(h.normals for h in hulls)]),
        np.concatenate([np.zeros(0), *(h.offsets for h in hulls)]),
        first.astype(np.int64),
        centres,
        np.array(radii, dtype=float),
        np.vstack([none, *(h.begins for h in hulls)]),
        np.vstack([none, *(h.ends for h in hulls)]),
        np.vstack(
            [
                np.zeros((0, 2), dtype=np.int64),
                *(h.faces + n for h, n in zip(hulls, first, strict=False)),
            ]
        ).astype(np.int64),
        walls,
        is_complete,
    )

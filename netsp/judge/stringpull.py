"""String pulling: taut lengths within a homotopy class, by triangulation and the funnel algorithm.

The method shares nothing with the roadmaps. Circles become inscribed polygons, and free space is
triangulated. A path crosses a sequence of triangle edges. Removing edges that are crossed back at
once gives the *reduced* sequence, which identifies the homotopy class. The funnel algorithm finds
the shortest path through a sequence of edges (Lee & Preparata 1984; Chazelle 1982; Hershberger &
Snoeyink 1994). Its corners show which disks the taut path touches, and thus give the exact length
(`netsp.judge.chain`).

Degenerate positions need no special case, because orientations are exact
(`netsp.judge.orientation`). If a point of a path lies on the line of an edge, or a segment runs
through the end of an edge, sides are those of the path shifted by (-δ², δ) for an infinitesimal
δ > 0 (Edelsbrunner & Mücke 1990, "Simulation of simplicity"). The shifted path is in general
position, so the edges that it crosses are a walk from triangle to triangle, and the reversed path
takes the reversed walk. Start and end of a path lie in the closed first and last triangle of its
walk, as the funnel algorithm requires.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.geometry.polygons import box_around
from netsp.judge.chain import contacts_of, exact_length
from netsp.judge.judge_policy import JudgePolicy
from netsp.judge.orientation import Point, orientation, orientations
from netsp.judge.solid_distances import inset
from netsp.model.problem import Problem

PLACE_TOLERANCE = 1e-7
"""Tolerance of positions, as a share of the problem's size: distance by which a path may miss a
goal, and depth to which it may enter an obstacle."""


@dataclass(frozen=True)
class Pulled:
    """Length of a taut path in plan, as two bounds.

    The bounds are equal if the contacts with the disks were found.

    Attributes
    ----------
    low
        Lower bound: the length around inscribed polygons.
    high
        Estimated upper bound: the lower bound and an allowance at each bend for the distance
        between polygon and circle.
    turning
        Total angle by which the path turns, radians; a lower bound if contacts were not found.
    """

    low: float
    high: float
    turning: float


class StringPuller:
    """Triangulated free space of a problem's plan.

    Parameters
    ----------
    reach
        Distance around base, goals and obstacles that the triangles cover, in the problem's units.
    place
        Tolerance of positions, in the problem's units.
    path
        Points (n, 2 or more) that the triangles must also cover.
    policy
        Polygons that stand for circles, and the search for contacts.
    """

    def __init__(
        self,
        problem: Problem,
        reach: float,
        place: float | None = None,
        path: Floats | None = None,
        policy: JudgePolicy = JudgePolicy(),
    ) -> None:
        self.problem, self.policy = problem, policy
        self.place = PLACE_TOLERANCE * problem.scale if place is None else place
        self.origin = np.array(problem.base[:2])
        self.solids = [
            inset(problem, o, self.place, self.origin, policy) for o in problem.obstacles
        ]
        shapes = [s.shape for s in self.solids]
        disks = [s.disks for s in self.solids]
        self.disks: Floats = np.vstack(disks) if disks else np.zeros((0, 3))
        self._disk_at = {
            (float(x), float(y)): tuple(s.disks[k].tolist())
            for s in self.solids
            for (x, y), k in zip(s.ring, s.owner, strict=True)
        }
        sagitta = 1.0 - math.cos(math.pi / policy.circle_sides)
        # largest distance by which a disk exceeds its polygon
        self.max_excess = max(
            (float(s.disks[:, 2].max()) * sagitta + s.depth for s in self.solids), default=0.0
        )
        triangles = shapely.get_parts(
            shapely.constrained_delaunay_triangles(self._free(reach, path, shapes))
        )
        self._edges, self._triangles = _interior_edges(triangles)
        self._ends: list[tuple[Point, Point]] = [
            ((a, b), (c, d)) for a, b, c, d in self._edges.tolist()
        ]
        self._tree = shapely.STRtree(shapely.linestrings(self._edges.reshape(-1, 2, 2)))

    def _free(
        self, reach: float, path: Floats | None, shapes: list[shapely.Polygon]
    ) -> shapely.Geometry:
        """Return the free space: a box with the obstacles taken out."""
        problem = self.problem
        if problem.bounds is not None:
            bounds = np.array(problem.bounds) - np.tile(self.origin, 2)
            # twice the tolerance, so that no point of a path within bounds lies on the outline
            box = shapely.box(*bounds).buffer(2.0 * self.place, join_style="mitre")
        else:
            points = problem.points[:, :2]
            if path is not None:
                points = np.vstack([points, path[:, :2]])
            box = box_around([shapely.MultiPoint(points - self.origin), *shapes], 2.0 * reach)
        return box.difference(shapely.union_all(shapes)) if shapes else box

    def crossings(self, path: npt.ArrayLike) -> list[list[tuple[int, bool]]]:
        """Return the triangle edges that each segment of a polyline crosses, in order.

        A crossing is an edge and whether it is crossed from the left. The crossings of a path are
        those of its segments, one after the other.
        """
        xy = np.asarray(path, dtype=float)[:, :2] - self.origin
        out: list[list[tuple[int, bool]]] = [[] for _ in range(len(xy) - 1)]
        segments = shapely.linestrings(np.stack([xy[:-1], xy[1:]], axis=1))
        seg, edge = self._tree.query(segments, predicate=None)
        e = self._edges[edge]
        p, q, u, v = xy[seg], xy[seg + 1], e[:, :2], e[:, 2:]
        p_left, q_left = _left_of_edge(u, v, p), _left_of_edge(u, v, q)
        apart = p_left != q_left
        seg, edge, p_left = seg[apart], edge[apart], p_left[apart]
        p, q, u, v = p[apart], q[apart], u[apart], v[apart]
        hit = _left_of_segment(p, q, u) != _left_of_segment(p, q, v)
        seg, edge, p_left = seg[hit], edge[hit], p_left[hit]
        p, q, u, v = p[hit], q[hit], u[hit], v[hit]
        a, b = _cross(u, v, p), _cross(u, v, q)
        apart_by = np.where(a == b, 1.0, a - b)
        # rounding may swap crossings near the end of an edge; `_as_walk` restores the order
        order = np.lexsort((a / apart_by, seg))
        bounds = np.flatnonzero(np.diff(seg[order])) + 1
        for group in np.split(order, bounds) if len(order) else []:
            hits = list(zip(edge[group].tolist(), p_left[group].tolist(), strict=True))
            out[seg[group[0]]] = self._as_walk(hits) if len(hits) > 1 else hits
        return out

    def _as_walk(self, hits: list[tuple[int, bool]]) -> list[tuple[int, bool]]:
        """Return crossings so ordered that each leaves the triangle that the one before entered.

        A segment through an obstacle has several such runs; their order is kept.
        """
        enters = {self._to(h) for h in hits}
        leaves = {self._from(h): h for h in hits}
        walk: list[tuple[int, bool]] = []
        for first in hits:
            if self._from(first) in enters:
                continue
            step: tuple[int, bool] | None = first
            while step is not None:
                walk.append(step)
                step = leaves.pop(self._to(step), None)
        return walk

    def _from(self, crossing: tuple[int, bool]) -> int:
        edge, from_left = crossing
        return int(self._triangles[edge, 0 if from_left else 1])

    def _to(self, crossing: tuple[int, bool]) -> int:
        edge, from_left = crossing
        return int(self._triangles[edge, 1 if from_left else 0])

    def pull(
        self, start: npt.ArrayLike, end: npt.ArrayLike, sleeve: list[tuple[int, bool]]
    ) -> Pulled:
        """Return the taut length from start to end through a reduced sequence of edges."""
        a, b = (np.asarray(p, dtype=float)[:2] - self.origin for p in (start, end))
        portals = []
        for edge, from_left in sleeve:
            u, v = self._ends[edge]
            # seen by a path that crosses u→v from the left, v is on the left
            portals.append((v, u) if from_left else (u, v))
        corners = _funnel((float(a[0]), float(a[1])), (float(b[0]), float(b[1])), portals)
        inner = [(float(x), float(y)) for x, y in corners[1:-1]]
        contacts = contacts_of(corners, [self._disk_at.get(p, (*p, 0.0)) for p in inner])
        slack, max_changes = 1e-3 * self.place, self.policy.max_contact_changes
        exact = exact_length(a, b, contacts, self.disks, slack, max_changes)
        if exact is not None:
            return Pulled(exact[0], exact[0], exact[1])
        return self._estimated(corners)

    def _estimated(self, corners: Floats) -> Pulled:
        """Return bounds on the length of a taut path, given its corners at inscribed polygons."""
        d = np.diff(corners, axis=0)
        low = float(np.hypot(d[:, 0], d[:, 1]).sum())
        heading = np.unwrap(np.arctan2(d[:, 1], d[:, 0])) if len(d) > 1 else np.zeros(1)
        turns = np.diff(heading)
        switches = int((np.sign(turns[1:]) != np.sign(turns[:-1])).sum()) if len(turns) > 1 else 0
        slack = np.abs(turns).sum() + 2.0 * (switches + 1) * (len(turns) > 0)
        total = float(np.abs(turns).sum())
        error = 2.0 * math.pi / self.policy.circle_sides * 2.0 * (switches + 1)
        return Pulled(low, low + self.max_excess * float(slack), max(total - error, 0.0))


def reduce_sleeve(crossings: list[tuple[int, bool]]) -> list[tuple[int, bool]]:
    """Return a reduced sequence of crossings: edges that are crossed back at once are removed."""
    out: list[tuple[int, bool]] = []
    for edge, side in crossings:
        if out and out[-1][0] == edge:
            out.pop()
        else:
            out.append((edge, side))
    return out


def _interior_edges(triangles: npt.NDArray[np.object_]) -> tuple[Floats, Ints]:
    """Return the edges (k, 4) that two triangles share, and the triangles (k, 2) left and right.

    Edges run from the end with the smaller x (then y) to the other end.
    """
    ring = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    turned = orientations(ring[:, 0], ring[:, 1], ring[:, 2])
    ring = np.where((turned < 0)[:, None, None], ring[:, ::-1], ring)
    a, b = ring.reshape(-1, 2), np.roll(ring, -1, axis=1).reshape(-1, 2)
    triangle = np.repeat(np.arange(len(ring)), 3)
    swap = (a[:, 0] > b[:, 0]) | ((a[:, 0] == b[:, 0]) & (a[:, 1] > b[:, 1]))
    ends = np.where(swap[:, None], np.hstack([b, a]), np.hstack([a, b]))
    # a counter-clockwise triangle lies on the left of its edges
    order = np.lexsort((swap, *ends.T[::-1]))
    ends, triangle = ends[order], triangle[order]
    shared = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1))
    return ends[shared], np.column_stack([triangle[shared], triangle[shared + 1]])


def _left_of_edge(u: Floats, v: Floats, p: Floats) -> Bools:
    """Return the mask of rows in which p lies left of the edge from u to v.

    A point on the line of the edge counts as left: shifted by (-δ², δ), it lies left of any edge
    that runs to the right or, if vertical, up.
    """
    return np.asarray(orientations(u, v, p) >= 0)


def _left_of_segment(p: Floats, q: Floats, u: Floats) -> Bools:
    """Return the mask of rows in which u lies left of the segment from p to q.

    A point on the line counts as right of a segment that runs to the right (or up), because the
    segment is shifted to its left, and as left of a segment in the opposite direction.
    """
    onward = (p[:, 0] < q[:, 0]) | ((p[:, 0] == q[:, 0]) & (p[:, 1] < q[:, 1]))
    side = orientations(p, q, u)
    return np.asarray((side > 0) | ((side == 0) & ~onward))


def _cross(a: Floats, b: Floats, c: Floats) -> Floats:
    return np.asarray(
        (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    )


def _funnel(a: Point, b: Point, portals: list[tuple[Point, Point]]) -> Floats:
    """Return the corners of the shortest path from a to b through portals (left end, right end).

    The funnel of Lee & Preparata: shortest paths from the last corner to both ends of the portal,
    the left one turning left only and the right one right only.
    """
    corners = [a]
    left: deque[Point] = deque()
    right: deque[Point] = deque()

    def narrow(side: deque[Point], other: deque[Point], p: Point, sense: int) -> None:
        """Make p the new end of one side; `sense` is 1 for the left side, -1 for the right."""
        while side:
            before = side[-2] if len(side) > 1 else corners[-1]
            if sense * orientation(before, side[-1], p) > 0:
                break
            side.pop()
        if not side:
            while other:
                turn = sense * orientation(corners[-1], other[0], p)
                if turn > 0 or (turn == 0 and not _beyond(corners[-1], other[0], p)):
                    break
                corners.append(other.popleft())
        side.append(p)

    last: tuple[Point | None, Point | None] = (None, None)
    for portal in portals:
        if portal[0] != last[0]:
            narrow(left, right, portal[0], 1)
        if portal[1] != last[1]:
            narrow(right, left, portal[1], -1)
        last = portal
    narrow(left, right, b, 1)
    out = [*corners, *left]
    return np.array([out[0], *(q for p, q in pairwise(out) if p != q or q is out[-1])])


def _beyond(a: Point, b: Point, c: Point) -> bool:
    """Return whether c, on the line through a and b, lies at b or beyond it."""
    return (c[0] - b[0]) * (b[0] - a[0]) + (c[1] - b[1]) * (b[1] - a[1]) >= 0.0

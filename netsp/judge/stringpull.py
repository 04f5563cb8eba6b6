"""Pull a path taut within its homotopy class: constrained Delaunay triangles and the funnel.

An independent road to taut lengths. Circles become inscribed polygons; free space is triangulated;
a path is the sequence of triangle edges it crosses; cancelling an edge crossed back at once gives
the *reduced* sequence, which is the path's homotopy class; the shortest path through a sequence of
edges is found with the funnel algorithm (Lee & Preparata 1984; Chazelle 1982; Hershberger &
Snoeyink 1994). Its corners tell which disks the taut path touches, and with that its exact length
(`netsp.judge.chain`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from netsp.arrays import Floats
from netsp.judge.chain import contacts_of, exact_length
from netsp.judge.solids import SIDES, inset
from netsp.problem import Problem

PLACE_TOLERANCE = 1e-7
"""How far, relative to the problem's size, a path may miss a point or enter an obstacle."""


@dataclass(frozen=True)
class Pulled:
    """A taut planar length between two bounds. They agree where the contacts with the disks
    themselves were found; else `low` is among inscribed polygons, and `high` adds what the circles
    stand proud of them along the bends (an estimate: it assumes no bend moves elsewhere). And the
    angle (radians) by which it turns; at least, where contacts were not found."""

    low: float
    high: float
    turning: float


class StringPuller:
    """Triangulated free space of a problem's plan.

    Parameters
    ----------
    reach
        How far from base, goals and obstacles a path may go.
    place
        The judge's tolerance.
    """

    def __init__(self, problem: Problem, reach: float, place: float | None = None) -> None:
        self.problem = problem
        self.place = PLACE_TOLERANCE * problem.scale if place is None else place
        self.origin = np.array(problem.base[:2])
        self.solids = [inset(problem, o, self.place, self.origin) for o in problem.obstacles]
        shapes = [s.shape for s in self.solids]
        disks = [s.disks for s in self.solids]
        self.disks: Floats = np.vstack(disks) if disks else np.zeros((0, 3))
        self._disk_at = {
            (float(x), float(y)): tuple(s.disks[k].tolist())
            for s in self.solids
            for (x, y), k in zip(s.ring, s.owner, strict=True)
        }
        self.proud = max(
            (float(s.disks[:, 2].max()) * (1.0 - math.cos(math.pi / SIDES)) + s.depth
             for s in self.solids), default=0.0,
        )  # fmt: skip
        if problem.bounds is not None:
            bounds = np.array(problem.bounds) - np.tile(self.origin, 2)
            box = shapely.box(*bounds).buffer(self.place, join_style="mitre")
        else:
            box = shapely.MultiPoint(problem.points[:, :2] - self.origin)
            box = shapely.union_all([box, *shapes]).envelope.buffer(2.0 * reach, join_style="mitre")
        free = box.difference(shapely.union_all(shapes)) if shapes else box
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(free))
        self._edges = _interior_edges(triangles)
        self._tree = shapely.STRtree(shapely.linestrings(self._edges.reshape(-1, 2, 2)))

    def crossings(self, path: npt.ArrayLike) -> list[list[tuple[int, bool]]]:
        """Per segment of a polyline, the triangle edges crossed, in order, with the side come from.

        Sides of vertices are half-open, as for rays, so that the sequence of a whole path is the
        sequences of its parts put together.
        """
        xy = np.asarray(path, dtype=float)[:, :2] - self.origin
        out: list[list[tuple[int, bool]]] = [[] for _ in range(len(xy) - 1)]
        segments = shapely.linestrings(np.stack([xy[:-1], xy[1:]], axis=1))
        seg, edge = self._tree.query(segments, predicate=None)
        e = self._edges[edge]
        p, q, u, v = xy[seg], xy[seg + 1], e[:, :2], e[:, 2:]
        p_left, q_left = _orient(u, v, p) >= 0.0, _orient(u, v, q) >= 0.0
        u_side, v_side = _orient(p, q, u), _orient(p, q, v)
        hit = (p_left != q_left) & ((u_side > 0.0) != (v_side > 0.0))
        seg, edge, p_left = seg[hit], edge[hit], p_left[hit]
        a, b = _orient(u, v, p)[hit], _orient(u, v, q)[hit]
        t = a / (a - b)
        for k in np.lexsort((t, seg)):
            out[seg[k]].append((int(edge[k]), bool(p_left[k])))
        return out

    def pull(
        self, start: npt.ArrayLike, end: npt.ArrayLike, sleeve: list[tuple[int, bool]]
    ) -> Pulled:
        """Taut length from start to end through a reduced sequence of edges."""
        a, b = (np.asarray(p, dtype=float)[:2] - self.origin for p in (start, end))
        portals = []
        for edge, from_left in sleeve:
            u, v = self._edges[edge, :2], self._edges[edge, 2:]
            # coming from the left of u→v, v lies on the left hand
            portals.append((v, u) if from_left else (u, v))
        corners = _funnel(a, b, portals)
        own = [(float(x), float(y)) for x, y in corners[1:-1]]
        contacts = contacts_of(corners, [self._disk_at.get(p, (*p, 0.0)) for p in own])
        exact = exact_length(a, b, contacts, self.disks, 1e-3 * self.place)
        if exact is not None:
            return Pulled(exact[0], exact[0], exact[1])
        d = np.diff(corners, axis=0)
        low = float(np.hypot(d[:, 0], d[:, 1]).sum())
        heading = np.unwrap(np.arctan2(d[:, 1], d[:, 0])) if len(d) > 1 else np.zeros(1)
        turns = np.diff(heading)
        switches = int((np.sign(turns[1:]) != np.sign(turns[:-1])).sum()) if len(turns) > 1 else 0
        slack = np.abs(turns).sum() + 2.0 * (switches + 1) * (len(turns) > 0)
        most = float(np.abs(turns).sum())
        less = 2.0 * math.pi / SIDES * 2.0 * (switches + 1)
        return Pulled(low, low + self.proud * float(slack), max(most - less, 0.0))


def reduce_sleeve(crossings: list[tuple[int, bool]]) -> list[tuple[int, bool]]:
    """Cancel edges crossed back at once."""
    out: list[tuple[int, bool]] = []
    for edge, side in crossings:
        if out and out[-1][0] == edge:
            out.pop()
        else:
            out.append((edge, side))
    return out


def _interior_edges(triangles: npt.NDArray[np.object_]) -> Floats:
    """(k, 4) edges shared by two triangles."""
    xy = shapely.get_coordinates(triangles).reshape(-1, 4, 2)
    a, b = xy[:, :3].reshape(-1, 2), xy[:, 1:].reshape(-1, 2)
    swap = (a[:, 0] > b[:, 0]) | ((a[:, 0] == b[:, 0]) & (a[:, 1] > b[:, 1]))
    edges = np.where(swap[:, None], np.hstack([b, a]), np.hstack([a, b]))
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(unique[count == 2])


def _orient(a: Floats, b: Floats, c: Floats) -> Floats:
    return np.asarray(
        (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    )


def _cross(o: Floats, a: Floats, b: Floats) -> float:
    return float((a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]))


def _funnel(a: Floats, b: Floats, portals: list[tuple[Floats, Floats]]) -> Floats:
    """Corners of the shortest path from a to b through portals (left end, right end)."""
    gates = [*portals, (b, b)]
    corners = [a]
    apex, left, right = a, a, a
    left_at = right_at = -1
    k = 0
    while k < len(gates):
        new_left, new_right = gates[k]
        if _cross(apex, right, new_right) >= 0.0:
            if (apex == right).all() or _cross(apex, left, new_right) < 0.0:
                right, right_at = new_right, k
            else:
                corners.append(left)
                apex, k = left, left_at
                left = right = apex
                right_at = left_at
                k += 1
                continue
        if _cross(apex, left, new_left) <= 0.0:
            if (apex == left).all() or _cross(apex, right, new_left) > 0.0:
                left, left_at = new_left, k
            else:
                corners.append(right)
                apex, k = right, right_at
                left = right = apex
                left_at = right_at
                k += 1
                continue
        k += 1
    corners.append(b)
    return np.array(corners)

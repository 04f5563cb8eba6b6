"""Lower bounds on the lengths of legs, in whole grid units (Lemmas 7 and 8).

The shortest path through the gates between two vertices is a lower bound. More gates, which end on
arcs where that path turns, raise the bound towards the length of tangents and arcs. Floating-point
numbers are used with +, -, *, / and sqrt only, which IEEE 754 rounds correctly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from netsp_check.covering_tree import LEFT, RIGHT, CoveringTree, Funnel
from netsp_check.triangulation import Disk, Point, turn

Gate = tuple[Point, Point]
"""Left and right end of a segment that a path crosses."""

ROUNDING = 96
"""Tolerance: grid units that cover δ, 64 units, by which a place may lie in an obstacle, and all
rounding errors of one bound in floating point."""

ROUNDS = ((8, 2), (8, 1))
"""Parts into which arcs are divided, in each round, where the path turns and elsewhere."""


class Arc(NamedTuple):
    """Arc of a disk between two gates with one common end, the apex."""

    side: int
    first: Point
    last: Point
    apex: Point
    disk: Disk


class LegBounds:
    """Lower bounds on the lengths of legs between vertices of a cover, by effort.

    Effort 0 is the straight line, 1 the path through all gates, 2 the path with more gates at arcs.
    """

    def __init__(self, tree: CoveringTree) -> None:
        self.tree = tree
        heights = tree.triangulation.problem.heights
        self._height = [float(heights[v.place]) for v in tree.vertices]
        self.known: dict[tuple[int, int], tuple[int, int]] = {}  # effort and bound of (u, v), u < v

    def bound(self, u: int, v: int, effort: int) -> int:
        """Return a lower bound on the length of a leg in space."""
        key = (u, v) if u < v else (v, u)
        known = self.known.get(key)
        if known is None or known[0] < effort:
            planar = max(self._planar(*key, effort) - ROUNDING, 0.0)
            rise = self._height[u] - self._height[v]
            length = planar if rise == 0.0 else math.sqrt(planar * planar + rise * rise)
            known = effort, max(math.floor(length) - ROUNDING, 0)
            if effort:
                self.known[key] = known
        return known[1]

    def _planar(self, u: int, v: int, effort: int) -> float:
        start, end = self.tree.vertices[u], self.tree.vertices[v]
        if not effort:
            return math.dist(start.at, end.at)
        points = self.tree.triangulation.points
        edges = self.tree.gates(start, end)
        gates = [(points[left], points[right]) for left, right in edges]
        path, length = shortest_path(start.at, end.at, gates)
        if effort == 1 or len(path) == 2:
            return length
        arcs = self._arcs(edges)
        for parts in ROUNDS:
            gates, arcs = _refined(gates, arcs, set(path[1:-1]), *parts)
            path, length = shortest_path(start.at, end.at, gates)
        return length

    def _arcs(self, edges: Sequence[tuple[int, int]]) -> list[Arc | None]:
        """Return the arc between each edge and the next one, None where there is none."""
        points, disks = self.tree.triangulation.points, self.tree.triangulation.disks
        out: list[Arc | None] = []
        for before, after in pairwise(edges):
            side = LEFT if before[LEFT] != after[LEFT] else RIGHT
            a, b = before[side], after[side]
            disk = disks.get((b, a) if side == LEFT else (a, b))  # its triangle is on its left
            apex = points[after[1 - side]]
            out.append(None if disk is None else Arc(side, points[a], points[b], apex, disk))
        return out


def shortest_path(start: Point, end: Point, gates: Sequence[Gate]) -> tuple[list[Point], float]:
    """Return the corners and the length of the shortest path that meets gates in order."""
    funnel, last = Funnel(start), (start, start)
    for gate in gates:
        for side in (LEFT, RIGHT):
            if gate is gates[0] or gate[side] != last[side]:
                funnel.narrow(gate[side], side)
        last = gate
    funnel.narrow(end, LEFT)
    return funnel.passed + funnel.chains[LEFT], funnel.length(LEFT)


def _refined(
    gates: list[Gate], arcs: list[Arc | None], touched: set[Point], parts: int, other_parts: int
) -> tuple[list[Gate], list[Arc | None]]:
    """Return more gates, with the arcs between; `parts` is for arcs with a touched end."""
    more, between = gates[:1], list[Arc | None]()
    for gate, arc in zip(gates[1:], arcs, strict=True):
        if arc is not None:
            is_touched = arc.first in touched or arc.last in touched
            for p in _on_arc(arc, parts if is_touched else other_parts):
                between.append(arc._replace(last=p))
                more.append((p, arc.apex) if arc.side == LEFT else (arc.apex, p))
                arc = arc._replace(first=p)
        between.append(arc)
        more.append(gate)
    return more, between


def _on_arc(arc: Arc, parts: int) -> list[Point]:
    """Return points that divide an arc, in its disk and in the triangle to its apex (Lemma 7)."""
    x, y, radius = arc.disk
    a, b, c, d = arc.first[0] - x, arc.first[1] - y, arc.last[0] - x, arc.last[1] - y
    out, last = [], arc.first
    for k in range(1, parts):
        u, v = a + (c - a) * k / parts, b + (d - b) * k / parts
        norm = math.sqrt(u * u + v * v)
        if norm > 0.5 * radius:
            scale = (radius - 4.0) / norm  # rounding keeps the point in the disk
            p = round(x + u * scale), round(y + v * scale)
            sign = 1 - 2 * arc.side
            sides = turn(last, arc.apex, p), turn(arc.apex, arc.last, p), turn(arc.last, last, p)
            if min(sign * s for s in sides) > 0:
                out.append(p)
                last = p
    return out

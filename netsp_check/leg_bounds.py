"""Lower bounds on the lengths of legs, in whole grid units (Lemmas 6 to 8).

Three bounds of rising cost: by the distances of both ends from the base; by a funnel among the
triangles; by a funnel that is refined at arcs, whose bends are replaced by tangents and arcs.
Floating-point numbers are used with +, -, *, / and sqrt only, which IEEE 754 rounds correctly.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from netsp_check.covering_tree import LEFT, RIGHT, CoveringTree, Funnel, Vertex
from netsp_check.triangulation import Point, turn

Vector = tuple[float, float]
Disk = tuple[float, float, float]
Gate = tuple[Point, Point]

ROUNDING = 16
"""Tolerance: grid units that cover all rounding errors of one bound in floating point."""

PARTS = 8
"""Format constant: parts into which arcs at the bends of a path are divided."""


@dataclass(frozen=True)
class Arc:
    """Part of a path's gates that leads past an arc of a disk.

    Attributes
    ----------
    first, last
        Ends of the chord, in the order of travel.
    apex
        Other end of all gates between.
    disk
        Disk that holds the chord.
    """

    side: int
    first: Point
    last: Point
    apex: Point
    disk: Disk


class LegBounds:
    """Lower bounds on the lengths of legs between vertices of the cover, by effort.

    Bounds in space are the hypotenuse of the bound in the plane and the difference in height.
    """

    def __init__(self, tree: CoveringTree) -> None:
        self.tree = tree
        problem = tree.triangulation.problem
        self._height = [float(problem.heights[v.place]) for v in tree.vertices]
        self._subpoints: dict[tuple[Point, Point, Disk], list[Point]] = {}
        self.known: dict[tuple[int, int], tuple[int, int]] = {}

    def bound(self, u: int, v: int, effort: int) -> int:
        """Return the bound of effort 0 (straight line), 1 (funnel) or 2 (tangents and arcs)."""
        key = (u, v) if u < v else (v, u)
        known = self.known.get(key)
        if known is None or known[0] < effort:
            known = effort, self._in_space(*key, self.planar(*key, effort))
            if effort:
                self.known[key] = known
        return known[1]

    def planar(self, u: int, v: int, effort: int) -> float:
        """Return the bound in the plane, in grid units."""
        start, end = self.tree.vertices[u], self.tree.vertices[v]
        if not effort:
            dx, dy = start.at[0] - end.at[0], start.at[1] - end.at[1]
            return math.sqrt(dx * dx + dy * dy)
        points = self.tree.triangulation.points
        indices = self.tree.gates(start, end)
        gates = [(points[left], points[right]) for left, right in indices]
        path, length = shortest_path(start.at, end.at, gates)
        if effort < 2 or len(path) == 2:
            return length
        gates, arcs = self._refined(gates, self._arcs(indices), {p for p, _ in path[1:-1]})
        path, length = shortest_path(start.at, end.at, gates)
        return max(length, along_arcs(path, gates, arcs))

    def _in_space(self, u: int, v: int, planar: float) -> int:
        planar = max(planar - ROUNDING, 0.0)
        rise = self._height[u] - self._height[v]
        length = planar if rise == 0.0 else math.sqrt(planar * planar + rise * rise)
        return max(math.floor(length) - ROUNDING, 0)

    def _arcs(self, indices: Sequence[tuple[int, int]]) -> list[Arc | None]:
        """Return the arc between each gate and the next one, None where there is none."""
        points, disks = self.tree.triangulation.points, self.tree.triangulation.disks
        out: list[Arc | None] = []
        for before, after in zip(indices, indices[1:], strict=False):
            side = LEFT if before[LEFT] != after[LEFT] else RIGHT
            a, b = before[side], after[side]
            # the triangle is on the left of the directed edge
            disk = disks.get((b, a) if side == LEFT else (a, b))
            apex = points[after[1 - side]]
            out.append(None if disk is None else Arc(side, points[a], points[b], apex, disk))
        return out

    def _refined(
        self, gates: list[Gate], arcs: list[Arc | None], touched: set[Point]
    ) -> tuple[list[Gate], list[Arc | None]]:
        """Return more gates, with arcs between: one at each arc, several at arcs that are touched.

        The ends of these gates are in the disk, so that a path outside it meets each (Lemma 7).
        """
        out, between = gates[:1], []
        for gate, arc in zip(gates[1:], arcs, strict=True):
            if arc is None:
                between.append(arc)
            else:
                is_touched = arc.first in touched or arc.last in touched
                last = arc.first
                for p in self._on_arc(arc, PARTS if is_touched else 2):
                    between.append(Arc(arc.side, last, p, arc.apex, arc.disk))
                    out.append((p, arc.apex) if arc.side == LEFT else (arc.apex, p))
                    last = p
                between.append(Arc(arc.side, last, arc.last, arc.apex, arc.disk))
            out.append(gate)
        return out, between

    def _on_arc(self, arc: Arc, parts: int) -> list[Point]:
        """Return points of an arc's disk and triangle that divide the arc."""
        key = arc.first, arc.last, arc.apex, parts
        if key not in self._subpoints:
            x, y, radius = arc.disk
            (a, b), (c, d) = _radial(arc.first, arc.disk), _radial(arc.last, arc.disk)
            found = []
            for k in range(1, parts):
                u, v = a + (c - a) * k / parts, b + (d - b) * k / parts
                norm = math.sqrt(u * u + v * v)
                if norm > 0.1:
                    reach = (radius - 4.0) / norm  # rounding keeps the point in the disk
                    p = round(x + u * reach), round(y + v * reach)
                    sides = [turn(arc.first, arc.apex, p), turn(arc.apex, arc.last, p)]
                    sides.append(turn(arc.last, arc.first, p))
                    if min(sides) >= 0 if arc.side == LEFT else max(sides) <= 0:
                        found.append(p)
            self._subpoints[key] = found
        return self._subpoints[key]


def shortest_path(
    start: Point, end: Point, gates: Sequence[Gate]
) -> tuple[list[tuple[Point, int]], float]:
    """Return the corners, with their sides, and the length of the shortest path through gates."""
    funnel = Funnel(start)
    left = right = None
    for gate in gates:
        if gate[LEFT] != left:
            left = gate[LEFT]
            funnel.narrow(left, LEFT)
        if gate[RIGHT] != right:
            right = gate[RIGHT]
            funnel.narrow(right, RIGHT)
    funnel.narrow(end, LEFT)
    return funnel.corners(LEFT), funnel.length(LEFT)


@dataclass(frozen=True)
class Bend:
    """Bend of a path about a disk, or about a point if the radius is 0.

    Attributes
    ----------
    sign
        1 if the obstacle is on the left, -1 if on the right.
    first, last
        Indices of the first and the last gate that ends at its corners.
    corners
        Number of corners of the path.
    """

    sign: int
    disk: Disk
    first: int
    last: int
    corners: int = 1


def along_arcs(
    path: Sequence[tuple[Point, int]], gates: Sequence[Gate], arcs: Sequence[Arc | None]
) -> float:
    """Return a lower bound on paths through gates and past arcs, by directions (Lemma 8).

    Any unit vectors give a bound. Those of tangents between the bends of a path give the best one.
    """
    bends = _bends(path, gates, arcs)
    start, end = path[0][0], path[-1][0]
    while True:
        ends = [(0, (*start, 0.0)), *((b.sign, b.disk) for b in bends), (0, (*end, 0.0))]
        pairs = zip(ends, ends[1:], strict=False)
        directions = [_tangent(a, b) for a, b in pairs]
        known = [u for u in directions if u is not None]
        if len(known) < len(directions):
            return 0.0
        # a bend of several corners may turn by more than half a turn
        turned = [
            b.corners > 2 or b.sign * _cross(known[k], known[k + 1]) > 0.0
            for k, b in enumerate(bends)
        ]
        if all(turned):
            break
        bends = [b for b, is_turned in zip(bends, turned, strict=True) if is_turned]
    total = known[-1][0] * end[0] + known[-1][1] * end[1]
    total -= known[0][0] * start[0] + known[0][1] * start[1]
    position = count = 0
    for k, bend in enumerate(bends):
        turns = list(_turns(bend, known[k], known[k + 1], gates, arcs))
        for at, value in turns:
            if at < position:
                return 0.0  # directions would change in another order than the gates are met
            position, total, count = at, total + value, count + 1
    return total - ROUNDING - count


def _bends(
    path: Sequence[tuple[Point, int]], gates: Sequence[Gate], arcs: Sequence[Arc | None]
) -> list[Bend]:
    """Return the bends of a path, one for consecutive corners on one disk."""
    out: list[Bend] = []
    k = 0
    for p, side in path[1:-1]:
        while gates[k][side] != p:
            k += 1
        first = k
        while k + 1 < len(gates) and gates[k + 1][side] == p:
            k += 1
        around = [arcs[j] for j in (k, first - 1) if 0 <= j < len(arcs)]
        disks = [a.disk for a in around if a is not None and a.side == side]
        disk = disks[0] if disks else (float(p[0]), float(p[1]), 0.0)
        sign, last = 1 - 2 * side, k
        k = first
        corners = 1
        if out and out[-1].sign == sign and out[-1].disk == disk:
            before = out.pop()
            first, corners = before.first, before.corners + 1
        out.append(Bend(sign, disk, first, last, corners))
    return out


def _turns(
    bend: Bend, u: Vector, v: Vector, gates: Sequence[Gate], arcs: Sequence[Arc | None]
) -> Iterator[tuple[int, float]]:
    """Yield where the direction turns from u towards v, and what each turn adds to the bound.

    Turns at gate k have position 2 k, those at the arc after it 2 k + 1.
    """
    side, sign = (LEFT, 1) if bend.sign == 1 else (RIGHT, -1)
    if not bend.disk[2]:
        near = range(bend.first, bend.last + 1)
        yield max((_at_gate(u, v, *_ends(gates[k], side)), 2 * k) for k in near)[::-1]
        return
    chain = _chain(bend, side, gates, arcs)
    for number, (k, arc) in enumerate(chain, 1):
        start, stop = (_along(p, bend.disk, sign) for p in (arc.first, arc.last))
        if number == 1 and sign * _cross(u, start) > 0.0:
            w = start if sign * _cross(start, v) > 0.0 or len(chain) > 2 else v
            yield 2 * k, _at_gate(u, w, arc.first, arc.apex)
            u = w
        # the last direction is compared where it is less than half a turn ahead
        if number > len(chain) - 2 and sign * _cross(stop, v) <= 0.0:
            stop = v
        is_ahead = sign * _cross(u, stop) > 0.0 and sign * _cross(start, stop) > 0.0
        if is_ahead and sign * _cross(start, u) >= 0.0:
            yield from _at_arc(k, arc, u, stop)
            u = stop
    if u != v:
        yield 2 * chain[-1][0] + 2, _at_gate(u, v, *_ends(gates[chain[-1][0] + 1], side))


def _chain(
    bend: Bend, side: int, gates: Sequence[Gate], arcs: Sequence[Arc | None]
) -> list[tuple[int, Arc]]:
    """Return the arcs of a bend's disk from the one before its first corner to the one after its
    last, with the gates before them."""
    out: list[tuple[int, Arc]] = []
    for k in range(max(bend.first - 1, 0), min(bend.last + 1, len(arcs))):
        arc = arcs[k]
        if arc is not None and arc.side == side and arc.disk == bend.disk:
            out.append((k, arc))
    return out


def _at_gate(u: Vector, v: Vector, p: Point, q: Point) -> float:
    """Return the least of (u - v) · x on a gate."""
    x, y = u[0] - v[0], u[1] - v[1]
    return min(x * p[0] + y * p[1], x * q[0] + y * q[1])


def _at_arc(k: int, arc: Arc, u: Vector, v: Vector) -> Iterator[tuple[int, float]]:
    """Yield what turns past an arc add: the arc's length where it is seen from the apex."""
    seen = [u, v]
    if not (_is_seen(arc, u) and _is_seen(arc, v)):
        steps = [t / PARTS for t in range(PARTS + 1)]
        some = [_unit(u[0] + (v[0] - u[0]) * t, u[1] + (v[1] - u[1]) * t) for t in steps]
        seen = [w for w in some if _is_seen(arc, w)] or some[PARTS // 2 :][:1]
    x, y, radius = arc.disk
    a, b = seen[0], seen[-1]
    yield 2 * k, _at_gate(u, a, arc.first, arc.apex)
    yield 2 * k + 1, radius * _angle(a, b) + x * (a[0] - b[0]) + y * (a[1] - b[1])
    yield 2 * k + 2, _at_gate(b, v, arc.last, arc.apex)


def _is_seen(arc: Arc, w: Vector) -> bool:
    """Return whether the apex sees the point of the arc that a path in direction w touches."""
    x, y, radius = arc.disk
    sign = 1 - 2 * arc.side
    a, b = sign * w[1], -sign * w[0]
    p, q = (x + radius * a, y + radius * b), arc.apex
    if a * (q[0] - x) + b * (q[1] - y) < radius:
        return False
    # points of the disk's rim may be outside the triangle by as much as its corners are inside
    for c, d in ((arc.first, q), (q, arc.last)):
        dx, dy = d[0] - c[0], d[1] - c[1]
        side = sign * (dx * (p[1] - c[1]) - dy * (p[0] - c[0]))
        if side < -0.5 * ROUNDING * (abs(dx) + abs(dy)):
            return False
    return True


def _tangent(a: tuple[int, Disk], b: tuple[int, Disk]) -> Vector | None:
    """Return the direction of the tangent from one disk to another, None if there is none.

    Each disk comes with 1 if it is on the left, and -1 if it is on the right.
    """
    (sign_a, (x, y, radius_a)), (sign_b, (u, v, radius_b)) = a, b
    dx, dy, offset = u - x, v - y, sign_a * radius_a - sign_b * radius_b
    length2 = dx * dx + dy * dy
    if length2 <= offset * offset:
        return None
    along = math.sqrt(length2 - offset * offset)
    return (along * dx - offset * dy) / length2, (along * dy + offset * dx) / length2


def _ends(gate: Gate, side: int) -> Gate:
    """Return the ends of a gate, the one on a side first."""
    return gate[side], gate[1 - side]


def _radial(p: Point, disk: Disk) -> Vector:
    """Return the direction of a point from the centre of a disk."""
    return _unit(p[0] - disk[0], p[1] - disk[1])


def _unit(x: float, y: float) -> Vector:
    """Return the unit vector of a direction."""
    norm = math.sqrt(x * x + y * y)
    return x / norm, y / norm


def _along(p: Point, disk: Disk, sign: int) -> Vector:
    """Return the direction in which a path passes a point of a disk, on its left if sign is 1."""
    x, y = _radial(p, disk)
    return -sign * y, sign * x


def _cross(u: Vector, v: Vector) -> float:
    return u[0] * v[1] - u[1] * v[0]


def _angle(u: Vector, v: Vector) -> float:
    """Return the angle between two unit vectors, rounded down, without libm."""
    x, y, a, b = u[0] - v[0], u[1] - v[1], u[0] + v[0], u[1] + v[1]
    t = math.sqrt((x * x + y * y) / (a * a + b * b))  # the tangent of half the angle
    for _ in range(3):
        t /= 1.0 + math.sqrt(1.0 + t * t)
    total, power = 0.0, t
    for k in range(1, 21, 2):  # ends with a negative term, so the sum is below the arc tangent
        total += power / k if k % 4 == 1 else -power / k
        power *= t * t
    return 16.0 * total

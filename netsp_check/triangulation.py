"""Triangulations of free space, checked with exact numbers (Lemmas 1 to 4)."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from netsp_check.problem_file import Exact, Obstacle, Problem, Refused

Point = tuple[int, int]
"""Point of the grid."""

Disk = tuple[float, float, float]
"""Centre (x, y) and radius."""

RESOLUTION = 2**30
"""Tolerance: δ is the size of the problem divided by this. Gaps between obstacles up to δ wide may
count as closed, and a place may lie in an obstacle by less than δ."""

BRIDGE_RADIUS = Fraction(4)
"""Tolerance: grid units on both sides of a bridge that count as obstacle; its corners are whole."""

MAX_HALVINGS = 8
"""Format limit: how often an edge is halved until one piece of an obstacle holds each part."""

MAX_COORDINATE = 2**44
"""Format limit: coordinates in grid units are smaller, so that rounding errors stay below 1."""

MIN_RADIUS = 2**12
"""Tolerance: arcs of smaller disks, in grid units, count as their chords."""


class Piece(NamedTuple):
    """Convex part of an obstacle: the points within `radius` of the segment from a to b."""

    a: Exact
    b: Exact
    radius: Fraction

    def holds(self, p: Exact) -> bool:
        """Return whether a point is in the piece."""
        return _distance2(p, self.a, self.b) <= self.radius * self.radius


class Border:
    """Region that must hold all border edges: obstacles, bridges, and outside the box."""

    def __init__(
        self, problem: Problem, box: list[int] | None, bridges: Sequence[tuple[Point, Point]]
    ) -> None:
        self.delta = problem.size / RESOLUTION
        self._usable = usable = _usable(problem, box, self.delta)
        self._box = box if box is not None else problem.bounds
        self._polygons = [o.corners for o in usable if len(o.corners) > 1]
        grown = [o for o in usable if o.growth > 0]
        pieces = [Piece(c, c, o.growth) for o in grown for c in o.corners]
        pieces += [Piece(a, b, o.growth) for o in grown for a, b in _edges(o.corners)]
        self._framed = [(piece, _frame(piece)) for piece in pieces]
        new = [self._bridge(a, b, problem, box is None) for a, b in bridges]
        self._framed += [(piece, _frame(piece)) for piece in new]

    def holder(self, a: Exact, b: Exact, halvings: int = 0) -> Piece | None:
        """Return a piece that holds an edge, None if it is held otherwise; refuse other edges."""
        x0, x1 = sorted((float(a[0]), float(b[0])))
        y0, y1 = sorted((float(a[1]), float(b[1])))
        for piece, (u0, v0, u1, v1) in self._framed:
            is_near = u0 <= x0 and x1 <= u1 and v0 <= y0 and y1 <= v1
            if is_near and piece.holds(a) and piece.holds(b):
                return piece
        if self._is_outside(a, b) or any(_is_inside(c, a, b) for c in self._polygons):
            return None
        if halvings == MAX_HALVINGS:
            raise Refused(f"an edge near ({x0:.0f}, {y0:.0f}) is not in an obstacle")
        middle = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2
        self.holder(a, middle, halvings + 1)
        self.holder(middle, b, halvings + 1)
        return None

    def _bridge(self, a: Point, b: Point, problem: Problem, has_bounds: bool) -> Piece:
        """Return the piece that closes a gap of at most δ between points in obstacles (Lemma 4)."""
        first, last = exact(a), exact(b)
        if _distance2(first, last, last) > self.delta**2:
            raise Refused(f"bridge {a}, {b}: expected a length of at most δ")
        held = [self._holders(p, has_bounds) for p in (first, last)]
        if not all(held) or len(held[0] | held[1]) < 2:
            raise Refused(f"bridge {a}, {b}: expected its ends in different obstacles")
        if any(_distance2(p, first, last) < (2 * self.delta) ** 2 for p in problem.places):
            raise Refused(f"bridge {a}, {b}: expected 2 δ to the base and all goals")
        return Piece(first, last, BRIDGE_RADIUS)

    def _holders(self, p: Exact, has_bounds: bool) -> set[int]:
        """Return the obstacles that hold a point, and -1 if it is outside the bounds."""
        owners = {-1} if has_bounds and self._is_outside(p, p) else set()
        for k, o in enumerate(self._usable):
            pieces = [Piece(c, c, o.growth) for c in o.corners] if o.growth > 0 else []
            pieces += [Piece(*edge, o.growth) for edge in _edges(o.corners) if o.growth > 0]
            if any(q.holds(p) for q in pieces) or _is_inside(o.corners, p, p):
                owners.add(k)
        return owners

    def _is_outside(self, a: Exact, b: Exact) -> bool:
        """Return whether an edge is outside the box, or on its border."""
        box = self._box
        return box is not None and any(
            max(a[i], b[i]) <= box[i] or min(a[i], b[i]) >= box[i + 2] for i in (0, 1)
        )


class Triangulation:
    """Triangles that cover the free space, and perhaps parts of obstacles.

    Attributes
    ----------
    points, triangles : list
        Corners on the grid, and triples of their indices, counter-clockwise.
    left : dict
        Triangle on the left of each directed edge (a, b).
    disks : dict
        Disk that holds both ends of a border edge (a, b), which has no triangle on its right.
    """

    def __init__(
        self,
        problem: Problem,
        points: list[Point],
        triangles: list[tuple[int, int, int]],
        box: list[int] | None,
        bridges: Sequence[tuple[Point, Point]],
    ) -> None:
        self.problem, self.points, self.triangles = problem, points, triangles
        values = [*problem.heights, *(v for p in problem.places for v in p)]
        whole = [v for p in points for v in p]
        if max(map(abs, values)) >= MAX_COORDINATE or max(map(abs, whole)) >= MAX_COORDINATE:
            raise Refused("points: are too far from the base")
        self.left: dict[tuple[int, int], int] = {}
        for t, (a, b, c) in enumerate(triangles):
            if turn(points[a], points[b], points[c]) <= 0:
                raise Refused(f"triangle {t}: expected corners in counter-clockwise order")
            for edge in ((a, b), (b, c), (c, a)):
                if self.left.setdefault(edge, t) != t:
                    raise Refused(f"triangle {t}: another one is on the left of edge {edge}")
        self._check_fans()
        self.disks: dict[tuple[int, int], Disk] = {}
        self._check_border(Border(problem, box, bridges))

    def locate(self, number: int) -> tuple[list[int], Point]:
        """Return all triangles that hold a place, and the grid point nearest to the place."""
        at = round(self.problem.places[number][0]), round(self.problem.places[number][1])
        found = []
        for t, (i, j, k) in enumerate(self.triangles):
            a, b, c = self.points[i], self.points[j], self.points[k]
            if turn(a, b, at) >= 0 and turn(b, c, at) >= 0 and turn(c, a, at) >= 0:
                found.append(t)
        return found, at

    def _check_fans(self) -> None:
        """Check that the triangles about a corner never surround it (Lemma 2)."""
        closed = {(v, t) for t, triangle in enumerate(self.triangles) for v in triangle}
        for (v, w), first in self.left.items():
            t = None if (w, v) in self.left else first
            while t is not None:
                closed.discard((v, t))
                a, b, c = self.triangles[t]
                t = self.left.get((v, c if v == a else a if v == b else b))
        if closed:
            raise Refused(f"point {min(closed)[0]}: triangles surround it")

    def _check_border(self, border: Border) -> None:
        """Check that border edges are within the border, and δ away from all places."""
        near = 2.0 * float(border.delta)
        places = [(p, float(p[0]), float(p[1])) for p in self.problem.places]
        for a, b in self.left:
            if (b, a) in self.left:
                continue
            start, end = exact(self.points[a]), exact(self.points[b])
            piece = border.holder(start, end)
            if piece is not None and piece.a == piece.b:
                x, y, radius = float(piece.a[0]), float(piece.a[1]), float(piece.radius)
                if radius >= MIN_RADIUS and max(abs(x), abs(y), radius) < MAX_COORDINATE:
                    self.disks[a, b] = x, y, radius
            u0, v0, u1, v1 = _frame(Piece(start, end, Fraction(near)))
            for p, x, y in places:
                if u0 <= x <= u1 and v0 <= y <= v1 and _distance2(p, start, end) < border.delta**2:
                    raise Refused(f"edge {(a, b)}: expected δ to the base and all goals")


def turn(a: Point, b: Point, c: Point) -> int:
    """Return twice the area of a triangle, positive if it is counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def exact(p: Point) -> Exact:
    """Return a point of the grid in exact numbers."""
    return Fraction(p[0]), Fraction(p[1])


def _usable(problem: Problem, box: list[int] | None, delta: Fraction) -> list[Obstacle]:
    """Return the obstacles that may bound triangles: all, or those within the box (Lemma 3)."""
    bounds = problem.bounds
    if box is None:
        if bounds is None:
            raise Refused("box: expected one, because the problem has no bounds")
        return list(problem.obstacles)
    if bounds is not None and not _encloses(bounds, box[:2], box[2:]):
        raise Refused("box: reaches beyond the bounds")
    if not all(_encloses(box, p, p) for p in problem.places):
        raise Refused("box: does not hold the base and all goals")
    room = 4 * delta + 1  # the way along the box must be free
    inner = [box[0] + room, box[1] + room, box[2] - room, box[3] - room]
    return [o for o in problem.obstacles if _encloses(inner, *o.span())]


def _encloses(box: Sequence[float | Fraction], low: Sequence, high: Sequence) -> bool:  # type: ignore[type-arg]
    """Return whether a box holds another one, given by two corners."""
    return all(box[i] <= low[i] and high[i] <= box[i + 2] for i in (0, 1))


def _distance2(p: Exact, a: Exact, b: Exact) -> Fraction:
    """Return the squared distance of a point from a segment."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    x, y = p[0] - a[0], p[1] - a[1]
    along, length2 = x * dx + y * dy, dx * dx + dy * dy
    if along > 0:
        t = min(along / length2, Fraction(1))
        x, y = x - t * dx, y - t * dy
    return x * x + y * y


def _frame(piece: Piece) -> tuple[float, float, float, float]:
    """Return a box (x0, y0, x1, y1) that holds a piece, despite rounding."""
    room = float(piece.radius) * (1.0 + 1e-6) + 1.0
    x0, x1 = sorted((float(piece.a[0]), float(piece.b[0])))
    y0, y1 = sorted((float(piece.a[1]), float(piece.b[1])))
    return x0 - room, y0 - room, x1 + room, y1 + room


def _edges(corners: Sequence[Exact]) -> list[tuple[Exact, Exact]]:
    """Return the edges of a polygon; none of a circle."""
    return [(corners[k - 1], c) for k, c in enumerate(corners)] if len(corners) > 1 else []


def _is_inside(corners: Sequence[Exact], a: Exact, b: Exact) -> bool:
    """Return whether a segment is inside a polygon and does not meet its edges."""
    is_inside = False
    for p, q in _edges(corners):
        side_a, side_b = _side(p, q, a), _side(p, q, b)
        if (p[1] > a[1]) != (q[1] > a[1]) and (side_a > 0) == (q[1] > p[1]):
            is_inside = not is_inside
        if side_a * side_b <= 0 and _side(a, b, p) * _side(a, b, q) <= 0:
            low = [max(min(p[i], q[i]), min(a[i], b[i])) for i in (0, 1)]
            high = [min(max(p[i], q[i]), max(a[i], b[i])) for i in (0, 1)]
            if low[0] <= high[0] and low[1] <= high[1]:
                return False
    return is_inside


def _side(a: Exact, b: Exact, c: Exact) -> Fraction:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

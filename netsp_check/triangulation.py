"""Triangulations of free space, checked with exact numbers (Lemmas 1 to 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from netsp_check.problem_file import Exact, Obstacle, Problem, Refused

Point = tuple[int, int]
"""Point of the grid."""

RESOLUTION = 2**30
"""Tolerance: the size of the problem divided by this is δ, the width below which a gap may count
as closed, and the depth to which a goal may lie in an obstacle."""

MAX_HALVINGS = 8
"""Format limit: how often an edge is halved until one piece of an obstacle holds each part."""


@dataclass(frozen=True)
class Piece:
    """Convex part of an obstacle: the points within `radius` of the segment from a to b."""

    a: Exact
    b: Exact
    radius: Fraction

    def holds(self, p: Exact) -> bool:
        """Return whether a point is in the piece."""
        return distance2(p, self.a, self.b) <= self.radius * self.radius

    def frame(self) -> tuple[float, ...]:
        """Return a box (x0, y0, x1, y1) that holds the piece, despite rounding."""
        reach = float(self.radius) * (1.0 + 1e-6) + 1.0
        xs, ys = (
            sorted((float(self.a[0]), float(self.b[0]))),
            sorted((float(self.a[1]), float(self.b[1]))),
        )
        return xs[0] - reach, ys[0] - reach, xs[1] + reach, ys[1] + reach


class Triangulation:
    """Triangles that cover the free space, and perhaps parts of obstacles.

    Attributes
    ----------
    points : list of (x, y)
        Corners, on the grid.
    triangles : list of (a, b, c)
        Indices of corners, counter-clockwise.
    left : dict
        Triangle on the left of each directed edge (a, b).
    disks : dict
        Disk (x, y, radius) that holds both ends of a directed edge (a, b) on the border.
    """

    def __init__(
        self,
        problem: Problem,
        points: list[Point],
        triangles: list[tuple[int, int, int]],
        box: list[int] | None,
        bridges: list[tuple[Point, Point]],
    ) -> None:
        self.problem, self.points, self.triangles = problem, points, triangles
        self.left: dict[tuple[int, int], int] = {}
        for t, (a, b, c) in enumerate(triangles):
            if turn(points[a], points[b], points[c]) <= 0:
                raise Refused(f"triangle {t}: expected corners in counter-clockwise order")
            for edge in ((a, b), (b, c), (c, a)):
                if self.left.setdefault(edge, t) != t:
                    raise Refused(f"triangle {t}: two triangles are on the left of edge {edge}")
        self._check_fans()
        self._delta = problem.size / RESOLUTION
        self._border = Border(problem, self._usable(box), box)
        for a, b in bridges:
            self._border.add_bridge(a, b, self._delta)
        self.disks: dict[tuple[int, int], tuple[float, float, float]] = {}
        self._check_border()

    def locate(self, k: int) -> tuple[int, Point]:
        """Return a triangle that holds place k, and the grid point nearest to the place."""
        at = (round(self.problem.places[k][0]), round(self.problem.places[k][1]))
        for t, corners in enumerate(self.triangles):
            a, b, c = (self.points[i] for i in corners)
            if turn(a, b, at) >= 0 and turn(b, c, at) >= 0 and turn(c, a, at) >= 0:
                return t, at
        raise Refused(f"place {k}: no triangle holds it")

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

    def _usable(self, box: list[int] | None) -> list[Obstacle]:
        """Return the obstacles that may bound triangles: all, or those within the box (Lemma 3)."""
        problem, bounds = self.problem, self.problem.bounds
        if box is None:
            if bounds is None:
                raise Refused("box: missing; expected one, because the problem has no bounds")
            return list(problem.obstacles)
        low, high = [Fraction(v) for v in box[:2]], [Fraction(v) for v in box[2:]]
        if bounds is not None and not _encloses(bounds[:2], bounds[2:], low, high):
            raise Refused("box: reaches beyond the bounds")
        if not all(_encloses(low, high, p, p) for p in problem.places):
            raise Refused("box: does not hold the base and all goals")
        spans = [(o, *o.span()) for o in problem.obstacles]
        inner = [v + 1 for v in low], [v - 1 for v in high]  # paths along the box must be free
        return [o for o, first, last in spans if _encloses(*inner, first, last)]

    def _check_border(self) -> None:
        """Check that each edge without a neighbour is in obstacles, and away from places there."""
        buried = [p for p in self.problem.places if self._border.holds_point(p)]
        for a, b in self.left:
            if (b, a) in self.left:
                continue
            start, end = _exact(self.points[a]), _exact(self.points[b])
            piece = self._border.holder(start, end)
            if piece is not None and piece.a == piece.b:
                self.disks[a, b] = float(piece.a[0]), float(piece.a[1]), float(piece.radius)
            for p in buried:
                if distance2(p, start, end) < self._delta**2:
                    raise Refused(f"edge {(a, b)}: is less than δ from a place in an obstacle")


class Border:
    """Region in which edges without a neighbour must lie: obstacles, bridges, outside the box."""

    def __init__(self, problem: Problem, usable: list[Obstacle], box: list[int] | None) -> None:
        self._places, self._has_bounds = problem.places, box is None
        self._box = [Fraction(v) for v in box] if box is not None else list(problem.bounds or ())
        self._polygons = [o.corners for o in usable if len(o.corners) > 1]
        corners = [Piece(c, c, o.growth) for o in usable for c in o.corners if o.growth > 0]
        edges = [
            Piece(a, b, o.growth) for o in usable if o.growth > 0 for a, b in _edges(o.corners)
        ]
        self._pieces = [(p, p.frame()) for p in corners + edges]

    def add_bridge(self, a: Point, b: Point, delta: Fraction) -> None:
        """Add what closes a gap of at most δ between two points in obstacles (Lemma 4)."""
        first, last = _exact(a), _exact(b)
        if distance2(first, last, last) > delta * delta:
            raise Refused(f"bridge {a}, {b}: is longer than δ")
        if not all(self.holds_point(p) or self._is_beyond_bounds(p) for p in (first, last)):
            raise Refused(f"bridge {a}, {b}: an end is in no obstacle")
        if any(distance2(p, first, last) < 4 * delta * delta for p in self._places):
            raise Refused(f"bridge {a}, {b}: is less than 2 δ from the base or a goal")
        piece = Piece(first, last, delta)
        self._pieces.append((piece, piece.frame()))

    def holds_point(self, p: Exact) -> bool:
        """Return whether a point is in a closed obstacle."""
        x, y = float(p[0]), float(p[1])
        near = (q for q, f in self._pieces if f[0] <= x <= f[2] and f[1] <= y <= f[3])
        return any(q.holds(p) for q in near) or any(_inside(c, p, p) for c in self._polygons)

    def _is_beyond_bounds(self, p: Exact) -> bool:
        """Return whether a point is outside the problem's bounds, and these are the box."""
        return self._has_bounds and self._is_outside(p, p)

    def holder(self, a: Exact, b: Exact, halvings: int = 0) -> Piece | None:
        """Return a piece that holds an edge, None if it is held otherwise; refuse other edges."""
        x0, x1 = sorted((float(a[0]), float(b[0])))
        y0, y1 = sorted((float(a[1]), float(b[1])))
        for piece, (u0, v0, u1, v1) in self._pieces:
            is_near = u0 <= x0 and x1 <= u1 and v0 <= y0 and y1 <= v1
            if is_near and piece.holds(a) and piece.holds(b):
                return piece
        if self._is_outside(a, b) or any(_inside(c, a, b) for c in self._polygons):
            return None
        if halvings == MAX_HALVINGS:
            raise Refused(f"edge from {_text(a)} to {_text(b)}: is not in an obstacle")
        middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
        self.holder(a, middle, halvings + 1)
        self.holder(middle, b, halvings + 1)
        return None

    def _is_outside(self, a: Exact, b: Exact) -> bool:
        """Return whether an edge is outside the box, or on its border."""
        return bool(self._box) and any(
            max(a[i], b[i]) <= self._box[i] or min(a[i], b[i]) >= self._box[i + 2] for i in (0, 1)
        )


def turn(a: Point, b: Point, c: Point) -> int:
    """Return twice the area of a triangle, positive if it is counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def distance2(p: Exact, a: Exact, b: Exact) -> Fraction:
    """Return the squared distance of a point from a segment."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    x, y = p[0] - a[0], p[1] - a[1]
    along, length2 = x * dx + y * dy, dx * dx + dy * dy
    if along > 0:
        t = min(Fraction(along, length2), Fraction(1))
        x, y = x - t * dx, y - t * dy
    return Fraction(x * x + y * y)


def _exact(p: Point) -> Exact:
    return Fraction(p[0]), Fraction(p[1])


def _text(p: Exact) -> str:
    return f"({float(p[0]):.0f}, {float(p[1]):.0f})"


def _edges(corners: Sequence[Exact]) -> list[tuple[Exact, Exact]]:
    """Return the edges of a polygon; none of a circle."""
    return [(corners[k - 1], c) for k, c in enumerate(corners)] if len(corners) > 1 else []


def _encloses(low: Sequence[Fraction], high: Sequence[Fraction], first: Exact, last: Exact) -> bool:
    """Return whether the box from low to high holds the one from first to last."""
    return all(low[i] <= first[i] and last[i] <= high[i] for i in (0, 1))


def _inside(corners: Sequence[Exact], a: Exact, b: Exact) -> bool:
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
    """Return twice the area of a triangle, positive if it is counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

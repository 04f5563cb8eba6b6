"""Certified lower bounds on the length of the robot's paths around edges of solids.

The shortest path around convex polytopes bends on their edges. A search over pieces of edges gives
a lower bound on its length, and the pieces on the path that it finds are halved until the bound is
sharp (`netsp.plan.space.edge_paths`). Polytopes lie inside of the solids
(`netsp.plan.space.inscribed_polytopes`), so the bound holds for the solids. The proof is in
docs/theory, Section 21.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.plan.space.edge_paths import (
    UNKNOWN,
    Pieces,
    apart_from_edges,
    is_blocked,
    is_inside,
    shortest_on_pieces,
    shortest_over_pieces,
)
from netsp.plan.space.inscribed_polytopes import Polytopes
from netsp.plan.space.mission_policy import EdgePolicy
from netsp.plan.space.potential import BOUND_ROUNDING, Ends, Region


class EdgeBound(NamedTuple):
    """Lower bound on paths between two points.

    Attributes
    ----------
    length
        No path is shorter, metres; at least the distance of the points.
    is_final
        Whether more effort cannot raise the bound by more than rounding off the polytopes does.
    """

    length: float
    is_final: bool


def edge_bound(
    shapes: Polytopes, ends: Ends, region: Region, policy: EdgePolicy, clock: Clock | None = None
) -> EdgeBound:
    """Return a lower bound on the length of paths around polytopes between two points.

    Parameters
    ----------
    shapes : Polytopes
        Polytopes that the paths stay out of.
    ends : Ends
        The two points, and the upper limit of the bound.
    region : Region
        Region of the paths; both points are in it.
    policy : EdgePolicy
        Effort.
    clock : Clock, optional
        Clock of the run; when it is up, the bound proven so far is returned.

    Examples
    --------
    >>> import numpy as np
    >>> from netsp.plan.space.inscribed_polytopes import inscribed_polytopes
    >>> from netsp.world import Scene
    >>> wall = {"box": {"center": [0, 0, 0], "size": [0.2, 6, 6]}}
    >>> box, policy = np.array([[-9.0] * 3, [9.0] * 3]), EdgePolicy()
    >>> shapes = inscribed_polytopes(Scene(solids=[wall]).field(), 0.0, box, policy)
    >>> ends = Ends(np.array([-4.1, 0.0, 0.0]), np.array([4.1, 0.0, 0.0]), 12.0)
    >>> around = edge_bound(shapes, ends, Region(0.0, box, np.zeros(3), 20.0), policy).length
    >>> round(around, 2)  # 5 m to the rim, over it, and 5 m back
    10.2
    """
    clock = clock or Clock()
    straight = float(np.linalg.norm(ends.b - ends.a))
    if not straight < ends.longest < math.inf:
        return EdgeBound(straight, False)
    nearest = shapes.nearest(ends.a, ends.b, policy.max_edges)
    search = _EdgeSearch(nearest, ends, region, policy, clock)
    best, is_sharp = straight, False
    for _ in range(policy.max_rounds):
        length, path = search.shortest()
        best = max(best, length)
        if clock.is_up:
            break
        is_sharp = not len(path) or search.is_sharp(length, path)
        if is_sharp or not search.refine(path):
            break
    length = max(straight, best * (1.0 - BOUND_ROUNDING))
    return EdgeBound(length, is_sharp and nearest is shapes and shapes.is_complete)


@dataclass
class _EdgeSearch:
    """Pieces of the edges that short paths between two points may bend at.

    Attributes
    ----------
    shapes, ends, region, policy, clock
        As for `edge_bound`.
    edges
        (e,) numbers of the edges of `shapes` that are left.
    pieces
        Pieces; there is room for more of them.
    count
        Number of pieces.
    links
        (m, m) costs of links from piece to piece.
    """

    shapes: Polytopes
    ends: Ends
    region: Region
    policy: EdgePolicy
    clock: Clock
    edges: Ints = field(init=False)
    pieces: Pieces = field(init=False)
    count: int = field(init=False)
    links: Floats = field(init=False)

    def __post_init__(self) -> None:
        shapes, (a, b, longest) = self.shapes, self.ends
        begins, ends, edge = _clipped(shapes, self.region)
        near = _distances(begins, ends, a) + _distances(begins, ends, b) <= longest
        near &= (
            _distances(begins, ends, self.region.anchor) <= self.region.reach * (1.0 + 1e-9) + 1e-9
        )
        near &= np.array(
            [not is_inside(shapes, p, q) for p, q in zip(begins, ends, strict=True)], dtype=np.bool_
        )
        begins, ends, edge = begins[near], ends[near], edge[near]
        self.edges = edge
        self._begins, self._ends = np.ascontiguousarray(begins), np.ascontiguousarray(ends)
        size = len(edge) + 2
        capacity = max(self.policy.max_pieces, size)
        self.count = size
        points, numbers = np.zeros((2, capacity, 3)), np.zeros((2, capacity))
        edges = np.zeros(capacity, dtype=np.int64)
        self.pieces = Pieces(points[0], points[1], edges, numbers[0], numbers[1])
        self.links = np.full((size, size), UNKNOWN)
        for k, (p, q, e) in enumerate(
            zip([a, b, *begins], [a, b, *ends], [-1, -2, *edge], strict=True)
        ):
            self._put(k, p, q, int(e), 0.0)

    def _put(self, k: int, p: Floats, q: Floats, edge: int, slope: float) -> None:
        """Make a piece the k-th. Its slope is limited so that no cost is negative."""
        pieces = self.pieces
        pieces.begins[k], pieces.ends[k], pieces.edge[k] = p, q, edge
        pieces.to_end[k] = _distances(p[None], q[None], self.ends.b)[0]
        size = float(np.linalg.norm(q - p))
        if slope != 0.0 and size > 0.0:
            number = int(np.flatnonzero(self.edges == edge)[0])
            apart = apart_from_edges(
                self._begins, self._ends, self.ends.a, self.ends.b, p, q, number
            )
            limit = min(0.999, apart / size)
            pieces.slope[k] = min(limit, max(-limit, slope))
        else:
            pieces.slope[k] = 0.0

    def shortest(self) -> tuple[float, Ints]:
        """Return the shortest path over pieces, as `shortest_over_pieces`."""
        flag = self.clock.flag
        return self.clock.interruptible(
            lambda: shortest_over_pieces(
                self.shapes, self.pieces, self.links, self.count, self.ends.longest, flag
            )
        )

    def is_sharp(self, length: float, path: Ints) -> bool:
        """Return whether a path around the polytopes is hardly longer than a path over pieces."""
        on_pieces, corners, _ = shortest_on_pieces(self.pieces, path)
        return bool(on_pieces - length <= self.policy.tolerance * length) and not any(
            is_blocked(self.shapes, p, p, q, q) for p, q in pairwise(corners)
        )

    def refine(self, path: Ints) -> bool:
        """Halve the longest pieces of a path, and return whether there were any."""
        policy, pieces = self.policy, self.pieces
        _, _, slopes = shortest_on_pieces(pieces, path)
        inner = path[1:-1]
        sizes = np.linalg.norm(pieces.ends[inner] - pieces.begins[inner], axis=1)
        halved = np.flatnonzero(sizes > max(policy.min_piece, 0.49 * sizes.max(initial=0.0)))
        if not len(halved) or self.count + len(halved) > len(pieces.edge):
            return False
        for k in halved:
            self._halve(int(inner[k]), float(slopes[k + 1]))
        return True

    def _halve(self, k: int, slope: float) -> None:
        """Replace a piece by its halves."""
        pieces, n = self.pieces, self.count
        p, q, edge = pieces.begins[k].copy(), pieces.ends[k].copy(), int(pieces.edge[k])
        middle = 0.5 * (p + q)
        if n == len(self.links):
            more = np.full((2 * n, 2 * n), UNKNOWN)
            more[:n, :n] = self.links
            self.links = more
        # what is blocked for a piece is blocked for its halves
        for new, old in ((self.links[n], self.links[k]), (self.links[:, n], self.links[:, k])):
            old[:] = np.where(old == np.inf, np.inf, UNKNOWN)
            new[:] = old
        self.links[k, n] = self.links[n, k] = np.inf
        self.count += 1
        self._put(k, p, middle, edge, slope)
        self._put(n, middle, q, edge, slope)


def _clipped(shapes: Polytopes, region: Region) -> tuple[Floats, Floats, Ints]:
    """Return the parts of edges in a region and in front of all walls: ends, and numbers."""
    walls = [*shapes.walls]
    for axis in range(3):
        for sign, bound in ((1.0, region.bounds[0, axis]), (-1.0, region.bounds[1, axis])):
            if math.isfinite(bound):
                walls.append(np.array([*(sign * np.eye(3)[axis]), sign * bound]))
    begins, ends = shapes.begins, shapes.ends
    low, high = np.zeros(len(begins)), np.ones(len(begins))
    for wall in walls:
        at, to = begins @ wall[:3] - wall[3], ends @ wall[:3] - wall[3]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = at / (at - to)
        low = np.where((at < 0.0) & (to > at), np.maximum(low, share), low)
        high = np.where((to < 0.0) & (to < at), np.minimum(high, share), high)
        high = np.where((at < 0.0) & (to < 0.0), -1.0, high)
    kept: Bools = low <= high
    low, high = low[kept, None], high[kept, None]
    span = ends[kept] - begins[kept]
    return begins[kept] + low * span, begins[kept] + high * span, np.flatnonzero(kept)


def _distances(begins: Floats, ends: Floats, point: Floats) -> Floats:
    """Return the distances of segments (n, 3) from a point, metres."""
    span = ends - begins
    squares = np.maximum((span * span).sum(1), 1e-300)
    share = np.clip(((point - begins) * span).sum(1) / squares, 0.0, 1.0)
    return np.asarray(np.linalg.norm(begins + share[:, None] * span - point, axis=1))

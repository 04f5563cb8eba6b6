"""Shortest paths in any class: over the contacts of tangents and arcs, or over milestones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.roadmap.outline import Outline, is_free
from netsp.roadmap.roadmap_policy import RoadmapPolicy
from netsp.roadmap.tangents import JOINING, TangentGraph, build_tangents


class ShortestPaths(Protocol):
    """Shortest planar paths between numbered nodes, in coordinates relative to the base."""

    def tree(self, source: int) -> tuple[Floats, Ints]:
        """Return the length to every node (inf if there is no path) and its predecessor."""

    def draw(self, source: int, target: int, before: Ints) -> Floats:
        """Return the (k, 2) polyline of the path from the source to a target along a tree."""


def _positions_by_number(numbers: Ints, count: int) -> list[Ints]:
    """Return the positions, in order, of each number below `count`."""
    order = np.argsort(numbers, kind="stable")
    return np.split(order, np.searchsorted(numbers[order], np.arange(1, count + 1)))[:count]


class RemainingLengths(NamedTuple):
    """Shortest lengths to a point.

    Attributes
    ----------
    source
        Length from the base.
    to_end
        (e,) lengths from the end of every tangent.
    """

    source: float
    to_end: Floats


class ContactGraph:
    """Exact shortest paths: tangents join contact points across free space, arcs along the outline.

    Nodes 0 … points - 1 are the outline's points (base, goals); then follow two for every tangent.
    """

    def __init__(
        self,
        outline: Outline,
        tangents: TangentGraph | None = None,
        clock: Clock | None = None,
        policy: RoadmapPolicy | None = None,
    ) -> None:
        from scipy.sparse import csr_array

        self.policy = policy = policy or RoadmapPolicy()
        self.outline = outline
        if tangents is None:
            tangents = build_tangents(outline, np.inf, clock, policy.sight)
        t = self.tangents = tangents
        arcs, points = len(t.arcs), len(t.points)
        self.points = points
        edges = len(t.target)
        tail = np.repeat(np.arange(len(t.start) - 1), np.diff(t.start))
        # contact points + 2 e (+ 1) is the departure (arrival) of tangent e
        leave = np.where(tail >= 2 * arcs, tail - 2 * arcs, points + 2 * np.arange(edges))
        arrive = np.where(
            t.target >= 2 * arcs, t.target - 2 * arcs, points + 2 * np.arange(edges) + 1
        )
        rows, cols, cost = [leave], [arrive], [t.length]
        self.arc = np.full(points + 2 * edges, -1, dtype=np.int64)
        self.angle = np.zeros(points + 2 * edges)
        each = policy.contacts.arcs_per_check
        outward, inward = (
            _positions_by_number(tail // 2, arcs),
            _positions_by_number(t.target // 2, arcs),
        )
        for a in range(arcs):
            if clock is not None and a % each == each - 1:
                clock.check(JOINING)
            out_e, in_e = outward[a], inward[a]
            contact = np.concatenate([leave[out_e], arrive[in_e]])
            theta = np.concatenate([t.angle[out_e, 0], t.angle[in_e, 1]])
            key = np.mod(theta - t.arcs[a, 3] + 1e-6, 2.0 * np.pi)
            order = np.argsort(key)
            contact, key = contact[order], key[order]
            self.arc[contact], self.angle[contact] = a, theta[order]
            step = np.diff(key) * t.arcs[a, 2]
            rows.append(contact[:-1])
            cols.append(contact[1:])
            cost.append(step)
            if t.full[a] and len(contact) > 1:
                rows.append(contact[-1:])
                cols.append(contact[:1])
                cost.append(np.array([(key[0] + 2.0 * np.pi - key[-1]) * t.arcs[a, 2]]))
        r, c, d = np.concatenate(rows), np.concatenate(cols), np.concatenate(cost)
        size = points + 2 * edges
        # scipy takes a stored zero for no edge
        self._graph = csr_array((np.maximum(d, 1e-300), (r, c)), shape=(size, size))
        self._edge_of = np.concatenate([np.full(points, -1), np.repeat(np.arange(edges), 2)])

    def lengths(self, sources: Sequence[int] | None = None) -> Floats:
        """Return the (sources, points) shortest lengths between the outline's points, by default
        from all."""
        from scipy.sparse.csgraph import dijkstra

        rows = np.arange(self.points) if sources is None else np.asarray(sources)
        found = dijkstra(self._graph, directed=False, indices=rows)
        return np.asarray(found[:, : self.points])

    def distance_bounds(self, height: Floats, up: Callable[[], bool]) -> Floats:
        """Return (points, points) lower bounds on 3D paths between points of given heights, in any
        class. They are straight distances for points not looked at when the time was up."""
        planar = np.zeros((self.points, self.points))
        count = self.policy.contacts.sources_per_check
        for first in range(0, self.points, count):
            if up():
                break
            rows = range(first, min(first + count, self.points))
            planar[rows] = self.lengths(rows)
        planar[~np.isfinite(planar)] = 0.0
        x, y = self.outline.points.T
        straight = np.hypot(np.subtract.outer(x, x), np.subtract.outer(y, y))
        planar = np.maximum(np.maximum(planar, planar.T), straight * (1.0 - 1e-12))
        return np.asarray(np.hypot(planar, np.subtract.outer(height, height)))

    def remaining_lengths(self, goal: int) -> RemainingLengths:
        """Return lower bounds on the lengths to a point."""
        from scipy.sparse.csgraph import dijkstra

        found = dijkstra(self._graph, directed=False, indices=goal)
        ends = np.where(
            self.tangents.target >= 2 * len(self.tangents.arcs),
            self.tangents.target - 2 * len(self.tangents.arcs),
            self.points + 2 * np.arange(len(self.tangents.target)) + 1,
        )
        # a rounding less, so that it is never more than what is left
        return RemainingLengths(float(found[0]), np.asarray(found[ends]) * (1.0 - 1e-12))

    def tree(self, source: int, limit: float = np.inf) -> tuple[Floats, Ints]:
        """Return the length to every node and its predecessor; inf for nodes beyond a limit."""
        from scipy.sparse.csgraph import dijkstra

        d, before = dijkstra(
            self._graph, directed=False, indices=source, return_predecessors=True, limit=limit
        )
        return d, before.astype(np.int64)

    def _limits(self, straight: float) -> list[float]:
        """Return the limits of the searches for a point at a distance; one if the distance is 0."""
        ratios = self.policy.contacts.limit_ratios
        return [*(ratio * straight for ratio in ratios if straight > 0.0), np.inf]

    def tree_to(self, source: int, target: int) -> Ints:
        """Return the predecessors on shortest paths from a point, as far as another point."""
        straight = math.dist(self.outline.points[source], self.outline.points[target])
        for limit in self._limits(straight):
            length, before = self.tree(source, limit)
            if np.isfinite(length[target]):
                break
        return before

    def tree_to_nearest(self, source: int, count: int) -> tuple[Floats, Ints]:
        """Return `tree`, limited so that it holds at least `count` points with the source."""
        if count >= self.points:
            return self.tree(source)
        straight = np.sort(np.hypot(*(self.outline.points - self.outline.points[source]).T))
        for limit in self._limits(float(straight[count - 1])):
            length, before = self.tree(source, limit)
            if np.isfinite(length[: self.points]).sum() >= count:
                break
        return length, before

    def draw(self, source: int, target: int, before: Ints) -> Floats:
        """Return the (k, 2) polyline, with arcs as circumscribed chords, finer where a gap is
        narrow."""
        nodes = _walk_back(source, target, before)
        step = self.policy.paths.max_chord_turn
        for _ in range(12):
            xy = self._polyline(nodes, step)
            if is_free(xy, self.outline.blockers):
                break
            step /= 2.0
        # drawn from where points on a boundary stand off; their places decide sides of rays
        xy[0], xy[-1] = self.outline.places[source], self.outline.places[target]
        return xy

    def _polyline(self, nodes: list[int], step: float) -> Floats:
        t = self.tangents
        out: list[tuple[float, float]] = []
        for k, node in enumerate(nodes):
            on_arc = k > 0 and self.arc[node] >= 0 and self.arc[node] == self.arc[nodes[k - 1]]
            if on_arc and self._edge_of[node] != self._edge_of[nodes[k - 1]]:
                cx, cy, r = t.arcs[self.arc[node], :3]
                first = self.angle[nodes[k - 1]]
                turn = math.remainder(self.angle[node] - first, 2.0 * math.pi)
                if abs(turn) > 1e-7:
                    count = max(1, math.ceil(abs(turn) / step - 1e-9))
                    half = turn / count / 2.0
                    radius = r / math.cos(half)
                    for i in range(count):
                        theta = first + half * (2 * i + 1)
                        out.append((cx + radius * math.cos(theta), cy + radius * math.sin(theta)))
            out.append(self._place(node))
        xy = np.array(out)
        keep = np.concatenate([[True], np.any(np.diff(xy, axis=0) != 0.0, axis=1)])
        return np.asarray(xy[keep] if keep.sum() > 1 else xy[[0, -1]])

    def _place(self, node: int) -> tuple[float, float]:
        if node < self.points:
            x, y = self.outline.points[node]
        else:
            e, end = divmod(node - self.points, 2)
            x, y = self.tangents.ends[e, 2 * end : 2 * end + 2]
        return float(x), float(y)


class MilestoneGraph:
    """Shortest paths over the straight edges of a roadmap."""

    def __init__(self, places: Floats, edges: Ints) -> None:
        from scipy.sparse import csr_array

        self.places = places
        cost = np.hypot(*(places[edges[:, 0]] - places[edges[:, 1]]).T)
        self._graph = csr_array(
            (np.maximum(cost, 1e-300), (edges[:, 0], edges[:, 1])), shape=(len(places), len(places))
        )

    def tree(self, source: int) -> tuple[Floats, Ints]:
        """Return the length to every node and its predecessor."""
        from scipy.sparse.csgraph import dijkstra

        d, before = dijkstra(self._graph, directed=False, indices=source, return_predecessors=True)
        return d, before.astype(np.int64)

    def draw(self, source: int, target: int, before: Ints) -> Floats:
        """Return the (k, 2) polyline of the path from the source to a target along a tree."""
        return np.asarray(self.places[_walk_back(source, target, before)])


def _walk_back(source: int, target: int, before: Ints) -> list[int]:
    nodes = [target]
    while nodes[-1] != source:
        nodes.append(int(before[nodes[-1]]))
    return nodes[::-1]

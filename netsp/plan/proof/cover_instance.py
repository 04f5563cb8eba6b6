"""Instance over the classes that the checker finds, with estimates of its costs."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.hsignature import Word
from netsp.hsignature.rays import signature
from netsp.model.problem import Problem
from netsp.roadmap.travel_graph import TravelGraph
from netsp_check.dual_bound import Bound
from netsp_check.leg_bounds import shortest_path


class CoverInstance:
    """Vertices of the checker's cover within reach, and costs of the legs between them.

    Attributes
    ----------
    vertices
        (n,) indices in the cover; the first one is the base.
    cluster
        (n,) cluster of each vertex.
    labels
        Word of the tether at each vertex.
    costs
        (n, n) costs in grid units; inf within a cluster, and where precedences exclude a leg. They
        are estimates, until `settle` replaces them by the checker's own.
    before
        Pairs of clusters of which the first is visited before the second.
    """

    def __init__(
        self,
        problem: Problem,
        graph: TravelGraph,
        bound: Bound,
        vertices: Iterable[int],
        check: Callable[[], None] = lambda: None,
    ) -> None:
        tree = bound.tree
        self.tree, self.legs, self.before = tree, bound.legs, tree.triangulation.problem.before
        self.vertices: Ints = np.array(sorted(vertices), dtype=np.int64)
        of_place = np.array(tree.triangulation.problem.cluster)
        place = np.array([tree.vertices[v].place for v in self.vertices.tolist()])
        self.cluster: Ints = of_place[place]
        self.labels = [self._word(problem, v) for v in self.vertices.tolist()]
        known = {
            (int(graph.goal[k]) if k else 0, word): k for k, word in enumerate(graph.signatures)
        }
        at = [known.get((p, w), -1) for p, w in zip(place.tolist(), self.labels, strict=True)]
        self.at: Ints = np.array(at, dtype=np.int64)
        self.costs = self._estimates(graph, check)
        is_allowed = np.zeros((bound.clusters, bound.clusters), dtype=bool)
        for g, h in bound.allowed:
            is_allowed[g, h] = is_allowed[h, g] = True
        self.costs[~is_allowed[np.ix_(self.cluster, self.cluster)]] = np.inf
        self._is_settled: Bools = np.zeros(self.costs.shape, dtype=bool)

    def rows_of(self, graph_vertices: Iterable[int]) -> list[int] | None:
        """Return the rows of vertices of the travel graph; None if one is missing."""
        row = {k: i for i, k in enumerate(self.at.tolist()) if k >= 0}
        found = [row.get(int(v)) for v in graph_vertices]
        return None if None in found else [int(i) for i in found if i is not None]

    def settle(self, legs: Ints, check: Callable[[], None] = lambda: None) -> None:
        """Replace the estimates of legs (k, 2) by the checker's bounds."""
        legs = legs[~self._is_settled[legs[:, 0], legs[:, 1]]]
        names = self.vertices[legs].tolist()
        for (i, j), (u, v) in zip(legs.tolist(), names, strict=True):
            check()
            self._is_settled[i, j] = self._is_settled[j, i] = True
            self.costs[i, j] = self.costs[j, i] = self.legs.bound(u, v, 2)

    def _word(self, problem: Problem, vertex: int) -> Word:
        tree = self.tree
        points, scale = tree.triangulation.points, 2.0**-tree.triangulation.problem.grid
        start, end = tree.vertices[0], tree.vertices[vertex]
        gates = [(points[a], points[b]) for a, b in tree.gates(start, end)]
        path, _ = shortest_path(start.at, end.at, gates)
        xy = np.array(path, dtype=float) * scale + np.array(problem.base[:2])
        # on a ray, as beside a structure to inspect, the side depends on the last bit
        xy[[0, -1]] = [problem.points[v.place, :2] for v in (start, end)]
        return signature(xy, problem.representative_points)

    def _estimates(self, graph: TravelGraph, check: Callable[[], None]) -> Floats:
        size = len(self.vertices)
        out = np.full((size, size), np.inf)
        is_known: Bools = self.at >= 0
        known = np.flatnonzero(is_known)
        at = self.at[known]
        measured = np.asarray(graph.costs, dtype=float)
        scale = 2.0**self.tree.triangulation.problem.grid
        out[np.ix_(known, known)] = np.floor(measured[np.ix_(at, at)] * scale)
        others = np.flatnonzero(~is_known)
        for i in others.tolist():
            check()
            for j in np.flatnonzero(self.cluster != self.cluster[i]).tolist():
                bound = self.legs.bound(int(self.vertices[i]), int(self.vertices[j]), 1)
                out[i, j] = out[j, i] = bound
        return out

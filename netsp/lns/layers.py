"""For a fixed order of goals the best classes are a shortest path through layers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from numba import njit

from netsp.travel import TravelGraph

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


NEAR = 12
"""A cluster is put back next to one of so many nearest clusters."""

RANKED = 60
"""Neighbours of a cluster that are taken out with it."""


@dataclass(frozen=True)
class Instance:
    """A travel graph with vertices grouped by cluster: members of cluster c are
    order[start[c]:start[c + 1]]."""

    graph: TravelGraph

    @cached_property
    def order(self) -> Ints:
        """Vertices by cluster."""
        return np.argsort(self.graph.cluster, kind="stable").astype(np.int64)

    @cached_property
    def start(self) -> Ints:
        """Row starts into `order`."""
        c = self.graph.cluster[self.order]
        return np.searchsorted(c, np.arange(self.graph.goal_count + 2)).astype(np.int64)

    @cached_property
    def costs(self) -> Floats:
        """(V, V) leg costs in the order of `order`; where there is no leg, a cost that no tour of
        legs alone can reach."""
        costs = self.graph.costs[np.ix_(self.order, self.order)]
        finite = np.isfinite(costs)
        most = float(np.max(costs[finite], initial=0.0))
        costs[~finite] = 2.0 * (self.graph.goal_count + 1) * most + 1.0
        return np.ascontiguousarray(costs)

    @cached_property
    def cluster_costs(self) -> Floats:
        """(m + 1, m + 1) least leg cost between clusters."""
        k = len(self.start) - 1
        out = np.full((k, k), np.inf)
        for a in range(k):
            for b in range(k):
                block = self.costs[
                    self.start[a] : self.start[a + 1], self.start[b] : self.start[b + 1]
                ]
                if a != b:
                    out[a, b] = block.min()
        return out

    @cached_property
    def rank(self) -> Ints:
        """(m + 1, k) clusters nearest to each, nearest first; the base is among them."""
        d = self.cluster_costs.copy()
        np.fill_diagonal(d, np.inf)
        return np.argsort(d, axis=1, kind="stable")[:, : min(RANKED, len(d) - 1)]

    @cached_property
    def near(self) -> npt.NDArray[np.bool_]:
        """(m + 1, m + 1) whether one of two clusters is among the `NEAR` nearest of the other."""
        out = np.zeros_like(self.cluster_costs, dtype=bool)
        out[np.arange(len(out))[:, None], self.rank[:, :NEAR]] = True
        return np.asarray(out | out.T)

    def order_of(self, tour: npt.ArrayLike) -> Ints:
        """Clusters in the order of a tour of the travel graph, base first."""
        return np.asarray(self.graph.cluster[np.asarray(tour, dtype=np.int64)])

    def original(self, tour: npt.ArrayLike) -> tuple[int, ...]:
        """Vertices of the travel graph from positions in `order`."""
        return tuple(int(v) for v in self.order[np.asarray(tour, dtype=np.int64)])


@njit(cache=True)
def best_classes(clusters, start, costs):
    """Length and vertices (base first) of the best tour that visits clusters in the given order."""
    n = len(clusters)
    largest = 0
    for k in range(n):
        largest = max(largest, start[clusters[k] + 1] - start[clusters[k]])
    reach = np.full((n, largest), np.inf)
    back = np.zeros((n, largest), dtype=np.int64)
    for k in range(n):
        c = clusters[k]
        for j in range(start[c + 1] - start[c]):
            v = start[c] + j
            if k == 0:
                reach[k, j] = costs[0, v]
                continue
            p = clusters[k - 1]
            for i in range(start[p + 1] - start[p]):
                d = reach[k - 1, i] + costs[start[p] + i, v]
                if d < reach[k, j]:
                    reach[k, j], back[k, j] = d, i
    best, at = np.inf, 0
    c = clusters[n - 1]
    for j in range(start[c + 1] - start[c]):
        d = reach[n - 1, j] + costs[start[c] + j, 0]
        if d < best:
            best, at = d, j
    tour = np.zeros(n + 1, dtype=np.int64)
    for k in range(n - 1, -1, -1):
        tour[k + 1] = start[clusters[k]] + at
        at = back[k, at]
    return best, tour

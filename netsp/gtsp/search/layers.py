"""Vertices grouped by cluster, and the best of them for a fixed order of clusters."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.interpretation import interprets
from netsp.base.compiled.kernel import kernel
from netsp.base.deprecated import deprecated_method, deprecated_names
from netsp.gtsp.gtsp_policy import LocalSearchPolicy
from netsp.gtsp.instance import Instance
from netsp.gtsp.search.links import EQUAL_LENGTHS
from netsp.model.arrangement import UNORDERED

MIN_GAIN = 1e-9
"""Tolerance of the saving of an accepted move, relative to the length, if costs are not whole
numbers: lengths of legs are accurate to about this share."""

MAX_EXACT_SUM = 2.0**53
"""Tolerance of whole numbers: up to this size double precision adds them without rounding."""


class LayeredInstance:
    """Vertices grouped by cluster: members of cluster c are order[start[c]:start[c + 1]].

    Parameters
    ----------
    cluster : ndarray of int, shape (V,)
        Cluster of each vertex.
    costs : ndarray, shape (V, V)
        Costs of legs. A missing leg (inf) gets a cost that no tour of existing legs reaches.
    labels : ndarray of int, shape (V,), optional
        Vertices of the travel graph; by default the positions.
    before : ndarray of bool, optional
        Which clusters come before which (`Instance.before`).
    policy : LocalSearchPolicy
        Policy of searches over this instance.
    """

    def __init__(
        self,
        cluster: Ints,
        costs: Floats,
        labels: Ints | None = None,
        before: Bools = UNORDERED,
        policy: LocalSearchPolicy = LocalSearchPolicy(),
    ) -> None:
        self.policy = policy
        self.before = before
        self.clusters = int(cluster.max()) + 1
        self.order: Ints = np.argsort(cluster, kind="stable").astype(np.int64)
        self.start: Ints = np.searchsorted(
            cluster[self.order], np.arange(self.clusters + 1)
        ).astype(np.int64)
        self.labels = self.order if labels is None else labels[self.order]
        grouped = costs[np.ix_(self.order, self.order)]
        finite = np.isfinite(grouped)
        largest = float(np.max(grouped[finite], initial=0.0))
        self.penalty = 2.0 * self.clusters * largest + 1.0
        grouped[~finite] = self.penalty
        self.costs: Floats = np.ascontiguousarray(grouped)
        self._largest_cost = largest if finite.all() else self.penalty

    @cached_property
    def min_gain(self) -> float:
        """Minimum relative saving of an accepted move; 0 if lengths are exact."""
        sums = (self.clusters + 1) * self._largest_cost
        exact = sums < MAX_EXACT_SUM and bool((self.costs == np.rint(self.costs)).all())
        return 0.0 if exact else MIN_GAIN

    @property
    def rounding(self) -> float:
        """Largest gain that rounding may cause in the tables of `netsp.gtsp.search.links`: the
        share `EQUAL_LENGTHS` of the largest cost for each cluster, ahead and behind."""
        return 2.0 * (self.clusters + 1) * EQUAL_LENGTHS * self._largest_cost

    @classmethod
    def of_graph(
        cls, graph: Instance, policy: LocalSearchPolicy = LocalSearchPolicy()
    ) -> LayeredInstance:
        """Return an instance of all vertices of a travel graph, whose legs are measured.

        Parameters
        ----------
        graph : Instance
            Travel graph.
        policy : LocalSearchPolicy
            Policy of searches.
        """
        return cls(graph.cluster, graph.costs, before=graph.before, policy=policy)

    of = deprecated_method("of", "of_graph")

    @classmethod
    def among(
        cls, graph: Instance, core: Ints, policy: LocalSearchPolicy = LocalSearchPolicy()
    ) -> LayeredInstance:
        """Return an instance of some vertices of a travel graph, whose legs are measured.

        Parameters
        ----------
        graph : Instance
            Travel graph.
        core : ndarray of int
            Vertices, the base first.
        policy : LocalSearchPolicy
            Policy of searches.
        """
        if len(core) == len(graph):
            return cls.of_graph(graph, policy)
        costs = graph.costs_among(core)
        return cls(graph.cluster[core], costs, core, graph.before, policy)

    @property
    def largest(self) -> int:
        """Number of vertices of the largest cluster."""
        return int(np.diff(self.start).max())

    @cached_property
    def cluster_costs(self) -> Floats:
        """(m + 1, m + 1) minimum cost of a leg between clusters; inf on the diagonal."""
        rows = np.minimum.reduceat(self.costs, self.start[:-1], axis=0)
        out = np.minimum.reduceat(rows, self.start[:-1], axis=1)
        np.fill_diagonal(out, np.inf)
        return np.asarray(out)

    @cached_property
    def rank(self) -> Ints:
        """(m + 1, k) nearest clusters of each, the base among them, nearest first."""
        d = self.cluster_costs
        count = min(self.policy.ruined_neighbours, len(d) - 1)
        return np.argsort(d, axis=1, kind="stable")[:, :count]

    @cached_property
    def near(self) -> npt.NDArray[np.bool_]:
        """(m + 1, m + 1) whether a cluster may be inserted next to another, because one of the two
        is among the nearest of the other."""
        out = np.zeros_like(self.cluster_costs, dtype=bool)
        out[np.arange(len(out))[:, None], self.rank[:, : self.policy.near_clusters]] = True
        return np.asarray(out | out.T)

    @cached_property
    def neighbours(self) -> tuple[Ints, Ints]:
        """Clusters that each cluster may be inserted next to, nearest first: start of the stretch
        of each cluster (m + 2,), and all stretches joined."""
        c, p = np.nonzero(self.near)
        order = np.lexsort((self.cluster_costs[c, p], c))
        return np.searchsorted(c, np.arange(len(self.near) + 1)), p[order]

    def original(self, tour: npt.ArrayLike) -> tuple[int, ...]:
        """Return the labels of positions in `order`.

        Parameters
        ----------
        tour : array_like of int
            Positions.
        """
        return tuple(int(v) for v in self.labels[np.asarray(tour, dtype=np.int64)])


@kernel
def best_classes(clusters: Ints, start: Ints, costs: Floats) -> tuple[float, Ints]:
    """Return length and vertices (base first) of the best tour that visits clusters in an order.

    It is a shortest path through layers.
    """
    n = len(clusters)
    largest = 0
    for k in range(n):
        largest = max(largest, start[clusters[k] + 1] - start[clusters[k]])
    reach = np.full((n, largest), np.inf)
    predecessor = np.zeros((n, largest), dtype=np.int64)
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
                    reach[k, j], predecessor[k, j] = d, i
    best, at = np.inf, 0
    c = clusters[n - 1]
    for j in range(start[c + 1] - start[c]):
        d = reach[n - 1, j] + costs[start[c] + j, 0]
        if d < best:
            best, at = d, j
    tour = np.zeros(n + 1, dtype=np.int64)
    for k in range(n - 1, -1, -1):
        tour[k + 1] = start[clusters[k]] + at
        at = predecessor[k, at]
    return best, tour


@interprets(best_classes)
def _best_classes_in_numpy(clusters: Ints, start: Ints, costs: Floats) -> tuple[float, Ints]:
    """Vectorise `best_classes` over the vertices of a cluster."""
    n = len(clusters)
    members = [slice(start[c], start[c + 1]) for c in clusters]
    reach, predecessors = costs[0, members[0]], []
    for previous, current in pairwise(members):
        lengths = reach[:, None] + costs[previous, current]
        predecessors.append(lengths.argmin(axis=0))
        reach = lengths.min(axis=0)
    closed = reach + costs[members[-1], 0]
    at = int(closed.argmin())
    best, tour = float(closed[at]), np.zeros(n + 1, dtype=np.int64)
    for k in range(n - 1, -1, -1):
        tour[k + 1] = members[k].start + at
        at = int(predecessors[k - 1][at]) if k else 0
    return best, tour


__getattr__ = deprecated_names(globals(), Instance="LayeredInstance")

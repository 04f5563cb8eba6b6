"""For a fixed order of goals the best classes are a shortest path through layers."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.interpretation import interprets
from netsp.base.compiled.kernel import kernel
from netsp.gtsp.search.links import EVEN
from netsp.gtsp.travel.graph import TravelGraph
from netsp.model.arrangement import UNORDERED

NEAR = 12
"""A cluster is put back next to one of so many nearest clusters."""

RANKED = 60
"""Neighbours of a cluster that are taken out with it."""

MIN_GAIN = 1e-9
"""Least relative saving of an accepted move, if costs are not whole numbers. Lengths of legs are
accurate to about this share."""

EXACT = 2.0**53
"""Limit below which double precision adds whole numbers without rounding."""


class Instance:
    """Vertices grouped by cluster: members of cluster c are order[start[c]:start[c + 1]].

    Parameters
    ----------
    cluster : ndarray of int, shape (V,)
        Cluster of each vertex.
    costs : ndarray, shape (V, V)
        Leg costs; where there is no leg (inf), a cost that no tour of legs alone can reach is put.
    labels : ndarray of int, shape (V,), optional
        What the vertices are called outside.
    before : ndarray of bool, optional
        Which clusters come before which (`TravelGraph.before`).
    """

    def __init__(
        self, cluster: Ints, costs: Floats, labels: Ints | None = None, before: Bools = UNORDERED
    ) -> None:
        self.before = before
        self.clusters = int(cluster.max()) + 1
        self.order: Ints = np.argsort(cluster, kind="stable").astype(np.int64)
        self.start: Ints = np.searchsorted(
            cluster[self.order], np.arange(self.clusters + 1)
        ).astype(np.int64)
        self.labels = self.order if labels is None else labels[self.order]
        grouped = costs[np.ix_(self.order, self.order)]
        finite = np.isfinite(grouped)
        most = float(np.max(grouped[finite], initial=0.0))
        self.penalty = 2.0 * self.clusters * most + 1.0
        grouped[~finite] = self.penalty
        self.costs: Floats = np.ascontiguousarray(grouped)
        self._largest_cost = most if finite.all() else self.penalty

    @cached_property
    def min_gain(self) -> float:
        """Least relative saving of an accepted move; 0 if lengths are exact."""
        sums = (self.clusters + 1) * self._largest_cost
        exact = sums < EXACT and bool((self.costs == np.rint(self.costs)).all())
        return 0.0 if exact else MIN_GAIN

    @property
    def rounding(self) -> float:
        """Largest gain that rounding may cause in the tables of `netsp.gtsp.search.links`: the
        share `EVEN` of the highest cost for each cluster, ahead and behind."""
        return 2.0 * (self.clusters + 1) * EVEN * self._largest_cost

    @classmethod
    def of(cls, graph: TravelGraph) -> Instance:
        """All of a travel graph.

        Parameters
        ----------
        graph : TravelGraph
            The graph; its legs are measured.

        Returns
        -------
        Instance
            All its vertices.
        """
        return cls(graph.cluster, graph.costs, before=graph.before)

    @classmethod
    def among(cls, graph: TravelGraph, core: Ints) -> Instance:
        """Some vertices of a travel graph.

        Parameters
        ----------
        graph : TravelGraph
            The graph; the legs among these vertices are measured.
        core : ndarray of int
            The vertices, the base first.

        Returns
        -------
        Instance
            These vertices.
        """
        if len(core) == len(graph):
            return cls.of(graph)
        return cls(graph.cluster[core], graph.costs_among(core), core, graph.before)

    @property
    def largest(self) -> int:
        """Most vertices of a cluster."""
        return int(np.diff(self.start).max())

    @cached_property
    def cluster_costs(self) -> Floats:
        """(m + 1, m + 1) least leg cost between clusters; inf on the diagonal."""
        rows = np.minimum.reduceat(self.costs, self.start[:-1], axis=0)
        out = np.minimum.reduceat(rows, self.start[:-1], axis=1)
        np.fill_diagonal(out, np.inf)
        return np.asarray(out)

    @cached_property
    def rank(self) -> Ints:
        """(m + 1, k) clusters nearest to each, nearest first; the base is among them."""
        d = self.cluster_costs
        return np.argsort(d, axis=1, kind="stable")[:, : min(RANKED, len(d) - 1)]

    @cached_property
    def near(self) -> npt.NDArray[np.bool_]:
        """(m + 1, m + 1) whether one of two clusters is among the `NEAR` nearest of the other."""
        out = np.zeros_like(self.cluster_costs, dtype=bool)
        out[np.arange(len(out))[:, None], self.rank[:, :NEAR]] = True
        return np.asarray(out | out.T)

    @cached_property
    def beside(self) -> tuple[Ints, Ints]:
        """Next to which clusters each is put: where those of each begin (m + 2,), and all of them,
        the nearest first."""
        c, p = np.nonzero(self.near)
        order = np.lexsort((self.cluster_costs[c, p], c))
        return np.searchsorted(c, np.arange(len(self.near) + 1)), p[order]

    def original(self, tour: npt.ArrayLike) -> tuple[int, ...]:
        """Labels of the vertices at positions in `order`.

        Parameters
        ----------
        tour : array_like of int
            Positions.

        Returns
        -------
        tuple of int
            Labels.
        """
        return tuple(int(v) for v in self.labels[np.asarray(tour, dtype=np.int64)])


@kernel
def best_classes(clusters: Ints, start: Ints, costs: Floats) -> tuple[float, Ints]:
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


@interprets(best_classes)
def _best_classes_in_numpy(clusters: Ints, start: Ints, costs: Floats) -> tuple[float, Ints]:
    """Vectorise `best_classes` over the vertices of a cluster."""
    n = len(clusters)
    own = [slice(start[c], start[c + 1]) for c in clusters]
    reach, back = costs[0, own[0]], []
    for before, now in pairwise(own):
        lengths = reach[:, None] + costs[before, now]
        back.append(lengths.argmin(axis=0))
        reach = lengths.min(axis=0)
    home = reach + costs[own[-1], 0]
    at = int(home.argmin())
    best, tour = float(home[at]), np.zeros(n + 1, dtype=np.int64)
    for k in range(n - 1, -1, -1):
        tour[k + 1] = own[k].start + at
        at = int(back[k - 1][at]) if k else 0
    return best, tour

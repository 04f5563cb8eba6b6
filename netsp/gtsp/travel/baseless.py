"""Generalised TSPs without a base: a closed tour through one vertex of each cluster.

Solvers want a base. Every tour takes a vertex of the smallest cluster, so the shortest tour is the
shortest of those from each of its vertices; where that cluster has one vertex, as is usual in
GTSPLIB, there is one such problem.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.errors import InputError, counted
from netsp.gtsp.travel.costs import CostTable
from netsp.gtsp.travel.graph import TravelGraph
from netsp.model.bound_scope import Scope


class BaselessGraph(TravelGraph):
    """A travel graph without a base, for `netsp.solve_graph`; solvers take what `rooted` makes of
    it."""

    def __repr__(self) -> str:
        """In a line."""
        return (
            f"<TravelGraph: {counted(self.cluster_count, 'cluster')} of {len(self)} vertices, "
            "no base>"
        )

    @property
    def cluster_count(self) -> int:
        """Number of clusters."""
        return int(self.cluster.max()) + 1

    @property
    def roots(self) -> Ints:
        """Vertices of the smallest cluster, the first of those."""
        return self.members(int(np.argmin(np.bincount(self.cluster))))

    @property
    def costs_to_base(self) -> Floats:
        """There is no base: InputError."""
        raise InputError("graph: has no base; expected solve_graph to be called with it")

    def is_tour(self, tour: Sequence[int]) -> bool:
        """Whether vertices are a tour: exactly one of every cluster.

        Parameters
        ----------
        tour : sequence of int
            Vertices, the first not repeated at the end.

        Returns
        -------
        bool
            True for a tour.
        """
        return self.takes_one_of_each(tour)

    def rooted(self, root: int) -> tuple[TravelGraph, Ints]:
        """The tours through a vertex, as those from a base.

        Parameters
        ----------
        root : int
            The vertex.

        Returns
        -------
        graph : TravelGraph
            The root is its base; the other vertices of that cluster are left out.
        vertices : ndarray of int
            What its vertices are here.
        """
        own = int(self.cluster[root])
        vertices = np.r_[root, np.flatnonzero(self.cluster != own)]
        cluster = self.cluster[vertices]
        cluster = np.where(cluster == own, 0, cluster + (cluster < own))
        costs = self.costs[np.ix_(vertices, vertices)]
        table = CostTable(costs, cluster)
        graph = TravelGraph(cluster, [()] * len(cluster), np.zeros(len(cluster)), table)
        graph.grain, graph.declared_scope = self.grain, Scope.PART
        return graph, vertices

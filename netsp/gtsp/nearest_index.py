"""Legs from a few vertices to all others, where most legs are not held.

Which of the vertices that a program visits each other one is nearest to decides which side of a cut
it comes to lie on. Legs that are in no better tour say that as well as any: without them cuts are
so much weaker that programs over 6000 and 13,000 classes stood still that are solved with them. So
these legs are found again, and kept as long as the same vertices are visited.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Bools, Ints
from netsp.gtsp.travel.graph import TravelGraph

NOBODY: Ints = np.zeros(0, dtype=np.int64)


class NearestIndex:
    """The legs from the vertices that were asked for last, (r, k) in single precision.

    Parameters
    ----------
    graph
        Whose legs may be found in blocks.
    """

    def __init__(self, graph: TravelGraph) -> None:
        self._graph, self._some, self._costs = graph, NOBODY, np.zeros((0, len(graph)), np.float32)

    def nearest(self, vertices: Ints, some: Ints) -> Ints:
        """(k,) which of some (positions, no two alike) has the cheapest leg to each of k vertices.

        Raises
        ------
        LimitReachedError
            The graph's clock was up before legs were found.
        """
        order = np.argsort(some)
        rows = some[order]
        costs = np.empty((len(rows), len(vertices)), dtype=np.float32)
        there = np.isin(rows, self._some)
        costs[there] = self._costs[np.isin(self._some, rows)]
        # not held twice, and if time is up nothing is
        self._some, self._costs = NOBODY, np.zeros((0, len(vertices)), np.float32)
        missing = rows[~there]
        if len(missing):
            for found, block in self._graph.costs_in_blocks(vertices, missing):
                costs[np.searchsorted(rows, found)] = block
        self._some, self._costs = rows, costs
        return np.asarray(order[np.argmin(costs, axis=0)])

    def restrict(self, keep: Bools) -> None:
        """All but the vertices marked are forgotten."""
        kept = keep[self._some]
        self._some = np.cumsum(keep)[self._some[kept]] - 1
        self._costs = self._costs[np.ix_(kept, keep)]

"""Index of the nearest of a few vertices, where sparse costs lack most legs.

Cuts over the visited vertices are extended to all vertices: each vertex joins the side of the
visited vertex nearest to it. Legs that have been fixed out count here like any others; without them
cuts are much weaker. So these legs are measured again, and kept as long as the same vertices are
visited.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Bools, Ints
from netsp.gtsp.instance import Instance

NO_VERTICES: Ints = np.zeros(0, dtype=np.int64)


class NearestIndex:
    """Costs (r, k), in single precision, of the legs from the vertices of the last query.

    Parameters
    ----------
    graph
        Graph whose legs can be found in blocks.
    """

    def __init__(self, graph: Instance) -> None:
        self._graph = graph
        self._rows, self._costs = NO_VERTICES, np.zeros((0, len(graph)), np.float32)

    def nearest(self, vertices: Ints, rows: Ints) -> Ints:
        """Return which of some rows (distinct positions) is nearest to each of k vertices.

        Raises
        ------
        LimitReachedError
            The graph's clock was up before legs were found.
        """
        order = np.argsort(rows)
        ascending = rows[order]
        costs = np.empty((len(ascending), len(vertices)), dtype=np.float32)
        is_held = np.isin(ascending, self._rows)
        costs[is_held] = self._costs[np.isin(self._rows, ascending)]
        # released before others are found: memory holds them once, and nothing if time is up
        self._rows, self._costs = NO_VERTICES, np.zeros((0, len(vertices)), np.float32)
        missing = ascending[~is_held]
        if len(missing):
            for found, block in self._graph.costs_in_blocks(vertices, missing):
                costs[np.searchsorted(ascending, found)] = block
        self._rows, self._costs = ascending, costs
        return np.asarray(order[np.argmin(costs, axis=0)])

    def restrict(self, keep: Bools) -> None:
        """Remove all vertices except those marked."""
        kept = keep[self._rows]
        self._rows = np.cumsum(keep)[self._rows[kept]] - 1
        self._costs = self._costs[np.ix_(kept, keep)]

"""Leg costs that are measured only when they matter.

A leg of a long tether costs a search, and there are many. As long as a leg is only bounded from
below, everything that is proven with the bound holds: the relaxation is one of a cheaper world. So
the relaxation runs on bounds first, and what it cannot rule out is measured.
"""

from __future__ import annotations

import numpy as np

from netsp.arrays import Bools, Floats, Ints
from netsp.memory import ask
from netsp.travel.graph import TravelGraph

MEASURE_AT_ONCE = 400
"""So many vertices or fewer are measured altogether: that takes a second at most."""


BYTES_PER_LEG = 24.0
"""Of memory that a proof takes: the values, what is known of them, and what is in between."""


class LegCosts:
    """Costs among some vertices of a travel graph.

    Parameters
    ----------
    vertices
        (k,) of the graph.
    cluster
        (k,).
    values
        (k, k) lengths or lower bounds, inf within a cluster.
    exact
        (k, k) which are lengths; None when all are.
    """

    def __init__(self, graph: TravelGraph) -> None:
        self.graph = graph
        self.vertices: Ints = np.arange(len(graph))
        self.cluster: Ints = graph.cluster
        self.values: Floats
        self.exact: Bools | None = None
        if graph.measured or len(graph) <= MEASURE_AT_ONCE:
            self.values = np.array(graph.costs)
            return
        ask(
            BYTES_PER_LEG * len(graph) ** 2,
            f"bounding every tour over {len(graph)} homotopy classes",
            "lower tether_length or max_classes, or use solver 'lns'",
        )
        self.values = graph.lower_bounds()
        self.exact = np.zeros(self.values.shape, dtype=bool)
        self.values[0] = self.values[:, 0] = graph.costs_to_base
        self.exact[0] = self.exact[:, 0] = True

    def __len__(self) -> int:
        return len(self.vertices)

    def measure(self, chosen: Ints) -> None:
        """Measure all legs among chosen rows."""
        if self.exact is None:
            return
        grid = np.ix_(chosen, chosen)
        known = self.exact[grid] | (self.cluster[chosen][:, None] == self.cluster[chosen][None, :])
        if known.all():
            return
        open_rows = chosen[~known.all(axis=1)]
        grid = np.ix_(open_rows, open_rows)
        self.values[grid] = self.graph.costs_among(self.vertices[open_rows])
        self.exact[grid] = True

    def measure_legs(self, legs: Ints) -> bool:
        """Measure legs (k, 2), rows; whether any of them was only bounded."""
        if self.exact is None or not len(legs):
            return False
        u, v = legs[~self.exact[legs[:, 0], legs[:, 1]]].T
        if not len(u):
            return False
        chosen, at = np.unique(np.concatenate([u, v]), return_inverse=True)
        i, j = at[: len(u)], at[len(u) :]
        asked = np.zeros((len(chosen), len(chosen)), dtype=bool)
        asked[i, j] = asked[j, i] = True
        lengths = self.graph.costs_among(self.vertices[chosen], asked)[i, j]
        self.values[u, v] = self.values[v, u] = lengths
        self.exact[u, v] = self.exact[v, u] = True
        return True

    def measure_all(self, asked: Bools) -> None:
        """Measure everything asked for (symmetric); what is neither measured nor asked for counts
        as no leg from now on."""
        if self.exact is not None:
            asked = asked & ~self.exact
            new = self.graph.costs_among(self.vertices, asked)
            self.values = np.where(asked, new, np.where(self.exact, self.values, np.inf))
            self.exact = None

    def restrict(self, keep: Bools) -> None:
        """Forget all vertices but those marked."""
        self.vertices, self.cluster = self.vertices[keep], self.cluster[keep]
        self.values = np.ascontiguousarray(self.values[np.ix_(keep, keep)])
        if self.exact is not None:
            self.exact = self.exact[np.ix_(keep, keep)]

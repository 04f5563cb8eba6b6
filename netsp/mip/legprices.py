"""Lagrangian bound (`netsp.mip.lagrangian_bound`) and reduced costs over a list of legs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.mip.cuts import Cut
from netsp.mip.lagrangian_bound import lowest_of_clusters, rounding
from netsp.mip.program import Duals


class LegPrices:
    """Reduced costs of a list of legs, all others being excluded.

    Parameters
    ----------
    legs : ndarray of int, shape (k, 2)
        The legs.
    costs : ndarray, shape (k,)
        Cost of each leg.
    cluster : ndarray of int, shape (V,)
        Cluster of each vertex.
    cuts : sequence of Cut
        Cuts of the program.
    duals : Duals
        Any dual values; better ones give a better bound.

    Attributes
    ----------
    bound : float
        Lower bound on the tours of these legs; inf if a cluster has fewer than two of them.
    """

    def __init__(
        self, legs: Ints, costs: Floats, cluster: Ints, cuts: Sequence[Cut], duals: Duals
    ) -> None:
        u, v = legs.T
        reduced = costs - (duals.degree[u] + duals.degree[v])
        vertex = 2.0 * duals.degree - duals.cluster[cluster]
        for k in np.flatnonzero(duals.cut < 0.0).tolist():
            cut, mu = cuts[k], float(duals.cut[k])
            reduced[cut.inside[u] & cut.inside[v]] -= mu
            if cut.teeth:
                reduced[cut.in_tooth(cluster, legs)] -= mu
            vertex[cut.inside & (cluster != cut.cluster)] += mu
        lowest, second = _two_lowest(legs, reduced, len(cluster))
        cost = vertex + 0.5 * (lowest + second)
        cheapest = lowest_of_clusters(cost, cluster)
        self._legs, self._reduced, self._lowest, self._second = legs, reduced, lowest, second
        self._above = vertex - cheapest[cluster]
        if np.isinf(cheapest).any():
            self.bound = float("inf")
            return
        fixed = float((duals.cluster + cheapest).sum()) + duals.constant
        self.bound = fixed - rounding(duals, float(np.abs(reduced).max(initial=0.0)))

    def exceeds(self, gap: float) -> Bools:
        """Return the mask (k,) of legs whose tours all exceed the bound by more than a gap."""
        r = total = self._reduced
        for end in self._legs.T:
            other = np.where(r <= self._lowest[end], self._second[end], self._lowest[end])
            total = total + self._above[end] + 0.5 * other
        return np.asarray(total > gap)


def _two_lowest(legs: Ints, values: Floats, size: int) -> tuple[Floats, Floats]:
    """Return the two lowest values (V,) of the legs at each vertex, inf where legs are missing."""
    ends, leg_values = legs.ravel(), np.repeat(values, 2)
    order = np.lexsort((leg_values, ends))
    ends, leg_values = ends[order], np.append(leg_values[order], [np.inf, np.inf])
    first = np.searchsorted(ends, np.arange(size))
    count = np.bincount(ends, minlength=size)
    lowest = np.where(count > 0, leg_values[first], np.inf)
    second = np.where(count > 1, leg_values[np.minimum(first + 1, len(leg_values) - 1)], np.inf)
    return lowest, second

"""The bound of `netsp.mip.lagrangian_bound` over a list of legs, all others being out of the
question."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.mip.cuts import Cut
from netsp.mip.lagrangian_bound import least_of_clusters, rounding
from netsp.mip.program import Duals


class LegPrices:
    """Reduced costs of legs.

    Parameters
    ----------
    legs : ndarray of int, shape (k, 2)
        All that there are.
    costs : ndarray, shape (k,)
        Of these.
    cluster : ndarray of int, shape (V,)
        Of the vertices.
    cuts : sequence of Cut
        Of the program.
    duals : Duals
        Any; the better they are, the better the bound.

    Attributes
    ----------
    bound : float
        No tour of these legs is shorter; inf where some cluster cannot be reached by two of them.
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
        least, second = _two_least(legs, reduced, len(cluster))
        cost = vertex + 0.5 * (least + second)
        cheapest = least_of_clusters(cost, cluster)
        self._legs, self._reduced, self._least, self._second = legs, reduced, least, second
        self._above = vertex - cheapest[cluster]
        if np.isinf(cheapest).any():
            self.bound = float("inf")
            return
        fixed = float((duals.cluster + cheapest).sum()) + duals.constant
        self.bound = fixed - rounding(duals, float(np.abs(reduced).max(initial=0.0)))

    def above(self, missing: float) -> Bools:
        """(k,) legs that no tour less than so much longer than the bound uses (see
        `netsp.mip.prices`)."""
        r = total = self._reduced
        for end in self._legs.T:
            other = np.where(r <= self._least[end], self._second[end], self._least[end])
            total = total + self._above[end] + 0.5 * other
        return np.asarray(total > missing)


def _two_least(legs: Ints, values: Floats, size: int) -> tuple[Floats, Floats]:
    """(V,) the two least values of the legs at each vertex; inf where there are not so many."""
    ends, of_both = legs.ravel(), np.repeat(values, 2)
    order = np.lexsort((of_both, ends))
    ends, of_both = ends[order], np.append(of_both[order], [np.inf, np.inf])
    first = np.searchsorted(ends, np.arange(size))
    count = np.bincount(ends, minlength=size)
    least = np.where(count > 0, of_both[first], np.inf)
    second = np.where(count > 1, of_both[np.minimum(first + 1, len(of_both) - 1)], np.inf)
    return least, second

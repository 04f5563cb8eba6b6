"""Stages of a proof: integer duals, and the legs that they strike out, as the checker does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.mip.cuts import Cut

Pair = tuple[int, int]


@dataclass(frozen=True)
class DualStage:
    """Integer duals of clusters, cuts and pairs of clusters.

    Attributes
    ----------
    prices
        (m + 1,) duals of clusters.
    cuts, multipliers
        Cuts over the rows of the instance, and their multipliers, positive whole numbers.
    pair_prices
        Duals of pairs that must be adjacent.
    """

    prices: Ints
    cuts: tuple[Cut, ...]
    multipliers: tuple[int, ...]
    pair_prices: dict[Pair, int] = field(default_factory=dict)

    @classmethod
    def rounded(
        cls, by_cluster: Floats, cuts: Sequence[Cut], by_cut: Floats, pairs: dict[Pair, int]
    ) -> DualStage:
        """Return the stage of an LP's dual values."""
        whole = np.rint(by_cut).astype(np.int64).tolist()
        held = [(c, b) for c, b in zip(cuts, whole, strict=True) if b > 0]
        prices = np.floor(by_cluster).astype(np.int64)
        return cls(prices, tuple(c for c, _ in held), tuple(b for _, b in held), pairs)

    def constant(self) -> int:
        """Return the bound if no leg has a negative reduced cost."""
        total = 2 * int(self.prices.sum()) + sum(self.pair_prices.values())
        for cut, b in zip(self.cuts, self.multipliers, strict=True):
            total -= round(2.0 * cut.rhs) * b
        return total

    def reduced_costs(self, costs: Floats, cluster: Ints) -> Floats:
        """Return the reduced costs (n, n) of all legs; inf for missing ones."""
        potential = self.prices[cluster].astype(float)
        twice = np.zeros_like(costs)
        if self.cuts:
            outer = np.array([c.inside for c in self.cuts])
            inner = np.array([c.inside & (cluster != c.cluster) for c in self.cuts])
            b = np.array(self.multipliers, dtype=float)
            potential += b @ inner
            weighted = (b[:, None] * inner).T @ outer.astype(float)
            both = (b[:, None] * inner).T @ inner.astype(float)
            twice += weighted + weighted.T - both
        clusters = int(cluster.max()) + 1
        of_pair = np.zeros((clusters, clusters))
        for cut, b in zip(self.cuts, self.multipliers, strict=True):
            if not cut.teeth:
                continue
            pairs = cut.tooth_pairs(clusters)
            np.fill_diagonal(pairs, False)
            if is_crossing(cut):
                inside, outside = np.flatnonzero(cut.inside), np.flatnonzero(~cut.inside)
                counted = b * pairs[np.ix_(cluster[inside], cluster[outside])]
                twice[np.ix_(inside, outside)] += counted
                twice[np.ix_(outside, inside)] += counted.T
            else:
                of_pair += b * pairs
        for (g, h), price in self.pair_prices.items():
            of_pair[g, h] -= 0.5 * price
            of_pair[h, g] -= 0.5 * price
        twice += of_pair[np.ix_(cluster, cluster)]
        return np.asarray(costs - potential[:, None] - potential[None, :] + 2.0 * twice)

    def to_json(self, vertices: Ints, cluster: Ints, reach: int) -> dict[str, Any]:
        """Return the stage as a proof holds it.

        Parameters
        ----------
        vertices
            (n,) indices in the cover of the rows of the cuts' sets.
        cluster
            Cluster of each vertex of the cover.
        reach
            Reach of the stage, of `strike_out`.
        """
        cuts = []
        for cut, b in zip(self.cuts, self.multipliers, strict=True):
            inside = vertices[cut.inside]
            if not cut.teeth:
                cuts.append(["subtour", b, _mask(inside), int(cut.cluster)])
                continue
            teeth = [list(t) for t in cut.teeth]
            if is_crossing(cut):
                cuts.append(["parity", b, _mask(inside), teeth])
            else:
                whole = np.flatnonzero(np.isin(cluster, cluster[inside]))
                cuts.append(["comb", b, _mask(whole), teeth])
        out: dict[str, Any] = {"a": self.prices.tolist(), "cuts": cuts, "reach": reach}
        if self.pair_prices:
            out["p"] = [[g, h, price] for (g, h), price in self.pair_prices.items()]
        return out


def is_crossing(cut: Cut) -> bool:
    """Return whether only legs across the handle count in the teeth of a cut."""
    return all(len(t) == 2 for t in cut.teeth)


def _mask(vertices: Ints) -> str:
    """Return the hexadecimal mask of a set of vertices."""
    return f"{sum(1 << v for v in vertices.tolist()):x}"


@dataclass(frozen=True)
class Struck:
    """Outcome of a stage.

    Attributes
    ----------
    vertices, legs
        Masks (n,) and (n, n) of what is left.
    excess
        Twice the bound, less twice the target.
    reach
        Reach that the stage needs.
    """

    vertices: Bools
    legs: Bools
    excess: int
    reach: int


def strike_out(reduced: Floats, cluster: Ints, vertices: Bools, legs: Bools, short: int) -> Struck:
    """Return what a stage leaves over, as `netsp_check.dual_bound` finds it.

    Parameters
    ----------
    reduced
        (n, n) reduced costs.
    vertices, legs
        What earlier stages left over.
    short
        Constant of the stage less the target.
    """
    r = np.where(legs, reduced, np.inf)
    lowest = np.sort(np.partition(r, 1, axis=1)[:, :2], axis=1)
    reach = np.inf
    for _ in range(2):
        low = np.minimum(lowest, reach)
        pair = np.where(vertices, low.sum(axis=1), np.inf)
        cheapest = np.full(int(cluster.max()) + 1, np.inf)
        np.minimum.at(cheapest, cluster, pair)
        if not np.isfinite(cheapest).all():
            return Struck(np.zeros_like(vertices), np.zeros_like(legs), 0, _finite(lowest))
        excess = 2.0 * short + cheapest.sum()
        above = -cheapest[cluster]
        left = vertices & (excess + above + pair < 0.0)
        if not left.any() or reach < np.inf:
            break
        reach = np.ceil(-0.5 * excess - (low[:, 0] + above)[left].min()) + 1.0
    reach = reach if np.isfinite(reach) else _finite(lowest)
    other = np.where(r <= low[:, :1], low[:, 1:], low[:, :1])
    total = excess + above[:, None] + above[None, :] + 2.0 * r + other + other.T
    kept = legs & (r < reach) & (total < 0.0) & left[:, None] & left[None, :]
    return Struck(left, kept, int(excess), int(reach))


def _finite(lowest: Floats) -> int:
    """Return one more than the largest finite number."""
    values = lowest[np.isfinite(lowest)]
    return int(values.max(initial=0.0)) + 1

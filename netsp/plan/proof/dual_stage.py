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
            multipliers = np.array(self.multipliers, dtype=float)
            potential += multipliers @ inner
            weighted = (multipliers[:, None] * inner).T @ outer.astype(float)
            both = (multipliers[:, None] * inner).T @ inner.astype(float)
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

    def to_json(self, table: CutTable, reach: int | None) -> dict[str, Any]:
        """Return the stage as a proof holds it, with its cuts by their numbers in a table."""
        numbers = [table.number(cut) for cut in self.cuts]
        cuts = [[k, b] for k, b in zip(numbers, self.multipliers, strict=True)]
        out: dict[str, Any] = {"a": self.prices.tolist(), "cuts": cuts}
        if reach is not None:
            out["reach"] = reach
        if self.pair_prices:
            out["p"] = [[g, h, price] for (g, h), price in self.pair_prices.items()]
        return out


class CutTable:
    """Cuts of a proof, each once.

    Attributes
    ----------
    vertices
        (n,) indices in the cover of the rows of the cuts' sets.
    rows
        Cuts as a proof holds them: kind, mask of vertices, and cluster or teeth.
    """

    def __init__(self, vertices: Ints, cluster: Ints) -> None:
        self.vertices, self._cluster = vertices, cluster
        self.rows: list[list[Any]] = []
        self._numbers: dict[str, int] = {}

    def number(self, cut: Cut) -> int:
        """Return the number of a cut, which is added if it is new."""
        row = self._row(cut)
        number = self._numbers.setdefault(repr(row), len(self.rows))
        if number == len(self.rows):
            self.rows.append(row)
        return number

    def _row(self, cut: Cut) -> list[Any]:
        inside = self.vertices[cut.inside]
        if not cut.teeth:
            return ["subtour", _mask(inside), int(cut.cluster)]
        teeth = [[int(c) for c in t] for t in cut.teeth]
        if is_crossing(cut):
            return ["parity", _mask(inside), teeth]
        whole = np.flatnonzero(np.isin(self._cluster, self._cluster[inside]))
        return ["comb", _mask(whole), teeth]


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
    reach
        Reach that the stage needs; None if it needs none.
    """

    vertices: Bools
    legs: Bools
    reach: int | None


def strike_out(
    reduced: Floats,
    cluster: Ints,
    vertices: Bools,
    legs: Bools,
    short: int,
    room: float | None = None,
) -> Struck:
    """Return what a stage leaves over, as `netsp_check.dual_bound` finds it.

    Parameters
    ----------
    reduced
        (n, n) reduced costs.
    vertices, legs
        What earlier stages left over.
    short
        Constant of the stage less the target.
    room
        Amount by which the reach is larger than needed; None for a stage over known legs, which
        needs no reach.
    """
    r = np.where(legs, reduced, np.inf)
    lowest = np.sort(np.partition(r, 1, axis=1)[:, :2], axis=1)
    within = _Clipped(lowest, cluster, vertices, short)
    if not within.has_left(np.inf):
        reach = None if room is None else within.closing_reach(room)
        return Struck(np.zeros_like(vertices), np.zeros_like(legs), reach)
    reach = None if room is None else within.open_reach(room)
    limit = np.inf if reach is None else float(reach)
    excess, above, left = within.values(limit)
    low = np.minimum(lowest, limit)
    other = np.where(r <= low[:, :1], low[:, 1:], low[:, :1])
    with np.errstate(invalid="ignore"):  # vertices without legs are not left
        total = excess + above[:, None] + above[None, :] + 2.0 * r + other + other.T
    kept = legs & (r < limit) & (total < 0.0) & left[:, None] & left[None, :]
    return Struck(left, kept, reach)


@dataclass(frozen=True)
class _Clipped:
    """Bounds of a stage in which reduced costs beyond a reach count as the reach."""

    lowest: Floats
    cluster: Ints
    vertices: Bools
    short: int

    def values(self, reach: float) -> tuple[float, Floats, Bools]:
        """Return twice the bound less twice the target, minus the share of each vertex's cluster in
        the bound (n,), and the mask of the vertices left."""
        low = np.where(self.vertices, np.minimum(self.lowest, reach).sum(axis=1), np.inf)
        cheapest = np.full(int(self.cluster.max()) + 1, np.inf)
        np.minimum.at(cheapest, self.cluster, low)
        if not np.isfinite(cheapest).all():
            return 0.0, -low, np.zeros_like(self.vertices)
        excess = 2.0 * self.short + float(cheapest.sum())
        above = -cheapest[self.cluster]
        return excess, above, self.vertices & (excess + above + low < 0.0)

    def has_left(self, reach: float) -> bool:
        """Return whether vertices are left."""
        return bool(self.values(reach)[2].any())

    def open_reach(self, room: float) -> int:
        """Return a reach beyond which all legs are struck out."""
        reach = np.inf
        while True:
            excess, above, left = self.values(reach)
            low = np.minimum(self.lowest[:, 0], reach)
            needed = np.ceil(-0.5 * excess - (low + above)[left].min())
            if needed <= reach < np.inf:
                return int(reach)
            reach = needed + np.ceil(room)

    def closing_reach(self, room: float) -> int:
        """Return a small reach with which no vertex is left."""
        values = np.unique(self.lowest[np.isfinite(self.lowest)])
        first, last = 0, len(values)
        while first < last:
            middle = (first + last) // 2
            if self.has_left(values[middle]):
                first = middle + 1
            else:
                last = middle
        reach = values[first] if first < len(values) else values.max(initial=0.0)
        return int(np.ceil(reach + room)) + 1

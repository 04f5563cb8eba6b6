"""The cells of covers, and what legs between them cost: from classes, or from ways.

The cheapest leg between the classes of two cells is one between the cells (`ClassCovers`). Where
there are too many classes the shortest way of any from the one to the other is (`PathCovers`,
`netsp.gtsp.travel.parity_distances`); then a bound holds for classes that a roadmap has left out,
too.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.gtsp.sparse_costs import Rows, SparseCosts
from netsp.gtsp.travel.parity_distances import WaysByParity
from netsp.mip.cover_bounds import Cells, packed


class Covers(Protocol):
    """The covers of a problem."""

    obstacles: int

    def cells(self, obstacles: tuple[int, ...]) -> Cells:
        """Of the cover of some obstacles, those that a tether reaches."""

    def costs(self, cells: Cells) -> Floats:
        """(m, m) costs between cells, inf within a goal."""

    def costs_by_parity(self, cells: Cells, ends: Ints) -> Floats:
        """(k, n, 2) costs of the cheapest legs between two cells (k, 2) that write an even, and an
        odd, number of letters of each obstacle; inf, or less, where there is none."""


class ClassCovers:
    """Covers below the classes of a travel graph.

    Parameters
    ----------
    costs
        (V, V) of legs; or those that are left, and only the classes that have any.
    cluster
        (V,) of the vertices.
    odd
        (V, n) as of `netsp.mip.parity_cuts.odd_letters`.
    """

    def __init__(self, costs: Floats | SparseCosts, cluster: Ints, odd: Bools) -> None:
        self._costs, self._cluster, self._odd = costs, cluster, odd
        self._with_legs = (
            costs.with_legs()
            if isinstance(costs, SparseCosts)
            else np.ones(len(cluster), dtype=bool)
        )
        self.obstacles = odd.shape[1]

    def cells(self, obstacles: tuple[int, ...]) -> Cells:
        """As of `Covers.cells`."""
        both = np.column_stack([self._cluster, packed(self._odd, obstacles)])
        both = np.unique(both[self._with_legs], axis=0)
        return Cells(obstacles, *np.ascontiguousarray(both.T))

    def costs(self, cells: Cells) -> Floats:
        """As of `Covers.costs`."""
        own, order, row = self._members(cells)
        out = np.full((len(cells.cluster), len(cells.cluster)), np.inf)
        if isinstance(self._costs, SparseCosts):
            _least_in_rows(self._costs.held, own, out)
        else:
            _least(self._costs, order, row, out)
        return out

    def costs_by_parity(self, cells: Cells, ends: Ints) -> Floats:
        """As of `Covers.costs_by_parity`."""
        own, order, row = self._members(cells)
        if isinstance(self._costs, SparseCosts):
            return _least_by_parity_in_rows(self._costs.held, self._odd, own, order, row, ends)
        return _least_by_parity(self._costs, self._odd, order, row, ends)

    def _members(self, cells: Cells) -> tuple[Ints, Ints, Ints]:
        """The cell of each vertex, the vertices cell by cell, and where those of each begin."""
        own = cells.of(self._cluster, self._odd)
        order = np.argsort(own, kind="stable")
        row = np.searchsorted(own[order], np.arange(len(cells.cluster) + 1))
        return own, order, row.astype(np.int64)


@kernel
def _least(costs: Floats, order: Ints, row: Ints, out: Floats) -> None:
    """The least cost between the members of two cells."""
    cells = len(row) - 1
    own = np.empty(len(order), dtype=np.int64)
    for b in range(cells):
        for k in range(row[b], row[b + 1]):
            own[order[k]] = b
    for a in range(cells):
        for k in range(row[a], row[a + 1]):
            u = order[k]
            for v in range(len(order)):
                out[a, own[v]] = min(out[a, own[v]], costs[u, v])


@kernel
def _least_by_parity(costs: Floats, odd: Bools, order: Ints, row: Ints, ends: Ints) -> Floats:
    """(k, n, 2) of the least costs between the members of two cells."""
    n = odd.shape[1]
    out = np.full((len(ends), n, 2), np.inf)
    for k in range(len(ends)):
        a, b = ends[k]
        for u in order[row[a] : row[a + 1]]:
            for v in order[row[b] : row[b + 1]]:
                for i in range(n):
                    side = 1 if odd[u, i] != odd[v, i] else 0
                    out[k, i, side] = min(out[k, i, side], costs[u, v])
    return out


@kernel
def _least_in_rows(rows: Rows, own: Ints, out: Floats) -> None:
    """The least cost of the legs left between two cells."""
    for u in range(len(own)):
        for k in range(rows.first[u], rows.first[u] + rows.size[u]):
            a, b = own[u], own[rows.other[k]]
            if a >= 0 and b >= 0:
                out[a, b] = min(out[a, b], rows.cost[k])


@kernel
def _least_by_parity_in_rows(
    rows: Rows, odd: Bools, own: Ints, order: Ints, row: Ints, ends: Ints
) -> Floats:  # fmt: skip
    """As `_least_by_parity`."""
    n = odd.shape[1]
    out = np.full((len(ends), n, 2), np.inf)
    for e in range(len(ends)):
        a, b = ends[e]
        for u in order[row[a] : row[a + 1]]:
            for k in range(rows.first[u], rows.first[u] + rows.size[u]):
                v = rows.other[k]
                if own[v] != b:
                    continue
                for i in range(n):
                    side = 1 if odd[u, i] != odd[v, i] else 0
                    out[e, i, side] = min(out[e, i, side], rows.cost[k])
    return out


class PathCovers:
    """Covers below whatever classes there are.

    Parameters
    ----------
    ways
        Between goals.
    tether
        What it is longer than is in no tour.
    """

    def __init__(self, ways: WaysByParity, tether: float) -> None:
        self._ways, self.obstacles = ways, ways.obstacles
        self._odd = ways.odd_of(np.arange(len(ways.ends)))
        reached = (ways.ends[:, 0] == 0) & (ways.length <= tether)
        self._goal, self._at_goal = ways.ends[reached, 1], self._odd[reached]
        self._size = int(ways.ends.max()) + 1
        self._pair = ways.ends[:, 0] * self._size + ways.ends[:, 1]
        self._order = np.argsort(self._pair, kind="stable")
        every = np.arange(self._size**2 + 1)
        self._row = np.searchsorted(self._pair[self._order], every).astype(np.int64)

    def cells(self, obstacles: tuple[int, ...]) -> Cells:
        """As of `Covers.cells`."""
        both = np.column_stack([self._goal, packed(self._at_goal, obstacles)])
        both = np.unique(np.vstack([[[0, 0]], both]), axis=0)
        return Cells(obstacles, *np.ascontiguousarray(both.T))

    def costs(self, cells: Cells) -> Floats:
        """As of `Covers.costs`."""
        code, ways = packed(self._odd, cells.obstacles), self._ways
        order = np.lexsort((ways.length, code, self._pair))
        pair, code = self._pair[order], code[order]
        new = np.ones(len(order), dtype=bool)
        new[1:] = (pair[1:] != pair[:-1]) | (code[1:] != code[:-1])
        order, pair, code = order[new], pair[new], code[new]
        row = np.searchsorted(pair, np.arange(self._size**2 + 1)).astype(np.int64)
        m = len(cells.cluster)
        costs = np.full((m, m), np.inf)
        _between(
            cells.cluster, cells.code, row, code, ways.length[order], ways.reach, self._size, costs
        )
        return costs

    def costs_by_parity(self, cells: Cells, ends: Ints) -> Floats:
        """As of `Covers.costs_by_parity`."""
        low = np.minimum(cells.cluster[ends[:, 0]], cells.cluster[ends[:, 1]])
        high = np.maximum(cells.cluster[ends[:, 0]], cells.cluster[ends[:, 1]])
        wanted = cells.code[ends[:, 0]] ^ cells.code[ends[:, 1]]
        code = packed(self._odd, cells.obstacles)
        return _shortest_by_parity(
            low * self._size + high, wanted, self._row, self._order, code, self._odd,
            self._ways.length, self._ways.reach,
        )  # fmt: skip


@kernel
def _between(
    cluster: Ints, code: Ints, row: Ints, codes: Ints, lengths: Floats, reach: float, size: int,
    costs: Floats,
) -> None:  # fmt: skip
    """Fill in costs between cells: the ways between a pair of goals are rows row[pair] to
    row[pair + 1] of ascending codes."""
    m = len(cluster)
    for a in range(m):
        for b in range(a + 1, m):
            g, h = cluster[a], cluster[b]
            if g == h:
                continue
            wanted = code[a] ^ code[b]
            pair = g * size + h if g < h else h * size + g
            low, high = row[pair], row[pair + 1]
            after = high
            while low < high:
                middle = (low + high) // 2
                if codes[middle] < wanted:
                    low = middle + 1
                else:
                    high = middle
            cost = reach
            if low < after and codes[low] == wanted:
                cost = lengths[low]
            costs[a, b] = costs[b, a] = cost


@kernel
def _shortest_by_parity(
    pair: Ints, wanted: Ints, row: Ints, order: Ints, code: Ints, odd: Bools, lengths: Floats,
    reach: float,
) -> Floats:  # fmt: skip
    """(k, n, 2) of the shortest ways of a code between a pair of goals: those are order[row[pair]]
    to order[row[pair + 1]]."""
    n = odd.shape[1]
    out = np.full((len(pair), n, 2), reach)
    for k in range(len(pair)):
        for w in order[row[pair[k]] : row[pair[k] + 1]]:
            if code[w] != wanted[k]:
                continue
            for i in range(n):
                side = 1 if odd[w, i] else 0
                out[k, i, side] = min(out[k, i, side], lengths[w])
    return out

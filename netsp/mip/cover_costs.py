"""Cells of covers, and the costs of legs between them.

A leg between two cells costs as much as the cheapest leg between their classes (`ClassCovers`). If
there are too many classes, it costs as much as the shortest path between their goals with the right
parities (`PathCovers`, `netsp.gtsp.travel.parity_distances`); then a bound also holds for classes
that a roadmap has left out.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.gtsp.sparse_costs import Rows, SparseCosts
from netsp.gtsp.travel.parity_distances import ParityDistances
from netsp.mip.cover_bounds import Cells, packed


class Covers(Protocol):
    """Covers of a problem, one for each set of barriers."""

    barriers: int

    def cells(self, barriers: tuple[int, ...]) -> Cells:
        """Return the cells that are reached in the cover of some barriers."""

    def costs(self, cells: Cells) -> Floats:
        """Return the costs (m, m) between cells, inf within a goal."""

    def costs_by_parity(self, cells: Cells, ends: Ints) -> Floats:
        """Return the costs (k, n, 2) of the cheapest legs between two cells (k, 2), by parity.

        Entry [k, i, p] covers the legs that cross barrier i an even (p = 0) or an odd (p = 1)
        number of times. It is inf, or any lower bound on such a cost, if there is no such leg.
        """


class ClassCovers:
    """Covers with the costs of legs between classes.

    Parameters
    ----------
    costs
        (V, V) costs of legs; or sparse costs, where classes without legs are ignored.
    cluster
        (V,) cluster of each vertex.
    odd
        Result of `netsp.mip.parity_cuts.odd_numbers`.
    """

    def __init__(self, costs: Floats | SparseCosts, cluster: Ints, odd: Bools) -> None:
        self._costs, self._cluster, self._odd = costs, cluster, odd
        self._with_legs = (
            costs.with_legs()
            if isinstance(costs, SparseCosts)
            else np.ones(len(cluster), dtype=bool)
        )
        self.barriers = odd.shape[1]

    def cells(self, barriers: tuple[int, ...]) -> Cells:
        """Return the cells of the cover of some barriers."""
        both = np.column_stack([self._cluster, packed(self._odd, barriers)])
        both = np.unique(both[self._with_legs], axis=0)
        return Cells(barriers, *np.ascontiguousarray(both.T))

    def costs(self, cells: Cells) -> Floats:
        """Return the costs (m, m) between cells."""
        cell, order, row = self._members(cells)
        out = np.full((len(cells.cluster), len(cells.cluster)), np.inf)
        if isinstance(self._costs, SparseCosts):
            _fill_lowest_in_rows(self._costs.held, cell, out)
        else:
            _fill_lowest(self._costs, order, row, out)
        return out

    def costs_by_parity(self, cells: Cells, ends: Ints) -> Floats:
        """Return the costs (k, n, 2) of the cheapest legs between two cells (k, 2), by parity."""
        cell, order, row = self._members(cells)
        if isinstance(self._costs, SparseCosts):
            return _lowest_by_parity_in_rows(self._costs.held, self._odd, cell, order, row, ends)
        return _lowest_by_parity(self._costs, self._odd, order, row, ends)

    def _members(self, cells: Cells) -> tuple[Ints, Ints, Ints]:
        """Return the cell of each vertex, the vertices by cell, and the start of each cell's."""
        cell = cells.cells_of(self._cluster, self._odd)
        order = np.argsort(cell, kind="stable")
        row = np.searchsorted(cell[order], np.arange(len(cells.cluster) + 1))
        return cell, order, row.astype(np.int64)


@kernel
def _fill_lowest(costs: Floats, order: Ints, row: Ints, out: Floats) -> None:
    """Fill in the lowest costs between the members of two cells."""
    cells = len(row) - 1
    cell = np.empty(len(order), dtype=np.int64)
    for b in range(cells):
        for k in range(row[b], row[b + 1]):
            cell[order[k]] = b
    for a in range(cells):
        for k in range(row[a], row[a + 1]):
            u = order[k]
            for v in range(len(order)):
                out[a, cell[v]] = min(out[a, cell[v]], costs[u, v])


@kernel
def _lowest_by_parity(costs: Floats, odd: Bools, order: Ints, row: Ints, ends: Ints) -> Floats:
    """Return the lowest costs (k, n, 2) between the members of two cells, by parity."""
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
def _fill_lowest_in_rows(rows: Rows, cell: Ints, out: Floats) -> None:
    """Fill in the lowest costs of the legs left between two cells."""
    for u in range(len(cell)):
        for k in range(rows.first[u], rows.first[u] + rows.size[u]):
            a, b = cell[u], cell[rows.other[k]]
            if a >= 0 and b >= 0:
                out[a, b] = min(out[a, b], rows.cost[k])


@kernel
def _lowest_by_parity_in_rows(
    rows: Rows, odd: Bools, cell: Ints, order: Ints, row: Ints, ends: Ints
) -> Floats:
    """Return the lowest costs (k, n, 2) of the legs left between two cells, by parity."""
    n = odd.shape[1]
    out = np.full((len(ends), n, 2), np.inf)
    for e in range(len(ends)):
        a, b = ends[e]
        for u in order[row[a] : row[a + 1]]:
            for k in range(rows.first[u], rows.first[u] + rows.size[u]):
                v = rows.other[k]
                if cell[v] != b:
                    continue
                for i in range(n):
                    side = 1 if odd[u, i] != odd[v, i] else 0
                    out[e, i, side] = min(out[e, i, side], rows.cost[k])
    return out


class PathCovers:
    """Covers with the lengths of shortest paths between goals, whatever classes a roadmap keeps.

    Parameters
    ----------
    paths
        Shortest paths between goals, by parity.
    max_length
        Maximum length of a path from the base; goals are reached by paths up to it.
    """

    def __init__(self, paths: ParityDistances, max_length: float) -> None:
        self._paths, self.barriers = paths, paths.barriers
        self._odd = paths.odd_of(np.arange(len(paths.ends)))
        reached = (paths.ends[:, 0] == 0) & (paths.length <= max_length)
        self._goal, self._at_goal = paths.ends[reached, 1], self._odd[reached]
        self._size = int(paths.ends.max()) + 1
        self._pair = paths.ends[:, 0] * self._size + paths.ends[:, 1]
        self._order = np.argsort(self._pair, kind="stable")
        pairs = np.arange(self._size**2 + 1)
        self._row = np.searchsorted(self._pair[self._order], pairs).astype(np.int64)

    def cells(self, barriers: tuple[int, ...]) -> Cells:
        """Return the cells of the cover of some barriers."""
        both = np.column_stack([self._goal, packed(self._at_goal, barriers)])
        both = np.unique(np.vstack([[[0, 0]], both]), axis=0)
        return Cells(barriers, *np.ascontiguousarray(both.T))

    def costs(self, cells: Cells) -> Floats:
        """Return the costs (m, m) between cells."""
        code, paths = packed(self._odd, cells.barriers), self._paths
        order = np.lexsort((paths.length, code, self._pair))
        pair, code = self._pair[order], code[order]
        new = np.ones(len(order), dtype=bool)
        new[1:] = (pair[1:] != pair[:-1]) | (code[1:] != code[:-1])
        order, pair, code = order[new], pair[new], code[new]
        row = np.searchsorted(pair, np.arange(self._size**2 + 1)).astype(np.int64)
        m = len(cells.cluster)
        costs = np.full((m, m), np.inf)
        ordered = PathTable(row, code, paths.length[order], paths.reach)
        _fill_in_lengths(cells.cluster, cells.code, ordered, self._size, costs)
        return costs

    def costs_by_parity(self, cells: Cells, ends: Ints) -> Floats:
        """Return the costs (k, n, 2) of the cheapest legs between two cells (k, 2), by parity."""
        low = np.minimum(cells.cluster[ends[:, 0]], cells.cluster[ends[:, 1]])
        high = np.maximum(cells.cluster[ends[:, 0]], cells.cluster[ends[:, 1]])
        wanted = cells.code[ends[:, 0]] ^ cells.code[ends[:, 1]]
        code = packed(self._odd, cells.barriers)
        pair, rows = low * self._size + high, self._row
        table = PathTable(rows, code, self._paths.length, self._paths.reach)
        return _shortest_by_parity(pair, wanted, table, self._order, self._odd)


class PathTable(NamedTuple):
    """Shortest paths between goals, grouped by pair of goals, for kernels.

    Attributes
    ----------
    row
        Start of each pair's paths, and the end of the last.
    code
        Parities of each path, as bits.
    length
        Length of each path.
    reach
        Lower bound on the length of all paths that are not listed.
    """

    row: Ints
    code: Ints
    length: Floats
    reach: float


@kernel
def _fill_in_lengths(cluster: Ints, code: Ints, paths: PathTable, size: int, costs: Floats) -> None:
    """Fill in the costs between cells, by paths that ascend in code within each pair of goals."""
    m = len(cluster)
    for a in range(m):
        for b in range(a + 1, m):
            g, h = cluster[a], cluster[b]
            if g == h:
                continue
            wanted = code[a] ^ code[b]
            pair = g * size + h if g < h else h * size + g
            low, high = paths.row[pair], paths.row[pair + 1]
            end = high
            while low < high:
                middle = (low + high) // 2
                if paths.code[middle] < wanted:
                    low = middle + 1
                else:
                    high = middle
            cost = paths.reach
            if low < end and paths.code[low] == wanted:
                cost = paths.length[low]
            costs[a, b] = costs[b, a] = cost


@kernel
def _shortest_by_parity(
    pair: Ints, wanted: Ints, paths: PathTable, order: Ints, odd: Bools
) -> Floats:
    """Return the lengths (k, n, 2) of the shortest paths of a code between a pair, by parity.

    The paths of a pair are `order[row[pair] : row[pair + 1]]`.
    """
    n = odd.shape[1]
    out = np.full((len(pair), n, 2), paths.reach)
    for k in range(len(pair)):
        for w in order[paths.row[pair[k]] : paths.row[pair[k] + 1]]:
            if paths.code[w] != wanted[k]:
                continue
            for i in range(n):
                side = 1 if odd[w, i] else 0
                out[k, i, side] = min(out[k, i, side], paths.length[w])
    return out

"""The cells of covers, and what legs between them cost: from classes, or from ways.

The cheapest leg between the classes of two cells is one between the cells (`OverClasses`). Where
there are too many classes the shortest way of any from the one to the other is (`OverWays`,
`netsp.travel.ways`); then a bound holds for classes that a roadmap has left out, too.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from netsp.arrays import Bools, Floats, Ints
from netsp.compiled.kernel import kernel
from netsp.mip.overcells import Cells, packed
from netsp.travel.ways import WaysByParity


class Tower(Protocol):
    """The covers of a problem."""

    obstacles: int

    def cells(self, obstacles: tuple[int, ...]) -> Cells:
        """Of the cover of some obstacles, those that a tether reaches."""

    def costs(self, cells: Cells) -> Floats:
        """(m, m) costs between cells, inf within a goal."""

    def odd_between(self, cells: Cells, ends: Ints) -> Bools:
        """(k, n) of which obstacles the cheapest leg between two cells (k, 2) writes an odd number
        of letters."""


class OverClasses:
    """Covers below the classes of a travel graph.

    Parameters
    ----------
    costs
        (V, V) of legs.
    cluster
        (V,) of the vertices.
    odd
        (V, n) as of `netsp.mip.parities.odd_letters`.
    """

    def __init__(self, costs: Floats, cluster: Ints, odd: Bools) -> None:
        self._costs, self._cluster, self._odd = costs, cluster, odd
        self.obstacles = odd.shape[1]

    def cells(self, obstacles: tuple[int, ...]) -> Cells:
        """As of `Tower.cells`."""
        both = np.unique(np.column_stack([self._cluster, packed(self._odd, obstacles)]), axis=0)
        return Cells(obstacles, both[:, 0], both[:, 1])

    def costs(self, cells: Cells) -> Floats:
        """As of `Tower.costs`."""
        order, row = self._members(cells)
        out = np.empty((len(cells.cluster), len(cells.cluster)))
        _least(self._costs, order, row, out)
        return out

    def odd_between(self, cells: Cells, ends: Ints) -> Bools:
        """As of `Tower.odd_between`."""
        order, row = self._members(cells)
        out = np.empty((len(ends), self.obstacles), dtype=bool)
        for k, (a, b) in enumerate(ends.tolist()):
            us, vs = order[row[a] : row[a + 1]], order[row[b] : row[b + 1]]
            i, j = divmod(int(np.argmin(self._costs[np.ix_(us, vs)])), len(vs))
            out[k] = self._odd[us[i]] ^ self._odd[vs[j]]
        return out

    def _members(self, cells: Cells) -> tuple[Ints, Ints]:
        """The vertices cell by cell, and where those of each begin."""
        own = cells.of(self._cluster, self._odd)
        order = np.argsort(own, kind="stable")
        row = np.searchsorted(own[order], np.arange(len(cells.cluster) + 1))
        return order, row.astype(np.int64)


@kernel
def _least(costs: Floats, order: Ints, row: Ints, out: Floats) -> None:
    """The least cost between the members of two cells."""
    cells = len(row) - 1
    own = np.empty(len(order), dtype=np.int64)
    for b in range(cells):
        for k in range(row[b], row[b + 1]):
            own[order[k]] = b
    out[:] = np.inf
    for a in range(cells):
        for k in range(row[a], row[a + 1]):
            u = order[k]
            for v in range(len(order)):
                out[a, own[v]] = min(out[a, own[v]], costs[u, v])


class OverWays:
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

    def cells(self, obstacles: tuple[int, ...]) -> Cells:
        """As of `Tower.cells`."""
        both = np.column_stack([self._goal, packed(self._at_goal, obstacles)])
        both = np.unique(np.vstack([[[0, 0]], both]), axis=0)
        return Cells(obstacles, both[:, 0], both[:, 1])

    def costs(self, cells: Cells) -> Floats:
        """As of `Tower.costs`."""
        return self._shortest(cells)[0]

    def odd_between(self, cells: Cells, ends: Ints) -> Bools:
        """As of `Tower.odd_between`; none where nothing is known."""
        way = self._shortest(cells)[1][ends[:, 0], ends[:, 1]]
        return np.asarray(self._odd[np.maximum(way, 0)] & (way >= 0)[:, None])

    def _shortest(self, cells: Cells) -> tuple[Floats, Ints]:
        """(m, m) costs, and numbers of the ways, -1 for a longer one that is not known."""
        code, ways = packed(self._odd, cells.obstacles), self._ways
        order = np.lexsort((ways.length, code, self._pair))
        pair, code = self._pair[order], code[order]
        new = np.ones(len(order), dtype=bool)
        new[1:] = (pair[1:] != pair[:-1]) | (code[1:] != code[:-1])
        order, pair, code = order[new], pair[new], code[new]
        row = np.searchsorted(pair, np.arange(self._size**2 + 1)).astype(np.int64)
        m = len(cells.cluster)
        costs, way = np.full((m, m), np.inf), np.full((m, m), -1, dtype=np.int64)
        _between(
            cells.cluster, cells.code, row, code, order, ways.length[order], ways.reach,
            self._size, costs, way,
        )  # fmt: skip
        return costs, way


@kernel
def _between(
    cluster: Ints, code: Ints, row: Ints, codes: Ints, numbers: Ints, lengths: Floats, reach: float,
    size: int, costs: Floats, way: Ints,
) -> None:  # fmt: skip
    """Fill in costs and ways between cells: those of a pair of goals are rows row[pair] to
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
            cost, number = reach, -1
            if low < after and codes[low] == wanted:
                cost, number = lengths[low], numbers[low]
            costs[a, b] = costs[b, a] = cost
            way[a, b] = way[b, a] = number

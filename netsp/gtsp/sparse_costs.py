"""Sparse costs: the legs that may be in a better tour, vertex by vertex.

Among 20,000 vertices a matrix of all legs takes 1.5 GiB in single precision. A first bound over
covers leaves fewer than one leg in ten (`netsp.mip.cost_fixing`), and finds them from the legs of
some vertices at a time, so that memory grows with the legs that remain.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.dynamic_array import order_of
from netsp.base.compiled.kernel import kernel
from netsp.base.ram import check_available
from netsp.gtsp.gtsp_policy import CostPolicy

Columns = npt.NDArray[np.int32]


class Rows(NamedTuple):
    """Costs by rows: row v is entries ``first[v]`` to ``first[v] + size[v]`` of `other` and `cost`.

    `other` is ascending within a row. A row may have room after its last entry.
    """

    first: Ints
    size: Ints
    other: Columns
    cost: Floats


EMPTY_ROWS = Rows(
    np.zeros(0, dtype=np.int64),
    np.zeros(0, dtype=np.int64),
    np.zeros(0, dtype=np.int32),
    np.zeros(0, dtype=np.float32),  # type: ignore[arg-type]
)
"""Empty rows, used while costs are a matrix."""


class SparseCosts:
    """Costs of the legs that remain among some vertices.

    Parameters
    ----------
    vertices
        Number of vertices.
    blocks
        Vertices (r,) and the costs (r, V) of their legs in single precision, block by block, until
        each vertex has come once.
    cell
        (V,) cell of each vertex; negative for none.
    longest
        (m, m) largest cost of a leg between two cells that is kept.
    tour
        Vertices of the incumbent, whose legs are kept whatever they cost.
    policy
        How costs are held.

    Raises
    ------
    MemoryLimitError
        There is no room for the legs that are kept.
    """

    def __init__(
        self,
        vertices: int,
        blocks: Iterable[tuple[Ints, Floats]],
        cell: Ints,
        longest: Floats,
        tour: Ints,
        *,
        policy: CostPolicy = CostPolicy(),
    ) -> None:
        self.policy = policy
        mates = np.full((vertices, 2), -1, dtype=np.int64)
        mates[tour] = np.column_stack([np.roll(tour, 1), np.roll(tour, -1)])
        # vertices in no cell are put into a last one, which has no legs
        longest = np.pad(longest, (0, 1), constant_values=-np.inf)
        cell = np.where(cell < 0, len(longest) - 1, cell)
        first, size = np.zeros(vertices, dtype=np.int64), np.zeros(vertices, dtype=np.int64)
        other: Columns = np.zeros(0, dtype=np.int32)
        cost: Floats = np.zeros(0, dtype=np.float32)  # type: ignore[assignment]
        for rows, costs in blocks:
            block = Block(rows, costs, cell, longest, mates)
            counts = np.zeros(len(rows), dtype=np.int64)
            self._share_rows(partial(_count, block, counts), len(rows))
            check_available(
                float(other.itemsize + cost.itemsize) * counts.sum(),
                f"the legs left between {vertices} homotopy classes",
                "lower tether_length or max_classes, or use solver 'lns'",
            )
            begin = len(other) + np.cumsum(counts) - counts
            first[rows], size[rows] = begin, counts
            # resized in place, because there may be no room for a second copy
            other.resize(len(other) + int(counts.sum()), refcheck=False)
            cost.resize(len(other), refcheck=False)
            self._share_rows(partial(_keep, block, begin, other, cost), len(rows))
        self.held = Rows(first, size, other, cost)

    def _share_rows(self, work: Callable[[int, int], None], count: int) -> None:
        """Share the rows of a block among threads."""
        task_rows = self.policy.task_rows
        parts = range(0, count, task_rows)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(lambda k: work(k, min(k + task_rows, count)), parts))

    def __len__(self) -> int:
        return len(self.held.first)

    def __getitem__(self, ends: tuple[Ints, Ints]) -> Bools:
        """Return whether legs (k,) from us to vs are fixed out."""
        return np.asarray(np.isinf(self.costs_of(*ends)))

    def costs_of(self, us: Ints, vs: Ints) -> Floats:
        """Return the costs (k,) of legs from us to vs; inf for legs fixed out."""
        return _costs_of(np.asarray(us), np.asarray(vs), self.held)

    def add_vertices(self, gone: Bools) -> None:
        """Fix out all legs of the marked vertices (V,)."""
        _drop_vertices(gone, self.held)
        if self.held.size.sum() < self.policy.min_packed_share * len(self.held.other):
            self._pack(np.ones(len(self), dtype=bool))

    def add_above(self, cell: Ints, dead: Bools) -> None:
        """Fix out all legs between cells whose own leg is fixed out.

        Parameters
        ----------
        cell
            (V,) cell of each vertex.
        dead
            (m, m) mask of legs between cells.
        """
        _drop_above(cell, dead, self.held)

    @property
    def left(self) -> int:
        """Number of remaining legs."""
        return int(self.held.size.sum()) // 2

    def legs_left(self) -> Ints:
        """Return the remaining legs (k, 2), u < v, in order."""
        return _legs(self.held)

    def with_legs(self) -> Bools:
        """Return whether each vertex (V,) has a remaining leg."""
        return np.asarray(self.held.size > 0)

    def nearest_legs(self, count: int) -> Ints:
        """Return the cheapest legs (k, 2) of each vertex, at most `count` of each."""
        return _cheapest(count, self.held)

    def restrict(self, keep: Bools) -> None:
        """Remove all vertices except those marked."""
        _drop_vertices(~keep, self.held)
        self._pack(keep)

    def _pack(self, keep: Bools) -> None:
        place = np.where(keep, np.cumsum(keep) - 1, -1)
        self.held = Rows(*_packed(np.flatnonzero(keep), place, self.held))


class Block(NamedTuple):
    """Legs `costs` (r, V) of the vertices `rows`, and which of them are kept: those of their mates
    in the tour, and those no longer than the longest between the two cells."""

    rows: Ints
    costs: Floats
    cell: Ints
    longest: Floats
    mates: Ints


@kernel
def _kept(k: int, block: Block, other: Columns, cost: Floats) -> int:
    """Return the number of legs of row k that are kept, and write as many of them as fit into
    `other` and `cost`."""
    costs, longest = block.costs[k], block.longest[block.cell[block.rows[k]]]
    before, after = block.mates[block.rows[k]]
    largest, count = longest.max(), 0
    for v in range(len(costs)):
        c = costs[v]
        # most legs are longer than any that is kept, and are passed over quickly
        if (c <= largest and c <= longest[block.cell[v]]) or v in (before, after):
            if c == np.inf:
                continue
            if count < len(other):
                other[count], cost[count] = v, c
            count += 1
    return count


@kernel
def _count(block: Block, count: Ints, first: int, last: int) -> None:
    """Count the legs of some rows that are kept."""
    other, cost = EMPTY_ROWS.other, EMPTY_ROWS.cost
    for k in range(first, last):
        count[k] = _kept(k, block, other, cost)


@kernel
def _keep(block: Block, begin: Ints, other: Columns, cost: Floats, first: int, last: int) -> None:
    """Write the legs of some rows that are kept, each row from its place on."""
    for k in range(first, last):
        end = begin[k + 1] if k + 1 < len(begin) else len(other)
        _kept(k, block, other[begin[k] : end], cost[begin[k] : end])


@kernel
def place_of(u: int, v: int, rows: Rows) -> int:
    """Return the index of a leg in `rows.other`; -1 if it is fixed out."""
    low, high = rows.first[u], rows.first[u] + rows.size[u]
    end = high
    while low < high:
        middle = (low + high) // 2
        if rows.other[middle] < v:
            low = middle + 1
        else:
            high = middle
    return int(low) if low < end and rows.other[low] == v else -1


@kernel
def _costs_of(us: Ints, vs: Ints, rows: Rows) -> Floats:
    out = np.full(len(us), np.inf)
    for k in range(len(us)):
        at = place_of(us[k], vs[k], rows)
        if at >= 0:
            out[k] = rows.cost[at]
    return out


@kernel
def _drop_vertices(gone: Bools, rows: Rows) -> None:
    """Remove the legs of the marked vertices from all rows."""
    for u in range(len(rows.first)):
        if gone[u]:
            rows.size[u] = 0
            continue
        first, kept = rows.first[u], 0
        for k in range(first, first + rows.size[u]):
            if not gone[rows.other[k]]:
                rows.other[first + kept], rows.cost[first + kept] = rows.other[k], rows.cost[k]
                kept += 1
        rows.size[u] = kept


@kernel
def _drop_above(cell: Ints, dead: Bools, rows: Rows) -> None:
    for u in range(len(rows.first)):
        first, kept = rows.first[u], 0
        for k in range(first, first + rows.size[u]):
            if not dead[cell[u], cell[rows.other[k]]]:
                rows.other[first + kept], rows.cost[first + kept] = rows.other[k], rows.cost[k]
                kept += 1
        rows.size[u] = kept


@kernel
def _packed(chosen: Ints, place: Ints, rows: Rows) -> tuple[Ints, Ints, Columns, Floats]:
    """Return the rows of the chosen vertices, renumbered by `place`, without room between them."""
    size = rows.size[chosen]
    first = np.cumsum(size) - size
    other = np.empty(np.sum(size), dtype=np.int32)
    cost = np.empty(np.sum(size), dtype=np.float32)
    for k in range(len(chosen)):
        at = rows.first[chosen[k]]
        for j in range(size[k]):
            other[first[k] + j] = place[rows.other[at + j]]
            cost[first[k] + j] = rows.cost[at + j]
    return first, size, other, cost  # type: ignore[return-value]


@kernel
def _legs(rows: Rows) -> Ints:
    out = np.empty((np.sum(rows.size), 2), dtype=np.int64)
    size = 0
    for u in range(len(rows.first)):
        for v in rows.other[rows.first[u] : rows.first[u] + rows.size[u]]:
            if u < v:
                out[size, 0], out[size, 1] = u, v
                size += 1
    return out[:size].copy()


@kernel
def _cheapest(limit: int, rows: Rows) -> Ints:
    out = np.empty((limit * len(rows.first), 2), dtype=np.int64)
    size = 0
    for u in range(len(rows.first)):
        first = rows.first[u]
        cost = np.empty(rows.size[u])
        for k in range(rows.size[u]):
            cost[k] = rows.cost[first + k]
        for k in order_of(cost)[:limit]:
            out[size, 0], out[size, 1] = u, rows.other[first + k]
            size += 1
    return out[:size].copy()

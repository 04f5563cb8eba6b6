"""The legs that may be in a better tour, vertex by vertex, and nothing of all others.

Among 20,000 vertices a matrix of all legs takes 1.5 GiB in single precision. A first bound over
covers leaves fewer than one leg in ten (`netsp.mip.cost_fixing`), and it takes nothing but the legs
of some vertices at a time to find them. What these rows take is proportional to the legs that are
left.
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

Columns = npt.NDArray[np.int32]

ROWS = 256
"""That a thread works on at a time."""

BYTES = 8.0
"""Of each leg, either way."""

HALF = 0.5
"""Rows are packed again when no more than this share of their room is in use."""


class Rows(NamedTuple):
    """Row v is places ``first[v]`` to ``first[v] + size[v]`` of `other`, ascending, and `cost`."""

    first: Ints
    size: Ints
    other: Columns
    cost: Floats


EMPTY_ROWS = Rows(
    np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int32),
    np.zeros(0, dtype=np.float32),  # type: ignore[arg-type]
)  # fmt: skip
"""Where legs are held as a matrix."""


class SparseCosts:
    """The legs left among some vertices.

    Parameters
    ----------
    vertices
        How many there are.
    blocks
        Some vertices (r,) and the costs (r, V) of their legs in single precision, until all
        vertices have been given.
    own
        (V,) the cell that each vertex lies in.
    longest
        (m, m) what a leg between two cells may cost to be kept.
    tour
        Its vertices in order; its legs are kept whatever they cost.

    Raises
    ------
    MemoryLimitError
        There is no room for those that are kept.
    """

    def __init__(
        self, vertices: int, blocks: Iterable[tuple[Ints, Floats]], own: Ints, longest: Floats,
        tour: Ints,
    ) -> None:  # fmt: skip
        mates = np.full((vertices, 2), -1, dtype=np.int64)
        mates[tour] = np.column_stack([np.roll(tour, 1), np.roll(tour, -1)])
        # what lies in no cell lies in the last, which has no legs
        longest = np.pad(longest, (0, 1), constant_values=-np.inf)
        own = np.where(own < 0, len(longest) - 1, own)
        first, size = np.zeros(vertices, dtype=np.int64), np.zeros(vertices, dtype=np.int64)
        other: Columns = np.zeros(0, dtype=np.int32)
        cost: Floats = np.zeros(0, dtype=np.float32)  # type: ignore[assignment]
        for rows, costs in blocks:
            kept = Kept(rows, costs, own, longest, mates)
            counts = np.zeros(len(rows), dtype=np.int64)
            _by_rows(partial(_count, kept, counts), len(rows))
            check_available(
                BYTES * counts.sum(), f"the legs left between {vertices} homotopy classes",
                "lower tether_length or max_classes, or use solver 'lns'",
            )  # fmt: skip
            begin = len(other) + np.cumsum(counts) - counts
            first[rows], size[rows] = begin, counts
            # grows where it stands: two of them may be more than there is room for
            other.resize(len(other) + int(counts.sum()), refcheck=False)
            cost.resize(len(other), refcheck=False)
            _by_rows(partial(_keep, kept, begin, other, cost), len(rows))
        self.held = Rows(first, size, other, cost)

    def __len__(self) -> int:
        return len(self.held.first)

    def __getitem__(self, ends: tuple[Ints, Ints]) -> Bools:
        """(k,) whether legs from us to vs are gone."""
        return np.asarray(np.isinf(self.costs_of(*ends)))

    def costs_of(self, us: Ints, vs: Ints) -> Floats:
        """(k,) costs of legs from us to vs; inf where they are gone."""
        return _costs_of(np.asarray(us), np.asarray(vs), self.held)

    def add_vertices(self, gone: Bools) -> None:
        """Let go of all legs of some vertices (V,)."""
        _without(gone, self.held)
        if self.held.size.sum() < HALF * len(self.held.other):
            self._pack(np.ones(len(self), dtype=bool))

    def add_above(self, own: Ints, dead: Bools) -> None:
        """Let go of all legs between cells whose own leg is dead.

        Parameters
        ----------
        own
            (V,) the cell of each vertex.
        dead
            (m, m) legs between cells.
        """
        _not_above(own, dead, self.held)

    @property
    def left(self) -> int:
        """How many legs are left."""
        return int(self.held.size.sum()) // 2

    def legs_left(self) -> Ints:
        """(k, 2) those that are left, u < v, in order."""
        return _legs(self.held)

    def with_legs(self) -> Bools:
        """(V,) whether a vertex has a leg left."""
        return np.asarray(self.held.size > 0)

    def nearest_legs(self, most: int) -> Ints:
        """(k, 2) the cheapest legs of every vertex, so many at most."""
        return _cheapest(most, self.held)

    def restrict(self, keep: Bools) -> None:
        """Forget all vertices but those marked."""
        _without(~keep, self.held)
        self._pack(keep)

    def _pack(self, keep: Bools) -> None:
        place = np.where(keep, np.cumsum(keep) - 1, -1)
        self.held = Rows(*_packed(np.flatnonzero(keep), place, self.held))


class Kept(NamedTuple):
    """What is kept of the legs `costs` (r, V) of some vertices `rows`: those of their mates in the
    tour, and what is no longer than the longest between two cells."""

    rows: Ints
    costs: Floats
    own: Ints
    longest: Floats
    mates: Ints


@kernel
def _kept(k: int, kept: Kept, other: Columns, cost: Floats) -> int:
    """How many legs of a row are kept; the first of them go into `other` and `cost`, as many as
    there is room for."""
    costs, longest = kept.costs[k], kept.longest[kept.own[kept.rows[k]]]
    before, after = kept.mates[kept.rows[k]]
    top, count = longest.max(), 0
    for v in range(len(costs)):
        c = costs[v]
        # few are as short as any may be: the others are passed over quickly
        if (c <= top and c <= longest[kept.own[v]]) or v in (before, after):
            if c == np.inf:
                continue
            if count < len(other):
                other[count], cost[count] = v, c
            count += 1
    return count


@kernel
def _count(kept: Kept, count: Ints, first: int, last: int) -> None:
    """How many legs of some rows are kept."""
    other, cost = EMPTY_ROWS.other, EMPTY_ROWS.cost
    for k in range(first, last):
        count[k] = _kept(k, kept, other, cost)


@kernel
def _keep(
    kept: Kept, begin: Ints, other: Columns, cost: Floats, first: int, last: int
) -> None:  # fmt: skip
    """Write them down, each row from its place on."""
    for k in range(first, last):
        end = begin[k + 1] if k + 1 < len(begin) else len(other)
        _kept(k, kept, other[begin[k] : end], cost[begin[k] : end])


def _by_rows(work: Callable[[int, int], None], count: int) -> None:
    """Share the rows of a block among threads."""
    parts = range(0, count, ROWS)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(lambda k: work(k, min(k + ROWS, count)), parts))


@kernel
def place_of(u: int, v: int, rows: Rows) -> int:
    """The place of a leg, -1 if it is gone."""
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
def _without(gone: Bools, rows: Rows) -> None:
    """Take legs of vertices that are gone out of all rows."""
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
def _not_above(own: Ints, dead: Bools, rows: Rows) -> None:
    for u in range(len(rows.first)):
        first, kept = rows.first[u], 0
        for k in range(first, first + rows.size[u]):
            if not dead[own[u], own[rows.other[k]]]:
                rows.other[first + kept], rows.cost[first + kept] = rows.other[k], rows.cost[k]
                kept += 1
        rows.size[u] = kept


@kernel
def _packed(chosen: Ints, place: Ints, rows: Rows) -> tuple[Ints, Ints, Columns, Floats]:
    """Rows of some vertices, numbered anew, without room between them."""
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
def _cheapest(most: int, rows: Rows) -> Ints:
    out = np.empty((most * len(rows.first), 2), dtype=np.int64)
    size = 0
    for u in range(len(rows.first)):
        first = rows.first[u]
        cost = np.empty(rows.size[u])
        for k in range(rows.size[u]):
            cost[k] = rows.cost[first + k]
        for k in order_of(cost)[:most]:
            out[size, 0], out[size, 1] = u, rows.other[first + k]
            size += 1
    return out[:size].copy()

"""Refinement of covers: the choice of the barriers that count next.

A leg of a program's point is the shortest between two cells, however often it crosses a barrier.
Once the barrier counts, each cell that is reached on both sides of it splits in two: a leg that
crosses it an even number of times stays on its side, and a leg that crosses it an odd number of
times changes it. With the same legs, and each cell on its better side, the point then costs more by
what it saved by crossing the barrier an odd number of times: the frustration of a signed graph
(Harary 1959) with lengths for weights. That is the promise of the barrier. The program may choose
other legs and gain less, but large promises mean large gains. Minimum frustration is NP-hard; a
spanning tree of the legs whose sides differ most, and then changing the sides of single cells,
comes near it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.dynamic_array import order_of
from netsp.base.compiled.kernel import kernel
from netsp.mip.cover_bounds import Cells
from netsp.mip.cover_costs import Covers
from netsp.mip.mip_policy import CoverPolicy

SIDE_TOLERANCE = 1e-12
"""Tolerance below which the gain of changing a side counts as rounding."""


@dataclass
class CoverRefinement:
    """Choice of barriers, cover by cover.

    Attributes
    ----------
    covers
        Covers of the problem.
    policy
        Limits on the number of cells, and how promises are weighed.
    """

    covers: Covers
    policy: CoverPolicy = CoverPolicy()
    _promised: dict[int, float] = field(default_factory=dict)

    def next_barriers(
        self,
        cells: Cells,
        ends: Ints,
        y: Floats,
        gap: float,
        check: Callable[[], None] = lambda: None,
    ) -> list[int]:
        """Return the barriers that the next cover adds, those of largest promise per new cell.

        Parameters
        ----------
        cells
            Cells of the cover so far.
        ends, y
            (k, 2) legs that its point uses, and (k,) their values.
        gap
            Gap of the bound; a leg that is longer by that much is in no better tour.
        check
            Called for each barrier; may raise to stop.
        """
        policy, known = self.policy, cells.barriers
        left = [i for i in range(self.covers.barriers) if i not in known]
        if not left or len(known) >= policy.max_barriers:
            return []
        lengths = self.covers.costs_by_parity(cells, ends)
        lowest = lengths.min(axis=2, keepdims=True)
        lowest[np.isinf(lowest)] = 0.0  # no leg lies above these, so they have no excess
        excess = y[:, None, None] * np.minimum(lengths - lowest, gap)
        excess = np.ascontiguousarray(excess.swapaxes(0, 1))
        new_cells = {}
        for i in left:
            check()
            split = self.covers.cells((*known, i))
            new_cells[i] = len(split.cluster) - len(cells.cluster)
            promise = frustration(ends, excess[i], _sides(cells, split), policy.max_side_passes)
            self._promised[i] = max(promise, policy.promise_decay * self._promised.get(i, 0.0))
        left = [i for i in left if len(cells.cluster) + new_cells[i] <= policy.max_cells]
        promising = [i for i in left if self._promised[i] > policy.min_promise * gap]
        promising.sort(
            key=lambda i: -self._promised[i] / max(new_cells[i], 1) ** policy.size_exponent
        )
        # without a promise, prefer barriers that split few cells
        return self._first(cells, promising or sorted(left, key=lambda i: new_cells[i]))

    def _first(self, cells: Cells, order: list[int]) -> list[int]:
        """Return the first barriers of a list, as many as the limits on cells allow."""
        policy = self.policy
        out: list[int] = []
        for i in order:
            count = len(self.covers.cells((*cells.barriers, *out, i)).cluster)
            has_all = len(cells.barriers) + len(out) == policy.max_barriers
            if (
                has_all
                or count > policy.max_cells
                or (out and count > policy.max_growth * len(cells.cluster))
            ):
                break
            out.append(i)
        return out


def _sides(cells: Cells, split: Cells) -> Bools:
    """Return the mask (m, 2) of cells with an even, and an odd, side of the last barrier above."""
    out = np.zeros((len(cells.cluster), 2), dtype=bool)
    out[split.cells_below(cells), split.code >> len(cells.barriers) & 1] = True
    return out


@kernel
def frustration(ends: Ints, excess: Floats, sides: Bools, max_passes: int) -> float:
    """Return the excess cost of legs with each cell on one side, near its minimum.

    Parameters
    ----------
    ends
        (k, 2) cells of legs.
    excess
        (k, 2) excess cost of a leg that stays on a side, and of one that changes it.
    sides
        (m, 2) mask of the sides of a cell.
    max_passes
        Maximum number of passes over all cells.
    """
    side = _sides_along_tree(ends, excess, sides)
    _improve_sides(ends, excess, sides, side, max_passes)
    total = 0.0
    for e in range(len(ends)):
        total += excess[e, side[ends[e, 0]] ^ side[ends[e, 1]]]
    return total


@kernel
def _sides_along_tree(ends: Ints, excess: Floats, sides: Bools) -> Ints:
    """Return the side of each cell by a spanning tree of the legs whose sides differ most."""
    m = len(sides)
    # forests with sides relative to the root; cells with only one side join the extra root m
    parent, turned = np.arange(m + 1), np.zeros(m + 1, dtype=np.int64)
    for v in range(m):
        if sides[v, 0] != sides[v, 1]:
            parent[v], turned[v] = m, np.int64(sides[v, 1])
    clear = np.abs(excess[:, 0] - excess[:, 1])
    for e in order_of(-clear):
        u, v = ends[e]
        change = np.int64(excess[e, 1] < excess[e, 0])
        while parent[u] != u:
            change ^= turned[u]
            u = parent[u]
        while parent[v] != v:
            change ^= turned[v]
            v = parent[v]
        if u > v:
            u, v = v, u
        if u != v:
            parent[u], turned[u] = v, change
    side = np.zeros(m, dtype=np.int64)
    for v in range(m):
        u = v
        while parent[u] != u:
            side[v] ^= turned[u]
            u = parent[u]
    return side


@kernel
def _improve_sides(ends: Ints, excess: Floats, sides: Bools, side: Ints, max_passes: int) -> None:
    """Change the sides of single cells while that makes legs cheaper."""
    row, legs = _legs_by_cell(ends, len(sides))
    for _ in range(max_passes):
        changed = False
        for v in range(len(sides)):
            if not (sides[v, 0] and sides[v, 1]):
                continue
            gain = 0.0
            for e in legs[row[v] : row[v + 1]]:
                change = side[ends[e, 0]] ^ side[ends[e, 1]]
                gain += excess[e, change] - excess[e, 1 - change]
            if gain > SIDE_TOLERANCE:
                side[v] ^= 1
                changed = True
        if not changed:
            break


@kernel
def _legs_by_cell(ends: Ints, cells: int) -> tuple[Ints, Ints]:
    """Return `row` and `legs`: the legs at cell c are `legs[row[c] : row[c + 1]]`."""
    row = np.zeros(cells + 2, dtype=np.int64)
    for e in range(len(ends)):
        row[ends[e, 0] + 2] += 1
        row[ends[e, 1] + 2] += 1
    for c in range(cells):
        row[c + 2] += row[c + 1]
    legs = np.empty(2 * len(ends), dtype=np.int64)
    for e in range(len(ends)):
        for c in ends[e]:
            legs[row[c + 1]] = e
            row[c + 1] += 1
    return row[: cells + 1], legs

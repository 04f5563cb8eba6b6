"""Which obstacles a cover tells apart next: those that promise most for the cells that they add.

A leg of a program's point is the shortest between two cells, however many letters of an obstacle it
writes. Once these count, the cells that are reached on both sides of the obstacle fall in two, and
so does the leg: one that writes an even number of them stays on its side, and one that writes an
odd number changes it. What the point costs then, with the same legs and each cell on the better
side, is more by what it saved going around that obstacle: the frustration of a signed graph
(Harary 1959), with lengths for weights. To find the least is NP-hard; a spanning tree of the legs
that say most, and changing sides of one cell after another, is near it. The program may choose
other legs and so gains less; but where the promise is large, the gain is too.
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

FADES = 0.5
"""Of what an obstacle promised at the cover below, so much is believed: a point goes around it one
way here and another there."""

DEAR = 2.5
"""A promise is divided by this power of the cells that it adds: an LP over twice the cells takes
far more than twice as long."""

MOST_OBSTACLES = 60
"""That fit into a number."""

HARDLY = 1e-4
"""A smaller share of the gap is no promise."""

PASSES = 20
"""Over all cells, changing sides."""

TINY = 1e-12
"""A side that saves less is not changed."""


@dataclass
class CoverRefinement:
    """The choice of obstacles, cover by cover.

    Attributes
    ----------
    tower
        The covers.
    growth, most
        So many times as many cells at most, unless one obstacle alone adds more; and at most so
        many cells.
    """

    tower: Covers
    growth: float
    most: int
    _promised: dict[int, float] = field(default_factory=dict)

    def after(
        self, cells: Cells, ends: Ints, y: Floats, gap: float,
        check: Callable[[], None] = lambda: None,
    ) -> list[int]:  # fmt: skip
        """The obstacles whose letters are to count from now on, too; none if there are no more.

        Parameters
        ----------
        cells
            Of the cover so far.
        ends, y
            (k, 2) legs that its point uses, and (k,) how much.
        gap
            A leg that is longer by that much is in no better tour.
        check
            Called for each obstacle; may raise to stop.
        """
        own = cells.obstacles
        left = [i for i in range(self.tower.obstacles) if i not in own]
        if not left or len(own) >= MOST_OBSTACLES:
            return []
        lengths = self.tower.costs_by_parity(cells, ends)
        least = lengths.min(axis=2, keepdims=True)
        least[np.isinf(least)] = 0.0  # a leg that has none above it says nothing
        excess = y[:, None, None] * np.minimum(lengths - least, gap)
        excess = np.ascontiguousarray(excess.swapaxes(0, 1))
        adds = {}
        for i in left:
            check()
            split = self.tower.cells((*own, i))
            adds[i] = len(split.cluster) - len(cells.cluster)
            new = frustration(ends, excess[i], _sides(cells, split))
            self._promised[i] = max(new, FADES * self._promised.get(i, 0.0))
        left = [i for i in left if len(cells.cluster) + adds[i] <= self.most]
        promising = [i for i in left if self._promised[i] > HARDLY * gap]
        promising.sort(key=lambda i: -self._promised[i] / max(adds[i], 1) ** DEAR)
        # else where few goals are reached on both sides, most say on which side they are
        return self._first(cells, promising or sorted(left, key=lambda i: adds[i]))

    def _first(self, cells: Cells, order: list[int]) -> list[int]:
        """Of some obstacles the first, as many as there is room for."""
        out: list[int] = []
        for i in order:
            count = len(self.tower.cells((*cells.obstacles, *out, i)).cluster)
            full = len(cells.obstacles) + len(out) == MOST_OBSTACLES or count > self.most
            if full or (out and count > self.growth * len(cells.cluster)):
                break
            out.append(i)
        return out


def _sides(cells: Cells, split: Cells) -> Bools:
    """(m, 2) whether a cell has an even, and an odd, side of the obstacle that is last in the cover
    above."""
    out = np.zeros((len(cells.cluster), 2), dtype=bool)
    out[split.above(cells), split.code >> len(cells.obstacles) & 1] = True
    return out


@kernel
def frustration(ends: Ints, excess: Floats, sides: Bools) -> float:
    """What legs cost more with each cell on one side; nearly the least.

    Parameters
    ----------
    ends
        (k, 2) cells.
    excess
        (k, 2) of a leg that stays on a side, and of one that changes.
    sides
        (m, 2) that a cell has.
    """
    m = len(sides)
    # trees with sides told from the root; what has one side hangs on a root of its own
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
    row, legs = _at(ends, m)
    for _ in range(PASSES):
        changed = False
        for v in range(m):
            if not (sides[v, 0] and sides[v, 1]):
                continue
            gain = 0.0
            for e in legs[row[v] : row[v + 1]]:
                change = side[ends[e, 0]] ^ side[ends[e, 1]]
                gain += excess[e, change] - excess[e, 1 - change]
            if gain > TINY:
                side[v] ^= 1
                changed = True
        if not changed:
            break
    total = 0.0
    for e in range(len(ends)):
        total += excess[e, side[ends[e, 0]] ^ side[ends[e, 1]]]
    return total


@kernel
def _at(ends: Ints, cells: int) -> tuple[Ints, Ints]:
    """The legs at each cell: `legs[row[c] : row[c + 1]]`."""
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

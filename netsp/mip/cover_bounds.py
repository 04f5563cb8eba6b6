"""What is proven over goals, or over cells of a cover, for the program over classes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.mip.cuts import Cut
from netsp.mip.program import Duals


@dataclass(frozen=True)
class Cells:
    """The vertices of a cover.

    Attributes
    ----------
    obstacles
        Whose letters count.
    cluster, code
        (m,) goal, and bits that tell of which obstacles a word has an odd number of letters; the
        first is the base.
    """

    obstacles: tuple[int, ...]
    cluster: Ints
    code: Ints

    def of(self, cluster: Ints, odd: Bools) -> Ints:
        """(V,) the cells that vertices lie in, -1 for none; `odd` tells as
        `netsp.mip.parity_cuts.odd_letters` does."""
        return self._places(cluster, packed(odd, self.obstacles))

    def above(self, below: Cells) -> Ints:
        """(m,) the cell of a cover below that each lies above; the first of the obstacles are those
        that count there."""
        return below._places(self.cluster, self.code & ((1 << len(below.obstacles)) - 1))

    def _places(self, cluster: Ints, code: Ints) -> Ints:
        """Numbers of cells, -1 where there is none."""
        own = zip(self.cluster.tolist(), self.code.tolist(), strict=True)
        place = {k: j for j, k in enumerate(own)}
        keys = zip(cluster.tolist(), code.tolist(), strict=True)
        return np.array([place.get(k, -1) for k in keys], dtype=np.int64)


@dataclass(frozen=True)
class CellBound:
    """What a program over cells has proven.

    Attributes
    ----------
    bound
        No tour is shorter.
    cells
        Its vertices.
    costs
        (m, m) of legs between them, inf where there is none.
    alive
        (m,) which of them may be in a better tour.
    dead
        (m, m) legs that are in none.
    cuts, duals
        That the bound rests on, over the cells.
    """

    bound: float
    cells: Cells
    costs: Floats
    alive: Bools
    dead: Bools
    cuts: tuple[Cut, ...]
    duals: Duals

    def lifted_cuts(self, own: Ints) -> list[Cut]:
        """Over vertices that lie in these cells."""
        return [replace(c, inside=c.inside[own]) for c in self.cuts]

    def lifted_duals(self, own: Ints) -> Duals:
        """For vertices that lie in these cells, with the cuts of `lifted_cuts`."""
        return replace(self.duals, degree=self.duals.degree[own])


@dataclass(frozen=True)
class GoalBound:
    """A bound over goals or cells, and what it rests on.

    Attributes
    ----------
    bound
        No tour is shorter.
    cuts
        Over goals.
    cells
        What has been proven over cells instead, which is worth more; None for nothing.
    """

    bound: float
    cuts: tuple[Cut, ...] = ()
    cells: CellBound | None = None


def packed(odd: Bools, obstacles: Sequence[int]) -> Ints:
    """(V,) the columns of some obstacles as bits."""
    out = np.zeros(len(odd), dtype=np.int64)
    for j, i in enumerate(obstacles):
        if i < odd.shape[1]:
            out |= odd[:, i].astype(np.int64) << j
    return out

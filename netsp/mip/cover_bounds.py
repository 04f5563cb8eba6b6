"""Bounds over goals, or over cells of a cover, and their data for the program over classes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.mip.cuts import Cut
from netsp.mip.program import Duals


@dataclass(frozen=True)
class Cells:
    """Vertices of a cover; the first is the base.

    Attributes
    ----------
    barriers
        Barriers by whose sides the cells differ.
    cluster
        (m,) goal of each cell.
    code
        (m,) bits, one for each of the barriers: whether labels hold an odd number of it.
    """

    barriers: tuple[int, ...]
    cluster: Ints
    code: Ints

    def cells_of(self, cluster: Ints, odd: Bools) -> Ints:
        """Return the cell (V,) of each vertex, -1 for none.

        Parameters
        ----------
        odd
            Result of `netsp.mip.parity_cuts.odd_numbers`.
        """
        return self._places(cluster, packed(odd, self.barriers))

    def cells_below(self, below: Cells) -> Ints:
        """Return the cell (m,) of a lower cover that each cell lies above.

        The barriers of the lower cover are the first of this one's.
        """
        return below._places(self.cluster, self.code & ((1 << len(below.barriers)) - 1))

    def _places(self, cluster: Ints, code: Ints) -> Ints:
        """Return the number of each cell, -1 for none."""
        cells = zip(self.cluster.tolist(), self.code.tolist(), strict=True)
        place = {k: j for j, k in enumerate(cells)}
        keys = zip(cluster.tolist(), code.tolist(), strict=True)
        return np.array([place.get(k, -1) for k in keys], dtype=np.int64)


@dataclass(frozen=True)
class CellBound:
    """Lower bound from the program over a cover.

    Attributes
    ----------
    bound
        Lower bound on all tours.
    cells
        Vertices of the cover.
    costs
        (m, m) costs of legs between cells, inf for missing ones.
    alive
        (m,) mask of cells that may be in a better tour.
    dead
        (m, m) mask of legs that are in no better tour.
    cuts, duals
        Cuts and dual values over the cells, from which the bound follows.
    """

    bound: float
    cells: Cells
    costs: Floats
    alive: Bools
    dead: Bools
    cuts: tuple[Cut, ...]
    duals: Duals

    def lifted_cuts(self, cell: Ints) -> list[Cut]:
        """Return the cuts over vertices that lie in given cells (V,)."""
        return [replace(c, inside=c.inside[cell]) for c in self.cuts]

    def lifted_duals(self, cell: Ints) -> Duals:
        """Return the dual values for vertices that lie in given cells (V,)."""
        return replace(self.duals, degree=self.duals.degree[cell])


@dataclass(frozen=True)
class GoalBound:
    """Lower bound over goals or over a cover.

    Attributes
    ----------
    bound
        Lower bound on all tours.
    cuts
        Cuts over goals.
    cells
        Bound over a cover, which is stronger; None if there is none.
    """

    bound: float
    cuts: tuple[Cut, ...] = ()
    cells: CellBound | None = None


def packed(odd: Bools, barriers: Sequence[int]) -> Ints:
    """Return the columns of barriers in a mask (V, n) as bits (V,)."""
    out = np.zeros(len(odd), dtype=np.int64)
    for j, i in enumerate(barriers):
        if i < odd.shape[1]:
            out |= odd[:, i].astype(np.int64) << j
    return out

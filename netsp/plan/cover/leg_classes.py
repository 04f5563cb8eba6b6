"""Legs along which the tether stays in the class of the shortest ones.

In the complex of the free water (`netsp.plan.space.space_signature`), edges have letters, and the
shortest paths from the anchor have none. A leg that crosses no edge with a letter leads from a
place to another so that the tether to the first becomes the shortest tether to the second. A tour
of such legs ends with a free tether, and needs no more than the longest of the shortest tethers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.plan.space.space_signature import SpaceSignature
from netsp.plan.space.triangle_labels import UNKNOWN, Labels
from netsp.world.paths.tree import Grid


@dataclass(frozen=True, eq=False)
class TetherClasses:
    """Classes of tethers on a grid.

    Parameters
    ----------
    water : SpaceSignature
        Labelled complex of the free water, rooted at the anchor.
    """

    water: SpaceSignature

    @classmethod
    def on_grid(cls, grid: Grid, anchor: Floats) -> TetherClasses:
        """Return the classes of tethers from an anchor (3,), metres, on the grid of a mission.

        Raises
        ------
        InputError
            As `netsp.plan.space.space_signature.SpaceSignature.in_box`.
        """
        high = grid.low + grid.cell * np.array(grid.free.shape)
        return cls(SpaceSignature.in_box(grid.field, grid.low, high, grid.cell, anchor))

    def stay(self, a: Floats, b: Floats) -> Bools:
        """Return whether the tether stays in the class of the shortest ones along each of n
        straight legs.

        Parameters
        ----------
        a, b : ndarray, shape (n, 3)
            Ends of the legs, metres.
        """
        water = self.water
        shape = np.array(water.cells.flags.shape, dtype=np.int64)
        low = np.asarray(water.cells.low, dtype=float)
        begin, end = np.ascontiguousarray(a, dtype=float), np.ascontiguousarray(b, dtype=float)
        return stay_without_letters(water.labels, low, float(water.cells.cell), shape, begin, end)


@kernel
def stay_without_letters(
    labels: Labels, low: Floats, cell: float, shape: Ints, a: Floats, b: Floats
) -> Bools:
    """Return whether each of n straight legs (n, 3) crosses only edges without a letter.

    Parameters
    ----------
    labels : ndarray of int
        Number of the word of edge 3 cell + axis; 0 for the empty word.
    low, cell
        Corner of the grid (3,) and size of its cells, metres.
    shape : ndarray of int, shape (3,)
        Numbers of cells.
    """
    out = np.ones(len(a), dtype=np.bool_)
    at, last, step = np.zeros(3, np.int64), np.zeros(3, np.int64), np.zeros(3, np.int64)
    next_crossing, spacing = np.zeros(3), np.zeros(3)
    for leg in range(len(a)):
        for axis in range(3):
            begin, end = (a[leg, axis] - low[axis]) / cell, (b[leg, axis] - low[axis]) / cell
            at[axis] = min(max(math.floor(begin), 0), shape[axis] - 1)
            last[axis] = min(max(math.floor(end), 0), shape[axis] - 1)
            step[axis] = 1 if last[axis] > at[axis] else -1
            far = abs(end - begin)
            spacing[axis] = 1.0 / far if far > 0.0 else math.inf
            border = at[axis] + (1 if step[axis] > 0 else 0)
            next_crossing[axis] = abs(border - begin) / far if far > 0.0 else math.inf
        # from one cell to the next across their common face (Amanatides & Woo 1987)
        while out[leg]:
            axis = -1
            for k in range(3):
                if at[k] != last[k] and (axis < 0 or next_crossing[k] < next_crossing[axis]):
                    axis = k
            if axis < 0:
                break
            if step[axis] < 0:
                at[axis] -= 1
            lower = (at[0] * shape[1] + at[1]) * shape[2] + at[2]
            if labels[3 * lower + axis] != 0 and labels[3 * lower + axis] != UNKNOWN:
                out[leg] = False
            if step[axis] > 0:
                at[axis] += 1
            next_crossing[axis] += spacing[axis]
    return out

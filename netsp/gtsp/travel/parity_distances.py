"""Ways between goals, told apart by the rays that they cross an odd number of times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, ComparesArrays, Floats, Ints

BITS = 64


@dataclass(frozen=True, eq=False)
class WaysByParity(ComparesArrays):
    """The shortest way between two goals of each set of rays crossed an odd number of times, as
    far as it is no longer than `reach`; from the base, than the tether.

    Attributes
    ----------
    ends : ndarray of int, shape (k, 2)
        The goals, the smaller number first; 0 is the base.
    odd : ndarray of uint64, shape (k, w)
        Bit i of word j tells of obstacle 64 j + i.
    length : ndarray, shape (k,)
        In 3D, or something less.
    reach : float
        All others are longer, in the plan.
    obstacles : int
        How many there are.
    """

    ends: Ints
    odd: npt.NDArray[np.uint64]
    length: Floats
    reach: float
    obstacles: int

    def odd_of(self, rows: Ints) -> Bools:
        """(k, n) the same for some ways, spelt out."""
        bits = np.arange(self.obstacles)
        words = self.odd[rows][:, bits // BITS]
        return np.asarray((words >> (bits % BITS).astype(np.uint64)) & np.uint64(1), dtype=bool)

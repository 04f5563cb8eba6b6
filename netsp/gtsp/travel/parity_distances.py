"""Shortest paths between goals, by the rays that they cross an odd number of times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, ComparesArrays, Floats, Ints
from netsp.base.deprecated import deprecated_names

BITS_PER_WORD = 64
"""Format of sets of obstacles: bits of a word of uint64."""


@dataclass(frozen=True, eq=False)
class ParityDistances(ComparesArrays):
    """Lengths of the shortest paths between two goals, one for each set of rays crossed oddly.

    Attributes
    ----------
    ends : ndarray of int, shape (k, 2)
        Goals at the ends of each path, the smaller number first; 0 is the base.
    odd : ndarray of uint64, shape (k, w)
        Obstacles whose rays the path crosses an odd number of times: bit i of word j stands for
        obstacle 64 j + i.
    length : ndarray, shape (k,)
        Length in 3D, or a lower bound.
    reach : float
        Planar length above which paths are missing; from the base, paths above the tether are.
    obstacles : int
        Number of obstacles.
    """

    ends: Ints
    odd: npt.NDArray[np.uint64]
    length: Floats
    reach: float
    obstacles: int

    def odd_of(self, rows: Ints) -> Bools:
        """Return which obstacles (k, n) some paths cross an odd number of times."""
        bits = np.arange(self.obstacles)
        words = self.odd[rows][:, bits // BITS_PER_WORD]
        return np.asarray(
            (words >> (bits % BITS_PER_WORD).astype(np.uint64)) & np.uint64(1), dtype=bool
        )


__getattr__ = deprecated_names(globals(), WaysByParity="ParityDistances")

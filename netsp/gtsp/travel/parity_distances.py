"""Shortest paths between goals, by the barriers that they cross an odd number of times.

A closed tour crosses each barrier an even number of times. In the plane, barriers are the rays of
obstacles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, ComparesArrays, Floats, Ints
from netsp.base.deprecated import deprecated_method, deprecated_names

BITS_PER_ENTRY = 64
"""Format of sets of barriers: bits of an entry of uint64."""


@dataclass(frozen=True, eq=False)
class ParityDistances(ComparesArrays):
    """Lengths of the shortest paths between two goals, one for each set of barriers crossed oddly.

    Attributes
    ----------
    ends : ndarray of int, shape (k, 2)
        Goals at the ends of each path, the smaller number first; 0 is the base.
    odd : ndarray of uint64, shape (k, w)
        Barriers that the path crosses an odd number of times: bit i of word j stands for
        barrier 64 j + i.
    length : ndarray, shape (k,)
        Length in 3D, or a lower bound.
    reach : float
        Length above which paths are missing; other limits may hold for paths from the base.
    barriers : int
        Number of barriers.
    """

    ends: Ints
    odd: npt.NDArray[np.uint64]
    length: Floats
    reach: float
    barriers: int

    obstacles = deprecated_method("obstacles", "barriers")

    def odd_of(self, rows: Ints) -> Bools:
        """Return which barriers (k, n) some paths cross an odd number of times."""
        bits = np.arange(self.barriers)
        entries = self.odd[rows][:, bits // BITS_PER_ENTRY]
        return np.asarray(
            (entries >> (bits % BITS_PER_ENTRY).astype(np.uint64)) & np.uint64(1), dtype=bool
        )


__getattr__ = deprecated_names(
    globals(), BITS_PER_WORD="BITS_PER_ENTRY", WaysByParity="ParityDistances"
)

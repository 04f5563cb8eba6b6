"""Which legs are in no better tour, at one bit each.

Among 20,000 vertices a byte for every leg would be 0.4 GiB, a quarter of what their costs take.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.kernel import kernel

Bits = npt.NDArray[np.uint8]

ALL = np.uint8(255)
"""Eight legs that are dead."""

NO_BITS: Bits = np.zeros((0, 0), dtype=np.uint8)
"""Where legs are held in rows."""

ROWS = 512
"""Of a matrix that are worked on at a time, so that what is in between stays small."""


class DeadLegs:
    """The dead among all legs of some vertices.

    Parameters
    ----------
    dead : ndarray of bool, shape (V, V)
        Symmetric.

    Attributes
    ----------
    bits : ndarray of uint8, shape (V, ceil(V / 8))
        Leg (u, v) is bit ``v % 8`` of byte ``v // 8`` in row u. What is beyond the last vertex is
        dead.
    """

    def __init__(self, dead: Bools) -> None:
        self.bits: Bits = _packed(dead)

    @classmethod
    def of(cls, costs: Floats) -> DeadLegs:
        """Those that there are none of: costs (V, V) that are infinite."""
        out = cls(np.zeros((0, 0), dtype=bool))
        out.bits = np.empty((len(costs), -(-len(costs) // 8)), dtype=np.uint8)
        for rows in out._blocks():
            out.bits[rows] = _packed(np.isinf(costs[rows]))
        return out

    def __len__(self) -> int:
        return len(self.bits)

    def __getitem__(self, ends: tuple[Ints, Ints]) -> Bools:
        """(k,) of legs from us to vs."""
        us, vs = ends
        return np.asarray(self.bits[us, vs >> 3] >> (vs & 7) & 1 != 0)

    def add(self, rows: slice, dead: Bools) -> None:
        """Mark legs (k, V) of some vertices, too."""
        self.bits[rows] |= _packed(dead)

    def add_above(self, own: Ints, dead: Bools) -> None:
        """Mark all legs between cells whose own leg is dead.

        Parameters
        ----------
        own
            (V,) the cell of each vertex.
        dead
            (m, m) legs between cells.
        """
        for rows in self._blocks():
            self.add(rows, dead[own[rows]][:, own])

    def add_vertices(self, gone: Bools) -> None:
        """Mark all legs of some vertices (V,)."""
        self.bits[gone] = ALL
        self.bits |= np.packbits(gone, bitorder="little")

    def revive(self, legs: Ints) -> None:
        """Take the marks off legs (k, 2)."""
        for u, v in (legs.T, legs.T[::-1]):
            np.bitwise_and.at(self.bits, (u, v >> 3), ~(1 << (v & 7)).astype(np.uint8))

    def rows(self, some: slice) -> Bools:
        """(k, V) of some vertices."""
        bits = np.unpackbits(self.bits[some], axis=1, count=len(self), bitorder="little")
        return bits.view(bool)

    def matrix(self) -> Bools:
        """(V, V) of all."""
        return self.rows(slice(None))

    @property
    def left(self) -> int:
        """How many legs are not dead."""
        dead = sum(
            int(np.count_nonzero(np.unpackbits(self.bits[rows]).view(bool)))
            for rows in self._blocks()
        )
        return (8 * self.bits.size - dead) // 2

    def legs_left(self) -> Ints:
        """(k, 2) those that are not dead, u < v, in order."""
        out = [np.zeros((0, 2), dtype=np.int64)]
        for rows in self._blocks():
            u, v = np.nonzero(~self.rows(rows))
            u += rows.start
            out.append(np.column_stack([u, v])[u < v])
        return np.concatenate(out)

    def with_legs(self) -> Bools:
        """(V,) whether a vertex has a leg that is not dead."""
        return np.asarray((self.bits != ALL).any(axis=1))

    def restrict(self, keep: Bools) -> None:
        """Forget all vertices but those marked."""
        chosen = np.flatnonzero(keep)
        bits = np.empty((len(chosen), -(-len(chosen) // 8)), dtype=np.uint8)
        for first in range(0, len(chosen), ROWS):
            some = chosen[first : first + ROWS]
            whole = np.unpackbits(self.bits[some], axis=1, count=len(self), bitorder="little")
            bits[first : first + ROWS] = _packed(whole[:, chosen].view(bool))
        self.bits = bits

    def _blocks(self) -> Iterator[slice]:
        for first in range(0, len(self), ROWS):
            yield slice(first, min(first + ROWS, len(self)))


def _packed(dead: Bools) -> Bits:
    """Rows of marks as bits, those beyond the last vertex set."""
    bits = np.packbits(dead, axis=1, bitorder="little")
    if beyond := dead.shape[1] % 8:
        bits[:, -1] |= np.uint8(256 - (1 << beyond))
    return bits


@kernel
def mark_dead(u: int, v: int, bits: Bits) -> None:
    """Mark leg (u, v) in the row of u."""
    bits[u, v >> 3] |= np.uint8(1 << (v & 7))


@kernel
def not_dead(u: int, bits: Bits, other: Ints) -> int:
    """How many legs of a vertex are not dead, and the first so many of `other`: their other ends,
    ascending."""
    count = 0
    for k in range(bits.shape[1]):
        eight = bits[u, k]
        if eight == 255:
            continue
        for j in range(8):
            if not eight >> j & 1:
                other[count] = 8 * k + j
                count += 1
    return count

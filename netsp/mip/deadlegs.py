"""Mask of the legs that are in no better tour, one bit for each leg.

Among 20,000 vertices a byte for each leg would take 0.4 GiB, a quarter of the memory of the costs.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.mip.mip_policy import PricingPolicy

Bits = npt.NDArray[np.uint8]

ALL_DEAD = np.uint8(255)
"""Code of eight dead legs."""

NO_BITS: Bits = np.zeros((0, 0), dtype=np.uint8)
"""Mask of no vertices, for kernels that read sparse costs instead."""


class DeadLegs:
    """Symmetric mask of dead legs.

    Parameters
    ----------
    dead : ndarray of bool, shape (V, V)
        The mask.
    policy : PricingPolicy
        Rows that are unpacked at a time.

    Attributes
    ----------
    bits : ndarray of uint8, shape (V, ceil(V / 8))
        Leg (u, v) is bit ``v % 8`` of byte ``v // 8`` in row u. Bits past the last vertex are set.
    """

    def __init__(self, dead: Bools, policy: PricingPolicy = PricingPolicy()) -> None:
        self.policy = policy
        self.bits: Bits = _packed(dead)

    @classmethod
    def missing(cls, costs: Floats, policy: PricingPolicy = PricingPolicy()) -> DeadLegs:
        """Return the mask of the legs with infinite costs (V, V)."""
        out = cls(np.zeros((0, 0), dtype=bool), policy)
        out.bits = np.empty((len(costs), -(-len(costs) // 8)), dtype=np.uint8)
        for rows in out._blocks():
            out.bits[rows] = _packed(np.isinf(costs[rows]))
        return out

    def __len__(self) -> int:
        return len(self.bits)

    def __getitem__(self, ends: tuple[Ints, Ints]) -> Bools:
        """Return the mask (k,) of dead legs from us to vs."""
        us, vs = ends
        return np.asarray(self.bits[us, vs >> 3] >> (vs & 7) & 1 != 0)

    def add(self, rows: slice, dead: Bools) -> None:
        """Mark more legs (k, V) of a range of vertices as dead."""
        self.bits[rows] |= _packed(dead)

    def add_above(self, cell: Ints, dead: Bools) -> None:
        """Mark all legs between two cells as dead if the leg of the cells is.

        Parameters
        ----------
        cell
            (V,) cell of each vertex.
        dead
            (m, m) mask of legs between cells.
        """
        for rows in self._blocks():
            self.add(rows, dead[cell[rows]][:, cell])

    def add_vertices(self, gone: Bools) -> None:
        """Mark all legs of the vertices of a mask (V,) as dead."""
        self.bits[gone] = ALL_DEAD
        self.bits |= np.packbits(gone, bitorder="little")

    def revive(self, legs: Ints) -> None:
        """Unmark legs (k, 2)."""
        for u, v in (legs.T, legs.T[::-1]):
            np.bitwise_and.at(self.bits, (u, v >> 3), ~(1 << (v & 7)).astype(np.uint8))

    def rows(self, selected: slice) -> Bools:
        """Return the mask (k, V) of a range of vertices."""
        bits = np.unpackbits(self.bits[selected], axis=1, count=len(self), bitorder="little")
        return bits.view(bool)

    def matrix(self) -> Bools:
        """Return the mask (V, V) of all vertices."""
        return self.rows(slice(None))

    @property
    def left(self) -> int:
        """Number of legs that are not dead."""
        dead = sum(
            int(np.count_nonzero(np.unpackbits(self.bits[rows]).view(bool)))
            for rows in self._blocks()
        )
        return (8 * self.bits.size - dead) // 2

    def legs_left(self) -> Ints:
        """Return the legs (k, 2) that are not dead, u < v, in order."""
        out = [np.zeros((0, 2), dtype=np.int64)]
        for rows in self._blocks():
            u, v = np.nonzero(~self.rows(rows))
            u += rows.start
            out.append(np.column_stack([u, v])[u < v])
        return np.concatenate(out)

    def with_legs(self) -> Bools:
        """Return the mask (V,) of vertices with a leg that is not dead."""
        return np.asarray((self.bits != ALL_DEAD).any(axis=1))

    def restrict(self, keep: Bools) -> None:
        """Remove all vertices but those marked."""
        chosen = np.flatnonzero(keep)
        bits = np.empty((len(chosen), -(-len(chosen) // 8)), dtype=np.uint8)
        step = self.policy.mask_rows
        for first in range(0, len(chosen), step):
            rows = chosen[first : first + step]
            whole = np.unpackbits(self.bits[rows], axis=1, count=len(self), bitorder="little")
            bits[first : first + step] = _packed(whole[:, chosen].view(bool))
        self.bits = bits

    def _blocks(self) -> Iterator[slice]:
        step = self.policy.mask_rows
        for first in range(0, len(self), step):
            yield slice(first, min(first + step, len(self)))


def _packed(dead: Bools) -> Bits:
    """Return the rows of a mask as bits; those beyond the last vertex are set."""
    bits = np.packbits(dead, axis=1, bitorder="little")
    if beyond := dead.shape[1] % 8:
        bits[:, -1] |= np.uint8(256 - (1 << beyond))
    return bits


@kernel
def mark_dead(u: int, v: int, bits: Bits) -> None:
    """Mark leg (u, v) as dead in the row of u."""
    bits[u, v >> 3] |= np.uint8(1 << (v & 7))


@kernel
def write_alive(u: int, bits: Bits, other: Ints) -> int:
    """Write the ends of a vertex's legs that are not dead to `other`, and return their number."""
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

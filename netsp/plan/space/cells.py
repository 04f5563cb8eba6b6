"""Free water of a scene as a cubical complex of cells, edges and squares.

Edges and squares count only if balls without solids cover them. Distances of a field overstate
nowhere, so every path along edges that count is free, and every loop that shrinks over squares that
count is contractible. Otherwise, paths would pass through rings thinner than a cell. Gaps narrower
than a cell may be closed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.bounded_work import abandoned, end_if_abandoned
from netsp.base.compiled.dynamic_array import write_ints
from netsp.base.compiled.kernel import kernel
from netsp.base.errors import InputError
from netsp.base.time_flags import Flag
from netsp.plan.space.mission_policy import WordPolicy
from netsp.world.scene.field import DistanceField
from netsp.world.scene.sampling import Field, distance

FREE_CELL = 1
"""Code of a cell whose centre is free, a bit of its flags."""

OPEN_CELL = 2
"""Code of a cell whose 26 neighbours have all edges and squares, a bit of its flags."""

EDGE_BIT = 4
"""Code of an edge along x, the first of three bits: along x, y and z."""

SQUARE_BIT = 32
"""Code of a square along y and z, the first of three bits: along yz, zx and xy."""


@dataclass(frozen=True)
class Cells:
    """Cubical complex of a box in a scene.

    Attributes
    ----------
    low
        (3,) corner of the box, metres.
    cell
        Size of a cell, metres.
    flags
        (nx, ny, nz) bits of `FREE_CELL`, `OPEN_CELL`, `EDGE_BIT` and `SQUARE_BIT`; edges and
        squares belong to their lowest corner.
    """

    field: DistanceField
    low: Floats
    cell: float
    flags: npt.NDArray[np.uint8]

    @classmethod
    def in_box(
        cls,
        field: DistanceField,
        low: npt.ArrayLike,
        high: npt.ArrayLike,
        cell: float,
        policy: WordPolicy | None = None,
    ) -> Cells:
        """Return the complex of a box between two corners, with cells of a given size, all in
        metres.

        Raises
        ------
        InputError
            A box without size, or more cells than the policy allows.
        """
        policy = policy or WordPolicy()
        low = np.asarray(low, dtype=float)
        size = np.asarray(high, dtype=float) - low
        if not (size > 0.0).all():
            raise InputError(f"bounds: expected a box, got sides {size.tolist()}")
        shape = np.maximum(1.0, np.ceil(size / cell))
        if float(np.prod(shape)) > policy.max_cells:
            better = cell * (float(np.prod(shape)) / policy.max_cells) ** (1.0 / 3.0)
            raise InputError(
                f"cell: {cell:g} makes {np.prod(shape):.2g} cells, which would take "
                f"{np.prod(shape) * 7e-8:.2g} GiB; expected {better:.2g} or more"
            )
        nx, ny, nz = (int(n) for n in shape)
        flags = complex_flags(
            field.arrays,
            low,
            cell,
            (nx, ny, nz),
            policy.min_room_ratio,
            policy.max_halvings,
            abandoned(),
        )
        end_if_abandoned()
        return cls(field, low, cell, flags)

    def centre(self, cells: npt.ArrayLike) -> Floats:
        """Return the centres (..., 3) of cells (..., 3), metres."""
        return np.asarray(self.low + (np.asarray(cells) + 0.5) * self.cell)


class Marking(NamedTuple):
    """Cells whose edges and squares are marked, with room for the marking of one of them.

    Attributes
    ----------
    field, low, cell, flags
        As in `Cells`.
    room
        (nx, ny, nz) distance of the centre of each cell from solids, metres.
    at
        (3,) the cell that is marked.
    to, centre
        (3,) overwritten.
    max_halvings
        How often an edge or a square is divided to prove that it is free.
    """

    field: Field
    low: Floats
    cell: float
    flags: npt.NDArray[np.uint8]
    room: npt.NDArray[np.float32]
    at: Ints
    to: Ints
    centre: Floats
    max_halvings: int


@kernel
def complex_flags(
    field: Field,
    low: Floats,
    cell: float,
    shape: tuple[int, int, int],
    min_room_ratio: float,
    max_halvings: int,
    stop: Flag,
) -> npt.NDArray[np.uint8]:
    """Return the flags of all cells. Ends early once `stop` is set."""
    nx, ny, nz = shape
    flags = np.zeros(shape, dtype=np.uint8)
    room = np.empty(shape, dtype=np.float32)
    for i in range(nx):
        if stop[0] != 0:
            break
        for j in range(ny):
            for k in range(nz):
                d = distance(
                    field,
                    low[0] + (i + 0.5) * cell,
                    low[1] + (j + 0.5) * cell,
                    low[2] + (k + 0.5) * cell,
                )
                room[i, j, k] = d
                if d >= min_room_ratio * cell:
                    flags[i, j, k] = FREE_CELL
    at, to, centre = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64), np.empty(3)
    marking = Marking(field, low, cell, flags, room, at, to, centre, max_halvings)
    for i in range(nx):
        if stop[0] != 0:
            break
        for j in range(ny):
            for k in range(nz):
                if flags[i, j, k] != 0:
                    at[0], at[1], at[2] = i, j, k
                    mark_edges(marking)
    for i in range(nx):
        if stop[0] != 0:
            break
        for j in range(ny):
            for k in range(nz):
                if flags[i, j, k] != 0:
                    at[0], at[1], at[2] = i, j, k
                    mark_squares(marking)
    return flags


@kernel
def mark_edges(marking: Marking) -> None:
    """Set the bits of a free cell for its edges that are free, and for an open cell."""
    low, cell, flags, room = marking.low, marking.cell, marking.flags, marking.room
    at, to, centre = marking.at, marking.to, marking.centre
    i, j, k = at[0], at[1], at[2]
    if room[i, j, k] >= 1.75 * cell:
        flags[i, j, k] |= OPEN_CELL
    wide = room[i, j, k] >= 1.4143 * cell
    for axis in range(3):
        if at[axis] == flags.shape[axis] - 1:
            continue
        write_ints(to, at, 3)
        to[axis] += 1
        if not flags[to[0], to[1], to[2]] & FREE_CELL:
            continue
        if not wide:
            for c in range(3):
                centre[c] = low[c] + (0.5 * (at[c] + to[c]) + 0.5) * cell
            if room[i, j, k] + room[to[0], to[1], to[2]] < 1.0001 * cell and (
                not is_covered(marking.field, centre, cell, axis, -1, marking.max_halvings)
            ):
                continue
        flags[i, j, k] |= EDGE_BIT << axis


@kernel
def mark_squares(marking: Marking) -> None:
    """Set the bits of a free cell for its squares that are free; all edges are marked before."""
    low, cell, flags, room = marking.low, marking.cell, marking.flags, marking.room
    at, to, centre = marking.at, marking.to, marking.centre
    i, j, k = at[0], at[1], at[2]
    wide = room[i, j, k] >= 1.4143 * cell
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        if at[a] == flags.shape[a] - 1 or at[b] == flags.shape[b] - 1:
            continue
        if not (flags[i, j, k] & (EDGE_BIT << a) and flags[i, j, k] & (EDGE_BIT << b)):
            continue
        write_ints(to, at, 3)
        to[a] += 1
        if not flags[to[0], to[1], to[2]] & (EDGE_BIT << b):
            continue
        write_ints(to, at, 3)
        to[b] += 1
        if not flags[to[0], to[1], to[2]] & (EDGE_BIT << a):
            continue
        if not wide:
            for c in range(3):
                centre[c] = low[c] + (at[c] + 0.5) * cell
            centre[a] += 0.5 * cell
            centre[b] += 0.5 * cell
            if not is_covered(marking.field, centre, cell, a, b, marking.max_halvings):
                continue
        flags[i, j, k] |= SQUARE_BIT << axis


@kernel
def is_covered(field: Field, centre: Floats, size: float, a: int, b: int, halvings: int) -> bool:
    """Return whether balls without solids cover an edge along axis a (b < 0) or a square along a
    and b."""
    # (centre, half a side, halvings left) of the parts still to cover
    parts, left = np.empty((4 * halvings + 8, 5)), 1
    parts[0, 0], parts[0, 1], parts[0, 2] = centre[0], centre[1], centre[2]
    parts[0, 3], parts[0, 4] = 0.5 * size, halvings
    while left > 0:
        left -= 1
        x, y, z, half, more = parts[left]
        d = distance(field, x, y, z)
        if d >= 1.0001 * (half if b < 0 else half * math.sqrt(2.0)):
            continue
        if more == 0.0 or d <= 0.0:
            return False
        for k in range(2 if b < 0 else 4):
            parts[left, 0], parts[left, 1], parts[left, 2] = x, y, z
            parts[left, a] += 0.5 * half if k % 2 else -0.5 * half
            if b >= 0:
                parts[left, b] += 0.5 * half if k // 2 else -0.5 * half
            parts[left, 3], parts[left, 4] = 0.5 * half, more - 1.0
            left += 1
    return True

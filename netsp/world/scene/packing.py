"""Layout of a distance field, without its voxels, in one vector.

The vector holds a header, a row for each solid, the corners of prisms, and the look-up. There is
one vector instead of several tables, because a kernel that takes an array out of a tuple counts a
reference with an atomic instruction, which would take most of the time of a distance.

The look-up is a coarse grid of cells, with the solids that may be nearest somewhere in each. The
list of cell k is ``data[int(data[c + k]) : int(data[c + k + 1])]``, where c is stored at `CELLS`;
it holds the places at which rows begin.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints, Singles
from netsp.base.compiled.dynamic_array import write_ints
from netsp.base.compiled.kernel import kernel
from netsp.world.scene.grid import SIDE, VoxelGrid
from netsp.world.scene.solids import PRISM, solid_distance

COUNT = 0
"""Index of the number of solids."""

CELLS = 1
"""Index of the place at which the look-up begins; 0 without a look-up, where all solids are
measured."""

VOXELS = 2
"""Index of 1 for a field with voxels, else 0."""

NEAR = 3
"""Index of the look-up's origin (3), size of a cell and counts (3)."""

PLACE = 10
"""Index of the voxels' origin (3) and size, and of the bounding box (6) of the solid."""

SHAPE = 20
"""Index of the counts (3) of the voxels."""

BLOCKS = 23
"""Index of the place at which the table of blocks begins; 0 without blocks. For each cell between
grid points, the table holds the place of its block among the voxels, or 0."""

FINE = 24
"""Index of the size of a voxel in a block."""

ROWS = 25
"""Index of the first row."""

ROW = 17
"""Format of a row: its length, of the kind and 16 numbers."""


def pack_solids(kinds: list[int], rows: list[list[float]], outline: npt.ArrayLike) -> Floats:
    """Return the vector of solids, without look-up.

    Rows of prisms state the range of their corners in the outline (m, 2).
    """
    corners = np.asarray(outline, dtype=float).reshape(-1, 2)
    data = np.zeros(ROWS + ROW * len(kinds) + corners.size)
    data[COUNT] = len(kinds)
    first = len(data) - corners.size
    data[first:] = corners.ravel()
    for n, (kind, row) in enumerate(zip(kinds, rows, strict=True)):
        at = ROWS + ROW * n
        data[at] = kind
        data[at + 1 : at + 1 + len(row)] = row
        if kind == PRISM:
            data[at + 1 : at + 3] = first + 2 * data[at + 1 : at + 3]
    return data


def add_lookup(data: Floats, low: Floats, high: Floats, size: float) -> Floats:
    """Return a vector with a look-up whose cells have a size and cover a box."""
    counts = np.ceil((high - low) / size)
    data = data.copy()
    data[NEAR : NEAR + 7] = [*low, size, *counts]
    cells, items = candidates(data)
    begin = len(data)
    data[CELLS] = begin
    return np.concatenate([data, begin + len(cells) + cells, items])


def add_voxels(data: Floats, grid: VoxelGrid) -> Floats:
    """Return the vector of a field with voxels."""
    data = data.copy()
    data[VOXELS] = 1.0
    data[PLACE : PLACE + 10] = [*grid.origin, grid.size, *np.ravel(grid.solid)]
    data[SHAPE : SHAPE + 3] = grid.counts
    data[FINE] = grid.voxel
    if grid.table is None:
        return data
    data[BLOCKS] = len(data)
    begins = np.prod(grid.counts) + SIDE**3 * grid.table.astype(float)
    return np.concatenate([data, np.where(grid.table < 0, 0.0, begins).ravel()])


def unpack_voxels(data: Floats, values: Singles, notes: tuple[str, ...]) -> VoxelGrid | None:
    """Return the grid of a vector; None without voxels."""
    if data[VOXELS] == 0.0:
        return None
    nx, ny, nz = data[SHAPE : SHAPE + 3].astype(int).tolist()
    table = None
    if data[BLOCKS]:
        begin, cells = int(data[BLOCKS]), (nx - 1, ny - 1, nz - 1)
        begins = data[begin : begin + int(np.prod(cells))].reshape(cells)
        blocks = (begins - nx * ny * nz) / SIDE**3
        table = np.where(begins > 0.0, blocks, -1.0).astype(np.int32)
    box = data[PLACE + 4 : PLACE + 10].reshape(2, 3).copy()
    place, size = data[PLACE : PLACE + 3].copy(), float(data[PLACE + 3])
    return VoxelGrid(values, (nx, ny, nz), place, size, box, notes, table)


def sample_block_points(data: Floats, voxels: Singles, offset: float, max_count: int) -> Floats:
    """Return at most `max_count` points (n, 3) in blocks whose distance is below an offset.

    They are chosen evenly, as many from each of evenly chosen blocks.
    """
    counts = data[SHAPE : SHAPE + 3].astype(int) - 1
    begin = int(data[BLOCKS])
    table = data[begin : begin + int(np.prod(counts))].reshape(counts)
    cells = np.argwhere(table > 0.0)
    cells = cells[np.argsort(table[tuple(cells.T)])]
    values = voxels[int(np.prod(counts + 1)) :].reshape(-1, SIDE, SIDE, SIDE)
    chosen = np.arange(0, len(cells), max(1, len(cells) // max_count))
    at = np.argwhere(values[chosen] < offset)
    at = at[:: max(1, len(at) // max_count)]
    return np.asarray(
        data[PLACE : PLACE + 3] + data[FINE] * (SIDE * cells[chosen[at[:, 0]]] + at[:, 1:])
    )


@kernel
def candidates(data: Floats) -> tuple[Ints, Ints]:
    """Return, for every cell of the look-up, the solids that may be nearest to some point of it.

    These are the solids no farther from its centre than the nearest one plus the cell's diagonal.

    Returns
    -------
    cells, items : ndarray of int
        The rows of the solids of cell k begin at ``items[cells[k] : cells[k + 1]]``.
    """
    near = data[NEAR : NEAR + 7]
    nx, ny, nz = int(near[4]), int(near[5]), int(near[6])
    count = int(data[COUNT])
    cells = np.zeros(nx * ny * nz + 1, dtype=np.int64)
    items = np.empty(4 * nx * ny * nz + count, dtype=np.int64)
    found = np.empty(count)
    size, reach = 0, math.sqrt(3.0) * near[3] * (1.0 + 1e-9)
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                x = near[0] + (i + 0.5) * near[3]
                y = near[1] + (j + 0.5) * near[3]
                z = near[2] + (k + 0.5) * near[3]
                smallest = math.inf
                for n in range(count):
                    found[n] = solid_distance(data, ROWS + ROW * n, x, y, z)[0]
                    smallest = min(smallest, found[n])
                if size + count > len(items):
                    more = np.empty(2 * len(items) + count, dtype=np.int64)
                    write_ints(more, items, size)
                    items = more
                for n in range(count):
                    if found[n] <= smallest + reach:
                        items[size] = ROWS + ROW * n
                        size += 1
                cells[(i * ny + j) * nz + k + 1] = size
    return cells, items[:size].copy()

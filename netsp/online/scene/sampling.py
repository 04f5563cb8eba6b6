"""What a distance field says at a point: the one query beneath tether, planner and pictures.

Exact for solids (`netsp.online.scene.solids`), trilinear for voxels, the least of both for both.
Compiled; `Field` is a plain tuple of arrays, so that every kernel takes it whole.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.arrays import Floats, Ints
from netsp.compiled.kernel import kernel
from netsp.online.scene.solids import ROW, solid_distance


class Field(NamedTuple):
    """The arrays of a distance field.

    Attributes
    ----------
    kinds, rows, outline
        The solids. (n,), (n, 16), (m, 2).
    cells, items, near
        Which solids may be nearest in a cell of a coarse grid: cell k has ``items[cells[k]:cells[k
        + 1]]``; near = origin (3), cell size, cell counts (3). An empty `cells` means that all
        solids are asked.
    grid, place
        Distances at grid points, (nx, ny, nz), empty without voxels; place = origin (3), voxel
        size, bounding box of all that is solid (6).
    offset
        Subtracted from every distance (the tether's radius).
    """

    kinds: npt.NDArray[np.int64]
    rows: npt.NDArray[np.float64]
    outline: npt.NDArray[np.float64]
    cells: npt.NDArray[np.int64]
    items: npt.NDArray[np.int64]
    near: npt.NDArray[np.float64]
    grid: npt.NDArray[np.float32]
    place: npt.NDArray[np.float64]
    offset: float


@kernel
def sample(field: Field, x: float, y: float, z: float) -> tuple[float, float, float, float, int]:
    """(d, gx, gy, gz, solid): distance, its unit gradient, and which solid is nearest (-1: the
    voxels)."""
    d, gx, gy, gz, which = _solids(field, x, y, z)
    if field.grid.size > 0:
        e, ex, ey, ez = _voxels(field.grid, field.place, x, y, z)
        if e < d:
            d, gx, gy, gz, which = e, ex, ey, ez, -1
    return d - field.offset, gx, gy, gz, which


@kernel
def distance(field: Field, x: float, y: float, z: float) -> float:
    """Distance alone."""
    d = math.inf
    if len(field.kinds) > 0:
        d = _solids(field, x, y, z)[0]
    if field.grid.size > 0:
        d = min(d, _voxel_distance(field.grid, field.place, x, y, z))
    return d - field.offset


@kernel
def _solids(field: Field, x: float, y: float, z: float) -> tuple[float, float, float, float, int]:
    d, gx, gy, gz, which = math.inf, 0.0, 0.0, 1.0, -1
    cells, near = field.cells, field.near
    if cells.size > 0:
        i = math.floor((x - near[0]) / near[3])
        j = math.floor((y - near[1]) / near[3])
        k = math.floor((z - near[2]) / near[3])
        ny, nz = int(near[5]), int(near[6])
        if 0 <= i < near[4] and 0 <= j < ny and 0 <= k < nz:
            cell = (i * ny + j) * nz + k
            for at in range(cells[cell], cells[cell + 1]):
                n = field.items[at]
                e, ex, ey, ez = solid_distance(
                    field.kinds[n], field.rows[n], field.outline, x, y, z
                )
                if e < d:
                    d, gx, gy, gz, which = e, ex, ey, ez, n
            return d, gx, gy, gz, which
    for n in range(len(field.kinds)):
        e, ex, ey, ez = solid_distance(field.kinds[n], field.rows[n], field.outline, x, y, z)
        if e < d:
            d, gx, gy, gz, which = e, ex, ey, ez, n
    return d, gx, gy, gz, which


@kernel
def _cell(
    grid: npt.NDArray[np.float32], place: Floats, x: float, y: float, z: float
) -> tuple[int, int, int, float, float, float, bool]:
    """Cell and the fractions within it; whether the point lies in the grid, to within rounding."""
    nx, ny, nz = grid.shape
    u, v, w = (x - place[0]) / place[3], (y - place[1]) / place[3], (z - place[2]) / place[3]
    e = 1e-6
    inside = -e <= u <= nx - 1 + e and -e <= v <= ny - 1 + e and -e <= w <= nz - 1 + e
    if not inside:
        return 0, 0, 0, 0.0, 0.0, 0.0, False
    i, j, k = min(int(u), nx - 2), min(int(v), ny - 2), min(int(w), nz - 2)
    return i, j, k, u - i, v - j, w - k, True


@kernel
def _border(
    grid: npt.NDArray[np.float32], place: Floats, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """The point of the grid nearest to one outside of it."""
    nx, ny, nz = grid.shape
    h = place[3]
    return (
        min(max(x, place[0]), place[0] + (nx - 1) * h),
        min(max(y, place[1]), place[1] + (ny - 1) * h),
        min(max(z, place[2]), place[2] + (nz - 1) * h),
    )


@kernel
def _voxel_distance(
    grid: npt.NDArray[np.float32], place: Floats, x: float, y: float, z: float
) -> float:
    i, j, k, u, v, w, inside = _cell(grid, place, x, y, z)
    if not inside:
        # all solids lie in the grid, a box: seen from its nearest point c, they are behind it, so
        # no distance is below hypot(|p - c|, d(c)), nor below that to their bounding box
        bx, by, bz = _border(grid, place, x, y, z)
        i, j, k, u, v, w, _ = _cell(grid, place, bx, by, bz)
        value = max(_trilinear(grid, i, j, k, u, v, w), 0.0)
        behind = (x - bx) ** 2 + (y - by) ** 2 + (z - bz) ** 2 + value * value
        dx = max(place[4] - x, 0.0, x - place[7])
        dy = max(place[5] - y, 0.0, y - place[8])
        dz = max(place[6] - z, 0.0, z - place[9])
        return math.sqrt(max(behind, dx * dx + dy * dy + dz * dz))
    return _trilinear(grid, i, j, k, u, v, w)


@kernel
def _trilinear(
    grid: npt.NDArray[np.float32], i: int, j: int, k: int, u: float, v: float, w: float
) -> float:
    a = (1.0 - w) * grid[i, j, k] + w * grid[i, j, k + 1]
    b = (1.0 - w) * grid[i, j + 1, k] + w * grid[i, j + 1, k + 1]
    c = (1.0 - w) * grid[i + 1, j, k] + w * grid[i + 1, j, k + 1]
    d = (1.0 - w) * grid[i + 1, j + 1, k] + w * grid[i + 1, j + 1, k + 1]
    return float((1.0 - u) * ((1.0 - v) * a + v * b) + u * ((1.0 - v) * c + v * d))


@kernel
def _voxels(
    grid: npt.NDArray[np.float32], place: Floats, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    # half a voxel to either side: a central difference does not jump at the cells' faces
    h = 0.5 * place[3]
    d = _voxel_distance(grid, place, x, y, z)
    gx = _voxel_distance(grid, place, x + h, y, z) - _voxel_distance(grid, place, x - h, y, z)
    gy = _voxel_distance(grid, place, x, y + h, z) - _voxel_distance(grid, place, x, y - h, z)
    gz = _voxel_distance(grid, place, x, y, z + h) - _voxel_distance(grid, place, x, y, z - h)
    length = math.sqrt(gx * gx + gy * gy + gz * gz)
    if length == 0.0:
        return d, 0.0, 0.0, 1.0
    return d, gx / length, gy / length, gz / length


@kernel
def sample_many(field: Field, points: Floats) -> Floats:
    """(n, 5) distance, gradient and nearest solid at (n, 3) points."""
    out = np.empty((len(points), 5))
    for p in range(len(points)):
        d, gx, gy, gz, which = sample(field, points[p, 0], points[p, 1], points[p, 2])
        out[p, 0], out[p, 1], out[p, 2], out[p, 3], out[p, 4] = d, gx, gy, gz, which
    return out


@kernel
def lowest_along(
    field: Field, ax: float, ay: float, az: float, bx: float, by: float, bz: float, tolerance: float
) -> tuple[float, float]:
    """Least distance along a segment and where (fraction), to within `tolerance`.

    Sphere tracing: within a distance d of a point no distance is below 0, so the next sample may be
    d + tolerance further and nothing in between is deeper than -tolerance. The samples are that
    dense only near solids.
    """
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2 + (bz - az) ** 2)
    if length == 0.0:
        return distance(field, ax, ay, az), 0.0
    best, where, s = math.inf, 0.0, 0.0
    while True:
        t = s / length
        d = distance(field, ax + t * (bx - ax), ay + t * (by - ay), az + t * (bz - az))
        if d < best:
            best, where = d, t
        if s >= length:
            return best, where
        s = min(length, s + max(d, 0.0) + tolerance)


@kernel
def candidates(field: Field, near: Floats) -> tuple[Ints, Ints]:
    """For every cell of a coarse grid, the solids that may be nearest to some point of it: those no
    farther from its centre than the nearest plus the cell's diagonal. Returns (cells, items)."""
    nx, ny, nz = int(near[4]), int(near[5]), int(near[6])
    count = len(field.kinds)
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
                least = math.inf
                for n in range(count):
                    found[n] = solid_distance(
                        field.kinds[n], field.rows[n], field.outline, x, y, z
                    )[0]
                    least = min(least, found[n])
                if size + count > len(items):
                    more = np.empty(2 * len(items) + count, dtype=np.int64)
                    more[:size] = items[:size]
                    items = more
                for n in range(count):
                    if found[n] <= least + reach:
                        items[size] = n
                        size += 1
                cells[(i * ny + j) * nz + k + 1] = size
    return cells, items[:size].copy()


def of_solids(
    kinds: list[int], rows: list[list[float]], outline: npt.ArrayLike, offset: float = 0.0
) -> Field:
    """A field without voxels."""
    table = np.zeros((len(rows), ROW))
    for n, row in enumerate(rows):
        table[n, : len(row)] = row
    return Field(
        np.array(kinds, dtype=np.int64),
        table,
        np.asarray(outline, dtype=float).reshape(-1, 2),
        np.empty(0, dtype=np.int64),
        np.empty(0, dtype=np.int64),
        np.zeros(7),
        np.empty((0, 0, 0), dtype=np.float32),
        np.zeros(10),
        float(offset),
    )

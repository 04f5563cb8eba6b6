"""Distance and gradient at points, for tethers, planners and pictures. Compiled.

Distances are exact for solids (`netsp.world.scene.solids`) and trilinear for voxels. `Field` is a
plain tuple of arrays, because kernels accept those.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Singles
from netsp.base.compiled.interpretation import interpreted, interprets
from netsp.base.compiled.kernel import kernel
from netsp.world.scene import point_batches
from netsp.world.scene.grid import SIDE
from netsp.world.scene.packing import (
    BLOCKS,
    CELLS,
    COUNT,
    FINE,
    NEAR,
    PLACE,
    ROW,
    ROWS,
    SHAPE,
    VOXELS,
)
from netsp.world.scene.solids import (
    BOX,
    CAPSULE,
    CYLINDER,
    box_gap,
    capsule,
    capsule_gap,
    cylinder_gap,
    solid_distance,
)


class Field(NamedTuple):
    """Arrays of a distance field.

    Attributes
    ----------
    data
        Solids and layout of the voxels (`netsp.world.scene.packing`).
    grid
        Distances at grid points and in blocks, in one row; empty without voxels.
    offset
        Length subtracted from every distance: the tether's radius.
    """

    data: Floats
    grid: Singles
    offset: float


@kernel
def sample(field: Field, x: float, y: float, z: float) -> tuple[float, float, float, float, int]:
    """Return distance, its unit gradient (3), and the index of the nearest solid, -1 for voxels."""
    data = field.data
    d, at = _nearest(data, x, y, z)
    gx, gy, gz, which = 0.0, 0.0, 1.0, -1
    if at > 0:
        if int(data[at]) == CAPSULE:  # as in `_nearest`
            d, gx, gy, gz = capsule(data, at + 1, x, y, z)
        else:
            d, gx, gy, gz = solid_distance(data, at, x, y, z)
        which = (at - ROWS) // ROW
    if data[VOXELS] > 0.0:
        e, ex, ey, ez = _voxels(field.grid, data, x, y, z)
        if e < d:
            d, gx, gy, gz, which = e, ex, ey, ez, -1
    return d - field.offset, gx, gy, gz, which


@kernel
def distance(field: Field, x: float, y: float, z: float) -> float:
    """Return the distance at a point, metres, without its gradient."""
    data = field.data
    d, _ = _nearest(data, x, y, z)
    if data[VOXELS] > 0.0:
        d = min(d, _voxel_distance(field.grid, data, x, y, z))
    return d - field.offset


@kernel
def _nearest(data: Floats, x: float, y: float, z: float) -> tuple[float, int]:
    """Return the distance and the row of the nearest solid; infinite and 0 without solids."""
    begin, end, looked_up = 0, int(data[COUNT]), False
    if data[CELLS] > 0.0:
        size = data[NEAR + 3]
        u = (x - data[NEAR]) / size
        v = (y - data[NEAR + 1]) / size
        w = (z - data[NEAR + 2]) / size
        if 0.0 <= u < data[NEAR + 4] and 0.0 <= v < data[NEAR + 5] and 0.0 <= w < data[NEAR + 6]:
            ny, nz = int(data[NEAR + 5]), int(data[NEAR + 6])
            cell = int(data[CELLS]) + (int(u) * ny + int(v)) * nz + int(w)
            begin, end, looked_up = int(data[cell]), int(data[cell + 1]), True
    d, which = math.inf, 0
    for item in range(begin, end):
        at = int(data[item]) if looked_up else ROWS + ROW * item
        kind = int(data[at])
        # inlined by hand, because the compiler would not inline a function
        if kind == CAPSULE:
            e = capsule_gap(data, at + 1, x, y, z)
        elif kind == CYLINDER:
            e = cylinder_gap(data, at + 1, x, y, z)
        elif kind == BOX:
            e = box_gap(data, at + 1, x, y, z)
        else:
            e = solid_distance(data, at, x, y, z)[0]
        if e < d:
            d, which = e, at
    return d, which


@kernel
def _voxel_distance(grid: Singles, data: Floats, x: float, y: float, z: float) -> float:
    h = data[PLACE + 3]
    nx, ny, nz = int(data[SHAPE]), int(data[SHAPE + 1]), int(data[SHAPE + 2])
    u, v, w = (x - data[PLACE]) / h, (y - data[PLACE + 1]) / h, (z - data[PLACE + 2]) / h
    e = 1e-6  # rounding
    if -e <= u <= nx - 1 + e and -e <= v <= ny - 1 + e and -e <= w <= nz - 1 + e:
        return _between(grid, data, nx, ny, nz, u, v, w)
    # all solids lie in the grid, a box: seen from its nearest point c, they are behind it, so
    # no distance is below hypot(|p - c|, d(c)), nor below that to their bounding box
    bu, bv, bw = min(max(u, 0.0), nx - 1.0), min(max(v, 0.0), ny - 1.0), min(max(w, 0.0), nz - 1.0)
    value = max(_between(grid, data, nx, ny, nz, bu, bv, bw), 0.0)
    behind = h * h * ((u - bu) ** 2 + (v - bv) ** 2 + (w - bw) ** 2) + value * value
    dx = max(data[PLACE + 4] - x, 0.0, x - data[PLACE + 7])
    dy = max(data[PLACE + 5] - y, 0.0, y - data[PLACE + 8])
    dz = max(data[PLACE + 6] - z, 0.0, z - data[PLACE + 9])
    return math.sqrt(max(behind, dx * dx + dy * dy + dz * dz))


@kernel
def _between(
    grid: Singles, data: Floats, nx: int, ny: int, nz: int, u: float, v: float, w: float
) -> float:
    """Return the linear interpolation at (u, v, w), in steps of the grid, between grid or block
    points."""
    i, j, k = min(int(u), nx - 2), min(int(v), ny - 2), min(int(w), nz - 2)
    u, v, w = u - i, v - j, w - k
    at, across, along = (i * ny + j) * nz + k, ny * nz, nz
    if data[BLOCKS] > 0.0:
        begin = data[int(data[BLOCKS]) + (i * (ny - 1) + j) * (nz - 1) + k]
        if begin > 0.0:
            u, v, w = SIDE * u, SIDE * v, SIDE * w
            p, q, r = min(int(u), SIDE - 1), min(int(v), SIDE - 1), min(int(w), SIDE - 1)
            u, v, w = u - p, v - q, w - r
            if p == SIDE - 1 or q == SIDE - 1 or r == SIDE - 1:
                p, q, r = SIDE * i + p, SIDE * j + q, SIDE * k + r
                return _across_blocks(grid, data, ny, nz, (p, q, r), u, v, w)
            across, along = SIDE * SIDE, SIDE
            at = int(begin) + p * across + q * along + r
    return _linear(grid, at, across, along, u, v, w)


@kernel
def _across_blocks(
    grid: Singles,
    data: Floats,
    ny: int,
    nz: int,
    at: tuple[int, int, int],
    u: float,
    v: float,
    w: float,
) -> float:
    """Return the linear interpolation between points of more than one block."""
    i, j, k = at
    value = 0.0
    for n in range(8):
        p, q, r = n // 4, n // 2 % 2, n % 2
        share = (u if p else 1.0 - u) * (v if q else 1.0 - v) * (w if r else 1.0 - w)
        if share > 0.0:
            value += share * _fine_point(grid, data, ny, nz, i + p, j + q, k + r)
    return value


@kernel
def _fine_point(grid: Singles, data: Floats, ny: int, nz: int, i: int, j: int, k: int) -> float:
    """Return the distance at a point of a block, or interpolated where its cell is no block."""
    p, q, r = i // SIDE, j // SIDE, k // SIDE
    begin = data[int(data[BLOCKS]) + (p * (ny - 1) + q) * (nz - 1) + r]
    i, j, k = i - SIDE * p, j - SIDE * q, k - SIDE * r
    if begin > 0.0:
        return float(grid[int(begin) + (i * SIDE + j) * SIDE + k])
    at = (p * ny + q) * nz + r
    return _linear(grid, at, ny * nz, nz, i / SIDE, j / SIDE, k / SIDE)


@kernel
def _linear(grid: Singles, at: int, across: int, along: int, u: float, v: float, w: float) -> float:
    a = (1.0 - w) * grid[at] + w * grid[at + 1]
    b = (1.0 - w) * grid[at + along] + w * grid[at + along + 1]
    at += across
    c = (1.0 - w) * grid[at] + w * grid[at + 1]
    d = (1.0 - w) * grid[at + along] + w * grid[at + along + 1]
    return float((1.0 - u) * ((1.0 - v) * a + v * b) + u * ((1.0 - v) * c + v * d))


@kernel
def _voxels(
    grid: Singles, data: Floats, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    # central differences over half a voxel, which have no jump at the faces of cells
    h = 0.5 * data[FINE]
    d = _voxel_distance(grid, data, x, y, z)
    gx = _voxel_distance(grid, data, x + h, y, z) - _voxel_distance(grid, data, x - h, y, z)
    gy = _voxel_distance(grid, data, x, y + h, z) - _voxel_distance(grid, data, x, y - h, z)
    gz = _voxel_distance(grid, data, x, y, z + h) - _voxel_distance(grid, data, x, y, z - h)
    length = math.sqrt(gx * gx + gy * gy + gz * gz)
    if length == 0.0:
        return d, 0.0, 0.0, 1.0
    return d, gx / length, gy / length, gz / length


@kernel
def sample_many(field: Field, points: Floats) -> Floats:
    """Return (n, 5) distance, gradient and nearest solid at points (n, 3)."""
    out = np.empty((len(points), 5))
    for p in range(len(points)):
        d, gx, gy, gz, which = sample(field, points[p, 0], points[p, 1], points[p, 2])
        out[p, 0], out[p, 1], out[p, 2], out[p, 3], out[p, 4] = d, gx, gy, gz, which
    return out


@interprets(sample_many)
def _sample_many_in_numpy(field: Field, points: Floats) -> Floats:
    """Vectorise `sample_many` over the points of a field without voxels, where there are many."""
    if point_batches.needs_loop(field.data, len(points)):
        sampled = interpreted(sample)
        return np.array([sampled(field, x, y, z) for x, y, z in points]).reshape(-1, 5)
    return point_batches.samples(field.data, field.offset, points)


@kernel
def lowest_along(
    field: Field, ax: float, ay: float, az: float, bx: float, by: float, bz: float, tolerance: float
) -> tuple[float, float]:
    """Return the minimum distance along a segment, to within `tolerance`, and its place, 0 to 1.

    The method is sphere tracing: if the distance at a point is d, no point within d is inside a
    solid, so the next sample is d + tolerance farther, and nothing in between is deeper than
    -tolerance. Samples are dense only near solids.
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
def are_clear(field: Field, a: Floats, b: Floats, tolerances: Floats, min_distance: float) -> bool:
    """Return whether no point of some segments has less than a distance.

    Parameters
    ----------
    a, b : ndarray, shape (n, 3)
        Ends of the segments.
    tolerances : ndarray, shape (n,)
        Tolerance of `lowest_along` for each segment.
    min_distance : float
        The distance, metres; negative inside solids.
    """
    for k in range(len(a)):
        low, _ = lowest_along(
            field, a[k, 0], a[k, 1], a[k, 2], b[k, 0], b[k, 1], b[k, 2], tolerances[k]
        )
        if low < min_distance:
            return False
    return True


def lowest_along_each(field: Field, a: Floats, b: Floats, tolerance: float) -> Floats:
    """Return the minimum distance along each of n segments, for kernels that run interpreted.

    The distances are those of `lowest_along` to the last bit.

    Parameters
    ----------
    field : Field
        Field of the distances.
    a, b : ndarray, shape (n, 3)
        Ends of the segments.
    tolerance : float
        Tolerance of `lowest_along`.
    """
    if not point_batches.needs_loop(field.data, len(a)):
        return point_batches.lowest_along(field.data, field.offset, a, b, tolerance)
    lowest = interpreted(lowest_along)
    return np.array([lowest(field, *a[k], *b[k], tolerance)[0] for k in range(len(a))], dtype=float)

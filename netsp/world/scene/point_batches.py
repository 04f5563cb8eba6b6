"""Distance field at many points, vectorised in NumPy for kernels that run interpreted.

The results are those of `netsp.world.scene.sampling` and `netsp.world.scene.solids` to the last
bit. For that, operations have the same order, and comparisons replace NumPy's minimum and maximum,
which treat signed zeros differently. Sines and cosines come from `math`, which calls the C library
as compiled code does; NumPy's own differ.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.compile_policy import current_policy
from netsp.base.compiled.interpretation import interprets
from netsp.base.geometry.kernels import TWO_PI
from netsp.world.scene.packing import CELLS, COUNT, NEAR, ROW, ROWS, VOXELS, candidates
from netsp.world.scene.solids import BOX, CAPSULE, CYLINDER, POST, PRISM, TORUS

Vectors = tuple[Floats, Floats, Floats]
"""Coordinates of points, one array for each axis."""

Samples = tuple[Floats, Floats, Floats, Floats]
"""Distances and the coordinates of their gradients."""

Row = list[Any]
"""Numbers of one solid, or arrays with the numbers of one solid for each point
(`netsp.world.scene.packing`)."""


def needs_loop(data: Floats, count: int) -> bool:
    """Return whether a loop over points is faster than NumPy, or needed because of voxels."""
    items = count * (2 + int(data[COUNT]))
    return data[VOXELS] > 0.0 or items < current_policy().min_numpy_items


def distances(data: Floats, offset: float, x: Floats, y: Floats, z: Floats) -> Floats:
    """Return the distances of points, minus an offset; the field has no voxels."""
    out = np.empty(len(x))
    chunk = current_policy().numpy_chunk_items
    for first in range(0, len(x), chunk):
        part = slice(first, first + chunk)
        out[part] = _nearest(data, (x[part], y[part], z[part]))[0] - offset
    return out


def samples(data: Floats, offset: float, points: Floats) -> Floats:
    """Return distances, gradients and nearest solids as `sampling.sample_many` does, without
    voxels."""
    out = np.empty((len(points), 5))
    chunk = current_policy().numpy_chunk_items
    for first in range(0, len(points), chunk):
        part = slice(first, first + chunk)
        x, y, z = (np.ascontiguousarray(points[part, axis]) for axis in range(3))
        p = (x, y, z)
        part_rows = np.empty((len(x), 5))
        part_rows[:] = 0.0, 0.0, 0.0, 1.0, -1.0
        part_rows[:, 0], rows = _nearest(data, p)
        found = np.flatnonzero(rows)
        for kind, which in _by_kind(data, rows[found]):
            n = found[which]
            part_rows[n, :4] = np.column_stack(_solids(data, kind, rows[n], _at(p, n)))
        part_rows[found, 4] = (rows[found] - ROWS) // ROW
        part_rows[:, 0] -= offset
        out[part] = part_rows
    return out


def lowest_along(data: Floats, offset: float, a: Floats, b: Floats, tolerance: float) -> Floats:
    """Return the minimum distance along each of n segments, as `sampling.lowest_along` does,
    without voxels."""
    begins = [np.ascontiguousarray(a[:, axis]) for axis in range(3)]
    sides = [b[:, axis] - a[:, axis] for axis in range(3)]
    lengths = np.sqrt(sides[0] * sides[0] + sides[1] * sides[1] + sides[2] * sides[2])
    out, along = np.full(len(a), np.inf), np.zeros(len(a))
    left = np.arange(len(a))
    while len(left):
        length, s = lengths[left], along[left]
        t = np.where(length == 0.0, 0.0, s / length)
        x, y, z = (p[left] + t * v[left] for p, v in zip(begins, sides, strict=True))
        d = distances(data, offset, x, y, z)
        best = out[left]
        out[left] = np.where(d < best, d, best)
        further = s + _larger(d, 0.0) + tolerance
        along[left] = np.where(further < length, further, length)
        left = left[~(s >= length)]
    return out


@interprets(candidates)
def _candidates_in_numpy(data: Floats) -> tuple[Ints, Ints]:
    """Vectorise `packing.candidates` over cells."""
    size, counts = data[NEAR + 3], [int(n) for n in data[NEAR + 4 : NEAR + 7]]
    along = [data[NEAR + axis] + (np.arange(counts[axis]) + 0.5) * size for axis in range(3)]
    x, y, z = (v.ravel() for v in np.meshgrid(*along, indexing="ij"))
    rows = range(ROWS, ROWS + ROW * int(data[COUNT]), ROW)
    reach = math.sqrt(3.0) * size * (1.0 + 1e-9)
    listed, items = [np.zeros(1, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    step = max(1, 16 * current_policy().numpy_chunk_items // max(1, len(rows)))
    for first in range(0, len(x), step):
        p = _at((x, y, z), np.arange(first, min(first + step, len(x))))
        found = np.array(
            [_solids(data, int(data[at]), at, p, has_gradient=False)[0] for at in rows]
        )
        found = found.reshape(len(rows), len(p[0])).T
        near = found <= (found.min(axis=1, initial=np.inf) + reach)[:, None]
        listed.append(near.sum(axis=1))
        items.append(ROWS + ROW * np.nonzero(near)[1])
    return np.cumsum(np.concatenate(listed)), np.concatenate(items)


def _nearest(data: Floats, p: Vectors) -> tuple[Floats, Ints]:
    """Return the distances of points, and the rows of the nearest solids, 0 where there is no
    solid."""
    if data[CELLS] <= 0.0:
        return _nearest_of_all(data, p)
    size, counts = data[NEAR + 3], data[NEAR + 4 : NEAR + 7]
    cells = [(v - data[NEAR + axis]) / size for axis, v in enumerate(p)]
    inside: Bools = np.ones(len(p[0]), dtype=bool)
    for axis in range(3):
        inside &= (cells[axis] >= 0.0) & (cells[axis] < counts[axis])
    out, rows = np.empty(len(p[0])), np.empty(len(p[0]), dtype=np.int64)
    if not inside.all():
        out[~inside], rows[~inside] = _nearest_of_all(data, _at(p, ~inside))
    u, v, w = (c[inside].astype(np.int64) for c in cells)
    cell = int(data[CELLS]) + (u * int(counts[1]) + v) * int(counts[2]) + w
    out[inside], rows[inside] = _nearest_of_listed(data, _at(p, inside), cell)
    return out, rows


def _nearest_of_all(data: Floats, p: Vectors) -> tuple[Floats, Ints]:
    out, rows = np.full(len(p[0]), np.inf), np.zeros(len(p[0]), dtype=np.int64)
    for at in range(ROWS, ROWS + ROW * int(data[COUNT]), ROW):
        d = _solids(data, int(data[at]), at, p, has_gradient=False)[0]
        closer = d < out
        out = np.where(closer, d, out)
        rows[closer] = at
    return out, rows


def _nearest_of_listed(data: Floats, p: Vectors, cell: Ints) -> tuple[Floats, Ints]:
    """Return the distances of points, and the rows of the nearest solids in the lists of their
    cells."""
    out, rows = np.full(len(cell), np.inf), np.zeros(len(cell), dtype=np.int64)
    begin = data[cell].astype(np.int64)
    listed = data[cell + 1].astype(np.int64) - begin
    # all pairs of a point and a solid in its list
    points = np.repeat(np.arange(len(cell)), listed)
    nth = np.arange(len(points)) - np.repeat(np.cumsum(listed) - listed, listed)
    solids = data[np.repeat(begin, listed) + nth].astype(np.int64)
    d = np.empty(len(points))
    for kind, which in _by_kind(data, solids):
        d[which] = _solids(data, kind, solids[which], _at(p, points[which]), has_gradient=False)[0]
    np.minimum.at(out, points, d)
    nearest = np.flatnonzero((d == out[points]) & (d < np.inf))
    nearest = nearest[::-1]  # among equally near solids, the first one in the list is written last
    out[points[nearest]], rows[points[nearest]] = d[nearest], solids[nearest]
    return out, rows


def _at(p: Vectors, which: Ints | Bools) -> Vectors:
    return p[0][which], p[1][which], p[2][which]


def _by_kind(data: Floats, rows: Ints) -> Iterator[tuple[int, Ints]]:
    """Yield each kind of solids, with the indices of the rows of this kind."""
    kinds = data[rows].astype(np.int64)
    for kind in np.flatnonzero(np.bincount(kinds)).tolist():
        yield kind, np.flatnonzero(kinds == kind)


def _solids(data: Floats, kind: int, at: Any, p: Vectors, has_gradient: bool = True) -> Samples:
    """Return distances and gradients as `solids.solid_distance` does.

    Without gradients the distances are those of `solids.capsule_gap`, `cylinder_gap` and `box_gap`.

    Parameters
    ----------
    kind : int
        Kind of all the solids.
    at : int or ndarray of int, shape (n,)
        Row of one solid for all points, or the row of one solid for each point.
    """
    if kind != PRISM:
        length, measure = _BY_KIND.get(kind, (6, _half_space))
        return measure([data[at + k] for k in range(1, length + 1)], p, has_gradient)
    if isinstance(at, int):
        return _prism(data, at, p)
    out = np.empty((4, len(at)))
    for one in np.unique(at).tolist():
        out[:, at == one] = _prism(data, one, _at(p, at == one))
    return out[0], out[1], out[2], out[3]


def _larger(a: Any, b: Any) -> Any:
    """Return the larger of two numbers, the first of equal ones, as Python does."""
    return np.where(b > a, b, a)


def _share(t: Any) -> Any:
    """Return numbers clipped to 0 … 1."""
    t = np.where(t > 0.0, t, 0.0)
    return np.where(t < 1.0, t, 1.0)


def _round(vx: Any, vy: Any, vz: Any, radius: Any) -> Samples:
    length = np.sqrt(vx * vx + vy * vy + vz * vz)
    zero = length == 0.0
    return (
        np.where(zero, -radius, length - radius),
        np.where(zero, 1.0, vx / length),
        np.where(zero, 0.0, vy / length),
        np.where(zero, 0.0, vz / length),
    )


def _capsule(row: Row, p: Vectors, has_gradient: bool) -> Samples:
    px, py, pz, qx, qy, qz, radius = row
    ax, ay, az = qx - px, qy - py, qz - pz
    vx, vy, vz = p[0] - px, p[1] - py, p[2] - pz
    aa = ax * ax + ay * ay + az * az
    t, is_long = _share((vx * ax + vy * ay + vz * az) / aa), aa > 0.0
    vx, vy, vz = (np.where(is_long, v - t * a, v) for v, a in ((vx, ax), (vy, ay), (vz, az)))
    if has_gradient:
        return _round(vx, vy, vz, radius)
    d = np.sqrt(vx * vx + vy * vy + vz * vz) - radius
    return d, d, d, d


def _cylinder(row: Row, p: Vectors, has_gradient: bool) -> Samples:
    px, py, pz, ux, uy, uz, radius, length = row
    vx, vy, vz = p[0] - px, p[1] - py, p[2] - pz
    t = vx * ux + vy * uy + vz * uz
    qx, qy, qz = vx - t * ux, vy - t * uy, vz - t * uz
    rho = np.sqrt(qx * qx + qy * qy + qz * qz)
    side, beyond = rho - radius, t > 0.5 * length
    end = np.where(beyond, t - length, -t)
    corner = (side > 0.0) & (end > 0.0)
    d = np.where(side > end, side, end) if has_gradient else _larger(side, end)
    if corner.any():
        d[corner] = np.hypot(side[corner], end[corner])
    if not has_gradient:
        return d, d, d, d
    is_steep = abs(ux) < 0.6
    nx, ny, nz = (np.where(is_steep, a, b) for a, b in ((0.0, -uz), (uz, 0.0), (-uy, ux)))
    norm = np.sqrt(nx * nx + ny * ny + nz * nz)
    off = rho > 0.0
    qx, qy, qz = (np.where(off, q / rho, n / norm) for q, n in ((qx, nx), (qy, ny), (qz, nz)))
    sign = np.where(beyond, 1.0, -1.0)
    a = np.where(corner, side / d, np.where(side > end, 1.0, 0.0))
    b = np.where(corner, sign * end / d, np.where(side > end, 0.0, sign))
    return d, a * qx + b * ux, a * qy + b * uy, a * qz + b * uz


def _box(row: Row, p: Vectors, has_gradient: bool) -> Samples:
    vx, vy, vz = (p[axis] - row[axis] for axis in range(3))
    best, squares = np.full(len(vx), -np.inf), np.zeros(len(vx))
    gradient: tuple[Floats, ...] = (np.zeros(len(vx)),) * 3
    inward = gradient
    for k in range(3):
        part_rows = row[6 + 3 * k : 9 + 3 * k]
        t = vx * part_rows[0] + vy * part_rows[1] + vz * part_rows[2]
        out = abs(t) - row[3 + k]
        is_out, is_best = out > 0.0, out > best
        best = np.where(is_best, out, best)
        squares = np.where(is_out, squares + out * out, squares)
        if has_gradient:
            sign = np.where(t >= 0.0, 1.0, -1.0)
            inward = tuple(
                np.where(is_best, sign * u, g) for g, u in zip(inward, part_rows, strict=True)
            )
            gradient = tuple(
                np.where(is_out, g + sign * out * u, g)
                for g, u in zip(gradient, part_rows, strict=True)
            )
    roots, is_outside = np.sqrt(squares), squares > 0.0
    d = np.where(is_outside, roots, best)
    gx, gy, gz = (np.where(is_outside, g / roots, i) for g, i in zip(gradient, inward, strict=True))
    return d, gx, gy, gz


def _torus(row: Row, p: Vectors, has_gradient: bool) -> Samples:
    px, py, pz, ax, ay, az, sx, sy, sz, bend, radius, max_angle = row
    vx, vy, vz = p[0] - px, p[1] - py, p[2] - pz
    h = vx * ax + vy * ay + vz * az
    qx, qy, qz = vx - h * ax, vy - h * ay, vz - h * az
    tx = ay * sz - az * sy
    ty = az * sx - ax * sz
    tz = ax * sy - ay * sx
    u, v = qx * sx + qy * sy + qz * sz, qx * tx + qy * ty + qz * tz
    angle = np.array(list(map(math.atan2, v.tolist(), u.tolist())), dtype=float)
    angle = np.where(angle < 0.0, angle + TWO_PI, angle)
    ends = np.where(angle - max_angle < TWO_PI - angle, max_angle, 0.0)
    angles = np.where(angle > max_angle, ends, angle).tolist()
    c = bend * np.array(list(map(math.cos, angles)), dtype=float)
    s = bend * np.array(list(map(math.sin, angles)), dtype=float)
    return _round(vx - c * sx - s * tx, vy - c * sy - s * ty, vz - c * sz - s * tz, radius)


def _post(row: Row, p: Vectors, has_gradient: bool) -> Samples:
    return _round(p[0] - row[0], p[1] - row[1], np.zeros(len(p[0])), row[2])


def _half_space(row: Row, p: Vectors, has_gradient: bool) -> Samples:
    px, py, pz, nx, ny, nz = row
    d = (p[0] - px) * nx + (p[1] - py) * ny + (p[2] - pz) * nz
    gx, gy, gz = (np.broadcast_to(n, d.shape) for n in (nx, ny, nz))
    return d, gx, gy, gz


def _prism(data: Floats, at: int, p: Vectors) -> Samples:
    start, stop, grow = int(data[at + 1]), int(data[at + 2]), data[at + 3]
    x, y, corners = p[0], p[1], data[start:stop].tolist()
    best, inside = np.full(len(x), np.inf), np.zeros(len(x), dtype=bool)
    vx, vy, nx, ny = (np.full(len(x), v) for v in (0.0, 0.0, 1.0, 0.0))
    for k in range(0, len(corners), 2):
        ax, ay = corners[k - 2], corners[k - 1]
        bx, by = corners[k], corners[k + 1]
        ex, ey = bx - ax, by - ay
        t = _share(((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey))
        qx, qy = x - ax - t * ex, y - ay - t * ey
        q = qx * qx + qy * qy
        closer = q < best
        if closer.any():
            length = np.hypot(ex, ey)
            best = np.where(closer, q, best)
            vx, vy = np.where(closer, qx, vx), np.where(closer, qy, vy)
            nx, ny = np.where(closer, ey / length, nx), np.where(closer, -ex / length, ny)
        spans = (ay > y) != (by > y)
        if spans.any():
            inside ^= spans & (x < ax + (y - ay) / (by - ay) * ex)
    d = np.sqrt(best)
    sign = np.where(inside, -1.0, 1.0)
    is_off = d > 1e-12
    nx, ny = np.where(is_off, sign * vx / d, nx), np.where(is_off, sign * vy / d, ny)
    return sign * d - grow, nx, ny, np.zeros(len(x))


_BY_KIND: dict[int, tuple[int, Callable[[Row, Vectors, bool], Samples]]] = {
    CAPSULE: (7, _capsule),
    CYLINDER: (8, _cylinder),
    BOX: (15, _box),
    TORUS: (12, _torus),
    POST: (3, _post),
}
"""Number of values in the row of a solid, and the function that measures it, by kind of solid."""

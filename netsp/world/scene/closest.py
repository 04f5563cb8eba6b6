"""Closest sites of all points of a grid, and winding numbers of meshes around them. Compiled."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Singles
from netsp.base.compiled.kernel import kernel
from netsp.base.time_flags import Flag
from netsp.world.scene.sites import extent, site_distance

Owners = npt.NDArray[np.int32]


@kernel
def nearest_sites(
    sites: Floats, origin: Floats, size: float, distances: Singles, owner: Owners, stop: Flag
) -> None:
    """Measure each site from the grid points around it, until `stop` is set."""
    nx, ny, nz = distances.shape
    low, high = np.zeros(3, dtype=np.int64), np.zeros(3, dtype=np.int64)
    shape = (nx, ny, nz)
    for s in range(len(sites)):
        for a in range(3):
            lowest, highest = extent(sites, s, a)
            low[a] = max(0, math.floor((lowest - origin[a]) / size) - 2)
            high[a] = min(shape[a] - 1, math.ceil((highest - origin[a]) / size) + 2)
        for i in range(low[0], high[0] + 1):
            if stop[0] != 0:
                return
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    x, y, z = origin[0] + size * i, origin[1] + size * j, origin[2] + size * k
                    d = site_distance(sites, s, x, y, z)
                    if d < distances[i, j, k]:
                        distances[i, j, k] = d
                        owner[i, j, k] = s


@kernel
def sweep(
    sites: Floats,
    origin: Floats,
    size: float,
    distances: Singles,
    owner: Owners,
    turn: int,
    stop: Flag,
) -> None:
    """Sweep the grid in one of the eight diagonal directions, until `stop` is set.

    Each grid point measures the nearest sites of the three neighbours that come before it.
    """
    nx, ny, nz = distances.shape
    di = 1 if turn % 2 == 0 else -1
    dj = 1 if turn // 2 % 2 == 0 else -1
    dk = 1 if turn // 4 % 2 == 0 else -1
    for a in range(nx):
        if stop[0] != 0:
            return
        i = a if di > 0 else nx - 1 - a
        for b in range(ny):
            j = b if dj > 0 else ny - 1 - b
            for c in range(nz):
                k = c if dk > 0 else nz - 1 - c
                best, mine = distances[i, j, k], owner[i, j, k]
                tried = mine
                x, y, z = origin[0] + size * i, origin[1] + size * j, origin[2] + size * k
                for n in range(3):
                    u = i - di if n == 0 else i
                    v = j - dj if n == 1 else j
                    w = k - dk if n == 2 else k
                    if u < 0 or u >= nx or v < 0 or v >= ny or w < 0 or w >= nz:
                        continue
                    s = owner[u, v, w]
                    if s < 0 or s in (mine, tried):
                        continue
                    # the site is no nearer than the neighbour's distance minus a step
                    if distances[u, v, w] - size >= best:
                        continue
                    tried = s
                    d = site_distance(sites, s, x, y, z)
                    if d < best:
                        best, mine = d, s
                distances[i, j, k], owner[i, j, k] = best, mine


@kernel
def windings(
    triangles: Floats, origin: Floats, size: float, counts: tuple[int, int, int]
) -> npt.NDArray[np.int16]:
    """Return how often a mesh winds around each grid point (nx, ny, nz).

    That is the sum of the signed crossings of the ray from the point in the direction -x.
    """
    nx, ny, nz = counts
    out = np.zeros((nx, ny, nz), dtype=np.int16)
    for s in range(len(triangles)):
        y, z = triangles[s, :, 1], triangles[s, :, 2]
        j0 = max(0, math.ceil((y.min() - origin[1]) / size))
        j1 = min(ny - 1, math.floor((y.max() - origin[1]) / size))
        k0 = max(0, math.ceil((z.min() - origin[2]) / size))
        k1 = min(nz - 1, math.floor((z.max() - origin[2]) / size))
        for j in range(j0, j1 + 1):
            for k in range(k0, k1 + 1):
                x, sign = yz_crossing(triangles, s, origin[1] + size * j, origin[2] + size * k)
                i = math.ceil((x - origin[0]) / size)
                if sign != 0 and i < nx:
                    out[max(i, 0), j, k] += sign
    for i in range(1, nx):
        for j in range(ny):
            for k in range(nz):
                out[i, j, k] += out[i - 1, j, k]
    return out


@kernel
def yz_crossing(t: Floats, s: int, y: float, z: float) -> tuple[float, int]:
    """Return where the line along x through (y, z) crosses triangle t[s], and the change of
    winding.

    The change is 1 or -1 behind the crossing; 0 without a crossing.
    """
    ay, az, by, bz, cy, cz = t[s, 0, 1], t[s, 0, 2], t[s, 1, 1], t[s, 1, 2], t[s, 2, 1], t[s, 2, 2]
    area = (by - ay) * (cz - az) - (bz - az) * (cy - ay)
    if area == 0.0:
        return 0.0, 0
    a = _side(by, bz, cy, cz, y, z)
    b = _side(cy, cz, ay, az, y, z)
    c = _side(ay, az, by, bz, y, z)
    # strictly on one side of all edges: the grid is placed so that none is met exactly
    if (a > 0.0 and b > 0.0 and c > 0.0) or (a < 0.0 and b < 0.0 and c < 0.0):
        # the normal's x has the sign of the area: entering where it is negative
        return (a * t[s, 0, 0] + b * t[s, 1, 0] + c * t[s, 2, 0]) / (
            a + b + c
        ), -1 if area > 0.0 else 1
    return 0.0, 0


@kernel
def _side(ay: float, az: float, by: float, bz: float, y: float, z: float) -> float:
    """Return twice the signed area of a, b and a point, the same for both triangles at an edge."""
    if (ay, az) < (by, bz):
        return (by - ay) * (z - az) - (bz - az) * (y - ay)
    return -((ay - by) * (z - bz) - (az - bz) * (y - by))

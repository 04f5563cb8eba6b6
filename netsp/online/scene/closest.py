"""Closest sites of all points of a grid, and how often a mesh winds around them. Compiled.

A site is a row of 10 numbers: a triangle's corners, or a point and six unused, and last a weight
that is subtracted from the distance.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from netsp.arrays import Floats
from netsp.compiled.kernel import kernel

Singles = npt.NDArray[np.float32]
Owners = npt.NDArray[np.int32]


@kernel
def triangle_distance(t: Floats, x: float, y: float, z: float) -> float:
    """Distance of a point to the triangle t[0:9].

    The closest point is the foot of the perpendicular where that lies inside, else it is on an
    edge (Ericson, Real-Time Collision Detection, 5.1.5, tells the regions by the same products).
    """
    abx, aby, abz = t[3] - t[0], t[4] - t[1], t[5] - t[2]
    acx, acy, acz = t[6] - t[0], t[7] - t[1], t[8] - t[2]
    apx, apy, apz = x - t[0], y - t[1], z - t[2]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    aa = abx * abx + aby * aby + abz * abz
    bb = abx * acx + aby * acy + abz * acz
    cc = acx * acx + acy * acy + acz * acz
    det = aa * cc - bb * bb
    v, w = cc * d1 - bb * d2, aa * d2 - bb * d1
    if det > 1e-14 * aa * cc and v >= 0.0 and w >= 0.0 and v + w <= det:
        v, w = v / det, w / det
        qx = apx - v * abx - w * acx
        qy = apy - v * aby - w * acy
        qz = apz - v * abz - w * acz
        return math.sqrt(qx * qx + qy * qy + qz * qz)
    best = math.inf
    for k in range(3):
        i, j = 3 * k, 3 * ((k + 1) % 3)
        ex, ey, ez = t[j] - t[i], t[j + 1] - t[i + 1], t[j + 2] - t[i + 2]
        px, py, pz = x - t[i], y - t[i + 1], z - t[i + 2]
        ee = ex * ex + ey * ey + ez * ez
        s = 0.0
        if ee > 0.0:
            s = min(1.0, max(0.0, (px * ex + py * ey + pz * ez) / ee))
        qx, qy, qz = px - s * ex, py - s * ey, pz - s * ez
        best = min(best, qx * qx + qy * qy + qz * qz)
    return math.sqrt(best)


@kernel
def _site_distance(site: Floats, points: bool, x: float, y: float, z: float) -> float:
    if points:
        d = math.sqrt((x - site[0]) ** 2 + (y - site[1]) ** 2 + (z - site[2]) ** 2)
    else:
        d = triangle_distance(site, x, y, z)
    return float(d - site[9])


@kernel
def nearest_sites(
    sites: Floats, points: bool, origin: Floats, size: float, distances: Singles, owner: Owners
) -> None:
    """Measure each site from the grid points around it."""
    nx, ny, nz = distances.shape
    corners = 1 if points else 3
    low, high = np.zeros(3, dtype=np.int64), np.zeros(3, dtype=np.int64)
    shape = (nx, ny, nz)
    for s in range(len(sites)):
        for a in range(3):
            least, most = math.inf, -math.inf
            for c in range(corners):
                least = min(least, sites[s, 3 * c + a])
                most = max(most, sites[s, 3 * c + a])
            low[a] = max(0, math.floor((least - origin[a]) / size) - 2)
            high[a] = min(shape[a] - 1, math.ceil((most - origin[a]) / size) + 2)
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    d = _site_distance(
                        sites[s], points,
                        origin[0] + size * i, origin[1] + size * j, origin[2] + size * k,
                    )  # fmt: skip
                    if d < distances[i, j, k]:
                        distances[i, j, k] = d
                        owner[i, j, k] = s


@kernel
def sweep(
    sites: Floats,
    points: bool,
    origin: Floats,
    size: float,
    distances: Singles,
    owner: Owners,
    turn: int,
) -> None:
    """Pass through the grid in one of the eight diagonal directions; each grid point measures the
    nearest sites of the three neighbours that were passed before it."""
    nx, ny, nz = distances.shape
    di = 1 if turn % 2 == 0 else -1
    dj = 1 if turn // 2 % 2 == 0 else -1
    dk = 1 if turn // 4 % 2 == 0 else -1
    for a in range(nx):
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
                    # no nearer than the neighbour's distance less a step
                    if distances[u, v, w] - size >= best:
                        continue
                    tried = s
                    d = _site_distance(sites[s], points, x, y, z)
                    if d < best:
                        best, mine = d, s
                distances[i, j, k], owner[i, j, k] = best, mine


@kernel
def windings(
    triangles: Floats, origin: Floats, size: float, counts: tuple[int, int, int]
) -> npt.NDArray[np.int16]:
    """(nx, ny, nz) how often the mesh winds around each grid point: the signed crossings of the ray
    from it in the direction -x."""
    nx, ny, nz = counts
    out = np.zeros((nx, ny, nz), dtype=np.int16)
    for s in range(len(triangles)):
        t = triangles[s]
        ay, az, by, bz, cy, cz = t[0, 1], t[0, 2], t[1, 1], t[1, 2], t[2, 1], t[2, 2]
        area = (by - ay) * (cz - az) - (bz - az) * (cy - ay)
        if area == 0.0:
            continue
        j0 = max(0, math.ceil((min(ay, by, cy) - origin[1]) / size))
        j1 = min(ny - 1, math.floor((max(ay, by, cy) - origin[1]) / size))
        k0 = max(0, math.ceil((min(az, bz, cz) - origin[2]) / size))
        k1 = min(nz - 1, math.floor((max(az, bz, cz) - origin[2]) / size))
        for j in range(j0, j1 + 1):
            y = origin[1] + size * j
            for k in range(k0, k1 + 1):
                z = origin[2] + size * k
                a = _side(by, bz, cy, cz, y, z)
                b = _side(cy, cz, ay, az, y, z)
                c = _side(ay, az, by, bz, y, z)
                # strictly on one side of all edges: the grid is placed so that none is met exactly
                if (a > 0.0 and b > 0.0 and c > 0.0) or (a < 0.0 and b < 0.0 and c < 0.0):
                    x = (a * t[0, 0] + b * t[1, 0] + c * t[2, 0]) / (a + b + c)
                    i = math.ceil((x - origin[0]) / size)
                    if i < nx:
                        # the normal's x has the sign of the area: entering where it is negative
                        out[max(i, 0), j, k] += -1 if area > 0.0 else 1
    for i in range(1, nx):
        for j in range(ny):
            for k in range(nz):
                out[i, j, k] += out[i - 1, j, k]
    return out


@kernel
def _side(ay: float, az: float, by: float, bz: float, y: float, z: float) -> float:
    """Twice the signed area of a, b and the point, computed alike for both triangles at an edge."""
    if (ay, az) < (by, bz):
        return (by - ay) * (z - az) - (bz - az) * (y - ay)
    return -((ay - by) * (z - bz) - (az - bz) * (y - by))

"""Signed distance and its gradient, exact for each kind of solid. Compiled, no policy.

A solid is a kind and a row of 16 numbers (`netsp.online.primitives` writes them). Distances are to
the surface, negative inside; gradients are unit vectors away from the solid. Formulas: the closest
point of each solid, by hand.
"""

from __future__ import annotations

import math

from netsp.arrays import Floats
from netsp.compiled.kernel import kernel
from netsp.geometry.kernels import TWO_PI

CAPSULE, CYLINDER, BOX, TORUS, POST, PRISM, HALF_SPACE = range(7)

ROW = 16
"""Numbers per solid."""


@kernel
def solid_distance(
    kind: int, row: Floats, outline: Floats, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """(d, gx, gy, gz) of one solid at a point.

    Parameters
    ----------
    outline
        (m, 2) vertices of all prisms.
    """
    if kind == CAPSULE:
        return _capsule(row, x, y, z)
    if kind == CYLINDER:
        return _cylinder(row, x, y, z)
    if kind == BOX:
        return _box(row, x, y, z)
    if kind == TORUS:
        return _torus(row, x, y, z)
    if kind == POST:
        return _round(x - row[0], y - row[1], 0.0, row[2])
    if kind == PRISM:
        return _prism(row, outline, x, y)
    d = (x - row[0]) * row[3] + (y - row[1]) * row[4] + (z - row[2]) * row[5]
    return d, row[3], row[4], row[5]


@kernel
def _round(vx: float, vy: float, vz: float, radius: float) -> tuple[float, float, float, float]:
    """From the vector out of the closest point of the core."""
    length = math.sqrt(vx * vx + vy * vy + vz * vz)
    if length == 0.0:
        return -radius, 1.0, 0.0, 0.0
    return length - radius, vx / length, vy / length, vz / length


@kernel
def _capsule(row: Floats, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """All points within row[6] of the segment from row[0:3] to row[3:6]."""
    ax, ay, az = row[3] - row[0], row[4] - row[1], row[5] - row[2]
    vx, vy, vz = x - row[0], y - row[1], z - row[2]
    aa = ax * ax + ay * ay + az * az
    if aa > 0.0:
        t = min(1.0, max(0.0, (vx * ax + vy * ay + vz * az) / aa))
        vx, vy, vz = vx - t * ax, vy - t * ay, vz - t * az
    return _round(vx, vy, vz, row[6])


@kernel
def _cylinder(row: Floats, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """A solid cylinder with flat ends: axis from row[0:3] along the unit vector row[3:6] for
    row[7], radius row[6]."""
    vx, vy, vz = x - row[0], y - row[1], z - row[2]
    t = vx * row[3] + vy * row[4] + vz * row[5]
    qx, qy, qz = vx - t * row[3], vy - t * row[4], vz - t * row[5]
    rho = math.sqrt(qx * qx + qy * qy + qz * qz)
    if rho > 0.0:
        qx, qy, qz = qx / rho, qy / rho, qz / rho
    else:
        # on the axis every radial direction is as good: one perpendicular to the axis
        if abs(row[3]) < 0.6:
            qx, qy, qz = 0.0, row[5], -row[4]
        else:
            qx, qy, qz = -row[5], 0.0, row[3]
        length = math.sqrt(qx * qx + qy * qy + qz * qz)
        qx, qy, qz = qx / length, qy / length, qz / length
    side = rho - row[6]
    end, sign = (t - row[7], 1.0) if t > 0.5 * row[7] else (-t, -1.0)
    if side > 0.0 and end > 0.0:
        d = math.hypot(side, end)
        a, b = side / d, sign * end / d
    elif side > end:
        d, a, b = side, 1.0, 0.0
    else:
        d, a, b = end, 0.0, sign
    return d, a * qx + b * row[3], a * qy + b * row[4], a * qz + b * row[5]


@kernel
def _box(row: Floats, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Centre row[0:3], half sizes row[3:6], the three axes row[6:15]."""
    vx, vy, vz = x - row[0], y - row[1], z - row[2]
    best, axis, sign, squares = -math.inf, 0, 1.0, 0.0
    gx, gy, gz = 0.0, 0.0, 0.0
    for k in range(3):
        ux, uy, uz = row[6 + 3 * k], row[7 + 3 * k], row[8 + 3 * k]
        t = vx * ux + vy * uy + vz * uz
        s = 1.0 if t >= 0.0 else -1.0
        out = abs(t) - row[3 + k]
        if out > best:
            best, axis, sign = out, k, s
        if out > 0.0:
            squares += out * out
            gx, gy, gz = gx + s * out * ux, gy + s * out * uy, gz + s * out * uz
    if squares > 0.0:
        d = math.sqrt(squares)
        return d, gx / d, gy / d, gz / d
    k = 6 + 3 * axis
    return best, sign * row[k], sign * row[k + 1], sign * row[k + 2]


@kernel
def _torus(row: Floats, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """All points within row[10] of an arc: centre row[0:3], axis row[3:6], first point in the
    direction row[6:9] at distance row[9], turning by row[11] about the axis (2 pi: closed)."""
    vx, vy, vz = x - row[0], y - row[1], z - row[2]
    h = vx * row[3] + vy * row[4] + vz * row[5]
    px, py, pz = vx - h * row[3], vy - h * row[4], vz - h * row[5]
    sx, sy, sz = row[6], row[7], row[8]
    # the third axis: axis x start
    tx = row[4] * sz - row[5] * sy
    ty = row[5] * sx - row[3] * sz
    tz = row[3] * sy - row[4] * sx
    u, v = px * sx + py * sy + pz * sz, px * tx + py * ty + pz * tz
    angle = math.atan2(v, u)
    if angle < 0.0:
        angle += TWO_PI
    if angle > row[11]:
        # beyond the ends: the nearer one
        angle = row[11] if angle - row[11] < TWO_PI - angle else 0.0
    c, s = row[9] * math.cos(angle), row[9] * math.sin(angle)
    return _round(
        vx - c * sx - s * tx, vy - c * sy - s * ty, vz - c * sz - s * tz, row[10]
    )  # fmt: skip


@kernel
def _prism(row: Floats, outline: Floats, x: float, y: float) -> tuple[float, float, float, float]:
    """A vertical prism without ends over the polygon outline[row[0]:row[1]], grown by row[2]."""
    start, stop = int(row[0]), int(row[1])
    best, inside = math.inf, False
    vx, vy, nx, ny = 0.0, 0.0, 1.0, 0.0
    j = stop - 1
    for i in range(start, stop):
        ax, ay, bx, by = outline[j, 0], outline[j, 1], outline[i, 0], outline[i, 1]
        ex, ey = bx - ax, by - ay
        t = min(1.0, max(0.0, ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey)))
        qx, qy = x - ax - t * ex, y - ay - t * ey
        q = qx * qx + qy * qy
        if q < best:
            best, vx, vy = q, qx, qy
            length = math.hypot(ex, ey)
            nx, ny = ey / length, -ex / length
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * ex:
            inside = not inside
        j = i
    d = math.sqrt(best)
    sign = -1.0 if inside else 1.0
    if d > 1e-12:
        nx, ny = sign * vx / d, sign * vy / d
    return sign * d - row[2], nx, ny, 0.0

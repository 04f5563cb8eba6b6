"""Signed distance and gradient of each kind of solid, exact. Compiled.

A solid is a kind and a row of up to 16 numbers (`netsp.world.scene.shapes` lists them), here from
place r on in the vector of a field (`netsp.world.scene.packing`). Distances are to the surface,
negative inside; gradients are unit vectors away from the solid. All formulas find the closest point
of the solid.
"""

from __future__ import annotations

import math

from netsp.base.arrays import Floats
from netsp.base.compiled.kernel import kernel
from netsp.base.geometry.kernels import TWO_PI

CAPSULE, CYLINDER, BOX, TORUS, POST, PRISM, HALF_SPACE = range(7)


@kernel
def solid_distance(
    data: Floats, at: int, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Return distance and gradient at a point of the solid whose kind is data[at], before its
    row."""
    kind, r = int(data[at]), at + 1
    if kind == CAPSULE:
        return capsule(data, r, x, y, z)
    if kind == CYLINDER:
        return _cylinder(data, r, x, y, z)
    if kind == BOX:
        return _box(data, r, x, y, z)
    if kind == TORUS:
        return _torus(data, r, x, y, z)
    if kind == POST:
        return _round(x - data[r], y - data[r + 1], 0.0, data[r + 2])
    if kind == PRISM:
        return _prism(data, r, x, y)
    px, py, pz = _three(data, r)
    nx, ny, nz = _three(data, r + 3)
    return (x - px) * nx + (y - py) * ny + (z - pz) * nz, nx, ny, nz


@kernel
def capsule_gap(data: Floats, r: int, x: float, y: float, z: float) -> float:
    """Return the distance of `capsule` without its gradient."""
    px, py, pz = _three(data, r)
    qx, qy, qz = _three(data, r + 3)
    ax, ay, az = qx - px, qy - py, qz - pz
    vx, vy, vz = x - px, y - py, z - pz
    aa = ax * ax + ay * ay + az * az
    if aa > 0.0:
        t = min(1.0, max(0.0, (vx * ax + vy * ay + vz * az) / aa))
        vx, vy, vz = vx - t * ax, vy - t * ay, vz - t * az
    length = math.sqrt(vx * vx + vy * vy + vz * vz)
    return float(length - data[r + 6])


@kernel
def cylinder_gap(data: Floats, r: int, x: float, y: float, z: float) -> float:
    """Return the distance of `_cylinder` without its gradient."""
    px, py, pz = _three(data, r)
    ux, uy, uz = _three(data, r + 3)
    vx, vy, vz = x - px, y - py, z - pz
    t = vx * ux + vy * uy + vz * uz
    qx, qy, qz = vx - t * ux, vy - t * uy, vz - t * uz
    side = math.sqrt(qx * qx + qy * qy + qz * qz) - data[r + 6]
    end = t - data[r + 7] if t > 0.5 * data[r + 7] else -t
    if side > 0.0 and end > 0.0:
        return math.hypot(side, end)
    return float(max(side, end))


@kernel
def box_gap(data: Floats, r: int, x: float, y: float, z: float) -> float:
    """Return the distance of `_box` without its gradient."""
    px, py, pz = _three(data, r)
    vx, vy, vz = x - px, y - py, z - pz
    best, squares = -math.inf, 0.0
    for k in range(3):
        ux, uy, uz = _three(data, r + 6 + 3 * k)
        out = abs(vx * ux + vy * uy + vz * uz) - data[r + 3 + k]
        best = max(best, out)
        if out > 0.0:
            squares += out * out
    return math.sqrt(squares) if squares > 0.0 else best


@kernel
def _three(data: Floats, at: int) -> tuple[float, float, float]:
    """Return a point or vector of a row."""
    return data[at], data[at + 1], data[at + 2]


@kernel
def _round(vx: float, vy: float, vz: float, radius: float) -> tuple[float, float, float, float]:
    """Return distance and gradient for the vector v from the closest point of an axis or arc."""
    length = math.sqrt(vx * vx + vy * vy + vz * vz)
    if length == 0.0:
        return -radius, 1.0, 0.0, 0.0
    return length - radius, vx / length, vy / length, vz / length


@kernel
def capsule(
    data: Floats, r: int, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Measure a capsule: ends of its axis (3, 3), radius."""
    px, py, pz = _three(data, r)
    qx, qy, qz = _three(data, r + 3)
    ax, ay, az = qx - px, qy - py, qz - pz
    vx, vy, vz = x - px, y - py, z - pz
    aa = ax * ax + ay * ay + az * az
    if aa > 0.0:
        t = min(1.0, max(0.0, (vx * ax + vy * ay + vz * az) / aa))
        vx, vy, vz = vx - t * ax, vy - t * ay, vz - t * az
    return _round(vx, vy, vz, data[r + 6])


@kernel
def _cylinder(
    data: Floats, r: int, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Measure a solid cylinder with flat ends: start (3) and unit vector (3) of its axis, radius,
    length."""
    px, py, pz = _three(data, r)
    ux, uy, uz = _three(data, r + 3)
    radius, length = data[r + 6], data[r + 7]
    vx, vy, vz = x - px, y - py, z - pz
    t = vx * ux + vy * uy + vz * uz
    qx, qy, qz = vx - t * ux, vy - t * uy, vz - t * uz
    rho = math.sqrt(qx * qx + qy * qy + qz * qz)
    if rho > 0.0:
        qx, qy, qz = qx / rho, qy / rho, qz / rho
    else:
        # on the axis, any direction perpendicular to it will do
        if abs(ux) < 0.6:
            qx, qy, qz = 0.0, uz, -uy
        else:
            qx, qy, qz = -uz, 0.0, ux
        norm = math.sqrt(qx * qx + qy * qy + qz * qz)
        qx, qy, qz = qx / norm, qy / norm, qz / norm
    side = rho - radius
    end, sign = (t - length, 1.0) if t > 0.5 * length else (-t, -1.0)
    if side > 0.0 and end > 0.0:
        d = math.hypot(side, end)
        a, b = side / d, sign * end / d
    elif side > end:
        d, a, b = side, 1.0, 0.0
    else:
        d, a, b = end, 0.0, sign
    return d, a * qx + b * ux, a * qy + b * uy, a * qz + b * uz


@kernel
def _box(data: Floats, r: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Measure a box: centre (3), half sizes (3), axes (9)."""
    px, py, pz = _three(data, r)
    vx, vy, vz = x - px, y - py, z - pz
    best, axis, sign, squares = -math.inf, 0, 1.0, 0.0
    gx, gy, gz = 0.0, 0.0, 0.0
    for k in range(3):
        ux, uy, uz = _three(data, r + 6 + 3 * k)
        t = vx * ux + vy * uy + vz * uz
        s = 1.0 if t >= 0.0 else -1.0
        out = abs(t) - data[r + 3 + k]
        if out > best:
            best, axis, sign = out, k, s
        if out > 0.0:
            squares += out * out
            gx, gy, gz = gx + s * out * ux, gy + s * out * uy, gz + s * out * uz
    if squares > 0.0:
        d = math.sqrt(squares)
        return d, gx / d, gy / d, gz / d
    ux, uy, uz = _three(data, r + 6 + 3 * axis)
    return best, sign * ux, sign * uy, sign * uz


@kernel
def _torus(data: Floats, r: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Measure a torus, or the part of one about an arc.

    The row holds its centre (3), axis (3), direction of its first point (3), radius of the arc,
    radius about the arc, and the angle of the arc, 2 pi if it is closed.
    """
    px, py, pz = _three(data, r)
    ax, ay, az = _three(data, r + 3)
    sx, sy, sz = _three(data, r + 6)
    bend, radius, max_angle = data[r + 9], data[r + 10], data[r + 11]
    vx, vy, vz = x - px, y - py, z - pz
    h = vx * ax + vy * ay + vz * az
    px, py, pz = vx - h * ax, vy - h * ay, vz - h * az
    # the third axis: axis x start
    tx = ay * sz - az * sy
    ty = az * sx - ax * sz
    tz = ax * sy - ay * sx
    u, v = px * sx + py * sy + pz * sz, px * tx + py * ty + pz * tz
    angle = math.atan2(v, u)
    if angle < 0.0:
        angle += TWO_PI
    if angle > max_angle:
        # beyond the ends, the nearer end counts
        angle = max_angle if angle - max_angle < TWO_PI - angle else 0.0
    c, s = bend * math.cos(angle), bend * math.sin(angle)
    return _round(vx - c * sx - s * tx, vy - c * sy - s * ty, vz - c * sz - s * tz, radius)


@kernel
def _prism(data: Floats, r: int, x: float, y: float) -> tuple[float, float, float, float]:
    """Measure a vertical prism without ends: range of its corners (x, y) in the vector, and
    growth."""
    start, stop, grow = int(data[r]), int(data[r + 1]), data[r + 2]
    best, inside = math.inf, False
    vx, vy, nx, ny = 0.0, 0.0, 1.0, 0.0
    j = stop - 2
    for i in range(start, stop, 2):
        ax, ay, bx, by = data[j], data[j + 1], data[i], data[i + 1]
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
    return sign * d - grow, nx, ny, 0.0

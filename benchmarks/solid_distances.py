"""Distances from the solids of a scene file, written anew from their definitions.

`netsp.world.scene` has its own. Nothing here uses it, so that an error in one of the two shows as a
difference between them. Only meshes and clouds, which are voxels by definition, are measured by the
field of netsp (`Water.by_field`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.world.scene.sampling import Field
from netsp.world.scene.sampling import distance as field_distance
from netsp.world.scene.scene import Scene

CAPSULE, CYLINDER, BOX, TORUS, POST, PRISM, HALF_SPACE = range(7)
"""Kinds of rows."""


class Water(NamedTuple):
    """Solids of a scene as arrays for kernels.

    Attributes
    ----------
    kinds
        (n,) kind of each solid.
    rows
        (n, 16) numbers of each solid.
    corners
        (m, 2) corners of all prisms.
    offset
        Length by which all solids are grown, metres.
    by_field
        Whether `field` is used instead of the solids.
    field
        Field of netsp.
    """

    kinds: Ints
    rows: Floats
    corners: Floats
    offset: float
    by_field: bool
    field: Field


def water_of(scene: Scene) -> Water:
    """Return the solids of a scene; its field where there is a mesh or a cloud."""
    kinds, rows, corners = [], [], []
    for solid in scene.model_dump(exclude_none=True)["solids"]:
        for name in sorted(set(solid) - {"name"}):
            kind, numbers = _row(name, solid[name], len(corners))
            if kind == PRISM:
                corners += [tuple(p) for p in solid[name]["polygon"]]
            kinds.append(kind)
            rows.append([*numbers, *[0.0] * (16 - len(numbers))])
    return Water(
        np.array(kinds, dtype=np.int64),
        np.array(rows, dtype=float).reshape(-1, 16),
        np.array(corners, dtype=float).reshape(-1, 2),
        float(scene.tether_radius),
        scene.mesh is not None or scene.cloud is not None,
        scene.field().arrays,
    )


def _row(name: str, s: dict[str, Any], first: int) -> tuple[int, list[float]]:
    """Return the kind and the numbers of a solid."""
    if name == "sphere":
        return CAPSULE, [*s["center"], *s["center"], s["radius"]]
    if name == "capsule":
        return CAPSULE, [*s["a"], *s["b"], s["radius"]]
    if name == "cylinder":
        return CYLINDER, [*s["a"], *s["b"], s["radius"]]
    if name == "box":
        return BOX, [*s["center"], *(0.5 * v for v in s["size"]), *_turned(s["rotation"]).ravel()]
    if name == "torus":
        axis = np.array(s["axis"]) / np.linalg.norm(s["axis"])
        start = s.get("start")
        if start is None:
            start = np.eye(3)[int(np.abs(axis).argmin())]
        start = np.array(start) - np.dot(start, axis) * axis
        start /= np.linalg.norm(start)
        turn = math.radians(s["angle"])
        return TORUS, [*s["center"], *axis, *start, s["major_radius"], s["minor_radius"], turn]
    if name == "post":
        return POST, [*s["center"], s["radius"]]
    if name == "prism":
        return PRISM, [first, first + len(s["polygon"]), s["grow"]]
    normal = np.array(s["normal"]) / np.linalg.norm(s["normal"])
    return HALF_SPACE, [*s["point"], *normal]


def _turned(angles: tuple[float, float, float]) -> Floats:
    """Return the axes of a box, as rows, turned about x, then y, then z, degrees."""
    (a, b, c), turn = np.radians(angles), np.eye(3)
    for angle, (i, j) in ((a, (1, 2)), (b, (2, 0)), (c, (0, 1))):
        step = np.eye(3)
        step[i, i] = step[j, j] = math.cos(angle)
        step[i, j], step[j, i] = -math.sin(angle), math.sin(angle)
        turn = step @ turn
    return turn.T


@kernel
def distance_from_segment(
    x: float, y: float, z: float, ax: float, ay: float, az: float, bx: float, by: float, bz: float
) -> float:
    """Return the distance of a point from a segment."""
    ux, uy, uz = bx - ax, by - ay, bz - az
    size = ux * ux + uy * uy + uz * uz
    t = 0.0
    if size > 0.0:
        t = ((x - ax) * ux + (y - ay) * uy + (z - az) * uz) / size
        t = min(1.0, max(0.0, t))
    return math.sqrt((x - ax - t * ux) ** 2 + (y - ay - t * uy) ** 2 + (z - az - t * uz) ** 2)


@kernel
def distance_from_solid(
    kind: int, r: Floats, corners: Floats, x: float, y: float, z: float
) -> float:
    """Return the distance of a point from one solid, negative inside."""
    if kind == CAPSULE:
        return distance_from_segment(x, y, z, r[0], r[1], r[2], r[3], r[4], r[5]) - r[6]
    if kind == CYLINDER:
        ux, uy, uz = r[3] - r[0], r[4] - r[1], r[5] - r[2]
        long = math.sqrt(ux * ux + uy * uy + uz * uz)
        px, py, pz = x - r[0], y - r[1], z - r[2]
        along = (px * ux + py * uy + pz * uz) / long
        off = math.sqrt(max(0.0, px * px + py * py + pz * pz - along * along)) - r[6]
        end = max(-along, along - long)
        if off <= 0.0 or end <= 0.0:
            return max(off, end)
        return math.hypot(off, end)
    if kind == BOX:
        out, inside = 0.0, -math.inf
        for k in range(3):
            at = (x - r[0]) * r[6 + 3 * k] + (y - r[1]) * r[7 + 3 * k] + (z - r[2]) * r[8 + 3 * k]
            gap = abs(at) - r[3 + k]
            inside = max(inside, gap)
            out += max(gap, 0.0) ** 2
        return inside if inside <= 0.0 else math.sqrt(out)
    if kind == TORUS:
        px, py, pz = x - r[0], y - r[1], z - r[2]
        up = px * r[3] + py * r[4] + pz * r[5]
        a = px * r[6] + py * r[7] + pz * r[8]
        cx, cy, cz = (
            r[4] * r[8] - r[5] * r[7], r[5] * r[6] - r[3] * r[8], r[3] * r[7] - r[4] * r[6]
        )  # fmt: skip
        b = px * cx + py * cy + pz * cz
        angle = math.atan2(b, a)
        if angle < 0.0:
            angle += 2.0 * math.pi
        if angle <= r[11]:
            return math.hypot(math.hypot(a, b) - r[9], up) - r[10]
        first = math.sqrt((a - r[9]) ** 2 + b * b + up * up)
        ex, ey = r[9] * math.cos(r[11]), r[9] * math.sin(r[11])
        return min(first, math.sqrt((a - ex) ** 2 + (b - ey) ** 2 + up * up)) - r[10]
    if kind == POST:
        return math.hypot(x - r[0], y - r[1]) - r[2]
    if kind == PRISM:
        begin, end = int(r[0]), int(r[1])
        nearest, inside = math.inf, False
        for k in range(begin, end):
            m = k + 1 if k + 1 < end else begin
            ax, ay, bx, by = corners[k, 0], corners[k, 1], corners[m, 0], corners[m, 1]
            nearest = min(nearest, distance_from_segment(x, y, 0.0, ax, ay, 0.0, bx, by, 0.0))
            if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
                inside = not inside
        return (-nearest if inside else nearest) - r[2]
    return (x - r[0]) * r[3] + (y - r[1]) * r[4] + (z - r[2]) * r[5]


@kernel
def room_at(water: Water, x: float, y: float, z: float) -> float:
    """Return the distance of a point from all solids, metres, negative inside."""
    if water.by_field:
        return field_distance(water.field, x, y, z)
    nearest = math.inf
    for n in range(len(water.kinds)):
        nearest = min(
            nearest, distance_from_solid(int(water.kinds[n]), water.rows[n], water.corners, x, y, z)
        )
    return nearest - water.offset


@kernel
def rooms_at(water: Water, points: Floats) -> Floats:
    """Return the distances (n,) of points (n, 3) from all solids, metres."""
    out = np.empty(len(points))
    for n in range(len(points)):
        out[n] = room_at(water, points[n, 0], points[n, 1], points[n, 2])
    return out

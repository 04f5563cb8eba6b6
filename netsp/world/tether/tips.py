"""What hangs on the tips of corners, and in the notches of voxels, is taken off them sideways."""

from __future__ import annotations

import math

from netsp.base.arrays import Floats
from netsp.base.compiled.dynamic_array import write_rows
from netsp.base.compiled.kernel import kernel
from netsp.world.scene.packing import VOXELS
from netsp.world.scene.sampling import Field
from netsp.world.tether.mend import mend
from netsp.world.tether.strand import (
    CONE,
    EX,
    EY,
    EZ,
    PART,
    SHARP,
    X,
    Y,
    Z,
    gap,
    note_motion,
    rests,
    strand_length,
    to_surface,
)

TURNING, CLOSE, TIP = 0.95, 8.0, 4
"""Cosine of the angle by which a strand turns sharply, strides between contacts that it turns about
together, and how many of them a tip may have at most."""

SIDESTEP, MOST_NUDGE = 0.7, 9
"""Of a stride, what such contacts are taken sideways at a time, which leaves room for the way to
the surface; and how often at most: a strand whose ends stand still. One whose ends move is taken
once, and has another chance at once."""


@kernel
def nudge(
    field: Field, strand: Floats, count: int, slip: float, stride: float, room: int, worth: float,
    steps: int,
) -> tuple[Floats, int, bool]:  # fmt: skip
    """Take the contacts that the strand turns about sharply sideways, in up to so many steps,
    where that makes it shorter by what it is worth. Returns (strand, count, whether anything was).

    Over the tip of a corner each contact by itself is held, and a strand that is taut to both sides
    of the tip lies on a saddle: only all of them together, and across, get off it. And an edge in
    voxels is uneven: in its notches, millimetres deep, a strand would stay.
    """
    i = 1 if field.data[VOXELS] > 0.0 else count  # exact edges and corners need none of it
    while i < count - 1:
        j = i
        while j + 1 < count - 1 and gap(strand, j, j + 1) <= CLOSE * stride:
            j += 1
        wx, wy, wz, turned = across(strand, i, j)
        sharp = False
        for k in range(i, j + 1):
            # voxels are uneven everywhere: round parts of them are left to strands that stand still
            uneven = strand[k, PART] < 0.0 and steps > 1
            edge = strand[k, SHARP] + abs(strand[k, CONE]) > 0.0
            sharp = sharp or uneven or edge or not rests(strand, k)
        if turned and sharp and j < i + TIP:
            before, kept = strand_length(strand, count), strand[:count].copy()
            # over an edge that it crosses at a slant, a strand slips along the edge
            along_edge = i == j and strand[i, SHARP] == 1.0
            for way in range(4 if along_edge else 2):
                side, grown = (1.0, -1.0)[way % 2], count
                vx, vy, vz = side * wx, side * wy, side * wz
                if way >= 2:
                    vx, vy, vz = side * kept[i, EX], side * kept[i, EY], side * kept[i, EZ]
                for _ in range(steps):
                    if not sidestep(field, strand, grown, i, j, vx, vy, vz, stride):
                        break
                    strand, grown = mend(field, strand, grown, slip, room, slip)
                    if strand_length(strand, grown) < before - worth:
                        return strand, grown, True
                    ux, uy, uz, turned = across(strand, i, j)
                    if grown != count or not turned:
                        break
                    if way >= 2:
                        continue
                    same = 1.0 if ux * vx + uy * vy + uz * vz > 0.0 else -1.0
                    vx, vy, vz = same * ux, same * uy, same * uz
                write_rows(strand, kept, count)
        i = j + 1
    return strand, count, False


@kernel
def sidestep(
    field: Field, strand: Floats, count: int, i: int, j: int,
    vx: float, vy: float, vz: float, stride: float,
) -> bool:  # fmt: skip
    """Take nodes i to j along (vx, vy, vz), and onto the surface. Where that took one of them
    farther than a stride, past which the class may change, the step is not to be used: False."""
    by = SIDESTEP * stride
    for k in range(i, j + 1):
        x, y, z = strand[k, X], strand[k, Y], strand[k, Z]
        px, py, pz = to_surface(field, x + by * vx, y + by * vy, z + by * vz, 1e-3 * stride)
        if (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2 > stride * stride:
            return False
        strand[k, X], strand[k, Y], strand[k, Z] = px, py, pz
        note_motion(strand, count, k, math.inf)
    return True


@kernel
def across(strand: Floats, i: int, j: int) -> tuple[float, float, float, bool]:
    """The unit vector across the strand, and along the surface, where it rests on nodes i to j; and
    whether it turns there by more than `TURNING`."""
    la, lb = gap(strand, i - 1, i), gap(strand, j, j + 1)
    if la == 0.0 or lb == 0.0:
        return 0.0, 0.0, 0.0, False
    ax, ay, az = (
        (strand[i, X] - strand[i - 1, X]) / la,
        (strand[i, Y] - strand[i - 1, Y]) / la,
        (strand[i, Z] - strand[i - 1, Z]) / la,
    )
    bx, by, bz = (
        (strand[j + 1, X] - strand[j, X]) / lb,
        (strand[j + 1, Y] - strand[j, Y]) / lb,
        (strand[j + 1, Z] - strand[j, Z]) / lb,
    )
    if ax * bx + ay * by + az * bz > TURNING:
        return 0.0, 0.0, 0.0, False
    # out of the surface, and on along it
    nx, ny, nz = ax - bx, ay - by, az - bz
    tx, ty, tz = ax + bx, ay + by, az + bz
    wx, wy, wz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    length = math.sqrt(wx * wx + wy * wy + wz * wz)
    if length < 1e-6:
        return 0.0, 0.0, 0.0, False
    return wx / length, wy / length, wz / length, True

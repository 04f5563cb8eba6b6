"""Sidesteps of a strand off the tips of corners, and out of the notches of voxels."""

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
    is_resting,
    note_motion,
    strand_length,
    to_surface,
)
from netsp.world.tether.tether_policy import PullSettings


@kernel
def sidestep_tips(
    field: Field,
    strand: Floats,
    count: int,
    settings: PullSettings,
    room: int,
    steps: int,
    is_still: bool,
) -> tuple[Floats, int, bool]:
    """Move contacts sideways where the strand turns sharply, if that makes it shorter.

    Over the tip of a corner each contact by itself is held, and a strand that is taut on both sides
    of the tip lies on a saddle: only all contacts together, moved across the strand, leave it.
    Edges of voxels are uneven, and a strand would stay in their notches, which are millimetres
    deep. Of exact solids, only the corners where edges meet need sidesteps: there, contacts on two
    edges block each other, and a strand that should slip off does not come to rest.

    Returns the strand, the number of its nodes, and whether any contact was moved.

    Parameters
    ----------
    is_still : bool
        Whether the strand is at rest.
    """
    stride, slip = settings.stride, settings.slip
    min_gain = settings.min_gain * settings.precision
    is_exact = field.data[VOXELS] == 0.0
    i = 1
    if is_still if is_exact else settings.hold_friction > 0.0:
        return strand, count, False
    while i < count - 1:
        j = i
        while j + 1 < count - 1 and gap(strand, j, j + 1) <= settings.tip_strides * stride:
            j += 1
        wx, wy, wz, is_turning = sidestep_direction(strand, i, j, settings.max_tip_cosine)
        is_sharp = False
        for k in range(i, j + 1):
            # voxels are uneven everywhere; only strands that stand still leave their round parts
            is_uneven = strand[k, PART] < 0.0 and steps > 1
            is_edge = strand[k, SHARP] + abs(strand[k, CONE]) > 0.0
            is_sharp = is_sharp or is_uneven or is_edge or not is_resting(strand, k)
        is_corner = i < j and strand[i, SHARP] + strand[j, SHARP] == 2.0
        is_tip = is_turning and (is_corner if is_exact else is_sharp)
        if is_tip and j < i + settings.max_tip_contacts:
            before, kept = strand_length(strand, count), strand[:count].copy()
            # a strand that crosses an edge at a slant slips along the edge
            along_edge = i == j and strand[i, SHARP] == 1.0
            for attempt in range(4 if along_edge else 2):
                side, new_count = (1.0, -1.0)[attempt % 2], count
                vx, vy, vz = side * wx, side * wy, side * wz
                if attempt >= 2:
                    vx, vy, vz = side * kept[i, EX], side * kept[i, EY], side * kept[i, EZ]
                for _ in range(steps):
                    if not sidestep(field, strand, new_count, i, j, (vx, vy, vz), settings):
                        break
                    strand, new_count = mend(field, strand, new_count, settings, room, slip)
                    if strand_length(strand, new_count) < before - min_gain:
                        return strand, new_count, True
                    ux, uy, uz, is_turning = sidestep_direction(
                        strand, i, j, settings.max_tip_cosine
                    )
                    if new_count != count or not is_turning:
                        break
                    if attempt >= 2:
                        continue
                    same = 1.0 if ux * vx + uy * vy + uz * vz > 0.0 else -1.0
                    vx, vy, vz = same * ux, same * uy, same * uz
                write_rows(strand, kept, count)
        i = j + 1
    return strand, count, False


@kernel
def sidestep(
    field: Field,
    strand: Floats,
    count: int,
    i: int,
    j: int,
    direction: tuple[float, float, float],
    settings: PullSettings,
) -> bool:
    """Move nodes i to j along a direction and onto the surface.

    Returns False where a node moved farther than a stride, after which the homotopy class may
    differ; then the step must not be used.
    """
    stride = settings.stride
    step = settings.sidestep_strides * stride
    vx, vy, vz = direction
    for k in range(i, j + 1):
        x, y, z = strand[k, X], strand[k, Y], strand[k, Z]
        px, py, pz = to_surface(field, x + step * vx, y + step * vy, z + step * vz, 1e-3 * stride)
        if (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2 > stride * stride:
            return False
        strand[k, X], strand[k, Y], strand[k, Z] = px, py, pz
        note_motion(strand, count, k, math.inf)
    return True


@kernel
def sidestep_direction(
    strand: Floats, i: int, j: int, max_cosine: float
) -> tuple[float, float, float, bool]:
    """Return the unit vector across the strand along the surface at nodes i to j.

    The last value is whether the strand turns sharply there; without it, there is no direction.
    """
    la, lb = gap(strand, i - 1, i), gap(strand, j, j + 1)
    if la == 0.0 or lb == 0.0:
        return 0.0, 0.0, 0.0, False
    ax, ay, az = (
        (strand[i, X] - strand[i - 1, X]) / la,
        (strand[i, Y] - strand[i - 1, Y]) / la,
        (strand[i, Z] - strand[i - 1, Z]) / la,
    )
    bx, step, bz = (
        (strand[j + 1, X] - strand[j, X]) / lb,
        (strand[j + 1, Y] - strand[j, Y]) / lb,
        (strand[j + 1, Z] - strand[j, Z]) / lb,
    )
    if ax * bx + ay * step + az * bz > max_cosine:
        return 0.0, 0.0, 0.0, False
    # out of the surface, and on along it
    nx, ny, nz = ax - bx, ay - step, az - bz
    tx, ty, tz = ax + bx, ay + step, az + bz
    wx, wy, wz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    length = math.sqrt(wx * wx + wy * wy + wz * wz)
    if length < 1e-6:
        return 0.0, 0.0, 0.0, False
    return wx / length, wy / length, wz / length, True

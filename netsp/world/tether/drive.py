"""Motions of a strand's ends along paths, with its lengths on the way."""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.compiled.kernel import kernel
from netsp.world.scene.sampling import Field, distance
from netsp.world.tether.contact_creep import creep
from netsp.world.tether.measure import corner_excess
from netsp.world.tether.pull import pull_end
from netsp.world.tether.strand import X, Y, Z, strand_length
from netsp.world.tether.tether_policy import PullSettings


@kernel
def move_end(
    field: Field,
    strand: Floats,
    count: int,
    last: bool,
    target: tuple[float, float, float],
    settings: PullSettings,
) -> tuple[Floats, int, float]:
    """Move one end as `pull_end` does, and let contacts creep by the length that passes.

    What a slip makes the strand shorter passes over some of its contacts only, and does not count.
    """
    x, y, z = target
    if settings.hold_friction <= 0.0:
        return pull_end(field, strand, count, last, x, y, z, settings)
    before, end = strand_length(strand, count), count - 1 if last else 0
    path = (strand[end, X] - x) ** 2 + (strand[end, Y] - y) ** 2 + (strand[end, Z] - z) ** 2
    strand, count, residual = pull_end(field, strand, count, last, x, y, z, settings)
    travel = min(abs(strand_length(strand, count) - before), math.sqrt(path))
    strand, count = creep(field, strand, count, settings, travel)
    return strand, count, residual


@kernel
def follow(
    field: Field, strand: Floats, last: bool, x: float, y: float, z: float, settings: PullSettings
) -> tuple[Floats, float, float, float]:
    """Move one end of a copy of the strand to (x, y, z), as `pull_end` does.

    Returns
    -------
    strand : ndarray
        The new strand; the old one where the target is too deep.
    residual : float
        Motion in the last round, metres.
    length : float
        Length, metres.
    depth : float
        Depth of the target inside a solid, metres. Above delta / 4, nothing is moved.
    """
    depth = -distance(field, x, y, z)
    if depth > 0.25 * settings.delta:
        return strand, 0.0, 0.0, depth
    strand, count, residual = move_end(field, strand.copy(), len(strand), last, (x, y, z), settings)
    length = strand_length(strand, count) + corner_excess(field, strand, count, settings)
    return strand[:count].copy(), residual, length, depth


@kernel
def drive(
    field: Field, strand: Floats, count: int, path: Floats, settings: PullSettings, floor: float
) -> tuple[Floats, int, float, Floats]:
    """Move the robot along a path (k, 3).

    Lengths from `floor` on, and the last one, are corrected for the corners of voxels. Returns
    strand, count and residual as `pull_end` does, and the length at each point (k,).
    """
    lengths, residual = np.empty(len(path)), 0.0
    for k in range(len(path)):
        strand, count, residual = move_end(
            field, strand, count, True, (path[k, 0], path[k, 1], path[k, 2]), settings
        )
        lengths[k] = strand_length(strand, count)
        if lengths[k] >= floor or k == len(path) - 1:
            lengths[k] += corner_excess(field, strand, count, settings)
    return strand, count, residual, lengths

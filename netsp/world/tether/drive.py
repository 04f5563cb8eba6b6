"""Take the end of a strand along a path, and say how long it is on the way."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.compiled.kernel import kernel
from netsp.world.scene.sampling import Field, distance
from netsp.world.tether.measure import cut_off
from netsp.world.tether.pull import PullSettings, pull_end
from netsp.world.tether.strand import strand_length


@kernel
def follow(
    field: Field,
    strand: Floats,
    last: bool,
    x: float,
    y: float,
    z: float,
    settings: PullSettings,
) -> tuple[Floats, float, float, float]:
    """`pull_end` on a copy, with what its callers ask next. Returns (strand, residual, length,
    depth): depth is how deep the target lies inside a solid; then nothing is done."""
    depth = -distance(field, x, y, z)
    if depth > 0.25 * settings.delta:
        return strand, 0.0, 0.0, depth
    strand, count, residual = pull_end(field, strand.copy(), len(strand), last, x, y, z, settings)
    length = strand_length(strand, count) + cut_off(field, strand, count, settings)
    return strand[:count].copy(), residual, length, depth


@kernel
def drive(
    field: Field,
    strand: Floats,
    count: int,
    path: Floats,
    settings: PullSettings,
    floor: float,
) -> tuple[Floats, int, float, Floats]:
    """Take the robot along a path (k, 3). Returns (strand, count, residual, lengths after each
    point). What corners cut off is added at the last point, and where the length is at least
    `floor`."""
    lengths, residual = np.empty(len(path)), 0.0
    for k in range(len(path)):
        strand, count, residual = pull_end(
            field, strand, count, True, path[k, 0], path[k, 1], path[k, 2], settings
        )
        lengths[k] = strand_length(strand, count)
        if lengths[k] >= floor or k == len(path) - 1:
            lengths[k] += cut_off(field, strand, count, settings)
    return strand, count, residual, lengths

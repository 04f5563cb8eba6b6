"""Take the end of a strand along a path, and say how long it is on the way."""

from __future__ import annotations

import math

import numpy as np

from netsp.arrays import Floats
from netsp.compiled.kernel import kernel
from netsp.online.scene.sampling import Field, distance
from netsp.online.tether.measure import cut_off
from netsp.online.tether.pull import PullSettings, come_to_rest, pull_end
from netsp.online.tether.strand import X, Y, Z, strand_length


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
    strand, count, residual = pull_end(
        field, strand.copy(), len(strand), last, x, y, z, settings, False
    )
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
    point). Where the length is at least `floor` the strand comes to rest there; elsewhere it is
    longer than it would be at rest. What corners cut off is added there, and at the last point."""
    lengths, residual, way = np.empty(len(path)), 0.0, 0.0
    for k in range(len(path)):
        x, y, z = path[k, 0], path[k, 1], path[k, 2]
        end, passing = count - 1, floor > 0.0
        way += math.sqrt(
            (x - strand[end, X]) ** 2 + (y - strand[end, Y]) ** 2 + (z - strand[end, Z]) ** 2
        )
        strand, count, residual = pull_end(field, strand, count, True, x, y, z, settings, passing)
        lengths[k] = strand_length(strand, count)
        near = lengths[k] >= floor
        if near:
            if passing:
                strand, count, residual = come_to_rest(field, strand, count, settings, way)
                lengths[k] = strand_length(strand, count)
            way = 0.0
        if near or k == len(path) - 1:
            lengths[k] += cut_off(field, strand, count, settings)
    return strand, count, residual, lengths

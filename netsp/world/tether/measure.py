"""Correction of a strand's length where its edges cut the corners of voxels.

An edge may be a slip deep in a solid, and a node may rest beside a corner. Both are precise enough
for the homotopy class and for being at rest, but the length is too short by a first-order amount in
that depth. So lengths are measured on a copy with nodes at the corners, too. The strand itself does
without them, because every notch of the voxels would hold it as it moves on.

The copy is a curve of the strand's class that is nowhere deeper than `TetherPolicy.corner_depth`.
The shortest curve of the class is no longer, apart from that depth.
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.compiled.dynamic_array import write_rows
from netsp.base.compiled.kernel import kernel
from netsp.world.scene.packing import VOXELS
from netsp.world.scene.sampling import Field
from netsp.world.tether.mend import mend
from netsp.world.tether.pull import pull
from netsp.world.tether.strand import WIDTH, strand_length
from netsp.world.tether.tether_policy import PullSettings


@kernel
def corner_excess(field: Field, strand: Floats, count: int, settings: PullSettings) -> float:
    """Return by how much the shortest curve of a strand's class is longer than the strand, metres.

    The result is 0 where all edges are exact, as those of solids are.
    """
    if field.data[VOXELS] <= 0.0:
        return 0.0
    deep = settings.corner_depth * settings.slip
    length, shortest = strand_length(strand, count), math.inf
    room = 4 * count + 64
    copy, n = np.zeros((count + 16, WIDTH)), count
    write_rows(copy, strand, count)
    vain_mends, min_gain = 0, settings.min_mend_gain * length
    for _ in range(settings.max_mends):
        copy, n = mend(field, copy, n, settings, room, deep)
        before, shortest = shortest, min(shortest, strand_length(copy, n))
        vain_mends = vain_mends + 1 if shortest > before - min_gain else 0
        is_done = shortest <= length + min_gain or vain_mends > settings.max_vain_mends
        if is_done or shortest > settings.max_crumpled_ratio * length:
            break
        copy, n, _ = pull(field, copy, n, settings, settings.passing_rounds, 0, 1)
    return max(0.0, shortest - length) if shortest <= settings.max_crumpled_ratio * length else 0.0

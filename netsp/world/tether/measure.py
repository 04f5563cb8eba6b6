"""What a strand's length is short of, where its edges cut the corners of voxels.

An edge may be as deep as ``slip`` in a solid, and a node may rest beside a corner: enough for the
class, and to be at rest, but the length is then short by something of the first order in that depth
(among random meshes 1.4 % at worst). So lengths are taken from a copy that has nodes at the
corners, too. Only from a copy: a strand with so many nodes that goes on moving is held by every
notch of the voxels.

The copy is a curve of the strand's class that is nowhere deeper than `CUT` of a slip, so the
shortest curve of the class is no longer than the copy, but for that depth.
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
from netsp.world.tether.pull import PASSING, SLIP, PullSettings, pull
from netsp.world.tether.strand import WIDTH, strand_length

CUT = 1.0 / 6.0
"""Of a slip, the depth from which an edge counts as cutting a corner."""

TURNS, PATIENCE, ENOUGH = 8, 2, 1e-4
"""How often at most the copy is mended and pulled, because nodes are put where edges are deepest
and not where the copy is shortest; how often in a row in vain; and what share of the length counts
as that."""

CRUMPLED = 1.1
"""A strand whose copy is longer by more than this lies crumpled over voxels, far from rest: about
its length nothing is to be said."""


@kernel
def cut_off(field: Field, strand: Floats, count: int, settings: PullSettings) -> float:
    """Metres by which the shortest of some curves through nothing is longer than a strand at
    rest; 0 where all edges are exact, as those of solids are."""
    if field.data[VOXELS] <= 0.0:
        return 0.0
    slip = SLIP * settings.delta
    length, least = strand_length(strand, count), math.inf
    room = 4 * count + 64
    copy, n = np.zeros((count + 16, WIDTH)), count
    write_rows(copy, strand, count)
    in_vain, worth = 0, ENOUGH * length
    for _ in range(TURNS):
        copy, n = mend(field, copy, n, slip, room, CUT * slip)
        before, least = least, min(least, strand_length(copy, n))
        in_vain = in_vain + 1 if least > before - worth else 0
        if least <= length + worth or in_vain > PATIENCE or least > CRUMPLED * length:
            break
        copy, n, _ = pull(field, copy, n, settings, PASSING, 0, 1)
    return max(0.0, least - length) if least <= CRUMPLED * length else 0.0

"""Sideways creep of contacts on which the tether slides lengthwise under friction.

Coulomb friction acts against the whole sliding motion. A contact over which the tether slides
lengthwise by ds, and sideways by q, is held sideways by the force mu N q / sqrt(q^2 + ds^2) only.
So a tether that is paid out or reeled in creeps sideways under any sideways pull, however small,
and friction holds it at rest only while no length passes (docs/theory/tether). For q that is small
beside ds, the force is mu N q / ds, as of a viscous medium: one more term on the diagonal of the
Hessian of the length. It is never less than the exact force, so contacts creep no farther than
they would.
"""

from __future__ import annotations

import math

from netsp.base.arrays import Floats
from netsp.base.compiled.kernel import kernel
from netsp.world.scene.sampling import Field
from netsp.world.tether.mend import mend
from netsp.world.tether.pull import eliminate, length_derivatives, undo_lengthening_steps
from netsp.world.tether.strand import (
    EX,
    EY,
    EZ,
    SHARP,
    X,
    Y,
    Z,
    note_motion,
    strand_length,
    to_surface,
)
from netsp.world.tether.tether_policy import PullSettings


@kernel
def creep(
    field: Field, strand: Floats, count: int, settings: PullSettings, travel: float
) -> tuple[Floats, int]:
    """Let contacts creep sideways while a length of tether passes over them.

    Parameters
    ----------
    travel : float
        Length of tether that passes, metres. It is divided into pieces of at most a stride.

    Returns
    -------
    strand : ndarray
        The strand, copied where it had to grow.
    count : int
        Number of its nodes.
    """
    stride, slip = settings.stride, settings.slip
    if travel <= settings.precision or settings.hold_friction <= 0.0 or count < 3:
        return strand, count
    pieces = min(math.ceil(travel / stride), settings.max_creep_pieces)
    room = count + 64 + int(0.5 * strand_length(strand, count) / slip)
    for _ in range(pieces):
        if creep_once(field, strand, count, settings, travel / pieces) <= 0.0:
            break
        strand, count = mend(field, strand, count, settings, room, slip)
        if count < 3:
            break
    return strand, count


@kernel
def creep_once(
    field: Field, strand: Floats, count: int, settings: PullSettings, travel: float
) -> float:
    """Move each contact along its slide by what it creeps, at most a stride, in place.

    This is a step of the implicit Euler method. Returns the largest motion, metres.
    """
    n, stride = count - 2, settings.stride
    slope, diagonal, beside, pressing, _ = length_derivatives(strand, count, settings)
    for k in range(n):
        diagonal[k] += settings.hold_friction * max(pressing[k], 0.0) / travel
    eliminate(slope, diagonal, beside, settings.min_pivot_share)
    for k in range(n - 1, -1, -1):
        right = slope[k]
        if k < n - 1:
            right -= beside[k] * slope[k + 1]
        slope[k] = right / diagonal[k]
    before = strand[1 : count - 1, X : Z + 1].copy()
    largest = 0.0
    for k in range(n):
        i = k + 1
        step = min(max(-slope[k], -stride), stride)
        if abs(step) <= 1e-3 * settings.precision:
            continue
        strand[i, X] += step * strand[i, EX]
        strand[i, Y] += step * strand[i, EY]
        strand[i, Z] += step * strand[i, EZ]
        if strand[i, SHARP] == 0.0:
            strand[i, X], strand[i, Y], strand[i, Z] = to_surface(
                field, strand[i, X], strand[i, Y], strand[i, Z], 1e-3 * stride
            )
        note_motion(strand, count, i, abs(step))
        largest = max(largest, abs(step))
    undo_lengthening_steps(strand, before, settings.max_halvings)
    return largest

"""Tether length beyond the taut one: slack, sag in a current, and friction at contacts.

Sag. A span of chord c hangs in a current. Drag along a cable is small. The drag normal to it is w
per metre on the chord, and w cos^2 a where it is inclined by a against the chord (Morison's law for
inclined cylinders, as in Faltinsen, "Sea Loads on Ships and Offshore Structures", 1990). With no
force along it the tension T is the same everywhere, and the balance of a piece, ``T da = w cos^2 a
ds``, gives ``tan a = w s / T`` from the middle on: a catenary. Its length is ``(2 T / w) sinh(q /
2)`` with ``q = w c / T``, that is c (1 + q^2 / 24) while q is small.

Friction. Around contacts the tension grows by e^(mu theta), theta the sum of turning angles (Euler,
Eytelwein: the capstan). The tension is smallest at the anchor, so sag that is computed with the
tension there is never too small.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.compiled.kernel import kernel
from netsp.model.solution import tension_ratio
from netsp.world.scene.sampling import Field
from netsp.world.tether.drive import move_end
from netsp.world.tether.measure import corner_excess
from netsp.world.tether.strand import EXTRA, X, Y, Z, gap, is_resting, strand_length
from netsp.world.tether.taut_tether import Tether
from netsp.world.tether.tether_policy import PullSettings, TetherPolicy


class Load(NamedTuple):
    """Forces on a tether.

    Attributes
    ----------
    slack
        Slack, as a share of the taut length.
    drag
        Drag of a metre of tether in a flow of 1 m/s across it, N s^2 / m^3.
    x, y, z
        Velocity of the water, m/s.
    tension
        Tension at the anchor, N.
    gusts
        Additional speed of the water in any direction, m/s.
    max_sag
        Maximum ratio of the drag on a span to its tension. A span with more is practically endless.
    """

    slack: float
    drag: float
    x: float
    y: float
    z: float
    tension: float
    gusts: float = 0.0
    max_sag: float = 40.0


@kernel
def span_length(c: float, dx: float, dy: float, dz: float, load: Load) -> float:
    """Return the length of a span with the chord c, metres, along (dx, dy, dz)."""
    if c <= 0.0 or load.drag == 0.0:
        return c
    along = (load.x * dx + load.y * dy + load.z * dz) / c
    across = math.sqrt(max(load.x**2 + load.y**2 + load.z**2 - along * along, 0.0)) + load.gusts
    q = min(load.drag * across * across * c / load.tension, load.max_sag)
    if q < 1e-3:
        return c * (1.0 + q * q / 24.0)
    return 2.0 * c / q * math.sinh(0.5 * q)


@kernel
def strand_payout(strand: Floats, count: int, load: Load) -> float:
    """Return the payout of a strand. Nodes in the air do not divide spans."""
    total, first, chord, over = 0.0, 0, 0.0, 0.0
    for i in range(1, count):
        chord += gap(strand, i - 1, i)
        over += strand[i - 1, EXTRA]
        if i < count - 1 and not is_resting(strand, i):
            continue
        sagging = span_length(
            chord,
            strand[i, X] - strand[first, X],
            strand[i, Y] - strand[first, Y],
            strand[i, Z] - strand[first, Z],
            load,
        )
        total += max(sagging, chord + over)  # a piece that bends over a surface does not sag
        first, chord, over = i, 0.0, 0.0
    return (1.0 + load.slack) * total


@kernel
def strand_turning(strand: Floats, count: int, min_piece: float) -> float:
    """Return the sum of the angles by which a strand turns at its contacts, radians.

    Pieces shorter than `min_piece` do not count: two contacts that are not at rest yet can be so
    close together that the piece between them points backwards.
    """
    total, begun = 0.0, False
    px, py, pz = strand[0, X], strand[0, Y], strand[0, Z]
    ax, ay, az = 0.0, 0.0, 0.0
    for i in range(1, count):
        bx, by, bz = strand[i, X] - px, strand[i, Y] - py, strand[i, Z] - pz
        if bx * bx + by * by + bz * bz < min_piece * min_piece:
            continue
        if begun:
            cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            across = math.sqrt(cx * cx + cy * cy + cz * cz)
            total += math.atan2(across, ax * bx + ay * by + az * bz)
        ax, ay, az, begun = bx, by, bz, True
        px, py, pz = strand[i, X], strand[i, Y], strand[i, Z]
    return total


@kernel
def drive_under(
    field: Field, strand: Floats, count: int, path: Floats, settings: PullSettings, load: Load
) -> tuple[Floats, int, float, Floats, Floats]:
    """Move the robot as `drive` does, with payout and turning at each point instead of the
    length."""
    payouts, turnings, residual = np.empty(len(path)), np.empty(len(path)), 0.0
    for k in range(len(path)):
        strand, count, residual = move_end(
            field, strand, count, True, (path[k, 0], path[k, 1], path[k, 2]), settings
        )
        more = corner_excess(field, strand, count, settings)
        payouts[k] = strand_payout(strand, count, load) + (1.0 + load.slack) * more
        turnings[k] = strand_turning(strand, count, settings.min_piece * settings.delta)
    return strand, count, residual, payouts, turnings


def payout(tether: Tether, load: Load) -> float:
    """Return the payout of a tether: the length that must be out, metres."""
    if load.slack == 0.0 and load.drag == 0.0:
        return tether.length
    more = tether.length - strand_length(tether.strand, len(tether.strand))
    return float(strand_payout(tether.strand, len(tether.strand), load) + (1.0 + load.slack) * more)


def turning(tether: Tether, delta: float, *, min_piece: float = TetherPolicy.min_piece) -> float:
    """Return the sum of the angles by which a tether turns at its contacts, radians.

    Parameters
    ----------
    tether : Tether
        The taut tether.
    delta : float
        Resolution of its model, metres.
    min_piece : float
        Minimum length of the pieces that count (`TetherPolicy`), in units of delta.
    """
    return float(strand_turning(tether.strand, len(tether.strand), min_piece * delta))


def payout_along(line: npt.ArrayLike, load: Load) -> float:
    """Return the payout of a taut line whose corners all rest on something, metres.

    Parameters
    ----------
    line : array_like, shape (k, 3)
        Corners, metres.
    load : Load
        Forces on the tether.
    """
    steps = np.diff(np.asarray(line, dtype=float), axis=0)
    chords = np.linalg.norm(steps, axis=1)
    spans = (span_length(c, x, y, z, load) for c, (x, y, z) in zip(chords, steps, strict=True))
    return (1.0 + load.slack) * float(sum(spans))


def pull_on_robot(
    tether: Tether, load: Load, friction: float, velocity: Floats, delta: float
) -> Floats:
    """Return the force of a tether on the robot at its end, N.

    It is the tension at the anchor, grown by friction at contacts, along the last span, plus half
    of the drag on that span. A lumped model: the span's shape and inertia are ignored.

    Parameters
    ----------
    tether : Tether
        The taut tether.
    load : Load
        Forces on it.
    friction : float
        Coefficient of friction at contacts.
    velocity : ndarray, shape (3,)
        Velocity of the robot, m/s. The span moves at half of it.
    delta : float
        Resolution of the tether's model, metres.
    """
    resting = [i for i in range(len(tether.strand) - 1) if i == 0 or is_resting(tether.strand, i)]
    span = tether.nodes[resting[-1]] - tether.robot
    length = float(np.linalg.norm(span))
    if length < 1e-9:
        return np.zeros(3)
    along = span / length
    tension = load.tension * tension_ratio(friction, turning(tether, delta))
    flow = np.array([load.x, load.y, load.z]) - 0.5 * velocity
    across = flow - (flow @ along) * along
    drag = 0.5 * load.drag * length * float(np.linalg.norm(across)) * across
    return np.asarray(tension * along + drag)

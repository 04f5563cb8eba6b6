"""What a tether needs beyond its taut length: slack, sag in a current, and friction at contacts.

Sag. A span of chord c hangs in a current. Drag along a cable is small; what acts is the drag normal
to it, w per metre on the chord and w cos^2 a where it is inclined by a against the chord (Morison's
law for inclined cylinders, as in Faltinsen, "Sea Loads on Ships and Offshore Structures", 1990).
With no force along it the tension T is the same everywhere, and the balance of a piece,
``T da = w cos^2 a ds``, says ``tan a = w s / T`` from the middle on: a catenary. Its length is
``(2 T / w) sinh(q / 2)`` with ``q = w c / T``, that is c (1 + q^2 / 24) while q is small.

Friction. Around contacts the tension grows by e^(mu theta), theta the sum of turning angles (Euler,
Eytelwein: the capstan). The tension at the anchor, where it is held, is therefore the least, and
sag worked out with it is never too small.
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
from netsp.world.tether.measure import cut_off
from netsp.world.tether.pull import PullSettings, pull_end
from netsp.world.tether.strand import EXTRA, X, Y, Z, gap, rests, strand_length
from netsp.world.tether.taut_tether import Tether

MOST_SAG = 40.0
"""q at most: beyond, a span is as good as endless."""


SHORT = 0.3
"""In units of delta: shorter pieces of a strand say nothing about its direction."""


class Load(NamedTuple):
    """What acts on a tether: slack (share of its length), drag (N s^2 / m^3: of a metre at 1 m/s
    across), the water's velocity (m/s), the tension at the anchor (N), and how much faster the
    water may be in any direction (m/s)."""

    slack: float
    drag: float
    x: float
    y: float
    z: float
    tension: float
    gusts: float = 0.0


@kernel
def span_length(c: float, dx: float, dy: float, dz: float, load: Load) -> float:
    """Length of a span of chord c along (dx, dy, dz)."""
    if c <= 0.0 or load.drag == 0.0:
        return c
    along = (load.x * dx + load.y * dy + load.z * dz) / c
    across = math.sqrt(max(load.x**2 + load.y**2 + load.z**2 - along * along, 0.0)) + load.gusts
    q = min(load.drag * across * across * c / load.tension, MOST_SAG)
    if q < 1e-3:
        return c * (1.0 + q * q / 24.0)
    return 2.0 * c / q * math.sinh(0.5 * q)


@kernel
def payout_of(strand: Floats, count: int, load: Load) -> float:
    """Length that must be out for a strand to lie as it does. Nodes in the air part no spans."""
    total, first, chord, over = 0.0, 0, 0.0, 0.0
    for i in range(1, count):
        chord += gap(strand, i - 1, i)
        over += strand[i - 1, EXTRA]
        if i < count - 1 and not rests(strand, i):
            continue
        sagging = span_length(
            chord,
            strand[i, X] - strand[first, X],
            strand[i, Y] - strand[first, Y],
            strand[i, Z] - strand[first, Z],
            load,
        )
        total += max(sagging, chord + over)  # bent over a surface, a piece does not sag as well
        first, chord, over = i, 0.0, 0.0
    return (1.0 + load.slack) * total


@kernel
def turning_of(strand: Floats, count: int, least: float) -> float:
    """Sum of the angles (rad) by which a strand turns at its contacts, between pieces no shorter
    than `least`: two contacts that have not come to rest can lie so close together that the piece
    between them points backwards."""
    total, begun = 0.0, False
    px, py, pz = strand[0, X], strand[0, Y], strand[0, Z]
    ax, ay, az = 0.0, 0.0, 0.0
    for i in range(1, count):
        bx, by, bz = strand[i, X] - px, strand[i, Y] - py, strand[i, Z] - pz
        if bx * bx + by * by + bz * bz < least * least:
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
    field: Field,
    strand: Floats,
    count: int,
    path: Floats,
    settings: PullSettings,
    load: Load,
) -> tuple[Floats, int, float, Floats, Floats]:
    """`drive.drive` with payout and turning after each point instead of the length."""
    payouts, turnings, residual = np.empty(len(path)), np.empty(len(path)), 0.0
    for k in range(len(path)):
        strand, count, residual = pull_end(
            field, strand, count, True, path[k, 0], path[k, 1], path[k, 2], settings
        )
        more = cut_off(field, strand, count, settings)
        payouts[k] = payout_of(strand, count, load) + (1.0 + load.slack) * more
        turnings[k] = turning_of(strand, count, SHORT * settings.delta)
    return strand, count, residual, payouts, turnings


def payout(tether: Tether, load: Load) -> float:
    """Length that must be out for a tether to lie as it does.

    Parameters
    ----------
    tether : Tether
        The taut tether.
    load : Load
        What acts on it.

    Returns
    -------
    float
        Metres.
    """
    if load.slack == 0.0 and load.drag == 0.0:
        return tether.length
    more = tether.length - strand_length(tether.strand, len(tether.strand))
    return float(payout_of(tether.strand, len(tether.strand), load) + (1.0 + load.slack) * more)


def turning(tether: Tether, delta: float) -> float:
    """Sum of the angles by which a tether turns at its contacts.

    Parameters
    ----------
    tether : Tether
        The taut tether.
    delta : float
        Resolution of its model, metres.

    Returns
    -------
    float
        Radians.
    """
    return float(turning_of(tether.strand, len(tether.strand), SHORT * delta))


def payout_along(line: npt.ArrayLike, load: Load) -> float:
    """The same for a taut line whose corners all rest on something.

    Parameters
    ----------
    line : array_like, shape (k, 3)
        Its corners, metres.
    load : Load
        What acts on it.

    Returns
    -------
    float
        Metres.
    """
    steps = np.diff(np.asarray(line, dtype=float), axis=0)
    chords = np.linalg.norm(steps, axis=1)
    spans = (span_length(c, x, y, z, load) for c, (x, y, z) in zip(chords, steps, strict=True))
    return (1.0 + load.slack) * float(sum(spans))


def pull_on_robot(
    tether: Tether, load: Load, friction: float, velocity: Floats, delta: float
) -> Floats:
    """The force of a tether on the robot at its end: tension at the anchor, grown by friction at
    contacts, along the last span, and half of the drag on that span.

    A lumped model: the span's shape and its inertia are left out.

    Parameters
    ----------
    tether : Tether
        The taut tether.
    load : Load
        What acts on it.
    friction : float
        Coefficient of friction at contacts.
    velocity : ndarray, shape (3,)
        Of the robot, m/s: half of it is that of the span.
    delta : float
        Resolution of the tether's model, metres.

    Returns
    -------
    ndarray, shape (3,)
        N.
    """
    resting = [i for i in range(len(tether.strand) - 1) if i == 0 or rests(tether.strand, i)]
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

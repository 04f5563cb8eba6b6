"""Exact length of a taut path among disks, from the corners of a path around polygons.

The taut path around inscribed polygons has corners. Consecutive corners on one disk that turn in
one direction are one contact with the disk. Contacts in a given order and sense determine a chain
of common tangents and arcs, whose length has a closed form. If an arc runs backwards, its contact
is an artefact of the polygon and is removed. If a tangent enters another disk, which the polygon
allows, that disk becomes a contact. Once neither happens, the chain is the taut path among the
disks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Floats
from netsp.judge.judge_policy import JudgePolicy

TURN_TOLERANCE = 1e-9
"""Tolerance for an arc that runs backwards, radians."""


@dataclass(frozen=True)
class Contact:
    """Disk that a path bends around: centre, radius and sense, in the problem's units.

    Attributes
    ----------
    sense
        1 if the disk is on the left of the path, -1 if it is on the right.
    turn
        Approximate angle by which the path turns, radians.
    """

    x: float
    y: float
    radius: float
    sense: int
    turn: float


def contacts_of(corners: Floats, disk_of: list[tuple[float, float, float]]) -> list[Contact]:
    """Return the contacts of a polyline whose inner corners lie on given disks (x, y, radius)."""
    out: list[Contact] = []
    d = np.diff(corners, axis=0)
    keep = np.hypot(*d.T) > 0.0
    heading = np.arctan2(d[:, 1], d[:, 0])
    before = None
    for k in range(len(d)):
        if not keep[k]:
            continue
        if before is not None:
            turn = math.remainder(heading[k] - before, 2.0 * math.pi)
            x, y, r = disk_of[k - 1]
            sense = 1 if turn > 0.0 else -1
            last = out[-1] if out else None
            if last and (last.x, last.y, last.sense) == (x, y, sense):
                out[-1] = Contact(x, y, r, sense, last.turn + abs(turn))
            elif turn != 0.0:
                out.append(Contact(x, y, r, sense, abs(turn)))
        before = heading[k]
    return out


def exact_length(
    a: Floats,
    b: Floats,
    contacts: list[Contact],
    disks: Floats,
    slack: float,
    max_changes: int = JudgePolicy.max_contact_changes,
) -> tuple[float, float] | None:
    """Return the length of the taut path from a to b among disks, and its total turning, radians.

    Return None if no consistent contacts are found after `max_changes` changes.

    Parameters
    ----------
    contacts
        First guess of the contacts.
    disks
        (d, 3) x, y, radius.
    slack
        Depth up to which a tangent may enter a disk.
    """
    chain = list(contacts)
    for _ in range(max_changes):
        nodes = [(a[0], a[1], 0.0, 0), *((c.x, c.y, c.radius, c.sense) for c in chain)]
        nodes.append((b[0], b[1], 0.0, 0))
        legs = [_tangent(p, q) for p, q in pairwise(nodes)]
        length = sum(leg[1] for leg in legs)
        backward, worst = -1, -TURN_TOLERANCE
        turns = []
        for k, c in enumerate(chain):
            raw = c.sense * (legs[k + 1][0] - legs[k][0])
            turn = raw + 2.0 * math.pi * round((c.turn - raw) / (2.0 * math.pi))
            turns.append(turn)
            if turn < worst:
                backward, worst = k, turn
        if backward >= 0:
            del chain[backward]
            continue
        entered = _entered(a, chain, legs, disks, slack)
        if entered is None:
            arcs = sum(c.radius * t for c, t in zip(chain, turns, strict=True))
            return length + arcs, sum(turns)
        index, contact = entered
        chain = [Contact(c.x, c.y, c.radius, c.sense, t) for c, t in zip(chain, turns, strict=True)]
        chain.insert(index, contact)
    return None


def _tangent(
    p: tuple[float, float, float, int], q: tuple[float, float, float, int]
) -> tuple[float, float]:
    """Return the heading and length of the common tangent of two oriented disks.

    With n the left normal of the tangent, it touches disk i at c_i - s_i r_i n, so
    (c_2 - c_1) · n = s_2 r_2 - s_1 r_1.
    """
    dx, dy = q[0] - p[0], q[1] - p[1]
    d = math.hypot(dx, dy)
    off = q[3] * q[2] - p[3] * p[2]
    if d <= abs(off):  # a point on a boundary, or disks that touch from inside
        return math.atan2(dy, dx) - math.copysign(0.5 * math.pi, off) if d else 0.0, 0.0
    return math.atan2(dy, dx) - math.asin(off / d), math.sqrt((d - off) * (d + off))


def _entered(
    a: Floats, chain: list[Contact], legs: list[tuple[float, float]], disks: Floats, slack: float
) -> tuple[int, Contact] | None:
    """Return where in the chain to insert the disk that a tangent enters deepest, and its
    contact."""
    if len(disks) == 0:
        return None
    deepest, found = slack, None
    for k, (heading, length) in enumerate(legs):
        ux, uy = math.cos(heading), math.sin(heading)
        if k == 0:
            x, y = float(a[0]), float(a[1])
        else:
            c = chain[k - 1]
            x, y = c.x + c.sense * c.radius * uy, c.y - c.sense * c.radius * ux
        dx, dy = disks[:, 0] - x, disks[:, 1] - y
        along = dx * ux + dy * uy
        side = dy * ux - dx * uy  # > 0: the centre is on the left
        depth = np.where((along > 0.0) & (along < length), disks[:, 2] - np.abs(side), -np.inf)
        for j in (k - 1, k):  # the two disks that the tangent touches
            if 0 <= j < len(chain):
                is_touched = (disks[:, 0] == chain[j].x) & (disks[:, 1] == chain[j].y)
                depth[is_touched] = -np.inf
        i = int(np.argmax(depth))
        if depth[i] > deepest:
            deepest = float(depth[i])
            sense = 1 if side[i] > 0.0 else -1
            cx, cy, r = disks[i].tolist()
            found = k, Contact(cx, cy, r, sense, 0.0)
    return found

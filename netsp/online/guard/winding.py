"""Loops of a taut tether in space.

In the plane a tether that meets itself wraps something (`netsp.online.guard.loops`). In space it
passes itself at some distance, however often it wraps a bar. So a piece of the
tether counts as a loop if it turns by more than half a circle (a closed curve turns by a whole one:
Fenchel 1929), comes back near to where it began, in sight of it, and stays there when it is closed
and pulled taut. This includes loops around bodies with free ends, which have no words.
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.online.guard.guard_policy import LoopPolicy, SitePolicy
from netsp.online.guard.site import Loop
from netsp.world.scene.field import DistanceField
from netsp.world.tether import GeodesicTether


def space_loops_in(
    field: DistanceField, model: GeodesicTether, nodes: Floats, policy: SitePolicy
) -> list[Loop]:
    """Return the loops of a taut tether, the last to be closed first.

    Each is around other solids than those before. `nodes`, shape (n, 3), begin at the anchor.
    """
    points, turned = _dense(nodes, policy.loops.sample_spacing)
    found: list[Loop] = []
    end = len(points)
    while end > 2:
        loop, at = _last_loop(field, model, points[:end], turned[:end], policy)
        if loop is None or at is None:
            break
        if all(loop.around != other.around for other in found):
            found.append(loop)
        end = at + 1  # what is left is the tether up to where that loop begins
    return found


def space_loop_closed_by(
    field: DistanceField, model: GeodesicTether, nodes: Floats, place: Floats, policy: SitePolicy
) -> Loop | None:
    """Return the loop that a robot closes by moving straight to a place; None if none.

    `nodes`, shape (n, 3), are those of the taut tether to the robot, m.
    """
    points, turned = _dense(np.vstack([nodes, place]), policy.loops.sample_spacing)
    begins = _returns(points, turned, len(points) - 1, policy.loops)
    for i in begins[::-1]:
        loop = _loop_of_piece(field, model, points[i:], policy)
        if loop is not None:
            return loop
    return None


def _dense(nodes: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Return places along a tether, shape (k, 3), and the angle turned up to each, rad."""
    steps = np.diff(nodes, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    nodes = np.vstack([nodes[:1], nodes[1:][lengths > 1e-9]])
    steps, lengths = steps[lengths > 1e-9], lengths[lengths > 1e-9]
    if not len(steps):
        return nodes, np.zeros(1)
    ahead = steps / lengths[:, None]
    cosine = np.clip((ahead[:-1] * ahead[1:]).sum(1), -1.0, 1.0)
    turned = np.concatenate([[0.0], np.cumsum(np.arccos(cosine))])
    points, at = [nodes[:1]], [np.zeros(1)]
    for a, b, turn, length in zip(nodes[:-1], nodes[1:], turned, lengths, strict=True):
        share = np.linspace(0.0, 1.0, math.ceil(length / spacing) + 1)[1:, None]
        points.append(a + share * (b - a))
        at.append(np.full(len(share), turn))
    return np.vstack(points), np.concatenate(at)


def _returns(points: Floats, turned: Floats, end: int, policy: LoopPolicy) -> np.ndarray:
    """Return the indices of places that a tether comes back to at place `end`, after a turn."""
    turn = turned[end] - turned[:end]
    far = np.linalg.norm(points[:end] - points[end], axis=1)
    steps = np.linalg.norm(np.diff(points[: end + 1], axis=0), axis=1)
    between = np.cumsum(steps[::-1])[::-1]
    is_closed = far <= np.maximum(policy.max_gap, policy.max_gap_share * between)
    # of places in a row, the nearest
    inner = np.r_[np.inf, far, np.inf]
    is_nearest = (far <= inner[:-2]) & (far <= inner[2:])
    return np.flatnonzero((turn >= policy.min_turn) & is_closed & is_nearest)


def _last_loop(
    field: DistanceField, model: GeodesicTether, points: Floats, turned: Floats, policy: SitePolicy
) -> tuple[Loop | None, int | None]:
    """Return the last loop, and the index of the place where it begins."""
    if turned[-1] < policy.loops.min_turn:
        return None, None
    for end in range(len(points) - 1, 1, -1):
        for i in _returns(points, turned, end, policy.loops)[::-1]:
            loop = _loop_of_piece(field, model, points[i : end + 1], policy)
            if loop is not None:
                return loop, int(i)
        if turned[end] < policy.loops.min_turn:
            break
    return None, None


def _loop_of_piece(
    field: DistanceField, model: GeodesicTether, piece: Floats, policy: SitePolicy
) -> Loop | None:
    """Return a piece of tether as a loop; None if it could be pulled out."""
    if not field.line_of_sight(piece[0], piece[-1], 0.2 * model.delta):
        return None
    closed = np.vstack([piece, piece[:1]])
    tether = model.relaxed(closed, policy.relax_rounds)
    if tether.length <= policy.loops.max_gap:
        return None
    middle = polylines.dense(tether.nodes, 0.5 * model.delta)
    touching = field.distance(middle) <= policy.contact_share * model.delta
    around = tuple(sorted({int(k) for k in field.nearest(middle[touching])}))
    return Loop(around, closed) if around else None

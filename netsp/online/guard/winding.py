"""Loops of a taut tether in space.

In the plane a tether that meets itself is wound around something (`netsp.online.guard.loops`). In
space it passes itself at some distance, however often it is wound around a bar. So what counts as a
loop is a piece of the tether that comes back near to where it began, in sight of it, after turning
by more than half a circle (a closed curve turns by a whole one: Fenchel 1929), and that stays where
it is when it is closed and pulled taut. That takes in bodies with free ends, too, of which words
know nothing.
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.online.guard.site import ROUNDS, Loop
from netsp.world.scene.field import DistanceField
from netsp.world.tether import GeodesicTether

NEAR, SHARE = 0.25, 0.15
"""Metres between its ends at which a piece of tether counts as closed, or that share of its length:
a robot that goes round a pile passes its own tether above or below."""

TURN = 1.1 * math.pi
"""Radians that a loop turns by, at least: more than a tether that comes back beside itself."""

STEP = 0.2
"""Metres between the places of a tether that are looked at."""

TOUCHING = 0.1
"""Of delta: nearer to a solid than that, a tether rests on it."""


def loops_of(field: DistanceField, model: GeodesicTether, nodes: Floats) -> list[Loop]:
    """The loops that a taut tether has.

    Parameters
    ----------
    field : DistanceField
        The scene.
    model : GeodesicTether
        The tether's.
    nodes : ndarray, shape (n, 3)
        Taut, from the anchor on, metres.

    Returns
    -------
    list of Loop
        The last to be closed first; each around other solids than those before.
    """
    points, turned = _dense(nodes)
    found: list[Loop] = []
    end = len(points)
    while end > 2:
        loop, at = _last_loop(field, model, points[:end], turned[:end])
        if loop is None or at is None:
            break
        if all(loop.around != other.around for other in found):
            found.append(loop)
        end = at + 1  # what is left is the tether up to where that loop begins
    return found


def closing(
    field: DistanceField, model: GeodesicTether, nodes: Floats, there: Floats
) -> Loop | None:
    """The loop that a robot closes by going straight to a place.

    Parameters
    ----------
    field : DistanceField
        The scene.
    model : GeodesicTether
        The tether's.
    nodes : ndarray, shape (n, 3)
        Taut, to where the robot is, metres.
    there : ndarray, shape (3,)
        Where it goes, metres.

    Returns
    -------
    Loop or None
        None where it closes none that is not closed already.
    """
    points, turned = _dense(np.vstack([nodes, there]))
    begins = _near(points, turned, len(points) - 1)
    for i in begins[::-1]:
        loop = _wound(field, model, points[i:])
        if loop is not None:
            return loop
    return None


def _dense(nodes: Floats) -> tuple[Floats, Floats]:
    """(k, 3) places along a tether, and (k,) radians that it has turned by up to each."""
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
        share = np.linspace(0.0, 1.0, math.ceil(length / STEP) + 1)[1:, None]
        points.append(a + share * (b - a))
        at.append(np.full(len(share), turn))
    return np.vstack(points), np.concatenate(at)


def _near(points: Floats, turned: Floats, end: int) -> np.ndarray:
    """Places that a tether comes back to at one of its places, after half a circle or more."""
    turn = turned[end] - turned[:end]
    far = np.linalg.norm(points[:end] - points[end], axis=1)
    steps = np.linalg.norm(np.diff(points[: end + 1], axis=0), axis=1)
    between = np.cumsum(steps[::-1])[::-1]
    near = (turn >= TURN) & (far <= np.maximum(NEAR, SHARE * between))
    # of places in a row, the nearest
    inner = np.r_[np.inf, far, np.inf]
    least = (far <= inner[:-2]) & (far <= inner[2:])
    return np.flatnonzero(near & least)


def _last_loop(
    field: DistanceField, model: GeodesicTether, points: Floats, turned: Floats
) -> tuple[Loop | None, int | None]:
    if turned[-1] < TURN:
        return None, None
    for end in range(len(points) - 1, 1, -1):
        for i in _near(points, turned, end)[::-1]:
            loop = _wound(field, model, points[i : end + 1])
            if loop is not None:
                return loop, int(i)
        if turned[end] < TURN:
            break
    return None, None


def _wound(field: DistanceField, model: GeodesicTether, piece: Floats) -> Loop | None:
    """A piece of tether as a loop; None where it could be pulled out."""
    if not field.line_of_sight(piece[0], piece[-1], 0.2 * model.delta):
        return None
    closed = np.vstack([piece, piece[:1]])
    tether = model.relaxed(closed, ROUNDS)
    if tether.length <= NEAR:
        return None
    middle = polylines.dense(tether.nodes, 0.5 * model.delta)
    touching = field.distance(middle) <= TOUCHING * model.delta
    around = tuple(sorted({int(k) for k in field.nearest(middle[touching])}))
    return Loop(around, closed) if around else None

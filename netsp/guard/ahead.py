"""What the present motion leads to: a tether that is too short, or a loop.

The robot goes on as it goes: straight, and where its course has been turning, in that circle, along
obstacles that it would run into. The tether is driven along (0.1 ms a step), so that what comes off
a corner on the way has come off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.arrays import Floats
from netsp.guard.site import Loop, Site
from netsp.guard.track import MOVING, Motion
from netsp.online.scene.field import pushed_out
from netsp.online.tether import Tether

HORIZON_S = 40.0
"""Seconds that are looked ahead."""

STEPS = 40
"""In them."""

TURNING = 0.06
"""Radians per second: slower turns are those of noise."""

ORBIT, TANGENT, NEAR = 0.4, 0.75, 10.0
"""A robot goes round an obstacle if it is no farther from it than so many metres, moves at right
angles to it (share of its speed), and turns at the rate of such a circle, give or take that share.
Where it is tells the circle better than how fast it turns."""


@dataclass(frozen=True)
class Ahead:
    """What going on leads to.

    Parameters
    ----------
    loop_s : float or None
        Seconds until a loop closes; None within the horizon.
    loop : Loop or None
        That loop.
    short_s : float or None
        Seconds until the tether is longer than it may be; None within the horizon.
    turning : bool
        Whether it takes a turn that goes on for that, which is less sure than to go straight on.
    """

    loop_s: float | None = None
    loop: Loop | None = None
    short_s: float | None = None
    turning: bool = False


def look_ahead(
    site: Site, tether: Tether, motion: Motion, speed: float
) -> Ahead:  # fmt: skip
    """Where the present motion leads.

    Parameters
    ----------
    site : Site
        Where.
    tether : Tether
        As it is.
    motion : Motion
        Of the robot.
    speed : float
        Its fastest, m/s: slower than a tenth of it, it is at rest.

    Returns
    -------
    Ahead
        The sooner of what straight on and turning on lead to.
    """
    pace = float(np.linalg.norm(motion.velocity[:2]))
    if pace < MOVING * speed:
        return Ahead()
    turns = [0.0] if abs(motion.turn) < TURNING else [0.0, motion.turn]
    turns += _orbits(site.centres, tether.robot[:2], motion)
    found = [_along(site, tether, motion.velocity, turn) for turn in turns]
    loops = [(a.loop_s, k) for k, a in enumerate(found) if a.loop_s is not None]
    shorts = [a.short_s for a in found if a.short_s is not None]
    first = min(loops, default=None)
    return Ahead(
        None if first is None else first[0],
        None if first is None else found[first[1]].loop,
        min(shorts, default=None),
        first is not None and first[1] > 0,
    )


def _orbits(centres: Floats, place: Floats, motion: Motion) -> list[float]:
    """Rates of turning, of the circles about obstacles that the robot may be on."""
    pace = float(np.hypot(*motion.velocity[:2]))
    out = []
    for x, y in centres:
        away = place - (x, y)
        far = float(np.hypot(*away))
        if not 1e-6 < far < NEAR:
            continue
        across = float(away[0] * motion.velocity[1] - away[1] * motion.velocity[0]) / far
        rate = math.copysign(pace / far, across)
        turns_so = ORBIT <= motion.turn / rate <= 1.0 / ORBIT
        if abs(across) >= TANGENT * pace and turns_so:
            out.append(rate)
    return out


def _along(site: Site, tether: Tether, velocity: Floats, turn: float) -> Ahead:
    dt = HORIZON_S / STEPS
    place, course = tether.robot.copy(), velocity.copy()
    most = abs(turn) * HORIZON_S
    if most > 2.0 * math.pi:
        dt *= 2.0 * math.pi / most  # once around is enough
    c, s = math.cos(turn * dt), math.sin(turn * dt)
    short = None
    for k in range(1, STEPS + 1):
        course[:2] = (c * course[0] - s * course[1], s * course[0] + c * course[1])
        there = pushed_out(site.field, (place + dt * course)[None], 1e-3)[0]
        loop = site.closed_by(tether.nodes, there)
        if loop is not None:
            return Ahead(k * dt, loop, short)
        if not site.field.line_of_sight(place, there, depth=0.2 * site.model.delta):
            break  # it has run into something, or between obstacles that overlap
        tether = site.model.update(tether, there)
        if short is None and tether.length > site.tether_length:
            short = k * dt
        if float(np.linalg.norm(there - place)) < 0.1 * dt * float(np.linalg.norm(velocity)):
            break
        place = there
    return Ahead(None, None, short)

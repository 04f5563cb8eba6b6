"""What the present motion leads to: a tether that is too short, or a loop.

The robot goes on as it goes: straight, and where its course has been turning, in that circle, along
obstacles that it would run into. The tether is driven along (0.1 ms a step), so that what comes off
a corner on the way has come off; but for stretches of open water, of which is known at once that
nothing happens there.
"""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.online.guard.position_track import MOVING, Motion
from netsp.online.guard.site import Loop, Site
from netsp.world.scene.field import pushed_out
from netsp.world.tether import Tether

HORIZON_S, TURN_HORIZON_S = 36.0, 30.0
"""Seconds that are looked ahead, straight on and turning on: a bit farther than what is spoken of
(`netsp.online.guard.reasons`)."""

STEP_S, STEP_ANGLE = 1.0, 0.5
"""Seconds, about, and radians at most, between two places on the way."""

SURFACE = 1e-3
"""Metres off an obstacle, at least, that places on the way are, and more where the way turns, so
that the straight step between two goes past it, too."""

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


class Look:
    """Where the present motion leads, found out a few steps at a time: all at once would take
    longer than there is between two estimates.

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
    closed : set of tuple of int
        What loops that are closed already are around: ways that come to one lead to none.
    """

    def __init__(
        self, site: Site, tether: Tether, motion: Motion, speed: float,
        closed: Set[tuple[int, ...]] = frozenset(),
    ) -> None:  # fmt: skip
        self.site, self.velocity, self.closed = site, motion.velocity, closed
        pace = float(np.linalg.norm(motion.velocity[:2]))
        courses: list[tuple[Floats, float]] = []
        if pace >= MOVING * speed:
            turns = [0.0] if abs(motion.turn) < TURNING else [0.0, motion.turn]
            courses = [(motion.velocity, turn) for turn in turns]
            courses += _orbits(site.centres, tether.robot[:2], motion)
        self._ways = [_Way(tether, velocity, turn) for velocity, turn in courses]

    def go_on(self, steps: int) -> int:
        """Look a bit farther.

        Parameters
        ----------
        steps : int
            At most.

        Returns
        -------
        int
            Steps that are left of those: more than 0 when all is found out.
        """
        for way in self._ways:
            while steps > 0 and not way.done:
                way.step(self.site)
                steps -= 1
        return steps

    @property
    def done(self) -> bool:
        """Whether all is found out."""
        return all(way.done for way in self._ways)

    @property
    def ahead(self) -> Ahead:
        """The sooner of what straight on and turning on lead to, as far as it is found out."""
        loops = [
            (w.loop_s, k) for k, w in enumerate(self._ways)
            if w.loop_s is not None and w.loop is not None and w.loop.around not in self.closed
        ]  # fmt: skip
        shorts = [w.short_s for w in self._ways if w.short_s is not None]
        first = min(loops, default=None)
        return Ahead(
            None if first is None else first[0],
            None if first is None else self._ways[first[1]].loop,
            min(shorts, default=None),
            first is not None and first[1] > 0,
        )


def _orbits(centres: Floats, place: Floats, motion: Motion) -> list[tuple[Floats, float]]:
    """Velocities, and rates of turning, of the circles about obstacles that the robot may be on."""
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
            velocity = motion.velocity.copy()
            velocity[:2] = rate * np.array([-away[1], away[0]])
            out.append((velocity, rate))
    return out


class _Way:
    """One way on: straight, or turning at a rate (radians per second)."""

    def __init__(self, tether: Tether, velocity: Floats, turn: float) -> None:
        horizon = TURN_HORIZON_S if turn else HORIZON_S
        if abs(turn) * horizon > 2.0 * math.pi:
            horizon = 2.0 * math.pi / abs(turn)  # once around is enough
        self._steps = math.ceil(max(horizon / STEP_S, abs(turn) * horizon / STEP_ANGLE))
        self._dt = horizon / self._steps
        pace = float(np.linalg.norm(velocity[:2]))
        bulge = pace / abs(turn) * (1.0 - math.cos(0.5 * turn * self._dt)) if turn else 0.0
        self._margin = SURFACE + 1.2 * bulge
        c, s = math.cos(turn * self._dt), math.sin(turn * self._dt)
        rotation = np.array([[c, -s], [s, c]])
        self._least = 0.1 * self._dt * np.linalg.norm(velocity)
        courses = np.empty((self._steps + 1, 3))
        courses[:] = velocity
        for k in range(self._steps):
            courses[k + 1, :2] = rotation @ courses[k, :2]
        # where each step leads, from where the robot is
        self._offsets = self._dt * (np.cumsum(courses, axis=0) - velocity)
        self._tether, self._k = tether, 0
        self.loop_s: float | None = None
        self.loop: Loop | None = None
        self.short_s: float | None = None
        self.done = False

    def step(self, site: Site) -> None:
        place, k = self._tether.robot, self._k
        places = place + self._offsets[k + 1 :] - self._offsets[k]
        leap = site.leap(self._tether, places)
        if leap == len(places):
            self.done = True
            return
        if leap > 1:
            self._tether, self._k = site.ahead.update(self._tether, places[leap - 1]), k + leap
            return
        self._k += 1
        there = pushed_out(site.field, places[:1], self._margin)[0]
        self.loop = site.closed_by(self._tether.nodes, there)
        if self.loop is not None:
            self.loop_s, self.done = self._k * self._dt, True
            return
        stopped = float(np.linalg.norm(there - place)) < self._least
        # it has run into something, or between obstacles that overlap
        if stopped or not site.field.line_of_sight(place, there, depth=0.2 * site.model.delta):
            self.done = True
            return
        self._tether = site.ahead.update(self._tether, there)
        if self.short_s is None and self._tether.length > site.tether_length:
            self.short_s = self._k * self._dt
        self.done = self._k == self._steps


__all__ = ["Ahead", "Look"]

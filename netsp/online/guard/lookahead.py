"""Lookahead: whether the current motion leads to a lack of tether, or to a loop.

The robot is assumed to go straight on, in a circle at its present turn rate, or around an obstacle
that it circles, and to slide along obstacles in its way. The tether model follows it (0.1 ms a
step), so contacts may come off. Steps in open water, where nothing can happen, are skipped.
"""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.online.guard.guard_policy import LookaheadPolicy
from netsp.online.guard.position_track import Motion
from netsp.online.guard.site import Loop, Site
from netsp.world.scene.field import pushed_out
from netsp.world.tether import Tether


@dataclass(frozen=True)
class LookaheadResult:
    """Result of a look ahead.

    Attributes
    ----------
    loop_s
        Time until a loop closes, s; None within the horizon.
    loop
        Loop that closes.
    short_s
        Time until the tether is too short, s; None within the horizon.
    is_turning
        Whether the loop closes on a turning course, which is less sure than a straight one.
    """

    loop_s: float | None = None
    loop: Loop | None = None
    short_s: float | None = None
    is_turning: bool = False


class Lookahead:
    """Lookahead along the current motion, in steps over several updates.

    All steps together would take longer than the time between two estimates.

    Parameters
    ----------
    site : Site
        The site.
    tether : Tether
        Current tether.
    motion : Motion
        Motion of the robot.
    min_speed : float
        Speed below which the robot is at rest, m/s.
    closed : set of tuple of int
        Obstacles of each loop that is closed already; courses to such a loop do not count.
    policy : LookaheadPolicy
        Horizons and steps.
    """

    def __init__(
        self,
        site: Site,
        tether: Tether,
        motion: Motion,
        min_speed: float,
        closed: Set[tuple[int, ...]] = frozenset(),
        policy: LookaheadPolicy = LookaheadPolicy(),
    ) -> None:
        self.site, self.velocity, self.closed = site, motion.velocity, closed
        courses: list[tuple[Floats, float]] = []
        if float(np.linalg.norm(motion.velocity[:2])) >= min_speed:
            is_straight = abs(motion.turn) < policy.min_turn_rate
            turns = [0.0] if is_straight else [0.0, motion.turn]
            courses = [(motion.velocity, turn) for turn in turns]
            courses += _orbits(site.centres, tether.robot[:2], motion, policy)
        self._courses = [_Course(tether, velocity, turn, policy) for velocity, turn in courses]

    def advance(self, max_steps: int) -> int:
        """Simulate up to `max_steps` steps, and return how many were not needed."""
        for course in self._courses:
            while max_steps > 0 and not course.is_done:
                course.step(self.site)
                max_steps -= 1
        return max_steps

    @property
    def is_done(self) -> bool:
        """Return whether all courses are followed to their end."""
        return all(course.is_done for course in self._courses)

    @property
    def result(self) -> LookaheadResult:
        """Return the first event on the courses, as far as they have been followed."""
        loops = [
            (c.loop_s, k)
            for k, c in enumerate(self._courses)
            if c.loop_s is not None and c.loop is not None and c.loop.around not in self.closed
        ]
        shorts = [c.short_s for c in self._courses if c.short_s is not None]
        first = min(loops, default=None)
        return LookaheadResult(
            None if first is None else first[0],
            None if first is None else self._courses[first[1]].loop,
            min(shorts, default=None),
            first is not None and first[1] > 0,
        )


def _orbits(
    centres: Floats, place: Floats, motion: Motion, policy: LookaheadPolicy
) -> list[tuple[Floats, float]]:
    """Return velocity and turn rate of the circles about obstacles that the robot may be on."""
    pace = float(np.hypot(*motion.velocity[:2]))
    out = []
    for x, y in centres:
        away = place - (x, y)
        far = float(np.hypot(*away))
        if not 1e-6 < far < policy.max_orbit_radius:
            continue
        across = float(away[0] * motion.velocity[1] - away[1] * motion.velocity[0]) / far
        rate = math.copysign(pace / far, across)
        ratio = policy.min_orbit_ratio
        is_circling = ratio <= motion.turn / rate <= 1.0 / ratio
        if abs(across) >= policy.min_orbit_tangency * pace and is_circling:
            velocity = motion.velocity.copy()
            velocity[:2] = rate * np.array([-away[1], away[0]])
            out.append((velocity, rate))
    return out


class _Course:
    """Course that the robot may take: straight, or turning at a rate, rad/s."""

    def __init__(
        self, tether: Tether, velocity: Floats, turn: float, policy: LookaheadPolicy
    ) -> None:
        horizon = policy.turn_horizon_s if turn else policy.horizon_s
        if abs(turn) * horizon > 2.0 * math.pi:
            horizon = 2.0 * math.pi / abs(turn)  # once around is enough
        angle_steps = abs(turn) * horizon / policy.max_step_angle
        self._steps = math.ceil(max(horizon / policy.step_s, angle_steps))
        self._dt = horizon / self._steps
        pace = float(np.linalg.norm(velocity[:2]))
        bulge = pace / abs(turn) * (1.0 - math.cos(0.5 * turn * self._dt)) if turn else 0.0
        self._margin = policy.surface_distance + 1.2 * bulge
        c, s = math.cos(turn * self._dt), math.sin(turn * self._dt)
        rotation = np.array([[c, -s], [s, c]])
        self._min_step = 0.1 * self._dt * np.linalg.norm(velocity)
        courses = np.empty((self._steps + 1, 3))
        courses[:] = velocity
        for k in range(self._steps):
            courses[k + 1, :2] = rotation @ courses[k, :2]
        # offset of each place from the robot
        self._offsets = self._dt * (np.cumsum(courses, axis=0) - velocity)
        self._tether, self._k = tether, 0
        self.loop_s: float | None = None
        self.loop: Loop | None = None
        self.short_s: float | None = None
        self.is_done = False

    def step(self, site: Site) -> None:
        """Move the tether one step along the course, or several through free water."""
        place, k = self._tether.robot, self._k
        places = place + self._offsets[k + 1 :] - self._offsets[k]
        count = site.safe_prefix(self._tether, places)
        if count == len(places):
            self.is_done = True
            return
        if count > 1:
            end = places[count - 1]
            self._tether, self._k = site.lookahead_model.update(self._tether, end), k + count
            return
        self._k += 1
        end = pushed_out(site.field, places[:1], self._margin)[0]
        self.loop = site.loop_closed_by(self._tether.nodes, end)
        if self.loop is not None:
            self.loop_s, self.is_done = self._k * self._dt, True
            return
        is_stuck = float(np.linalg.norm(end - place)) < self._min_step
        # it has run into something, or between obstacles that overlap
        if is_stuck or not site.field.line_of_sight(place, end, depth=0.2 * site.model.delta):
            self.is_done = True
            return
        self._tether = site.lookahead_model.update(self._tether, end)
        if self.short_s is None and self._tether.length > site.tether_length:
            self.short_s = self._k * self._dt
        self.is_done = self._k == self._steps


__all__ = ["Lookahead", "LookaheadResult"]

"""From position estimates to motion: what is noise, what is a gap, what is a jump.

A Kalman filter of constant velocity smooths the estimates (white accelerations; e.g. Bar-Shalom,
Li & Kirubarajan 2001, section 6.2). What it must not smooth is told apart before: after a gap, a
freeze or a jump the robot may have gone any way there is.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.online.guard.frozen_position import FrozenPosition
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.velocities import NOISE, Velocities

ACCELERATION = 0.15
"""m/s²: standard deviation of what a work-class or smaller vehicle does between two estimates."""

GAP = 2.0
"""Seconds without an estimate that are one."""

MOVING = 0.1
"""Share of the full speed below which a robot counts as at rest."""

JUMPED = "the position jumped"
"""Reason of a motion that no robot can have made."""

RESTART_S = 10.0
"""Seconds that a vehicle takes to start anew, at least."""

PLAN, DEPTH = range(2)
AXES = (slice(0, 2), slice(2, 3))
"""What is filtered alike: velocities are learned of in the plan alone."""

ODD = 4.0
"""Deviations from what is expected beyond which a velocity is not learned of."""

TURN_SPAN, SHORT_SPAN = 3.0, 2.0
"""Seconds: courses over two spans in a row tell how fast the robot turns; the second where its
velocity is known, too."""


@dataclass(frozen=True)
class Motion:
    """How the robot got to where it is.

    Parameters
    ----------
    time : float
        Seconds.
    before : ndarray, shape (3,)
        Where it was, smoothed, metres.
    after : ndarray, shape (3,)
        Where it is.
    velocity : ndarray, shape (3,)
        m/s.
    turn : float
        Radians per second, counter-clockwise; 0 where it is not known.
    lost_s : float
        Seconds for which nobody knows where it went; 0 for most.
    reason : str
        What happened then.
    """

    time: float
    before: Floats
    after: Floats
    velocity: Floats
    turn: float
    lost_s: float = 0.0
    reason: str = ""


class Track:
    """Smooths estimates, and says where they cannot be believed.

    Parameters
    ----------
    noise : float
        Standard deviation of one estimate, metres.
    speed : float
        Fastest speed of the robot, m/s.
    """

    def __init__(self, noise: float, speed: float) -> None:
        self.noise, self.speed = max(noise, 1e-3), speed
        self.velocities = Velocities(self.noise, speed)
        self.time: float | None = None
        self.freeze = FrozenPosition(speed)
        self._state = np.zeros((2, 3))
        self._spread = np.zeros((2, 2, 2))
        self._doubt_since: float | None = None
        self._past: deque[tuple[float, Floats]] = deque()

    @property
    def frozen(self) -> bool:
        """Return whether estimates repeat while the robot moves."""
        return self.freeze.is_frozen

    @property
    def here(self) -> Floats:
        """(3,) where the robot is, smoothed, metres."""
        return np.array(self._state[0])

    @property
    def velocity(self) -> Floats:
        """(3,) m/s."""
        return np.array(self._state[1])

    def begin(self, time: float, position: Floats) -> None:
        """Begin at a place, at rest.

        Parameters
        ----------
        time : float
            Seconds.
        position : ndarray, shape (3,)
            Metres.
        """
        self.time = time
        self.freeze.begin(time, position)
        self._state = np.array([position, np.zeros(3)])
        self._spread = np.array([np.diag([self.noise**2, self.speed**2])] * 2)
        self._past = deque([(time, position.copy())])
        self.velocities.begin()
        self._doubt_since = None

    def shift(self, seconds: float) -> None:
        """The vehicle's clock was set.

        Parameters
        ----------
        seconds : float
            That it is ahead of what it was.
        """
        if self.time is not None:
            self.time += seconds - RESTART_S
        if self._doubt_since is not None:
            self._doubt_since += seconds - RESTART_S

    def lose(self, time: float) -> None:
        """The vehicle does not vouch for its estimates any more.

        Parameters
        ----------
        time : float
            Since when, seconds.
        """
        if self._doubt_since is None:
            self._doubt_since = time

    def silence(self, now: float) -> float:
        """Seconds since the last estimate that could be believed.

        Parameters
        ----------
        now : float
            Seconds.

        Returns
        -------
        float
            Seconds.
        """
        since = self.time if self._doubt_since is None else self._doubt_since
        return 0.0 if since is None else max(0.0, now - since)

    def take(self, fix: Fix) -> Motion | None:
        """One more estimate.

        Parameters
        ----------
        fix : Fix
            With a position.

        Returns
        -------
        Motion or None
            What the robot did; None for an estimate that is older than the last, or frozen.
        """
        assert fix.position is not None
        position = np.array(fix.position, dtype=float)
        if self.time is None:
            self.begin(fix.time, position)
            return Motion(fix.time, position, position, np.zeros(3), 0.0)
        dt = fix.time - self.time
        if dt <= 0.0:
            return None
        speed = float(np.linalg.norm(self._state[1]))
        if self.freeze.take(fix.time, position, fix.velocity, speed):
            self.lose(self.freeze.since)
            return None
        before = self.here
        far = float(np.linalg.norm(position - before - self._state[1] * dt))
        # what noise of four deviations and a robot at full speed cannot explain
        most = self.speed * dt + 4.0 * math.sqrt(3.0) * self.noise + 0.5
        lost_s, reason = 0.0, ""
        if self._doubt_since is not None:
            lost_s, reason = fix.time - self._doubt_since, "the estimate was lost"
        elif dt > GAP:
            lost_s, reason = dt, "no position came"
        elif far > most:
            lost_s, reason = dt, JUMPED
        if lost_s:
            self.begin(fix.time, position)
            return Motion(fix.time, before, position, np.zeros(3), 0.0, lost_s, reason)
        self._predict(dt)
        for part in (PLAN, DEPTH):
            self._learn(part, 0, position[AXES[part]], self.noise)
        if fix.velocity is None:
            self.velocities.note_none(fix.time)
        else:
            self._learn_velocity(fix.time, position[:2], np.array(fix.velocity[:2], dtype=float))
        self.time = fix.time
        self._past.append((fix.time, self.here))
        while len(self._past) > 2 and fix.time - self._past[1][0] >= 2.0 * TURN_SPAN:
            self._past.popleft()
        return Motion(fix.time, before, self.here, self.velocity, self._turn())

    def _predict(self, dt: float) -> None:
        step = np.array([[1.0, dt], [0.0, 1.0]])
        shake = ACCELERATION**2 * np.array([[dt**4 / 4.0, dt**3 / 2.0], [dt**3 / 2.0, dt**2]])
        self._state = step @ self._state
        self._spread = step @ self._spread @ step.T + shake * (1.0 / max(dt, 0.1))

    def _learn(self, part: int, k: int, told: Floats, noise: float) -> None:
        """Of the place (k = 0) or the velocity (1), in the plan or in depth."""
        spread, axes = self._spread[part], AXES[part]
        gain = spread[:, k] / (spread[k, k] + noise**2)
        self._state[:, axes] += np.outer(gain, told - self._state[k, axes])
        self._spread[part] = spread - np.outer(gain, spread[k])

    def _learn_velocity(self, time: float, place: Floats, velocity: Floats) -> None:
        """Of one that the robot can have, if such ones are believed; a single one that is far from
        what is expected is as likely an error of the link."""
        velocities = self.velocities
        if not velocities.possible(velocity):
            velocities.note_none(time)
            return
        velocities.take(time, place, velocity)
        off = float(np.abs(velocity - self._state[1, :2]).max())
        odd = off > ODD * math.hypot(math.sqrt(self._spread[PLAN, 1, 1]), NOISE)
        if velocities.believed and not odd:
            self._learn(PLAN, 1, velocity, NOISE)

    def _turn(self) -> float:
        """How fast the course changes, over twice the span; 0 where the robot went too little to
        have one."""
        span = SHORT_SPAN if self.velocities.believed else TURN_SPAN
        now, here = self._past[-1]
        times = np.array([t for t, _ in self._past])
        begin = int(np.searchsorted(times, now - 2.0 * span, side="right")) - 1
        start = self._past[max(begin, 0)]
        if now - start[0] < 1.8 * span:
            return 0.0
        k = int(np.searchsorted(times, now - span))
        middle = self._past[k][1]
        first, second = (middle - start[1])[:2], (here - middle)[:2]
        least = max(0.3, 2.0 * self.noise) * self.speed * span
        if min(np.hypot(*first), np.hypot(*second)) < min(least, 0.5 * self.speed * span):
            return 0.0
        cross = float(first[0] * second[1] - first[1] * second[0])
        return math.atan2(cross, float(first @ second)) / span

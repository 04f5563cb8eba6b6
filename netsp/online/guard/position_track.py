"""Track of a robot: from position estimates to motion.

A Kalman filter of constant velocity smooths the estimates (white accelerations; e.g. Bar-Shalom,
Li & Kirubarajan 2001, section 6.2). Dropouts, freezes and jumps are recognized before, because
after them the robot may have moved along any path.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.online.guard.frozen_position import FrozenPosition
from netsp.online.guard.guard_policy import TrackPolicy
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.velocities import VelocityCheck

JUMPED = "the position jumped"
"""Reason of a motion that no robot can have made."""

PLAN, DEPTH = range(2)
AXES = (slice(0, 2), slice(2, 3))
"""Axes of the two filters. Velocities correct the one in the plan only."""


@dataclass(frozen=True)
class Motion:
    """Motion of the robot between two estimates.

    Attributes
    ----------
    time
        Time, s.
    before, after
        Smoothed positions before and now, shape (3,), m.
    velocity
        Velocity, shape (3,), m/s.
    turn
        Turn rate, rad/s, counter-clockwise; 0 if unknown.
    lost_s
        Time for which the path is unknown, s; 0 as a rule.
    reason
        Reason why it is unknown.
    """

    time: float
    before: Floats
    after: Floats
    velocity: Floats
    turn: float
    lost_s: float = 0.0
    reason: str = ""


class Track:
    """Track of a robot, smoothed, with the times at which its estimates cannot be believed.

    Parameters
    ----------
    noise : float
        Standard deviation of one estimate, m.
    speed : float
        Full speed of the robot, m/s.
    policy : TrackPolicy
        Limits.
    """

    def __init__(self, noise: float, speed: float, policy: TrackPolicy = TrackPolicy()) -> None:
        self.noise, self.speed, self.policy = max(noise, 1e-3), speed, policy
        self.velocities = VelocityCheck(self.noise, speed, policy.velocity)
        self.time: float | None = None
        self.freeze = FrozenPosition(speed, policy.freeze)
        self._state = np.zeros((2, 3))
        self._spread = np.zeros((2, 2, 2))
        self._doubt_since: float | None = None
        self._past: deque[tuple[float, Floats]] = deque()

    @property
    def is_frozen(self) -> bool:
        """Return whether estimates repeat while the robot moves."""
        return self.freeze.is_frozen

    @property
    def position(self) -> Floats:
        """Return the smoothed position, shape (3,), m."""
        return np.array(self._state[0])

    @property
    def velocity(self) -> Floats:
        """Return the velocity, shape (3,), m/s."""
        return np.array(self._state[1])

    def begin(self, time: float, position: Floats) -> None:
        """Begin at a position, shape (3,), at rest."""
        self.time = time
        self.freeze.begin(time, position)
        self._state = np.array([position, np.zeros(3)])
        self._spread = np.array([np.diag([self.noise**2, self.speed**2])] * 2)
        self._past = deque([(time, position.copy())])
        self.velocities.reset()
        self._doubt_since = None

    def shift_clock(self, seconds: float) -> None:
        """Shift the times of the track by which the vehicle's clock was set ahead, s."""
        if self.time is not None:
            self.time += seconds - self.policy.restart_s
        if self._doubt_since is not None:
            self._doubt_since += seconds - self.policy.restart_s

    def invalidate(self, time: float) -> None:
        """Note the time from which on the vehicle does not vouch for its estimates."""
        if self._doubt_since is None:
            self._doubt_since = time

    def silence_s(self, now: float) -> float:
        """Return the time since the last estimate that could be believed, s."""
        since = self.time if self._doubt_since is None else self._doubt_since
        return 0.0 if since is None else max(0.0, now - since)

    def observe(self, fix: Fix) -> Motion | None:
        """Return the motion to the position of a fix; None if it is not newer than the last one, or
        frozen."""
        assert fix.position is not None
        position = np.array(fix.position, dtype=float)
        if self.time is None:
            self.begin(fix.time, position)
            return Motion(fix.time, position, position, np.zeros(3), 0.0)
        dt = fix.time - self.time
        if dt <= 0.0:
            return None
        speed = float(np.linalg.norm(self._state[1]))
        if self.freeze.observe(fix.time, position, fix.velocity, speed):
            self.invalidate(self.freeze.since)
            return None
        before = self.position
        far = float(np.linalg.norm(position - before - self._state[1] * dt))
        # what noise of four deviations and a robot at full speed cannot explain
        max_far = self.speed * dt + 4.0 * math.sqrt(3.0) * self.noise + 0.5
        lost_s, reason = 0.0, ""
        if self._doubt_since is not None:
            lost_s, reason = fix.time - self._doubt_since, "the estimate was lost"
        elif dt > self.policy.dropout_s:
            lost_s, reason = dt, "no position came"
        elif far > max_far:
            lost_s, reason = dt, JUMPED
        if lost_s:
            self.begin(fix.time, position)
            return Motion(fix.time, before, position, np.zeros(3), 0.0, lost_s, reason)
        self._predict(dt)
        for part in (PLAN, DEPTH):
            self._correct(part, 0, position[AXES[part]], self.noise)
        if fix.velocity is None:
            self.velocities.note_missing(fix.time)
        else:
            self._correct_velocity(fix.time, position[:2], np.array(fix.velocity[:2], dtype=float))
        self.time = fix.time
        self._past.append((fix.time, self.position))
        span = self.policy.turn_span_s
        while len(self._past) > 2 and fix.time - self._past[1][0] >= 2.0 * span:
            self._past.popleft()
        return Motion(fix.time, before, self.position, self.velocity, self._turn_rate())

    def _predict(self, dt: float) -> None:
        step = np.array([[1.0, dt], [0.0, 1.0]])
        acceleration = self.policy.acceleration
        shake = acceleration**2 * np.array([[dt**4 / 4.0, dt**3 / 2.0], [dt**3 / 2.0, dt**2]])
        self._state = step @ self._state
        self._spread = step @ self._spread @ step.T + shake * (1.0 / max(dt, 0.1))

    def _correct(self, part: int, k: int, measured: Floats, noise: float) -> None:
        """Correct the position (k = 0) or velocity (k = 1) in the plan or in depth."""
        spread, axes = self._spread[part], AXES[part]
        gain = spread[:, k] / (spread[k, k] + noise**2)
        self._state[:, axes] += np.outer(gain, measured - self._state[k, axes])
        self._spread[part] = spread - np.outer(gain, spread[k])

    def _correct_velocity(self, time: float, place: Floats, velocity: Floats) -> None:
        """Correct the velocity by a reported one that is possible, believed and near the expected
        one."""
        velocities, noise = self.velocities, self.policy.velocity.noise
        if not velocities.is_possible(velocity):
            velocities.note_missing(time)
            return
        velocities.observe(time, place, velocity)
        off = float(np.abs(velocity - self._state[1, :2]).max())
        deviation = math.hypot(math.sqrt(self._spread[PLAN, 1, 1]), noise)
        is_odd = off > self.policy.max_velocity_deviations * deviation
        if velocities.is_believed and not is_odd:
            self._correct(PLAN, 1, velocity, noise)

    def _turn_rate(self) -> float:
        """Return the turn rate over two spans, rad/s; 0 if the robot moved too little to have a
        course."""
        policy = self.policy
        span = policy.short_turn_span_s if self.velocities.is_believed else policy.turn_span_s
        now, end = self._past[-1]
        times = np.array([t for t, _ in self._past])
        begin = int(np.searchsorted(times, now - 2.0 * span, side="right")) - 1
        start = self._past[max(begin, 0)]
        if now - start[0] < 1.8 * span:
            return 0.0
        k = int(np.searchsorted(times, now - span))
        middle = self._past[k][1]
        first, second = (middle - start[1])[:2], (end - middle)[:2]
        min_travel = max(0.3, 2.0 * self.noise) * self.speed * span
        if min(np.hypot(*first), np.hypot(*second)) < min(min_travel, 0.5 * self.speed * span):
            return 0.0
        cross = float(first[0] * second[1] - first[1] * second[0])
        return math.atan2(cross, float(first @ second)) / span

"""Check of the velocities that a vehicle reports against its positions.

Between two moments the position must have changed by the sum of the velocities. Some vehicles
report
0 at any speed, so velocities count only once a robot that travelled some distance has moved as
reported. The check is in the plan only: depth is known from pressure.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from netsp.base.arrays import Floats
from netsp.online.guard.guard_policy import VelocityPolicy


class VelocityCheck:
    """Check whether a vehicle's velocities agree with its positions.

    Parameters
    ----------
    noise : float
        Standard deviation of one position, m.
    speed : float
        Full speed of the robot, m/s.
    policy : VelocityPolicy
        Limits.

    Attributes
    ----------
    is_believed : bool
        Whether velocities have agreed with positions, and still do.
    """

    def __init__(
        self, noise: float, speed: float, policy: VelocityPolicy = VelocityPolicy()
    ) -> None:
        self.noise, self.speed, self.policy = noise, speed, policy
        self.is_believed = False
        self._past: deque[tuple[float, Floats, Floats]] = deque()

    def reset(self) -> None:
        """Forget the past, and believe no velocity until it proves itself again."""
        self._past.clear()
        self.is_believed = False

    def is_possible(self, velocity: Floats) -> bool:
        """Return whether the robot can have a velocity, m/s, of shape (2,)."""
        policy = self.policy
        speed = float(np.linalg.norm(velocity))
        return speed <= policy.max_speed_factor * self.speed + 4.0 * policy.noise

    def note_missing(self, time: float) -> None:
        """Note that a position came without a velocity."""
        if self._past and time - self._past[-1][0] > self.policy.max_pause_s:
            self.reset()

    def observe(self, time: float, position: Floats, velocity: Floats) -> None:
        """Compare one more position, m, and velocity, m/s, each of shape (2,), with the past."""
        self.note_missing(time)
        policy, past, gone = self.policy, self._past, np.zeros(2)
        if past:
            before, _, gone = past[-1]
            gone = gone + (time - before) * velocity
        past.append((time, position, gone))
        while len(past) > 2 and time - past[1][0] >= policy.span_s + policy.averaging_s:
            past.popleft()
        if time - past[0][0] < policy.span_s + 0.8 * policy.averaging_s:
            return
        first = [(p, g) for t, p, g in past if t <= past[0][0] + policy.averaging_s]
        last = [(p, g) for t, p, g in past if t >= time - policy.averaging_s]
        went, reported = np.mean(last, axis=0) - np.mean(first, axis=0)
        off, travelled = float(np.linalg.norm(went - reported)), float(np.linalg.norm(went))
        noise = self.noise * math.sqrt(1.0 / len(first) + 1.0 / len(last))
        max_off = 4.0 * noise + policy.max_error_share * self.speed * policy.span_s
        longer = max(travelled, float(np.linalg.norm(reported)))
        min_distance = policy.min_noise_deviations * noise
        if off > max_off or off > max(policy.max_mismatch * longer, min_distance):
            self.is_believed = False
        elif off <= policy.max_mismatch * min(max_off, travelled):
            enough = max(policy.min_travel_share * self.speed * policy.span_s, min_distance)
            self.is_believed = self.is_believed or travelled >= enough

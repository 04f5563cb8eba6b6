"""Frozen positions: estimates that keep coming but do not change while the robot moves.

Estimates of a filter that works change in their last digits even at rest. Rounded ones repeat at
rest, and so do exact ones of a simulation. So repetition alone is no evidence: velocities must
show that the robot moves, or it must have stopped faster than a robot can.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import Point3


@dataclass(frozen=True)
class FreezePolicy:
    """Policy that tells a frozen position from a robot at rest.

    Attributes
    ----------
    min_repeat_s
        Shortest time for which a position must repeat, s. Positive.
    min_said_m
        Distance that the reported velocities must add up to meanwhile, m; at rest they add up to
        less, even with noise. Positive.
    dead_stop_s
        Time for which a position must repeat after the robot moved if no velocity tells whether it
        still does, s. Positive.
    moving_share
        Share of the full speed above which the robot moved before. Positive.
    stopping_share
        Share of the full speed from which no robot stops between two estimates. Positive.
    max_periods
        Number of usual periods between changes after which a position is late: those of slow
        sensors repeat in between. 1 or more.
    max_period_s
        Longest time between two changes that counts as a period of the sensor, s. Positive.
    """

    min_repeat_s: float = 1.0
    min_said_m: float = 0.25
    dead_stop_s: float = 3.0
    moving_share: float = 0.1
    stopping_share: float = 0.3
    max_periods: float = 3.0
    max_period_s: float = 5.0

    def __post_init__(self) -> None:
        for name in (
            "min_repeat_s", "min_said_m", "dead_stop_s", "moving_share", "stopping_share",
            "max_period_s",
        ):  # fmt: skip
            if not getattr(self, name) > 0.0:
                raise InputError(f"{name}: expected more than 0, got {getattr(self, name)!r}")
        if not self.max_periods >= 1.0:
            raise InputError(f"max_periods: expected 1 or more, got {self.max_periods!r}")


FORGETTING = 0.9
"""Share of the past in running averages, and of the longest period, after one more estimate."""

ALIVE = 0.5
"""Share of recent velocities that differed from the one before, above which repetition of the
velocity is evidence of a freeze: simulations without noise repeat it on straight lines."""


class FrozenPosition:
    """Detector of positions that repeat while the robot moves.

    Parameters
    ----------
    speed : float
        Full speed of the robot, m/s.
    policy : FreezePolicy, optional
        Policy that tells a freeze from rest.

    Attributes
    ----------
    is_frozen : bool
        True while the position is frozen.
    since : float
        Time from which on the position repeats, s.

    Examples
    --------
    >>> freeze = FrozenPosition(0.5)
    >>> place, velocity = np.array([3.0, 2.0, -1.0]), (0.5, 0.0, 0.0)
    >>> freeze.begin(0.0, place)
    >>> [freeze.take(0.2 * k, place, velocity, 0.5) for k in (1, 4, 5)]
    [False, False, True]
    """

    def __init__(self, speed: float, policy: FreezePolicy | None = None) -> None:
        self.speed, self.policy = speed, policy or FreezePolicy()
        self.is_frozen = False
        self.since = 0.0
        self._last: Floats | None = None
        self._time = self._plan_since = self._still_since = 0.0
        self._period = self._alive = 0.0
        self._said = np.zeros(2)
        self._velocity: Point3 | None = None
        self._was_moving = self._was_fast = self._differs = self._has_stopped = False

    def begin(self, time: float, place: Floats) -> None:
        """Begin at a place, at rest; the period of the sensor is kept.

        Parameters
        ----------
        time : float
            Time of the estimate, s.
        place : ndarray, shape (3,)
            Position, metres.
        """
        self.is_frozen = self._was_moving = self._was_fast = self._differs = False
        self._last, self._said, self._velocity = place, np.zeros(2), None
        self._time = self._plan_since = self._still_since = self.since = time

    def take(self, time: float, place: Floats, velocity: Point3 | None, speed: float) -> bool:
        """Take an estimate, and return whether the position is frozen.

        Parameters
        ----------
        time : float
            Time of the estimate, s; later than the one before.
        place : ndarray, shape (3,)
            Position, metres.
        velocity : (vx, vy, vz) or None
            Velocity that the vehicle reports, m/s.
        speed : float
            Smoothed speed before this estimate, m/s.

        Returns
        -------
        bool
            True while the position is frozen.
        """
        p, dt, before = self.policy, time - self._time, self._last
        self._time, self._last = time, place
        is_still = before is not None and bool(np.array_equal(place, before))
        is_still_in_plan = before is not None and bool(np.array_equal(place[:2], before[:2]))
        if not is_still_in_plan:
            self._note_change(time, speed)
        elif velocity is not None:
            self._said = self._said + dt * np.array(velocity[:2])
        has_changed = velocity is not None and velocity != self._velocity
        if not is_still:
            self._alive = FORGETTING * self._alive + (1.0 - FORGETTING) * has_changed
            self._was_moving = speed > p.moving_share * self.speed
            self._was_fast = (
                velocity is not None
                and math.hypot(*velocity[:2]) > p.stopping_share * self.speed
            )  # fmt: skip
            self._still_since, self._differs, self._has_stopped = time, False, False
        elif self._has_stopped:
            self._differs |= has_changed
        else:
            self._has_stopped = True  # the first repetition may differ from the last motion
        self._velocity = velocity
        late = p.max_periods * self._period
        if float(np.hypot(*self._said)) >= p.min_said_m and (
            time - self._plan_since >= max(p.min_repeat_s, late)
        ):
            self.is_frozen, self.since = True, self._plan_since
            return True
        is_stuck = self._was_fast and self._alive > ALIVE
        enough = p.min_repeat_s if is_stuck else p.dead_stop_s
        has_stopped_dead = is_still and self._was_moving and not self._differs
        self.is_frozen = has_stopped_dead and time - self._still_since >= max(enough, late)
        self.since = self._still_since
        return self.is_frozen

    def _note_change(self, time: float, speed: float) -> None:
        """Note that the position has changed in the plan, and learn the period of the sensor."""
        p, lasted = self.policy, time - self._plan_since
        has_moved = speed > p.moving_share * self.speed or (
            float(np.hypot(*self._said)) >= p.min_said_m
        )
        is_period = has_moved and lasted <= p.max_period_s
        self._period = max(FORGETTING * self._period, lasted if is_period else 0.0)
        self._plan_since, self._said = time, np.zeros(2)


__all__ = ["FreezePolicy", "FrozenPosition"]

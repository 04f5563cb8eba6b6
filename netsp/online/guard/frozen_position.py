"""Frozen positions: estimates that keep coming but do not change while the robot moves.

Estimates of a filter that works change in their last digits even at rest. Rounded ones repeat at
rest, and so do exact ones of a simulation. So repetition alone is no evidence: velocities must
show that the robot moves, it must have stopped faster than a robot can, or it must have a target
that is elsewhere. `FrozenPosition` is for a guard, which does not know where the robot is sent;
`FrozenFlight` is for a flight, which sends the targets.
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.field_types import Point3
from netsp.online.guard.guard_policy import FreezePolicy

PARTS = {"plan": slice(0, 2), "depth": slice(2, 3), "all": slice(0, 3)}
"""Coordinates that may freeze by themselves: latitude and longitude, depth, or all three."""


class _Repetition:
    """Times since which parts of a position have been the same to the last bit.

    Attributes
    ----------
    place : ndarray or None
        Last position, shape (3,), m.
    since : dict of str to float
        Time since which each of `PARTS` has been the same, s.
    changed : dict of str to float
        Time of the last change of each of `PARTS`, s; minus infinity before the first.
    """

    def __init__(self) -> None:
        self.place: Floats | None = None
        self.since = dict.fromkeys(PARTS, -math.inf)
        self.changed = dict.fromkeys(PARTS, -math.inf)

    def begin(self, time: float, place: Floats) -> None:
        """Begin at a position."""
        self.place = place
        self.since = dict.fromkeys(PARTS, time)
        self.changed = dict.fromkeys(PARTS, -math.inf)

    def observe(self, time: float, place: Floats) -> set[str]:
        """Return the names of the parts that are the same as before."""
        if self.place is None:
            self.begin(time, place)
            return set()
        same = {name for name, p in PARTS.items() if np.array_equal(place[p], self.place[p])}
        for name in PARTS:
            if name not in same:
                self.since[name] = self.changed[name] = time
        self.place = place
        return same


class FrozenPosition:
    """Detector of positions that repeat while the robot moves.

    Parameters
    ----------
    speed : float
        Full speed of the robot, m/s.
    policy : FreezePolicy
        Limits.

    Attributes
    ----------
    is_frozen : bool
        Whether the position is frozen.
    since : float
        Time from which on the position repeats, s.

    Examples
    --------
    >>> freeze = FrozenPosition(0.5)
    >>> place, velocity = np.array([3.0, 2.0, -1.0]), (0.5, 0.0, 0.0)
    >>> freeze.begin(0.0, place)
    >>> [freeze.observe(0.2 * k, place, velocity, 0.5) for k in (1, 4, 5)]
    [False, False, True]
    """

    def __init__(self, speed: float, policy: FreezePolicy = FreezePolicy()) -> None:
        self.speed, self.policy = speed, policy
        self.is_frozen = False
        self.since = 0.0
        self._repetition = _Repetition()
        self._time = 0.0
        self._period = self._changing_share = 0.0
        self._travelled = np.zeros(2)
        self._velocity: Point3 | None = None
        self._was_moving = self._was_fast = self._differs = self._has_stopped = False

    def begin(self, time: float, place: Floats) -> None:
        """Begin at a position, at rest; the period of the sensor is kept."""
        self.is_frozen = self._was_moving = self._was_fast = self._differs = False
        self._repetition.begin(time, place)
        self._travelled, self._velocity = np.zeros(2), None
        self._time = self.since = time

    def observe(self, time: float, place: Floats, velocity: Point3 | None, speed: float) -> bool:
        """Observe an estimate, and return whether the position is frozen.

        Parameters
        ----------
        time : float
            Time of the estimate, s; later than the one before.
        place : ndarray, shape (3,)
            Position, m.
        velocity : (vx, vy, vz) or None
            Velocity that the vehicle reports, m/s.
        speed : float
            Smoothed speed before this estimate, m/s.
        """
        p, dt = self.policy, time - self._time
        self._time = time
        since_before = self._repetition.since["plan"]
        same = self._repetition.observe(time, place)
        is_still = "all" in same
        if "plan" not in same:
            self._note_change(time - since_before, speed)
        elif velocity is not None:
            self._travelled = self._travelled + dt * np.array(velocity[:2])
        has_changed = velocity is not None and velocity != self._velocity
        if not is_still:
            self._changing_share = p.memory * self._changing_share + (1.0 - p.memory) * has_changed
            self._was_moving = speed > p.moving_share * self.speed
            limit = p.stopping_share * self.speed
            self._was_fast = velocity is not None and math.hypot(*velocity[:2]) > limit
            self._differs, self._has_stopped = False, False
        elif self._has_stopped:
            self._differs |= has_changed
        else:
            self._has_stopped = True  # the first repetition may differ from the last motion
        self._velocity = velocity
        late_s = p.max_periods * self._period
        since = self._repetition.since
        if float(np.hypot(*self._travelled)) >= p.min_reported_travel and (
            time - since["plan"] >= max(p.min_repeat_s, late_s)
        ):
            self.is_frozen, self.since = True, since["plan"]
            return True
        is_stuck = self._was_fast and self._changing_share > p.min_changing_share
        enough_s = p.min_repeat_s if is_stuck else p.dead_stop_s
        has_stopped_dead = is_still and self._was_moving and not self._differs
        self.is_frozen = has_stopped_dead and time - since["all"] >= max(enough_s, late_s)
        self.since = since["all"]
        return self.is_frozen

    def _note_change(self, lasted_s: float, speed: float) -> None:
        """Note that the position has changed in the plan, and learn the period of the sensor."""
        p = self.policy
        has_moved = speed > p.moving_share * self.speed or (
            float(np.hypot(*self._travelled)) >= p.min_reported_travel
        )
        is_period = has_moved and lasted_s <= p.max_period_s
        self._period = max(p.memory * self._period, lasted_s if is_period else 0.0)
        self._travelled = np.zeros(2)


class FrozenFlight:
    """Detector of positions that repeat while the vehicle moves or has a target to reach.

    A vehicle that waits at its target may hold still to the last bit, as simulators without noise
    do. Times are by the vehicle's clock.

    Parameters
    ----------
    policy : FreezePolicy
        Limits.
    """

    def __init__(self, policy: FreezePolicy = FreezePolicy()) -> None:
        self.policy = policy
        self._repetition = _Repetition()
        self._slow_until = {"plan": -math.inf, "depth": -math.inf}

    def observe(self, time: float, place: Floats, velocity: Floats | None) -> None:
        """Observe a position, m, and the velocity that came with it, m/s, each of shape (3,)."""
        self._repetition.observe(time, place.copy())
        for name in self._slow_until:
            speed = 0.0 if velocity is None else float(np.linalg.norm(velocity[PARTS[name]]))
            if not speed > self.policy.min_moving_speed:
                self._slow_until[name] = time

    def fault(
        self, time: float, target: Floats, sent: float, reach: float, target_wait_s: float
    ) -> str | None:
        """Return what shows that the position is frozen; None if nothing does.

        Parameters
        ----------
        time : float
            Time now, s.
        target : ndarray, shape (3,)
            Target that the vehicle was sent, m.
        sent : float
            Time when it was sent first, s.
        reach : float
            Distance from its target within which the vehicle may wait, m.
        target_wait_s : float
            Time that the vehicle may wait longer if its position has not changed since, s: it may
            have missed the target.
        """
        place, since, max_repeat_s = (
            self._repetition.place,
            self._repetition.since,
            self.policy.max_repeat_s,
        )
        if place is None:
            return None
        for name, what in (("plan", "position"), ("depth", "depth")):
            if time - max(since[name], self._slow_until[name]) > max_repeat_s:
                return (
                    f"its {what} is the same for {time - since[name]:.1f} s, though it says "
                    f"that it moves"
                )
        away = target - place
        far, flat = float(np.linalg.norm(away)), float(np.linalg.norm(away[PARTS["plan"]]))
        is_away = {
            "plan": flat > reach and flat > self.policy.min_plan_share * far,
            "all": far > reach,
        }
        for name in is_away:
            wait_s = 0.0 if self._repetition.changed[name] > sent else target_wait_s
            if is_away[name] and time - max(since[name], sent) > max_repeat_s + wait_s:
                return (
                    f"its position is the same for {time - since[name]:.1f} s, though its target "
                    f"is {far:.1f} m away"
                )
        return None


__all__ = ["FrozenFlight", "FrozenPosition"]

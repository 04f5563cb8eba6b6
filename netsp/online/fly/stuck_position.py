"""Positions that go on coming and never change: an estimate that hangs, or sensors that are stuck.

The vehicle goes on as it did last and is nowhere near where it says it is, but nothing else tells:
messages come in time, and the filter vouches for them.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.online.fly.flight_policy import FlightPolicy

PLAN, DEPTH, ALL = slice(0, 2), slice(2, 3), slice(0, 3)
"""Coordinates that may be stuck by themselves: latitude and longitude, depth, or all three."""


class StuckPosition:
    """Detector of positions that do not change while the vehicle moves or has a target to reach.

    A vehicle that waits at its target may hold still to the last bit, as simulators without noise
    do. Times are by the vehicle's clock.

    Parameters
    ----------
    policy : FlightPolicy
        Limits.
    """

    def __init__(self, policy: FlightPolicy) -> None:
        self.policy = policy
        self._place: Floats | None = None
        self._since = dict.fromkeys(("plan", "depth", "all"), -np.inf)
        self._moved = self._since.copy()
        self._slow_until = {"plan": -np.inf, "depth": -np.inf}

    def take(self, place: Floats, velocity: Floats | None, time: float) -> None:
        """Take a position that came.

        Parameters
        ----------
        place : ndarray, shape (3,)
            Position, metres.
        velocity : ndarray, shape (3,), or None
            Velocity that came with it, m/s.
        time : float
            Time, s.
        """
        for name, part in (("plan", PLAN), ("depth", DEPTH), ("all", ALL)):
            if self._place is None:
                self._since[name] = time
            elif not np.array_equal(place[part], self._place[part]):
                self._since[name] = self._moved[name] = time
        for name, part in (("plan", PLAN), ("depth", DEPTH)):
            speed = 0.0 if velocity is None else float(np.linalg.norm(velocity[part]))
            if not speed > self.policy.min_frozen_speed:
                self._slow_until[name] = time
        self._place = place.copy()

    def fault(self, time: float, target: Floats, sent: float, reach: float, is_echoed: bool,
              ) -> str | None:  # fmt: skip
        """Return what shows that the position is frozen; None if nothing does.

        Parameters
        ----------
        time : float
            Time now, s.
        target : ndarray, shape (3,)
            Target that the vehicle was sent, metres.
        sent : float
            Time when it was sent first, s.
        reach : float
            Distance from its target within which the vehicle may wait, metres.
        is_echoed : bool
            Whether the vehicle says that it has this target.
        """
        if self._place is None:
            return None
        for name, what in (("plan", "position"), ("depth", "depth")):
            still = time - max(self._since[name], self._slow_until[name])
            if still > self.policy.max_frozen_s:
                return (
                    f"its {what} is the same for {time - self._since[name]:.1f} s, though it says "
                    f"that it moves"
                )
        left = target - self._place
        far, flat = float(np.linalg.norm(left)), float(np.linalg.norm(left[PLAN]))
        for name, is_away in (
            ("plan", flat > reach and flat > self.policy.min_plan_share * far), ("all", far > reach)
        ):  # fmt: skip
            since = self._since[name]
            # a target that got lost is sent again; a vehicle without it may wait
            has_target = is_echoed or self._moved[name] > sent
            waits = 0.0 if has_target else self.policy.resend_s
            if is_away and time - max(since, sent) > self.policy.max_frozen_s + waits:
                return (
                    f"its position is the same for {time - since:.1f} s, though its target is "
                    f"{far:.1f} m away"
                )
        return None

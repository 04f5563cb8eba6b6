"""Corridor of a leg: the places that a vehicle may pass on its path to a vertex.

A vehicle that gets a new target under way does not turn at once. It comes to rest beyond the bend
and flies straight to the target from there. It is off the leg by its stopping distance at first,
and less and less towards the target. A vehicle that begins at rest, or flies straight on, is on the
leg.
"""

from __future__ import annotations

import numpy as np
import shapely

from netsp.base.arrays import Floats
from netsp.online.fly.flight_policy import FlightPolicy


class LegCorridor:
    """Triangle of a leg and the place where the vehicle stops before it follows the leg.

    Until the vehicle comes back towards the leg, that is the farthest place where it may stop;
    then
    it is the vehicle's place that was farthest from the leg.

    Parameters
    ----------
    begin : ndarray, shape (3,)
        Place of the vehicle when it got its target, m.
    velocity : ndarray, shape (3,)
        Velocity of the vehicle at that time, m/s.
    end : ndarray, shape (3,)
        Target, m.
    policy : FlightPolicy
        Limits.
    """

    def __init__(self, begin: Floats, velocity: Floats, end: Floats, policy: FlightPolicy) -> None:
        self.policy = policy
        self._begin, self._end = begin.copy(), end.copy()
        speed = float(np.linalg.norm(velocity))
        stopping_distance = min(speed, policy.max_speed) * policy.stopping_s
        self._stop = begin + velocity * (stopping_distance / speed if speed > 0.0 else 0.0)
        self._stopping_distance = stopping_distance
        away = end - begin
        length = float(np.linalg.norm(away))
        self._along = away / length if length > 0.0 else np.zeros(3)
        self._is_turning = stopping_distance > 0.0 and length > 0.0
        self._farthest, self._max_off = self._begin, 0.0
        self._update_plan()

    def _update_plan(self) -> None:
        corners = np.array([self._begin, self._stop, self._end])
        self._plan = shapely.MultiPoint(corners[:, :2]).convex_hull

    def _off(self, place: Floats) -> float:
        """Return the distance of a place from the line of the leg, m."""
        away = place - self._begin
        return float(np.linalg.norm(away - (away @ self._along) * self._along))

    def observe(self, place: Floats) -> None:
        """Observe a position of the vehicle, shape (3,), m.

        The corridor shrinks once the vehicle comes back towards the leg, or is well along it.
        """
        if not self._is_turning:
            return
        off = self._off(place)
        if off > self._max_off:
            self._farthest, self._max_off = place.copy(), off
        has_turned = self._max_off - off > self.policy.min_return
        is_along = float((place - self._begin) @ self._along) > self._stopping_distance
        if has_turned or is_along:
            self._is_turning = False
            if self._max_off < self._off(self._stop):
                self._stop = self._farthest
            self._update_plan()

    def distance(self, place: Floats) -> float:
        """Return the distance of a place from the corridor in the plan, m."""
        return float(self._plan.distance(shapely.Point(place[:2])))

    def depth_error(self, place: Floats) -> tuple[float, str]:
        """Return the distance of a place from the depths of the corridor, m, and "above" or
        "below"."""
        depths = self._begin[2], self._stop[2], self._end[2]
        above, below = float(place[2] - max(depths)), float(min(depths) - place[2])
        return (above, "above") if above > below else (below, "below")

"""Corridor of a leg: where a vehicle may be that is on its way to a vertex.

A vehicle that gets a new target under way does not turn at once. It comes to a stop beyond the bend
and flies straight on from there, so that it is off the leg by what it took to stop, and ever less
towards the vertex. A vehicle that begins at rest, or goes straight on, is on the leg itself.
"""

from __future__ import annotations

import numpy as np
import shapely

from netsp.base.arrays import Floats
from netsp.online.fly.flight_policy import FlightPolicy


class LegCorridor:
    """Triangle of a leg and the place where the vehicle stops before it goes along the leg.

    Until the vehicle comes back towards the leg, that place is the farthest where it may stop; then
    it is where the vehicle was farthest from the leg.

    Parameters
    ----------
    begin : ndarray, shape (3,)
        Place of the vehicle when it got its target, metres.
    velocity : ndarray, shape (3,)
        Velocity of the vehicle at that time, m/s.
    end : ndarray, shape (3,)
        Target, metres.
    policy : FlightPolicy
        Limits.
    """

    def __init__(self, begin: Floats, velocity: Floats, end: Floats, policy: FlightPolicy) -> None:
        self.policy = policy
        self._begin, self._end = begin.copy(), end.copy()
        speed = float(np.linalg.norm(velocity))
        most = min(speed, policy.max_speed) * policy.stopping_s
        self._stop = begin + velocity * (most / speed if speed > 0.0 else 0.0)
        self._stopping_way = most
        away = end - begin
        length = float(np.linalg.norm(away))
        self._along = away / length if length > 0.0 else np.zeros(3)
        self._is_turning = most > 0.0 and length > 0.0
        self._farthest, self._max_off = self._begin, 0.0
        self._draw()

    def _draw(self) -> None:
        corners = np.array([self._begin, self._stop, self._end])
        self._plan = shapely.MultiPoint(corners[:, :2]).convex_hull

    def _off(self, place: Floats) -> float:
        """Return the distance of a place from the line of the leg, metres."""
        away = place - self._begin
        return float(np.linalg.norm(away - (away @ self._along) * self._along))

    def take(self, place: Floats) -> None:
        """Take a position of the vehicle: once it comes back towards the leg, or is well along it,
        the corridor shrinks.

        Parameters
        ----------
        place : ndarray, shape (3,)
            Position, metres.
        """
        if not self._is_turning:
            return
        off = self._off(place)
        if off > self._max_off:
            self._farthest, self._max_off = place.copy(), off
        is_back = self._max_off - off > self.policy.min_return
        is_along = float((place - self._begin) @ self._along) > self._stopping_way
        if is_back or is_along:
            self._is_turning = False
            if self._max_off < self._off(self._stop):
                self._stop = self._farthest
            self._draw()

    def distance(self, place: Floats) -> float:
        """Return the distance of a place from the corridor in the plan, metres."""
        return float(self._plan.distance(shapely.Point(place[:2])))

    def depth_error(self, place: Floats) -> tuple[float, str]:
        """Return the distance of a place from the depths of the corridor, metres, and whether it is
        above or below them."""
        depths = self._begin[2], self._stop[2], self._end[2]
        above, below = float(place[2] - max(depths)), float(min(depths) - place[2])
        return (above, "above") if above > below else (below, "below")

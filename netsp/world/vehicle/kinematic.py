"""Protocol of simulated vehicles, and the kinematic vehicle, which follows paths exactly."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from netsp.base.arrays import Floats
from netsp.world.vehicle.vehicle_policy import VehiclePolicy


class Vehicle(Protocol):
    """Robot that follows paths.

    Attributes
    ----------
    position : ndarray, shape (3,)
        Position, metres.
    yaw : float
        Heading, rad.
    control_s : list of float
        Computing time of each control step, s.
    """

    control_s: list[float]

    @property
    def position(self) -> Floats:
        """Position (3,), metres."""

    @property
    def yaw(self) -> float:
        """Heading, rad."""

    def go(
        self,
        path: Floats,
        seconds: float,
        yaw: float,
        water: Floats,
        fresh: bool,
        pull: Floats | None = None,
    ) -> tuple[list[Floats], int]:
        """Follow a path for some seconds, turning to a heading, in moving water.

        Parameters
        ----------
        path : ndarray, shape (k, 3)
            Points to pass, metres.
        yaw : float
            Heading, rad.
        water : ndarray, shape (3,)
            Velocity of the water, m/s.
        fresh : bool
            Whether the path does not continue the one before.
        pull : ndarray, shape (3,), optional
            Force of the tether, N; only passed if the mission asks for it.

        Returns
        -------
        points : list of ndarray
            Points passed on straight lines, the last one the new position.
        count : int
            Number of points of the path that the vehicle has passed.
        """

    def stop_at(self, place: Floats) -> None:
        """Set the vehicle to rest at a place (3,), metres."""


class KinematicVehicle:
    """Vehicle that follows a path at a constant speed (m/s) and ignores the water."""

    def __init__(
        self, place: Floats, speed: float, policy: VehiclePolicy = VehiclePolicy()
    ) -> None:
        self.policy = policy
        self.position: Floats = np.array(place, dtype=float)
        self.speed = speed
        self.yaw: float = 0.0
        self.control_s: list[float] = []

    def go(
        self,
        path: Floats,
        seconds: float,
        yaw: float,
        water: Floats,
        fresh: bool,
        pull: Floats | None = None,
    ) -> tuple[list[Floats], int]:
        """Follow a path for some seconds; see `Vehicle.go`. Water and pull have no effect."""
        del water, fresh, pull
        max_turn = math.radians(self.policy.max_turn_rate_deg) * seconds
        self.yaw += float(np.clip(wrapped_angle(yaw - self.yaw), -max_turn, max_turn))
        points, passed = advance_along(self.position, path, self.speed * seconds)
        self.position = points[-1]
        return points, passed

    def stop_at(self, place: Floats) -> None:
        """See `Vehicle`."""
        self.position = np.array(place)


def wrapped_angle(angle: float) -> float:
    """Return an angle between -pi and pi."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def advance_along(robot: Floats, path: Floats, step: float) -> tuple[list[Floats], int]:
    """Return the corners that a robot passes on its next `step` metres of a path, its end, and the
    number of points of the path that it has passed."""
    points: list[Floats] = []
    position, left = robot, step
    for passed, point in enumerate(path):
        distance = float(np.linalg.norm(point - position))
        if distance > left:
            return [*points, position + (point - position) * (left / distance)], passed
        position, left = point, left - distance
        points.append(position)
    return points or [robot], len(path)

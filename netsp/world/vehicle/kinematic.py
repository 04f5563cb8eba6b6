"""What a vehicle is to the simulation, and the one that goes exactly where it is told."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from netsp.base.arrays import Floats
from netsp.world.vehicle.vehicle_policy import VehiclePolicy


class Vehicle(Protocol):
    """A robot that can be told a path.

    Attributes
    ----------
    position : ndarray, shape (3,)
        Metres.
    yaw : float
        Heading, radians.
    control_s : list of float
        Seconds of computing that each control step took.
    """

    control_s: list[float]

    @property
    def position(self) -> Floats:
        """(3,) m."""

    @property
    def yaw(self) -> float:
        """rad."""

    def go(
        self, path: Floats, seconds: float, yaw: float, water: Floats, fresh: bool,
        pull: Floats | None = None,
    ) -> tuple[list[Floats], int]:  # fmt: skip
        """Follow a path for some seconds, turning to a heading, in moving water.

        Parameters
        ----------
        path : ndarray, shape (k, 3)
            Points to pass, metres.
        seconds : float
            How long.
        yaw : float
            Heading, radians.
        water : ndarray, shape (3,)
            Velocity of the water, m/s.
        fresh : bool
            Whether the path does not continue the one before.
        pull : ndarray, shape (3,), optional
            Force of the tether, N; only missions that ask for it hand it over.

        Returns
        -------
        points : list of ndarray
            Points passed on straight lines, the last one its new position.
        count : int
            How many points of the path are behind it.
        """

    def stop_at(self, place: Floats) -> None:
        """Be at rest at a place.

        Parameters
        ----------
        place : ndarray, shape (3,)
            Metres.
        """


class KinematicVehicle:
    """Goes along the path at its speed, whatever the water does.

    Parameters
    ----------
    place : ndarray, shape (3,)
        Where it is, metres.
    speed : float
        m/s.
    """

    def __init__(
        self, place: Floats, speed: float, policy: VehiclePolicy = VehiclePolicy()
    ) -> None:
        self.policy = policy
        self.position: Floats = np.array(place, dtype=float)
        self.speed = speed
        self.yaw: float = 0.0
        self.control_s: list[float] = []

    def go(
        self, path: Floats, seconds: float, yaw: float, water: Floats, fresh: bool,
        pull: Floats | None = None,
    ) -> tuple[list[Floats], int]:  # fmt: skip
        """Follow a path for some seconds; see `Vehicle.go`.

        Parameters
        ----------
        path : ndarray, shape (k, 3)
            Points to pass, metres.
        seconds : float
            How long.
        yaw : float
            Heading, radians, taken at once.
        water : ndarray, shape (3,)
            Velocity of the water, m/s; it has no effect.
        fresh : bool
            Whether the path does not continue the one before.
        pull : ndarray, shape (3,), optional
            Force of the tether, N; it has no effect.

        Returns
        -------
        points : list of ndarray
            Points passed on straight lines, the last one its new position.
        count : int
            How many points of the path are behind it.
        """
        del water, fresh, pull
        most = math.radians(self.policy.max_turn_rate_deg) * seconds
        self.yaw += float(np.clip(turned(yaw - self.yaw), -most, most))
        points, passed = advance(self.position, path, self.speed * seconds)
        self.position = points[-1]
        return points, passed

    def stop_at(self, place: Floats) -> None:
        """Be at rest at a place.

        Parameters
        ----------
        place : ndarray, shape (3,)
            Metres.
        """
        self.position = np.array(place)


def turned(angle: float) -> float:
    """The same angle between -pi and pi."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def advance(robot: Floats, path: Floats, step: float) -> tuple[list[Floats], int]:
    """The corners that a robot passes on its next `step` metres of a path, where it ends, and how
    many points of the path it has passed."""
    points: list[Floats] = []
    here, left = robot, step
    for passed, point in enumerate(path):
        far = float(np.linalg.norm(point - here))
        if far > left:
            return [*points, here + (point - here) * (left / far)], passed
        here, left = point, left - far
        points.append(here)
    return points or [robot], len(path)

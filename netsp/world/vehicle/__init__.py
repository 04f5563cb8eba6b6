"""Simulated vehicles by name; a vehicle follows the path of a planner."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from netsp.base.registry import Registry, later, make_part
from netsp.world.vehicle.kinematic import KinematicVehicle, Vehicle


def _bluerov2(place: npt.NDArray[np.float64], speed: float) -> Vehicle:
    from netsp.world.vehicle.bluerov2 import BlueRov2

    return BlueRov2(place, speed)


VehicleFactory = Callable[[npt.NDArray[np.float64], float], Vehicle]

VEHICLES: Registry[VehicleFactory] = Registry(
    "vehicle", "netsp.vehicles", {"kinematic": KinematicVehicle, "bluerov2": _bluerov2}, later
)
"""Factories of vehicles by name, each called with a place (3,) and a speed."""


def make_vehicle(
    vehicle: str | VehicleFactory, place: npt.NDArray[np.float64], speed: float
) -> Vehicle:
    """Make a vehicle by name or by calling a factory, at rest at a place (3,), for a speed in m/s.

    Raises
    ------
    InputError
        No vehicle has that name; a callable takes other arguments, or what it makes is no vehicle.
    """
    factory = vehicle if callable(vehicle) else VEHICLES.named(vehicle)
    made: Vehicle = make_part(
        "vehicle", factory, {"place": place, "speed": speed}, ("go", "stop_at")
    )
    return made


__all__ = ["VEHICLES", "KinematicVehicle", "Vehicle", "VehicleFactory", "make_vehicle"]

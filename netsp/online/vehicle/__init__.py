"""Vehicles by name: what carries out a planner's way in a simulation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from netsp.errors import InputError
from netsp.online.vehicle.kinematic import KinematicVehicle, Vehicle


def _bluerov2(place: npt.NDArray[np.float64], speed: float) -> Vehicle:
    from netsp.online.vehicle.bluerov2 import BlueRov2

    return BlueRov2(place, speed)


VEHICLES: dict[str, Callable[[npt.NDArray[np.float64], float], Vehicle]] = {
    "kinematic": KinematicVehicle,
    "bluerov2": _bluerov2,
}


def make_vehicle(name: str, place: npt.NDArray[np.float64], speed: float) -> Vehicle:
    """A vehicle by name, at rest at a place (3,), that is to go at `speed` (m/s).

    Raises
    ------
    InputError : a name that is none.
    """
    if name not in VEHICLES:
        raise InputError(f"--vehicle: expected {' or '.join(VEHICLES)}, got {name!r}")
    return VEHICLES[name](place, speed)


__all__ = ["VEHICLES", "KinematicVehicle", "Vehicle", "make_vehicle"]

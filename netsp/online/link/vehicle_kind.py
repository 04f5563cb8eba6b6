"""Kind of a vehicle and of its autopilot, as reported in heartbeats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from netsp.online.link.dialect import dialect

SUBMARINE, ARDUPILOT = 12, 3
"""MAV_TYPE of an underwater vehicle, and MAV_AUTOPILOT of ArduPilot."""

GROUND_STATION_TYPE = 6
"""MAV_TYPE of a ground station."""


@dataclass(frozen=True)
class VehicleKind:
    """Kind of a vehicle.

    Attributes
    ----------
    vehicle
        MAV_TYPE.
    autopilot
        MAV_AUTOPILOT.
    """

    vehicle: int
    autopilot: int

    @property
    def is_ardusub(self) -> bool:
        """Return whether this is a submarine with ArduPilot."""
        return (self.vehicle, self.autopilot) == (SUBMARINE, ARDUPILOT)

    def __str__(self) -> str:
        """Name vehicle and autopilot, such as "quadrotor with autopilot px4"."""
        names = dialect().enums
        vehicle = _name(names, "MAV_TYPE", self.vehicle)
        return f"{vehicle} with autopilot {_name(names, 'MAV_AUTOPILOT', self.autopilot)}"


def other_vehicle(kind: VehicleKind) -> str:
    """Return the warning of a vehicle that a guard does not know.

    Parameters
    ----------
    kind : VehicleKind
        Kind of the vehicle.

    Returns
    -------
    str
        One line.
    """
    return (
        f"warning: the vehicle is a {kind}, expected a submarine with ArduPilot: its modes, and "
        "when its position is lost, may be misread"
    )


def _name(names: Any, kind: str, number: int) -> str:
    """Return the name of a number of an enumeration in small letters; the number if it has none."""
    entry = names[kind].get(number)
    if entry is None:
        return f"{kind} {number}"
    return str(entry.name).removeprefix(f"{kind}_").replace("_", " ").lower()

"""Kind of a vehicle and of its autopilot, as reported in heartbeats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from netsp.online.link.dialect import dialect

SUBMARINE = 12
"""Code MAV_TYPE of an underwater vehicle."""

ARDUPILOT = 3
"""Code MAV_AUTOPILOT of ArduPilot."""

GROUND_STATION_TYPE = 6
"""Code MAV_TYPE of a ground station."""


@dataclass(frozen=True)
class VehicleKind:
    """Kind of a vehicle (MAV_TYPE) and of its autopilot (MAV_AUTOPILOT)."""

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


def other_vehicle_warning(kind: VehicleKind) -> str:
    """Return the warning, in one line, of a vehicle that a guard does not know."""
    return (
        f"warning: the vehicle is a {kind}, expected a submarine with ArduPilot: its modes, and "
        "when its position is lost, may be misread"
    )


def _name(names: Any, kind: str, number: int) -> str:
    """Return the name of an entry of an enumeration in small letters, or its number."""
    entry = names[kind].get(number)
    if entry is None:
        return f"{kind} {number}"
    return str(entry.name).removeprefix(f"{kind}_").replace("_", " ").lower()

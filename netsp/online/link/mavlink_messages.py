"""From what a vehicle sends to what it says."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

from netsp.base.field_types import Point3
from netsp.online.guard.telemetry import Fix
from netsp.online.link.geo_frame import Frame
from netsp.online.link.modes import mode_name
from netsp.online.link.position_aiding import PositionAiding
from netsp.online.link.vehicle_kind import VehicleKind

AUTOPILOT = 1
"""Component id of the flight controller."""

ARMED = 128
"""Of the base mode of a heartbeat."""

HORIZONTAL, CONSTANT, UNINITIALIZED = 8 | 16, 128, 1024
"""Of the flags of EKF_STATUS_REPORT: a horizontal position (relative or absolute); none is sought;
none was yet."""

FARTHEST = 1e7
"""Metres from the base; a place beyond is none."""

FASTEST = 1e3
"""m/s; a velocity beyond is none."""

POSITIONS = ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT")
"""Messages that tell a position: in metres, and in degrees."""

NO_GPS_FIX = "no GPS fix (lat = lon = 0)"
NO_NUMBERS = "its numbers are NaN or out of range"
"""Reasons why a message says nothing that counts."""


class Listener:
    """Understands messages of one vehicle.

    Parameters
    ----------
    frame : Frame
        Of the site.
    system : int, optional
        Its system id; by default that of the first autopilot heard.

    Attributes
    ----------
    heard : bool
        Whether the vehicle has said anything.
    strangers : int
        How many messages came from others.
    others : set of int
        System ids of the other vehicles among them.
    aiding : PositionAiding
        What corrects the vehicle's position.
    kind : VehicleKind or None
        Kind of the vehicle by its last heartbeat; None before the first.
    left_out : str
        Why the last message that was not understood says nothing that counts; empty for one that is
        kept until the vehicle tells its time.
    """

    def __init__(self, frame: Frame, system: int | None = None) -> None:
        self.frame, self.system = frame, system
        self.time: float | None = None
        self.heard = False
        self.strangers = 0
        self.others: set[int] = set()
        self.kind: VehicleKind | None = None
        self.left_out = ""
        self.aiding = PositionAiding()
        self._early: Fix | None = None

    def understand(self, message: Any) -> Fix | None:
        """What a message says.

        Parameters
        ----------
        message : MAVLink_message
            Of any kind.

        Returns
        -------
        Fix or None
            None for messages of others, and those that say nothing that counts.
        """
        kind = message.get_type()
        if kind == "BAD_DATA":
            return self._none("damaged")
        if self.system is None and kind == "HEARTBEAT" and message.get_srcComponent() == AUTOPILOT:
            self.system = message.get_srcSystem()
        if message.get_srcSystem() != self.system or message.get_srcComponent() != AUTOPILOT:
            self.strangers += 1
            if kind == "HEARTBEAT" and message.get_srcComponent() == AUTOPILOT:
                self.others.add(message.get_srcSystem())
            if message.get_srcComponent() != AUTOPILOT:
                return self._none("not of an autopilot (component 1)")
            return self._none("of another vehicle")
        self.heard = True
        boot = getattr(message, "time_boot_ms", None)
        if isinstance(boot, int):
            self.time = boot / 1000.0
        read = self._readers.get(kind)
        if read is None:
            return self._none("says nothing that the guard uses")
        if self.time is None:
            return self._keep(read, message)
        self.aiding.take(message, self.time)
        fix = read(message)
        if fix is not None:
            fix = replace(fix, aiding_fault=self.aiding.fault(self.time))
        if fix is None or self._early is None:
            return fix
        early, self._early = self._early, None
        return _joined(early, fix)

    def _keep(self, read: Callable[[Any], Fix | None], message: Any) -> Fix | None:
        """Keep what a message says for the first fix, because the time is not known yet."""
        self.time, self.left_out = 0.0, ""
        fix = read(message)
        self.time = None
        if fix is not None:
            self._early = fix if self._early is None else _joined(self._early, fix)
        return None

    @property
    def _readers(self) -> dict[str, Callable[[Any], Fix | None]]:
        """Name of each message that says something that counts to what reads it."""
        return {
            "HEARTBEAT": self._heartbeat, "ATTITUDE": self._attitude,
            "LOCAL_POSITION_NED": self._local_position_ned,
            "GLOBAL_POSITION_INT": self._global_position_int,
            "EKF_STATUS_REPORT": self._ekf_status_report, "WINCH_STATUS": self._winch_status,
            "GPS_RAW_INT": self._aiding_only, "SYS_STATUS": self._aiding_only,
        }  # fmt: skip

    def _none(self, why: str) -> Fix | None:
        self.left_out = why
        return None

    def _heartbeat(self, m: Any) -> Fix:
        assert self.time is not None
        self.kind = VehicleKind(int(m.type), int(m.autopilot))
        return Fix(
            self.time, armed=bool(m.base_mode & ARMED), mode=mode_name(int(m.custom_mode))
        )  # fmt: skip

    def _attitude(self, m: Any) -> Fix | None:
        assert self.time is not None
        if not math.isfinite(m.yaw):
            return self._none(NO_NUMBERS)
        return Fix(self.time, heading=math.degrees(m.yaw) % 360.0)

    def _local_position_ned(self, m: Any) -> Fix | None:
        if self.frame.is_global:
            return self._none("degrees count, because the site has an origin")
        assert self.time is not None
        if not all(math.isfinite(v) and abs(v) < FARTHEST for v in (m.x, m.y, m.z)):
            return self._none(NO_NUMBERS)
        place = self.frame.from_local(m.x, m.y, m.z)
        return Fix(self.time, position=place, velocity=self._velocity(m.vx, m.vy, m.vz))

    def _velocity(self, north: float, east: float, down: float) -> Point3 | None:
        if not all(math.isfinite(v) and abs(v) < FASTEST for v in (north, east, down)):
            return None
        return self.frame.velocity(north, east, down)

    def _global_position_int(self, m: Any) -> Fix | None:
        assert self.time is not None
        if m.lat == 0 and m.lon == 0:
            return self._none(NO_GPS_FIX)
        if not self.frame.is_global:
            return self._none("metres from the base count" + (
                ", as --frame local says" if self.frame.has_origin
                else ", because the site has no origin"
            ))  # fmt: skip
        if abs(m.lat) > 900_000_000 or abs(m.lon) > 1_800_000_000:
            return self._none(NO_NUMBERS)
        place = self.frame.from_global(m.lat, m.lon, m.relative_alt / 1000.0)
        if not all(map(math.isfinite, place)):
            return self._none(NO_NUMBERS)
        velocity = self._velocity(m.vx / 100.0, m.vy / 100.0, m.vz / 100.0)
        return Fix(self.time, position=place, velocity=velocity)

    def _ekf_status_report(self, m: Any) -> Fix:
        assert self.time is not None
        flags = int(m.flags)
        good = bool(flags & HORIZONTAL) and not flags & (CONSTANT | UNINITIALIZED)
        return Fix(self.time, estimate=good)

    def _aiding_only(self, m: Any) -> Fix:
        del m  # what it says of the position's aiding is added to every fix
        assert self.time is not None
        return Fix(self.time)

    def _winch_status(self, m: Any) -> Fix | None:
        assert self.time is not None
        if not math.isfinite(m.line_length) or m.line_length < 0.0:
            return self._none(NO_NUMBERS)
        return Fix(self.time, paid_out=float(m.line_length))


def _joined(earlier: Fix, fix: Fix) -> Fix:
    """Return a fix with what an earlier one says besides."""
    missing = (f.name for f in fields(Fix) if getattr(fix, f.name) is None)
    return replace(fix, **{name: getattr(earlier, name) for name in missing})

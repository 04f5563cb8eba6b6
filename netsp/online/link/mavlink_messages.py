"""Fixes from the MAVLink messages of a vehicle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from netsp.base.field_types import Point3
from netsp.online.guard.telemetry import Fix
from netsp.online.link.geo_frame import Frame
from netsp.online.link.link_policy import LinkPolicy
from netsp.online.link.modes import mode_name
from netsp.online.link.position_aiding import PositionAiding
from netsp.online.link.vehicle_kind import VehicleKind

AUTOPILOT = 1
"""Code MAV_COMP_ID_AUTOPILOT1 of the flight controller."""

ARMED = 128
"""Code MAV_MODE_FLAG_SAFETY_ARMED in the base mode of a heartbeat."""

EKF_HORIZONTAL = 8 | 16
"""Code flags of EKF_STATUS_REPORT for a horizontal position, relative or absolute."""

EKF_CONSTANT = 128
"""Code flag of EKF_STATUS_REPORT for a filter that seeks no position."""

EKF_UNINITIALIZED = 1024
"""Code flag of EKF_STATUS_REPORT for a filter that never had a position."""

POSITIONS = ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT")
"""Messages with a position: in metres, and in degrees."""

NO_GPS_FIX = "no GPS fix (lat = lon = 0)"
"""Reason to leave out a position in degrees."""

NO_NUMBERS = "its numbers are NaN or out of range"
"""Reason to leave out a damaged message."""


class Listener:
    """Reader of the messages of one vehicle.

    Parameters
    ----------
    frame : Frame
        Frame of the site.
    system : int, optional
        System id of the vehicle; by default that of the first autopilot heard.
    policy : LinkPolicy
        Bounds of plausible numbers, and limits of aiding.

    Attributes
    ----------
    has_heard : bool
        Whether a message of the vehicle has come.
    n_foreign : int
        Number of messages from others.
    others : set of int
        System ids of the other vehicles among them.
    aiding : PositionAiding
        Monitor of what corrects the vehicle's position.
    kind : VehicleKind or None
        Kind of the vehicle by its last heartbeat; None before the first.
    left_out : str
        Reason why the last message without a fix was left out; empty for one that is kept until the
        vehicle reports its time.
    """

    def __init__(
        self, frame: Frame, system: int | None = None, policy: LinkPolicy = LinkPolicy()
    ) -> None:
        self.frame, self.system, self.policy = frame, system, policy
        self.time: float | None = None
        self.has_heard = False
        self.n_foreign = 0
        self.others: set[int] = set()
        self.kind: VehicleKind | None = None
        self.left_out = ""
        self.aiding = PositionAiding(policy.aiding)
        self._early: Fix | None = None

    def read(self, message: Any) -> Fix | None:
        """Return the fix of a MAVLink message of any kind.

        None for messages of others, and those without a quantity of `Fix`; `left_out` says why.
        """
        kind = message.get_type()
        if kind == "BAD_DATA":
            return self._leave_out("damaged")
        if self.system is None and kind == "HEARTBEAT" and message.get_srcComponent() == AUTOPILOT:
            self.system = message.get_srcSystem()
        if message.get_srcSystem() != self.system or message.get_srcComponent() != AUTOPILOT:
            return self._leave_out_foreign(message)
        self.has_heard = True
        boot = getattr(message, "time_boot_ms", None)
        if isinstance(boot, int):
            self.time = boot / 1000.0
        reader = self._readers.get(kind)
        if reader is None:
            return self._leave_out("says nothing that the guard uses")
        if self.time is None:
            return self._keep(reader, message)
        self.aiding.observe(message, self.time)
        fix = reader(message)
        if fix is not None:
            fix = replace(fix, aiding_fault=self.aiding.fault(self.time))
        if fix is None or self._early is None:
            return fix
        early, self._early = self._early, None
        return fix.completed_by(early)

    def _leave_out_foreign(self, message: Any) -> Fix | None:
        """Leave out a message that is not of the vehicle's autopilot."""
        self.n_foreign += 1
        if message.get_srcComponent() != AUTOPILOT:
            return self._leave_out("not of an autopilot (component 1)")
        if message.get_type() == "HEARTBEAT":
            self.others.add(message.get_srcSystem())
        return self._leave_out("of another vehicle")

    def _keep(self, reader: Callable[[Any], Fix | None], message: Any) -> Fix | None:
        """Keep the fix of a message for the first one whose time is known."""
        self.time, self.left_out = 0.0, ""
        fix = reader(message)
        self.time = None
        if fix is not None:
            self._early = fix if self._early is None else fix.completed_by(self._early)
        return None

    @property
    def _readers(self) -> dict[str, Callable[[Any], Fix | None]]:
        """Return the reader of each message that is used, by its name."""
        return {
            "HEARTBEAT": self._heartbeat,
            "ATTITUDE": self._attitude,
            "LOCAL_POSITION_NED": self._local_position_ned,
            "GLOBAL_POSITION_INT": self._global_position_int,
            "EKF_STATUS_REPORT": self._ekf_status_report,
            "WINCH_STATUS": self._winch_status,
            "GPS_RAW_INT": self._aiding_only,
            "SYS_STATUS": self._aiding_only,
        }

    def _leave_out(self, why: str) -> Fix | None:
        self.left_out = why
        return None

    def _heartbeat(self, m: Any) -> Fix:
        assert self.time is not None
        self.kind = VehicleKind(int(m.type), int(m.autopilot))
        is_armed = bool(m.base_mode & ARMED)
        return Fix(self.time, armed=is_armed, mode=mode_name(int(m.custom_mode)))

    def _attitude(self, m: Any) -> Fix | None:
        assert self.time is not None
        if not math.isfinite(m.yaw):
            return self._leave_out(NO_NUMBERS)
        return Fix(self.time, heading=math.degrees(m.yaw) % 360.0)

    def _local_position_ned(self, m: Any) -> Fix | None:
        if self.frame.is_global:
            return self._leave_out("degrees count, because the site has an origin")
        assert self.time is not None
        max_distance = self.policy.max_distance
        if not all(math.isfinite(v) and abs(v) < max_distance for v in (m.x, m.y, m.z)):
            return self._leave_out(NO_NUMBERS)
        place = self.frame.from_local(m.x, m.y, m.z)
        return Fix(self.time, position=place, velocity=self._velocity(m.vx, m.vy, m.vz))

    def _velocity(self, north: float, east: float, down: float) -> Point3 | None:
        max_speed = self.policy.max_speed
        if not all(math.isfinite(v) and abs(v) < max_speed for v in (north, east, down)):
            return None
        return self.frame.velocity(north, east, down)

    def _global_position_int(self, m: Any) -> Fix | None:
        assert self.time is not None
        if m.lat == 0 and m.lon == 0:
            return self._leave_out(NO_GPS_FIX)
        if not self.frame.is_global:
            why = (
                "as --frame local says"
                if self.frame.has_origin
                else "because the site has no origin"
            )
            return self._leave_out(f"metres from the base count, {why}")
        if abs(m.lat) > 900_000_000 or abs(m.lon) > 1_800_000_000:
            return self._leave_out(NO_NUMBERS)
        place = self.frame.from_global(m.lat, m.lon, m.relative_alt / 1000.0)
        if not all(map(math.isfinite, place)):
            return self._leave_out(NO_NUMBERS)
        velocity = self._velocity(m.vx / 100.0, m.vy / 100.0, m.vz / 100.0)
        return Fix(self.time, position=place, velocity=velocity)

    def _ekf_status_report(self, m: Any) -> Fix:
        assert self.time is not None
        flags = int(m.flags)
        has_position = bool(flags & EKF_HORIZONTAL)
        is_good = has_position and not flags & (EKF_CONSTANT | EKF_UNINITIALIZED)
        return Fix(self.time, estimate=is_good)

    def _aiding_only(self, m: Any) -> Fix:
        del m  # the state of the position's aiding is added to every fix
        assert self.time is not None
        return Fix(self.time)

    def _winch_status(self, m: Any) -> Fix | None:
        assert self.time is not None
        if not math.isfinite(m.line_length) or m.line_length < 0.0:
            return self._leave_out(NO_NUMBERS)
        return Fix(self.time, paid_out=float(m.line_length))

"""From what a vehicle sends to what it says."""

from __future__ import annotations

import math
from typing import Any

from netsp.fields import Point3
from netsp.guard.fix import Fix
from netsp.link.frame import Frame
from netsp.link.modes import mode_name

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
    """

    def __init__(self, frame: Frame, system: int | None = None) -> None:
        self.frame, self.system = frame, system
        self.time: float | None = None
        self.heard = False
        self.strangers = 0
        self.others: set[int] = set()

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
            return None
        if self.system is None and kind == "HEARTBEAT" and message.get_srcComponent() == AUTOPILOT:
            self.system = message.get_srcSystem()
        if message.get_srcSystem() != self.system or message.get_srcComponent() != AUTOPILOT:
            self.strangers += 1
            if kind == "HEARTBEAT" and message.get_srcComponent() == AUTOPILOT:
                self.others.add(message.get_srcSystem())
            return None
        self.heard = True
        boot = getattr(message, "time_boot_ms", None)
        if isinstance(boot, int):
            self.time = boot / 1000.0
        if self.time is None:
            return None
        read = getattr(self, f"_{kind.lower()}", None)
        return None if read is None else read(message)

    def _heartbeat(self, m: Any) -> Fix:
        assert self.time is not None
        return Fix(
            self.time, armed=bool(m.base_mode & ARMED), mode=mode_name(int(m.custom_mode))
        )  # fmt: skip

    def _attitude(self, m: Any) -> Fix | None:
        assert self.time is not None
        if not math.isfinite(m.yaw):
            return None
        return Fix(self.time, heading=math.degrees(m.yaw) % 360.0)

    def _local_position_ned(self, m: Any) -> Fix | None:
        if self.frame.is_global:
            return None
        assert self.time is not None
        if not all(math.isfinite(v) and abs(v) < FARTHEST for v in (m.x, m.y, m.z)):
            return None
        place = self.frame.from_local(m.x, m.y, m.z)
        return Fix(self.time, position=place, velocity=self._velocity(m.vx, m.vy, m.vz))

    def _velocity(self, north: float, east: float, down: float) -> Point3 | None:
        if not all(math.isfinite(v) and abs(v) < FASTEST for v in (north, east, down)):
            return None
        return self.frame.velocity(north, east, down)

    def _global_position_int(self, m: Any) -> Fix | None:
        assert self.time is not None
        if not self.frame.is_global or (m.lat == 0 and m.lon == 0):
            return None
        if abs(m.lat) > 900_000_000 or abs(m.lon) > 1_800_000_000:
            return None
        place = self.frame.from_global(m.lat, m.lon, m.relative_alt / 1000.0)
        if not all(map(math.isfinite, place)):
            return None
        velocity = self._velocity(m.vx / 100.0, m.vy / 100.0, m.vz / 100.0)
        return Fix(self.time, position=place, velocity=velocity)

    def _ekf_status_report(self, m: Any) -> Fix:
        assert self.time is not None
        flags = int(m.flags)
        good = bool(flags & HORIZONTAL) and not flags & (CONSTANT | UNINITIALIZED)
        return Fix(self.time, estimate=good)

    def _winch_status(self, m: Any) -> Fix | None:
        assert self.time is not None
        if not math.isfinite(m.line_length) or m.line_length < 0.0:
            return None
        return Fix(self.time, paid_out=float(m.line_length))

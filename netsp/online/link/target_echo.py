"""Echo of the target that a vehicle goes to: POSITION_TARGET_LOCAL_NED and _GLOBAL_INT."""

from __future__ import annotations

import math
from typing import Any

from netsp.base.field_types import Point3
from netsp.online.link.geo_frame import DEGREE, Frame

METRES_PER_UNIT = 0.011131884502145034
"""Unit of 1e-7 degrees of latitude in metres, as ArduPilot has it."""

RELATIVE_FRAMES = (3, 6)
"""Code MAV_FRAME_GLOBAL_RELATIVE_ALT and ..._INT: altitudes above home."""


class TargetEcho:
    """Decoder of the target that a vehicle reports.

    ArduSub echoes in degrees and above the sea. The decoder converts them into the site with
    home
    and the origin of the estimate, which ArduSub reports as well.
    """

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        self._origin: tuple[int, int, float] | None = None
        self._home: float | None = None

    def read(self, message: Any) -> Point3 | None:
        """Return the target in a message, in the site.

        None for other messages, and for echoes whose place in the site is not known yet.
        """
        kind = message.get_type()
        if kind == "GPS_GLOBAL_ORIGIN":
            self._origin = message.latitude, message.longitude, message.altitude / 1000.0
        elif kind == "GLOBAL_POSITION_INT":
            self._home = (message.alt - message.relative_alt) / 1000.0
        elif kind == "POSITION_TARGET_LOCAL_NED" and not self.frame.is_global:
            return _finite(self.frame.from_local(message.x, message.y, message.z))
        elif kind == "POSITION_TARGET_GLOBAL_INT":
            return self._from_degrees(message)
        return None

    def _from_degrees(self, message: Any) -> Point3 | None:
        is_relative = message.coordinate_frame in RELATIVE_FRAMES
        if self.frame.is_global:
            if not is_relative and self._home is None:
                return None
            above = message.alt if is_relative else message.alt - (self._home or 0.0)
            return _finite(self.frame.from_global(message.lat_int, message.lon_int, above))
        if self._origin is None or (is_relative and self._home is None):
            return None
        lat, lon, height = self._origin
        up = message.alt + (self._home or 0.0 if is_relative else 0.0) - height
        narrowing = math.cos(math.radians(0.5 * (lat + message.lat_int) * DEGREE))
        north = (message.lat_int - lat) * METRES_PER_UNIT
        east = (message.lon_int - lon) * METRES_PER_UNIT * narrowing
        return _finite(self.frame.from_local(north, east, -up))


def _finite(place: Point3) -> Point3 | None:
    return place if all(map(math.isfinite, place)) else None

"""Sources of a vehicle's position estimate: a filter without them drifts for seconds before its own
flags say so (ArduSub: 0.25 m after 3 s, 1 m after 7 s, when EKF_STATUS_REPORT changes)."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

FIX_3D = 3
"""Smallest GPS_FIX_TYPE that counts: a position with height."""

OTHER_SOURCES = {0x40: "the optical flow sensor", 0x80: "the DVL or visual odometry"}
"""Bits of SYS_STATUS for sensors that may give a filter its horizontal motion."""

REJECTED = 1.0
"""Innovation over the bound of acceptance (EKF_STATUS_REPORT) above which a filter rejects a
measurement, by definition."""

N_INTERVALS = 9
"""Number of intervals between GPS messages whose median is the usual interval."""

MAX_INTERVALS = 3.0
"""Number of usual intervals without a GPS message after which it is missed: two may get lost."""


class PositionSources:
    """Monitor of the sources of a vehicle's position. Times are by the vehicle's clock, so that
    load on this computer does not matter."""

    def __init__(self) -> None:
        self._had_fix = False
        self._no_fix_since: float | None = None
        self._gps_at: float | None = None
        self._intervals: deque[float] = deque(maxlen=N_INTERVALS)
        self._had: set[int] = set()
        self._healthy: set[int] = set()
        self._gone_since: float | None = None
        self._rejected_since: float | None = None
        self._innovation = 0.0
        self._what = ""

    def take(self, message: Any, time: float) -> None:
        """Take a message of the vehicle.

        Parameters
        ----------
        message : MAVLink_message
            Message of any kind.
        time : float
            Time of the vehicle, s.
        """
        kind = message.get_type()
        if kind == "GPS_RAW_INT":
            if self._gps_at is not None and time > self._gps_at:
                self._intervals.append(time - self._gps_at)
            self._gps_at = time
            if int(message.fix_type) >= FIX_3D:
                self._had_fix, self._no_fix_since = True, None
            elif self._no_fix_since is None:
                self._no_fix_since = time
        elif kind == "SYS_STATUS":
            enabled = int(message.onboard_control_sensors_enabled)
            works = enabled & int(message.onboard_control_sensors_health)
            self._healthy = {bit for bit in OTHER_SOURCES if works & bit}
            self._had |= self._healthy
            if self._healthy:
                self._gone_since = None
            elif self._gone_since is None:
                self._gone_since = time
        elif kind == "EKF_STATUS_REPORT":
            ratios = {
                "position": float(message.pos_horiz_variance),
                "velocity": float(message.velocity_variance),
            }
            self._what = max(ratios, key=lambda name: ratios[name])
            self._innovation = ratios[self._what]
            if not self._innovation > REJECTED:
                self._rejected_since = None
            elif self._rejected_since is None:
                self._rejected_since = time

    def lost(self, time: float, confirm_s: float, max_age_s: float) -> str | None:
        """Return what is wrong with the sources; None if nothing is.

        A GPS counts from its first fix on, another sensor from when it was healthy first. One that
        is lost does not matter while another one works.

        Parameters
        ----------
        time : float
            Time of the vehicle now, s.
        confirm_s : float
            Time for which a source must be bad, s.
        max_age_s : float
            Longest time without a message of the GPS, s; longer where its messages are rarer.
        """
        if self._rejected_since is not None and time - self._rejected_since >= confirm_s:
            return (
                f"the filter rejects its {self._what} (innovation {self._innovation:.1f} of "
                f"{REJECTED:g} allowed)"
            )
        gps = self._gps_lost(time, confirm_s, max_age_s)
        if self._healthy or (self._had_fix and gps is None):
            return None
        if gps is not None:
            return gps
        if not self._had or self._gone_since is None or time - self._gone_since < confirm_s:
            return None
        return f"{OTHER_SOURCES[max(self._had)]} is not healthy"

    def _gps_lost(self, time: float, confirm_s: float, max_age_s: float) -> str | None:
        if not self._had_fix:
            return None
        if self._no_fix_since is not None and time - self._no_fix_since >= confirm_s:
            return "the GPS has no fix"
        usual = float(np.median(self._intervals)) if self._intervals else 0.0
        age = time - (self._gps_at or 0.0)
        if age > max(max_age_s, MAX_INTERVALS * usual):
            return f"the GPS is silent for {age:.1f} s"
        return None

"""Aiding of a vehicle's position: whether GPS or another sensor corrects the filter's estimate.

A filter without fixes continues by dead reckoning and reports that late: ArduSub 4.7 vouches for
its estimate for 7 s more, when the error is 1 m. The sensors tell sooner: the GPS has no fix or
repeats itself, a sensor of position or velocity is unhealthy, or the filter rejects fixes because
they are too far from its estimate.

A guard warns at the first sign (`PositionAiding.fault`). A flight stops when a sign has lasted
(`PositionAiding.confirmed_fault`).
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np

from netsp.online.link.link_policy import AidingPolicy

FIX_TYPE_3D = 3
"""Code GPS_FIX_TYPE of GPS_RAW_INT for a fix in three dimensions, the smallest that aids."""

GPS_SENSOR = 32
"""Code MAV_SYS_STATUS_SENSOR of the GPS, a bit of SYS_STATUS."""

SENSORS = {GPS_SENSOR: "GPS", 64: "optical flow or DVL", 128: "visual or DVL odometry"}
"""Sensors that aid the position, by their bit in SYS_STATUS."""

GPS_FAULTS = 0x300
"""Code bits of XKF4.GPS that are set while there is no fix: the eighth or the ninth, by version."""


class PositionAiding:
    """Monitor of the sensors that correct a vehicle's position.

    A sensor counts once it has worked, because vehicles without GPS report one without a fix. The
    loss of a sensor does not matter while another one works. Times are by the vehicle's clock, so
    that the load of this computer does not matter.

    Parameters
    ----------
    policy : AidingPolicy
        Limits of age and innovation.

    Examples
    --------
    >>> aiding = PositionAiding()
    >>> aiding.observe_innovations(1.0, 0.1), aiding.fault(1.0)
    (None, '')
    >>> aiding.observe_innovations(1.2, 1.4), aiding.fault(1.2)
    (None, 'the filter rejects the fixes')
    """

    def __init__(self, policy: AidingPolicy = AidingPolicy()) -> None:
        self.policy = policy
        self._has_fix: bool | None = None
        self._no_fix_since: float | None = None
        self._fix_stamp: int | None = None
        self._fix_since = 0.0
        self._gps_at: float | None = None
        self._intervals: deque[float] = deque(maxlen=policy.n_intervals)
        self._worked: set[int] = set()
        self._working: set[int] = set()
        self._failed_since: dict[int, float] = {}
        self._innovation: tuple[float, str] | None = None
        self._rejected_since: float | None = None

    def observe(self, message: Any, time: float) -> None:
        """Observe a MAVLink message of the vehicle; messages of other kinds change nothing."""
        kind = message.get_type()
        if kind == "GPS_RAW_INT":
            stamp = int(getattr(message, "time_usec", 0))
            self._observe_gps(int(message.fix_type) >= FIX_TYPE_3D, stamp, time)
        elif kind == "SYS_STATUS":
            enabled = int(message.onboard_control_sensors_enabled)
            self._observe_sensors(enabled & int(message.onboard_control_sensors_health), time)
        elif kind == "EKF_STATUS_REPORT":
            self.observe_innovations(
                time, float(message.pos_horiz_variance), float(message.velocity_variance)
            )

    def _observe_gps(self, has_fix: bool, stamp: int, time: float) -> None:
        if self._gps_at is not None and time > self._gps_at:
            self._intervals.append(time - self._gps_at)
        self._gps_at = time
        if self._has_fix is None and not has_fix:
            return
        if has_fix:
            self._no_fix_since = None
        elif self._no_fix_since is None:
            self._no_fix_since = time
        if stamp != self._fix_stamp or stamp == 0:
            self._fix_stamp, self._fix_since = stamp, time
        self._has_fix = has_fix

    def _observe_sensors(self, healthy: int, time: float) -> None:
        self._working = {bit for bit in SENSORS if healthy & bit}
        self._worked |= self._working
        for bit in self._worked:
            if bit in self._working:
                self._failed_since.pop(bit, None)
            else:
                self._failed_since.setdefault(bit, time)

    def observe_innovations(self, time: float, position: float, velocity: float = math.nan) -> None:
        """Observe the innovations of the filter, each over its bound of acceptance; NaN has no
        effect."""
        named = ((position, "position"), (velocity, "velocity"))
        known = [pair for pair in named if math.isfinite(pair[0])]
        if not known:
            return
        self._innovation = max(known, key=lambda pair: pair[0])
        if self._innovation[0] < self.policy.max_innovation:
            self._rejected_since = None
        elif self._rejected_since is None:
            self._rejected_since = time

    def observe_gps_checks(self, flags: int) -> None:
        """Observe the failed GPS checks of a vehicle's log (XKF4.GPS), one bit each."""
        is_bad = bool(flags & GPS_FAULTS)
        if is_bad and self._has_fix is None:
            return
        self._has_fix = not is_bad
        self._fix_since = self._gps_at = math.inf  # the log has a row for each moment

    def fault(self, time: float) -> str | None:
        """Return why no sensor corrects the position now.

        Returns
        -------
        str or None
            The reason; empty while fixes correct the position, None if the sensors are unknown.
        """
        if self._rejected_since is not None:
            return "the filter rejects the fixes"
        failed = [SENSORS[bit] for bit in sorted(self._failed_since)]
        gps = self._gps_fault(time)
        has_gps = self._has_fix is not None and not gps and GPS_SENSOR not in self._failed_since
        if has_gps or self._working - {GPS_SENSOR}:
            return ""
        if gps:
            return gps
        if failed:
            return f"{' and '.join(failed)}: not healthy"
        is_known = self._innovation is not None or bool(self._worked)
        return "" if is_known else None

    def _gps_fault(self, time: float) -> str:
        """Return why the GPS gives no fixes; empty while it does, or never did."""
        if self._has_fix is False:
            return "the GPS has no fix"
        if self._has_fix:
            assert self._gps_at is not None
            if time - min(self._fix_since, self._gps_at) > self._max_age_s(self.policy.max_age_s):
                return "the GPS is silent"
        return ""

    def _max_age_s(self, max_age_s: float) -> float:
        """Return the age from which on the GPS is silent; longer where its messages are rare."""
        usual = float(np.median(self._intervals)) if self._intervals else 0.0
        return max(max_age_s, self.policy.max_intervals * usual)

    def confirmed_fault(self, time: float, min_fault_s: float, max_age_s: float) -> str | None:
        """Return why no sensor has corrected the position for some time; None if one has.

        The GPS counts by its fixes, not by its health in SYS_STATUS.

        Parameters
        ----------
        time : float
            Time now, s.
        min_fault_s : float
            Time for which a fault must have lasted, s.
        max_age_s : float
            Longest time without a message of the GPS, s; longer where its messages are rare.
        """
        if self._rejected_since is not None and time - self._rejected_since >= min_fault_s:
            assert self._innovation is not None
            ratio, name = self._innovation
            return (
                f"the filter rejects its {name} (innovation {ratio:.1f} of "
                f"{self.policy.max_innovation:g} allowed)"
            )
        gps = self._confirmed_gps_fault(time, min_fault_s, max_age_s)
        others = self._worked - {GPS_SENSOR}
        if others & self._working or (self._has_fix is not None and gps is None):
            return None
        if gps is not None:
            return gps
        if not others:
            return None
        failed_since = max(self._failed_since[bit] for bit in others)
        if time - failed_since < min_fault_s:
            return None
        return f"{SENSORS[max(others)]} is not healthy"

    def _confirmed_gps_fault(self, time: float, min_fault_s: float, max_age_s: float) -> str | None:
        if self._has_fix is None or self._gps_at is None:
            return None
        if self._no_fix_since is not None and time - self._no_fix_since >= min_fault_s:
            return "the GPS has no fix"
        age = time - self._gps_at
        if age > self._max_age_s(max_age_s):
            return f"the GPS is silent for {age:.1f} s"
        return None


__all__ = ["PositionAiding"]

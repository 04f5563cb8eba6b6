"""Aiding of a vehicle's position: whether GPS or another sensor corrects the filter's estimate.

A filter without fixes continues by dead reckoning and reports that late: ArduSub 4.7 vouches for
its estimate for 7 s more, when the error is 1 m. The sensors tell sooner: the GPS has no fix or
repeats itself, a sensor of position or velocity is unhealthy, or the filter rejects fixes because
they are too far from its estimate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from netsp.base.errors import InputError

MIN_FIX_TYPE = 3
"""Smallest fix type of GPS_RAW_INT that aids: a fix in three dimensions."""

GPS = 32
"""Bit of SYS_STATUS for the GPS."""

SENSORS = {GPS: "GPS", 64: "optical flow or DVL", 128: "visual or DVL odometry"}
"""Sensors that aid the position, by their bit in SYS_STATUS."""

GPS_FAULTS = 0x300
"""Bits of XKF4.GPS that are set while there is no fix: the eighth or the ninth, by version."""


@dataclass(frozen=True)
class AidingPolicy:
    """Policy that tells an aided position from one without aiding.

    Attributes
    ----------
    max_age_s
        Longest time for which GPS_RAW_INT may repeat the time of its fix, or stay away while other
        messages come, s; with messages that are rare, three times their period. Positive.
    max_innovation
        Largest ratio of the distance between fixes and the estimate to what the filter accepts:
        from 1 on, ArduPilot rejects them. Positive.
    """

    max_age_s: float = 1.5
    max_innovation: float = 1.0

    def __post_init__(self) -> None:
        for name in ("max_age_s", "max_innovation"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"{name}: expected more than 0, got {getattr(self, name)!r}")


class PositionAiding:
    """Monitor of the sensors that correct a vehicle's position.

    A sensor counts once it has worked, because vehicles without GPS report one without a fix. The
    loss of a sensor does not matter while another one works.

    Parameters
    ----------
    policy : AidingPolicy, optional
        Limits of age and innovation.

    Examples
    --------
    >>> aiding = PositionAiding()
    >>> aiding.take_innovation(0.1), aiding.fault(1.0)
    (None, '')
    >>> aiding.take_innovation(1.4), aiding.fault(1.2)
    (None, 'the filter rejects the fixes')
    """

    def __init__(self, policy: AidingPolicy | None = None) -> None:
        self.policy = policy or AidingPolicy()
        self._has_fix: bool | None = None
        self._fix_stamp: int | None = None
        self._fix_since = self._gps_seen = 0.0
        self._gps_period = 0.0
        self._healthy: set[int] = set()
        self._failed: set[int] = set()
        self._rejected: bool | None = None

    def take(self, message: Any, time: float) -> None:
        """Take a MAVLink message; messages of other kinds change nothing.

        Parameters
        ----------
        message : MAVLink_message
            Message of the vehicle.
        time : float
            Seconds, by the vehicle's clock.
        """
        kind = message.get_type()
        if kind == "GPS_RAW_INT":
            self._take_gps(int(message.fix_type) >= MIN_FIX_TYPE, int(message.time_usec), time)
        elif kind == "SYS_STATUS":
            watched = int(message.onboard_control_sensors_enabled)
            health = int(message.onboard_control_sensors_health)
            for bit in SENSORS:
                if watched & health & bit:
                    self._healthy.add(bit)
                    self._failed.discard(bit)
                elif watched & bit and bit in self._healthy:
                    self._failed.add(bit)
        elif kind == "EKF_STATUS_REPORT":
            self.take_innovation(
                float(message.pos_horiz_variance), float(message.velocity_variance)
            )

    def _take_gps(self, has_fix: bool, stamp: int, time: float) -> None:
        if self._has_fix is None and not has_fix:
            return
        if self._has_fix is not None and time >= self._gps_seen:
            self._gps_period = max(0.9 * self._gps_period, time - self._gps_seen)
        if stamp != self._fix_stamp or stamp == 0:
            self._fix_stamp, self._fix_since = stamp, time
        self._has_fix, self._gps_seen = has_fix, time

    def take_innovation(self, *ratios: float) -> None:
        """Take the innovations of the filter.

        Parameters
        ----------
        *ratios : float
            Innovations of position and velocity over the filter's bounds of acceptance; NaN is
            ignored.
        """
        known = [ratio for ratio in ratios if math.isfinite(ratio)]
        if known:
            self._rejected = max(known) >= self.policy.max_innovation

    def take_gps_checks(self, flags: int) -> None:
        """Take the failed GPS checks of a vehicle's log (XKF4.GPS).

        Parameters
        ----------
        flags : int
            One bit per failed check.
        """
        bad = bool(flags & GPS_FAULTS)
        if bad and self._has_fix is None:
            return
        self._has_fix = not bad
        self._fix_since = self._gps_seen = math.inf  # the log has a row for each moment

    def fault(self, time: float) -> str | None:
        """Return the reason why no sensor corrects the position.

        Parameters
        ----------
        time : float
            Seconds, by the vehicle's clock.

        Returns
        -------
        str or None
            The reason; empty while fixes correct the position, None if the sensors are unknown.
        """
        if self._rejected:
            return "the filter rejects the fixes"
        failed = [SENSORS[bit] for bit in sorted(self._failed)]
        gps = self._gps_fault(time)
        has_gps = self._has_fix is not None and not gps and GPS not in self._failed
        if has_gps or self._healthy - self._failed - {GPS}:
            return ""
        if gps:
            return gps
        if failed:
            return f"{' and '.join(failed)}: not healthy"
        is_known = self._rejected is not None or bool(self._healthy)
        return "" if is_known else None

    def _gps_fault(self, time: float) -> str:
        """Return why the GPS gives no fixes; empty while it does, or never did."""
        if self._has_fix is False:
            return "the GPS has no fix"
        oldest = max(self.policy.max_age_s, 3.0 * self._gps_period)
        if self._has_fix and time - min(self._fix_since, self._gps_seen) > oldest:
            return "the GPS is silent"
        return ""


__all__ = ["AidingPolicy", "PositionAiding"]

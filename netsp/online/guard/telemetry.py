"""Fixes: reports of a vehicle about its position and state."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from netsp.base.field_types import Point3


@dataclass(frozen=True)
class Fix:
    """Fix from one message, or one row of a recording; None for what it does not report.

    Attributes
    ----------
    time
        Time by the vehicle's clock, s.
    position
        Estimated position in the frame of the site, z up.
    heading
        Heading, degrees clockwise from the y axis.
    armed
        Whether the motors may turn.
    mode
        Name of the mode.
    estimate
        Whether the vehicle vouches for its position.
    paid_out
        Length of tether that the winch has let out.
    velocity
        Velocity estimated with the position, m/s.
    aiding_fault
        Reason why no fixes of GPS or another system correct the position; empty while they do.
    """

    time: float
    position: Point3 | None = None
    heading: float | None = None
    armed: bool | None = None
    mode: str | None = None
    estimate: bool | None = None
    paid_out: float | None = None
    velocity: Point3 | None = None
    aiding_fault: str | None = None

    def completed_by(self, earlier: Fix) -> Fix:
        """Return this fix; quantities that it lacks come from an earlier one."""
        missing = (f.name for f in fields(Fix) if getattr(self, f.name) is None)
        return replace(self, **{name: getattr(earlier, name) for name in missing})

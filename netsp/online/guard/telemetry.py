"""What a vehicle says of itself."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.field_types import Point3


@dataclass(frozen=True)
class Fix:
    """One message, or one row of a recording; None for what it does not say.

    Parameters
    ----------
    time : float
        Seconds, of the vehicle's clock.
    position : (x, y, z), optional
        As estimated, in the frame of the site, z up.
    heading : float, optional
        Degrees clockwise from the y axis.
    armed : bool, optional
        Whether its motors may turn.
    mode : str, optional
        Name of its mode.
    estimate : bool, optional
        Whether it vouches for the position.
    paid_out : float, optional
        Length of tether that the winch has let out.
    velocity : (x, y, z), optional
        As estimated with the position, m/s.
    aiding_fault : str, optional
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

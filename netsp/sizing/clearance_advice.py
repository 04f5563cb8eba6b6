"""How much clearance a real vehicle needs, from flights of ArduSub 4.7 in its own simulator.

Flown paths cost up to 0.10 m of clearance in still water and 0.15 m in a current of 0.8 m/s, with
the position as the vehicle believed it; the error of that position comes on top.
"""

from __future__ import annotations

from dataclasses import dataclass

from netsp.errors import InputError


@dataclass(frozen=True)
class ClearancePolicy:
    """Policy of how much clearance a plan needs to be flown.

    Attributes
    ----------
    position_error
        Error of the vehicle's position, m: of GPS, USBL or DVL. 0 or more.
    current
        Speed of the current, m/s. 0 or more.
    path_error
        Clearance that a flown path costs in still water, m; the largest of the measured flights.
        0 or more.
    error_by_current
        Clearance that it costs besides, for each m/s of the current, s; of the measured flights in
        0 and 0.8 m/s. 0 or more.
    """

    position_error: float = 0.0
    current: float = 0.0
    path_error: float = 0.1
    error_by_current: float = 0.06

    def __post_init__(self) -> None:
        for name in ("position_error", "current", "path_error", "error_by_current"):
            if not 0.0 <= getattr(self, name) < float("inf"):
                raise InputError(f"{name}: expected 0 or more, got {getattr(self, name)!r}")

    @property
    def min_clearance(self) -> float:
        """Return the least clearance that leaves room for a vehicle, m.

        Examples
        --------
        >>> round(ClearancePolicy(position_error=0.3, current=0.5).min_clearance, 3)
        0.43
        """
        return self.position_error + self.path_error + self.error_by_current * self.current


def clearance_advice(
    clearance: float, units: str, policy: ClearancePolicy | None = None
) -> str | None:
    """Return a warning if a plan has too little clearance to be flown.

    Parameters
    ----------
    clearance : float
        Clearance of the plan, in its units.
    units : str
        Units of the plan; only metres can be compared with flights.
    policy : ClearancePolicy, optional
        How much a vehicle needs.

    Returns
    -------
    str or None
        One line, which says what number to raise; None if there is enough.
    """
    p = policy or ClearancePolicy()
    if units != "m" or clearance >= p.min_clearance - 1e-9:
        return None
    return (
        f"clearance: {clearance:g} m is less than the {p.min_clearance:.3g} m that flights need "
        f"(position error {p.position_error:g} m + {p.path_error:g} m + {p.error_by_current:g} s × "
        f"current {p.current:g} m/s); raise clearance to {p.min_clearance:.3g} or more and plan "
        "again"
    )

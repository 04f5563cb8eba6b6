"""Options of an import: what a user says of a map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from netsp.errors import InputError


@dataclass(frozen=True)
class Looking:
    """How every obstacle is looked at (`netsp.shorthand.Inspection`).

    Attributes
    ----------
    viewpoints
        About each, at every depth.
    standoff
        Metres.
    depths
        Heights z, metres.
    """

    viewpoints: int
    standoff: float
    depths: tuple[float, ...] = (0.0,)


@dataclass(frozen=True)
class SiteOptions:
    """What the user says of a map besides.

    Attributes
    ----------
    tether
        Length, metres; None for the file's own.
    clearance
        Metres; None for the file's own, or none.
    radius
        Of obstacles that are points and have none, metres.
    crs
        Coordinate system, as ``EPSG:32632``; ``local`` for a plane of its own.
    units
        Of lengths in the file, one of `netsp.axes.UNITS`; not of coordinates on the earth. None
        takes the unit that the file states, or metres.
    maps
        Pairs of ours and theirs: ``("obstacle", layer)``, ``("name", property)``.
    looking
        How every obstacle is looked at.
    skip_unreachable
        Goals farther off than the tether is long are left out.
    line_width
        Width of open lines that are obstacles and have none of their own, metres; None refuses
        them.
    join_tolerance
        Ends of lines that are no farther apart are joined to one outline, metres; positive.
    crop
        Whether obstacles beyond the tether's reach are left out; None does so for charts only.
    crop_margin
        Share of the tether's length by which the cropped map is larger than its reach; 0 or more.
    """

    tether: float | None = None
    clearance: float | None = None
    radius: float | None = None
    crs: str | None = None
    units: str | None = None
    maps: Sequence[tuple[str, str]] = ()
    looking: Looking | None = None
    skip_unreachable: bool = False
    line_width: float | None = None
    join_tolerance: float = 0.01
    crop: bool | None = None
    crop_margin: float = 0.05

    def __post_init__(self) -> None:
        if self.line_width is not None and not 0.0 < self.line_width < math.inf:
            raise InputError(f"line_width: expected a positive width (m), got {self.line_width!r}")
        if not 0.0 < self.join_tolerance < math.inf:
            raise InputError(
                f"join_tolerance: expected a positive length (m), got {self.join_tolerance!r}"
            )
        if not 0.0 <= self.crop_margin < math.inf:
            raise InputError(f"crop_margin: expected 0 or more, got {self.crop_margin!r}")

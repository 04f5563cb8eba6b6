"""Options of an import: what a user says of a map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from netsp.base.errors import InputError
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
from netsp.exchange.maps.selection import Selection


@dataclass(frozen=True)
class Looking:
    """How every obstacle is looked at (`netsp.model.shorthand.Inspection`).

    Attributes
    ----------
    viewpoints
        About each, at every depth.
    standoff
        Metres.
    depths
        Heights z, metres.
    chosen
        Obstacles that are looked at; all by default.
    """

    viewpoints: int
    standoff: float
    depths: tuple[float, ...] = (0.0,)
    chosen: Selection = field(default_factory=Selection)


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
        Of lengths in the file, one of `netsp.base.axes.UNITS`; not of coordinates on the earth.
        None takes the unit that the file states, or metres.
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
    goals
        Table of goals (`netsp.exchange.maps.csv_table.from_table`).
    candidates
        Table of places where the base may stand; the cropped map holds the reach from each.
    draught
        Areas of a chart that may be shallower become obstacles, metres; None for none.
    floor
        Whether the sea floor of a chart is made.
    floor_cell
        Side of its cells, metres; None takes the number of cells of the policy.
    crop_margin
        Share of the tether's length by which the cropped map is larger than its reach; 0 or more.
    policy
        Limits and rules of the import.
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
    goals: str | Path | None = None
    candidates: str | Path | None = None
    draught: float | None = None
    floor: bool = False
    floor_cell: float | None = None
    crop_margin: float = 0.05
    policy: ImportPolicy = DEFAULT_IMPORT

    def __post_init__(self) -> None:
        if self.line_width is not None and not 0.0 < self.line_width < math.inf:
            raise InputError(f"line_width: expected a positive width (m), got {self.line_width!r}")
        if not 0.0 < self.join_tolerance < math.inf:
            raise InputError(
                f"join_tolerance: expected a positive length (m), got {self.join_tolerance!r}"
            )
        if self.draught is not None and not 0.0 <= self.draught < math.inf:
            raise InputError(f"draught: expected a depth of 0 m or more, got {self.draught!r}")
        if self.floor_cell is not None and not 0.0 < self.floor_cell < math.inf:
            raise InputError(f"floor_cell: expected a positive length (m), got {self.floor_cell!r}")
        if not 0.0 <= self.crop_margin < math.inf:
            raise InputError(f"crop_margin: expected 0 or more, got {self.crop_margin!r}")

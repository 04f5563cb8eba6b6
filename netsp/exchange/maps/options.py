"""Options of an import that a user states about a map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from netsp.base.errors import InputError
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
from netsp.exchange.maps.selection import Selection


@dataclass(frozen=True)
class InspectionOptions:
    """Inspection of every obstacle (`netsp.model.shorthand.Inspection`).

    Attributes
    ----------
    viewpoints
        Number of viewpoints around each obstacle, at every depth.
    standoff
        Distance from its surface, metres.
    depths
        Heights z, metres.
    chosen
        Obstacles to inspect; default: all.
    """

    viewpoints: int
    standoff: float
    depths: tuple[float, ...] = (0.0,)
    chosen: Selection = field(default_factory=Selection)


@dataclass(frozen=True)
class SiteOptions:
    """Options of an import.

    Attributes
    ----------
    tether
        Length of the tether, metres; None for the file's.
    clearance
        Clearance, metres; None for the file's, or none.
    radius
        Radius of point obstacles that state none, metres.
    crs
        Coordinate system, such as ``EPSG:32632``; ``local`` for a plane without a place on the
        earth.
    units
        Unit of lengths in the file, one of `netsp.base.units.UNITS`, but not of coordinates on the
        earth; None for the unit that the file states, or metres.
    maps
        Kinds of layers and names of properties: ``("obstacle", layer)``, ``("name", property)``.
    inspection
        Inspection of obstacles.
    skip_unreachable
        Whether goals farther from the base than the tether is long are left out.
    line_width
        Width of open lines that are obstacles and state none, metres; None refuses them.
    join_tolerance
        Largest distance of ends of lines that are joined to one outline, metres; positive.
    crop
        Whether obstacles beyond the tether's reach are left out; None for charts only.
    goals
        Table of goals (`netsp.exchange.maps.csv_table.from_table`).
    candidates
        Table of places where the base may stand; the cropped map holds the reach from each.
    draught
        Depth, metres, below which areas of a chart become obstacles; None for none.
    floor
        Whether the sea floor of a chart is made.
    floor_cell
        Side of the floor's cells, metres; None for the number of cells of the policy.
    crop_margin
        Share of the tether's length by which the cropped map exceeds its reach; 0 or more.
    policy
        Limits and rules of the import.
    """

    tether: float | None = None
    clearance: float | None = None
    radius: float | None = None
    crs: str | None = None
    units: str | None = None
    maps: Sequence[tuple[str, str]] = ()
    inspection: InspectionOptions | None = None
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

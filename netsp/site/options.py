"""What a user says of a map besides what stands in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

UNITS = {
    "m": 1.0, "km": 1e3, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "us-ft": 1200.0 / 3937.0,
    "in": 0.0254, "yd": 0.9144, "fathom": 1.8288,
}  # fmt: skip
"""Metres."""


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
        Of lengths in the file, one of `UNITS`; not of coordinates on the earth.
    maps
        Pairs of ours and theirs: ``("obstacle", layer)``, ``("name", property)``.
    looking
        How every obstacle is looked at.
    skip_unreachable
        Goals farther off than the tether is long are left out.
    """

    tether: float | None = None
    clearance: float | None = None
    radius: float | None = None
    crs: str | None = None
    units: str = "m"
    maps: Sequence[tuple[str, str]] = ()
    looking: Looking | None = None
    skip_unreachable: bool = False

"""Conversion between the frames of vehicles and sites.

A vehicle reports its place in metres north, east and down of where its estimate began, or in
degrees.
If a site has an origin on the earth, degrees count; otherwise the estimate is assumed to have begun
at the base, with the site's y axis to the north.
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.errors import InputError
from netsp.base.field_types import Point3
from netsp.exchange.maps.projection import Projection
from netsp.model.problem import Problem
from netsp.world.mission.mission import Mission

DEGREE = 1e-7
"""Unit of MAVLink's whole numbers for degrees."""


class Frame:
    """Conversion between the places of a vehicle and those of a site.

    Parameters
    ----------
    site : Problem or Mission
        Site; a mission has no origin on the earth.
    kind : str, optional
        "local" or "global"; by default global if the site has an origin.

    Attributes
    ----------
    is_given : bool
        Whether the kind was given.
    is_planar : bool
        Whether the site is a problem in the plane, where heights matter little.
    has_origin : bool
        Whether the site has a place on the earth.
    units : str
        Unit of lengths.

    Raises
    ------
    InputError
        The frame is global and the site has no origin, or there is no such kind.
    """

    def __init__(self, site: Problem | Mission, kind: str | None = None) -> None:
        if kind not in (None, "local", "global"):
            raise InputError(f"--frame: expected local or global, got {kind!r}")
        self.site, self.is_given = site, kind is not None
        self.is_planar = isinstance(site, Problem)
        if isinstance(site, Problem):
            projection, origin = Projection.for_problem(site), site.origin
            self.units, base = site.units, site.base
        else:
            projection = origin = None
            self.units, base = "m", site.start
        if kind == "global" and projection is None:
            raise InputError("--frame: global needs an origin, and the site has none")
        self.projection = None if kind == "local" else projection
        self.base, self.has_origin = np.asarray(base, dtype=float), origin is not None
        heading = math.radians(origin.heading) if origin else 0.0
        self._cos, self._sin = math.cos(heading), math.sin(heading)

    @property
    def is_global(self) -> bool:
        """Return whether places are in degrees."""
        return self.projection is not None

    def local(self) -> Frame:
        """Return the frame of the same site for places in metres."""
        return Frame(self.site, "local")

    def from_local(self, north: float, east: float, down: float) -> Point3:
        """Return the place in the site of metres north, east and down of the base."""
        c, s = self._cos, self._sin
        return (
            float(self.base[0]) + c * east - s * north,
            float(self.base[1]) + s * east + c * north,
            -down,
        )

    def velocity(self, north: float, east: float, down: float) -> Point3:
        """Return the velocity in the site of one to the north, east and down."""
        c, s = self._cos, self._sin
        return c * east - s * north, s * east + c * north, -down

    def to_local(self, place: Point3) -> tuple[float, float, float]:
        """Return the metres north, east and down of a place in the site."""
        c, s = self._cos, self._sin
        x, y = place[0] - float(self.base[0]), place[1] - float(self.base[1])
        return -s * x + c * y, c * x + s * y, -place[2]

    def from_global(self, lat: int, lon: int, above_home: float) -> Point3:
        """Return the place in the site of degrees × 1e7 and metres above home."""
        return self.from_degrees(lat * DEGREE, lon * DEGREE, above_home)

    def from_degrees(self, lat: float, lon: float, above_home: float) -> Point3:
        """Return the place in the site of degrees and metres above home."""
        assert self.projection is not None
        ((x, y),) = self.projection.to_plane([(lat, lon)])
        return float(x), float(y), above_home

    def to_global(self, place: Point3) -> tuple[int, int, float]:
        """Return the degrees × 1e7 and metres above home of a place in the site."""
        assert self.projection is not None
        ((lat, lon),) = self.projection.to_earth([place[:2]])
        return round(lat / DEGREE), round(lon / DEGREE), place[2]

"""Projection between a problem's plane and the earth: azimuthal equidistant, centred on the base.

Distances and directions from the base are exact on the WGS 84 ellipsoid; over 500 m the radial
error is below a micrometre (UTM is off by metres there, through its grid convergence).
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.deprecated import deprecated_method
from netsp.base.errors import InputError
from netsp.base.field_types import checked_argument
from netsp.base.validated import shown

if TYPE_CHECKING:
    from netsp.model.problem import Problem

QUARTER_MERIDIAN = 1e7
"""Physical constant: distance from the equator to a pole, m; farther points are refused."""


class Projection:
    """Projection of metres in a problem's plane to degrees and back.

    Parameters
    ----------
    latitude, longitude : float
        Position of the base, degrees.
    heading : float
        Direction of the problem's y axis, degrees clockwise from true north.
    base : tuple of float
        (x, y) of the base in the problem's plane, metres.
    name : str
        Name of the origin in messages.

    Raises
    ------
    InputError
        The origin is out of range, or pyproj is not installed.
    """

    def __init__(
        self,
        latitude: float,
        longitude: float,
        heading: float = 0.0,
        base: tuple[float, float] = (0.0, 0.0),
        name: str = "origin",
    ) -> None:
        self.latitude = checked_argument(f"{name}: latitude", latitude, -90.0, 90.0)
        self.longitude = checked_argument(f"{name}: longitude", longitude, -180.0, 180.0)
        self.heading = checked_argument(f"{name}: heading", heading, -360.0, 360.0)
        pair = _pairs("base", base)
        if len(pair) != 1:
            raise InputError(f"base: expected (x, y), got {shown(base)}")
        self.base = pair[0]

    @classmethod
    def parse(
        cls, text: str, base: tuple[float, float] = (0.0, 0.0), name: str = "origin"
    ) -> Projection:
        """Return the projection of a text ``lat,lon`` or ``lat,lon,heading`` in degrees.

        Raises
        ------
        InputError
            The text is not two or three numbers, or they are out of range.
        """
        if not isinstance(text, str):
            raise InputError(f"{name}: expected lat,lon or lat,lon,heading, got {shown(text)}")
        try:
            numbers = [float(v) for v in text.split(",")]
        except ValueError:
            numbers = []
        if len(numbers) not in (2, 3):
            raise InputError(f"{name}: expected lat,lon or lat,lon,heading, got {text!r}")
        return cls(numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else 0.0, base, name)

    @classmethod
    def for_problem(cls, problem: Problem) -> Projection | None:
        """Return the projection around the base of a problem; None if the problem has no origin."""
        if problem.origin is None:
            return None
        o = problem.origin
        return cls(o.latitude, o.longitude, o.heading, problem.base[:2])

    of = deprecated_method("of", "for_problem")

    @cached_property
    def _transform(self) -> Any:
        try:
            from pyproj import Transformer
        except ImportError:
            raise InputError(
                "positions on the earth need pyproj: pip install 'netsp[geo]'"
            ) from None
        local = (
            f"+proj=aeqd +lat_0={self.latitude!r} +lon_0={self.longitude!r} +datum=WGS84 +units=m"
        )
        return Transformer.from_crs("EPSG:4326", local, always_xy=True)

    def to_earth(self, xy: npt.ArrayLike) -> Floats:
        """Return the latitudes and longitudes of points.

        Parameters
        ----------
        xy : array_like, shape (n, 2)
            Points in the problem's plane, metres.

        Returns
        -------
        ndarray, shape (n, 2)
            Latitude and longitude, degrees.

        Raises
        ------
        InputError
            `xy` is not pairs of finite numbers, or points are beyond the range of the projection.
        """
        d = _pairs("xy", xy) - self.base
        if len(d) and not np.abs(d).max() <= QUARTER_MERIDIAN:
            raise InputError(
                f"xy: expected points within {QUARTER_MERIDIAN / 1e3:g} km of the base, got one "
                f"{np.abs(d).max() / 1e3:.4g} km off"
            )
        c, s = math.cos(math.radians(self.heading)), math.sin(math.radians(self.heading))
        east, north = c * d[:, 0] + s * d[:, 1], -s * d[:, 0] + c * d[:, 1]
        longitude, latitude = self._transform.transform(east, north, direction="INVERSE")
        return np.column_stack([latitude, longitude])

    def to_plane(self, latlon: npt.ArrayLike) -> Floats:
        """Return the points of latitudes and longitudes.

        Parameters
        ----------
        latlon : array_like, shape (n, 2)
            Latitude and longitude, degrees.

        Returns
        -------
        ndarray, shape (n, 2)
            Points in the problem's plane, metres.

        Raises
        ------
        InputError
            `latlon` is not pairs of finite numbers, or off the globe.
        """
        p = _pairs("latlon", latlon)
        if len(p) and not (np.abs(p) <= (90.0, 360.0)).all():
            raise InputError(
                "latlon: expected latitudes within 90 and longitudes within 360 degrees"
            )
        east, north = self._transform.transform(p[:, 1], p[:, 0])
        c, s = math.cos(math.radians(self.heading)), math.sin(math.radians(self.heading))
        return np.asarray(np.column_stack([c * east - s * north, s * east + c * north]) + self.base)


def _pairs(name: str, value: npt.ArrayLike) -> Floats:
    """Return an argument as an array (n, 2) of finite numbers."""
    try:
        given = np.asarray(value)
        pairs = np.atleast_2d(given).astype(float)
        if (given.dtype.kind not in "iuf" and given.size) or given.ndim not in (1, 2):
            raise ValueError
        pairs = pairs.reshape(0, 2) if not given.size else pairs
        if pairs.shape[1] != 2:
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}: expected pairs of numbers, got {shown(value)}") from None
    if not np.isfinite(pairs).all():
        raise InputError(f"{name}: expected finite numbers, got {shown(value)}")
    return pairs

"""Axes of coordinate systems: directions and units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from netsp.base.deprecated import deprecated_names
from netsp.base.errors import InputError


@dataclass(frozen=True)
class HeightAxis:
    """Vertical axis of a coordinate system.

    Parameters
    ----------
    sign : float
        1 where values count upwards, -1 where they are depths.
    metres : float
        Metres per unit.
    is_stated : bool
        Whether the system has a vertical axis; else heights are taken in the unit of the map.
    """

    sign: float = 1.0
    metres: float = 1.0
    is_stated: bool = False

    @property
    def change(self) -> str:
        """Note on converted heights; empty for heights in metres upwards."""
        parts = ["count downwards"] if self.sign < 0.0 else []
        parts += [f"are in units of {self.metres:.7g} m"] if self.metres != 1.0 else []
        return f"heights {' and '.join(parts)}: converted to metres upwards" if parts else ""


def height_axis(crs: Any) -> HeightAxis:
    """Return the direction and the unit of heights in a coordinate system.

    Without a vertical system, heights count upwards, in the unit of a projected map, or in metres
    for a system in degrees.

    Parameters
    ----------
    crs : pyproj.CRS or str
        Coordinate system, such as ``EPSG:25832+5715`` (depths in metres).

    Raises
    ------
    InputError
        Unknown system, or pyproj is not installed.
    """
    system = _system(crs)
    for axis in system.axis_info:
        direction = axis.direction.lower()
        if direction in ("up", "down"):
            factor = axis.unit_conversion_factor or 1.0
            return HeightAxis(-1.0 if direction == "down" else 1.0, float(factor), True)
    return HeightAxis(1.0, map_unit(system) or 1.0)


def map_unit(crs: Any) -> float | None:
    """Return the metres per unit of a coordinate system's map; None if it is in angles.

    Raises
    ------
    InputError
        Unknown or geocentric system, or pyproj is not installed.
    """
    system = _system(crs)
    if system.is_geographic:  # in degrees or grads
        return None
    if system.is_geocentric:
        raise InputError(
            "geocentric coordinates (from the centre of the earth); expected map coordinates, such "
            "as UTM"
        )
    for axis in system.axis_info:
        if axis.direction.lower() not in ("up", "down"):
            return float(axis.unit_conversion_factor or 1.0)
    return 1.0


def _system(crs: Any) -> Any:
    try:
        from pyproj import CRS
        from pyproj.exceptions import ProjError
    except ImportError:
        raise InputError("positions on the earth need pyproj: pip install 'netsp[geo]'") from None
    try:
        return CRS.from_user_input(crs)
    except ProjError as error:
        raise InputError(
            f"crs: expected a coordinate system as EPSG:32632, got {str(crs)[:60]!r} "
            f"({str(error).splitlines()[0][:80]})"
        ) from None


__getattr__ = deprecated_names(
    globals(),
    UNITS="netsp.base.units:UNITS",
    metres_per_unit="netsp.base.units:metres_per_unit",
    column="netsp.base.columns:column",
    height_meaning="netsp.base.columns:height_meaning",
    marks_of_no_height="netsp.world.scene.missing_heights:marks_of_no_height",
    Table="netsp.base.table_file:Table",
    read_table="netsp.base.table_file:read_table",
    read_path="netsp.base.polyline_file:read_path",
)

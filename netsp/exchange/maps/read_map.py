"""Map of any format; extension and content decide which."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from netsp.base.deprecated import deprecated_names
from netsp.base.errors import InputError
from netsp.base.registry import Registry, check_callable, foreign, later, load_target
from netsp.base.validated import shown
from netsp.exchange.maps.chart_reader import is_chart, read_chart
from netsp.exchange.maps.drawing import read_dxf
from netsp.exchange.maps.feature import Feature, Map
from netsp.exchange.maps.fence_list import read_fence_list, read_rally_list
from netsp.exchange.maps.geojson import read_geojson, read_geojson_sequence
from netsp.exchange.maps.gpx import read_gpx_map
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
from netsp.exchange.maps.kml_pages import read_kml
from netsp.exchange.maps.qgc_plan import is_plan, read_plan
from netsp.exchange.maps.vector import in_degrees, read_vector
from netsp.exchange.maps.waypoint_list import is_waypoint_list, read_waypoint_list

SEQUENCE_SUFFIXES = (".geojsonl", ".geojsons", ".geojsonseq", ".ndjson", ".ndgeojson", ".jsonl")
"""Extensions of sequences of GeoJSON texts."""


EARTH_READERS = {
    ".plan": read_plan,
    ".waypoints": read_waypoint_list,
    ".wpl": read_waypoint_list,
    ".gpx": read_gpx_map,
    ".fen": read_fence_list,
    ".ral": read_rally_list,
}
"""Readers of formats that are always in degrees, by extension."""

OTHER_SUFFIXES = (".dxf", ".kml", ".kmz", ".geojson", ".json")
"""Extensions of the other formats that netsp reads itself."""


class MapReaders(Registry[Callable[[str], Map]]):
    """Readers of other packages by extension without the dot, each called with a path."""

    def __setitem__(self, name: str, record: Callable[[str], Map]) -> None:
        ours = (*EARTH_READERS, *SEQUENCE_SUFFIXES, *OTHER_SUFFIXES)
        if not isinstance(name, str) or not name or name != name.lower().lstrip("."):
            raise InputError(
                f"map reader: got {shown(name)}; expected an extension in lower case, without dot"
            )
        if f".{name}" in ours:
            raise InputError(f"map reader: {name!r} is read by netsp itself; expected another")
        super().__setitem__(name, record)


MAP_READERS: Registry[Callable[[str], Map]] = MapReaders("map reader", "netsp.maps", {}, later)
"""Readers of other packages by extension without the dot, each called with a path."""


def read_map(
    file: str | Path,
    crs: str | None = None,
    units: str | None = None,
    policy: ImportPolicy = DEFAULT_IMPORT,
) -> Map:
    """Return a map of any format; the file's extension and content decide which.

    Parameters
    ----------
    crs : str, optional
        Coordinate system, ``local`` for a plane without a place on the earth.
    units : str, optional
        Unit of lengths that the user states; None for the file's.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    suffix = Path(file).suffix.lower()
    reader = EARTH_READERS.get(suffix)
    if suffix == ".txt" and is_waypoint_list(file):
        reader = read_waypoint_list
    elif suffix == ".json" and is_plan(file):
        reader = read_plan
    if reader is not None:
        if crs is not None:
            raise InputError(f"--crs: {file} is in degrees always; expected no system")
        return reader(file, policy)
    if is_chart(file, policy.read):
        return read_chart(file, crs, units, policy.read)
    if suffix == ".dxf":
        return read_dxf(file, crs, units, policy)
    if suffix in (".kml", ".kmz"):
        found = read_kml(file, crs, policy.read)
    elif suffix in (".geojson", ".json"):
        found = read_geojson(file, crs, policy.read)
    elif suffix in SEQUENCE_SUFFIXES:
        found = read_geojson_sequence(file, crs, policy.read)
    elif suffix[1:] in MAP_READERS:
        found = _read_by_plugin(file, suffix[1:])
    else:
        return read_vector(file, crs, policy.read)
    return found if crs is None else in_degrees(found, crs, file)


def _read_by_plugin(file: str | Path, extension: str) -> Map:
    """Return the map that a reader of another package makes of a file."""
    what = f"{file}: reader of .{extension}"
    with foreign(f"{what} failed"):
        reader = MAP_READERS[extension]
        check_callable(what, load_target(reader), ["file"])
        found = reader(str(file))
    if not isinstance(found, Map):
        raise InputError(f"{what}: expected a Map from it, got {shown(found)}")
    for feature in found.features:
        _check_feature(feature, what)
    return found


def _check_feature(feature: object, what: str) -> None:
    """Raise InputError unless a feature of another package has properties and a finite shape."""
    import shapely

    if not isinstance(feature, Feature):
        raise InputError(f"{what}: expected a Feature, got {shown(feature)}")
    where = f"{what}: {feature.where}"
    if not isinstance(feature.properties, Mapping):
        raise InputError(f"{where}: expected names with values, got {shown(feature.properties)}")
    shape = feature.shape
    if not isinstance(shape, shapely.Geometry) or shape.is_empty:
        raise InputError(
            f"{where}: expected a shape, got {shown(shape)}; name a feature without one in unread"
        )
    if not np.isfinite(shapely.get_coordinates(shape)).all():
        raise InputError(f"{where}: expected finite coordinates, got {shown(shape)}")


__getattr__ = deprecated_names(
    globals(),
    ImportedSite="netsp.exchange.maps.imported_site:ImportedSite",
    import_site="netsp.exchange.maps.site_import:import_site",
    read_site="netsp.exchange.maps.site_import:read_site",
)

"""Reader of GeoJSON (RFC 7946) that names the feature in every complaint."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from netsp.base.errors import InputError, UnansweredError
from netsp.base.files import read_text
from netsp.base.validated import parse_json_object, shown
from netsp.exchange.maps.feature import Feature, Map, Unread, with_tags
from netsp.exchange.maps.import_policy import DEFAULT_READ, ReadPolicy

if TYPE_CHECKING:
    import shapely

SHAPES = {
    "Point": 0,
    "MultiPoint": 1,
    "LineString": 1,
    "MultiLineString": 2,
    "Polygon": 2,
    "MultiPolygon": 3,
}
"""Depth of the positions in the lists of coordinates, by type of geometry."""

COLLECTION = "GeometryCollection"

RECORD_SEPARATOR = "\x1e"
"""Character before each text of a sequence (RFC 8142)."""


def read_geojson(file: str | Path, crs: str | None, policy: ReadPolicy = DEFAULT_READ) -> Map:
    """Return a GeoJSON file as a map in degrees, unless the user states another system.

    Parameters
    ----------
    crs : str, optional
        Coordinate system that the user states; None for degrees, as in RFC 7946.

    Raises
    ------
    InputError
        The file is not GeoJSON, or names another coordinate system than WGS 84.
    """
    return _map(file, _checked_features(read_text(file), str(file), crs), crs, policy)


def read_geojson_sequence(
    file: str | Path, crs: str | None, policy: ReadPolicy = DEFAULT_READ
) -> Map:
    """Return a sequence of GeoJSON texts as a map, as `read_geojson`.

    Parameters
    ----------
    file : str or Path
        Texts after record separators (RFC 8142), or one in each line.

    Raises
    ------
    InputError
        A text is not GeoJSON. It is not skipped, because it may be an obstacle.
    """
    text = read_text(file)
    is_separated = RECORD_SEPARATOR in text
    parts = text.split(RECORD_SEPARATOR) if is_separated else text.split("\n")
    features: list[Any] = []
    for k, part in enumerate(parts, 0 if is_separated else 1):
        if part.strip():
            called = f"{file}: {'text' if is_separated else 'line'} {k}"
            features += _checked_features(part, called, crs)
    if not features:
        raise InputError(f"{file}: cannot be read as a map: holds no GeoJSON")
    return _map(file, features, crs, policy)


def _checked_features(text: str, called: str, crs: str | None) -> list[Any]:
    """Return the features of a GeoJSON text in WGS 84, or in the system that the user gives."""
    data = parse_json_object(text, called)
    features = _features_of(data)
    if features is None:
        raise InputError(f"{called}: expected a GeoJSON FeatureCollection, Feature or geometry")
    system = data.get("crs")
    if crs is None and system is not None and not _is_wgs84(system):
        plain = f"{called}: crs: expected WGS 84 as RFC 7946 has it, got {json.dumps(system)[:120]}"
        raise UnansweredError([f"{plain}; give another with --crs"], [plain], ["crs"])
    return features


def _map(file: str | Path, features: list[Any], crs: str | None, policy: ReadPolicy) -> Map:
    """Return the map of features, named by their numbers."""
    found: list[Feature] = []
    unread: list[Unread] = []
    complaints = []
    for k, feature in enumerate(features):
        where = f"features[{k}]"
        try:
            for part in _feature(feature, where, policy, degrees=crs is None):
                (unread if isinstance(part, Unread) else found).append(part)  # type: ignore[arg-type]
        except _NowhereError as error:
            unread.append(Unread(where, "", str(error)))
        except InputError as error:
            complaints.append(f"{file}: {error}")
    # the parts of a GeometryCollection count as features of their own
    count = len({f.where for f in found}) + len(unread) + len(complaints)
    return Map(tuple(found), True, {"": count}, tuple(complaints), unread=tuple(unread))


class _NowhereError(Exception):
    """Feature without a place, which RFC 7946 allows; the text is the reason."""


def _features_of(data: dict[str, Any]) -> list[Any] | None:
    """Return the features of a GeoJSON object of any type; None if it is no GeoJSON."""
    kind = data.get("type")
    if kind == "FeatureCollection":
        features = data.get("features")
        return features if isinstance(features, list) else None
    if kind == "Feature":
        return [data]
    if isinstance(kind, str) and (kind in SHAPES or kind == COLLECTION):
        return [{"type": "Feature", "geometry": data, "properties": {}}]
    return None


def _is_wgs84(crs: Any) -> bool:
    text = json.dumps(crs)
    return "CRS84" in text or "4326" in text


def _feature(data: Any, where: str, policy: ReadPolicy, *, degrees: bool) -> list[Feature | Unread]:
    """Return a feature, or one for each part of a GeometryCollection; empty parts are unread."""
    if not isinstance(data, dict) or "geometry" not in data:
        raise InputError(f"{where}: expected a feature with a geometry")
    geometry, properties = data["geometry"], data.get("properties") or {}
    if geometry is None:
        raise _NowhereError("has no geometry")
    if not isinstance(geometry, dict) or not isinstance(properties, dict):
        raise InputError(f"{where}: expected an object as geometry and as properties")
    properties = with_tags(properties)
    identity = data.get("id")
    named = "" if identity is None else str(identity)
    parts = list(_parts(geometry, where, policy.max_collection_depth))
    if not parts:
        raise _NowhereError("is an empty collection of geometries")
    out: list[Feature | Unread] = []
    for place, part in parts:
        try:
            shape = _shape(part, place, degrees=degrees)
        except _NowhereError as error:
            out.append(Unread(place, "", str(error)))
        else:
            out.append(Feature(place, "", named, properties, shape))
    return out


def _parts(
    geometry: dict[str, Any], where: str, max_depth: int, depth: int = 0
) -> Iterator[tuple[str, Any]]:
    """Yield the geometries of a collection with their names in messages."""
    if geometry.get("type") != COLLECTION:
        yield where, geometry
        return
    inner = geometry.get("geometries")
    if not isinstance(inner, list) or depth >= max_depth:
        raise InputError(
            f"{where}: expected a list of geometries, nested at most {max_depth} times"
        )
    for k, part in enumerate(inner):
        place = f"{where}.geometries[{k}]"
        if not isinstance(part, dict):
            raise InputError(f"{place}: expected a geometry, got {shown(part)}")
        yield from _parts(part, place, max_depth, depth + 1)


def _shape(geometry: dict[str, Any], where: str, *, degrees: bool) -> shapely.Geometry:
    import shapely
    from shapely.geometry import shape

    kind = geometry.get("type")
    coordinates: Any = geometry.get("coordinates")
    if not isinstance(kind, str) or kind not in SHAPES:
        raise InputError(
            f"{where}: expected a {', '.join((*SHAPES, COLLECTION))}, got {shown(kind)}"
        )
    if coordinates == []:  # RFC 7946, 3.1: an empty list is a geometry without places
        raise _NowhereError("has no coordinates")
    _check(coordinates, SHAPES[kind], kind, where, degrees=degrees)
    if kind.endswith("Polygon"):
        for rings in coordinates if kind == "MultiPolygon" else [coordinates]:
            for ring in rings:
                if len(ring) < 4 or ring[0] != ring[-1]:
                    raise InputError(f"{where}: expected a closed ring of four positions or more")
    elif kind.endswith("LineString"):
        for line in coordinates if kind == "MultiLineString" else [coordinates]:
            if len(line) < 2:
                raise InputError(f"{where}: expected a line of two positions or more")
    try:
        return shape({"type": kind, "coordinates": _same_size(coordinates, kind)})
    except (ValueError, TypeError, shapely.errors.ShapelyError) as error:
        raise InputError(f"{where}: not a {kind}: {str(error).splitlines()[0]}") from None


def _check(coordinates: Any, depth: int, kind: str, where: str, *, degrees: bool) -> None:
    """Check that lists are as deep as the kind has them, with positions at their ends."""
    if depth:
        if not isinstance(coordinates, list) or not coordinates:
            expected = "a polygon with an outer ring" if kind.endswith("Polygon") else f"a {kind}"
            raise InputError(f"{where}: expected {expected}, got {json.dumps(coordinates)[:60]}")
        for part in coordinates:
            _check(part, depth - 1, kind, where, degrees=degrees)
        return
    c = coordinates
    good = (
        isinstance(c, list)
        and len(c) >= 2
        and all(
            isinstance(v, (int, float)) and not isinstance(v, bool) and -1e12 <= v <= 1e12
            for v in c
        )
    )
    if not good or (degrees and (abs(c[0]) > 180.0 or abs(c[1]) > 90.0)):
        metres = good and "; if these are metres, say in which system with --crs"
        raise InputError(
            f"{where}: expected [longitude, latitude] within 180 and 90 degrees, got "
            f"{json.dumps(c)[:60]}{metres or ''}"
        )


def _same_size(coordinates: Any, kind: str) -> Any:
    """Return positions with two or three numbers, all alike, because Shapely requires that.

    Points keep their heights, with NaN where some have none; heights of lines and areas are
    ignored.
    """
    sizes: set[int] = set()

    def visit(c: Any) -> None:
        if isinstance(c[0], list):
            for part in c:
                visit(part)
        else:
            sizes.add(min(len(c), 3))

    def cut(c: Any, size: int) -> Any:
        if isinstance(c[0], list):
            return [cut(p, size) for p in c]
        return [*c[:size], *[math.nan] * (size - len(c))]

    visit(coordinates)
    return cut(coordinates, max(sizes) if kind == "MultiPoint" else min(sizes))

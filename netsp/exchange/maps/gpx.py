"""Reader of GPX files (1.0 and 1.1): waypoints, tracks and routes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from netsp.base.errors import InputError, counted
from netsp.base.files import read_bytes
from netsp.base.validated import shown
from netsp.exchange.maps.feature import Feature, Map, Unread
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, DEFAULT_READ, ImportPolicy, ReadPolicy
from netsp.exchange.maps.time_stamps import seconds_of

HEADER = ("name", "desc", "author", "email", "url", "urlname", "time", "keywords", "bounds")
"""Elements of GPX 1.0 that describe the whole file."""

FORBIDDEN = (b"<!DOCTYPE", b"<!ENTITY")
"""XML declarations that are refused: GPX needs none, and entities can expand without end."""


@dataclass(frozen=True)
class GpxPoint:
    """Point of a track or a route, in degrees and metres.

    Attributes
    ----------
    time_s
        Seconds since 1970.
    """

    latitude: float
    longitude: float
    height: float | None = None
    time_s: float | None = None


@dataclass(frozen=True)
class GpxLine:
    """Route, or track with its segments joined; two points or more.

    Attributes
    ----------
    name
        Name; empty if it has none.
    """

    name: str
    points: tuple[GpxPoint, ...]


def read_gpx(
    file: str | Path,
    on_note: Callable[[str], None] | None = None,
    policy: ReadPolicy = DEFAULT_READ,
) -> list[GpxLine]:
    """Return the tracks and routes of a GPX file, in its order.

    Parameters
    ----------
    on_note : callable, optional
        Called with one line for each part left out and for segments that are joined.

    Raises
    ------
    InputError
        The file is not GPX, a point has no position, or no track or route has two points.
    """
    note = on_note or (lambda _: None)
    lines: list[GpxLine] = []
    count = {"trk": 0, "rte": 0, "wpt": 0}
    for element in _root(file):
        kind = _tag(element)
        if kind not in count:
            continue  # describes the file
        count[kind] += 1
        if kind == "wpt":
            continue
        name = f"{kind}[{count[kind] - 1}]"
        parts = [points for _, points in _parts(element)]
        points = [p for part in parts for p in part]
        read = tuple(_point(p, f"{file}: {name}: point {k}", policy) for k, p in enumerate(points))
        if len(read) < 2:
            note(f"{name} left out: has fewer than two points")
            continue
        if len(parts) > 1:
            note(f"{name}: its {len(parts)} segments are joined by straight lines")
        lines.append(GpxLine((_text(element, "name") or "").strip(), read))
    if lines and count["wpt"]:
        note(f"{counted(count['wpt'], 'waypoint')} left out: no part of a path")
    if not lines:
        raise InputError(
            f"{file}: expected a track or a route of two points or more, got {count['trk']} "
            f"tracks, {count['rte']} routes and {count['wpt']} waypoints"
        )
    return lines


def _root(file: str | Path) -> ElementTree.Element:
    """Return the root of a GPX file."""
    data = read_bytes(file)
    if any(word in data.upper() for word in FORBIDDEN):
        raise InputError(
            f"{file}: expected GPX without a document type, got {FORBIDDEN[0].decode()}"
        )
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        raise InputError(f"{file}: not XML: {error}") from None
    if _tag(root) != "gpx":
        raise InputError(f"{file}: expected a gpx element, got {shown(_tag(root))}")
    return root


def read_gpx_map(file: str | Path, policy: ImportPolicy = DEFAULT_IMPORT) -> Map:
    """Return a GPX file as a map in degrees: waypoints are goals, tracks and routes paths.

    Heights of waypoints are z. Texts and extensions of waypoints are properties, so that the
    `depth` of a dive computer counts.

    Raises
    ------
    InputError
        The file is not GPX.
    """
    import shapely

    features: list[Feature] = []
    unread: list[Unread] = []
    complaints: list[str] = []
    notes: list[str] = []
    layers: dict[str, int] = {}
    for element in _root(file):
        kind = _tag(element)
        if kind == "metadata" or (kind in HEADER and not len(element)):
            continue  # describes the file
        where = f"{kind}[{layers.get(kind, 0)}]"
        layers[kind] = layers.get(kind, 0) + 1
        if kind not in ("wpt", "trk", "rte"):
            unread.append(Unread(where, kind, "an element that is no part of GPX's places"))
            continue
        try:
            if kind == "wpt":
                point = _point(element, where, policy.read)
                place = shapely.Point(point.longitude, point.latitude, point.height or 0.0)
                features.append(Feature(where, kind, "", _properties(element, "goal"), place))
                continue
            lines = [
                (name, [_point(p, f"{name}: point {k}", policy.read) for k, p in enumerate(part)])
                for name, part in ((where + segment, part) for segment, part in _parts(element))
            ]
        except InputError as error:
            complaints.append(f"{file}: {error}")
            continue
        drawn = [[(p.longitude, p.latitude) for p in line] for _, line in lines if len(line) > 1]
        if not drawn:
            unread.append(Unread(where, kind, "has no two points in a row"))
            continue
        notes += [
            f"{name} left out: has fewer than two points" for name, line in lines if len(line) < 2
        ]
        shape = shapely.LineString(drawn[0]) if len(drawn) == 1 else shapely.MultiLineString(drawn)
        features.append(Feature(where, kind, "", _properties(element, "path"), shape))
    return Map(tuple(features), True, layers, tuple(complaints), tuple(notes), tuple(unread))


def _parts(element: ElementTree.Element) -> list[tuple[str, list[ElementTree.Element]]]:
    """Return the segments of a track, or the whole of a route: their names and their points."""
    if _tag(element) == "rte":
        return [("", [p for p in element if _tag(p) == "rtept"])]
    segments = [e for e in element if _tag(e) == "trkseg"]
    return [
        (f" trkseg[{k}]", [p for p in segment if _tag(p) == "trkpt"])
        for k, segment in enumerate(segments)
    ]


def _properties(element: ElementTree.Element, kind: str) -> dict[str, str]:
    """Return the texts of an element and of its extensions by name, with the kind."""
    found: dict[str, str] = {}
    points = ("trkseg", "trkpt", "rtept")
    for child in element:
        parts = child.iter() if _tag(child) == "extensions" else [child]
        for part in parts:
            if _tag(part) not in points and part.text and part.text.strip():
                found.setdefault(_tag(part), part.text.strip())
    return {**found, "kind": kind}


def _tag(element: ElementTree.Element) -> str:
    return str(element.tag).rpartition("}")[2].lower()


def _text(element: ElementTree.Element, name: str) -> str | None:
    return next((child.text for child in element if _tag(child) == name), None)


def _point(element: ElementTree.Element, where: str, policy: ReadPolicy) -> GpxPoint:
    latitude = _number(element.get("lat"), 90.0, f"{where}: lat")
    longitude = _number(element.get("lon"), 180.0, f"{where}: lon")
    height = _text(element, "ele")
    depth = next((e.text for e in element.iter() if _tag(e) == "depth" and e.text), None)
    if depth is not None:  # dive computers write it into an extension
        height = str(0.0 - _number(depth, policy.max_height, f"{where}: depth"))
    time = _text(element, "time")
    return GpxPoint(
        latitude,
        longitude,
        None
        if height is None or not height.strip()
        else _number(height, policy.max_height, f"{where}: ele"),
        None if time is None or not time.strip() else seconds_of(time, f"{where}: time"),
    )


def _number(text: str | None, max_value: float, where: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not abs(value) <= max_value:
        raise InputError(f"{where}: expected a number within {max_value:g}, got {shown(text)}")
    return value

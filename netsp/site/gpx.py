"""GPX files (1.0 and 1.1), read without any other library: waypoints, tracks and routes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from xml.etree import ElementTree

from netsp.errors import InputError
from netsp.files import read_bytes
from netsp.models import shown
from netsp.site.feature import Feature, Map, Unread

MAX_HEIGHT = 12_000.0
"""Largest height or depth in a file, metres; no place on the earth exceeds it."""

HEADER = ("name", "desc", "author", "email", "url", "urlname", "time", "keywords", "bounds")
"""Elements of GPX 1.0 that describe the whole file."""

FORBIDDEN = (b"<!DOCTYPE", b"<!ENTITY")
"""XML declarations that are refused: GPX needs none, and entities can expand without end."""


@dataclass(frozen=True)
class GpxPoint:
    """Point of a track or a route.

    Parameters
    ----------
    latitude, longitude : float
        Position, degrees.
    height : float, optional
        Height, metres.
    time_s : float, optional
        Time, seconds since 1970.
    """

    latitude: float
    longitude: float
    height: float | None = None
    time_s: float | None = None


@dataclass(frozen=True)
class GpxLine:
    """Track, with its segments joined, or route.

    Parameters
    ----------
    name : str
        Name; empty if it has none.
    points : tuple of GpxPoint
        Two points or more.
    """

    name: str
    points: tuple[GpxPoint, ...]


def read_gpx(file: str | Path) -> list[GpxLine]:
    """Read the tracks and routes of a GPX file.

    Parameters
    ----------
    file : str or Path
        The file.

    Returns
    -------
    list of GpxLine
        In the order of the file.

    Raises
    ------
    InputError
        Not GPX, a point without a position, or neither a track nor a route of two points.
    """
    root = _root(file)
    lines: list[GpxLine] = []
    count = {"trk": 0, "rte": 0, "wpt": 0}
    for element in root:
        kind = _tag(element)
        if kind not in count:
            continue
        count[kind] += 1
        if kind == "wpt":
            continue
        where = f"{file}: {kind}[{count[kind] - 1}]"
        wanted = ("trkpt", "rtept")
        points = [p for p in element.iter() if _tag(p) in wanted]
        read = tuple(_point(p, f"{where}: point {k}") for k, p in enumerate(points))
        if len(read) >= 2:
            lines.append(GpxLine((_text(element, "name") or "").strip(), read))
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


def read_gpx_map(file: str | Path) -> Map:
    """Read a GPX file as a map: waypoints are goals, tracks and routes paths.

    Parameters
    ----------
    file : str or Path
        The file.

    Returns
    -------
    Map
        In degrees; heights of waypoints are z. Texts and extensions of waypoints are properties, so
        that a `depth` of a dive computer counts.

    Raises
    ------
    InputError
        Not GPX.
    """
    import shapely

    features: list[Feature] = []
    unread: list[Unread] = []
    complaints: list[str] = []
    layers: dict[str, int] = {}
    for element in _root(file):
        kind = _tag(element)
        if kind == "metadata" or (kind in HEADER and not len(element)):
            continue  # says nothing of places
        where = f"{kind}[{layers.get(kind, 0)}]"
        layers[kind] = layers.get(kind, 0) + 1
        if kind not in ("wpt", "trk", "rte"):
            unread.append(Unread(where, kind, "an element that is no part of GPX's places"))
            continue
        try:
            if kind == "wpt":
                point = _point(element, where)
                at = shapely.Point(point.longitude, point.latitude, point.height or 0.0)
                features.append(Feature(where, kind, "", _properties(element, "goal"), at))
                continue
            parts = [e for e in element if _tag(e) == "trkseg"] if kind == "trk" else [element]
            lines = [
                [_point(p, f"{where}: point {k}") for k, p in enumerate(part)
                 if _tag(p) in ("trkpt", "rtept")]
                for part in parts
            ]  # fmt: skip
        except InputError as error:
            complaints.append(f"{file}: {error}")
            continue
        drawn = [[(p.longitude, p.latitude) for p in line] for line in lines if len(line) > 1]
        if not drawn:
            unread.append(Unread(where, kind, "has no two points in a row"))
            continue
        shape = shapely.LineString(drawn[0]) if len(drawn) == 1 else shapely.MultiLineString(drawn)
        features.append(Feature(where, kind, "", _properties(element, "path"), shape))
    return Map(tuple(features), True, layers, tuple(complaints), unread=tuple(unread))


def _properties(element: ElementTree.Element, kind: str) -> dict[str, str]:
    """Return the texts of an element and of its extensions, by their names; the kind is ours."""
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


def _point(element: ElementTree.Element, where: str) -> GpxPoint:
    latitude = _number(element.get("lat"), 90.0, f"{where}: lat")
    longitude = _number(element.get("lon"), 180.0, f"{where}: lon")
    height = _text(element, "ele")
    time = _text(element, "time")
    return GpxPoint(
        latitude, longitude,
        None if height is None or not height.strip()
        else _number(height, MAX_HEIGHT, f"{where}: ele"),
        None if time is None or not time.strip() else seconds_of(time, f"{where}: time"),
    )  # fmt: skip


def _number(text: str | None, most: float, where: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not abs(value) <= most:
        raise InputError(f"{where}: expected a number within {most:g}, got {shown(text)}")
    return value


def seconds_of(text: str, where: str) -> float:
    """Return the seconds since 1970 of an ISO 8601 time; without a time zone it is UTC.

    Parameters
    ----------
    text : str
        The time.
    where : str
        Name of the value in messages.

    Returns
    -------
    float
        Seconds since 1970.

    Raises
    ------
    InputError
        No such time.
    """
    try:
        time = datetime.fromisoformat(text.strip())
        return (time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError, OSError):
        raise InputError(
            f"{where}: expected a time such as 2026-05-01T12:00:00Z, got {shown(text)}"
        ) from None

"""Tracks and routes of GPX files (1.0 and 1.1), read without any other library."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from xml.etree import ElementTree

from netsp.errors import InputError
from netsp.files import read_bytes
from netsp.models import shown

MAX_HEIGHT = 12_000.0
"""Largest height or depth in a file, metres; no place on the earth exceeds it."""

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

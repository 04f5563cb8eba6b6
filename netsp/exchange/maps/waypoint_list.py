"""Waypoint lists of QGroundControl and Mission Planner (QGC WPL 110): missions and fences."""

from __future__ import annotations

import re
from pathlib import Path

from netsp.base.errors import InputError
from netsp.base.files import read_text
from netsp.base.validated import shown
from netsp.exchange.maps.feature import Map
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
from netsp.exchange.maps.mission_commands import (
    FRAMES_ABOVE_SEA,
    MissionItem,
    add_home,
    features_of_items,
)

HEAD = re.compile(r"QGC\s+WPL\s+1[0-9]0\s*")

COLUMN_COUNT = 12
"""Format QGC WPL 110: number, current, frame, command, four parameters, place, autocontinue."""


def is_waypoint_list(file: str | Path) -> bool:
    """Return whether a text file begins as a waypoint list does."""
    first = read_text(file).lstrip().partition("\n")[0]
    return HEAD.fullmatch(first) is not None


def read_waypoint_list(file: str | Path, policy: ImportPolicy = DEFAULT_IMPORT) -> Map:
    """Return a waypoint list, also of a fence or of rally points, as a map in degrees.

    Waypoints are goals, and row 0 is home, which is the base.

    Raises
    ------
    InputError
        The file is no such list.
    """
    lines = [(k, line.strip()) for k, line in enumerate(read_text(file).splitlines(), 1)]
    lines = [(k, line) for k, line in lines if line and not line.startswith("#")]
    if not lines or HEAD.fullmatch(lines[0][1]) is None:
        got = lines[0][1] if lines else ""
        raise InputError(f"{file}: expected QGC WPL 110 in the first line, got {shown(got)}")
    max_number = policy.read.max_number
    rows = [_row(n, line, f"{file}: line {k}", max_number) for n, (k, line) in enumerate(lines[1:])]
    home = rows[0] if rows and _is_home(rows[0], lines[1][1]) else None
    items = rows[1:] if home is not None else rows
    altitude = None if home is None else home.place[2]
    found = features_of_items(items, altitude, None if home is None else home.lonlat, policy)
    if home is not None:
        add_home(found, home.where, home.lonlat)
    return Map(
        tuple(found.features),
        True,
        found.layers(),
        tuple(f"{file}: {c}" for c in found.complaints),
        tuple(found.notes),
        tuple(found.unread),
    )


def _is_home(item: MissionItem, line: str) -> bool:
    """Return whether an item is home, which ArduPilot stores as waypoint 0, above the sea."""
    number = line.split()[0]
    return int(float(number)) == 0 and item.command == 16 and item.frame in FRAMES_ABOVE_SEA


def _row(index: int, line: str, where: str, max_number: float) -> MissionItem:
    cells = line.split()
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        numbers = []
    if len(numbers) != COLUMN_COUNT or not all(abs(v) <= max_number for v in numbers):
        raise InputError(f"{where}: expected {COLUMN_COUNT} numbers, got {shown(line)}")
    lat, lon, altitude = numbers[8:11]
    return MissionItem(
        f"waypoints[{index}]",
        int(numbers[3]),
        int(numbers[2]),
        tuple(numbers[4:8]),
        (lat, lon, altitude),
    )

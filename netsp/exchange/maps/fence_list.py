"""Lists of Mission Planner: fences (.fen), a corner in each line, and rally points (.ral)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from netsp.base.errors import InputError
from netsp.base.files import read_bytes
from netsp.base.table_file import decode_text
from netsp.base.validated import shown
from netsp.exchange.maps.feature import Feature, Map, Unread
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
from netsp.exchange.maps.mission_commands import FENCE, RALLY, ItemFeatures, add_polygon
from netsp.exchange.maps.waypoint_list import is_waypoint_list, read_waypoint_list

if TYPE_CHECKING:
    import shapely


def read_fence_list(file: str | Path, policy: ImportPolicy = DEFAULT_IMPORT) -> Map:
    """Return a fence as a map in degrees, with the fence as bounds.

    The file is a list of Mission Planner, with the place to return to after a breach and then the
    corners, or a waypoint list with a fence.

    Raises
    ------
    InputError
        The file is no such list.
    """
    if is_waypoint_list(file):
        return read_waypoint_list(file, policy)
    places = [_lonlat(cells, where) for where, cells in _rows(file)]
    if len(places) < 4:
        raise InputError(
            f"{file}: expected a fence: the place to return to, then three corners or more, each "
            f"as latitude and longitude, got {len(places)} lines"
        )
    found = ItemFeatures(policy)
    found.unread.append(
        Unread(
            "fence[0]",
            FENCE,
            "where the vehicle goes after a breach of the fence",
            _point(places[0]),
        )
    )
    add_polygon(found, "fence[1]", places[1:], is_inclusion=True)
    return Map(tuple(found.features), True, found.layers(), (), (), tuple(found.unread))


def read_rally_list(file: str | Path, policy: ImportPolicy = DEFAULT_IMPORT) -> Map:
    """Return rally points as a map in degrees; they are for emergencies and left out.

    The file is a list of Mission Planner, whose lines begin with RALLY, or a waypoint list.

    Raises
    ------
    InputError
        The file is no such list.
    """
    if is_waypoint_list(file):
        return read_waypoint_list(file, policy)
    features = []
    for k, (where, cells) in enumerate(_rows(file)):
        if cells[0].upper() != "RALLY":
            raise InputError(f"{where}: expected RALLY first, got {shown(cells[0])}")
        shape = _point(_lonlat(cells[1:], where))
        properties = {"kind": "ignore", "why": "a rally point, for emergencies"}
        features.append(Feature(f"rally[{k}]", RALLY, "", properties, shape))
    if not features:
        raise InputError(f"{file}: expected rally points, got nothing")
    return Map(tuple(features), True, {RALLY: len(features)})


def _rows(file: str | Path) -> list[tuple[str, list[str]]]:
    """Return the cells of each line that is no comment, with the line's name in messages."""
    lines = decode_text(read_bytes(file), str(file)).splitlines()
    return [
        (f"{file}: line {k}", [c for c in re.split(r"[\s,;]+", line.strip()) if c])
        for k, line in enumerate(lines, 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]


def _lonlat(cells: list[str], where: str) -> tuple[float, float]:
    try:
        lat, lon = float(cells[0]), float(cells[1])
    except (ValueError, IndexError):
        lat = lon = float("nan")
    if not (abs(lat) <= 90.0 and abs(lon) <= 180.0):
        raise InputError(
            f"{where}: expected latitude and longitude in degrees, got {shown(' '.join(cells))}"
        )
    return lon, lat


def _point(lonlat: tuple[float, float]) -> shapely.Point:
    import shapely

    return shapely.Point(lonlat)

"""Plans of QGroundControl (.plan): mission items, fences, rally points and the planned home."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from netsp.base.errors import InputError, counted
from netsp.base.files import read_text
from netsp.base.validated import parse_json_object, shown
from netsp.exchange.maps.feature import Feature, Map, Unread
from netsp.exchange.maps.mission_commands import (
    COMMANDS,
    FENCE,
    RALLY,
    ItemFeatures,
    MissionItem,
    add_circle,
    add_home,
    add_polygon,
    features_of_items,
)

LONGEST = 1e9
"""Bound on numbers of a plan; larger ones are damage."""


def is_plan(file: str | Path) -> bool:
    """Tell whether a JSON file is a plan of QGroundControl.

    Parameters
    ----------
    file : str or Path
        File of any kind.
    """
    try:
        return parse_json_object(read_text(file), str(file)).get("fileType") == "Plan"
    except InputError:  # the reader of other maps says what is wrong
        return False


def read_plan(file: str | Path) -> Map:
    """Read a plan as a map.

    Parameters
    ----------
    file : str or Path
        Plan of QGroundControl.

    Returns
    -------
    Map
        In degrees: waypoints as goals, the planned home as base, fences as bounds (inclusion) and
        obstacles (exclusion).

    Raises
    ------
    InputError
        No such plan.
    """
    data = parse_json_object(read_text(file), str(file))
    if data.get("fileType") != "Plan":
        raise InputError(
            f"{file}: fileType: expected Plan, as QGroundControl writes it, got "
            f"{shown(data.get('fileType'))}"
        )
    mission = _object(data.get("mission"), f"{file}: mission")
    own = _part(data, "netsp")
    complex_items: list[Unread] = []
    items: list[MissionItem] = []
    for k, item in enumerate(_list(mission.get("items"), f"{file}: mission.items")):
        where = f"items[{k}]"
        kind = item.get("type") if isinstance(item, dict) else None
        if kind == "SimpleItem" or (isinstance(item, dict) and kind == "missionItem"):
            items.append(_item(item, where, str(file)))
        else:
            name = item.get("complexItemType", kind) if isinstance(item, dict) else item
            complex_items.append(
                Unread(
                    where,
                    COMMANDS,
                    f"a pattern of QGroundControl ({shown(name)}): break it up into waypoints "
                    "there",
                )
            )
    home = mission.get("plannedHomePosition")
    place = [_number(v) for v in home] if isinstance(home, list) else []
    altitude = place[2] if len(place) > 2 else None
    found = features_of_items(items, altitude, None if home is None else _lonlat(home))
    found.unread += complex_items
    if home is not None:
        numbers = {k: _number(own.get(k)) for k in ("tether_length", "clearance", "heading")}
        add_home(found, "plannedHomePosition", _lonlat(home), **numbers)
    _fence(data.get("geoFence"), found, str(file))
    found.notes += _fence_notes(_part(own, "fence"))
    _rally(data.get("rallyPoints"), found)
    return Map(
        tuple(found.features),
        True,
        found.layers(),
        tuple(f"{file}: {c}" for c in found.complaints),
        tuple(found.notes),
        tuple(found.unread),
    )


def _fence_notes(fence: dict[str, Any]) -> list[str]:
    """Return notes on obstacles that an export of ours left out of the fence or simplified."""
    notes = []
    for member, what in (
        (
            "left_out",
            "the fence lacks {} of the planned problem, because the vehicle's storage is full",
        ),
        ("simplified", "the fence has {} simplified, and larger than in the planned problem"),
    ):
        names = fence.get(member)
        if isinstance(names, list) and names:
            said = ", ".join(shown(n) for n in names[:3]) + (", …" if len(names) > 3 else "")
            about = what.format(f"{counted(len(names), 'obstacle')} ({said})")
            notes.append(f"{about}; to plan again, use that problem")
    return notes


def _object(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{where}: expected an object, got {shown(value)}")
    return value


def _part(data: dict[str, Any], name: str) -> dict[str, Any]:
    """Return a member that is an object; an empty one without it."""
    value = data.get(name)
    return value if isinstance(value, dict) else {}


def _list(value: Any, where: str) -> list[Any]:
    if value is None:
        return []
    if not isinstance(value, list):
        raise InputError(f"{where}: expected a list, got {shown(value)}")
    return value


def _number(value: Any) -> float | None:
    """Return a number; None for null and what is no number."""
    good = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LONGEST
    return float(value) if good else None


def _item(item: dict[str, Any], where: str, file: str) -> MissionItem:
    """Return a simple item, of version 1 (param1, coordinate) or 2 (params)."""
    command, frame = _number(item.get("command")), _number(item.get("frame"))
    if command is None or frame is None:
        raise InputError(f"{file}: {where}: expected numbers as command and frame")
    params = item.get("params")
    if isinstance(params, list):
        numbers = [_number(v) for v in params]
    else:
        coordinate = item.get("coordinate")
        numbers = [_number(item.get(f"param{k}")) for k in (1, 2, 3, 4)]
        numbers += [_number(v) for v in coordinate] if isinstance(coordinate, list) else []
    numbers += [None] * (7 - len(numbers))
    mark = item.get("netsp")
    return MissionItem(
        where,
        int(command),
        int(frame),
        tuple(numbers[:4]),
        (numbers[4], numbers[5], numbers[6]),
        mark if isinstance(mark, dict) else None,
    )


def _lonlat(value: Any) -> tuple[float, float] | None:
    numbers = [_number(v) for v in value] if isinstance(value, list) else []
    if len(numbers) < 2 or numbers[0] is None or numbers[1] is None:
        return None
    return numbers[1], numbers[0]


def _fence(fence: Any, found: ItemFeatures, file: str) -> None:
    if fence is None:
        return
    fence = _object(fence, f"{file}: geoFence")
    for k, polygon in enumerate(_list(fence.get("polygons"), f"{file}: geoFence.polygons")):
        polygon = _object(polygon, f"{file}: geoFence.polygons[{k}]")
        corners = [_lonlat(c) for c in _list(polygon.get("polygon"), f"{file}: geoFence.polygons")]
        add_polygon(
            found,
            f"geoFence.polygons[{k}]",
            corners,
            is_inclusion=bool(polygon.get("inclusion", True)),
        )
    for k, circle in enumerate(_list(fence.get("circles"), f"{file}: geoFence.circles")):
        circle = _object(circle, f"{file}: geoFence.circles[{k}]")
        inner = _part(circle, "circle")
        add_circle(
            found,
            f"geoFence.circles[{k}]",
            _lonlat(inner.get("center")),
            _number(inner.get("radius")),
            is_inclusion=bool(circle.get("inclusion", True)),
        )
    old = fence.get("polygon")  # version 1 has one polygon, of inclusion
    if isinstance(old, list) and old:
        add_polygon(found, "geoFence.polygon", [_lonlat(c) for c in old], is_inclusion=True)
    if fence.get("breachReturn") is not None:
        reason = "where the vehicle goes after a breach of the fence"
        found.unread.append(Unread("geoFence.breachReturn", FENCE, reason))


def _rally(rally: Any, found: ItemFeatures) -> None:
    import shapely

    points = rally.get("points") if isinstance(rally, dict) else None
    for k, point in enumerate(points if isinstance(points, list) else []):
        where, at = f"rallyPoints[{k}]", _lonlat(point)
        if at is None or abs(at[1]) > 90.0 or abs(at[0]) > 180.0:
            found.unread.append(Unread(where, RALLY, "has no position"))
            continue
        why = "a rally point, for emergencies"
        shape = shapely.Point(at)
        found.features.append(Feature(where, RALLY, "", {"kind": "ignore", "why": why}, shape))

"""Plans of QGroundControl (.plan): mission items, fences, rally points and the planned home."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from netsp.base.errors import InputError, counted
from netsp.base.files import read_text
from netsp.base.validated import parse_json_object, shown
from netsp.exchange.maps.feature import Feature, Map, Unread
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
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


def is_plan(file: str | Path) -> bool:
    """Return whether a JSON file is a plan of QGroundControl."""
    try:
        return parse_json_object(read_text(file), str(file)).get("fileType") == "Plan"
    except InputError:  # the reader of other maps says what is wrong
        return False


def read_plan(file: str | Path, policy: ImportPolicy = DEFAULT_IMPORT) -> Map:
    """Read a plan as a map in degrees.

    Waypoints become goals, the planned home the base, inclusion fences bounds, and exclusion fences
    obstacles.

    Raises
    ------
    InputError
        The file is no plan, or a part of it has the wrong type.
    """
    data = parse_json_object(read_text(file), str(file))
    if data.get("fileType") != "Plan":
        raise InputError(
            f"{file}: fileType: expected Plan, as QGroundControl writes it, got "
            f"{shown(data.get('fileType'))}"
        )
    return _PlanReader(str(file), policy).read(data)


class _PlanReader:
    """Reader of one plan."""

    def __init__(self, file: str, policy: ImportPolicy) -> None:
        self.file, self.policy = file, policy

    def read(self, data: dict[str, Any]) -> Map:
        """Return the map of a plan."""
        file = self.file
        mission = _object(data.get("mission"), f"{file}: mission")
        netsp_part = _part(data, "netsp")
        items, patterns = self.items(_list(mission.get("items"), f"{file}: mission.items"))
        home = mission.get("plannedHomePosition")
        home_place = [self.number(v) for v in home] if isinstance(home, list) else []
        altitude = home_place[2] if len(home_place) > 2 else None
        home_lonlat = None if home is None else self.lonlat(home)
        found = features_of_items(items, altitude, home_lonlat, self.policy)
        found.unread += patterns
        if home is not None:
            names = ("tether_length", "clearance", "heading")
            numbers = {k: self.number(netsp_part.get(k)) for k in names}
            add_home(found, "plannedHomePosition", home_lonlat, **numbers)
        self.add_fence(data.get("geoFence"), found)
        found.notes += _fence_notes(_part(netsp_part, "fence"))
        self.add_rally_points(data.get("rallyPoints"), found)
        return Map(
            tuple(found.features),
            True,
            found.layers(),
            tuple(f"{file}: {c}" for c in found.complaints),
            tuple(found.notes),
            tuple(found.unread),
        )

    def items(self, rows: list[Any]) -> tuple[list[MissionItem], list[Unread]]:
        """Return the simple items of a mission, and its patterns, which are not read."""
        items: list[MissionItem] = []
        patterns: list[Unread] = []
        for k, item in enumerate(rows):
            where = f"items[{k}]"
            kind = item.get("type") if isinstance(item, dict) else None
            if kind == "SimpleItem" or (isinstance(item, dict) and kind == "missionItem"):
                items.append(self.item(item, where))
                continue
            name = item.get("complexItemType", kind) if isinstance(item, dict) else item
            reason = (
                f"a pattern of QGroundControl ({shown(name)}): break it up into waypoints there"
            )
            patterns.append(Unread(where, COMMANDS, reason))
        return items, patterns

    def item(self, item: dict[str, Any], where: str) -> MissionItem:
        """Return a simple item, of version 1 (param1, coordinate) or 2 (params)."""
        command, frame = self.number(item.get("command")), self.number(item.get("frame"))
        if command is None or frame is None:
            raise InputError(f"{self.file}: {where}: expected numbers as command and frame")
        params = item.get("params")
        if isinstance(params, list):
            numbers = [self.number(v) for v in params]
        else:
            coordinate = item.get("coordinate")
            numbers = [self.number(item.get(f"param{k}")) for k in (1, 2, 3, 4)]
            numbers += [self.number(v) for v in coordinate] if isinstance(coordinate, list) else []
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

    def add_fence(self, fence: Any, found: ItemFeatures) -> None:
        """Add the polygons and circles of a fence."""
        if fence is None:
            return
        name = f"{self.file}: geoFence"
        fence = _object(fence, name)
        for k, polygon in enumerate(_list(fence.get("polygons"), f"{name}.polygons")):
            polygon = _object(polygon, f"{name}.polygons[{k}]")
            corners = [self.lonlat(c) for c in _list(polygon.get("polygon"), f"{name}.polygons")]
            is_inclusion = bool(polygon.get("inclusion", True))
            add_polygon(found, f"geoFence.polygons[{k}]", corners, is_inclusion=is_inclusion)
        for k, circle in enumerate(_list(fence.get("circles"), f"{name}.circles")):
            circle = _object(circle, f"{name}.circles[{k}]")
            disc = _part(circle, "circle")
            add_circle(
                found,
                f"geoFence.circles[{k}]",
                self.lonlat(disc.get("center")),
                self.number(disc.get("radius")),
                is_inclusion=bool(circle.get("inclusion", True)),
            )
        single = fence.get("polygon")  # version 1 has one polygon, of inclusion
        if isinstance(single, list) and single:
            corners = [self.lonlat(c) for c in single]
            add_polygon(found, "geoFence.polygon", corners, is_inclusion=True)
        if fence.get("breachReturn") is not None:
            reason = "where the vehicle goes after a breach of the fence"
            found.unread.append(Unread("geoFence.breachReturn", FENCE, reason))

    def add_rally_points(self, rally: Any, found: ItemFeatures) -> None:
        """Add rally points as features that are left out."""
        import shapely

        points = rally.get("points") if isinstance(rally, dict) else None
        for k, point in enumerate(points if isinstance(points, list) else []):
            where, place = f"rallyPoints[{k}]", self.lonlat(point)
            if place is None or abs(place[1]) > 90.0 or abs(place[0]) > 180.0:
                found.unread.append(Unread(where, RALLY, "has no position"))
                continue
            properties = {"kind": "ignore", "why": "a rally point, for emergencies"}
            shape = shapely.Point(place)
            found.features.append(Feature(where, RALLY, "", properties, shape))

    def number(self, value: Any) -> float | None:
        """Return a number; None for null, for other types and for numbers out of range."""
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        return float(value) if is_number and abs(value) <= self.policy.read.max_number else None

    def lonlat(self, value: Any) -> tuple[float, float] | None:
        """Return longitude and latitude of a list that begins with latitude and longitude."""
        numbers = [self.number(v) for v in value] if isinstance(value, list) else []
        if len(numbers) < 2 or numbers[0] is None or numbers[1] is None:
            return None
        return numbers[1], numbers[0]


def _fence_notes(fence: dict[str, Any]) -> list[str]:
    """Return notes on obstacles that an export of netsp left out of the fence or simplified."""
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
            listed = ", ".join(shown(n) for n in names[:3]) + (", …" if len(names) > 3 else "")
            about = what.format(f"{counted(len(names), 'obstacle')} ({listed})")
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

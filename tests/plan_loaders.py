"""What ground stations ask of a file before they load it, after their documentation and behaviour:
QGroundControl's and MAVSDK's of plans, Cockpit's of missions. A file that one of them refuses
raises `RefusedError`."""

from __future__ import annotations

import math
from typing import Any


class RefusedError(Exception):
    """The ground station does not load the file."""


def _ask(condition: bool, text: str) -> None:
    if not condition:
        raise RefusedError(text)


def _number(value: Any, text: str, *, or_none: bool = False) -> None:
    if or_none and value is None:
        return
    good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    _ask(good, f"{text}: expected a number, got {value!r}")


def _whole(value: Any, text: str, expected: int | None = None) -> None:
    _ask(isinstance(value, int) and not isinstance(value, bool), f"{text}: {value!r}")
    _ask(expected is None or value == expected, f"{text}: expected {expected}, got {value!r}")


def _coordinate(value: Any, text: str, n: int = 2) -> None:
    _ask(isinstance(value, list) and len(value) == n, f"{text}: expected {n} numbers")
    for v in value:
        _number(v, text)
    _ask(abs(value[0]) <= 90.0 and abs(value[1]) <= 180.0, f"{text}: no degrees: {value}")


def load_plan(data: Any) -> None:
    """Load a plan as QGroundControl and MAVSDK do."""
    _ask(isinstance(data, dict) and data.get("fileType") == "Plan", "fileType")
    _whole(data.get("version"), "version", 1)
    for part in ("mission", "geoFence", "rallyPoints"):
        _ask(isinstance(data.get(part), dict), part)
        _whole(data[part].get("version"), f"{part}: version", 2)
    _load_mission(data["mission"])
    load_fence(data["geoFence"])
    _ask(isinstance(data["rallyPoints"].get("points"), list), "rallyPoints: points")


def _load_mission(mission: dict[str, Any]) -> None:
    for key in ("firmwareType", "vehicleType"):
        _whole(mission.get(key), key)
    for key in ("cruiseSpeed", "hoverSpeed"):
        _number(mission.get(key), key)
    _coordinate(mission.get("plannedHomePosition"), "plannedHomePosition", 3)
    _ask(isinstance(mission.get("items"), list), "items")
    for item in mission["items"]:
        _ask(item.get("type") == "SimpleItem", "type of an item")
        for key in ("command", "frame", "doJumpId"):
            _whole(item.get(key), key)
        _ask(isinstance(item.get("autoContinue"), bool), "autoContinue")
        params = item.get("params")
        _ask(isinstance(params, list) and len(params) == 7, "params: expected 7")
        for value in params:
            _number(value, "params", or_none=True)
        if item["command"] == 16:  # which has an altitude of its own
            for key in ("AltitudeMode", "Altitude"):
                _number(item.get(key), key)
            _number(item.get("AMSLAltAboveTerrain"), "AMSLAltAboveTerrain", or_none=True)
            _coordinate(params[4:6], "params")


def load_fence(fence: dict[str, Any]) -> None:
    """Load a fence as QGroundControl and MAVSDK do, and upload it."""
    for key in ("circles", "polygons"):
        _ask(isinstance(fence.get(key), list), key)
    for circle in fence["circles"]:
        _whole(circle.get("version"), "version of a circle", 1)
        _ask(isinstance(circle.get("inclusion"), bool), "inclusion of a circle")
        _ask(isinstance(circle.get("circle"), dict), "circle")
        _coordinate(circle["circle"].get("center"), "center")
        _number(circle["circle"].get("radius"), "radius")
        _ask(circle["circle"]["radius"] > 0.0, "radius")
    for polygon in fence["polygons"]:
        _whole(polygon.get("version"), "version of a polygon", 1)
        _ask(isinstance(polygon.get("inclusion"), bool), "inclusion of a polygon")
        corners = polygon.get("polygon")
        _ask(isinstance(corners, list) and 3 <= len(corners) <= 255, "corners of a polygon")
        for corner in corners:
            _coordinate(corner, "corner")
        _ask(corners[0] != corners[-1], "a polygon ends where it begins: one corner too many")


def stored_bytes(fence: dict[str, Any]) -> int:
    """Return the bytes that an ArduPilot vehicle needs for a fence."""
    corners = sum(2 + 8 * len(p["polygon"]) for p in fence["polygons"])
    return 5 + 13 * len(fence["circles"]) + corners


def load_cockpit(data: Any) -> list[dict[str, Any]]:
    """Import a mission as Cockpit's library does; returns the mission items of its upload."""
    _ask(isinstance(data, dict), "mission")
    for key in ("version", "settings", "waypoints"):
        _ask(key in data, key)
    for key in (
        "mapCenter", "zoom", "currentWaypointAltitude", "currentWaypointAltitudeRefType",
        "defaultCruiseSpeed",
    ):  # fmt: skip
        _ask(data["settings"].get(key) is not None, f"settings: {key}")
    _ask(isinstance(data.get("name"), str), "name")
    for key in ("createdAt", "updatedAt"):
        _number(data.get(key), key)
    _coordinate(data["settings"]["mapCenter"], "mapCenter")
    ids: set[str] = set()
    items = []
    for waypoint in data["waypoints"]:
        _ask(isinstance(waypoint.get("id"), str) and waypoint["id"] not in ids, "id")
        ids.add(waypoint["id"])
        _coordinate(waypoint.get("coordinates"), "coordinates")
        _number(waypoint.get("altitude"), "altitude")
        _ask(waypoint.get("altitudeReferenceType") == "Relative to home", "altitudeReferenceType")
        for command in waypoint["commands"]:
            _ask(command.get("type") == "MAVLINK_NAV_COMMAND", "type of a command")
            _ask(str(command.get("command")).startswith("MAV_CMD_"), "command")
            values = [command.get(f"param{k}") for k in range(1, 5)]
            for value in values:
                _number(value, "param")
            x, y = (round(v * 1e7) for v in waypoint["coordinates"])
            items.append({
                "command": command["command"], "params": values, "x": x, "y": y,
                "z": waypoint["altitude"],
            })  # fmt: skip
    return items

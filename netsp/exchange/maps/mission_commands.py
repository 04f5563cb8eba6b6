"""Items of MAVLink missions: which commands visit a place, and how high it is.

Numbers and names are those of MAVLink's common message set (MAV_CMD, MAV_FRAME).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from netsp.base.errors import counted
from netsp.exchange.maps.feature import Feature, Unread
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy

if TYPE_CHECKING:
    import shapely

VISITED = {
    16: "NAV_WAYPOINT",
    17: "NAV_LOITER_UNLIM",
    18: "NAV_LOITER_TURNS",
    19: "NAV_LOITER_TIME",
    31: "NAV_LOITER_TO_ALT",
    82: "NAV_SPLINE_WAYPOINT",
}
"""Commands that visit a place; they are goals."""

NOT_VISITED = {
    21: ("NAV_LAND", "where the vehicle lands"),
    22: ("NAV_TAKEOFF", "where the vehicle takes off"),
    84: ("NAV_VTOL_TAKEOFF", "where the vehicle takes off"),
    85: ("NAV_VTOL_LAND", "where the vehicle lands"),
    80: ("NAV_ROI", "a place to look at, not to visit"),
    94: ("NAV_PAYLOAD_PLACE", "where a payload is put"),
    179: ("DO_SET_HOME", "a new home; the tether stays where it is"),
    189: ("DO_LAND_START", "where a landing begins"),
    195: ("DO_SET_ROI_LOCATION", "a place to look at, not to visit"),
    201: ("DO_SET_ROI", "a place to look at, not to visit"),
    5000: ("NAV_FENCE_RETURN_POINT", "where the vehicle goes after a breach of the fence"),
    5100: ("NAV_RALLY_POINT", "a rally point, for emergencies"),
}
"""Commands with a place that is no goal, and the meaning of the place."""

WITHOUT_PLACE = {
    20: "NAV_RETURN_TO_LAUNCH", 30: "NAV_CONTINUE_AND_CHANGE_ALT", 92: "NAV_GUIDED_ENABLE",
    93: "NAV_DELAY", 112: "CONDITION_DELAY", 113: "CONDITION_CHANGE_ALT",
    114: "CONDITION_DISTANCE", 115: "CONDITION_YAW", 176: "DO_SET_MODE", 177: "DO_JUMP",
    178: "DO_CHANGE_SPEED", 181: "DO_SET_RELAY", 182: "DO_REPEAT_RELAY", 183: "DO_SET_SERVO",
    184: "DO_REPEAT_SERVO", 197: "DO_SET_ROI_NONE", 203: "DO_DIGICAM_CONTROL",
    204: "DO_MOUNT_CONFIGURE", 205: "DO_MOUNT_CONTROL", 206: "DO_SET_CAM_TRIGG_DIST",
    207: "DO_FENCE_ENABLE", 211: "DO_GRIPPER", 222: "DO_GUIDED_LIMITS", 223: "DO_ENGINE_CONTROL",
    224: "DO_SET_MISSION_CURRENT", 530: "SET_CAMERA_MODE", 600: "JUMP_TAG", 601: "DO_JUMP_TAG",
    1000: "DO_GIMBAL_MANAGER_PITCHYAW", 2000: "IMAGE_START_CAPTURE", 2001: "IMAGE_STOP_CAPTURE",
    2500: "VIDEO_START_CAPTURE", 2501: "VIDEO_STOP_CAPTURE", 42600: "DO_WINCH",
}  # fmt: skip
"""Commands without a place."""

POLYGONS = {5001: True, 5002: False}
CIRCLES = {5003: True, 5004: False}
"""Items of a fence: whether the vehicle stays inside. A polygon has an item for each corner."""

FRAMES_ABOVE_SEA = (0, 5)
"""Codes of frames in degrees whose altitudes count from mean sea level."""

FRAMES_ABOVE_HOME = (3, 6)
"""Codes of frames in degrees whose altitudes count from home."""

FRAMES_ABOVE_TERRAIN = (10, 11)
"""Codes of frames in degrees whose altitudes count from the terrain."""

FRAME_NAMES = {
    1: "LOCAL_NED",
    2: "MISSION",
    4: "LOCAL_ENU",
    7: "LOCAL_OFFSET_NED",
    8: "BODY_NED",
    9: "BODY_OFFSET_NED",
    12: "BODY_FRD",
    20: "LOCAL_FRD",
    21: "LOCAL_FLU",
}

WAYPOINTS, BENDS, COMMANDS = "waypoints", "bends", "commands"
FENCE, RALLY, HOME = "fence", "rally points", "home"
"""Layers of a mission file."""

INSIDE = {"kind": "bounds", "fence": "inclusion"}
"""Properties of an inclusion fence.

The vehicle stays within all inclusion fences, as in ArduPilot unless its option for their union is
set.
"""


@dataclass(frozen=True)
class MissionItem:
    """Item of a mission.

    Attributes
    ----------
    where
        Name in messages, such as "items[3]".
    command, frame
        Codes of MAV_CMD and MAV_FRAME.
    params
        The four parameters of the command.
    place
        Latitude, longitude (degrees) and altitude (m); None for what is not stated.
    mark
        Data of netsp about the item: ``kind`` and ``name``.
    """

    where: str
    command: int
    frame: int
    params: tuple[float | None, ...]
    place: tuple[float | None, float | None, float | None]
    mark: dict[str, Any] | None = None

    @property
    def hold_s(self) -> float | None:
        """Seconds that the vehicle stays at a waypoint; None for other commands."""
        return (self.params[0] or 0.0) if self.command in (16, 82) else None

    @property
    def lonlat(self) -> tuple[float, float] | None:
        """Longitude and latitude; None without a place."""
        lat, lon, _ = self.place
        if lat is None or lon is None or (lat == 0.0 and lon == 0.0):
            return None
        return lon, lat


@dataclass
class ItemFeatures:
    """Features of a mission file.

    Attributes
    ----------
    policy
        Policy of the import.
    features, unread
        As in `netsp.exchange.maps.feature.Map`.
    complaints, notes
        Lines without the name of the file.
    """

    policy: ImportPolicy = DEFAULT_IMPORT
    features: list[Feature] = field(default_factory=list)
    unread: list[Unread] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def layers(self) -> dict[str, int]:
        """Return the number of features of each layer."""
        counts: dict[str, int] = {}
        for layer in [f.layer for f in self.features] + [u.layer for u in self.unread]:
            counts[layer] = counts.get(layer, 0) + 1
        return counts


def features_of_items(
    items: Sequence[MissionItem],
    home_altitude: float | None,
    home: tuple[float, float] | None = None,
    policy: ImportPolicy = DEFAULT_IMPORT,
) -> ItemFeatures:
    """Return the features of mission items: goals, fences, and the rest.

    All corners of a polygon make one feature, every other item makes one.

    Parameters
    ----------
    home_altitude : float or None
        Altitude of home above mean sea level, m; None if it is not stated.
    home : (float, float), optional
        Longitude and latitude of home, degrees.
    """
    out = ItemFeatures(policy)
    visits = [i for i in items if i.command in VISITED and i.lonlat is not None]
    has_marks = any(i.mark is not None for i in visits)
    is_passed = _passing_rule(visits, home, policy)
    goals: list[MissionItem] = []
    is_fence = {**POLYGONS, **CIRCLES}
    for item in items:
        if item.command in is_fence:
            continue  # read below, with all corners of a polygon
        if item.command not in VISITED or item.lonlat is None or not _is_geographic(item):
            out.unread.append(Unread(item.where, _layer(item), _reason(item), _shape(item)))
            continue
        lon, lat = item.lonlat
        if abs(lat) > 90.0 or abs(lon) > 180.0:
            out.complaints.append(
                f"{item.where}: expected latitude within 90 and longitude within 180 degrees, got "
                f"{lat:g}, {lon:g}"
            )
            continue
        is_bend = (
            item.mark is not None and item.mark.get("kind") != "goal"
            if has_marks
            else is_passed(item)
        )
        if not is_bend:
            goals.append(item)
        z = _height(item, home_altitude)
        out.features.append(_visited(item, (lon, lat), z, is_bend=is_bend, by_mark=has_marks))
    if not has_marks:
        _note_bends(out)
    _note_altitudes(goals, home_altitude, out)
    _fences([i for i in items if i.command in is_fence], out)
    return out


def _height(item: MissionItem, home_altitude: float | None) -> float | None:
    """Return the height of a waypoint above the water; None if it is unknown."""
    z = item.place[2]
    if item.frame in FRAMES_ABOVE_TERRAIN or z is None:
        return None
    return z - (home_altitude or 0.0) if item.frame in FRAMES_ABOVE_SEA else z


def _note_bends(out: ItemFeatures) -> None:
    passed = [f for f in out.features if f.layer == BENDS]
    if passed:
        out.notes.append(
            f"{counted(len(passed), 'waypoint')} passed by: taken as bends of the path; make goals "
            f"of them with --map goal={BENDS}"
        )


def _note_altitudes(
    goals: Sequence[MissionItem], home_altitude: float | None, out: ItemFeatures
) -> None:
    """Complain of altitudes above the terrain, and add a note on those above the sea."""
    terrain = [item.where for item in goals if item.frame in FRAMES_ABOVE_TERRAIN]
    if terrain:
        out.complaints.append(
            f"{counted(len(terrain), 'waypoint')} ({terrain[0]}): altitudes above the terrain are "
            "not known without a sea floor; expected altitudes relative to home or above mean sea "
            "level"
        )
    if any(item.frame in FRAMES_ABOVE_SEA and item.place[2] is not None for item in goals):
        level = f"{home_altitude:g} m, the altitude of home" if home_altitude else "0"
        out.notes.append(f"altitudes above mean sea level: the water's surface is taken at {level}")


def _passing_rule(
    visits: Sequence[MissionItem], home: tuple[float, float] | None, policy: ImportPolicy
) -> Callable[[MissionItem], bool]:
    """Return the rule that tells bends from goals by the seconds for which the vehicle holds.

    A tour of netsp ends at home, where it holds as long as at its first waypoint and at every bend,
    and never as long at a goal. In other missions the vehicle passes waypoints with a hold of at
    most `policy.max_pass_s`, if it holds longer anywhere.
    """
    holds = [i.hold_s for i in visits]
    last = visits[-1].lonlat if visits else None
    if home is not None and last is not None and holds[-1] and holds[0] == holds[-1]:
        from netsp.exchange.maps.projection import Projection

        away = Projection(home[1], home[0]).to_plane([(last[1], last[0])])
        if math.hypot(*away[0]) <= policy.home_radius and any(h != holds[-1] for h in holds):
            return lambda item: item.hold_s == holds[-1]
    if any(h is not None and h > policy.max_pass_s for h in holds):
        return lambda item: item.hold_s is not None and item.hold_s <= policy.max_pass_s
    return lambda item: False


def _is_geographic(item: MissionItem) -> bool:
    return item.frame in (*FRAMES_ABOVE_SEA, *FRAMES_ABOVE_HOME, *FRAMES_ABOVE_TERRAIN)


def _layer(item: MissionItem) -> str:
    if item.command in VISITED:
        return WAYPOINTS
    if item.command == 5100:
        return RALLY
    return FENCE if item.command == 5000 else COMMANDS


def _reason(item: MissionItem) -> str:
    """Return why an item is no goal."""
    if item.command in VISITED:
        if not _is_geographic(item):
            frame = FRAME_NAMES.get(item.frame, f"number {item.frame}")
            return f"its position is in frame {frame}, not in degrees"
        return "has no position (lat = lon = 0)"
    if item.command in NOT_VISITED:
        name, what = NOT_VISITED[item.command]
        return f"{name}: {what}"
    name = WITHOUT_PLACE.get(item.command, f"command {item.command}")
    return f"{name}: a command without a place to visit"


def _shape(item: MissionItem) -> shapely.Geometry | None:
    import shapely

    lonlat = item.lonlat
    with_place = item.command in VISITED or item.command in NOT_VISITED
    if lonlat is None or not with_place or not _is_geographic(item):
        return None
    return shapely.Point(lonlat) if abs(lonlat[1]) <= 90.0 and abs(lonlat[0]) <= 180.0 else None


def _visited(
    item: MissionItem, lonlat: tuple[float, float], z: float | None, *, is_bend: bool, by_mark: bool
) -> Feature:
    """Return the feature of a waypoint: a goal, or a bend that is passed."""
    import shapely

    point = shapely.Point(*lonlat, 0.0 if z is None else z)
    if is_bend:
        why = (
            "a bend of the tour, as netsp wrote it"
            if by_mark
            else f"passed: it holds for {item.hold_s:g} s, as at home or less than others"
        )
        return Feature(item.where, BENDS, "", {"kind": "ignore", "why": why}, point)
    properties = {"kind": "goal", "command": VISITED[item.command]}
    if item.mark is not None and item.mark.get("name") is not None:
        properties["name"] = str(item.mark["name"])
    return Feature(item.where, WAYPOINTS, "", properties, point)


def _fences(items: Sequence[MissionItem], out: ItemFeatures) -> None:
    """Read fences: circles, and polygons whose corners stand one after the other."""
    k = 0
    while k < len(items):
        item = items[k]
        if item.command in CIRCLES:
            radius = item.params[0]
            add_circle(out, item.where, item.lonlat, radius, is_inclusion=CIRCLES[item.command])
            k += 1
            continue
        size = max(int(item.params[0] or 0), 1)
        corners = [i for i in items[k : k + size] if i.command == item.command]
        places = [i.lonlat for i in corners]
        if len(corners) < size:
            out.complaints.append(
                f"{item.where}: expected a fence of {size} corners, got {len(corners)}"
            )
            add_polygon(out, item.where, [], is_inclusion=POLYGONS[item.command])
        else:
            add_polygon(out, item.where, places, is_inclusion=POLYGONS[item.command])
        k += len(corners)


def add_polygon(
    out: ItemFeatures,
    where: str,
    corners: Iterable[tuple[float, float] | None],
    *,
    is_inclusion: bool,
) -> None:
    """Add a polygon of a fence: bounds if the vehicle stays inside, else an obstacle.

    Parameters
    ----------
    corners : iterable of (float, float)
        Longitudes and latitudes, degrees.
    """
    import shapely

    places = [c for c in corners if c is not None]
    if len(places) < 3 or any(abs(lat) > 90.0 or abs(lon) > 180.0 for lon, lat in places):
        out.unread.append(Unread(where, FENCE, "a fence without three corners in degrees"))
        return
    properties = INSIDE if is_inclusion else {"kind": "obstacle"}
    out.features.append(Feature(where, FENCE, "", properties, shapely.Polygon(places)))


def add_circle(
    out: ItemFeatures,
    where: str,
    center: tuple[float, float] | None,
    radius: float | None,
    *,
    is_inclusion: bool,
) -> None:
    """Add a circle of a fence: bounds if the vehicle stays inside, else an obstacle.

    Parameters
    ----------
    center : (float, float) or None
        Longitude and latitude, degrees.
    radius : float or None
        Radius, m.
    """
    import shapely

    if center is None or radius is None or not 0.0 < radius < math.inf or abs(center[1]) > 90.0:
        out.unread.append(Unread(where, FENCE, "a fence without a centre and a radius"))
        return
    if not is_inclusion:
        properties = {"kind": "obstacle", "radius_m": radius}
        out.features.append(Feature(where, FENCE, "", properties, shapely.Point(center)))
        return
    from netsp.exchange.maps.projection import Projection

    n_corners = out.policy.outlines.circle_corners
    turn = [2.0 * math.pi * k / n_corners for k in range(n_corners)]
    ring = [(radius * math.cos(a), radius * math.sin(a)) for a in turn]
    places = Projection(center[1], center[0]).to_earth(ring)[:, ::-1]
    out.notes.append(f"{where}: the round fence becomes a polygon of {n_corners} corners")
    out.features.append(Feature(where, FENCE, "", INSIDE, shapely.Polygon(places)))


def add_home(
    out: ItemFeatures, where: str, lonlat: tuple[float, float] | None, **properties: Any
) -> None:
    """Add the planned home as the base at the water's surface.

    Parameters
    ----------
    lonlat : (float, float) or None
        Degrees; None if home is not set.
    **properties
        Properties of the base; those that are None are left out.
    """
    import shapely

    if lonlat is None or lonlat == (0.0, 0.0):
        out.unread.append(Unread(where, HOME, "home is not set (lat = lon = 0)"))
    elif abs(lonlat[1]) > 90.0 or abs(lonlat[0]) > 180.0:
        out.complaints.append(f"{where}: expected degrees, got {lonlat[1]:g}, {lonlat[0]:g}")
    else:
        base_properties = {"kind": "base", **{k: v for k, v in properties.items() if v is not None}}
        out.features.append(Feature(where, HOME, "", base_properties, shapely.Point(lonlat)))

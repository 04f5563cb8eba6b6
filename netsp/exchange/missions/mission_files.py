"""Mission files: QGroundControl plans, waypoint lists, Cockpit missions, GeoJSON, KML and CSV.

Sources: QGroundControl's plan files and MAVLink's mission items; RFC 7946 for GeoJSON, which has no
circle, so that round obstacles are points with `radius_m`. ArduSub: depth is a negative altitude
relative to the surface, never 0 (0 has meant "keep the present one"); there is no take-off; the
plan ends at the base and not with return-to-launch; the vehicle goes through waypoints without a
hold, so bends are held. The first item is a held waypoint at the start of the tour, because the
vehicle goes straight to the first item from wherever it was armed. A speed is an item of its own:
the speeds of a plan's head change nothing on the vehicle, and neither does the item before the
first waypoint.
"""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from netsp.base.errors import InputError
from netsp.base.field_types import checked_argument, checked_instance
from netsp.base.files import csv_cell, write_bytes, write_text
from netsp.exchange.maps.projection import Projection
from netsp.exchange.missions.cockpit_mission import cockpit_mission
from netsp.exchange.missions.export_policy import DEFAULT_EXPORT, ExportPolicy
from netsp.exchange.missions.fence import Fence, FencePolicy, fence_of
from netsp.exchange.missions.kml import kml_of, kmz_of
from netsp.exchange.missions.leg_times import VehicleMotion, leg_times
from netsp.exchange.missions.waypoints import Waypoint, waypoints_of
from netsp.model.problem import Circle, Polygon, Problem
from netsp.model.solution import Solution
from netsp.plan.tour_plan import HOME

NAV_WAYPOINT = 16
"""Code of MAVLink's command NAV_WAYPOINT."""

DO_CHANGE_SPEED = 178
"""Code of MAVLink's command DO_CHANGE_SPEED."""

FRAME_RELATIVE_ALTITUDE = 3
"""Code of the frame of latitude, longitude and altitude above home."""

FRAME_MISSION = 2
"""Code of the frame of commands without a place."""

GROUND_SPEED = 1
"""Code of the speed over ground in DO_CHANGE_SPEED."""

KEEP_THROTTLE = -1
"""Sentinel for an unchanged throttle in DO_CHANGE_SPEED."""

AUTOPILOT_ARDUPILOT = 3
"""Code of ArduPilot in MAV_AUTOPILOT."""

VEHICLE_SUBMARINE = 12
"""Code of a submarine in MAV_TYPE."""


@dataclass(frozen=True)
class ExportSettings:
    """Settings of a mission file.

    Attributes
    ----------
    goal_hold_s
        Hold at goals, whole seconds; None for the waypoint's own, or the policy's.
    bend_hold_s
        Hold at bends, at the start and at the end, whole seconds, at least 1; longer if the vehicle
        holds that long at a goal (`with_distinct_holds`).
    speed
        Speed, m/s; None leaves it to the vehicle.
    max_waypoints
        Maximum number of waypoints. ArduSub stores 655 mission items, home and the speed included.
    fence
        Limits of the fence of a plan.
    policy
        Policy of the export.
    """

    goal_hold_s: int | None = None
    bend_hold_s: int = 1
    speed: float | None = 0.5
    max_waypoints: int = 650
    fence: FencePolicy = field(default_factory=FencePolicy)
    policy: ExportPolicy = DEFAULT_EXPORT


def export(
    problem: Problem,
    solution: Solution,
    file: str | Path,
    kind: str,
    projection: Projection | None = None,
    *,
    acceptance: float = 0.0,
    settings: ExportSettings | None = None,
) -> list[Waypoint]:
    """Write a solution as a mission file, and return its waypoints, the start first.

    Parameters
    ----------
    kind : str
        One of `FORMATS`.
    projection : Projection, optional
        Projection from the plane to degrees; default: that of the problem's origin. Only csv needs
        none.
    acceptance : float
        Acceptance radius of the vehicle, metres.

    Raises
    ------
    InputError
        The kind is unknown, units are not metres, there is no projection, waypoints are more than
        the vehicle takes, or would not be of the plan's class.
    """
    checked_instance("problem", problem, Problem)
    checked_instance("solution", solution, Solution)
    if not solution.tour or len(solution.path) < 2:
        raise InputError("solution: has no tour to export")
    if max(v.goal for v in solution.tour) >= len(problem.goals):
        raise InputError(f"solution: tour: expected goals #0 to #{len(problem.goals) - 1}")
    if problem.units != "m" and kind != "csv":
        raise InputError(
            f"units: format {kind!r} is in metres; expected a problem in m, got {problem.units!r}"
        )
    acceptance = checked_argument("acceptance", acceptance, 0.0)
    settings = settings or ExportSettings()
    check_settings(kind, settings)
    projection = projection or Projection.for_problem(problem)
    if projection is None and kind != "csv":
        raise InputError(
            f"origin: format {kind!r} needs latitude and longitude of the base; expected --origin "
            "LAT,LON, or the field origin in the problem"
        )
    path = waypoints_of(problem, solution, acceptance, settings.policy)
    points = [start_of(problem, solution), *path]
    settings = with_distinct_holds(points, settings)
    if len(points) > settings.max_waypoints and kind in FOR_VEHICLES:
        raise InputError(
            f"solution: needs {len(points)} waypoints, and the vehicle takes "
            f"{settings.max_waypoints}; raise that number if yours takes more"
        )
    write_page(file, kind, FORMATS[kind](problem, points, projection, settings))
    return points


def write_page(file: str | Path, kind: str, text: str) -> None:
    """Write the text of a format to a file; for ``kmz``, into an archive.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    if kind == "kmz":
        write_bytes(file, kmz_of(text))
    else:
        write_text(file, text)


def check_settings(kind: str, settings: ExportSettings) -> None:
    """Check a format and the settings of a mission file before anything is written.

    Raises
    ------
    InputError
        The kind is unknown; a speed, a hold or a number of waypoints is out of range.
    """
    if not isinstance(kind, str) or kind not in FORMATS:
        raise InputError(f"format: expected {', '.join(FORMATS)}, got {kind!r}")
    speed, policy = settings.speed, settings.policy
    if speed is not None and not checked_argument("speed", speed, 0.0, policy.max_speed):
        raise InputError("speed: expected more than 0, got 0")
    holds = [("bend", settings.bend_hold_s, 1)]
    if settings.goal_hold_s is not None:
        holds.insert(0, ("hold", settings.goal_hold_s, 0))
    for name, hold_s, min_s in holds:
        if not isinstance(hold_s, int | np.integer) or not min_s <= hold_s <= policy.max_hold_s:
            raise InputError(
                f"{name}: expected whole seconds from {min_s} to {policy.max_hold_s}, got "
                f"{hold_s!r}"
            )
    checked_argument("max_waypoints", settings.max_waypoints, 1)


def start_of(problem: Problem, solution: Solution) -> Waypoint:
    """Return the start of the tour: the base, or the place of the problem's state."""
    x, y, z = solution.path[0] if problem.state is not None else problem.base
    return Waypoint((float(x), float(y), float(z)), None, start=True)


def predicted_s(
    points: list[Waypoint], settings: ExportSettings, motion: VehicleMotion | None = None
) -> float | None:
    """Return the seconds that a mission takes from its first waypoint on; None without a speed.

    Parameters
    ----------
    points : list of Waypoint
        Waypoints of the mission, the start first.
    motion : VehicleMotion, optional
        Motion of the vehicle; default: that of an unchanged ArduSub.
    """
    if settings.speed is None:
        return None
    distinct = with_distinct_holds(points, settings)
    holds = [_hold(p, distinct) for p in points]
    places = [(*p.position[:2], altitude(p.position[2], settings.policy)) for p in points]
    return holds[0] + sum(leg_times(places, holds, settings.speed, motion))


def fence_of_points(problem: Problem, points: list[Waypoint], settings: ExportSettings) -> Fence:
    """Return the fence of a plan with these waypoints."""
    return fence_of(problem, [p.position[:2] for p in points], settings.fence)


def not_written(problem: Problem, kind: str) -> str | None:
    """Return a note on the parts of a problem that a format cannot store; None if it stores all."""
    missing = []
    if kind in ("wpl", "cockpit"):
        missing += ["the tether's length", "the clearance"]
        missing += ["obstacles"] if problem.obstacles else []
        missing += ["names of goals"] if any(g.name is not None for g in problem.goals) else []
    if kind == "plan" and any(o.name is not None for o in problem.obstacles):
        missing.append("names of obstacles")
    missing += ["bounds"] if problem.bounds is not None else []
    missing += ["the state of the tether"] if problem.state is not None else []
    return f"not written in this format: {', '.join(missing)}" if missing else None


def altitude(z: float, policy: ExportPolicy = DEFAULT_EXPORT) -> float:
    """Return the altitude relative to the surface that is written for a height."""
    return round(min(z, -policy.min_depth), 3)


def with_distinct_holds(points: Sequence[Waypoint], settings: ExportSettings) -> ExportSettings:
    """Return the settings with a hold at bends that differs from the hold at every goal.

    An import tells goals from bends by these times, because a ground station keeps no other mark of
    a waypoint when it saves the file. The hold at bends in the settings is the minimum.
    """
    holds = {_hold(p, settings) for p in points if p.goal not in (None, HOME)}
    free_holds = (
        s
        for s in range(settings.bend_hold_s, settings.bend_hold_s + len(holds) + 1)
        if s not in holds
    )
    return replace(settings, bend_hold_s=next(free_holds))


def _hold(point: Waypoint, settings: ExportSettings) -> int:
    if point.goal in (None, HOME):
        return settings.bend_hold_s
    if settings.goal_hold_s is not None:
        return settings.goal_hold_s
    return settings.policy.default_hold_s if point.stay is None else point.stay


def _plan(
    problem: Problem,
    points: list[Waypoint],
    projection: Projection | None,
    settings: ExportSettings,
) -> str:
    assert projection is not None
    fence = fence_of_points(problem, points, settings)
    plan = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "netsp": {
            "tether_length": problem.tether_length,
            "clearance": problem.clearance,
            "heading": projection.heading,
            "fence": {
                "simplified": [problem.obstacle_name(z.obstacle) for z in fence.simplified],
                "left_out": [problem.obstacle_name(k) for k in fence.left_out],
            },
        },
        "geoFence": _plan_fence(fence, projection),
        "rallyPoints": {"version": 2, "points": []},
        "mission": {
            "version": 2,
            "firmwareType": AUTOPILOT_ARDUPILOT,
            "vehicleType": VEHICLE_SUBMARINE,
            "globalPlanAltitudeMode": 1,
            "cruiseSpeed": settings.speed or 0.5,
            "hoverSpeed": settings.speed or 0.5,
            "plannedHomePosition": [projection.latitude, projection.longitude, 0],
            "items": _plan_items(problem, points, projection, settings),
        },
    }
    return json.dumps(plan, indent=1, allow_nan=False) + "\n"


def _plan_items(
    problem: Problem, points: list[Waypoint], projection: Projection, settings: ExportSettings
) -> list[dict[str, Any]]:
    places = projection.to_earth([p.position[:2] for p in points])
    items: list[dict[str, Any]] = []
    for p, (lat, lon) in zip(points, places, strict=True):
        z = altitude(p.position[2], settings.policy)
        hold_s = _hold(p, settings)
        item = {
            "type": "SimpleItem",
            "command": NAV_WAYPOINT,
            "frame": FRAME_RELATIVE_ALTITUDE,
            "autoContinue": True,
            "AltitudeMode": 1,
            "Altitude": z,
            "AMSLAltAboveTerrain": None,
            "params": [hold_s, 0, 0, p.heading, _degrees(lat), _degrees(lon), z],
            "netsp": _mark(problem, p),  # ground stations ignore what they do not know
        }
        items.append(item)
    if settings.speed is not None:
        change = {
            "type": "SimpleItem",
            "command": DO_CHANGE_SPEED,
            "frame": FRAME_MISSION,
            "autoContinue": True,
            "params": [GROUND_SPEED, settings.speed, KEEP_THROTTLE, 0, 0, 0, 0],
        }
        items.insert(1, change)
    for k, item in enumerate(items):
        item["doJumpId"] = k + 1
    return items


def _plan_fence(fence: Fence, projection: Projection) -> dict[str, Any]:
    circles: list[Any] = []
    polygons: list[Any] = []
    for zone in fence.zones:
        o = zone.shape
        if isinstance(o, Circle):
            ((lat, lon),) = projection.to_earth([o.center])
            radius = math.ceil(1000.0 * o.radius - 1e-3) / 1000.0  # no smaller than the obstacle
            centre = {"center": [_degrees(lat), _degrees(lon)], "radius": radius}
            circles.append({"version": 1, "inclusion": False, "circle": centre})
        else:
            corners = [[_degrees(a), _degrees(b)] for a, b in projection.to_earth(o.polygon)]
            polygons.append({"version": 1, "inclusion": False, "polygon": corners})
    return {"version": 2, "circles": circles, "polygons": polygons}


def _mark(problem: Problem, point: Waypoint) -> dict[str, Any]:
    """Return the kind of a waypoint, so that `netsp import` tells goals from bends."""
    if point.start:
        return {"kind": "start"}
    if point.goal is None:
        return {"kind": "bend"}
    if point.goal == HOME:
        return {"kind": "base"}
    name = problem.goals[point.goal].name
    return {"kind": "goal", **({} if name is None else {"name": name})}


def _wpl(
    problem: Problem,
    points: list[Waypoint],
    projection: Projection | None,
    settings: ExportSettings,
) -> str:
    del problem
    assert projection is not None
    rows: list[list[Any]] = [
        [0, 1, 0, NAV_WAYPOINT, 0, 0, 0, 0, projection.latitude, projection.longitude, 0, 1]
    ]
    places = projection.to_earth([p.position[:2] for p in points])
    for p, (lat, lon) in zip(points, places, strict=True):
        head = (len(rows), 0, FRAME_RELATIVE_ALTITUDE, NAV_WAYPOINT)
        params: list[Any] = [_hold(p, settings), 0, 0, p.heading or 0]
        z = altitude(p.position[2], settings.policy)
        rows.append([*head, *params, _degrees(lat), _degrees(lon), z, 1])
        if len(rows) == 2 and settings.speed is not None:
            params = [GROUND_SPEED, settings.speed, KEEP_THROTTLE, 0]
            rows.append([2, 0, FRAME_MISSION, DO_CHANGE_SPEED, *params, 0, 0, 0, 1])
    return "QGC WPL 110\n" + "".join("\t".join(map(_cell, r)) + "\n" for r in rows)


def _cockpit(
    problem: Problem,
    points: list[Waypoint],
    projection: Projection | None,
    settings: ExportSettings,
) -> str:
    assert projection is not None
    holds = [_hold(p, settings) for p in points]
    depths = [altitude(p.position[2], settings.policy) for p in points]
    return cockpit_mission(
        problem.name, points, holds, depths, projection, settings.speed, settings.policy
    )


def _cell(value: Any) -> str:
    return f"{value:.9f}" if isinstance(value, float) else str(value)


def _degrees(value: float) -> float:
    """Return degrees with nine decimal places: a tenth of a millimetre."""
    return round(float(value), 9)


def _geojson(
    problem: Problem,
    points: list[Waypoint],
    projection: Projection | None,
    settings: ExportSettings,
) -> str:
    del settings
    assert projection is not None

    features = [
        _feature(
            "base",
            "Point",
            _lonlat(projection, problem.base),
            tether_length=problem.tether_length,
            clearance=problem.clearance,
            heading=projection.heading or None,
        )
    ]
    visits = {p.goal: (n, p) for n, p in enumerate(q for q in points if q.goal not in (None, HOME))}
    for k, goal in enumerate(problem.goals):
        visit, point = visits.get(k, (None, None))
        features.append(
            _feature(
                "goal",
                "Point",
                _lonlat(projection, goal.position),
                name=goal.name,
                visit=None if visit is None else visit + 1,
                tether_length=None if point is None else point.tether,
                signature=None if point is None else list(point.word),
            )
        )
    features += [_obstacle_feature(o, projection) for o in problem.obstacles]
    line = [_lonlat(projection, p.position) for p in points]
    features.append(_feature("path", "LineString", line))
    return json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False) + "\n"


def _lonlat(projection: Projection, place: Sequence[float]) -> list[float]:
    """Return longitude and latitude of (x, y), or of (x, y, z) with its height."""
    ((lat, lon),) = projection.to_earth([place[:2]])
    return [_degrees(lon), _degrees(lat), *place[2:]]


def _feature(kind: str, shape: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    stated = {"kind": kind, **{k: v for k, v in properties.items() if v is not None}}
    geometry = {"type": shape, "coordinates": coordinates}
    return {"type": "Feature", "properties": stated, "geometry": geometry}


def _obstacle_feature(obstacle: Circle | Polygon, projection: Projection) -> dict[str, Any]:
    if isinstance(obstacle, Circle):
        center = _lonlat(projection, obstacle.center)
        return _feature("obstacle", "Point", center, radius_m=obstacle.radius, name=obstacle.name)
    ring = [_lonlat(projection, c) for c in _counter_clockwise(obstacle.polygon)]
    return _feature("obstacle", "Polygon", [[*ring, ring[0]]], name=obstacle.name)


def _counter_clockwise(corners: Any) -> Any:
    """Return corners counter-clockwise, as RFC 7946 requires of outer rings."""
    c = np.array(corners)
    x, y = c[:, 0], c[:, 1]
    area = float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    return corners if area > 0.0 else corners[::-1]


def _csv(
    problem: Problem,
    points: list[Waypoint],
    projection: Projection | None,
    settings: ExportSettings,
) -> str:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    head = ["x", "y", "z", "kind", "goal", "name", "hold_s", "tether_length", "signature"]
    table.writerow(head + (["latitude", "longitude"] if projection else []))
    places = projection.to_earth([p.position[:2] for p in points]) if projection else None
    for k, p in enumerate(points):
        visited = p.goal not in (None, HOME)
        row: list[Any] = [*(f"{v:.6f}" for v in p.position)]
        row += ["start" if p.start else "goal" if visited else "base" if p.goal == HOME else "bend"]
        row += [p.goal, csv_cell(problem.goals[p.goal or 0].name)] if visited else ["", ""]
        row += [_hold(p, settings), f"{p.tether:.6f}" if visited else ""]
        row += [" ".join(map(str, p.word)) if visited else ""]
        if places is not None:
            row += [f"{v:.9f}" for v in places[k]]
        table.writerow(row)
    return text.getvalue()


def _kml(
    problem: Problem,
    points: list[Waypoint],
    projection: Projection | None,
    settings: ExportSettings,
) -> str:
    assert projection is not None
    return kml_of(problem, points, projection, settings.policy)


FORMATS: dict[str, Callable[[Problem, list[Waypoint], Projection | None, ExportSettings], str]] = {
    "plan": _plan,
    "wpl": _wpl,
    "cockpit": _cockpit,
    "geojson": _geojson,
    "kml": _kml,
    "csv": _csv,
    "kmz": _kml,  # packed by `write_page`
}

FOR_VEHICLES = ("plan", "wpl", "cockpit")
"""Formats that are uploaded to a vehicle, with its limits and depths."""

EXTENSIONS = {
    ".plan": "plan",
    ".waypoints": "wpl",
    ".txt": "wpl",
    ".cmp": "cockpit",
    ".geojson": "geojson",
    ".json": "geojson",
    ".kml": "kml",
    ".kmz": "kmz",
    ".csv": "csv",
}
"""Format of a file by the extension of its name."""


def format_of(file: str, requested: str | None) -> str:
    """Return the format that is asked for, or that of the file's extension.

    Raises
    ------
    InputError
        The two disagree, or neither states a format.
    """
    extension = os.path.splitext(file)[1].lower()
    by_name = EXTENSIONS.get(extension)
    if requested is not None and requested not in FORMATS:
        raise InputError(f"format: expected {', '.join(FORMATS)}, got {requested!r}")
    if requested is not None and by_name is not None and requested != by_name:
        raise InputError(
            f"format: {requested!r}, but {file!r} ends like a file of format {by_name}"
        )
    if requested is None and by_name is None:
        raise InputError(
            f"file: expected a name that ends in {', '.join(EXTENSIONS)}, got {file!r}; or a format"
        )
    return requested or by_name or ""

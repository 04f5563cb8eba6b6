"""Mission files of tours in space, in the formats of `netsp.exchange.missions.mission_files`.

The straight lines between waypoints are checked: free of solids, also where a vehicle cuts corners,
of the planned classes, and within the tether. Solids are not written, because fences of ground
stations are upright and would forbid the water above and below.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import Point3, checked_argument
from netsp.base.geometry import polylines
from netsp.exchange.maps.projection import Projection
from netsp.exchange.missions.mission_files import (
    FOR_VEHICLES,
    FORMATS,
    ExportSettings,
    check_settings,
    with_distinct_holds,
    write_page,
)
from netsp.exchange.missions.waypoints import TURN_TOLERANCE, Waypoint, turn
from netsp.model.problem import Goal, Problem
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.tour_plan import HOME
from netsp.world.mission.mission import Mission
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene


@dataclass(frozen=True)
class Exported:
    """Mission that was written.

    Attributes
    ----------
    points
        Waypoints, the start first; heights above the surface.
    longest
        Longest taut tether along the lines between waypoints, metres.
    room
        Distance from these lines to the nearest solid, metres.
    """

    points: list[Waypoint]
    longest: float
    room: float


def export_mission(
    mission: Mission,
    file: str | Path,
    kind: str,
    projection: Projection | None = None,
    *,
    acceptance: float = 0.0,
    settings: ExportSettings | None = None,
    surface: float = 0.0,
    scene: Scene | None = None,
) -> Exported:
    """Write a planned mission as a mission file.

    Parameters
    ----------
    kind : str
        One of `netsp.exchange.missions.FORMATS`.
    projection : Projection, optional
        Projection from (x, y) to degrees; only csv needs none.
    acceptance : float
        Acceptance radius of the vehicle, metres.
    surface : float
        z of the water's surface, metres.
    scene : Scene, optional
        Scene of the mission, if it is loaded already.

    Raises
    ------
    InputError
        The mission has no tour, waypoints are above the surface, a vehicle could cut a corner
        through a solid, or the lines are not of the planned classes or take more tether.
    """
    if mission.tour is None:
        raise InputError("tour: the mission has none; expected one that `netsp solve` has planned")
    if mission.track:
        raise InputError("track: a ground station knows no moving anchor; expected none")
    settings = settings or ExportSettings()
    acceptance = checked_argument("acceptance", acceptance, 0.0)
    check_settings(kind, settings)
    if projection is None and kind != "csv":
        raise InputError(f"origin: format {kind!r} needs latitude and longitude of the start")
    points = _waypoints(mission, projection)
    if kind in FOR_VEHICLES:
        _check_for_vehicle(points, settings, surface)
    scene = scene or mission.load_scene()
    field = scene.field()
    context = PlanningContext.for_mission(mission, scene, field)
    line = np.array([p.position for p in points])
    longest = 0.0
    for share in settings.policy.corner_shares if acceptance else (0.0,):
        path = pursued(line, share * acceptance) if share else line
        _check_free(field, path, share * acceptance)
        longest = max(longest, _checked(context, points, path, share == 0.0))
    sunk = [_sunk(p, surface) for p in points]
    settings = with_distinct_holds(sunk, settings)
    problem = _problem_of_mission(mission, surface)
    write_page(file, kind, FORMATS[kind](problem, sunk, projection, settings))
    room = float(field.distance(polylines.dense(line, 0.05)).min())
    return Exported(sunk, longest, room)


def _check_for_vehicle(points: list[Waypoint], settings: ExportSettings, surface: float) -> None:
    """Refuse more waypoints than a vehicle takes, and waypoints above the water's surface."""
    if len(points) > settings.max_waypoints:
        raise InputError(
            f"mission: needs {len(points)} waypoints, and the vehicle takes "
            f"{settings.max_waypoints}; raise that number if yours takes more"
        )
    high = max(p.position[2] for p in points)
    if high > surface:
        raise InputError(
            f"surface: {surface:g} is below the tour, which rises to z {high:.4g}; expected the z "
            "of the water's surface"
        )


def _waypoints(mission: Mission, projection: Projection | None) -> list[Waypoint]:
    """Return the start, bends, waypoints, and home; a bend without a turn is left out."""
    tour = mission.tour
    assert tour is not None
    north_heading = 0.0 if projection is None else projection.heading
    points = [Waypoint(mission.begin, None, start=True)]
    for k, visit in enumerate(tour.stops):
        points += _bends(visit.path)
        heading = mission.waypoints[k].heading
        points.append(
            Waypoint(
                visit.path[-1],
                k,
                visit.signature or (),
                visit.tether_length,
                # from the x axis towards y, to clockwise from north
                heading=None if heading is None else (north_heading + 90.0 - heading) % 360.0,
                stay=math.ceil(mission.waypoints[k].dwell),
            )
        )
    return [*points, *_bends(tour.home), Waypoint(mission.start, HOME)]


def _bends(path: tuple[Point3, ...]) -> list[Waypoint]:
    """Return the places where a path turns between its ends; repeated points are no bends."""
    line = np.array(path)
    line = line[np.r_[True, (np.diff(line, axis=0) != 0.0).any(axis=1)]]
    return [
        Waypoint(tuple(b.tolist()), None)
        for a, b, c in zip(line, line[1:], line[2:], strict=False)
        if turn(a, b, c) > TURN_TOLERANCE
    ]


def pursued(line: Floats, radius: float) -> Floats:
    """Return the path of a vehicle that heads for each waypoint until it is within a radius of it.

    It may pass several bends at once that are near to one another.

    Parameters
    ----------
    line : ndarray, shape (k, 3)
        Waypoints, metres.
    radius : float
        Acceptance radius, metres.
    """
    path = [line[0]]
    for k, target in enumerate(line[1:], 1):
        position = path[-1]
        distance = float(np.linalg.norm(target - position))
        stop_distance = radius if k < len(line) - 1 else 0.0
        if distance > stop_distance:
            path.append(position + (target - position) * (1.0 - stop_distance / distance))
    return np.array(path)


def _check_free(field: DistanceField, line: Floats, radius: float) -> None:
    for a, b in pairwise(line):
        if field.line_of_sight(a, b, depth=1e-3):
            continue
        x, y, z = a
        if radius:
            raise InputError(
                f"acceptance: the vehicle could cut the corner at ({x:.4g}, {y:.4g}, {z:.4g}) "
                "through a solid; expected a smaller radius, or a plan with a larger clearance"
            )
        raise InputError(f"mission: the line from ({x:.4g}, {y:.4g}, {z:.4g}) on enters a solid")


def _checked(context: PlanningContext, points: list[Waypoint], line: Floats, exact: bool) -> float:
    """Return the longest taut tether along a line whose word at the end is empty, as in the plan.

    For the exact path, the words at the waypoints are checked as well.
    """
    words, tether, tour = context.words, context.present_tether, context.mission.tour
    assert tour is not None
    word, broken = words.try_word(np.vstack([tether.nodes, line, context.start_tether.nodes[::-1]]))
    if broken is not None or word != ():
        raise InputError("mission: its waypoints are not of the plan's homotopy class")
    if exact:
        for k, p in enumerate(points):
            if p.goal is None or p.goal == HOME:
                continue
            path = np.vstack([tether.nodes, line[: k + 1], context.mission.places[p.goal]])
            word, broken = words.try_word(path)
            stated = tour.stops[p.goal].signature
            if broken is not None or stated not in (None, word):
                raise InputError(
                    f"mission: at waypoint #{p.goal} the lines are not of the planned class"
                )
    _, longest = context.drive(tether, line, is_fine=True)
    limit = context.mission.tether_length
    if longest > limit:
        raise InputError(
            f"tether_length: the lines between waypoints take {longest:.4g} m; expected no more "
            f"than {limit:g}"
        )
    return longest


def _sunk(p: Waypoint, surface: float) -> Waypoint:
    x, y, z = p.position
    return replace(p, position=(x, y, z - surface))


def _problem_of_mission(mission: Mission, surface: float) -> Problem:
    """Return a problem with the mission's places, from which formats take names and the base.

    Goals of a problem are distinct, and a mission may visit a place again with another heading. So
    the goal of a later visit lies higher by a millionth of the tether for each earlier one.
    """
    x, y, z = mission.start
    places, step = mission.places.tolist(), 1e-6 * mission.tether_length
    goals = tuple(
        Goal(
            position=(a, b, c - surface + step * places[:k].count([a, b, c])), name=f"waypoint {k}"
        )
        for k, (a, b, c) in enumerate(places)
    )
    return Problem(
        name=mission.name,
        base=(x, y, z - surface),
        goals=goals,
        obstacles=(),
        tether_length=mission.tether_length,
        clearance=mission.clearance,
    )

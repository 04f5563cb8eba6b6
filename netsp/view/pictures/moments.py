"""Moments of a tour or a run: position of the robot, its path so far, and its tether."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.model.problem import Problem
from netsp.model.solution import Solution
from netsp.plan.space.space_world import SpaceWorld
from netsp.plan.tour_plan import HOME
from netsp.roadmap.plane_world import PlaneWorld
from netsp.view.pictures.mission_picture import path_of, tethers_along
from netsp.view.pictures.picture_layout import PageLayout
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import Run
from netsp.world.scene.scene import Scene
from netsp.world.world_protocol import World

VISITED, LEFT_OUT, CANCELLED = "visited", "left out", "cancelled"
"""Fates of a goal or waypoint."""

Fates = Mapping[str, tuple[int, ...]]
"""Numbers of goals or waypoints by fate."""


@dataclass(frozen=True)
class Moment:
    """Moment of a tour or a run.

    Parameters
    ----------
    nodes : ndarray, shape (k, 3)
        Nodes of the tether, from the anchor to the robot.
    path : ndarray, shape (m, 3)
        Path so far.
    text : str
        Caption: time or distance, and next goal.
    problem : Problem or None
        Map at this moment; None in space.
    fates : mapping
        Fates of goals or waypoints at this moment.
    """

    nodes: Floats
    path: Floats
    text: str
    problem: Problem | None = None
    fates: Fates = field(default_factory=dict)


def moments_of_plan(problem: Problem, solution: Solution, count: int) -> list[Moment]:
    """Return `count` + 1 moments at equal steps along the tour of a problem."""
    path = np.array(solution.path)
    s = polylines.along(path)
    visits = [(goal, float(s[n])) for goal, n in _reached(path, problem, solution)]
    world = PlaneWorld(problem, start_tether=solution.start_tether)
    return _moments_along(world, path, visits, count, problem=problem)


def moments_of_mission(mission: Mission, scene: Scene, count: int) -> list[Moment]:
    """Return `count` + 1 moments at equal steps along the tour of a mission.

    Raises
    ------
    InputError
        The mission has no tour.
    """
    if mission.tour is None:
        raise InputError(
            f"{mission.name}: tour: the mission has none; expected one that netsp solve has planned"
        )
    legs = [mission.tour.leg(k) for k in range(len(mission.tour.stops))]
    ends = np.cumsum([polylines.length(leg) for leg in legs if leg is not None]).tolist()
    left_out = tuple(range(len(ends), len(mission.waypoints)))
    world = SpaceWorld(mission, scene)
    return _moments_along(world, mission.tour.line, list(enumerate(ends)), count, left_out)


def _moments_along(
    world: World,
    path: Floats,
    visits: Sequence[tuple[int, float]],
    count: int,
    left_out: tuple[int, ...] = (),
    problem: Problem | None = None,
) -> list[Moment]:
    """Return the moments at equal steps along a path (n, 3), with tethers by the online model.

    `visits` are goals or waypoints in order, each with the length of the path up to it; the path
    does not lead to those in `left_out`.
    """
    s = polylines.along(path)
    state, units, out, at = world.present_tether, world.units, [], 0
    for u in np.linspace(0.0, s[-1], count + 1):
        robot_place = np.array([np.interp(u, s, path[:, k]) for k in range(3)])
        passed = int(np.searchsorted(s, u))
        state = world.model.drive(state, np.vstack([path[at:passed], robot_place]))[0]
        at = max(at, passed)
        visited = tuple(k for k, end in visits if end <= u + 1e-9 * s[-1])
        text = (
            f"{u:.4g} of {s[-1]:.4g} {units}; tether {state.length:.4g} of "
            f"{world.tether_length:g} {units}"
        )
        if problem is None:
            text += f"; {len(visited)} of {len(visits) + len(left_out)} visited"
        fates = {VISITED: visited, LEFT_OUT: left_out if u == s[-1] else ()}
        gone = np.vstack([path[:passed], robot_place])
        out.append(Moment(state.nodes, gone, text, problem, fates))
    return out


def _reached(path: Floats, problem: Problem, solution: Solution) -> list[tuple[int, int]]:
    """Return pairs of a goal of the tour and the vertex of the path at its visit."""
    out, at = [], 0
    for visit in solution.tour:
        apart = np.linalg.norm(path[at:] - np.array(problem.goals[visit.goal].position), axis=1)
        at += int(np.argmax(apart <= apart.min() + problem.tolerance))
        out.append((visit.goal, at))
    return out


def moments_of_run(
    maps: Sequence[tuple[float, Problem]],
    rows: Sequence[dict[str, str]],
    tethers: Sequence[dict[str, Any]],
    count: int,
    since: Mapping[str, Mapping[int, float]],
) -> list[Moment]:
    """Return the moments of a recorded run.

    Parameters
    ----------
    maps : sequence of (float, Problem)
        Maps, each with the time, s, from which it applied; the first from 0.
    rows : sequence of dict
        Rows of log.csv.
    tethers : sequence of dict
        Entries of tethers.json.
    count : int
        Approximate number of moments.
    since : mapping of str to mapping of int to float
        Times, s, from which goals have each fate.

    Returns
    -------
    list of Moment
        Moments, the last of the run included.

    Raises
    ------
    KeyError, ValueError
        A file is damaged.
    """
    times = np.array([float(r["time"]) for r in rows])
    path = np.array([[float(r[k]) for k in "xyz"] for r in rows])
    step = max(1, len(tethers) // count)
    chosen = [*tethers[::step], *([tethers[-1]] if (len(tethers) - 1) % step else [])]
    out = []
    for frame in chosen:
        nodes = np.array(frame["nodes"], dtype=float).reshape(-1, 3)
        if not np.isfinite([frame["time"], *nodes.ravel()]).all():
            raise ValueError(f"tethers.json: time {frame['time']}: expected numbers")
        k = min(int(np.searchsorted(times, frame["time"])), len(rows) - 1)
        row = rows[k]
        problem = next(p for since, p in reversed(maps) if since <= max(frame["time"], 0.0))
        where = f"next: {next_of(problem, int(row['goal']))}"
        if k == len(rows) - 1:
            where = "the end"
        text = (
            f"{frame['time']:.4g} s; tether {float(row['tether']):.4g} of {float(row['limit']):g} "
            f"{problem.units}; {where}"
        )
        gone = np.vstack([path[: k : max(1, k // PageLayout.path_points)], nodes[-1:]])
        now = frame["time"] if k < len(rows) - 1 else np.inf
        fates = {
            fate: tuple(g for g, when in begins.items() if when <= now)
            for fate, begins in since.items()
        }
        out.append(Moment(nodes, gone, text, problem, fates))
    return out


def moments_of_flight(run: Run, scene: Scene, count: int) -> list[Moment]:
    """Return about `count` moments of a flight in space, including the last one.

    The tether is simulated again along the path.
    """
    path = path_of(run)
    visited = {int(stop["waypoint"]) for stop in run.summary["stops"]}
    stamps = np.array([r.time for r in run.log])
    rows = np.searchsorted(stamps, np.linspace(0.0, stamps[-1], count))
    rows = np.minimum(rows, len(stamps) - 1)
    units, out = scene.units, []
    for row, tether in zip(rows, tethers_along(run, scene, rows), strict=True):
        r = run.log[row]
        end = row == len(stamps) - 1
        passed = range(len(run.mission.waypoints) if end else r.waypoint)
        fates = {
            VISITED: tuple(k for k in passed if k in visited),
            LEFT_OUT: tuple(k for k in passed if k not in visited),
        }
        text = (
            f"{r.time:.4g} s; tether {r.tether:.4g} of {r.limit:g} {units}; "
            f"{len(fates[VISITED])} of {len(run.mission.waypoints)} visited"
        )
        gone = np.vstack([path[: row : max(1, row // PageLayout.path_points)], path[row]])
        nodes = np.vstack([tether.nodes[:-1], path[row]])
        out.append(Moment(nodes, gone, text, fates=fates))
    return out


def next_of(problem: Problem, goal: int) -> str:
    """Return the name or number of a run's next goal, which may have been added on the way."""
    if goal == HOME:
        return "the base"
    return problem.goal_label(goal) if goal < len(problem.goals) else f"goal #{goal}"

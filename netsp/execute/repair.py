"""What is broken of a plan, and how it is mended.

The robot is at a state of the covering space: its position and the word of its tether. What is left
of the plan is whole if its ways are free, its tethers fit and the tether comes home free; otherwise
the remaining NE-TSP is solved from that state. First the order of the goals is kept and only their
classes are chosen afresh (a local repair, exact for that order and quick); the tour is planned anew
when that promises to save more time than planning takes.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from netsp.errors import InfeasibleError, NetspError
from netsp.execute.plan import HOME, Leg, legs_of
from netsp.hsignature import concatenate, crossings, signature
from netsp.problem import Circle, Goal, Problem, State
from netsp.result import Result
from netsp.roadmap.opened import FAR, OpenedGraph, opened_graph
from netsp.roadmap.paths import TautPaths
from netsp.solution import Status
from netsp.solvers import solve_graph, to_solution

Floats = npt.NDArray[np.float64]

REPLAN_S = 2.0
"""Seconds that planning the rest of a tour anew may take."""


@dataclass(frozen=True)
class Repair:
    """A new plan. kind : kept, local, replan or home. reason : for the log. lost : goals that
    cannot be reached any more, with the reason. length : metres to go. planning_s : what it
    took."""

    kind: str
    reason: str
    legs: list[Leg]
    lost: tuple[tuple[int, str], ...]
    length: float
    planning_s: float


def broken(problem: Problem, tether: Floats, legs: list[Leg]) -> tuple[str | None, list[Leg]]:
    """What is wrong with what is left of a plan, None if nothing is; and the legs with the words
    and tethers that they have among the obstacles that there are now. tether : (k, 3) the taut
    tether now. The ways of the legs follow on each other, the first starts at the robot."""
    rays = problem.representative_points
    word = signature(tether[:, :2], rays)
    left = [leg.goal for leg in legs if leg.goal != HOME]
    for leg in legs:
        obstacle = _in_the_way(problem, leg.way)
        if obstacle is not None:
            label = problem.obstacle_label(obstacle)
            return f"{label} stands in the way to {_label(problem, leg)}", legs
    rest = problem.model_copy(update={"goals": tuple(problem.goals[g] for g in left)})
    tethers = TautPaths(rest, FAR * problem.tether_length)
    now: list[Leg] = []
    for k, leg in enumerate(legs):
        word = concatenate(word, crossings(leg.way[:, :2], rays))
        if leg.goal == HOME:
            now.append(leg)
            break
        try:
            needs = tethers.length(0, k + 1, word)
        except NetspError:
            return f"no tether of the planned class reaches {_label(problem, leg)}", legs
        if needs > problem.tether_length + tethers.margin:
            return (
                f"the tether is too short at {_label(problem, leg)}: {needs:.6g} of "
                f"{problem.tether_length:g}"
            ), legs
        now.append(Leg(leg.goal, leg.way, word, needs))
    return ("the tether would not come home free", legs) if word else (None, now)


def _label(problem: Problem, leg: Leg) -> str:
    return "the base" if leg.goal == HOME else problem.goal_label(leg.goal)


def _in_the_way(problem: Problem, way: Floats) -> int | None:
    """An obstacle, grown by the clearance, that a way enters."""
    line = shapely.LineString(way[:, :2]) if len(way) > 1 else shapely.Point(way[0, :2])
    place = 1e-6 * problem.scale
    for i, o in enumerate(problem.obstacles):
        if isinstance(o, Circle):
            room = line.distance(shapely.Point(o.center)) - o.radius
        else:
            shape = shapely.Polygon(o.polygon)
            room = line.distance(shape)
            if shape.buffer(-place, join_style="mitre").intersects(line):
                room = -np.inf
        if room < problem.clearance - place:
            return i
    return None


def repair(
    problem: Problem, robot: Floats, tether: Floats, left: list[int], speed: float, why: str,
    seed: int = 0,
) -> Repair:  # fmt: skip
    """A plan from the present state through the goals `left` (numbers in the problem, in their
    order) and home. Goals that cannot be reached are left out, with the reason."""
    begin = time.perf_counter()
    lost: list[tuple[int, str]] = []
    word = signature(tether[:, :2], problem.representative_points)
    state = State(position=tuple(robot.tolist()), signature=word)
    order, graph = list(left), None
    while order:
        order, gone = _in_free_water(problem, order)
        lost += gone
        if not order:
            break
        try:
            graph = opened_graph(_rest(problem, order, state))
            break
        except InfeasibleError as error:
            far = _out_of_reach(problem, order, state)
            lost += [(g, str(error) if len(far) == 1 else "no tether reaches it") for g in far]
            order = [g for g in order if g not in far]
    if graph is None:
        legs = [_home(problem, state)]
        return Repair("home", why, legs, tuple(lost), legs[0].length, time.perf_counter() - begin)
    rest = _rest(problem, order, state)
    local = _keeping_order(graph, len(order))
    least = _least(graph, len(order))
    assert local.length is not None
    saving = (local.length - least) / speed
    chosen, kind = local, "local"
    reason = f"{why}; in the same order {local.length:.6g}"
    if saving > REPLAN_S:
        found = solve_graph(graph, "auto", time_limit=REPLAN_S, seed=seed, warm_start=local.tour)
        if found.length is not None and found.length < local.length - speed * REPLAN_S:
            chosen, kind = found, "replan"
            reason += f", in a new one {found.length:.6g}"
        else:
            reason += ", no new one is enough shorter"
    else:
        reason += f", a new one saves {saving:.2g} s at most"
    solution = to_solution(rest, graph, chosen, "auto", seed)
    legs = legs_of(rest, solution, order)
    return Repair(
        kind, reason, legs, tuple(lost), float(chosen.length or 0.0), time.perf_counter() - begin
    )


def _rest(problem: Problem, order: list[int], state: State) -> Problem:
    goals = tuple(problem.goals[g] for g in order)
    return problem.model_copy(update={"goals": goals, "state": state})


def _in_free_water(problem: Problem, order: list[int]) -> tuple[list[int], list[tuple[int, str]]]:
    """Goals that no obstacle has come to stand on, and those that one has."""
    kept: list[int] = []
    gone: list[tuple[int, str]] = []
    for g in order:
        xy = np.array(problem.goals[g].position[:2])
        on = [
            i for i, o in enumerate(problem.obstacles)
            if float(o.signed_distance(xy)) < problem.clearance - problem.tolerance
        ]  # fmt: skip
        if on:
            gone.append((g, f"{problem.obstacle_label(on[0])} stands on it"))
        else:
            kept.append(g)
    return kept, gone


def _out_of_reach(problem: Problem, order: list[int], state: State) -> list[int]:
    """Goals that no tether within the limit reaches."""
    out = []
    for g in order:
        try:
            opened_graph(_rest(problem, [g], state))
        except InfeasibleError:
            out.append(g)
    return out or list(order)


def _home(problem: Problem, state: State) -> Leg:
    """Back along the tether to the base."""
    placed = problem.model_copy(update={"goals": (Goal(position=state.position),), "state": None})
    back = TautPaths(placed, FAR * problem.tether_length).path(0, 1, state.signature)[::-1]
    return Leg(HOME, np.ascontiguousarray(back), (), 0.0)


def _keeping_order(graph: OpenedGraph, goals: int) -> Result:
    """The shortest path through the goals in their order: classes by dynamic programming."""
    start = graph.start
    assert start is not None
    at = np.array([start])
    reach = np.zeros(1)
    layers: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]] = []
    for c in range(1, goals + 1):
        members = graph.members(c)
        both = np.concatenate([at, members])
        legs = graph.within.costs_among(both)[: len(at), len(at) :]
        total = reach[:, None] + legs
        best = total.argmin(axis=0)
        layers.append((members, best))
        reach, at = total[best, np.arange(len(members))], members
    home = reach + graph.within.costs_to_base[at]
    k = int(home.argmin())
    length = float(home[k])
    tour: list[int] = []
    for members, best in reversed(layers):
        tour.append(int(members[k]))
        k = int(best[k])
    full = (0, start, *reversed(tour))
    return Result(
        status=Status.FEASIBLE, tour=full, length=length, lower_bound=None, trace=(),
    )  # fmt: skip


def _least(graph: OpenedGraph, goals: int) -> float:
    """A quick lower bound on every path: half the two cheapest legs at each goal, and one at each
    end."""
    vertices = np.arange(len(graph))
    bounds = graph.within.lower_bounds(vertices)
    cluster = graph.cluster
    ends, total = [0, int(cluster[graph.start])], 0.0
    for c in range(goals + 2):
        own = cluster == c
        if not own.any():
            continue
        nearest = [
            float(bounds[np.ix_(own, cluster == other)].min())
            for other in range(goals + 2)
            if other != c and (cluster == other).any() and {c, other} != set(ends)
        ]
        nearest.sort()
        total += sum(nearest[: 1 if c in ends else 2])
    return 0.5 * total

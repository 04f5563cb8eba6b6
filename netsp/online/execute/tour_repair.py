"""Check and repair of a plan in the plane.

The robot is at a state of the covering space: its position and the word of its tether. The rest of
the plan holds if its paths are free, its tethers fit and the tether comes home free; otherwise the
remaining NE-TSP is solved from that state, and `netsp.online.execute.repair_rule` decides what is
done. In the same order only the classes are chosen again, which is exact for that order and quick.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError, NetspError
from netsp.base.geometry import polylines
from netsp.base.interrupt_signals import until_interrupt
from netsp.gtsp.travel.result import Result
from netsp.hsignature import concatenate, crossings, signature
from netsp.model.problem import Circle, Goal, Problem, State
from netsp.model.solution import Status
from netsp.online.execute.execute_policy import RepairPolicy
from netsp.online.execute.repair_rule import HOMEWARD, choose_repair
from netsp.online.execute.tether_reserve import ReservedLimit
from netsp.plan.answer import to_solution
from netsp.plan.solve_problem import solve_graph
from netsp.plan.tour_plan import HOME, Leg, legs_of
from netsp.roadmap.explain_unreachable import unreached_message
from netsp.roadmap.from_state import GraphFromState, graph_from_state
from netsp.roadmap.paths import TautPaths, UnknownPathError
from netsp.roadmap.plane_world import free_position
from netsp.roadmap.roadmap_policy import RoadmapPolicy


@dataclass(frozen=True)
class Repair:
    """New plan.

    Attributes
    ----------
    kind
        Response: kept, local, replan or home.
    reason
        Reason for the response, for the log.
    legs
        Legs of the plan, the last one home.
    left_out
        Goals that can no longer be reached, with the reason.
    length
        Length of the rest of the tour, in the problem's units.
    planning_s
        Time of planning, s.
    limit
        Length of tether that the plan may use at its goals; None for a plan without goals.
    """

    kind: str
    reason: str
    legs: list[Leg]
    left_out: tuple[tuple[int, str], ...]
    length: float
    planning_s: float
    limit: ReservedLimit | None = None


def plan_fault(
    problem: Problem, tether: Floats, legs: list[Leg], limit: ReservedLimit | None = None
) -> tuple[str | None, list[Leg]]:
    """Return what is wrong with the rest of a plan, None if nothing is, and its legs with the words
    and tethers that they have among the present obstacles.

    Parameters
    ----------
    tether
        (k, 3) the present taut tether.
    legs
        Rest of the plan; its first path starts at the robot.
    limit
        Length of tether that the plan may use; by default the whole tether.
    """
    longest = problem.tether_length if limit is None else limit.length
    rays = problem.representative_points
    word = signature(tether[:, :2], rays)
    left = [leg.goal for leg in legs if leg.goal != HOME]
    for leg in legs:
        obstacle = _blocking_obstacle(problem, leg.path)
        if obstacle is not None:
            label = problem.obstacle_label(obstacle)
            return f"{label} blocks the path to {_label(problem, leg)}", legs
    rest = problem.model_copy(update={"goals": tuple(problem.goals[g] for g in left)})
    tethers = TautPaths(
        rest, RoadmapPolicy().max_state_ratio * max(problem.tether_length, polylines.length(tether))
    )
    present_legs: list[Leg] = []
    for k, leg in enumerate(legs):
        word = concatenate(word, crossings(leg.path[:, :2], rays))
        if leg.goal == HOME:
            present_legs.append(leg)
            break
        try:
            needs = tethers.length(0, k + 1, word)
        except NetspError:
            return f"no tether of the planned class reaches {_label(problem, leg)}", legs
        if needs > longest + tethers.margin:
            fault = "be over the limit"
            if needs <= problem.tether_length + tethers.margin and limit is not None:
                fault = f"leave less than {limit.reserve:.4g} {problem.units} in reserve"
            return (
                f"the tether would {fault} at {_label(problem, leg)}: {needs:.6g} of "
                f"{problem.tether_length:g} {problem.units}"
            ), legs
        present_legs.append(Leg(leg.goal, leg.path, word, needs))
    return ("the tether would not be free at the base", legs) if word else (None, present_legs)


def _label(problem: Problem, leg: Leg) -> str:
    return "the base" if leg.goal == HOME else problem.goal_label(leg.goal)


def _blocking_obstacle(problem: Problem, path: Floats) -> int | None:
    """Return an obstacle, grown by the clearance, that a path enters; None if there is none."""
    line = shapely.LineString(path[:, :2]) if len(path) > 1 else shapely.Point(path[0, :2])
    tolerance = 1e-6 * problem.scale
    for i, o in enumerate(problem.obstacles):
        if isinstance(o, Circle):
            room = line.distance(shapely.Point(o.center)) - o.radius
        else:
            shape = shapely.Polygon(o.polygon)
            room = line.distance(shape)
            if shape.buffer(-tolerance, join_style="mitre").intersects(line):
                room = -np.inf
        if room < problem.clearance - tolerance:
            return i
    return None


@dataclass(frozen=True)
class RepairOptions:
    """Options of a repair.

    Attributes
    ----------
    speed
        Speed of the vehicle, length units per second.
    seed
        Seed of the solver.
    reserve
        Length of tether to keep in reserve, in the problem's units. No goal is left out for it: if
        a goal needs more tether, less is kept.
    policy
        Limits of the repair.
    """

    speed: float
    seed: int = 0
    reserve: float = 0.0
    policy: RepairPolicy = RepairPolicy()


def repair(
    problem: Problem,
    robot: Floats,
    tether: Floats,
    left: list[int],
    why: str,
    options: RepairOptions,
) -> Repair:
    """Return a plan from the present state through the goals `left` (numbers in the problem, in
    order) and home. Goals that cannot be reached are left out, with the reason.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C, which solvers alone would take for the wish to have what there is.
    """
    with until_interrupt(options.policy.time_limit_s) as clock:
        try:
            repaired = _repaired(problem, robot, tether, left, why, options, clock)
        except NetspError:
            if clock.is_stopped:
                raise KeyboardInterrupt from None
            raise
        if clock.is_stopped:
            raise KeyboardInterrupt
        return repaired


def _repaired(
    problem: Problem,
    robot: Floats,
    tether: Floats,
    left: list[int],
    why: str,
    options: RepairOptions,
    clock: Clock,
) -> Repair:
    """Return a plan as `repair` does, with what the clock leaves time for."""
    word = signature(tether[:, :2], problem.representative_points)
    state = State(position=free_position(problem, robot), signature=word)
    order, left_out = split_reachable(problem, left)
    if not order:
        home, reason = _home(problem, state, tether, why)
        return Repair(HOMEWARD, reason, [home], tuple(left_out), home.length, clock.elapsed)
    reserved = reserved_limit(problem, order, options.reserve)
    rest = _rest(problem, order, state, reserved.length)
    graph = graph_from_state(
        rest, max_classes=options.policy.max_classes, time_limit=clock, limits_paths=False
    )
    with graph.within.on_clock(clock):
        local = _keeping_order(graph, len(order))
    assert local.length is not None
    new_order, words = _better_order(problem, graph, local, len(order), options, clock)
    kind, chosen = choose_repair(local, lambda: new_order, HOMEWARD)
    assert chosen is not None
    reason = f"{why}; {local.length:.4g} {problem.units} to go in the same order, {words}"
    if reserve_note := reserved.describe(problem):
        reason += f"; {reserve_note}"
    solution = to_solution(rest, graph, chosen, "auto", options.seed)
    legs = legs_of(rest, solution, order)
    return Repair(
        kind, reason, legs, tuple(left_out), float(chosen.length or 0.0), clock.elapsed, reserved
    )


def _better_order(
    problem: Problem,
    graph: GraphFromState,
    local: Result,
    goals: int,
    options: RepairOptions,
    clock: Clock,
) -> tuple[Result | None, str]:
    """Return a tour that saves more time than planning it takes, None if there is none, and words
    for the log."""
    assert local.length is not None
    speed, is_time_up = options.speed, clock.left <= 0.0
    # a new order must save more time than its planning takes
    replan_s = max(clock.left, 0.0)
    saving = (local.length - _lower_bound_of_rest(graph, goals, clock)) / speed
    if saving > replan_s > 0.0:
        found = solve_graph(
            graph, "auto", time_limit=clock, seed=options.seed, warm_start=local.tour
        )
        max_length = local.length - speed * replan_s
        if found.length is not None and found.length < max_length:
            return found, f"{found.length:.4g} {problem.units} in a new one"
        if found.status is Status.OPTIMAL or (found.lower_bound or 0.0) >= max_length:
            return None, "a new order would not save enough"
        return None, (
            "no new order that saves enough was found within the time limit of planning; a "
            "longer limit (--planning-limit) may find one"
        )
    if is_time_up:
        return None, (
            "planning reached its time limit before it tried a new order; a longer limit "
            "(--planning-limit) may find a shorter path"
        )
    return None, f"a new order could save at most {max(saving, 0.0):.1f} s"


def reserved_limit(problem: Problem, goals: list[int], reserve: float) -> ReservedLimit:
    """Return the length of tether that a plan may use so that a reserve is kept, as far as
    possible without leaving out a goal.

    Parameters
    ----------
    goals
        Goals to be visited; unreachable ones do not count.
    """
    whole_tether = ReservedLimit(problem.tether_length, 0.0, reserve)
    if reserve <= 0.0:
        return whole_tether
    goals = _in_free_water(problem, goals)[0]
    if not goals:
        return whole_tether
    paths, needed = _shortest_tethers(problem, goals)
    reached = [k for k in range(len(goals)) if needed[k] <= problem.tether_length + paths.margin]
    farthest = max(reached, key=lambda k: float(needed[k]), default=None)
    length = problem.tether_length - reserve
    if length > paths.margin and (farthest is None or needed[farthest] <= length + paths.margin):
        return ReservedLimit(length, reserve, reserve)
    if farthest is None:
        return whole_tether
    length = min(float(needed[farthest]), problem.tether_length)
    return ReservedLimit(length, problem.tether_length - length, reserve, goals[farthest])


def _shortest_tethers(problem: Problem, goals: list[int]) -> tuple[TautPaths, Floats]:
    """Return the paths of a problem with some of its goals, and the length of the shortest tether
    to each, inf if there is none."""
    chosen = tuple(problem.goals[g] for g in goals)
    plain = problem.model_copy(update={"goals": chosen, "state": None})
    paths = TautPaths(plain)
    planar = paths.contacts.lengths([0])[0][1:]
    return paths, np.hypot(planar, plain.points[1:, 2] - plain.points[0, 2])


def split_reachable(problem: Problem, left: list[int]) -> tuple[list[int], list[tuple[int, str]]]:
    """Return the goals that a taut tether within the limit reaches, in order, and the others with
    the reason."""
    order, left_out = _in_free_water(problem, left)
    if not order:
        return order, left_out
    paths, needed = _shortest_tethers(problem, order)
    problem_of_goals = paths.problem
    unreached = [k for k in range(len(order)) if needed[k] > problem.tether_length + paths.margin]
    for k in unreached:
        why = unreached_message(problem_of_goals, paths.outline, [k + 1])
        left_out.append((order[k], why.removeprefix(f"{problem_of_goals.goal_label(k)} ")))
    return [g for k, g in enumerate(order) if k not in unreached], left_out


def _rest(problem: Problem, order: list[int], state: State, limit: float) -> Problem:
    goals = tuple(problem.goals[g] for g in order)
    return problem.model_copy(update={"goals": goals, "state": state, "tether_length": limit})


def _in_free_water(problem: Problem, order: list[int]) -> tuple[list[int], list[tuple[int, str]]]:
    """Return the goals in free water, and those on which an obstacle stands."""
    free: list[int] = []
    blocked: list[tuple[int, str]] = []
    for g in order:
        xy = np.array(problem.goals[g].position[:2])
        blocking = [
            i
            for i, o in enumerate(problem.obstacles)
            if float(o.signed_distance(xy)) < problem.clearance - problem.tolerance
        ]
        if blocking:
            blocked.append((g, f"{problem.obstacle_label(blocking[0])} stands on it"))
        else:
            free.append(g)
    return free, blocked


def _home(problem: Problem, state: State, tether: Floats, why: str) -> tuple[Leg, str]:
    """Return the leg back along the taut tether to the base, and the reason for the log.

    If the taut path is not found, the leg follows the tether as it lies.
    """
    placed = problem.model_copy(update={"goals": (Goal(position=state.position),), "state": None})
    longest = RoadmapPolicy().max_state_ratio * max(problem.tether_length, polylines.length(tether))
    try:
        path = TautPaths(placed, longest).path(0, 1, state.signature)[::-1]
    except UnknownPathError:
        path = tether[::-1]
        why += "; no taut path of the tether was found, so back along the tether as it lies"
    return Leg(HOME, np.ascontiguousarray(path), (), 0.0), why


def _keeping_order(graph: GraphFromState, goals: int) -> Result:
    """Return the shortest path through the goals in their order, with classes by dynamic
    programming.

    When the time is up, the other goals keep the class of the shortest tether.
    """
    start = graph.start
    assert start is not None
    vertices = np.array([start])
    lengths = np.zeros(1)
    layers: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]] = []
    for c in range(1, goals + 1):
        members = graph.members(c)
        ends = np.concatenate([vertices, members])
        is_needed = np.zeros((len(ends), len(ends)), dtype=bool)
        is_needed[: len(vertices), len(vertices) :] = is_needed[
            len(vertices) :, : len(vertices)
        ] = True
        try:
            legs = graph.within.costs_among(ends, is_needed)
        except LimitReachedError:
            best_so_far, shortest = int(lengths.argmin()), int(graph.tethers[members].argmin())
            members = members[[shortest]]
            with graph.within.on_clock(None):
                leg_length = graph.within.costs_among([vertices[best_so_far], members[0]])[0, 1]
            layers.append((members, np.array([best_so_far])))
            lengths, vertices = lengths[[best_so_far]] + leg_length, members
            continue
        total = lengths[:, None] + legs[: len(vertices), len(vertices) :]
        best = total.argmin(axis=0)
        layers.append((members, best))
        lengths, vertices = total[best, np.arange(len(members))], members
    home = lengths + graph.within.costs_to_base[vertices]
    k = int(home.argmin())
    length = float(home[k])
    tour: list[int] = []
    for members, best in reversed(layers):
        tour.append(int(members[k]))
        k = int(best[k])
    full = (0, start, *reversed(tour))
    # the walk starts at the state, because the path to it is behind the robot
    return Result(full, length, None, Status.FEASIBLE, walk=(*full[1:], 0))


def _lower_bound_of_rest(graph: GraphFromState, goals: int, clock: Clock) -> float:
    """Return a quick lower bound on every path: half the two cheapest legs at each goal, and one at
    each end; 0 if there is no time."""
    vertices = np.arange(len(graph))
    try:
        with graph.within.on_clock(clock):
            bounds = graph.within.lower_bounds(vertices)
    except LimitReachedError:
        return 0.0
    cluster = graph.cluster
    ends, total = [0, int(cluster[graph.start])], 0.0
    for c in range(goals + 2):
        is_member = cluster == c
        if not is_member.any():
            continue
        cheapest = [
            float(bounds[np.ix_(is_member, cluster == other)].min())
            for other in range(goals + 2)
            if other != c and (cluster == other).any() and {c, other} != set(ends)
        ]
        cheapest.sort()
        total += sum(cheapest[: 1 if c in ends else 2])
    return 0.5 * total

"""The plane's proof as a bound in space, for solids that stand through all depths of the tours.

Remove all other solids, and shrink these a little. No path and no tether gets longer by that, and a
free tether stays free, so the shortest tour of the reduced scene bounds all tours. The reduced
scene is a problem in the plane with heights. The exact roadmap and its solvers bound its tours over
all homotopy classes of the tether. The robot keeps farther from solids than its tether, so its legs
are longer than those of the tether's problem (`netsp.plan.space.clearance_legs`). The proof, and
which solids stand through all depths, is in docs/theory, Section 22.
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.clock import Clock
from netsp.base.errors import NetspError
from netsp.base.geometry import polylines
from netsp.model.problem import Circle, Polygon, Problem
from netsp.plan.solve_problem import solve_graph
from netsp.plan.space.clearance_legs import ClearanceLegs
from netsp.plan.space.cross_sections import Depths, cross_sections, level_range
from netsp.plan.space.few_obstacles import ReducedProblem, solve_with_few_obstacles
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import (
    CLEARANCE_TOLERANCE,
    DEPTH_TOLERANCE,
    PlanningContext,
    max_corner_dip,
)
from netsp.plan.space.potential import BOUND_ROUNDING
from netsp.roadmap.taut import TautRoadmap
from netsp.roadmap.travel_graph import TravelGraph
from netsp.world.mission.mission import Mission


def bound_by_upright_solids(
    mission: Mission,
    context: PlanningContext,
    place_numbers: list[int],
    places: Places,
    clock: Clock,
) -> float | None:
    """Return a bound on all tours from the scene's upright solids.

    Parameters
    ----------
    place_numbers : list of int
        Numbers of the places that tours visit.
    clock : Clock
        Clock of the run; when it is up, the bound proven so far is returned.

    Returns
    -------
    float or None
        Lower bound, metres; None if there are no upright solids, the mission begins under way, a
        waypoint has alternatives, or there was no time.
    """
    if places.present is not None or len(set(places.waypoint[place_numbers].tolist())) < len(
        place_numbers
    ):
        return None
    # among obstacles shrunk by this depth, paths and tethers that the judge accepts are free, and
    # the taut tether is no longer than its model
    dip = context.max_dip
    obstacles = upright_obstacles(context, dip)
    if not obstacles or clock.is_up:
        return None
    # the problem begins at the start: a tether there is at most the tether from the anchor and the
    # tether laid from the anchor to the start
    laid = float(polylines.length(context.start_tether.nodes))
    max_length = mission.tether_length * (1.0 + 1e-6) + laid
    try:
        problem = Problem(
            base=mission.start,
            goals=places.points[place_numbers].tolist(),
            obstacles=tuple(obstacles),
            tether_length=max_length,
        )
    except NetspError:
        return None  # no problem in the plane, so no bound from it
    bound = _bound_in_plane(problem, context, dip, clock)
    return None if bound is None else bound * (1.0 - BOUND_ROUNDING)


def _bound_in_plane(
    problem: Problem, context: PlanningContext, dip: float, clock: Clock
) -> float | None:
    """Return a lower bound on all tours of a problem whose robot keeps its clearance: with all
    obstacles, if there is a list of their classes, otherwise with few of them."""
    policy, bounds = context.policy.bound, [0.0]
    part = clock.part(policy.thick_share)
    roadmap = _complete_roadmap(problem, policy.max_classes, part)
    if roadmap is not None:
        is_whole = len(roadmap.problem.obstacles) == len(problem.obstacles)
        limit = clock if is_whole else part
        bounds.append(_bound_with_room(roadmap, context, dip, limit) or 0.0)
        if is_whole and bounds[-1]:
            return bounds[-1]
    solved: ReducedProblem | None = None
    few_clock = clock.part(policy.few_share)
    for reduced in solve_with_few_obstacles(problem, few_clock, policy.max_obstacles_added):
        bounds.append(reduced.bound)
        solved = reduced if reduced.is_solved else solved
    if solved is not None and not clock.is_up:
        roadmap = TautRoadmap(solved.problem, max_classes=policy.max_classes, time_limit=clock)
        if roadmap.complete:
            bounds.append(_bound_with_room(roadmap, context, dip, clock) or 0.0)
    return max(bounds) or None


def judged_room(room: float, context: PlanningContext) -> float:
    """Return the least distance from solids of paths that the judge accepts for a robot that keeps
    `room`, metres; negative if the paths may enter solids.

    The judge samples paths (`netsp.plan.space.planning_context.keeps_clearance`), and between two
    samples a path may be nearer to solids. At its nearest point, the line to the solid is
    perpendicular to the path, and a sample is at most half a step away. So the square of the
    distance is at least that of the sampled one less that of half a step
    (docs/theory/space-bounds.md). For voxels, and where the sampled distance is no more than half a
    step, the result is less by half a step.
    """
    sampled = room - max_corner_dip(context.mission.delta)
    half_step = 2.0 * CLEARANCE_TOLERANCE  # twice what short paths have, for those of up to 40 km
    # voxel distances are estimates, and inside a solid the distance is not to a point of it
    if context.field.voxel is None and sampled > half_step:
        return math.sqrt(sampled**2 - half_step**2)
    return max(sampled - half_step, -2.0 * DEPTH_TOLERANCE)


def _bound_with_room(
    roadmap: TautRoadmap, context: PlanningContext, dip: float, clock: Clock
) -> float | None:
    """Return a lower bound on all tours of a roadmap's problem whose robot keeps its clearance;
    None if longer paths stand for some legs.

    Solve for the shortest tour, measure its legs with the clearance, and solve again, until the
    legs of the shortest tour are measured or the time is up.
    """
    mission, problem = context.mission, roadmap.problem
    points = np.vstack([problem.points, mission.start])
    room = min(mission.clearance, float(context.field.distance(points).min()))
    growth = max(0.0, dip + judged_room(room, context))
    try:
        graph = roadmap.to_travel_graph()
        legs = ClearanceLegs(graph, problem.model_copy(update={"clearance": growth}), clock=clock)
        if graph.legs_left_out:
            return None
        best = 0.0
        while True:
            known = TravelGraph.from_costs(legs.costs, graph.cluster)
            result = solve_graph(known, "auto", time_limit=clock)
            best = max(best, result.lower_bound or 0.0)
            if clock.is_up or result.tour is None or not legs.raise_along([*result.tour, 0]):
                return best
    except NetspError:
        return None


def _complete_roadmap(problem: Problem, max_classes: int, clock: Clock) -> TautRoadmap | None:
    """Return a roadmap with all classes; if there are too many, without the thinnest obstacles.

    A tether can wind often around a thin post, which makes many classes that no short tour
    needs. A problem with fewer obstacles has no longer tours, so its bound holds.
    """
    obstacles, removed = sorted(problem.obstacles, key=_girth, reverse=True), 1
    while obstacles and not clock.is_up:
        reduced = problem.model_copy(update={"obstacles": tuple(obstacles)})
        roadmap = TautRoadmap(reduced, max_classes=max_classes, time_limit=clock.part(0.5))
        if roadmap.complete:
            return roadmap
        obstacles, removed = obstacles[:-removed], 2 * removed
    return None


def _girth(obstacle: Circle | Polygon) -> float:
    """Return the perimeter of an obstacle, metres."""
    if isinstance(obstacle, Circle):
        return 2.0 * math.pi * obstacle.radius
    return float(obstacle.shape(0.0).length)


def upright_obstacles(context: PlanningContext, dip: float) -> list[Circle | Polygon]:
    """Return obstacles of the plane that lie within a scene's upright solids.

    A solid must stand through all heights in which tethers lie or words distinguish classes. If all
    solids are upright, these are the heights of the scene's bounds. If not, a tether may be led out
    of the bounds over another solid, and these are all heights in its reach, too.

    Parameters
    ----------
    dip : float
        Depth to which paths and tethers may enter solids, metres.

    Returns
    -------
    list of Circle or Polygon
        One for each upright solid that is thicker than twice `dip`.
    """
    field, grid = context.field, context.grid
    anchor = np.asarray(context.mission.anchor, dtype=float)
    reach = context.mission.tether_length * (1.0 + 1e-6) + dip
    floor, ceiling = level_range(field, dip)
    heights = [float(grid.low[2]), float(grid.low[2]) + grid.cell * grid.free.shape[2]]
    if context.bounds is not None:
        heights += [
            context.bounds[2],
            context.bounds[5],
            *context.start_tether.nodes[:, 2].tolist(),
        ]
        in_bounds = Depths(max(floor, min(heights)), min(ceiling, max(heights)), anchor, reach)
        obstacles, all_upright = cross_sections(field, in_bounds, dip)
        if all_upright:
            return obstacles
    heights += [anchor[2] - reach, anchor[2] + reach]
    in_reach = Depths(max(floor, min(heights)), min(ceiling, max(heights)), anchor, reach)
    return cross_sections(field, in_reach, dip)[0]

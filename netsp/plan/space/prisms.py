"""Tours of scenes whose solids are all upright prisms, from the exact roadmap of the plane.

Among upright prisms the water is the product of a plane and an interval, so the homotopy classes of
paths are those of the plane (docs/theory, Proposition 6). The taut roadmap therefore knows all
classes of such a scene, and the solvers find the shortest tour over them. This tour is a candidate:
it is driven and judged in space like any other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.base.errors import InfeasibleError, InputError, LimitReachedError
from netsp.base.geometry import polylines
from netsp.hsignature import concatenate, invert
from netsp.hsignature.rays import signature
from netsp.model.problem import Circle, Goal, Polygon, Problem
from netsp.model.solution import Status
from netsp.plan.solve_problem import solve, solve_graph
from netsp.plan.space.board import DrivenTour
from netsp.plan.space.clearance_legs import ClearanceLegs
from netsp.plan.space.driven_legs import LegTo, drive_legs
from netsp.plan.space.mission_policy import PlanePolicy
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.roadmap.explain_unreachable import shortest_tethers
from netsp.roadmap.from_state import from_state
from netsp.roadmap.paths import TautPaths, UnknownPathError
from netsp.roadmap.taut import TautRoadmap
from netsp.roadmap.travel_graph import TravelGraph
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene
from netsp.world.scene.shapes import Box, Capsule, Cylinder, HalfSpace, Post, Prism, Shape

UPRIGHT_TOLERANCE = 1e-9
"""Tolerance for rounding in files: largest difference from 1 of the cosine between an upright axis
and the vertical."""

Corner = tuple[float, float]


@dataclass(frozen=True)
class FloorPlan:
    """Floor plan of a scene of upright prisms.

    Attributes
    ----------
    circles
        Centre (x, y) and radius of each round solid, metres.
    polygons
        Corners (x, y) of each polygon, and the distance by which it grows, metres.
    """

    circles: tuple[tuple[Corner, float], ...]
    polygons: tuple[tuple[tuple[Corner, ...], float], ...]

    def obstacles(self, corner_segments: int) -> tuple[tuple[Circle | Polygon, ...], float]:
        """Return obstacles of a problem, smaller than the solids by a clearance, and this
        clearance, metres."""
        growth = min((g for _, g in self.polygons), default=0.0)
        growth = min([growth, *(0.5 * r for _, r in self.circles)])
        obstacles: list[Circle | Polygon] = [
            Circle(center=center, radius=radius - growth) for center, radius in self.circles
        ]
        for corners, polygon_growth in self.polygons:
            polygon = Polygon(polygon=corners)
            extra_growth = polygon_growth - growth
            if extra_growth > 0.0:
                import shapely

                # chords of a somewhat larger circle, so that none cuts the corner short
                extra_growth /= math.cos(math.pi / (4 * corner_segments))
                grown = shapely.Polygon(corners).buffer(extra_growth, quad_segs=corner_segments)
                polygon = Polygon(polygon=tuple(grown.exterior.coords[:-1]))
            obstacles.append(polygon)
        return tuple(obstacles), growth


def floor_plan(scene: Scene, mission: Mission) -> FloorPlan | None:
    """Return the floor plan of a scene if every solid in reach of the tether is an upright prism
    that spans all depths in its reach; None for other scenes."""
    if scene.mesh is not None or scene.cloud is not None or scene.floor is not None:
        return None
    anchor, reach = np.array(mission.anchor), mission.tether_length
    low, high = anchor - reach, anchor + reach
    if scene.bounds is not None:
        low = np.maximum(low, scene.bounds[:3])
        high = np.minimum(high, scene.bounds[3:])
    shapes = [solid.shape for solid in scene.all_solids()]
    for shape in shapes:
        if isinstance(shape, HalfSpace) and _is_vertical(shape.normal):
            if shape.normal[2] > 0.0:
                low[2] = max(low[2], shape.point[2])
            else:
                high[2] = min(high[2], shape.point[2])
    circles: list[tuple[Corner, float]] = []
    polygons: list[tuple[tuple[Corner, ...], float]] = []
    for shape in shapes:
        if isinstance(shape, HalfSpace):
            if _is_vertical(shape.normal):
                continue
            if abs(shape.normal[2]) > UPRIGHT_TOLERANCE * math.hypot(*shape.normal):
                return None
            normal = np.array(shape.normal[:2]) / math.hypot(*shape.normal[:2])
            wall = wall_corners(np.array(shape.point[:2]), normal, anchor, reach)
            polygons.append((wall, scene.tether_radius))
            continue
        if not isinstance(shape, Post | Prism):
            box = np.asarray(shape.box()) + scene.tether_radius * np.array([[-1.0], [1.0]])
            if (box[0] >= high).any() or (box[1] <= low).any():
                continue  # out of reach of all tours
        circle, polygon = _circle_of(shape, low[2], high[2]), _polygon_of(shape, low[2], high[2])
        if circle is not None:
            circles.append((circle[0], circle[1] + scene.tether_radius))
        elif polygon is not None:
            polygons.append((polygon[0], polygon[1] + scene.tether_radius))
        else:
            return None
    return FloorPlan(tuple(circles), tuple(polygons))


def _is_vertical(direction: tuple[float, float, float]) -> bool:
    """Return whether a direction is vertical."""
    return abs(direction[2]) >= (1.0 - UPRIGHT_TOLERANCE) * math.hypot(*direction)


def _circle_of(shape: Shape, low: float, high: float) -> tuple[Corner, float] | None:
    """Return centre and radius of an upright round solid that spans the depths from low to high."""
    if isinstance(shape, Post):
        return shape.center, shape.radius
    if isinstance(shape, Cylinder | Capsule):
        a, b = shape.a, shape.b
        axis = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
        spans = min(a[2], b[2]) <= low and max(a[2], b[2]) >= high
        if spans and math.hypot(*axis) > 0.0 and _is_vertical(axis):
            return (a[0], a[1]), shape.radius
    return None


def _polygon_of(shape: Shape, low: float, high: float) -> tuple[tuple[Corner, ...], float] | None:
    """Return corners and growth of an upright prism that spans the depths from low to high."""
    if isinstance(shape, Prism):
        return shape.polygon, shape.grow
    if isinstance(shape, Box):
        axes = shape.axes()
        up = int(np.abs(axes[:, 2]).argmax())
        half = 0.5 * np.array(shape.size)
        spans = shape.center[2] - half[up] <= low and shape.center[2] + half[up] >= high
        if spans and abs(axes[up, 2]) >= 1.0 - UPRIGHT_TOLERANCE:
            a, b = (axes[k, :2] * half[k] for k in range(3) if k != up)
            middle = np.array(shape.center[:2])
            corners = (middle + a + b, middle - a + b, middle - a - b, middle + a - b)
            return tuple((float(x), float(y)) for x, y in corners), 0.0
    return None


def wall_corners(point: Floats, normal: Floats, anchor: Floats, far: float) -> tuple[Corner, ...]:
    """Return the corners (x, y) of a rectangle that stands for an upright half-space in the reach
    of the tether, metres.

    Parameters
    ----------
    point : ndarray, shape (2,)
        Point on the face, metres.
    normal : ndarray, shape (2,)
        Unit normal out of the solid.
    anchor : ndarray, shape (2,) or (3,)
        Anchor of the tether, metres.
    far : float
        Length of the tether, metres.
    """
    along = np.array([-normal[1], normal[0]])
    foot = point + ((anchor[:2] - point) @ along) * along
    # no tour gets around a rectangle that extends by more than one tether length
    wide, deep = 4.0 * far * along, 4.0 * far * normal
    corners = (foot + wide, foot - wide, foot - wide - deep, foot + wide - deep)
    return tuple((float(x), float(y)) for x, y in corners)


def drive_plane_tours(
    context: PlanningContext,
    scene: Scene,
    places: Places,
    clock: Clock,
    seed: int = 0,
    policy: PlanePolicy | None = None,
    whole_tether: bool = False,
) -> Iterator[DrivenTour]:
    """Drive the shortest tours of the plane in a scene of upright prisms.

    Parameters
    ----------
    clock : Clock
        Clock of the run; when it is up, the best tours so far are driven.
    policy : PlanePolicy, optional
        Budget; by default that of the context.
    whole_tether : bool
        Whether tours may need the whole tether, for a caller that flies them.

    Yields
    ------
    DrivenTour
        First, if `whole_tether`, the shortest tour for the whole tether; then the shortest tour for
        the share of the tether that plans may use. Nothing in other scenes. A tour is skipped if
        the tether in space exceeds its limit.
    """
    plan, policy = floor_plan(scene, context.mission), policy or context.policy.plane
    if plan is None:
        return
    usable = context.policy.tether_share
    plane = _PlaneTour(context, scene, places, plan, policy)
    shares = (1.0 - policy.tether_margin, usable) if whole_tether else (usable,)
    for share in shares:
        shortest: DrivenTour | None = None
        is_optimal = False
        for touches in (True, False):
            if clock.is_up or is_optimal:
                break
            try:
                part = Clock(policy.max_s, within=clock.part(0.5))
                found = plane.shortest_legs(share, touches, part, seed)
            except (InputError, InfeasibleError, LimitReachedError, UnknownPathError):
                continue
            driven = None if found is None else drive_legs(context, found.legs, found.home)
            if found is not None and driven is not None:
                is_optimal = found.is_optimal
                if shortest is None or driven.length < shortest.length:
                    shortest = driven
        if shortest is not None:
            yield replace(shortest, is_plane_optimum=is_optimal)
            longest = max(visit.longest_tether for visit in shortest.visits)
            if is_optimal and longest <= usable * context.mission.tether_length:
                return


class _PlaneLegs(NamedTuple):
    """Shortest tour of the plane.

    Attributes
    ----------
    legs, home
        Legs to the visits, and the path home (k, 3), metres.
    is_optimal
        Whether the solver proved that no tour of the plane is shorter, in any class.
    """

    legs: list[LegTo]
    home: Floats
    is_optimal: bool


@dataclass(frozen=True)
class _PlaneTour:
    """Mission among upright prisms, as a problem of the plane."""

    context: PlanningContext
    scene: Scene
    places: Places
    plan: FloorPlan
    policy: PlanePolicy

    def shortest_legs(
        self, share: float, touches: bool, clock: Clock, seed: int
    ) -> _PlaneLegs | None:
        """Return the legs of the shortest tour for a share of the tether.

        Parameters
        ----------
        touches : bool
            Whether the tether may touch the prisms; if not, it keeps the robot's clearance.
        """
        context, places = self.context, self.places
        mission = context.mission
        start = len(places)  # number of the goal at the start, used if the start is not the anchor
        points = np.vstack([places.points, mission.start])
        starts_elsewhere = math.dist(mission.start, mission.anchor) > UPRIGHT_TOLERANCE
        goals = np.arange(len(points) if starts_elsewhere else start)
        tether_problem = partial(self._problem, share=share, touches=touches)
        goals = goals[self._goals_in_reach(tether_problem(points[goals]))]
        needed = {places.present} if places.present is not None else set()
        needed |= {start} if starts_elsewhere else set()
        if not needed <= set(goals.tolist()) or not set(goals.tolist()) - needed:
            return None
        roadmap = TautRoadmap(
            tether_problem(points[goals]),
            max_classes=self.policy.max_classes,
            time_limit=clock.part(0.5),
        )
        if not roadmap.complete and self._is_whole:
            # among the classes of the shortest tethers alone there are no short tours
            return (
                None if touches else self._searched_legs(goals[goals < start], share, clock, seed)
            )
        graph = roadmap.to_travel_graph()
        place = np.r_[-1, goals][graph.cluster]
        home = (
            self._vertex(roadmap, graph, place == start, context.start_tether.nodes)
            if starts_elsewhere
            else 0
        )
        begin = None
        if places.present is not None:
            begin = self._vertex(
                roadmap, graph, place == places.present, context.present_tether.nodes
            )
        if home is None or (places.present is not None and begin is None):
            return None
        robot_problem = self._problem(points[goals], share, touches=False)
        legs = ClearanceLegs(graph, robot_problem, missing_cost=math.inf, clock=clock)
        while True:
            known = TravelGraph.from_costs(legs.costs, graph.cluster)
            found = _solve_tour(known, place, self.places, home, begin, clock, seed)
            if found is None:
                return None
            tour, is_optimal = found
            ends = [home if begin is None else begin, *tour, home]
            if not touches or not legs.raise_along(ends):
                break
        paths = [legs.path(u, v) for u, v in pairwise(ends)]
        to_waypoints = [
            LegTo(int(places.waypoint[place[v]]), int(places.choice[place[v]]), path)
            for v, path in zip(tour, paths, strict=False)
        ]
        return _PlaneLegs(to_waypoints, paths[-1], is_optimal and roadmap.complete)

    @property
    def _is_whole(self) -> bool:
        """Return whether the mission begins at its start, and no waypoint has alternatives."""
        return self.places.present is None and not self.places.choice.any()

    def _searched_legs(
        self, goals: Ints, share: float, clock: Clock, seed: int
    ) -> _PlaneLegs | None:
        """Return the legs of the best tour of `netsp.plan.solve_problem.solve`, which needs no list
        of all classes.

        The problem begins at the start of the mission. Its tether is shorter by the tether that is
        laid from the anchor to the start, so a tether that it allows is within its share.
        """
        context, points = self.context, self.places.points[goals]
        laid = float(polylines.length(context.start_tether.nodes))
        tether_problem, robot_problem = (
            problem.model_copy(
                update={
                    "base": context.mission.start,
                    "tether_length": problem.tether_length - laid,
                }
            )
            for problem in (self._problem(points, share, t) for t in (True, False))
        )
        if not tether_problem.tether_length > 0.0:
            return None
        solution = solve(tether_problem, time_limit=clock, seed=seed)
        if not solution.tour:
            return None
        paths = TautPaths(robot_problem)
        ends = [(0, ()), *((visit.goal + 1, visit.signature) for visit in solution.tour), (0, ())]
        legs = [
            paths.path(a, b, concatenate(invert(before), after))
            for (a, before), (b, after) in pairwise(ends)
        ]
        to_waypoints = [
            LegTo(int(self.places.waypoint[goals[goal - 1]]), 0, path)
            for (goal, _), path in zip(ends[1:], legs[:-1], strict=False)
        ]
        return _PlaneLegs(to_waypoints, legs[-1], solution.status is Status.OPTIMAL)

    def _problem(self, goals: Floats, share: float, touches: bool) -> Problem:
        """Return the problem of the plane through some goals, without the robot's clearance if
        paths touch the prisms."""
        mission, (obstacles, growth) = (
            self.context.mission,
            self.plan.obstacles(self.policy.corner_segments),
        )
        room = float(self.context.field.distance(np.vstack([goals, mission.anchor])).min())
        bounds = self.scene.bounds
        clearance = max(0.0, min(mission.clearance, (1.0 - UPRIGHT_TOLERANCE) * room))
        return Problem(
            base=mission.anchor,
            obstacles=obstacles,
            goals=tuple(Goal(position=(x, y, z)) for x, y, z in goals.tolist()),
            tether_length=share * mission.tether_length,
            clearance=growth + (0.0 if touches else clearance),
            bounds=None if bounds is None else (bounds[0], bounds[1], bounds[3], bounds[4]),
        )

    def _goals_in_reach(self, problem: Problem) -> Ints:
        """Return the indices of the goals that the tether reaches in some class."""
        return np.flatnonzero(shortest_tethers(problem) <= problem.tether_length)

    def _vertex(
        self, roadmap: TautRoadmap, graph: TravelGraph, is_at_place: Floats, line: Floats
    ) -> int | None:
        """Return the vertex of a place whose tether lies in the class of a line."""
        word = signature(line, roadmap.problem.representative_points)
        matching = [v for v in np.flatnonzero(is_at_place).tolist() if graph.signatures[v] == word]
        return matching[0] if matching else None


def _solve_tour(
    graph: TravelGraph,
    place: Ints,
    places: Places,
    home: int,
    begin: int | None,
    clock: Clock,
    seed: int,
) -> tuple[list[int], bool] | None:
    """Return the vertices of the shortest tour that ends at `home` and begins at `begin`, or at
    `home` if `begin` is None, and whether it is proven to be the shortest."""
    count = len(places)
    if home == 0 and begin is None and not places.choice.any():
        result = solve_graph(graph, "auto", time_limit=clock, seed=seed)
        if result.tour is None:
            return None
        return list(result.tour[1:]), result.status is Status.OPTIMAL
    others = [
        v
        for v in range(1, len(graph))
        if 0 <= place[v] < count and (place[v] != places.present or v == begin)
    ]
    rows = np.array([home, *others])
    waypoint = places.waypoint[place[others]]
    cluster = np.r_[0, 1 + np.unique(waypoint, return_inverse=True)[1]]
    part = TravelGraph.from_costs(graph.costs_among(rows), cluster)
    first = 1
    if begin is not None:
        part, first = from_state(part, 1 + others.index(begin)), 2
    result = solve_graph(part, "auto", time_limit=clock, seed=seed)
    if result.tour is None:
        return None
    return [int(rows[v]) for v in result.tour[first:]], result.status is Status.OPTIMAL

"""NE-TSP in space: the shortest tour through a mission's waypoints that the tether allows.

Vertices of the travel graph are states (`netsp.plan.space.states`): a waypoint with a tether that
reaches it. Legs are paths along which the tether model was driven (`netsp.plan.space.space_legs`).
Any two states are also joined by the path back along one tether and out along the other. The graph
is solved like any other, and the whole tour is driven. If the tether exceeds its limit, or
is not free at the end, the first leg that did not arrive in its state is forbidden, and the graph
is solved again: no tour is accepted that was not driven without fault.

Status and bound of the result hold for tours along these states and legs, without the forbidden
ones, and not for all tours: the shortest tour along them is `optimal_of_states`. It is `optimal`
only if a bound on all tours (`netsp.plan.space.path_bound`) proves it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock, TimeLimit
from netsp.base.deprecated import deprecated_method
from netsp.base.errors import InputError, LimitReachedError
from netsp.base.interrupt_signals import until_interrupt
from netsp.gtsp.travel.result import Result, relative_gap
from netsp.model.solution import Status
from netsp.plan.solve_problem import SolverLike, solve_graph
from netsp.plan.solver_table import SOLVERS
from netsp.plan.space.board import DrivenTour, TourVisit
from netsp.plan.space.given_order import drive_given_order
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_policy import MissionPolicy
from netsp.plan.space.passages import find_gaps_on, resolve_gaps
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.prisms import drive_plane_tours
from netsp.plan.space.short_orders import short_order_tour
from netsp.plan.space.space_legs import RobotPaths
from netsp.plan.space.spoke_tours import Spokes, drive_spoke_orders
from netsp.plan.space.state_search import SearchRun, StateSearch
from netsp.roadmap.travel_graph import TravelGraph
from netsp.world.mission.mission import Mission
from netsp.world.mission.mission_limits import check_bounds, check_size, check_tether
from netsp.world.mission.planned_tour import PlannedTour, PlannedVisit, status_of_tour, thinned_path
from netsp.world.paths.tree import Grid
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene
from netsp.world.simulator.mission_run import mission_grid

TAUT_LEGS = "taut"
"""Kind of a plan along states and their taut legs."""

TAUT_SO_FAR = "taut so far"
"""Kind of a plan along states and their taut legs, while the search for shorter ones goes on."""

DETOURS = "detours"
"""Kind of a plan along states and legs with detours."""

PLANE = "plane"
"""Kind of a plan from the tour of the plane, in a scene of upright prisms."""

SHORT_ORDER = "short-order"
"""Kind of a plan in an order that is short by estimated distances."""

OUT_AND_BACK = "out-and-back"
"""Kind of a plan that goes out to each waypoint along a taut tether, and back the same way."""

AS_GIVEN = "as-given"
"""Kind of a plan in the order of the mission file."""


@dataclass(frozen=True)
class SpacePlan:
    """Tour of a mission's waypoints.

    Attributes
    ----------
    mission
        Mission that was planned.
    visits
        Visits in the order of the tour.
    home
        (k, 3) path from the last visit to the start, metres.
    length
        Length of the tour, metres.
    result
        Result of the solver; its status, bound and gap hold for the states and legs found.
    states, legs
        Numbers of states and of driven legs to choose from.
    unreached
        Waypoints to which no tether within the limit was found.
    free
        Whether the tether was as at the start when the whole tour was driven.
    context
        Context of the mission.
    paths
        The robot's paths between waypoints.
    kind
        Kind of the plan: `TAUT_LEGS`, `TAUT_SO_FAR`, `DETOURS`, `PLANE`, `SHORT_ORDER`,
        `OUT_AND_BACK` or `AS_GIVEN`.
    """

    mission: Mission
    visits: tuple[TourVisit, ...]
    home: Floats
    length: float
    result: Result
    states: int
    legs: int
    unreached: tuple[int, ...]
    free: bool
    context: PlanningContext
    paths: RobotPaths
    kind: str = TAUT_LEGS

    @property
    def order(self) -> tuple[int, ...]:
        """Return the numbers of the visited waypoints in the order of the tour."""
        return tuple(visit.waypoint for visit in self.visits)

    @property
    def all_waypoints(self) -> tuple[int, ...]:
        """Return the numbers of all waypoints: those of `order`, then the ones that no
        tether reaches."""
        unvisited = set(range(len(self.mission.waypoints))) - set(self.order)
        return (*self.order, *sorted(unvisited))

    planned = deprecated_method("planned", "to_mission")
    every_waypoint = deprecated_method("every_waypoint", "all_waypoints")
    stops = deprecated_method("stops", "visits")
    water = deprecated_method("water", "context")
    ways = deprecated_method("ways", "paths")

    def replaces(self, other: SpacePlan) -> bool:
        """Return whether this plan is better than another that has passed the judge.

        It is if it visits more waypoints, or as many and is shorter. A tour along states and legs
        may be longer than a tour of the plane by `bound_worth` of the policy.
        """
        if len(self.visits) != len(other.visits):
            return len(self.visits) > len(other.visits)
        has_bound = self.kind == TAUT_LEGS and other.kind == PLANE
        return self.length < other.length * (
            1.0 + (self.context.policy.bound_worth if has_bound else 0.0)
        )

    def to_mission(self, solver: str = "auto", seed: int = 0) -> Mission:
        """Return the mission with the tour, and its waypoints in the order of the tour; waypoints
        that no tether reaches come last.

        Parameters
        ----------
        solver : str
            Name of the solver that was used.
        seed : int
            Its random seed.
        """
        result = self.result
        tour = PlannedTour(
            stops=tuple(
                PlannedVisit(
                    path=thinned_path(visit.path),
                    signature=visit.word,
                    tether_length=visit.tether_length,
                    longest_tether=visit.longest_tether,
                    given_as=visit.waypoint,
                )
                for visit in self.visits
            ),
            home=thinned_path(self.home),
            status=status_of_tour(
                self.length, result.lower_bound, None, is_complete=not self.unreached
            ),
            solver=solver if self.kind in (TAUT_LEGS, TAUT_SO_FAR, DETOURS) else self.kind,
            seed=seed,
            length=self.length,
            lower_bound=result.lower_bound,
            gap=relative_gap(self.length, result.lower_bound),
            states=self.states,
            legs=self.legs,
            exact=self.context.words.exact if self.context.has_words else None,
            unresolved_gaps=self.context.unresolved_gaps,
        )
        given_waypoints = self.mission.waypoints
        waypoints = (
            *(given_waypoints[visit.waypoint].at(visit.choice) for visit in self.visits),
            *(given_waypoints[n] for n in self.all_waypoints[len(self.visits) :]),
        )
        return self.mission.model_copy(update={"waypoints": waypoints, "tour": tour})


def plan(
    mission: Mission,
    *,
    scene: Scene | None = None,
    field: DistanceField | None = None,
    grid: Grid | None = None,
    solver: SolverLike = "auto",
    params: Mapping[str, Any] | None = None,
    time_limit: TimeLimit = 60.0,
    iteration_limit: int | None = None,
    seed: int = 0,
    on_progress: Callable[[str], None] | None = None,
    policy: MissionPolicy | None = None,
) -> SpacePlan:
    """Find the shortest tour of a mission's waypoints that leaves the tether free.

    The tour begins at the mission's state, and visits one alternative of each waypoint.

    Parameters
    ----------
    mission : Mission
        The mission; the order of its waypoints is ignored.
    scene, field, grid : Scene, DistanceField, Grid, optional
        Scene of the mission, its distance field, and the grid for paths; loaded or computed if
        needed. With field and grid, the scene is not needed.
    solver, params, iteration_limit, seed
        As in `netsp.plan.solve_problem.solve_graph`.
    time_limit : float or Clock, optional
        Seconds for all stages; the best tour so far is returned when they are up.
    on_progress : callable, optional
        Called with a line of text at each stage.
    policy : MissionPolicy, optional
        Effort, time and limits.

    Returns
    -------
    SpacePlan
        The tour. At Ctrl-C, the best so far.

    Raises
    ------
    InputError
        A moving anchor; waypoints in solids; no tether that reaches any of them; or as
        `netsp.plan.space.space_signature.SpaceSignature.in_box`.
    LimitReachedError
        No tour was found whose tether stays within its limit, or the time was up before the words
        of the scene were found.
    """
    accepted: SpacePlan | None = None
    with until_interrupt(time_limit) as clock:
        for found in candidate_plans(
            mission,
            scene=scene,
            field=field,
            grid=grid,
            solver=solver,
            params=params,
            clock=clock,
            iteration_limit=iteration_limit,
            seed=seed,
            on_progress=on_progress,
            policy=policy,
        ):
            if accepted is None or found.replaces(accepted):
                verdict = verify_mission(found.to_mission(), scene=scene, context=found.context)
                accepted = found if verdict else accepted
            if accepted is not None and found.kind == TAUT_LEGS:
                break
        if accepted is None:
            raise LimitReachedError(
                "waypoints: no tour was found whose tether stays within the limit all along"
            )
        return accepted


def candidate_plans(
    mission: Mission,
    *,
    scene: Scene | None = None,
    field: DistanceField | None = None,
    grid: Grid | None = None,
    context: PlanningContext | None = None,
    solver: SolverLike = "auto",
    params: Mapping[str, Any] | None = None,
    clock: Clock,
    iteration_limit: int | None = None,
    seed: int = 0,
    whole_tether: bool = False,
    on_progress: Callable[[str], None] | None = None,
    policy: MissionPolicy | None = None,
) -> Iterator[SpacePlan]:
    """Find candidate tours of a mission's waypoints, which the judge has not checked yet.

    Parameters
    ----------
    mission : Mission
        The mission; the order of its waypoints is ignored.
    scene, field, grid : Scene, DistanceField, Grid, optional
        Scene of the mission, its distance field, and the grid for paths; loaded or computed if
        needed.
    context : PlanningContext, optional
        Context of the mission; if given, `field`, `grid` and `policy` are not used.
    solver, params, iteration_limit, seed
        As in `netsp.plan.solve_problem.solve_graph`.
    clock : Clock
        Clock of the run; when it is up, the best tours so far are yielded.
    whole_tether : bool
        Whether tours of the plane may need the whole tether, for a caller that flies them.
    on_progress : callable, optional
        Called with a line of text at each stage.
    policy : MissionPolicy, optional
        Effort, time and limits.

    Yields
    ------
    SpacePlan
        First, among upright prisms, the tours of the plane, or if there are none, the tour in a
        short order; then ever shorter tours along taut legs; then the tour with detours, if it is
        shorter than the tour along taut legs; then the tour along taut legs; last the tour out and
        back to each waypoint, which is computed only if the caller asks for it.

    Raises
    ------
    InputError
        A moving anchor; waypoints in solids; no tether that reaches any waypoint.
    """
    check_plannable(mission, solver, params, seed)
    if context is None:
        if field is None or grid is None:
            scene = scene or mission.load_scene()
        context = prepare_context(
            mission,
            clock,
            scene=scene,
            field=field,
            grid=grid,
            on_progress=on_progress,
            policy=policy,
        )
    options = {"solver": solver, "seed": seed, "params": params, "iteration_limit": iteration_limit}
    stages = StagedSearch(context, scene, on_progress or _silent, options, whole_tether)
    yield from stages.in_plane(clock)
    yield from stages.in_short_order(clock)
    yield from stages.along_states(clock)


def prepare_without_words(
    mission: Mission,
    clock: Clock,
    *,
    scene: Scene,
    field: DistanceField | None = None,
    policy: MissionPolicy | None = None,
) -> PlanningContext:
    """Return the context for planning a mission on its default grid, whose words are not known yet.

    Parameters
    ----------
    clock : Clock
        Clock of the run.
    scene : Scene
        Scene of the mission.
    field : DistanceField, optional
        Distance field of the scene; computed if needed.
    policy : MissionPolicy, optional
        Effort, time and limits.

    Raises
    ------
    InputError
        Waypoints in solids, a mission too large, or bounds that do not hold it.
    LimitReachedError
        The time was up before; says which work was broken off.
    """
    check_size(mission)
    check_bounds(mission, scene)
    field = field or clock.bounded("measuring distances in the scene", scene.field)
    mission = mission.checked_waypoints(field)
    Places.for_mission(mission, field)  # refuse bad waypoints
    grid = clock.bounded("measuring the cells", partial(mission_grid, mission, scene, field))
    return PlanningContext.without_words(mission, field, grid, scene.bounds, policy)


def prepare_context(
    mission: Mission,
    clock: Clock,
    *,
    scene: Scene | None = None,
    field: DistanceField | None = None,
    grid: Grid | None = None,
    on_progress: Callable[[str], None] | None = None,
    policy: MissionPolicy | None = None,
) -> PlanningContext:
    """Return the context for planning a mission.

    This checks the mission, finds the gaps that its grid does not show, refines the grid to show
    them, and finds the words of the scene.

    Parameters
    ----------
    clock : Clock
        Clock of the run; the search for gaps takes a share of it (`GapPolicy`).
    scene : Scene, optional
        Scene of the mission; needed unless `field` and `grid` are given.
    field : DistanceField, optional
        Distance field of the scene; computed if needed.
    grid : Grid, optional
        Grid for paths. If both `field` and `grid` are given, the grid is kept and its gaps are only
        named.
    on_progress : callable, optional
        Called with a line of text at each stage.
    policy : MissionPolicy, optional
        Effort, time and limits.

    Returns
    -------
    PlanningContext
        The context, with `gaps`. Its mission has the cell size of the grid.

    Raises
    ------
    InputError
        Waypoints in solids, a mission too large, or bounds that do not hold it.
    LimitReachedError
        The time was up before; says which work was broken off.
    """
    on_progress, policy = on_progress or _silent, policy or MissionPolicy()
    check_size(mission)
    if field is None or grid is None:
        scene = scene or clock.bounded("reading the scene", mission.load_scene)
        check_bounds(mission, scene)
        field = field or clock.bounded("measuring distances in the scene", scene.field)
        grid = None
    mission = mission.checked_waypoints(field)
    on_progress("gaps that the cells do not show")
    if grid is None:
        assert scene is not None
        find_gaps = partial(resolve_gaps, mission, scene, field)
    else:
        find_gaps = partial(find_gaps_on, mission, grid)
    effort = (policy.gaps, clock, policy.words.min_room_ratio)
    gaps = clock.bounded(
        "searching for gaps that the cells do not show", lambda: find_gaps(*effort)
    )
    mission = gaps.mission
    Places.for_mission(mission, field)  # refuse bad waypoints before the long search for words
    if grid is None:
        assert scene is not None
        grid = clock.bounded("measuring the cells", partial(mission_grid, mission, scene, field))
    on_progress("words of the scene")
    bounds = None if scene is None else scene.bounds
    context = clock.bounded(
        "finding the words of the scene",
        partial(PlanningContext.on_grid, mission, field, grid, bounds, policy),
    )
    return replace(context, gaps=gaps)


def plan_given_order(context: PlanningContext) -> SpacePlan | None:
    """Drive a mission in the order of its file: the first incumbent.

    Returns
    -------
    SpacePlan or None
        The plan, without known paths between waypoints; None if that order cannot be driven.
    """
    driven = drive_given_order(context)
    if driven is None:
        return None
    return _to_plan(context, Places.for_mission(context.mission, context.field), driven, AS_GIVEN)


def _to_plan(context: PlanningContext, places: Places, driven: DrivenTour, kind: str) -> SpacePlan:
    """Return a tour that was found without states and legs as a plan, without known paths between
    waypoints."""
    visited = {visit.waypoint for visit in driven.visits}
    unreached = tuple(n for n in range(len(context.mission.waypoints)) if n not in visited)
    return SpacePlan(
        context.mission,
        tuple(driven.visits),
        driven.home,
        driven.length,
        Result(None, driven.length, None, Status.FEASIBLE),
        len(driven.visits),
        len(driven.visits) + 1,
        unreached,
        driven.free,
        context,
        RobotPaths(context, places, context.policy.states.effort(len(places))),
        kind,
    )


def check_plannable(
    mission: Mission, solver: SolverLike, params: Mapping[str, Any] | None, seed: int
) -> None:
    """Refuse a moving anchor, and an unknown solver or option, before the search begins."""
    if mission.track:
        raise InputError("track: a moving anchor has no one best order; expected a mission without")
    _try_out(solver, params, seed)


def _silent(_: str) -> None:
    """Ignore a line of progress."""


@dataclass
class StagedSearch:
    """Candidate tours of a mission, in the stages in which `solve_mission` asks for them.

    Attributes
    ----------
    context
        Context of the mission.
    scene
        Scene of the mission; None if it is not known.
    on_progress
        Called with a line of text at each stage.
    options
        Options of `netsp.plan.solve_problem.solve_graph`.
    whole_tether
        Whether tours of the plane may need the whole tether, for a caller that flies them.
    is_in_plane
        Whether a tour of the plane was found.
    plane_optimum
        Length of the shortest tour of the plane, if it is proven, metres.
    """

    context: PlanningContext
    scene: Scene | None
    on_progress: Callable[[str], None]
    options: dict[str, Any]
    whole_tether: bool = True
    is_in_plane: bool = False
    plane_optimum: float | None = None
    _search: StateSearch | None = field(default=None, init=False)

    @cached_property
    def places(self) -> Places:
        """Return the places of the mission."""
        return Places.for_mission(self.context.mission, self.context.field)

    @cached_property
    def spokes(self) -> Spokes:
        """Return the spokes of the places."""
        return Spokes(self.context, self.places)

    @property
    def seed(self) -> int:
        """Return the random seed."""
        return int(self.options["seed"])

    def spokes_as_given(self) -> SpacePlan | None:
        """Return the tour in the order of the file along spokes; None if there is none."""
        order = np.flatnonzero((self.places.choice == 0) & self.places.is_waypoint)
        driven = self.spokes.drive(order.tolist())
        return None if driven is None else self._to_plan(driven, AS_GIVEN)

    def in_plane(self, clock: Clock) -> Iterator[SpacePlan]:
        """Yield the tours of the plane, among upright prisms."""
        if self.scene is None:
            return
        policy = self.context.policy.plane
        for driven in drive_plane_tours(
            self.context,
            self.scene,
            self.places,
            clock.part(policy.time_share),
            self.seed,
            policy,
            self.whole_tether,
        ):
            self.is_in_plane = True
            self.plane_optimum = driven.length if driven.is_plane_optimum else None
            yield self._to_plan(driven, PLANE)

    def along_spokes(self, clock: Clock) -> Iterator[SpacePlan]:
        """Yield tours in short orders along spokes."""
        self.on_progress("short orders along spokes")
        policy = self.context.policy.orders
        for driven in drive_spoke_orders(self.spokes, clock, self.seed, policy):
            yield self._to_plan(driven, SHORT_ORDER)

    def without_words(self, clock: Clock) -> Iterator[SpacePlan]:
        """Yield tours that need no words: short orders along spokes, and the tours of the plane.

        Parameters
        ----------
        clock : Clock
            Clock of the run, of which both plan with a time that does not depend on its limit.
        """
        policy = self.context.policy
        yield from self.along_spokes(clock.paced(policy.round_s))
        yield from self.in_plane(
            clock.paced(2.0 * policy.plane.max_s / max(policy.plane.time_share, 1e-9))
        )

    def in_short_order(self, clock: Clock) -> Iterator[SpacePlan]:
        """Yield the tour in a short order that `predictive` drives, unless there is a tour of the
        plane."""
        if self.is_in_plane:
            return
        self.on_progress("short orders")
        short = short_order_tour(self.context, self.places, clock, self.seed)
        if short is not None and short.visits:
            yield self._to_plan(short, SHORT_ORDER)

    def along_states(self, clock: Clock) -> Iterator[SpacePlan]:
        """Yield the tour with detours, if it is shorter, the tour along taut legs, and the tour out
        and back."""
        check_tether(self.context.mission, self.context.present_tether.length)
        run = SearchRun(self.context, self.places, clock, self.on_progress, self.options)
        if self._search is None:
            self._search = StateSearch(run)
        else:
            self._search.resume(run)
        yield from _candidates(self._search)

    def with_words(self, clock: Clock, is_first: bool) -> Iterator[SpacePlan]:
        """Yield the tours of a round: in the first round the short order, too."""
        if is_first:
            yield from self.in_short_order(clock)
        yield from self.along_states(clock)

    def _to_plan(self, driven: DrivenTour, kind: str) -> SpacePlan:
        """Return a driven tour as a plan."""
        return _to_plan(self.context, self.places, driven, kind)


def _plan_of_search(
    search: StateSearch, result: Result | None, driven: DrivenTour, kind: str
) -> SpacePlan:
    """Return a tour of a search as a plan; without a result, nothing is known of other tours."""
    run = search.run
    visited = {visit.waypoint for visit in driven.visits}
    return SpacePlan(
        run.mission,
        tuple(driven.visits),
        driven.home,
        driven.length,
        result or Result(None, driven.length, None, Status.FEASIBLE),
        len(search.states.entries),
        len(search.board.legs),
        tuple(n for n in range(len(run.mission.waypoints)) if n not in visited),
        driven.free,
        run.context,
        search.paths,
        kind,
    )


def _candidates(search: StateSearch) -> Iterator[SpacePlan]:
    """Yield the candidates along states and legs: ever shorter tours along taut legs, and those
    that `candidate_plans` names after them."""
    run, mission = search.run, search.run.mission
    search.connect()
    for found in search.tours_along_taut_legs():
        yield _plan_of_search(search, *found, TAUT_SO_FAR)
    best, is_complete = search.best, search.is_complete
    if not search.board.reached_waypoints:
        raise InputError(
            f"waypoints: the robot reaches none of them with its clearance of {mission.clearance:g}"
        )
    is_proven = best is not None and best[0].status is Status.OPTIMAL_OF_STATES and is_complete
    shorter = search.shorter(best and best[1], is_proven)
    along_taut = None
    if best is not None:
        along_taut = _plan_of_search(search, *best, TAUT_LEGS)
    if shorter is not None:
        # the solver's bound does not hold for the detours, which are not in its graph
        yield _plan_of_search(search, None, shorter, DETOURS)
    if along_taut is not None:
        yield along_taut
    run.on_progress("out along the tether and back")
    fallback = search.board.drive_out_and_back()
    if fallback is not None:
        yield _plan_of_search(search, None, fallback, OUT_AND_BACK)


def _try_out(solver: SolverLike, params: Mapping[str, Any] | None, seed: int) -> None:
    """Solve a tiny graph, so that a wrong solver or option is refused at once."""
    if isinstance(solver, str) and SOLVERS.named(solver).geometric:
        raise InputError(
            f"solver: {solver!r} needs the geometry of a problem in the plane; expected one that "
            "takes any travel graph, as auto, mip, dp, lns, anneal or greedy"
        )
    costs = np.ones((3, 3)) - np.eye(3)
    solve_graph(
        TravelGraph.from_costs(costs, [0, 1, 2]),
        solver,
        params=params,
        seed=seed,
        iteration_limit=1,
    )

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
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock, TimeLimit
from netsp.base.deprecated import deprecated_method
from netsp.base.errors import InputError, LimitReachedError, counted
from netsp.base.interrupt_signals import until_interrupt
from netsp.gtsp.travel.result import Result, relative_gap
from netsp.model.bound_scope import LowerBound, Scope
from netsp.model.solution import Status
from netsp.plan.solve_problem import SolverLike, solve_graph
from netsp.plan.solver_table import SOLVERS
from netsp.plan.space.board import DrivenTour, StateGraph, TourVisit, with_status
from netsp.plan.space.given_order import drive_given_order
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_policy import MissionPolicy, StageTimePolicy
from netsp.plan.space.non_taut_moves import Detours
from netsp.plan.space.passages import find_gaps_on, resolve_gaps
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.prisms import drive_plane_tours
from netsp.plan.space.short_orders import short_order_tour
from netsp.plan.space.space_legs import RobotPaths, StateGrowth
from netsp.plan.space.states import States, add_states_with_room, find_first_states
from netsp.plan.space.trees import add_states_of_trees
from netsp.roadmap.travel_graph import TravelGraph
from netsp.world.mission.mission import Mission
from netsp.world.mission.mission_limits import check_bounds, check_size, check_tether
from netsp.world.mission.planned_tour import PlannedTour, PlannedVisit, thinned_path
from netsp.world.paths.tree import Grid
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene
from netsp.world.simulator.mission_run import mission_grid

LENGTH_ROUNDING = 1e-9
"""Tolerance for the rounding of lengths, relative."""

TAUT_LEGS = "taut"
"""Kind of a plan along states and their taut legs."""

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
        Kind of the plan: `TAUT_LEGS`, `DETOURS`, `PLANE`, `SHORT_ORDER`, `OUT_AND_BACK` or
        `AS_GIVEN`.
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

    def _status(self, bound: float | None) -> Status:
        """Return the status of the tour: `optimal` if a bound on all tours to all waypoints proves
        it, else that of the tour along states and legs."""
        if bound is None or self.unreached:
            return self.result.status
        proven = LowerBound(bound, Scope.ALL_TOURS).proves(self.length)
        return Status.OPTIMAL if proven else self.result.status

    def to_mission(
        self, solver: str = "auto", seed: int = 0, bound: float | None = None
    ) -> Mission:
        """Return the mission with the tour, and its waypoints in the order of the tour; waypoints
        that no tether reaches come last.

        Parameters
        ----------
        solver : str
            Name of the solver that was used.
        seed : int
            Its random seed.
        bound : float, optional
            Bound on all tours (`netsp.plan.space.path_bound`), metres.
        """
        result = self.result
        if bound is not None:
            # legs of the bound are pulled taut more finely than those of the tour
            bound = min(bound, self.length)
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
            status=self._status(bound),
            solver=solver if self.kind in (TAUT_LEGS, DETOURS) else self.kind,
            seed=seed,
            length=self.length,
            lower_bound=result.lower_bound,
            gap=relative_gap(self.length, result.lower_bound),
            bound_of_all=bound,
            gap_to_all=relative_gap(self.length, bound),
            states=self.states,
            legs=self.legs,
            exact=self.context.words.exact,
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
        short order; then the tour with detours, if it is shorter than the tour along taut legs;
        then the tour along taut legs; last the tour out and back to each waypoint, which is
        computed only if the caller asks for it.

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
    places = Places.for_mission(context.mission, context.field)
    options = {"solver": solver, "seed": seed, "params": params, "iteration_limit": iteration_limit}
    run = _Run(context, places, clock, on_progress or _silent, options)
    yield from _candidates(run, scene, whole_tether)


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


@dataclass(frozen=True)
class _Run:
    """Run of a search for candidate plans.

    Attributes
    ----------
    context, places
        Context of the mission, and its places.
    clock
        Clock of the run.
    on_progress
        Called with a line of text at each stage.
    options
        Options of `netsp.plan.solve_problem.solve_graph`.
    """

    context: PlanningContext
    places: Places
    clock: Clock
    on_progress: Callable[[str], None]
    options: dict[str, Any]

    @property
    def mission(self) -> Mission:
        """Return the mission."""
        return self.context.mission

    @property
    def times(self) -> StageTimePolicy:
        """Return the division of the time."""
        return self.context.policy.times

    @property
    def seed(self) -> int:
        """Return the random seed."""
        return int(self.options["seed"])


def _plans_without_states(
    run: _Run, scene: Scene | None, whole_tether: bool
) -> Iterator[SpacePlan]:
    """Yield the tours of the plane, or if there are none, the tour in a short order."""
    context, places = run.context, run.places
    in_plane = False
    if scene is not None:
        policy = context.policy.plane
        part = run.clock.part(policy.time_share)
        for driven in drive_plane_tours(
            context, scene, places, part, run.seed, policy, whole_tether
        ):
            in_plane = True
            yield _to_plan(context, places, driven, PLANE)
    if not in_plane:
        run.on_progress("short orders")
        short = short_order_tour(context, places, run.clock, run.seed)
        if short is not None and short.visits:
            yield _to_plan(context, places, short, SHORT_ORDER)


def _find_states(run: _Run) -> States:
    """Return the first states, or raise InputError if no tether reaches any waypoint."""
    context, mission, share = run.context, run.mission, run.context.policy.tether_share
    # a robot that is farther out than the share may still come back
    present = context.present_tether.length * (1.0 + LENGTH_ROUNDING)
    limit = max(share * mission.tether_length, present)
    run.on_progress("shortest tethers to each waypoint")
    effort = context.policy.states.effort(len(run.places))
    part = run.clock.part(run.times.first_states_share)
    states = find_first_states(context, run.places, limit, effort, part)
    if states.reached - {len(mission.waypoints)}:
        return states
    nearest = float(np.linalg.norm(mission.places - np.array(mission.anchor), axis=1).min())
    if nearest <= limit:
        raise InputError(
            f"waypoints: no path through the water brings any of them within {limit:.4g} m of "
            f"tether, though the nearest is {nearest:.4g} m from the anchor as the crow flies: "
            f"walls, or gaps narrower than a cell ({context.words.cells.cell:.3g} m)"
        )
    raise InputError(
        f"waypoints: no tether within the limit reaches any of them: {limit:.4g} m "
        f"({100 * share:g} % of tether_length), and the nearest is {nearest:.4g} "
        "m from the anchor as the crow flies"
    )


class _StateSearch:
    """Search for tours along states and legs.

    Parameters
    ----------
    run : _Run
        The run.
    states : States
        First states; more are added.
    """

    def __init__(self, run: _Run, states: States) -> None:
        self.run, self.states = run, states
        self.effort = run.context.policy.states.effort(len(run.places))
        tethers = {
            n: [states.entries[s].tether.nodes for s in numbers]
            for n, numbers in states.at_place.items()
        }
        self.paths = RobotPaths(run.context, run.places, self.effort, tethers)
        self.board = StateGraph(run.context, states)
        self.growth = StateGrowth(states, self.paths)

    def connect(self) -> None:
        """Find the robot's paths, and legs between the first states and those along trees."""
        run, times, board = self.run, self.run.times, self.board
        clock, on_progress = run.clock, run.on_progress
        self.paths.find_all(clock, on_progress)
        on_progress("trees of legs")
        add_states_of_trees(self.states, self.paths, clock.part(times.tree_share))
        board.update(self.growth.legs, clock.part(times.home_path_share))
        if missing := set(range(len(run.mission.waypoints))) - board.reached_waypoints:
            on_progress("paths with room for the robot")
            part = clock.part(times.first_states_share)
            add_states_with_room(self.states, missing, self.effort.words, part)
            board.update(self.growth.legs, clock.part(times.home_path_share))
        self.growth.grow(0, clock.part(times.tree_share), on_progress)

    def best_along_taut_legs(self) -> tuple[tuple[Result, DrivenTour] | None, bool]:
        """Grow states and legs in stages, and return the best tour along them, and whether all legs
        were driven in some stage."""
        run, times, board = self.run, self.run.times, self.board
        on_progress, options = run.on_progress, run.options
        clock = run.clock.part(times.taut_share)
        best: tuple[Result, DrivenTour] | None = None
        is_complete = False
        for max_per_place in self.effort.states:
            begin = clock.elapsed
            share_suffices = board.legs or times.growth_share * clock.left >= times.min_growth_s
            growing = (
                clock.part(times.growth_share) if share_suffices else Clock(times.min_growth_s)
            )
            has_grown = self.growth.grow(max_per_place, growing, on_progress)
            on_progress("paths by way of the anchor")
            has_homes = board.update(self.growth.legs, clock.part(times.home_path_share))
            is_complete = (has_homes and has_grown) or is_complete
            is_last = max_per_place == self.effort.states[-1]
            share = times.solve_share if is_last else times.early_solve_share
            best = _better(best, _best_driven(board, clock, on_progress, best, share, options))
            if clock.left < clock.elapsed - begin:
                if not is_last and not (best is not None and best[0].status is Status.OPTIMAL):
                    share = times.solve_share
                    found = _best_driven(board, clock, on_progress, best, share, options)
                    best = _better(best, found)
                break
        return best, is_complete

    def shorter(self, best: DrivenTour | None, is_proven: bool) -> DrivenTour | None:
        """Return a shorter tour with detours, if there is one.

        If words distinguish all states, detours lead to the tethers that straight legs lead to.
        """
        if is_proven and not self.states.has_free_ends:
            return None
        run = self.run
        return Detours(self.board, self.paths).shorten(best, run.clock, run.on_progress, run.seed)

    def to_plan(self, result: Result | None, driven: DrivenTour, kind: str) -> SpacePlan:
        """Return a tour as a plan; without a result, nothing is known of other tours."""
        n_waypoints = len(self.run.mission.waypoints)
        visited = {visit.waypoint for visit in driven.visits}
        return SpacePlan(
            self.run.mission,
            tuple(driven.visits),
            driven.home,
            driven.length,
            result or Result(None, driven.length, None, Status.FEASIBLE),
            len(self.states.entries),
            len(self.board.legs),
            tuple(n for n in range(n_waypoints) if n not in visited),
            driven.free,
            self.run.context,
            self.paths,
            kind,
        )


def _candidates(run: _Run, scene: Scene | None, whole_tether: bool) -> Iterator[SpacePlan]:
    """Yield the candidates of `candidate_plans`."""
    mission = run.mission
    check_tether(mission, run.context.present_tether.length)
    yield from _plans_without_states(run, scene, whole_tether)
    search = _StateSearch(run, _find_states(run))
    search.connect()
    best, is_complete = search.best_along_taut_legs()
    if not search.board.reached_waypoints:
        raise InputError(
            f"waypoints: the robot reaches none of them with its clearance of {mission.clearance:g}"
        )
    is_proven = best is not None and best[0].status is Status.OPTIMAL and is_complete
    shorter = search.shorter(best and best[1], is_proven)
    along_taut = None
    if best is not None:
        result, driven = best
        if result.status is Status.OPTIMAL:
            # optimal over the graph only; an incomplete graph lacks legs within reach
            of_states = Status.OPTIMAL_OF_STATES if is_complete else Status.FEASIBLE
            result = replace(result, status=of_states)
        along_taut = search.to_plan(result, driven, TAUT_LEGS)
    if shorter is not None:
        # the solver's bound does not hold for the detours, which are not in its graph
        yield search.to_plan(None, shorter, DETOURS)
    if along_taut is not None:
        yield along_taut
    run.on_progress("out along the tether and back")
    fallback = search.board.drive_out_and_back()
    if fallback is not None:
        yield search.to_plan(None, fallback, OUT_AND_BACK)


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


def _better(
    best: tuple[Result, DrivenTour] | None, found: tuple[Result, DrivenTour] | None
) -> tuple[Result, DrivenTour] | None:
    """Return the shorter of two tours; of equals the second, because more was known when it was
    found."""
    if best is None or (found is not None and found[1].length <= best[1].length):
        return found
    return best


def _best_driven(
    board: StateGraph,
    clock: Clock,
    on_progress: Callable[[str], None],
    best: tuple[Result, DrivenTour] | None,
    share: float,
    options: dict[str, Any],
) -> tuple[Result, DrivenTour] | None:
    """Return the best tour that was driven without fault.

    As long as there is time, the graph is solved again without the legs at fault; then those legs
    are replaced by paths through the start.
    """
    times = board.context.policy.times
    n_solves, found = 0, None
    warm_start = None if best is None else best[1].tour
    while n_solves < times.max_solves or clock.is_up:
        if found is None:
            faults = f", {counted(n_solves, 'leg')} at fault forbidden" if n_solves else ""
            on_progress(f"order{faults}")
            solving = Clock(times.min_solve_s) if clock.is_up else clock.part(share)
            found = board.solve(solving, warm_start, **options)
            if found is None:
                return None
        result, tour = found
        on_progress("driving the tour")
        driven = board.drive(tour)
        if driven.fault is None:
            return with_status(result, driven, LENGTH_ROUNDING), driven
        is_joined = board.forbid(driven.fault)
        if clock.is_up and not (is_joined and board.can_reach_all(tour)):
            return None  # no time is left, and this tour can no longer be driven
        warm_start = None  # it may contain the forbidden leg
        n_solves += 1
        if not clock.is_up:
            found = None
    return None

"""Plan a mission: order, legs, and a flight that proves them.

The order of the mission file is driven and judged first, before any search, and is the first
incumbent. Searches follow: tours of the plane if all solids are upright prisms
(`netsp.plan.space.prisms`), else tours in short orders (`netsp.plan.space.short_orders`); tours
along states and legs (`netsp.plan.space.space_plan`); and the order by going straight on
(`netsp.plan.space.visit_order`), which is better for some bodies with many free ends. Tours are
compared by the time until the robot is home, in a flight by `predictive`, or by length if there is
no time to fly. All tours go through `_Incumbents`, which accepts none that the judge refuses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.bounded_work import end_if_abandoned
from netsp.base.clock import Clock, TimeLimit
from netsp.base.errors import InputError, LimitReachedError
from netsp.base.geometry import polylines
from netsp.base.interrupt_signals import until_interrupt
from netsp.gtsp.travel.result import relative_gap
from netsp.model.bound_scope import LowerBound, Scope
from netsp.model.solution import Status
from netsp.plan.solve_problem import SolverLike
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_policy import MissionPolicy
from netsp.plan.space.passages import GapResolution
from netsp.plan.space.path_bound import bound_all_tours
from netsp.plan.space.planning_context import PlanningContext, keeps_clearance
from netsp.plan.space.space_plan import (
    AS_GIVEN,
    LENGTH_ROUNDING,
    OUT_AND_BACK,
    PLANE,
    SHORT_ORDER,
    TAUT_LEGS,
    SpacePlan,
    candidate_plans,
    check_plannable,
    plan_given_order,
    prepare_context,
)
from netsp.plan.space.upright import bound_by_upright_solids
from netsp.plan.space.visit_order import order_by_going_on
from netsp.world.mission.mission import Mission
from netsp.world.mission.mission_limits import check_tether
from netsp.world.mission.planned_tour import PlannedTour, PlannedVisit, thinned_path
from netsp.world.mission.run_log import LogRow, Run
from netsp.world.planner import PlannerOptions
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene
from netsp.world.simulator.mission_run import simulate

GOING_ON = "going-straight-on"
"""Value of `solver` in tours that were found by going straight on."""


@dataclass(frozen=True)
class SolvedMission:
    """Planned mission whose tour has passed the judge.

    Attributes
    ----------
    mission
        Mission with its waypoints in the order of the tour, and the tour.
    order
        Original numbers of the waypoints in the new order; those left out come last.
    run
        Flight of the planned mission; None if there was no time.
    given
        Flight of the mission as it was given; None if there was no time.
    plan
        Tour of states and legs, whether it was accepted or not; None if none was found.
    interrupted
        Whether Ctrl-C ended the run.
    gaps
        Cell size of the plan, and the gaps that its grid shows and does not show.
    """

    mission: Mission
    order: tuple[int, ...]
    run: Run | None
    given: Run | None
    plan: SpacePlan | None
    interrupted: bool = False
    gaps: GapResolution | None = None

    @property
    def tour(self) -> PlannedTour:
        """Return the tour of the mission."""
        assert self.mission.tour is not None
        return self.mission.tour

    @property
    def left_out(self) -> tuple[int, ...]:
        """Return the original numbers of the waypoints that the tour does not visit."""
        return self.order[len(self.tour.stops) :]


@dataclass
class _Flights:
    """Flights of one mission in several orders, until the time is up."""

    mission: Mission
    scene: Scene
    context: PlanningContext
    clock: Clock
    on_progress: Callable[[str], None]
    policy: MissionPolicy

    def fly(
        self, mission: Mission, name: str, cutoff_s: float = np.inf, clock: Clock | None = None
    ) -> tuple[Run | None, bool]:
        """Fly a mission to its end.

        Parameters
        ----------
        name : str
            Name of the tour in progress messages.
        cutoff_s : float
            Seconds after which the flight is cut short, because a better one is known.
        clock : Clock, optional
            Clock of the flight; when it is up, the flight is cut short. By default that of the run.

        Returns
        -------
        run : Run or None
            The flight; None if it was cut short.
        slower : bool
            True if it was cut short because it took longer than `cutoff_s`.
        """
        clock = clock or self.clock
        if clock.is_up:
            return None, False
        self.on_progress(f"flying {name}")
        slower = False

        def watch(row: LogRow, _: object) -> None:
            nonlocal slower
            slower = row.time > cutoff_s
            if slower or clock.is_up:
                raise KeyboardInterrupt  # ends the simulation

        if all(w.heading is None for w in mission.waypoints):
            # without headings the camera changes no path, but takes most of the time
            mission = mission.model_copy(update={"camera": None})
        try:
            run = self.clock.bounded(
                f"flying {name}",
                lambda: simulate(
                    mission,
                    scene=self.scene,
                    field=self.context.field,
                    on_step=watch,
                    options=PlannerOptions(prepared=False, clock=clock),
                ),
            )
        except LimitReachedError:
            return None, False
        return (None, slower) if run.summary["status"] == "interrupted" else (run, False)

    def judged(self, mission: Mission) -> bool:
        """Return whether a tour passes the judge.

        Raises
        ------
        LimitReachedError
            The time was up before it was judged.
        """
        self.on_progress("judging the tour")
        return self.clock.bounded(
            "judging the tour",
            lambda: bool(verify_mission(mission, scene=self.scene, context=self.context)),
        )


@dataclass
class _Incumbents:
    """Incumbent of a run. It accepts no tour that the judge refuses.

    Attributes
    ----------
    flights
        Flights of the mission.
    first
        Tour in the order of the file, if it passes the judge. A tour that is longer, or home later,
        is not accepted.
    given
        Flight of the mission as it was given.
    best
        The incumbent.
    """

    flights: _Flights
    first: SolvedMission | None = None
    given: Run | None = None
    best: SolvedMission | None = None

    def accept_first(self, found: SolvedMission) -> bool:
        """Accept the order of the file if it passes the judge; return whether it does."""
        if not self.flights.judged(found.mission):
            return False
        self.first = self.best = found
        return True

    def keep_given_flight(self, run: Run | None) -> None:
        """Keep the flight of the mission as it was given, unless it was cut short."""
        self.given = run or self.given

    def offer(self, found: SolvedMission, name: str) -> None:
        """Accept a tour if it passes the judge and is better than the incumbent."""
        best = self.best
        if best is not None and (
            len(found.tour.stops) < len(best.tour.stops)
            or (len(found.tour.stops) == len(best.tour.stops) and not self._may_be_better(found))
        ):
            return
        try:
            if not self.flights.judged(found.mission):
                return
        except LimitReachedError:
            if best is None:
                raise
            return
        run, slower = self.flights.fly(found.mission, name, self._cutoff_s())
        found = replace(found, run=run)
        if self._needs_flight(found) and (found.run is None or not _is_good(found.run)):
            return
        if best is None or (not slower and self._is_better(found, best)):
            self.best = found

    def _needs_flight(self, found: SolvedMission) -> bool:
        """Return whether a tour counts only with a flight, because it needs the part of the tether
        that plans reserve for steering."""
        limit = self.flights.policy.tether_share * self.flights.mission.tether_length
        in_plane = found.plan is not None and found.plan.kind == PLANE
        return in_plane and found.tour.longest_tether > limit

    def fly_best(self) -> None:
        """Fly the incumbent as it will be written, if it has not been flown."""
        best = self.best
        if best is not None and best.run is None:
            run, _ = self.flights.fly(best.mission, "it as it will be written")
            self.best = replace(best, run=run)
            self.first = self.best if best is self.first else self.first

    def _time_until_home_s(self, found: SolvedMission) -> float | None:
        """Return the seconds until home of a tour, None if it was not flown. For the order of the
        file, the flight as given counts."""
        if found.run is not None:
            return seconds_until_home(found.run)
        if found is self.first and self.given is not None and _is_good(self.given):
            return seconds_until_home(self.given)
        return None

    def _cutoff_s(self) -> float:
        """Return the seconds after which a flight cannot replace the incumbent."""
        seconds = None if self.best is None else self._time_until_home_s(self.best)
        return np.inf if seconds is None else (1.0 + self.flights.policy.bound_worth) * seconds

    def _may_be_better(self, found: SolvedMission) -> bool:
        """Return whether a tour through as many waypoints may be better than the incumbent."""
        assert self.best is not None
        seconds, mission = self._time_until_home_s(self.best), self.flights.mission
        if seconds is None:
            return found.tour.length < self.best.tour.length * self._max_ratio(found, self.best)
        # a flight turns back within reach of each waypoint, which saves this length at most
        saved = 2.0 * mission.reach * (1 + len(found.tour.stops))
        allowed = (1.0 + self.flights.policy.bound_worth) * seconds
        return (found.tour.length - saved) / mission.speed < allowed

    def _max_ratio(self, found: SolvedMission, best: SolvedMission) -> float:
        """Return the largest ratio of a tour to the incumbent at which it is accepted.

        The ratio is a little more than 1 for a tour along states and legs, because it has a bound,
        and less than 1 for a tour by going straight on.
        """
        without_bound = (GOING_ON, AS_GIVEN, SHORT_ORDER)
        if found.tour.solver == GOING_ON and best.tour.solver not in without_bound:
            return 1.0 - self.flights.policy.min_saving
        has_bound = found.plan is not None and found.plan.kind == TAUT_LEGS
        return (
            1.0 + self.flights.policy.bound_worth
            if has_bound and best.tour.solver == PLANE
            else 1.0
        )

    def _is_better(self, found: SolvedMission, best: SolvedMission) -> bool:
        """Return whether a tour that passed the judge replaces the incumbent."""
        if found.run is not None and not _is_good(found.run):
            return False
        if len(found.tour.stops) > len(best.tour.stops):
            return True
        if self.first is not None and not self._is_no_worse(found, self.first):
            return False
        allowed = self._max_ratio(found, best)
        seconds, best_seconds = self._time_until_home_s(found), self._time_until_home_s(best)
        if seconds is not None and best_seconds is not None:
            return seconds < allowed * best_seconds
        return found.tour.length < allowed * best.tour.length

    def _is_no_worse(self, found: SolvedMission, first: SolvedMission) -> bool:
        """Return whether a tour is neither longer than the order of the file nor home later."""
        if len(found.tour.stops) > len(first.tour.stops):
            return True
        if found.tour.length > first.tour.length * (1.0 + LENGTH_ROUNDING):
            return False
        seconds, first_seconds = self._time_until_home_s(found), self._time_until_home_s(first)
        return (
            seconds is None
            or first_seconds is None
            or seconds <= first_seconds * (1.0 + LENGTH_ROUNDING)
        )


def solve_mission(
    mission: Mission,
    *,
    scene: Scene | None = None,
    field: DistanceField | None = None,
    solver: SolverLike = "auto",
    params: Mapping[str, Any] | None = None,
    time_limit: TimeLimit = 60.0,
    iteration_limit: int | None = None,
    seed: int = 0,
    on_progress: Callable[[str], None] | None = None,
    policy: MissionPolicy | None = None,
) -> SolvedMission:
    """Plan a mission: the shortest tour through its waypoints that leaves the tether free.

    Parameters
    ----------
    scene, field : Scene, DistanceField, optional
        Scene of the mission and its distance field; loaded and computed if needed.
    solver, params, iteration_limit, seed
        As in `netsp.plan.solve_problem.solve_graph`.
    time_limit : float or Clock, optional
        Seconds for all stages; when they are up, the best tour so far is returned.
    on_progress : callable, optional
        Called with a line of text at each stage.
    policy : MissionPolicy, optional
        Effort, time and limits.

    Returns
    -------
    SolvedMission
        The planned mission and its flight. At Ctrl-C, the best so far.

    Raises
    ------
    InputError
        As `netsp.plan.space.space_plan.plan` and `netsp.world.simulator.mission_run.simulate`.
    LimitReachedError
        No tour was found on which the tether stays within its limit.

    Examples
    --------
    >>> from netsp.world.mission.mission import Mission
    >>> planned = solve_mission(Mission.load("missions/basin.json"))  # doctest: +SKIP
    >>> planned.mission.save("planned.json")  # doctest: +SKIP
    """
    policy = policy or MissionPolicy()

    def report(text: str) -> None:
        end_if_abandoned()
        if on_progress is not None:
            on_progress(text)

    options = _SolverOptions(solver, params, iteration_limit, seed)
    with until_interrupt(time_limit) as clock:
        check_plannable(mission, solver, params, seed)
        try:
            with clock.with_min_cpu(policy.first_tour_s):
                scene = scene or clock.bounded("reading the scene", mission.load_scene)
                context = prepare_context(
                    mission, clock, scene=scene, field=field, on_progress=report, policy=policy
                )
                mission, gaps = context.mission, context.gaps
                tether = clock.bounded("laying the tether", lambda: context.present_tether)
                check_tether(mission, tether.length)
                flights = _Flights(mission, scene, context, clock, report, policy)
                incumbents = _Incumbents(flights)
                _begin_as_given(incumbents, clock.part(policy.given_share), seed)
        except LimitReachedError:
            if clock.is_stopped and not (isinstance(time_limit, Clock) and time_limit.is_up):
                raise KeyboardInterrupt from None
            raise
        searched = _search(incumbents, clock, options)
        best = _add_bound(_finish(incumbents, searched, seed), searched.bounds)
        best = replace(best, mission=with_gaps(best.mission, context))
        return replace(
            best,
            given=incumbents.given,
            plan=searched.plan,
            interrupted=clock.is_stopped,
            gaps=gaps,
        )


def _finish(incumbents: _Incumbents, searched: _SearchResult, seed: int) -> SolvedMission:
    """Offer the last tours after the search, and return the incumbent, flown if there is time."""
    if incumbents.given is None:
        given, _ = incumbents.flights.fly(incumbents.flights.mission, "the order as given")
        incumbents.keep_given_flight(given)
        _offer_given_flight(incumbents, seed)
    _offer_going_on(incumbents, seed)
    if incumbents.best is None:
        raise searched.failure or LimitReachedError(
            "waypoints: no tour was found whose tether stays within the limit all along"
        )
    incumbents.fly_best()
    _offer_given_flight(incumbents, seed)
    return incumbents.best


def with_gaps(mission: Mission, context: PlanningContext) -> Mission:
    """Return a planned mission whose tour names the gaps that its cells do not show."""
    assert mission.tour is not None
    gaps = {"unresolved_gaps": context.unresolved_gaps}
    return mission.model_copy(update={"tour": mission.tour.model_copy(update=gaps)})


@dataclass(frozen=True)
class _SolverOptions:
    """Solver, and its options as in `netsp.plan.solve_problem.solve_graph`."""

    solver: SolverLike
    params: Mapping[str, Any] | None
    iteration_limit: int | None
    seed: int

    @property
    def name(self) -> str:
        """Return the name of the solver."""
        if isinstance(self.solver, str):
            return self.solver
        return str(getattr(self.solver, "__name__", "solver"))


@dataclass
class _SearchResult:
    """Result of the search.

    Attributes
    ----------
    plan
        The plan; None if there is none.
    bounds
        Bounds on all tours through a set of waypoints, metres, by the set.
    failure
        Error that ended the search.
    has_all_bounds
        Whether all kinds of bounds have been computed.
    """

    plan: SpacePlan | None = None
    bounds: dict[frozenset[int], float] = field(default_factory=dict)
    failure: InputError | LimitReachedError | None = None
    has_all_bounds: bool = False


def _begin_as_given(incumbents: _Incumbents, flight_clock: Clock, seed: int) -> None:
    """Accept the mission as it was given, whatever the time, and fly it as long as the clock
    allows.

    Its tour is accepted if it passes the judge, else the tour in its order.
    """
    flights = incumbents.flights
    mission, on_progress = flights.mission, flights.on_progress
    order = tuple(range(len(mission.waypoints)))
    on_progress("the order as given")
    is_accepted = mission.tour is not None and incumbents.accept_first(
        SolvedMission(mission, order, None, None, None)
    )
    if not is_accepted:
        context = replace(flights.context, mission=mission.model_copy(update={"tour": None}))
        driven = flights.clock.bounded(
            "driving the order as given", lambda: plan_given_order(context)
        )
        if driven is not None and driven.visits:
            incumbents.accept_first(_solved_from_plan(driven, AS_GIVEN, seed))
    given, _ = flights.fly(mission, "the order as given", clock=flight_clock)
    incumbents.keep_given_flight(given)
    _offer_given_flight(incumbents, seed)


def _offer_given_flight(incumbents: _Incumbents, seed: int) -> None:
    """Offer the flight of the mission as it was given as a tour, if it is home earlier than the
    incumbent."""
    given, best, mission = incumbents.given, incumbents.best, incumbents.flights.mission
    if given is None or not _is_good(given) or (best is not None and best.run is None):
        return
    cutoff_s = np.inf if best is None or best.run is None else seconds_until_home(best.run)
    if seconds_until_home(given) >= cutoff_s or incumbents.flights.clock.is_overdue:
        return
    order = tuple(range(len(mission.waypoints)))
    context = incumbents.flights.context
    flown_tour = tour_of_flight(mission, order, given, context.field, context, seed, AS_GIVEN)
    if flown_tour is None or not flown_tour.tour.stops:
        return
    if best is None:
        incumbents.accept_first(flown_tour)
    else:
        incumbents.offer(flown_tour, "it as it will be written")


def _search(incumbents: _Incumbents, clock: Clock, options: _SolverOptions) -> _SearchResult:
    """Offer the tours of the plane and along states and legs."""
    flights, searched = incumbents.flights, _SearchResult()
    if clock.is_up and incumbents.best is not None:
        return searched  # the stages before the first plan would overrun the limit
    candidates = candidate_plans(
        flights.mission,
        scene=flights.scene,
        context=flights.context,
        solver=options.solver,
        params=options.params,
        clock=clock.part(flights.policy.planning_share),
        iteration_limit=options.iteration_limit,
        seed=options.seed,
        whole_tether=True,
        on_progress=flights.on_progress,
    )

    def next_plan() -> SpacePlan | None:
        return clock.bounded("looking for tours", lambda: next(candidates, None), winds_down=True)

    # if the order of the file cannot be driven, the first tour comes from this search
    needs_tour = incumbents.best is None
    first_tour_s = flights.policy.first_tour_s if needs_tour else 0.0
    try:
        with clock.with_min_cpu(first_tour_s):
            while (plan := next_plan()) is not None:
                best = incumbents.best
                if plan.kind == PLANE and best is not None and best.tour.solver == PLANE:
                    continue  # the accepted tour, for the whole tether, is at most as long
                bound_tours = partial(_raise_bound, searched, plan, flights, clock, options.seed)
                clock.bounded("bounding all tours", bound_tours)
                searched.plan = (
                    searched.plan
                    if searched.plan is not None and plan.kind == OUT_AND_BACK
                    else plan
                )
                solved = _solved_from_plan(plan, options.name, options.seed)
                incumbents.offer(solved, f"the tour ({plan.kind})")
                has_tour = incumbents.best is not None
                if has_tour and (plan.kind == TAUT_LEGS or (needs_tour and clock.is_up)):
                    break
    except (InputError, LimitReachedError) as error:
        if incumbents.best is None or not incumbents.best.tour.stops:
            raise
        searched.failure = error
    return searched


def _raise_bound(
    searched: _SearchResult, plan: SpacePlan, flights: _Flights, clock: Clock, seed: int
) -> None:
    """Bound all tours to the waypoints of a plan.

    The first plans are bounded by the upright solids alone, which takes little time; once paths
    between waypoints are known, by all bounds.
    """
    visited, part = frozenset(plan.order), clock.part(flights.policy.bound_share)
    before = searched.bounds.get(visited)
    if plan.kind in (PLANE, SHORT_ORDER) and before is None:
        flights.on_progress("bound on all tours by upright solids")
        places = plan.paths.places
        visited_places = [n for n in range(len(places)) if places.waypoint[n] in visited]
        bound = bound_by_upright_solids(
            flights.mission, flights.context, visited_places, places, part
        )
    elif plan.kind not in (PLANE, SHORT_ORDER) and not searched.has_all_bounds:
        flights.on_progress("bound on all tours")
        bound = bound_all_tours(plan.paths, sorted(visited), part, seed)
        searched.has_all_bounds = True
    else:
        return
    if bound is not None:
        searched.bounds[visited] = max(bound, before or 0.0)


def _solved_from_plan(planned: SpacePlan, solver: str, seed: int) -> SolvedMission:
    """Return a plan as a solved mission."""
    mission = planned.to_mission(solver, seed)
    return SolvedMission(mission, planned.all_waypoints, None, None, planned)


def _add_bound(best: SolvedMission, bounds: Mapping[frozenset[int], float]) -> SolvedMission:
    """Return a tour with the bound on all tours to the same waypoints, if there is one.

    A robot may turn back before it is at a waypoint. So the bound is reduced by twice the distance
    that remains at each waypoint, and once at home.
    """
    bound = bounds.get(frozenset(best.order[: len(best.tour.stops)]))
    if bound is None:
        return best
    tour, mission = best.tour, best.mission
    shortfall = sum(
        float(np.linalg.norm(np.subtract(stop.path[-1], place)))
        for stop, place in zip(tour.stops, mission.places, strict=False)
    )
    shortfall = 2.0 * shortfall + float(np.linalg.norm(np.subtract(tour.home[-1], mission.start)))
    bound = min(tour.length, max(0.0, bound - (shortfall if shortfall > LENGTH_ROUNDING else 0.0)))
    is_complete = len(tour.stops) == len(mission.waypoints)
    proven = is_complete and LowerBound(bound, Scope.ALL_TOURS).proves(tour.length)
    tour = tour.model_copy(
        update={
            "bound_of_all": bound,
            "gap_to_all": relative_gap(tour.length, bound),
            "status": Status.OPTIMAL if proven else tour.status,
        }
    )
    return replace(best, mission=mission.model_copy(update={"tour": tour}))


def _offer_going_on(incumbents: _Incumbents, seed: int) -> None:
    """Offer the order by going straight on, in both directions."""
    flights = incumbents.flights
    mission, clock = flights.mission.model_copy(update={"tour": None}), flights.clock
    if clock.is_up or mission.state is not None:
        return  # going straight on begins at the start
    flights.on_progress("order by going straight on")
    context = flights.context
    try:
        tour = clock.bounded(
            "ordering the waypoints by going straight on",
            lambda: order_by_going_on(
                mission,
                context.field,
                context.grid,
                clock=clock.part(flights.policy.going_on_share),
                seed=seed,
                policy=flights.policy,
            ),
        )
    except (InputError, LimitReachedError):
        return
    left_out = tuple(n for n in range(len(mission.waypoints)) if n not in tour)
    for direction, ordered_waypoints in (("forward", tour), ("in reverse", tour[::-1])):
        order = (*ordered_waypoints, *left_out)
        waypoints = tuple(mission.waypoints[n] for n in order)
        ordered = mission.model_copy(update={"waypoints": waypoints})
        run, slower = flights.fly(ordered, f"that order {direction}", incumbents._cutoff_s())
        if slower:
            continue
        if run is None or clock.is_overdue:
            break
        flown_tour = tour_of_flight(ordered, order, run, context.field, context, seed)
        if flown_tour is not None:
            incumbents.offer(flown_tour, "it as it will be written")


def _is_good(run: Run) -> bool:
    """Return whether a flight came home free, and never exceeded the limit of the tether."""
    return bool(run.summary["home"]["tether_free"]) and run.summary["exceedance_s"] == 0.0


def tour_of_flight(
    mission: Mission,
    order: tuple[int, ...],
    run: Run,
    field: DistanceField,
    context: PlanningContext | None = None,
    seed: int = 0,
    solver: str = GOING_ON,
) -> SolvedMission | None:
    """Return a mission with the path of a flight as its tour.

    Parameters
    ----------
    order : tuple of int
        Original numbers of the mission's waypoints.
    context : PlanningContext, optional
        Context for the words of the visits; computed if needed.
    solver : str
        Value of `solver` in the tour.

    Returns
    -------
    SolvedMission or None
        The mission with the tour. None if the robot did not come home free, went through a gap that
        the grid does not show, lost its clearance, or the tether was over the limit.
    """
    if not _is_good(run):
        return None
    visited = [int(stop["waypoint"]) for stop in run.summary["stops"]]
    left_out = [k for k in range(len(order)) if k not in visited]
    parts = _log_of_legs(run.log, visited)
    legs = [np.array([[r.x, r.y, r.z] for r in part]) for part in parts]
    path = np.vstack([legs[0][:1], *(leg[1:] for leg in legs)])
    if not all(keeps_clearance(field, leg, mission) for leg in legs):
        return None
    context = context or PlanningContext.for_mission(mission, mission.load_scene(), field)
    stops = _planned_visits(run, order, parts, legs, context)
    if stops is None:
        return None
    tour = PlannedTour(
        stops=stops,
        home=thinned_path(legs[-1]),
        status=Status.FEASIBLE,
        solver=solver,
        seed=seed,
        length=polylines.length(path),
        states=len(visited),
        legs=len(legs),
        exact=context.words.exact,
        unresolved_gaps=context.unresolved_gaps,
    )
    chosen = [*visited, *left_out]
    planned = mission.model_copy(
        update={"waypoints": tuple(mission.waypoints[k] for k in chosen), "tour": tour}
    )
    return SolvedMission(planned, tuple(order[k] for k in chosen), None, None, None)


def _planned_visits(
    run: Run,
    order: tuple[int, ...],
    parts: list[tuple[LogRow, ...]],
    legs: list[Floats],
    context: PlanningContext,
) -> tuple[PlannedVisit, ...] | None:
    """Return the visits of a flight with their words; None if the path to one has no word."""
    visits = []
    for k, stop in enumerate(run.summary["stops"]):
        walked = np.vstack([context.present_tether.nodes, *legs[: k + 1]])
        word, broken = context.words.try_word(walked)
        if broken is not None:
            return None
        visit = PlannedVisit(
            path=thinned_path(legs[k]),
            signature=word,
            tether_length=stop["tether"],
            longest_tether=max(r.tether for r in parts[k]),
            given_as=order[int(stop["waypoint"])],
        )
        visits.append(visit)
    return tuple(visits)


def _log_of_legs(log: tuple[LogRow, ...], visited: list[int]) -> list[tuple[LogRow, ...]]:
    """Return the log of each leg, from waypoint to waypoint and home; each has two rows at
    least."""
    next_waypoint = np.array([r.waypoint for r in log])
    ends = [int(np.argmax(next_waypoint > k)) for k in visited]
    cuts = [0, *ends, len(log) - 1]
    return [log[a : b + 1] if b > a else (log[a], log[a]) for a, b in pairwise(cuts)]


def seconds_until_home(run: Run) -> float:
    """Return the seconds of a flight until the robot is home."""
    return float(run.summary["inspection_s"] + run.summary["home"]["seconds"])

"""Plan a mission: order, legs, and a flight that proves them.

The first tours need no words of the scene, whose search takes long in large scenes: the order of
the file along spokes (`netsp.plan.space.spoke_tours`) and by the planner `predictive`, then short
orders along spokes and, among upright prisms, the tours of the plane (`netsp.plan.space.prisms`).
If the shortest tour of the plane is proven, the search ends. Otherwise gaps and words are searched
for, and then tours along states and legs (`netsp.plan.space.space_plan`), in rounds that each plan
with a fixed time: a run with a longer limit begins with the rounds of a shorter one. The first
round also looks for a short order by `predictive` (`netsp.plan.space.short_orders`) and the order
by going straight on (`netsp.plan.space.visit_order`). All tours go through
`Incumbents`, which accepts none that the judge refuses.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from netsp.base.bounded_work import end_if_abandoned
from netsp.base.clock import Clock, TimeLimit
from netsp.base.compiled.compile_policy import long_work
from netsp.base.errors import InputError, LimitReachedError
from netsp.base.interrupt_signals import until_interrupt
from netsp.gtsp.travel.result import relative_gap
from netsp.model.solution import Status
from netsp.plan.solve_problem import SolverLike
from netsp.plan.space.incumbents import Incumbents
from netsp.plan.space.mission_flights import (
    GOING_ON,
    Flights,
    SolvedMission,
    is_good,
    seconds_until_home,
    tour_of_flight,
)
from netsp.plan.space.mission_policy import MissionPolicy
from netsp.plan.space.passages import GapResolution
from netsp.plan.space.path_bound import bound_all_tours
from netsp.plan.space.planning_context import PlanningContext, keeps_clearance
from netsp.plan.space.space_plan import (
    AS_GIVEN,
    OUT_AND_BACK,
    PLANE,
    SHORT_ORDER,
    TAUT_LEGS,
    TAUT_SO_FAR,
    SpacePlan,
    StagedSearch,
    check_plannable,
    plan_given_order,
    prepare_context,
    prepare_without_words,
)
from netsp.plan.space.state_search import LENGTH_ROUNDING
from netsp.plan.space.upright import bound_by_upright_solids
from netsp.plan.space.visit_order import order_by_going_on
from netsp.world.mission.mission import Mission
from netsp.world.mission.mission_limits import check_tether
from netsp.world.mission.planned_tour import bound_within_rounding, status_of_tour
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene

__all__ = ["GOING_ON", "SolvedMission", "seconds_until_home", "solve_mission", "tour_of_flight"]


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
    with until_interrupt(time_limit) as clock, long_work():
        check_plannable(mission, solver, params, seed)
        run = _MissionRun(mission, clock, report, policy, options)
        try:
            with clock.with_min_cpu(policy.first_tour_s):
                run.begin(scene, field)
        except LimitReachedError:
            if clock.is_stopped and not (isinstance(time_limit, Clock) and time_limit.is_up):
                raise KeyboardInterrupt from None
            raise
        run.search()
        return run.finish()


@dataclass
class _MissionRun:
    """Run of `solve_mission`.

    Attributes
    ----------
    mission
        Mission as it was given.
    clock
        Clock of the run.
    on_progress
        Called with a line of text at each stage.
    policy
        Effort, time and limits.
    options
        Solver and its options.
    incumbents
        The incumbent.
    scene
        Scene of the mission.
    stages
        Search for candidate tours.
    searched
        What the search has found besides tours.
    """

    mission: Mission
    clock: Clock
    on_progress: Callable[[str], None]
    policy: MissionPolicy
    options: _SolverOptions
    incumbents: Incumbents = field(init=False)
    scene: Scene = field(init=False)
    stages: StagedSearch = field(init=False)
    searched: _SearchResult = field(default_factory=lambda: _SearchResult())

    @property
    def context(self) -> PlanningContext:
        """Return the context of the mission, which has words once they are found."""
        return self.incumbents.flights.context

    @property
    def seed(self) -> int:
        """Return the random seed."""
        return self.options.seed

    def begin(self, scene: Scene | None, field: DistanceField | None) -> None:
        """Find the first tours, whatever the time: the order of the file along spokes and, if that
        takes little time, by `predictive`."""
        clock, policy = self.clock, self.policy
        scene = scene or clock.bounded("reading the scene", self.mission.load_scene)
        context = prepare_without_words(
            self.mission, clock, scene=scene, field=field, policy=policy
        )
        tether = clock.bounded("laying the tether", lambda: context.present_tether)
        check_tether(context.mission, tether.length)
        self.scene = scene
        flights = Flights(context.mission, scene, context, clock, self.on_progress, policy)
        self.incumbents = Incumbents(flights)
        self.on_progress("the order as given")
        if self.mission.tour is not None:
            given = self.mission.model_copy(update={"tour": self.mission.tour.without_words()})
            order = tuple(range(len(given.waypoints)))
            self.incumbents.accept_first(SolvedMission(given, order, None, None, None))
        self.stages = StagedSearch(
            context, scene, self.on_progress, self.options.to_solver_options()
        )
        if self.incumbents.first is None:
            along_spokes = clock.bounded("driving along spokes", self.stages.spokes_as_given)
            self._accept_first(along_spokes)
            with clock.with_min_cpu(policy.given_order_s):
                self._offer_driven_order()

    def _accept_first(self, plan: SpacePlan | None) -> None:
        """Offer a plan in the order of the file."""
        if plan is not None and plan.visits:
            self.incumbents.accept_first(_solved_from_plan(plan, AS_GIVEN, self.seed))

    def _offer_driven_order(self) -> None:
        """Offer the order of the file as `predictive` drives it, if there is time."""
        if self.clock.is_overdue:
            return
        mission = self.context.mission.model_copy(update={"tour": None})
        context = replace(self.context, mission=mission)
        try:
            driven = self.clock.bounded(
                "driving the order as given", lambda: plan_given_order(context)
            )
            self._accept_first(driven)
        except LimitReachedError:
            if self.incumbents.best is None and self.clock.is_stopped:
                raise

    def search(self) -> None:
        """Offer tours until the time is up: first without words, then along states and legs, in
        rounds."""
        clock, needs_tour = self.clock, self.incumbents.best is None
        if clock.is_up and not needs_tour:
            return
        try:
            # if no order of the file can be driven, the first tour comes from this search
            with clock.with_min_cpu(self.policy.first_tour_s if needs_tour else 0.0):
                self._offer_plans(self.stages.without_words(clock))
                if self._is_done():
                    return
                self._find_words()
                self._fly_given()
                if not self._is_plane_optimum():
                    self._search_in_rounds()
        except (InputError, LimitReachedError) as error:
            if self.incumbents.best is None:
                raise
            self.searched.failure = error

    def _is_done(self) -> bool:
        """Return whether the time is up and there is a tour."""
        return self.clock.is_up and self.incumbents.best is not None

    def _find_words(self) -> None:
        """Find the gaps and the words of the scene, and add them to the tours found so far."""
        context = prepare_context(
            self.mission,
            self.clock,
            scene=self.scene,
            field=self.context.field,
            on_progress=self.on_progress,
            policy=self.policy,
        )
        self.incumbents.add_words(context)
        self.stages = replace(self.stages, context=context)

    def _fly_given(self) -> None:
        """Fly the mission as it was given, and offer the flight as a tour."""
        if self._is_done():
            return
        flights = self.incumbents.flights
        given, _ = flights.fly(flights.mission, "the order as given")
        self.incumbents.keep_given_flight(given)
        _offer_given_flight(self.incumbents, self.seed)

    def _search_in_rounds(self) -> None:
        """Search in rounds that plan with more and more time, until the time is up or a round was
        not cut short by its own time."""
        planned_s, is_first = self.policy.round_s, True
        while not self._is_done():
            round_ = self.clock if self.clock.limit is None else self.clock.paced(planned_s)
            planning = round_.part(self.policy.planning_share)
            self._offer_plans(self.stages.with_words(planning, is_first), round_)
            if self.clock.is_up or self._is_proven():
                return
            if is_first:
                _offer_going_on(self.incumbents, round_.part(self.policy.going_on_share), self.seed)
            if not round_.has_run_out:
                return
            planned_s, is_first = self.policy.round_growth * planned_s, False

    def _is_plane_optimum(self) -> bool:
        """Return whether the incumbent is no longer than the proven shortest tour of the plane."""
        best, optimum = self.incumbents.best, self.stages.plane_optimum
        return (
            best is not None
            and optimum is not None
            and best.length_to_waypoints <= optimum * (1.0 + LENGTH_ROUNDING)
        )

    def _is_proven(self) -> bool:
        """Return whether the bound on all tours proves the incumbent."""
        best = self.incumbents.best
        if best is None:
            return False
        bounded = add_bound(best, self.searched.bounds, self.context.field)
        return bounded is not None and bounded.tour.status is Status.OPTIMAL

    def _offer_plans(self, plans: Iterator[SpacePlan], round_: Clock | None = None) -> None:
        """Offer plans one after the other, and bound all tours to their waypoints."""
        clock, incumbents, searched = self.clock, self.incumbents, self.searched
        searched.has_all_bounds = False

        def next_plan() -> SpacePlan | None:
            return clock.bounded("looking for tours", lambda: next(plans, None), winds_down=True)

        while (plan := next_plan()) is not None:
            bounding = partial(
                _raise_bound, searched, plan, incumbents.flights, round_ or clock, self.seed
            )
            clock.bounded("bounding all tours", bounding)
            if searched.plan is None or plan.kind != OUT_AND_BACK:
                searched.plan = plan
            solved = _solved_from_plan(plan, self.options.name, self.seed)
            incumbents.offer(solved, f"the tour ({plan.kind})")
            if self._is_done() or (plan.kind == TAUT_LEGS and incumbents.best is not None):
                return

    def finish(self) -> SolvedMission:
        """Return the incumbent, flown if there is time, with its bound."""
        incumbents, searched = self.incumbents, self.searched
        if incumbents.given is None and not self.clock.is_up:
            self._fly_given()
        if incumbents.best is None:
            raise searched.failure or LimitReachedError(
                "waypoints: no tour was found whose tether stays within the limit all along"
            )
        incumbents.fly_best()
        best = incumbents.best
        bounded = add_bound(best, searched.bounds, self.context.field)
        if bounded is None:
            self.on_progress(
                "the bound on all tours is left out: the tour is shorter, so the bound is wrong; "
                "please report this mission as a bug"
            )
        best = bounded or best
        return replace(
            best,
            mission=with_gaps(best.mission, self.context),
            given=incumbents.given,
            plan=searched.plan,
            interrupted=self.clock.is_stopped,
            gaps=self.context.gaps or GapResolution(best.mission, self.context.grid.cell, (), None),
        )


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

    def to_solver_options(self) -> dict[str, Any]:
        """Return the options of `netsp.plan.solve_problem.solve_graph`."""
        return {
            "solver": self.solver,
            "seed": self.seed,
            "params": self.params,
            "iteration_limit": self.iteration_limit,
        }

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


def _offer_given_flight(incumbents: Incumbents, seed: int) -> None:
    """Offer the flight of the mission as it was given as a tour, if it is home earlier than the
    incumbent."""
    given, best, mission = incumbents.given, incumbents.best, incumbents.flights.mission
    if given is None or not is_good(given) or (best is not None and best.run is None):
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


def _raise_bound(
    searched: _SearchResult, plan: SpacePlan, flights: Flights, clock: Clock, seed: int
) -> None:
    """Bound all tours to the waypoints of a plan.

    The first plans are bounded by the upright solids alone, which takes little time; once paths
    between waypoints are known and no better tour is being searched for, by all bounds.
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
    elif plan.kind not in (PLANE, SHORT_ORDER, TAUT_SO_FAR) and not searched.has_all_bounds:
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


def add_bound(
    best: SolvedMission, bounds: Mapping[frozenset[int], float], field: DistanceField
) -> SolvedMission | None:
    """Return a tour with the bound on all tours to the same waypoints, if there is one.

    A robot may turn back before it is at a waypoint. So the bound is reduced by twice the distance
    that remains at each waypoint, and once at home. It holds only if the legs, led on to the
    waypoints, keep the room of these.

    Parameters
    ----------
    bounds : dict
        Bounds on all tours through a set of waypoints, metres, by the set.
    field : DistanceField
        Distance field of the scene.

    Returns
    -------
    SolvedMission or None
        The same tour if there is no bound that holds for it; None if the tour is shorter than its
        bound, so that the bound is wrong.
    """
    found = bounds.get(frozenset(best.order[: len(best.tour.stops)]))
    tour, mission, shortfall = best.tour, best.mission, best.shortfall
    if shortfall <= LENGTH_ROUNDING:
        shortfall = 0.0
    if found is None or (shortfall and not _keeps_room_to_waypoints(best, field)):
        return best
    bound = bound_within_rounding(tour.length, max(0.0, found - shortfall))
    if bound is None:
        return None
    is_complete = len(tour.stops) == len(mission.waypoints)
    tour = tour.model_copy(
        update={
            "bound_of_all": bound,
            "gap_to_all": relative_gap(tour.length, bound),
            "status": status_of_tour(tour.length, tour.lower_bound, bound, is_complete=is_complete),
        }
    )
    return replace(best, mission=mission.model_copy(update={"tour": tour}))


def _keeps_room_to_waypoints(best: SolvedMission, field: DistanceField) -> bool:
    """Return whether all legs, led on to the waypoints themselves, keep as much room as the judge
    asks of a leg between these."""
    mission, tour = best.mission, best.tour
    paths = [*(np.array(stop.path) for stop in tour.stops), np.array(tour.home)]
    places = np.vstack([paths[0][0], mission.places[: len(tour.stops)], mission.start])
    return all(
        keeps_clearance(field, np.vstack([a, path, b]), mission)
        for (a, b), path in zip(pairwise(places), paths, strict=True)
    )


def _offer_going_on(incumbents: Incumbents, clock: Clock, seed: int) -> None:
    """Offer the order by going straight on, in both directions."""
    flights = incumbents.flights
    mission = flights.mission.model_copy(update={"tour": None})
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
        run, _ = flights.fly(ordered, f"that order {direction}")
        if run is None or clock.is_overdue:
            break
        flown_tour = tour_of_flight(ordered, order, run, context.field, context, seed)
        if flown_tour is not None:
            incumbents.offer(flown_tour, "it as it will be written")

"""From a mission to the same mission planned: order, legs, and a flight that proves them.

Two ways are tried, and the better is kept: the tour of states and legs (`netsp.space.plan`), and
the order by going straight on (`netsp.space.order`), which is better for some bodies with many free
ends. What counts is the time until the robot is home, of a flight by `predictive`, which keeps to
the legs of the first, and finds those of the second.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from netsp.clock import Clock, TimeLimit, until_interrupt
from netsp.errors import LimitReachedError
from netsp.online.log import LogRow, Run
from netsp.online.mission import Mission
from netsp.online.planner import PlannerOptions
from netsp.online.scene.field import DistanceField
from netsp.online.scene.scene import Scene
from netsp.online.simulate import grid_of, simulate
from netsp.online.tour import PlannedStop, PlannedTour, in_file
from netsp.solution import Status
from netsp.solvers.solve import SolverLike
from netsp.space.bound import bound_of_all
from netsp.space.judge import verify_mission
from netsp.space.order import order_by_going_on
from netsp.space.plan import SpacePlan, plan
from netsp.space.water import Water, along, has_room
from netsp.travel.result import relative_gap

PLANNING, BOUNDING, ORDERING = 0.7, 0.3, 0.3
"""Of the time left, what the tour of states and legs may take, then the bound, then the order by
going straight on; the rest is for flights."""

HURRY = 0.5
"""Of the time limit: when less than that is left, flights that cannot be the best are cut short."""

WORTH = 0.005
"""Share of its time that a flight must save to be taken instead of a tour of which more is known;
what is saved by stopping within reach of the start is less."""

GOING_ON, AS_GIVEN = "going-straight-on", "as-given"
"""Names of the older way and of the order of the file, where tours tell their solver."""


@dataclass(frozen=True)
class SolvedMission:
    """A mission, planned.

    Parameters
    ----------
    mission : Mission
        With its waypoints in the order of the tour, and the tour.
    order : tuple of int
        Old numbers of the waypoints in the new order; those that are left out come last.
    run : Run or None
        The planned mission, flown; None when there was no time left.
    given : Run or None
        The mission as it was given, flown; None when there was no time left.
    plan : SpacePlan or None
        The tour of states and legs, whether it was kept or not; None where none was found.
    interrupted : bool
        Whether Ctrl-C ended it.
    """

    mission: Mission
    order: tuple[int, ...]
    run: Run | None
    given: Run | None
    plan: SpacePlan | None
    interrupted: bool = False

    @property
    def tour(self) -> PlannedTour:
        """Of the mission."""
        assert self.mission.tour is not None
        return self.mission.tour

    @property
    def left_out(self) -> tuple[int, ...]:
        """Old numbers of the waypoints that the tour does not go to."""
        return self.order[len(self.tour.stops) :]


@dataclass
class _Flights:
    """Flights of one mission in several orders, until the time is up."""

    mission: Mission
    scene: Scene
    field: DistanceField
    clock: Clock
    tell: Callable[[str], None]
    planned: SpacePlan | None

    @cached_property
    def water(self) -> Water:
        """With the words that tours name."""
        if self.planned is not None:
            return self.planned.water
        return Water.of(self.mission, self.scene, self.field)

    def of(self, mission: Mission, name: str, best: SolvedMission | None = None) -> Run | None:
        """A flight to its end; None if the time was up before, or, where not much of it is left,
        if the flight has taken longer than the best already: way home and all, it would be far from
        it, and to plan the way home of a tether that is wound up takes longest."""
        if self.clock.up:
            return None
        self.tell(f"flying {name}")

        worth = np.inf if best is None or best.run is None else seconds_until_home(best.run)
        limit = self.clock.limit or np.inf

        def watch(row: LogRow, _: object) -> None:
            hopeless = row.time > worth and self.clock.left < HURRY * limit
            if self.clock.up or hopeless:
                raise KeyboardInterrupt  # it ends a flight

        if all(w.heading is None for w in mission.waypoints):
            # what is seen takes most of the time of a flight, and changes nothing else of it
            mission = mission.model_copy(update={"camera": None})
        run = simulate(
            mission,
            scene=self.scene, field=self.field, on_step=watch,
            options=PlannerOptions(prepared=False, clock=self.clock),
        )  # fmt: skip
        return None if run.summary["status"] == "interrupted" else run

    def judged(self, mission: Mission) -> bool:
        """Whether the judge finds no fault with a tour."""
        self.tell("judging the tour")
        return bool(verify_mission(mission, scene=self.scene, field=self.field))


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
) -> SolvedMission:
    """Plan a mission: the shortest tour through its waypoints that leaves the tether free.

    Parameters
    ----------
    mission : Mission
        The mission.
    scene : Scene, optional
        Its scene, when it is at hand.
    field : DistanceField, optional
        The scene's field, when it is at hand.
    solver : str or callable
        As of `netsp.solvers.solve.solve_graph`.
    params : mapping, optional
        Options of the solver.
    time_limit : float or Clock, optional
        Seconds for all; when they are up, the best by then is returned (`netsp.space.plan.plan`).
    iteration_limit : int, optional
        Iterations of the solver.
    seed : int
        Of the solver.
    on_progress : callable, optional
        Called with a line of text now and then.

    Returns
    -------
    SolvedMission
        The planned mission and its flight. At Ctrl-C, the best by then.

    Raises
    ------
    InputError
        As of `netsp.space.plan.plan` and `simulate`.
    LimitReachedError
        No tour was found on which the tether stays within its limit.
    """
    tell = on_progress or (lambda _: None)
    name = solver if isinstance(solver, str) else getattr(solver, "__name__", "solver")
    with until_interrupt(time_limit) as clock:
        scene = scene or mission.load_scene()
        field = field or scene.field()
        mission = mission.checked_waypoints(field)
        planned, failure, bound = None, None, None
        best: SolvedMission | None = None
        try:
            planned = plan(
                mission, scene=scene, field=field, solver=solver, params=params,
                time_limit=clock.part(PLANNING), iteration_limit=iteration_limit, seed=seed,
                on_progress=tell,
            )  # fmt: skip
        except LimitReachedError as error:
            failure = error
        flights = _Flights(mission, scene, field, clock, tell, planned)
        if planned is not None:
            tell("bound on all tours")
            reached = sorted(planned.order)
            bound = bound_of_all(planned.ways, reached, clock.part(BOUNDING), seed)
            best = _of_plan(planned, name, seed, bound)
            best = replace(best, run=flights.of(best.mission, "the tour"))
            best = _or_without_detours(best, planned.taut, flights, name, seed, bound)
        given = flights.of(mission, "the order as given", best)
        best = _or_as_given(best, given, flights, bound, seed)
        best = _or_going_on(best, flights, bound, seed)
        if best is None:
            raise failure or LimitReachedError("time limit reached before any tour was found")
        return replace(best, given=given, plan=planned, interrupted=clock.stopped)


def _of_plan(planned: SpacePlan, solver: str, seed: int, bound: float | None) -> SolvedMission:
    mission = planned.planned(solver, seed, bound)
    return SolvedMission(mission, planned.every_waypoint, None, None, planned)


def _or_without_detours(
    best: SolvedMission, taut: SpacePlan | None, flights: _Flights, solver: str, seed: int,
    bound: float | None,
) -> SolvedMission:  # fmt: skip
    """The better of a tour with detours and of the best one without: a tether that hangs otherwise
    than it should after a detour may take long to come free."""
    if taut is None:
        return best
    other = _of_plan(taut, solver, seed, bound)
    if not flights.judged(best.mission):
        return replace(other, run=flights.of(other.mission, "the tour without detours"))
    if best.run is None or seconds_until_home(best.run) <= taut.length / best.mission.speed:
        return best
    run = flights.of(other.mission, "the tour without detours", best)
    return best if run is None or not _better_than(run, best) else replace(other, run=run)


def _or_going_on(
    best: SolvedMission | None, flights: _Flights, bound: float | None, seed: int
) -> SolvedMission | None:  # fmt: skip
    """The better of a tour and of the order by going straight on, in both directions."""
    mission, clock = flights.mission.model_copy(update={"tour": None}), flights.clock
    if clock.up or mission.state is not None:
        return best  # that way begins at the start
    flights.tell("order by going straight on")
    grid = grid_of(mission, flights.scene, flights.field)
    limited = clock.part(ORDERING)
    try:
        found = order_by_going_on(mission, flights.field, grid, clock=limited, seed=seed)
    except LimitReachedError:
        return best
    rest = tuple(n for n in range(len(mission.waypoints)) if n not in found)
    for direction, tour in (("forward", found), ("in reverse", found[::-1])):
        order = (*tour, *rest)
        there = mission.model_copy(update={"waypoints": tuple(mission.waypoints[n] for n in order)})
        run = flights.of(there, f"that order {direction}", best)
        if run is None:
            break
        if best is not None and not _better_than(run, best):
            continue
        kept = tour_of_flight(there, order, run, flights.field, flights.water, bound, seed)
        if kept is None or not flights.judged(kept.mission):
            continue
        again = flights.of(kept.mission, "it as it will be written")
        if again is None or (best is not None and not _better_than(again, best)):
            continue
        best = replace(kept, run=again)
    return best


def _or_as_given(
    best: SolvedMission | None, given: Run | None, flights: _Flights, bound: float | None,
    seed: int,
) -> SolvedMission | None:  # fmt: skip
    """The better of a tour and of the mission as it was given, whose own tour is kept if it has
    one."""
    mission = flights.mission
    order = tuple(range(len(mission.waypoints)))
    if given is None and mission.tour is not None:
        # no time to fly it, but to judge it
        if best is not None and best.tour.length <= mission.tour.length:
            return best
        good = flights.judged(mission)
        return SolvedMission(mission, order, None, None, None) if good else best
    if given is None or (best is not None and not _better_than(given, best)):
        return best
    if mission.tour is not None and _good(given):
        return SolvedMission(mission, order, given, None, None)
    kept = tour_of_flight(
        mission, order, given, flights.field, flights.water, bound, seed, AS_GIVEN
    )
    if kept is None or not flights.judged(kept.mission):
        return best
    again = flights.of(kept.mission, "it as it will be written")
    if again is None:
        if best is not None and best.run is not None:
            return best
        return kept  # there was no time to fly what will be written, but to judge it
    return replace(kept, run=again) if best is None or _better_than(again, best) else best


def _better_than(run: Run, best: SolvedMission) -> bool:
    """Whether a flight is better than a tour that was flown; one that there was no time to fly
    takes at least as long as its length says."""
    if best.run is not None:
        worth = (1.0 - WORTH) * seconds_until_home(best.run)
        return better(run, best.run) and seconds_until_home(run) < worth
    least = best.tour.length / best.mission.speed
    return run.summary["visited"] >= len(best.tour.stops) and seconds_until_home(run) < least


def _good(run: Run) -> bool:
    """Whether a flight came home free, and never exceeded the limit."""
    return bool(run.summary["home"]["tether_free"]) and run.summary["exceedance_s"] == 0.0


def tour_of_flight(
    mission: Mission, order: tuple[int, ...], run: Run, field: DistanceField,
    water: Water | None = None, bound: float | None = None, seed: int = 0, name: str = GOING_ON,
) -> SolvedMission | None:  # fmt: skip
    """Where a robot was on a flight, made the tour of its mission.

    Parameters
    ----------
    mission : Mission
        What was flown.
    order : tuple of int
        Numbers of its waypoints in the mission that it came of.
    run : Run
        The flight.
    field : DistanceField
        Of the scene.
    water : Water, optional
        Whose words the stops get, when it is at hand.
    bound : float, optional
        Of all tours through the waypoints, metres. A robot that turns back a bit before them goes
        less, by twice as much as it stays away, and once at home.
    seed : int
        Of what found the order.
    name : str
        Of what found it.

    Returns
    -------
    SolvedMission or None
        The mission with the tour; None where the robot did not come home free or went where it has
        not its clearance, or the tether was over the limit.
    """
    if not _good(run):
        return None
    stops = run.summary["stops"]
    visited = [int(stop["waypoint"]) for stop in stops]
    left = [k for k in range(len(order)) if k not in visited]
    parts = _parts(run.log, visited)
    legs = [np.array([[r.x, r.y, r.z] for r in part]) for part in parts]
    path = np.vstack([legs[0][:1], *(leg[1:] for leg in legs)])
    if not all(has_room(field, leg, mission) for leg in legs):
        return None
    water = water or Water.of(mission, mission.load_scene(), field)
    planned_stops = []
    for k, stop in enumerate(stops):
        word = water.words.word(np.vstack([water.present.nodes, *legs[: k + 1]]))
        planned_stops.append(
            PlannedStop(
                path=in_file(legs[k]), signature=word, tether_length=stop["tether"],
                longest_tether=max(r.tether for r in parts[k]),
                given_as=order[visited[k]],
            )
        )  # fmt: skip
    length = along(path)
    if bound is not None:
        ends = np.array([leg[-1] for leg in legs[:-1]]).reshape(-1, 3)
        off = np.linalg.norm(ends - mission.places[visited].reshape(-1, 3), axis=1)
        short_of_home = float(np.linalg.norm(legs[-1][-1] - np.array(mission.start)))
        bound = min(length, max(0.0, bound - 2.0 * float(off.sum()) - short_of_home))
    tour = PlannedTour(
        stops=tuple(planned_stops), home=in_file(legs[-1]), status=Status.FEASIBLE, solver=name,
        seed=seed, length=length, bound_of_all=bound, gap_to_all=relative_gap(length, bound),
        states=len(visited), legs=len(legs),
        exact=water.words.exact,
    )  # fmt: skip
    chosen = [*visited, *left]
    there = mission.model_copy(
        update={"waypoints": tuple(mission.waypoints[k] for k in chosen), "tour": tour}
    )
    return SolvedMission(there, tuple(order[k] for k in chosen), None, None, None)


def _parts(log: tuple[LogRow, ...], visited: list[int]) -> list[tuple[LogRow, ...]]:
    """A log from each waypoint that was visited to the next, and home; two rows at least."""
    next_one = np.array([r.waypoint for r in log])
    ends = [int(np.argmax(next_one > k)) for k in visited]
    cuts = [0, *ends, len(log) - 1]
    return [log[a : b + 1] if b > a else (log[a], log[a]) for a, b in pairwise(cuts)]


def better(run: Run, than: Run) -> bool:
    """Whether a flight is better than another of the same mission.

    Parameters
    ----------
    run : Run
        A flight.
    than : Run
        The other.

    Returns
    -------
    bool
        It visits as many waypoints, is not longer over the limit, comes home as free, and is home
        earlier.
    """
    a, b = run.summary, than.summary
    return bool(
        a["visited"] >= b["visited"]
        and a["exceedance_s"] <= b["exceedance_s"]
        and a["home"]["tether_free"] >= b["home"]["tether_free"]
        and seconds_until_home(run) < seconds_until_home(than)
    )


def seconds_until_home(run: Run) -> float:
    """Of a flight.

    Parameters
    ----------
    run : Run
        The flight.

    Returns
    -------
    float
        Seconds of inspection and way home.
    """
    return float(run.summary["inspection_s"] + run.summary["home"]["seconds"])

"""Flights of a mission in several orders, and the tours that they make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.base.geometry import polylines
from netsp.hsignature.words import Word
from netsp.model.solution import Status
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_policy import MissionPolicy
from netsp.plan.space.passages import GapResolution
from netsp.plan.space.planning_context import PlanningContext, keeps_clearance
from netsp.plan.space.space_plan import SpacePlan
from netsp.world.mission.mission import Mission
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
    def shortfall(self) -> float:
        """Return the length, in metres, that the tour saves because the robot turns back before it
        is at a waypoint, as a flight does within reach: twice the distance that remains at each
        waypoint, and once that at home."""
        tour, mission = self.tour, self.mission
        remaining = sum(
            float(np.linalg.norm(np.subtract(stop.path[-1], place)))
            for stop, place in zip(tour.stops, mission.places, strict=False)
        )
        return 2.0 * remaining + float(np.linalg.norm(np.subtract(tour.home[-1], mission.start)))

    @property
    def length_to_waypoints(self) -> float:
        """Return an upper bound on the length of the tour if it went to the waypoints themselves,
        metres. Tours and flights are compared by it."""
        return self.tour.length + self.shortfall

    @property
    def left_out(self) -> tuple[int, ...]:
        """Return the original numbers of the waypoints that the tour does not visit."""
        return self.order[len(self.tour.stops) :]


@dataclass
class Flights:
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


def is_good(run: Run) -> bool:
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
    if not is_good(run):
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
        exact=context.words.exact if context.has_words else None,
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
    """Return the visits of a flight, with their words if the context has words; None if the path to
    one has no word."""
    visits, words = [], list[Word | None]()
    for k, stop in enumerate(run.summary["stops"]):
        visit = PlannedVisit(
            path=thinned_path(legs[k]),
            tether_length=stop["tether"],
            longest_tether=max(r.tether for r in parts[k]),
            given_as=order[int(stop["waypoint"])],
        )
        visits.append(visit)
    if not context.has_words:
        return tuple(visits)
    words = context.words_along(legs[: len(visits)])
    if None in words:
        return None
    return tuple(
        visit.model_copy(update={"signature": word})
        for visit, word in zip(visits, words, strict=True)
    )


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

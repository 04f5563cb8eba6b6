"""Incumbent of a planned mission: the best tour so far that the judge has passed.

Tours are compared by their length to the waypoints themselves, which does not depend on how much
time there is. So more time never replaces a tour by a longer one. A flight can only refuse a tour.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from netsp.base.errors import LimitReachedError
from netsp.plan.space.mission_flights import (
    GOING_ON,
    Flights,
    SolvedMission,
    is_good,
    seconds_until_home,
)
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.space_plan import AS_GIVEN, PLANE, SHORT_ORDER
from netsp.plan.space.state_search import LENGTH_ROUNDING
from netsp.world.mission.run_log import Run


@dataclass
class Incumbents:
    """Incumbent of a run. It accepts no tour that the judge refuses.

    Attributes
    ----------
    flights
        Flights of the mission.
    first
        Shortest tour in the order of the file that passes the judge. A tour that is longer, or home
        later, is not accepted.
    given
        Flight of the mission as it was given.
    best
        The incumbent.
    """

    flights: Flights
    first: SolvedMission | None = None
    given: Run | None = None
    best: SolvedMission | None = None

    def accept_first(self, found: SolvedMission) -> bool:
        """Accept a tour in the order of the file if it passes the judge; return whether it does."""
        if not self.flights.judged(found.mission):
            return False
        if self.first is None or _is_shorter(found, self.first):
            self.first = found
        if self.best is None or _is_shorter(found, self.best):
            self.best = found
        return True

    def keep_given_flight(self, run: Run | None) -> None:
        """Keep the flight of the mission as it was given, unless it was cut short."""
        self.given = run or self.given

    def offer(self, found: SolvedMission, name: str) -> None:
        """Accept a tour if it passes the judge and is better than the incumbent."""
        best = self.best
        if best is not None and not self._may_be_better(found, best):
            return
        try:
            if not self.flights.judged(found.mission):
                return
        except LimitReachedError:
            if best is None:
                raise
            return
        run, _ = self.flights.fly(found.mission, name)
        found = replace(found, run=run)
        if self._needs_flight(found) and (found.run is None or not is_good(found.run)):
            return
        if best is None or self._is_better(found):
            self.best = found

    def add_words(self, context: PlanningContext) -> None:
        """Add the words of a scene, once they are known, to the tours that were found without them.

        A tour that has no word, or whose word at the end is not empty, is given up.
        """
        self.flights.context, self.flights.mission = context, context.mission
        first = None if self.first is None else _with_words(self.first, context)
        if self.best is not self.first and self.best is not None:
            self.best = _with_words(self.best, context) or first
        else:
            self.best = first
        self.first = first

    def fly_best(self) -> None:
        """Fly the incumbent as it will be written, if it has not been flown."""
        best = self.best
        if best is not None and best.run is None:
            run, _ = self.flights.fly(best.mission, "it as it will be written")
            self.best = replace(best, run=run)
            self.first = self.best if best is self.first else self.first

    def _needs_flight(self, found: SolvedMission) -> bool:
        """Return whether a tour counts only with a flight, because it needs the part of the tether
        that plans reserve for steering."""
        limit = self.flights.policy.tether_share * self.flights.mission.tether_length
        in_plane = found.plan is not None and found.plan.kind == PLANE
        return in_plane and found.tour.longest_tether > limit

    def _time_until_home_s(self, found: SolvedMission) -> float | None:
        """Return the seconds until home of a tour, None if it was not flown. For the order of the
        file, the flight as given counts."""
        if found.run is not None:
            return seconds_until_home(found.run)
        if found is self.first and self.given is not None and is_good(self.given):
            return seconds_until_home(self.given)
        return None

    def _may_be_better(self, found: SolvedMission, best: SolvedMission) -> bool:
        """Return whether a tour visits more waypoints than the incumbent, or as many and is
        shorter.

        A tour by going straight on must save more, because it has no bound. Of two tours that are
        as long, the one with the higher bound is better.
        """
        without_bound = (GOING_ON, AS_GIVEN, SHORT_ORDER)
        by_going_on = found.tour.solver == GOING_ON and best.tour.solver not in without_bound
        min_saving = self.flights.policy.min_saving if by_going_on else 0.0
        return _is_shorter(found, best, min_saving) or (
            _has_higher_bound(found, best) and not _is_shorter(best, found)
        )

    def _is_better(self, found: SolvedMission) -> bool:
        """Return whether a tour that passed the judge, and may be better, is not refused by its
        flight."""
        if found.run is not None and not is_good(found.run):
            return False
        first = self.first
        if first is None or len(found.tour.stops) > len(first.tour.stops):
            return True
        seconds, first_seconds = self._time_until_home_s(found), self._time_until_home_s(first)
        return (
            seconds is None
            or first_seconds is None
            or seconds <= first_seconds * (1.0 + LENGTH_ROUNDING)
        )


def _is_shorter(found: SolvedMission, best: SolvedMission, min_saving: float = 0.0) -> bool:
    """Return whether a tour visits more waypoints than another, or as many and is shorter by more
    than a share of the other's length."""
    if len(found.tour.stops) != len(best.tour.stops):
        return len(found.tour.stops) > len(best.tour.stops)
    factor = 1.0 - max(min_saving, LENGTH_ROUNDING)
    return found.length_to_waypoints < factor * best.length_to_waypoints


def _has_higher_bound(found: SolvedMission, best: SolvedMission) -> bool:
    """Return whether more is proven of a tour's states and legs than of another's."""
    bound, best_bound = found.tour.lower_bound, best.tour.lower_bound
    return bound is not None and (best_bound is None or bound > best_bound)


def _with_words(found: SolvedMission, context: PlanningContext) -> SolvedMission | None:
    """Return a solved mission with the words of its tour; None if the tour has none, or its tether
    is not free by them."""
    tour, mission = found.tour, context.mission
    legs = [np.array(stop.path) for stop in tour.stops]
    to_start = context.start_tether.nodes[::-1]
    *words, at_end = context.words_along([*legs, np.vstack([np.array(tour.home), to_start])])
    if None in words or at_end != ():
        return None
    tour = tour.model_copy(
        update={
            "stops": tuple(
                stop.model_copy(update={"signature": word})
                for stop, word in zip(tour.stops, words, strict=True)
            ),
            "exact": context.words.exact,
            "unresolved_gaps": context.unresolved_gaps,
        }
    )
    update = {"tour": tour, "cell": mission.cell}
    return replace(found, mission=found.mission.model_copy(update=update))

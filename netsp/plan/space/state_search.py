"""Search for tours along states and legs of a mission.

Vertices of the travel graph are states (`netsp.plan.space.states`), and its edges are legs
(`netsp.plan.space.space_legs`). States and legs grow in stages; after each, the graph is solved,
and the shortest tour is driven. If the tether exceeds its limit, or is not free at the end, the
first leg that did not arrive in its state is forbidden, and the graph is solved again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from netsp.base.clock import Clock
from netsp.base.errors import InputError, counted
from netsp.gtsp.travel.result import Result
from netsp.model.solution import Status
from netsp.plan.space.board import DrivenTour, StateGraph, with_status
from netsp.plan.space.mission_policy import StageTimePolicy, StateEffort
from netsp.plan.space.non_taut_moves import Detours
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.space_legs import RobotPaths, StateGrowth
from netsp.plan.space.states import (
    States,
    add_first_states,
    add_states_with_room,
    find_first_states,
)
from netsp.plan.space.trees import add_states_of_trees
from netsp.world.mission.mission import Mission

LENGTH_ROUNDING = 1e-9
"""Tolerance for the rounding of lengths, relative."""


@dataclass(frozen=True)
class SearchRun:
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


FAST_SOLVER = "lns"
"""Solver of a graph with states around a tour, instead of `auto`: a search without a proof."""

FIRST_STATES = "shortest tethers to each waypoint"
"""Name of the search for the first states in progress messages."""


def find_states(run: SearchRun, effort: StateEffort, clock: Clock) -> States:
    """Return the first states.

    Raises
    ------
    InputError
        No tether reaches any waypoint.
    """
    context, mission, share = run.context, run.mission, run.context.policy.tether_share
    # a robot that is farther out than the share may still come back
    present = context.present_tether.length * (1.0 + LENGTH_ROUNDING)
    limit = max(share * mission.tether_length, present)
    run.on_progress(FIRST_STATES)
    states = find_first_states(context, run.places, limit, effort, clock)
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


class StateSearch:
    """Search for tours along states and legs, which may be resumed with more time.

    Parameters
    ----------
    run : SearchRun
        The run.

    Attributes
    ----------
    best
        Best tour so far that was driven, with the result of the solver; None if there is none.
    is_complete
        Whether all legs were found in some stage of growth.
    """

    def __init__(self, run: SearchRun) -> None:
        self.run = run
        self.effort = run.context.policy.states.effort(len(run.places))
        part = run.clock.part(run.times.first_states_share)
        self.states = find_states(run, self.effort, part)
        self._lacks_first_states = part.is_up
        self.paths = RobotPaths(run.context, run.places, self.effort)
        self.board = StateGraph(run.context, self.states)
        self.growth = StateGrowth(self.states, self.paths)
        self._paths_in_trees, self._lacks_trees = 0, True
        self.best: tuple[Result, DrivenTour] | None = None
        self.is_complete = False
        self._solved: tuple[int, int] | None = None
        self._set_tethers()

    def resume(self, run: SearchRun) -> None:
        """Go on with a run that has more time. What was found is kept; what was cut short is done
        again."""
        self.run = run
        if self._lacks_first_states:
            run.on_progress(FIRST_STATES)
            part = run.clock.part(run.times.first_states_share)
            add_first_states(self.states, self.effort, part)
            self._lacks_first_states = part.is_up
            self._set_tethers()
        if self.best is not None:
            # what was proven of the graph before says nothing of the one that comes
            result, driven = self.best
            self.best = replace(result, status=Status.FEASIBLE, lower_bound=None), driven

    def _set_tethers(self) -> None:
        """Give the tethers of the first states to the robot's paths."""
        self.paths.tethers = {
            n: [self.states.entries[s].tether.nodes for s in numbers]
            for n, numbers in self.states.at_place.items()
        }

    def connect(self) -> None:
        """Find the robot's paths, and legs between the first states and those along trees."""
        run, times, board = self.run, self.run.times, self.board
        clock, on_progress = run.clock, run.on_progress
        self.paths.find_all(clock, on_progress)
        if self._lacks_trees or self.paths.count > self._paths_in_trees:
            on_progress("trees of legs")
            part = clock.part(times.tree_share)
            add_states_of_trees(self.states, self.paths, part)
            self._paths_in_trees, self._lacks_trees = self.paths.count, part.is_up
        board.update(self.growth.legs, clock.part(times.home_path_share))
        if missing := set(range(len(run.mission.waypoints))) - board.reached_waypoints:
            on_progress("paths with room for the robot")
            part = clock.part(times.first_states_share)
            add_states_with_room(self.states, missing, self.effort.words, part)
            board.update(self.growth.legs, clock.part(times.home_path_share))
        self.growth.queue_new_paths()
        self.growth.grow(0, clock.part(times.tree_share), on_progress)

    def tours_along_taut_legs(self) -> Iterator[tuple[Result, DrivenTour]]:
        """Grow states and legs in stages, and yield each tour along them that is shorter than those
        before. The last one is `best`, too; `is_complete` says whether all legs were found in some
        stage."""
        run, times, board = self.run, self.run.times, self.board
        on_progress, options = run.on_progress, run.options
        words = run.context.words
        self.growth.by_words = words.exact and words.group.rank > 0
        needs_no_detours = self.growth.by_words and not self.states.has_free_ends
        clock = run.clock if needs_no_detours else run.clock.part(times.taut_share)
        self.is_complete = False
        # legs that are not driven take little time, so the fewest states are not worth a stage
        stages = self.effort.states[1:] if self.growth.by_words else ()
        for max_per_place in stages or self.effort.states:
            begin = clock.elapsed
            growth_s = times.growth_share * clock.planned_left
            has_time = board.legs or growth_s >= times.min_growth_s
            growing = clock.part(times.growth_share) if has_time else Clock(times.min_growth_s)
            has_grown = self.growth.grow(max_per_place, growing, on_progress)
            on_progress("paths by way of the anchor")
            has_homes = self._update_board(clock)
            self.is_complete = (has_homes and has_grown) or self.is_complete
            is_last = max_per_place == self.effort.states[-1]
            share = times.solve_share if is_last else times.early_solve_share
            yield from self._solve(clock, share, options if is_last else self._fast_options)
            yield from self._surround_tours(clock)
            if clock.planned_left < clock.elapsed - begin:
                if not is_last and not self._is_optimal:
                    yield from self._solve(clock, times.solve_share, options)
                break

    @property
    def _fast_options(self) -> dict[str, Any]:
        """Return the options of the solver while states are still added.

        Where legs are not driven, proofs soon take too long, because there are many states.
        """
        options = self.run.options
        if not self.growth.by_words or options["solver"] != "auto":
            return options
        return {**options, "solver": FAST_SOLVER}

    def _update_board(self, clock: Clock) -> bool:
        """Give the legs so far to the board; return whether there was time for all paths from the
        start."""
        part = clock.part(self.run.times.home_path_share)
        by_words = self.growth.by_words
        return self.board.update(self.growth.legs, part, only_from_start=by_words)

    def correct(self, tour: Sequence[int], clock: Clock) -> bool:
        """Drive the legs of a tour that are known by words alone, each by itself, and give the
        corrected legs to the board; return whether any was wrong."""
        if not self.growth.by_words or not self.growth.correct(tour):
            return False
        self._update_board(clock)
        return True

    def _surround_tours(self, clock: Clock) -> Iterator[tuple[Result, DrivenTour]]:
        """Add the states around the best tour, and solve again, until no states are new, or the
        time is up; yield each shorter tour.

        A tour among few states per place is often a short order with the tether on a wrong side of
        some solids. States around it hold the tours that pass one of them otherwise.
        """
        policy, run = self.run.context.policy.states, self.run
        while self.growth.by_words and self.best is not None and not clock.is_up:
            room = policy.max_with_surrounding - len(self.states.entries)
            run.on_progress("states around the tour")
            tour, count = self.best[1].tour, min(policy.max_surrounding, room)
            if not self.growth.surround(tour, count, clock):
                return
            self._update_board(clock)
            yield from self._solve(clock, run.times.surround_share, self._fast_options)

    @property
    def _is_optimal(self) -> bool:
        """Return whether the best tour is the shortest along the states and legs found."""
        return self.best is not None and self.best[0].status is Status.OPTIMAL_OF_STATES

    def _solve(
        self, clock: Clock, share: float, options: dict[str, Any]
    ) -> Iterator[tuple[Result, DrivenTour]]:
        """Solve the graph and drive its tour, unless that was done for the same graph; yield the
        tour if it is shorter than the best before."""
        graph = len(self.states.entries), len(self.growth.legs.arrives)
        if self._is_optimal and self._solved == graph:
            return
        found = _best_driven(self, clock, share, options)
        before = self.best
        self.best, self._solved = _better(before, found), graph
        if self.best is not None and (
            before is None or self.best[1].length < before[1].length * (1.0 - LENGTH_ROUNDING)
        ):
            yield self.best

    def shorter(self, best: DrivenTour | None, is_proven: bool) -> DrivenTour | None:
        """Return a shorter tour with detours, if there is one.

        If words distinguish all states, detours lead to the tethers that straight legs lead to.
        """
        if (is_proven or self.growth.by_words) and not self.states.has_free_ends:
            return None
        run = self.run
        return Detours(self.board, self.paths).shorten(best, run.clock, run.on_progress, run.seed)


def _better(
    best: tuple[Result, DrivenTour] | None, found: tuple[Result, DrivenTour] | None
) -> tuple[Result, DrivenTour] | None:
    """Return the shorter of two tours; of equals the second, because more was known when it was
    found."""
    if best is None or (found is not None and found[1].length <= best[1].length):
        return found
    return best


def _best_driven(
    search: StateSearch, clock: Clock, share: float, options: dict[str, Any]
) -> tuple[Result, DrivenTour] | None:
    """Return the best tour that was driven without fault.

    As long as there is time, the graph is solved again without the legs at fault; then those legs
    are replaced by paths through the start.
    """
    board, on_progress, times = search.board, search.run.on_progress, search.run.times
    n_solves, found = 0, None
    warm_start = None if search.best is None else search.best[1].tour
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
        if not clock.is_up and search.correct(tour, clock):
            n_solves, found = n_solves + 1, None
            continue
        driven = board.drive(tour)
        if driven.fault is None:
            return with_status(result, driven), driven
        is_joined = board.forbid(driven.fault)
        if clock.is_up and not (is_joined and board.can_reach_all(tour)):
            return None  # no time is left, and this tour can no longer be driven
        warm_start = None  # it may contain the forbidden leg
        n_solves += 1
        if not clock.is_up:
            found = None
    return None

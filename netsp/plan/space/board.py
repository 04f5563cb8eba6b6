"""Travel graph of a mission: states, legs and paths through the start, without the forbidden
ones."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.gtsp.travel.result import Result
from netsp.model.bound_scope import LowerBound, Scope
from netsp.model.solution import Status
from netsp.plan.solve_problem import solve_graph
from netsp.plan.space.planning_context import PlanningContext, max_corner_dip
from netsp.plan.space.space_legs import DrivenLegs
from netsp.plan.space.states import States, hang_alike
from netsp.roadmap.from_state import from_state
from netsp.roadmap.travel_graph import TravelGraph


@dataclass(frozen=True)
class TourVisit:
    """Visit of a waypoint in a tour.

    Attributes
    ----------
    waypoint
        Number of the waypoint.
    choice
        Number of its alternative, from 1 on; 0 for the position of the waypoint itself.
    word
        Word of the tether there; None if the words of the scene are not known.
    tether_length
        Length of the tether there, metres.
    path
        (k, 3) path of the robot from the visit before, metres.
    longest_tether
        Maximum length of the tether on that path, metres.
    """

    waypoint: int
    choice: int
    word: tuple[int, ...] | None
    tether_length: float
    path: Floats
    longest_tether: float


@dataclass(frozen=True)
class DrivenTour:
    """Tour along which the tether was driven.

    Attributes
    ----------
    tour
        States in their order.
    visits
        The visits with their paths.
    home
        (k, 3) path from the last visit to the start, metres.
    length
        Length of the tour, metres.
    free
        Whether the tether lay at the end as it does at the start.
    fault
        Two states, -1 for the start, whose leg is to blame for a tether over its limit, or one that
        is not free at the end.
    is_plane_optimum
        Whether the tour is proven to be the shortest of the plane, among upright prisms.
    """

    tour: list[int]
    visits: list[TourVisit]
    home: Floats
    length: float
    free: bool
    fault: tuple[int, int] | None
    is_plane_optimum: bool = False


@dataclass
class StateGraph:
    """States and the robot's paths between them.

    Attributes
    ----------
    context, states
        Context of the mission, and the states so far.
    legs
        Paths (k, 3) from the state with the lower number to the other, metres.
    """

    context: PlanningContext
    states: States
    legs: dict[tuple[int, int], Floats] = field(default_factory=dict)
    # path from the start along the tether of each state; None if the robot has no room there
    _paths_out: list[Floats | None] = field(default_factory=list)
    # states without a path, because the time was up
    _skipped: list[int] = field(default_factory=list)
    # length of the shortest path from the start to each state, metres; inf if there is none
    _home_lengths: list[float] = field(default_factory=list)
    # state before on that path, for states without a path along their tether
    _via_state: dict[int, int] = field(default_factory=dict)
    # legs that arrive in one direction only: whether that is from the lower number to the higher
    _directions: dict[tuple[int, int], bool] = field(default_factory=dict)
    # pairs of states whose leg is forbidden, and those whose path through the start is, too
    _forbidden: set[tuple[int, int]] = field(default_factory=set)
    _forbidden_via_start: set[tuple[int, int]] = field(default_factory=set)

    def update(self, legs: DrivenLegs, clock: Clock, *, only_from_start: bool = False) -> bool:
        """Replace the legs, and find paths from the start to new states.

        Parameters
        ----------
        clock : Clock
            When it is up, only the first state of each waypoint gets a path from the start.
        only_from_start : bool
            Whether states that were not found by a search from the start get no path of their own:
            the robot gets to them through other states.

        Returns
        -------
        bool
            Whether there was time for the paths to all states.
        """
        is_complete = True
        known = len(self._paths_out)
        self._paths_out += [None] * (len(self.states.entries) - known)
        skipped, self._skipped = self._skipped, []
        for v in (*skipped, *range(known, len(self.states.entries))):
            # each waypoint needs one path, even if the time is up
            is_complete = is_complete and not clock.is_up
            is_first = self.states.at_place[self.states.entries[v].place][0] == v
            is_wanted = not only_from_start or v in self.states.from_start
            if (is_complete and is_wanted) or is_first:
                self._paths_out[v] = self._path_along_tether(v)
            else:
                self._skipped.append(v)
        if self.states.present is not None and self._paths_out[self.states.present] is None:
            # the robot is at this state, and may go back along its tether whatever the clearance
            self._paths_out[self.states.present] = np.vstack(
                [self.context.start_tether.nodes[::-1], self.context.present_tether.nodes[1:]]
            )
        legs_by_pair = dict[tuple[int, int], Floats]()
        self._directions = {}
        for v, w, path, has_reverse in legs.both_directions():
            pair = (min(v, w), max(v, w))
            if pair not in self._forbidden:
                legs_by_pair[pair] = path if v < w else path[::-1]
                if not has_reverse:
                    self._directions[pair] = v < w
        self._measure_paths_home(legs_by_pair)
        self.legs = {
            (v, w): path
            for (v, w), path in legs_by_pair.items()
            if polylines.length(path) < self._home_lengths[v] + self._home_lengths[w]
            or self._via_state.get(v) == w
            or self._via_state.get(w) == v
        }
        return is_complete

    def _path_along_tether(self, v: int) -> Floats | None:
        """Return the path from the start along the tether of a state, pulled taut in its class;
        None if the robot has no room there, because a tether fits through narrower gaps."""
        tether = self.states.entries[v].tether
        line = np.vstack([self.context.start_tether.nodes[::-1], tether.nodes[1:]])
        return self.context.pull_taut_nearby(line)

    def _measure_paths_home(self, legs: dict[tuple[int, int], Floats]) -> None:
        """Measure the shortest path from the start to each state: along its tether or, if the robot
        has no room there, through other states."""
        legs_from: dict[int, list[tuple[int, float]]] = {}
        for (v, w), path in legs.items():
            if (v, w) in self._directions:
                continue
            length = polylines.length(path)
            legs_from.setdefault(v, []).append((w, length))
            legs_from.setdefault(w, []).append((v, length))
        self._home_lengths = [
            np.inf if path is None else polylines.length(path) for path in self._paths_out
        ]
        self._via_state = {}
        waiting = [
            (length, v) for v, length in enumerate(self._home_lengths) if np.isfinite(length)
        ]
        heapq.heapify(waiting)
        while waiting:
            length, v = heapq.heappop(waiting)
            if length > self._home_lengths[v] or not self._has_clearance(v):
                continue
            for w, leg in legs_from.get(v, ()):
                if self._paths_out[w] is None and length + leg < self._home_lengths[w]:
                    self._home_lengths[w], self._via_state[w] = length + leg, v
                    heapq.heappush(waiting, (length + leg, w))

    def _has_clearance(self, v: int) -> bool:
        """Return whether paths to other states may lead through a state: its waypoint may be nearer
        to solids than the clearance, but other paths may not."""
        place = self.states.places.points[self.states.entries[v].place]
        mission = self.context.mission
        min_distance = mission.clearance - max_corner_dip(mission.delta)
        return float(self.context.field.distance(place)) >= min_distance

    @property
    def reached_waypoints(self) -> set[int]:
        """Return the numbers of the waypoints that the robot can get to."""
        places = self.states.places
        count = len(self.context.mission.waypoints)
        found = {
            int(places.waypoint[s.place])
            for s, length in zip(self.states.entries, self._home_lengths, strict=False)
            if np.isfinite(length)
        }
        return {n for n in found if n < count}

    def path(self, v: int, w: int) -> Floats:
        """Return the path (k, 3) from one state to another, -1 for the start, metres."""
        if v < 0:
            return self._path_out(w)
        if w < 0:
            return self._path_out(v)[::-1]
        direct = self.legs.get((min(v, w), max(v, w)))
        if direct is None:
            return np.vstack([self._path_out(v)[::-1], self._path_out(w)[1:]])
        return direct if v < w else direct[::-1]

    def path_out(self, v: int) -> Floats | None:
        """Return the path (k, 3) from the start to a state, metres; None if the robot cannot get
        there."""
        return self._path_out(v) if np.isfinite(self._home_lengths[v]) else None

    def _path_out(self, v: int) -> Floats:
        """Return the path (k, 3) from the start to a state that the robot can get to."""
        path = self._paths_out[v] if v >= 0 else self.context.start_tether.nodes[-1:]
        if path is not None:
            return path
        u = self._via_state[v]
        leg = self.legs[min(u, v), max(u, v)]
        return np.vstack([self._path_out(u), (leg if u < v else leg[::-1])[1:]])

    def forbid(self, pair: tuple[int, int]) -> bool:
        """Remove the leg between two states, the lower number first, or their path through the
        start if there is no leg; return whether the states are still connected."""
        if self.legs.pop(pair, None) is None:
            self._forbidden_via_start.add(pair)
        else:
            self._measure_paths_home(self.legs)
        self._forbidden.add(pair)
        return pair not in self._forbidden_via_start

    def can_reach_all(self, tour: Sequence[int]) -> bool:
        """Return whether the robot gets from the start to every state of a tour.

        A leg that is forbidden may have been the only path to a state.
        """
        return all(np.isfinite(self._home_lengths[v]) for v in tour)

    @property
    def _reached_states(self) -> list[int]:
        """Return the states that the robot gets to."""
        return [v for v, length in enumerate(self._home_lengths) if np.isfinite(length)]

    def solve(
        self, clock: Clock, warm_start: Sequence[int] | None = None, **options: Any
    ) -> tuple[Result, list[int]] | None:
        """Solve the travel graph.

        Parameters
        ----------
        clock : Clock
            When it is up, the result is the best so far.
        warm_start : sequence of int, optional
            States of a tour.
        **options : Any
            Options of `netsp.plan.solve_problem.solve_graph`.

        Returns
        -------
        (Result, list of int) or None
            Result of the solver, and the states in the order of its tour without the state in which
            the mission begins. None if there is no tour.
        """
        usable = self._reached_states
        vertex = {v: k for k, v in enumerate(usable, 1)}
        lengths = np.array([self._home_lengths[v] for v in usable])
        costs = np.zeros((len(usable) + 1, len(usable) + 1))
        costs[1:, 1:] = lengths[:, None] + lengths[None, :]
        costs[0, 1:] = costs[1:, 0] = lengths
        for (v, w), path in self.legs.items():
            if v in vertex and w in vertex:
                costs[vertex[v], vertex[w]] = costs[vertex[w], vertex[v]] = polylines.length(path)
        for v, w in self._forbidden_via_start:
            a, b = vertex.get(v, 0), vertex.get(w, 0)
            costs[a, b] = costs[b, a] = np.inf
        places, begin = self.states.places, self.states.present
        waypoint = [int(places.waypoint[self.states.entries[v].place]) for v in usable]
        cluster = np.r_[0, 1 + np.unique(waypoint, return_inverse=True)[1]]
        try:
            graph = TravelGraph.from_costs(costs, cluster)
        except InputError:  # a waypoint has no leg left
            return None
        if begin is not None:
            graph = from_state(graph, vertex[begin])
        fixed_start = [0] if begin is None else [0, vertex[begin]]
        start = None
        if warm_start is not None and all(v in vertex for v in warm_start):
            start = [*fixed_start, *(vertex[v] for v in warm_start)]
        result = solve_graph(graph, time_limit=clock, warm_start=start, **options)
        if result.tour is None:
            return None
        return result, [usable[int(k) - 1] for k in result.tour[len(fixed_start) :]]

    def drive_out_and_back(self) -> DrivenTour | None:
        """Drive a tour that goes out to each waypoint along a taut tether, and back along the same
        path.

        The tour needs no legs between states, so it exists whenever each waypoint can be reached.

        Returns
        -------
        DrivenTour or None
            The tour, in the order of the waypoints. None if no waypoint has such a path with the
            tether within its limit and free at the end, or if the mission begins under way and its
            tether does not come free at the start.
        """
        state_of: dict[int, int] = {}
        # if the time ran out, only the first state of each waypoint has a path out
        for v, state in enumerate(self.states.entries):
            if (
                self._paths_out[v] is None
                and self.states.places.waypoint[state.place] not in self.reached_waypoints
            ):
                self._paths_out[v] = self._path_along_tether(v)
        self._measure_paths_home(self.legs)
        for v in sorted(self._reached_states, key=lambda v: self._home_lengths[v]):
            waypoint = int(self.states.places.waypoint[self.states.entries[v].place])
            if v == self.states.present or waypoint in state_of:
                continue
            if self._can_return(v):
                state_of[waypoint] = v
        if not state_of:
            return None
        without_legs = replace(self, legs={}, _directions={})
        # a path out through other states follows the legs of this board
        without_legs._paths_out = [self.path_out(v) for v in range(len(self._paths_out))]
        driven = without_legs._drive([state_of[n] for n in sorted(state_of)])
        return driven if driven.fault is None else None

    def _can_return(self, v: int) -> bool:
        """Return whether the tether keeps its limit out to a state and back, and comes free."""
        context, path = self.context, self._path_out(v)
        tether_out, longest = context.drive(context.start_tether, path, is_fine=True)
        tether_back, longest_back = context.drive(tether_out, path[::-1], is_fine=True)
        is_free = hang_alike(tether_back, context.start_tether, context.mission.delta)
        return is_free and max(longest, longest_back) <= self.states.limit

    def drive(self, tour: Sequence[int]) -> DrivenTour:
        """Drive a tour with the tether at its beginning, in the direction in which more of its legs
        were driven; if that fails, in the other. If both fail, return the first."""
        if self.states.present is not None:
            return self._drive(tour)  # a tour that begins under way has one direction
        forward, backward = list(tour), list(tour)[::-1]
        if self._count_reversed_legs(forward) > self._count_reversed_legs(backward):
            forward, backward = backward, forward
        first = self._drive(forward)
        if first.fault is None:
            return first
        second = self._drive(backward)
        return second if second.fault is None else first

    def _count_reversed_legs(self, tour: Sequence[int]) -> int:
        """Return how many legs of a tour arrive only in the other direction."""
        return sum(
            self._directions.get((min(v, w), max(v, w)), v < w) != (v < w)
            for v, w in pairwise(tour)
        )

    def _drive(self, tour: Sequence[int]) -> DrivenTour:
        """Drive a tour in the given direction."""
        states, context, places = self.states, self.context, self.states.places
        tether, previous = context.present_tether, -1 if states.present is None else states.present
        visits: list[TourVisit] = []
        total, fault, first_deviation = 0.0, None, None
        delta = context.mission.delta
        word = context.word_number(tether.nodes)
        at_home = context.word_number(context.start_tether.nodes)
        for state in [*tour, -1]:
            path = self.path(previous, state)
            tether, longest = context.drive(tether, path, is_fine=True)
            total += polylines.length(path)
            expected = context.start_tether if state < 0 else states.entries[state].tether
            pair = (min(previous, state), max(previous, state))
            leg_word = context.word_number(path)
            if word is None or leg_word is None:
                word = None
            else:
                word = context.words.multiply(word, leg_word)
            is_as_expected = word == (at_home if state < 0 else states.entries[state].word)
            # the first leg after which the tether differs from its state; it is no fault if the
            # tether agrees with a later state
            if is_as_expected and hang_alike(tether, expected, delta):
                first_deviation = None
            else:
                first_deviation = first_deviation or pair
            if fault is None and (longest > states.limit or word is None):
                fault = first_deviation or pair
            if state >= 0:
                place = states.entries[state].place
                waypoint, choice = int(places.waypoint[place]), int(places.choice[place])
                letters = () if word is None else context.words.letters(word)
                visits.append(TourVisit(waypoint, choice, letters, tether.length, path, longest))
            previous = state
        free = word == at_home and hang_alike(tether, context.start_tether, delta)
        return DrivenTour(list(tour), visits, path, total, free, fault or first_deviation)


def with_status(result: Result, driven: DrivenTour) -> Result:
    """Return the result of a solver with the status that holds for the tour that was driven.

    A driven path through the start may be longer than the solver's leg; then its bound may not
    prove the tour.
    """
    bound = result.lower_bound
    if bound is None or not LowerBound(bound, Scope.STATES).proves(driven.length):
        return replace(result, status=Status.FEASIBLE)
    return replace(result, status=Status.OPTIMAL_OF_STATES)

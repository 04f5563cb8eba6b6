"""Tours with detours: legs that are longer than necessary, so that the tether comes to hang
elsewhere.

A robot that passes half a metre farther out may leave its tether on the other side of a bar with a
free end. Pulled taut, such a leg is the straight one again, so no search for taut paths finds it,
and no word distinguishes the two.

An order is driven leg by leg along taut paths and detours. After each leg, the tethers of the
shortest paths that hang differently are kept (beam search). The first orders are that of the best
tour so far and that of the shortest tour without a tether; further ones move pieces of the best.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, product

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.plan.solve_problem import solve_graph
from netsp.plan.space.board import DrivenTour, StateGraph, TourVisit
from netsp.plan.space.detour_variants import perpendiculars
from netsp.plan.space.mission_policy import DetourPolicy
from netsp.plan.space.planning_context import is_straight_clear, keeps_clearance
from netsp.plan.space.space_legs import RobotPaths
from netsp.plan.space.states import hang_alike
from netsp.roadmap.from_state import from_state
from netsp.roadmap.travel_graph import TravelGraph
from netsp.world.tether import Tether

HOME = -1
"""Sentinel number of a place: the start."""


@dataclass(frozen=True)
class _PartialTour:
    """Beginning of a tour: its length, the tether at its end, and its last leg.

    Attributes
    ----------
    tether, in_flight
        The tether, and the tether of a robot in flight, which turns back within reach of each
        waypoint.
    word
        Number of the tether's word.
    before
        The tour without its last leg.
    place, path, longest_tether
        Where the last leg leads, its path (k, 3), metres, and the maximum length of the tether on
        it, metres.
    """

    length: float
    tether: Tether
    in_flight: Tether
    word: int
    before: _PartialTour | None = None
    place: int = HOME
    path: Floats | None = None
    longest_tether: float = 0.0

    @property
    def legs(self) -> list[_PartialTour]:
        """Return all legs in order, each as the partial tour that it completes."""
        tours, tour = [], self
        while tour.before is not None:
            tours.append(tour)
            tour = tour.before
        return tours[::-1]


@dataclass
class Detours:
    """Legs of a mission with their detours.

    Attributes
    ----------
    board
        States, and the paths from the start to them.
    paths
        The robot's paths between waypoints.
    """

    board: StateGraph
    paths: RobotPaths
    _paths_by_ends: dict[tuple[int, int], list[tuple[Floats, int]]] = field(default_factory=dict)

    @property
    def _policy(self) -> DetourPolicy:
        """Return the policy of detours."""
        return self.paths.context.policy.detours

    def shorten(
        self,
        best: DrivenTour | None,
        clock: Clock,
        on_progress: Callable[[str], None],
        seed: int = 0,
    ) -> DrivenTour | None:
        """Search for a tour that is shorter than the best so far.

        Parameters
        ----------
        best : DrivenTour, optional
            The best tour so far.
        clock : Clock
            When it is up, no more orders are driven.
        on_progress : callable
            Called with a line of text.
        seed : int
            Random seed of the solver that orders the waypoints without a tether.

        Returns
        -------
        DrivenTour or None
            The tour; None if no shorter one was found.
        """
        if clock.is_up and best is not None:
            return None
        states = self.board.states
        shortest, worth = self._shortest_lengths(clock), self.paths.context.policy.bound_worth
        orders = [] if best is None else [[states.entries[v].place for v in best.tour]]
        without_tether = self._order_without_tether(
            shortest, clock.part(self._policy.order_share), seed
        )
        orders += [] if without_tether is None else [without_tether]
        found: list[list[_PartialTour]] = []
        cutoff = np.inf if best is None else (1.0 - worth) * best.length
        for order in orders:
            for direction in (order, order[::-1]):
                if clock.is_up or (direction != order and states.present is not None):
                    continue
                on_progress(f"detours along {len(order)} legs")
                stages = self._drive_order(direction, cutoff, clock)
                if stages is not None:
                    found, cutoff = stages, (1.0 - worth) * stages[-1][0].length
        if not found and best is None:
            return None
        current = orders[0] if not found else [leg.place for leg in found[-1][0].legs[:-1]]
        found = self._move_pieces(current, found, shortest, cutoff, clock, on_progress)
        return self._to_driven_tour(found[-1][0]) if found else None

    def _move_pieces(
        self,
        current: list[int],
        found: list[list[_PartialTour]],
        shortest: Floats,
        cutoff: float,
        clock: Clock,
        on_progress: Callable[[str], None],
    ) -> list[list[_PartialTour]]:
        """Move pieces of an order as long as that makes its tour shorter, and return the partial
        tours of the best order; `found` if no order is better."""
        worth = self.paths.context.policy.bound_worth
        driven_orders: set[tuple[int, ...]] = set()
        has_moved = True
        while has_moved:
            has_moved = False
            for order in self._neighbouring_orders(current, shortest, cutoff):
                if clock.is_up or len(driven_orders) >= self._policy.max_orders:
                    break
                if tuple(order) in driven_orders:
                    continue
                driven_orders.add(tuple(order))
                on_progress(f"detours, {len(driven_orders)} orders, {cutoff:.1f} m")
                stages = self._drive_order(order, cutoff, clock, current, found)
                if stages is not None:
                    found, cutoff = stages, (1.0 - worth) * stages[-1][0].length
                    current, has_moved = order, True
                    break
        return found

    def _paths_between(self, n: int, m: int) -> list[tuple[Floats, int]]:
        """Return the paths from a place to another and their words, shortest first."""
        if (n, m) in self._paths_by_ends:
            return self._paths_by_ends[n, m]
        if m == HOME or (n != HOME and n > m):
            number = self.paths.context.word_number
            reverse = [(path[::-1], number(path[::-1])) for path, _ in self._paths_between(m, n)]
            self._paths_by_ends[n, m] = [(path, word) for path, word in reverse if word is not None]
            return self._paths_by_ends[n, m]
        context, mission = self.paths.context, self.paths.context.mission
        begin, end = self._place(n), self._place(m)
        paths = self._taut_paths(n, m)
        for path in self._detours(begin, end):
            if all(
                is_straight_clear(context.field, a, b, mission.clearance) for a, b in pairwise(path)
            ):
                paths.append(path)
        numbered = [
            (path, context.word_number(path)) for path in sorted(paths, key=polylines.length)
        ]
        self._paths_by_ends[n, m] = [(path, word) for path, word in numbered if word is not None]
        return self._paths_by_ends[n, m]

    def _taut_paths(self, n: int, m: int) -> list[Floats]:
        """Return the paths between two places without detours."""
        context, mission = self.paths.context, self.paths.context.mission
        begin, end = self._place(n), self._place(m)
        paths = [] if n == HOME else [path for _, path in self.paths.between(n, m)]
        if n == HOME:
            states = self.board.states.at_place.get(m, ())
            tether_paths = (self.board.path_out(v) for v in states[: self._policy.n_start_paths])
            paths = [path for path in tether_paths if path is not None]
        if not any(len(path) == 2 for path in paths) and is_straight_clear(
            context.field, begin, end, mission.clearance
        ):
            paths.append(np.array([begin, end]))
        return [path for path in paths if keeps_clearance(context.field, path, mission)]

    def _detours(self, begin: Floats, end: Floats) -> Iterator[Floats]:
        """Yield paths with one bend, out in all directions from the middle of the straight path."""
        effort, step = self.paths.effort, end - begin
        straight_length = float(np.linalg.norm(step))
        if straight_length < 1e-9:
            return
        u, v = perpendiculars(step)
        for extra in effort.detours:
            offset = 0.5 * straight_length * math.sqrt((1.0 + extra) ** 2 - 1.0)
            for angle in np.linspace(0.0, 2.0 * math.pi, effort.detour_directions, endpoint=False):
                bend = offset * (math.cos(angle) * u + math.sin(angle) * v)
                yield np.array([begin, begin + 0.5 * step + bend, end])

    def _place(self, n: int) -> Floats:
        """Return the position (3,) of a place, metres."""
        return self.paths.context.start_tether.robot if n == HOME else self.paths.points[n]

    def _shortest_lengths(self, clock: Clock) -> Floats:
        """Return the lengths (n + 1, n + 1) of the shortest paths between places, the start last,
        metres; infinite if no path is known, or if there is no time to test the lines of sight of
        places far apart."""
        count = len(self.paths.points)
        search_clock = clock.part(self._policy.order_share)
        lengths = np.full((count + 1, count + 1), np.inf)
        for m in range(count):
            for n in (HOME, *range(m)):
                known = self.paths.between(n, m) if n != HOME else []
                length = polylines.length(known[0][1]) if known else np.inf
                if not known and not search_clock.is_up:
                    length = min(map(polylines.length, self._taut_paths(n, m)), default=np.inf)
                lengths[n, m] = lengths[m, n] = length
        return lengths

    def _order_without_tether(self, shortest: Floats, clock: Clock, seed: int) -> list[int] | None:
        """Return the places in the order of the shortest tour without a tether."""
        places, reached = self.paths.places, self.board.reached_waypoints
        numbers = [
            n for n in range(len(places)) if n == places.present or places.waypoint[n] in reached
        ]
        rows = np.array([HOME, *numbers])
        cluster = np.r_[0, 1 + np.unique(places.waypoint[numbers], return_inverse=True)[1]]
        costs = shortest[np.ix_(rows, rows)].copy()
        np.fill_diagonal(costs, 0.0)
        try:
            graph = TravelGraph.from_costs(costs, cluster)
        except InputError:  # a waypoint has no leg
            return None
        first = 1
        if places.present is not None:
            graph = from_state(graph, 1 + numbers.index(places.present))
            first = 2
        result = solve_graph(graph, "auto", time_limit=clock, seed=seed)
        return None if result.tour is None else [int(rows[v]) for v in result.tour[first:]]

    def _neighbouring_orders(
        self, order: Sequence[int], shortest: Floats, cutoff: float
    ) -> Iterator[list[int]]:
        """Yield the orders that result from moving or reversing a piece, shortest first without a
        tether."""
        begin = HOME if self.paths.places.present is None else self.paths.places.present
        found: set[tuple[float, tuple[int, ...]]] = set()
        for moved in _moved_pieces(list(order), self._policy.piece_lengths):
            ends = np.array([begin, *moved, HOME])
            length = float(shortest[ends[:-1], ends[1:]].sum())
            if length < cutoff:
                found.add((length, tuple(moved)))
        for _, moved_order in sorted(found):
            yield list(moved_order)

    def _drive_order(
        self,
        order: Sequence[int],
        cutoff: float,
        clock: Clock,
        similar: Sequence[int] = (),
        known: Sequence[list[_PartialTour]] = (),
    ) -> list[list[_PartialTour]] | None:
        """Drive an order, and return the partial tours kept after each leg, the whole tour last.

        Parameters
        ----------
        cutoff : float
            Length that the tour must stay below, metres.
        similar, known : sequence
            An order that was driven, and the partial tours kept after each of its legs. They are
            reused up to where the orders differ.

        Returns
        -------
        list or None
            Partial tours after each leg; None if no tour is short enough.
        """
        context, places = self.paths.context, self.paths.places
        begin = HOME if places.present is None else places.present
        ends = [begin, *order, HOME]
        legs = [self._paths_between(n, m) for n, m in pairwise(ends)]
        if not all(legs):
            return None
        rest = np.cumsum([0.0, *(polylines.length(leg[0][0]) for leg in legs[::-1])])[::-1]
        word = context.word_number(context.present_tether.nodes)
        if word is None or rest[0] >= cutoff:
            return None
        stages = [[_PartialTour(0.0, context.present_tether, context.present_tether, word)]]
        shared = 0
        while known and shared < len(order) and order[shared] == similar[shared]:
            shared += 1
            stages.append(known[shared])
        for k in range(shared, len(legs)):
            kept = self._extend(stages[k], legs[k], ends[k + 1], rest[k + 1], cutoff, clock)
            if not kept:
                return None
            stages.append(kept)
        return stages

    def _extend(
        self,
        tours: list[_PartialTour],
        paths: list[tuple[Floats, int]],
        place: int,
        rest: float,
        cutoff: float,
        clock: Clock,
    ) -> list[_PartialTour]:
        """Return the partial tours kept after another leg.

        Parameters
        ----------
        rest : float
            Minimum length of the legs after it, metres.
        cutoff : float
            Length that the whole tour must stay below, metres.
        """
        context, states, is_last = self.paths.context, self.board.states, place == HOME
        candidates = sorted(
            (tour.length + polylines.length(path), i, j)
            for i, tour in enumerate(tours)
            for j, (path, _) in enumerate(paths)
            if tour.length + polylines.length(path) + rest < cutoff
        )
        kept: list[_PartialTour] = []
        for length, i, j in candidates:
            if clock.is_up or len(kept) >= (1 if is_last else self.paths.effort.detour_tethers):
                break
            tour, (path, path_word) = tours[i], paths[j]
            word = context.words.multiply(tour.word, path_word)
            tether, longest = context.drive(tour.tether, path)
            if longest > states.limit or any(self._is_same(other, tether, word) for other in kept):
                continue
            if is_last and not self._is_free(tether, word):
                continue
            in_flight = self._tether_in_flight(tour, path, tether)
            if in_flight is not None:
                kept.append(
                    _PartialTour(length, tether, in_flight, word, tour, place, path, longest)
                )
        return kept

    def _tether_in_flight(self, tour: _PartialTour, path: Floats, after: Tether) -> Tether | None:
        """Return the tether of a robot in flight at the end of a leg; None if it does not hang as
        it should.

        In flight a robot moves in fine steps and turns back within reach of each waypoint. If the
        tether slips off something on the way, it must do so in steps of all sizes, and with bends
        that are farther out or in.
        """
        shares = np.linspace(0.0, 1.0, len(path))[1:-1, None]
        bends = path[1:-1] - (path[0] + shares * (path[-1] - path[0]))
        offsets = (
            self._policy.position_error
            * bends
            / np.maximum(np.linalg.norm(bends, axis=1, keepdims=True), 1e-9)
        )
        in_flight, does_slip = None, False
        for before in (tour.tether, tour.in_flight):
            in_flight, slipped = self._drive_finely(
                before, path, after, self._policy.drive_steps[0]
            )
            if in_flight is None:
                return None
            does_slip = does_slip or slipped
        if not does_slip:
            return in_flight
        for step, offset in product(
            self._policy.drive_steps,
            (0.0 * offsets, offsets, -offsets) if len(path) > 2 else (offsets,),
        ):
            moved_path = np.vstack([path[:1], path[1:-1] + offset, path[-1:]])
            for before in (tour.tether, tour.in_flight):
                if self._drive_finely(before, moved_path, after, step)[0] is None:
                    return None
        return in_flight

    def _drive_finely(
        self, before: Tether, path: Floats, after: Tether, step: float
    ) -> tuple[Tether | None, bool]:
        """Drive a tether in steps along a path to within reach of its end, and return it with
        whether it slipped off something; None in its place if it does not hang like `after` at the
        end."""
        context = self.paths.context
        line = np.vstack([before.robot[None], path[1:]])
        shortened = _shortened_path(line, context.mission.reach)
        step *= max(1.0, polylines.length(path) / self._policy.long_leg)
        arrived, lengths = context.model.drive(before, polylines.dense(shortened, step))
        end, longest_at_end = context.drive(arrived, np.vstack([shortened[-1:], path[-1:]]))
        longest = max(longest_at_end, float(lengths.max(initial=0.0)))
        delta = context.mission.delta
        if longest > self.board.states.limit or not hang_alike(end, after, delta):
            return None, False
        drops = -np.diff(lengths, prepend=before.length)
        return arrived, bool((drops > step + delta).any())

    def _is_same(self, tour: _PartialTour, tether: Tether, word: int) -> bool:
        """Return whether the tether of a partial tour hangs like another."""
        delta = self.paths.context.mission.delta
        return tour.word == word and hang_alike(tour.tether, tether, 0.25 * delta)

    def _is_free(self, tether: Tether, word: int) -> bool:
        """Return whether a tether lies as at the start."""
        context = self.paths.context
        has_same_word = not context.words.exact or word == context.word_number(
            context.start_tether.nodes
        )
        return has_same_word and hang_alike(tether, context.start_tether, context.mission.delta)

    def _to_driven_tour(self, tour: _PartialTour) -> DrivenTour:
        """Return a complete partial tour as a driven tour."""
        *legs, home = tour.legs
        places, letters = self.paths.places, self.paths.context.words.letters
        visits = [
            TourVisit(
                int(places.waypoint[leg.place]),
                int(places.choice[leg.place]),
                letters(leg.word),
                leg.tether.length,
                _path(leg),
                leg.longest_tether,
            )
            for leg in legs
        ]
        return DrivenTour([], visits, _path(home), tour.length, True, None)


def _shortened_path(path: Floats, shortening: float) -> Floats:
    """Return a path without its last metres, or half of it if it is no longer than twice that."""
    length = polylines.length(path)
    kept_length = max(length - shortening, 0.5 * length)
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    last = int(np.searchsorted(lengths, kept_length, side="left"))
    share = (kept_length - lengths[last - 1]) / (lengths[last] - lengths[last - 1])
    return np.vstack([path[:last], path[last - 1] + share * (path[last] - path[last - 1])])


def _path(leg: _PartialTour) -> Floats:
    """Return the path of the last leg, which only the empty tour lacks."""
    assert leg.path is not None
    return leg.path


def _moved_pieces(order: list[int], piece_lengths: Sequence[int]) -> Iterator[list[int]]:
    """Yield an order with a piece of it moved elsewhere in either direction, or reversed in
    place."""
    count = len(order)
    for size in piece_lengths:
        for i in range(count - size + 1):
            piece, others = order[i : i + size], order[:i] + order[i + size :]
            for j in range(len(others) + 1):
                yield others[:j] + piece + others[j:]
                yield others[:j] + piece[::-1] + others[j:]
    for i in range(count):
        for j in range(i + 2, count + 1):
            yield order[:i] + order[i:j][::-1] + order[j:]

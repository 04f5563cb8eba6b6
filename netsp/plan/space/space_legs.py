"""Paths of the robot between waypoints, and legs: paths along which the tether was driven."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.base.geometry import polylines
from netsp.plan.space.detour_variants import find_bent_paths
from netsp.plan.space.mission_policy import StateEffort
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext, is_straight_clear, keeps_clearance
from netsp.plan.space.states import State, States
from netsp.plan.space.word_search import WordSearch


@dataclass
class RobotPaths:
    """The robot's paths between waypoints that are near one another, by their words.

    Attributes
    ----------
    context, places
        Context of the mission, and its places.
    effort
        Maximum numbers and lengths of paths.
    tethers
        Lines (k, 3) of tethers at some places, metres. If there is no time for a search, paths are
        made of these.
    """

    context: PlanningContext
    places: Places
    effort: StateEffort
    tethers: dict[int, list[Floats]] = field(default_factory=dict)
    _known: dict[tuple[int, int], list[tuple[int, Floats]]] = field(default_factory=dict)
    # pairs of places whose paths were searched for in all classes
    _searched: set[tuple[int, int]] = field(default_factory=set)

    def __post_init__(self) -> None:
        distances = self.places.distances
        places_per_waypoint = len(distances) / np.count_nonzero(self.places.choice == 0)
        count = min(
            math.ceil(self.context.policy.states.n_neighbours * places_per_waypoint),
            len(distances) - 1,
        )
        nearest = np.argsort(distances, axis=1, kind="stable")[:, :count]
        is_near = np.zeros(distances.shape, dtype=bool)
        is_near[np.arange(len(distances))[:, None], nearest] = True
        is_near = (is_near | is_near.T) & np.isfinite(distances)
        self.neighbours: list[Ints] = [np.flatnonzero(row) for row in is_near]
        self._distances = distances

    @property
    def points(self) -> Floats:
        """Return the places (n, 3), metres."""
        return self.places.points

    def find_from(self, n: int, *, search: bool = True, tether_clock: Clock | None = None) -> None:
        """Find the paths from a place to its neighbours with greater numbers.

        Parameters
        ----------
        search : bool
            Whether to search for paths of all classes; if not, there are only straight paths and
            paths along tethers.
        tether_clock : Clock, optional
            When it is up, no more paths are made of tethers.
        """
        done = self._searched if search else self._known
        targets = [int(m) for m in self.neighbours[n] if m > n and (n, int(m)) not in done]
        if not targets:
            return
        context, words = self.context, self.context.words
        begin_cell = words.visible_cell(self.points[n])
        found, end_cells = None, dict[int, int | None]()
        if begin_cell is not None and search:
            end_cells = {m: words.visible_cell(self.points[m]) for m in targets}
            max_lengths = {
                cell: self._max_length(n, m) for m, cell in end_cells.items() if cell is not None
            }
            if max_lengths:
                found = context.search_words(True, begin_cell, self.effort.paths, max_lengths)
        for m in targets:
            paths = self._straight_path(n, m)
            if found is not None:
                self._add_searched(n, m, paths, found, end_cells[m])
            elif not (tether_clock is not None and tether_clock.is_up):
                self._add_along_tethers(n, m, paths)
            paths.sort(key=_length_of)
            if found is not None and paths:
                known = [path for _, path in paths]
                # a wall between two close waypoints makes all paths long
                shortest = max(float(self._distances[n, m]), polylines.length(known[0]))
                bent = find_bent_paths(context, known, self.effort.max_path_ratio * shortest)
                paths += self._numbered(bent)
                paths.sort(key=_length_of)
            if search:
                self._searched.add((n, m))
            self._known[n, m] = paths
            self._known[m, n] = self._numbered([path[::-1] for _, path in paths])

    def _max_length(self, n: int, m: int) -> float:
        """Return the length of the longest path between two places, metres."""
        return self.effort.max_path_ratio * float(self._distances[n, m])

    def _numbered(self, paths: Iterable[Floats]) -> list[tuple[int, Floats]]:
        """Return the paths that have a word, with its number."""
        numbered = ((self.context.word_number(path), path) for path in paths)
        return [(word, path) for word, path in numbered if word is not None]

    def _straight_path(self, n: int, m: int) -> list[tuple[int, Floats]]:
        """Return the straight path between two places and its word, if it is clear."""
        a, b, context = self.points[n], self.points[m], self.context
        if not is_straight_clear(context.field, a, b, context.mission.clearance):
            return []
        return self._numbered([self.points[[n, m]]])

    def _add_searched(
        self,
        n: int,
        m: int,
        paths: list[tuple[int, Floats]],
        found: WordSearch,
        end_cell: int | None,
    ) -> None:
        """Add the paths that a search found, pulled taut, one for each class."""
        if end_cell is None:
            return
        for _, cells in self.context.paths_to(found, end_cell):
            path = self.context.pull_taut(np.vstack([self.points[n], cells, self.points[m]]))
            word = self.context.word_number(path)
            if word is not None and all(word != w for w, _ in paths):
                paths.append((word, path))

    def _add_along_tethers(self, n: int, m: int, paths: list[tuple[int, Floats]]) -> None:
        """Add the shortest paths back along a tether of one place and out along one of another,
        pulled taut, one for each class."""
        found: dict[int, Floats] = {}
        for tether_back in self.tethers.get(n, ()):
            for tether_out in self.tethers.get(m, ()):
                path = self.context.pull_taut(np.vstack([tether_back[::-1], tether_out[1:]]))
                word = self.context.word_number(path)
                if word is None or not keeps_clearance(
                    self.context.field, path, self.context.mission
                ):
                    continue
                if word not in found or polylines.length(path) < polylines.length(found[word]):
                    found[word] = path
        for word, path in sorted(found.items(), key=_length_of):
            if len(paths) < self.effort.paths and all(word != w for w, _ in paths):
                paths.append((word, path))

    @property
    def count(self) -> int:
        """Return the number of pairs of places whose paths were searched for in all classes."""
        return len(self._searched)

    def find_all(self, clock: Clock, on_progress: Callable[[str], None]) -> None:
        """Find all paths between neighbours.

        Parameters
        ----------
        clock : Clock
            When a share of it is up, paths are made of tethers instead of a search; when another is
            up, only straight paths are found (`StageTimePolicy`).
        on_progress : callable
            Called with a line of text.
        """
        times = self.context.policy.times
        search_clock, tether_clock = clock.part(times.path_search_share), None
        for n in range(len(self.points)):
            on_progress(f"paths of the robot from waypoint {n + 1} of {len(self.points)}")
            if search_clock.is_up and tether_clock is None:
                tether_clock = clock.part(times.tether_path_share)
            self.find_from(n, search=tether_clock is None, tether_clock=tether_clock)

    def between(self, n: int, m: int) -> list[tuple[int, Floats]]:
        """Return the paths found so far from one place to another, shortest first.

        Returns
        -------
        list of (int, ndarray of shape (k, 3))
            Number of the word, and path, metres.
        """
        return self._known.get((n, m), [])


def _length_of(entry: tuple[int, Floats]) -> float:
    """Return the length of a path that comes with its word, metres."""
    return polylines.length(entry[1])


@dataclass
class DrivenLegs:
    """Legs between states, each driven with the tether of the state where it begins.

    Attributes
    ----------
    arrives
        The shortest path (k, 3) from one state to another that arrives in it, metres.
    """

    arrives: dict[tuple[int, int], Floats] = field(default_factory=dict)

    def add(self, v: int, w: int, path: Floats) -> None:
        """Add a leg along a path (k, 3), metres, unless a shorter one is known."""
        old = self.arrives.get((v, w))
        if old is None or polylines.length(path) < polylines.length(old):
            self.arrives[v, w] = path

    def both_directions(self) -> Iterator[tuple[int, int, Floats, bool]]:
        """Yield each leg once.

        A tether may hang otherwise when the robot comes back, and then arrives in another state or
        in none.

        Yields
        ------
        (int, int, ndarray, bool)
            The two states, the path from the first to the second, and whether the reverse arrives,
            too. In that case the lower number comes first, and the path is the shorter of the two.
        """
        for (v, w), path in self.arrives.items():
            reverse = self.arrives.get((w, v))
            if reverse is None:
                yield v, w, path, False
            elif v < w:
                yield v, w, min(path, reverse[::-1], key=polylines.length), True


class _QueuedLeg(NamedTuple):
    """Path that the tether of a state is to be driven along, the shortest first.

    It has a length, metres, a number that no other has, the state, the place at its end, and the
    word and nodes (k, 3) of the path.
    """

    length: float
    number: int
    state: int
    target: int
    word: int
    path: Floats


@dataclass
class StateGrowth:
    """Legs and the states that they lead to.

    The tether of each state is driven along all paths to neighbouring places, and where it arrives
    is a state, too. The shortest legs come first, so that states are found in chains of neighbours,
    and the legs known when the time is up connect them.

    Where words distinguish the states of a place, a leg need not be driven to know where it
    arrives: the word of a state times the word of a path is the word at its end, and a tether that
    is not known there yet is pulled taut, which takes a tenth of the time. Whether the tether keeps
    its limit all along such a leg is known once a tour along it is driven. Legs to a place where
    two tethers of that word hang differently are still driven.

    Attributes
    ----------
    states, paths
        The states, and the paths of the robot.
    by_words
        Whether legs arrive where their words say, and are driven only where a word does not say in
        which of several states.
    legs
        Legs so far.
    """

    states: States
    paths: RobotPaths
    by_words: bool = False
    legs: DrivenLegs = field(default_factory=DrivenLegs)
    _queue: list[_QueuedLeg] = field(default_factory=list)
    _postponed: list[_QueuedLeg] = field(default_factory=list)
    _known: int = 0
    _count: int = 0
    _shortest: dict[tuple[int, int], float] = field(default_factory=dict)
    # states, places and paths that are queued or driven already
    _queued: set[tuple[int, int, int, float]] = field(default_factory=set)
    # state of each place and word, those with several states, and those whose tether exceeds the
    # limit; used by words only
    _state_of: dict[tuple[int, int], int] = field(default_factory=dict)
    _count_by_word: int = 0
    _ambiguous: set[tuple[int, int]] = field(default_factory=set)
    _too_long: set[tuple[int, int]] = field(default_factory=set)
    # legs that were driven, as pairs of states
    _driven: set[tuple[int, int]] = field(default_factory=set)
    # states whose legs lead to states of all words already
    _surrounded: set[int] = field(default_factory=set)

    def queue_new_paths(self) -> None:
        """Queue the paths that were found since the states at their ends were queued."""
        self._queue_from(0)

    def grow(self, max_per_place: int, clock: Clock, on_progress: Callable[[str], None]) -> bool:
        """Drive legs until all are driven, or the time is up; return whether all are.

        Parameters
        ----------
        max_per_place : int
            Maximum number of states of a place.
        on_progress : callable
            Called with a line of text.
        """
        self.states.max_per_place = max_per_place
        for leg in self._postponed:
            heapq.heappush(self._queue, leg)
        self._postponed.clear()
        while self._drive_next():
            on_progress(
                f"legs, {len(self.legs.arrives)} driven between {len(self.states.entries)} states"
            )
            if clock.is_up:
                return False
        return True

    def _queue_new_states(self) -> None:
        """Queue the paths from new states."""
        self._queue_from(self._known)

    def _queue_from(self, first: int) -> None:
        """Queue the paths from a state and all later ones that are not queued yet."""
        for v in range(first, len(self.states.entries)):
            state = self.states.entries[v]
            key = state.place, state.word
            self._shortest[key] = min(state.tether.length, self._shortest.get(key, np.inf))
            for m in self.paths.neighbours[state.place]:
                for word, path in self.paths.between(state.place, int(m)):
                    length = polylines.length(path)
                    if (v, int(m), word, length) in self._queued:
                        continue
                    self._queued.add((v, int(m), word, length))
                    self._count += 1
                    heapq.heappush(
                        self._queue, _QueuedLeg(length, self._count, v, int(m), word, path)
                    )
        self._known = len(self.states.entries)

    def _drive_next(self) -> bool:
        """Drive the next leg in the queue; return whether there was one."""
        self._queue_new_states()
        if not self._queue:
            return False
        leg = heapq.heappop(self._queue)
        _, _, v, target, word, path = leg
        states = self.states
        state = states.entries[v]
        new_word = states.context.words.multiply(state.word, word)
        if not states.can_hold(target, new_word):
            self._postponed.append(leg)
            return True
        if self.by_words:
            self._add_by_word(v, target, new_word, path)
        elif self._may_fit(state, target, new_word, path) and not self._add_driven(
            v, target, new_word, path
        ):
            self._postponed.append(leg)
        return True

    def _add_driven(self, v: int, target: int, word: int, path: Floats) -> bool:
        """Drive the tether of a state along a path, and add the leg to the state in which it
        arrives; return False if that place has no room for another state."""
        states = self.states
        tether, longest = states.context.drive(states.entries[v].tether, path)
        if longest > states.limit:
            return True
        w = states.find(target, word, tether)
        if w is None:
            w = states.add(target, word, tether)
        if w is None:
            return False
        self.legs.add(v, w, path)
        self._driven.add((v, w))
        return True

    def surround(self, tour: Iterable[int], max_new: int, clock: Clock) -> int:
        """Add all states that one leg leads to from the states of a tour, whatever the maximum per
        place, and the legs between these and all others; return the number of new states.

        Words must distinguish states (`by_words`).

        Parameters
        ----------
        tour : iterable of int
            States of the tour.
        max_new : int
            Number of new states from which on the rest of the tour is left for the next call.
        clock : Clock
            When it is up, the rest of the tour is left out.
        """
        first = len(self.states.entries)
        for v in tour:
            if clock.is_up or len(self.states.entries) - first >= max_new:
                break
            if v not in self._surrounded:
                self._surrounded.add(v)
                self._add_legs_from(v, with_new=True)
        for v in range(first, len(self.states.entries)):
            self._add_legs_from(v, with_new=False)
        # their legs to states that are not known yet are not queued
        self._known = max(self._known, len(self.states.entries))
        return len(self.states.entries) - first

    def correct(self, tour: Sequence[int]) -> bool:
        """Drive the legs of a tour that are known by words alone, and replace each wrong leg, whose
        tether arrives in another state; return whether any was wrong.

        Parameters
        ----------
        tour : sequence of int
            States of the tour.
        """
        is_wrong = False
        for v, w in pairwise(tour):
            for ends in ((v, w), (w, v)):
                if ends in self.legs.arrives and not self._does_arrive(*ends):
                    is_wrong = True
        return is_wrong

    def _does_arrive(self, v: int, w: int) -> bool:
        """Return whether the leg between two states arrives; if not, replace it by one to the state
        in which it does, if the tether keeps its limit."""
        states, path = self.states, self.legs.arrives[v, w]
        if (v, w) in self._driven:
            return True
        self._driven.add((v, w))
        end = states.entries[w]
        tether, longest = states.context.drive(states.entries[v].tether, path)
        if longest <= states.limit:
            arrived = states.find(end.place, end.word, tether)
            if arrived == w:
                return True
            if arrived is None:
                arrived = states.add(end.place, end.word, tether, beyond_max=True)
            if arrived is not None:
                self.legs.add(v, arrived, path)
                self._driven.add((v, arrived))
        del self.legs.arrives[v, w]
        return False

    def _add_legs_from(self, v: int, *, with_new: bool) -> None:
        """Add the legs from a state by their words; with new states, or only to known ones."""
        state, multiply = self.states.entries[v], self.states.context.words.multiply
        for m in self.paths.neighbours[state.place]:
            target = int(m)
            for path_word, path in self.paths.between(state.place, target):
                word = multiply(state.word, path_word)
                if with_new or (target, word) in self._by_word:
                    self._add_by_word(v, target, word, path, beyond_max=with_new)

    @property
    def _by_word(self) -> dict[tuple[int, int], int]:
        """Return the states by place and word."""
        entries = self.states.entries
        for s in range(self._count_by_word, len(entries)):
            key = entries[s].place, entries[s].word
            if self._state_of.setdefault(key, s) != s:
                self._ambiguous.add(key)
        self._count_by_word = len(entries)
        return self._state_of

    def _add_by_word(
        self, v: int, target: int, word: int, path: Floats, *, beyond_max: bool = False
    ) -> None:
        """Add the leg along a path to the state of a word, and that state if it is not known."""
        key = target, word
        w = self._by_word.get(key)
        if key in self._ambiguous:
            self._add_driven(v, target, word, path)
            return
        if w is None and key not in self._too_long:
            states = self.states
            line = np.vstack([states.entries[v].tether.nodes, path[1:]])
            tether = states.context.model.relaxed(
                line, states.context.policy.states.max_pull_rounds
            )
            if tether.length > states.limit:
                self._too_long.add(key)
            else:
                w = states.add(target, word, tether, beyond_max=beyond_max)
        if w is None:
            return
        for a, b, along in ((v, w, path), (w, v, path[::-1])):
            if (a, b) not in self._driven:
                self.legs.add(a, b, along)

    def _may_fit(self, state: State, target: int, word: int, path: Floats) -> bool:
        """Return whether the tether may be within its limit at the end of a path. Pulling it taut
        there takes a tenth of the time of driving it."""
        key = target, word
        if self._shortest.get(key, np.inf) > self.states.limit:
            line = np.vstack([state.tether.nodes, path[1:]])
            rounds = self.states.context.policy.states.max_pull_rounds
            length = self.states.context.model.relaxed(line, rounds).length
            self._shortest[key] = min(length, self._shortest.get(key, np.inf))
            return bool(length <= self.states.limit)
        return True

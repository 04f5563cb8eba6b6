"""Ways of the robot from one waypoint to another, and what its tether does on them."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.base.geometry import polylines
from netsp.plan.space.detour_variants import find_bent_paths
from netsp.plan.space.mission_policy import StateEffort
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext, is_straight_clear, keeps_clearance
from netsp.plan.space.states import State, States


@dataclass
class RobotPaths:
    """The robot's ways between waypoints that are near one another, by the words they write.

    Parameters
    ----------
    context : PlanningContext
        Where they are.
    places : Places
        The waypoints, and where else the robot may be.
    effort : StateEffort
        How many.
    tethers : dict of int to list of ndarray of shape (k, 3)
        Of some places, how tethers hang there: ways are made of these where there is no time for a
        search, metres.
    """

    context: PlanningContext
    places: Places
    effort: StateEffort
    tethers: dict[int, list[Floats]] = field(default_factory=dict)
    _known: dict[tuple[int, int], list[tuple[int, Floats]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        apart = self.places.distances
        per = len(apart) / np.count_nonzero(self.places.choice == 0)
        count = min(math.ceil(self.context.policy.states.n_neighbours * per), len(apart) - 1)
        nearest = np.argsort(apart, axis=1, kind="stable")[:, :count]
        both = np.zeros(apart.shape, dtype=bool)
        both[np.arange(len(apart))[:, None], nearest] = True
        both = (both | both.T) & np.isfinite(apart)
        self.neighbours: list[Ints] = [np.flatnonzero(row) for row in both]
        self._apart = apart

    @property
    def points(self) -> Floats:
        """(n, 3) the places, metres."""
        return self.places.points

    def find_from(self, n: int, *, search: bool = True, pulling: Clock | None = None) -> None:
        """Seek the ways from a waypoint to those near it that have a greater number.

        Parameters
        ----------
        n : int
            The waypoint.
        search : bool
            Search for all classes; else there are the straight ways, and those along tethers.
        pulling : Clock, optional
            When it is up, there are no more of those along tethers, either.
        """
        to = [int(m) for m in self.neighbours[n] if m > n and (n, int(m)) not in self._known]
        if not to:
            return
        context, words = self.context, self.context.words
        here = words.visible_cell(self.points[n])
        found = None
        if here is not None and search:
            ends = {m: words.visible_cell(self.points[m]) for m in to}
            limits = {
                c: self.effort.max_path_ratio * float(self._apart[n, m])
                for m, c in ends.items()
                if c is not None
            }
            found = context.search_words(True, here, self.effort.paths, limits) if limits else None
        for m in to:
            paths = []
            if is_straight_clear(
                context.field, self.points[n], self.points[m], context.mission.clearance
            ):
                line = self.points[[n, m]]
                word = context.word_number(line)
                if word is not None:
                    paths.append((word, line))
            there = ends[m] if found is not None else None
            if found is not None and there is not None:
                for _, cells in context.paths_to(found, there):
                    path = context.pull_taut(np.vstack([self.points[n], cells, self.points[m]]))
                    word = context.word_number(path)
                    if word is not None and all(word != w for w, _ in paths):
                        paths.append((word, path))
            if found is None and not (pulling is not None and pulling.up):
                self._add_along_tethers(n, m, paths)
            paths.sort(key=lambda way: polylines.length(way[1]))
            if found is not None and paths:
                farther = self.effort.max_path_ratio * float(self._apart[n, m])
                for path in find_bent_paths(context, [way for _, way in paths], farther):
                    word = context.word_number(path)
                    if word is not None:
                        paths.append((word, path))
                paths.sort(key=lambda way: polylines.length(way[1]))
            back = []
            for _, path in paths:
                word = context.word_number(path[::-1])
                if word is not None:
                    back.append((word, path[::-1]))
            self._known[n, m], self._known[m, n] = paths, back

    def _add_along_tethers(self, n: int, m: int, paths: list[tuple[int, Floats]]) -> None:
        """The shortest ways back along a tether of one place and out along one of another, pulled
        taut, each of a class of its own."""
        found: dict[int, Floats] = {}
        for back in self.tethers.get(n, ()):
            for out in self.tethers.get(m, ()):
                path = self.context.pull_taut(np.vstack([back[::-1], out[1:]]))
                word = self.context.word_number(path)
                if word is None or not keeps_clearance(
                    self.context.field, path, self.context.mission
                ):
                    continue
                if word not in found or polylines.length(path) < polylines.length(found[word]):
                    found[word] = path
        for word, path in sorted(found.items(), key=lambda way: polylines.length(way[1])):
            if len(paths) < self.effort.paths and all(word != w for w, _ in paths):
                paths.append((word, path))

    def find_all(self, clock: Clock, tell: Callable[[str], None]) -> None:
        """Seek all ways between waypoints that are near.

        Parameters
        ----------
        clock : Clock
            When a share of it is up, ways are made of tethers; when another is, straight ways are
            all that is looked at.
        tell : callable
            Called with a line of text now and then.
        """
        times = self.context.policy.times
        searching, pulling = clock.part(times.path_search_share), None
        for n in range(len(self.points)):
            tell(f"ways of the robot from waypoint {n + 1} of {len(self.points)}")
            if searching.up and pulling is None:
                pulling = clock.part(times.tether_path_share)
            self.find_from(n, search=pulling is None, pulling=pulling)

    def between(self, n: int, m: int) -> list[tuple[int, Floats]]:
        """Ways from one waypoint to another that were found so far, shortest first.

        Parameters
        ----------
        n : int
            Where they begin.
        m : int
            Where they end.

        Returns
        -------
        list of (int, ndarray of shape (k, 3))
            Number of the word, and the path, metres.
        """
        return self._known.get((n, m), [])


@dataclass
class DrivenLegs:
    """Legs between states: each was driven with the tether of the state that it begins at.

    Attributes
    ----------
    arrives : dict of (state, state) to ndarray of shape (k, 3)
        The shortest path from one to the other.
    """

    arrives: dict[tuple[int, int], Floats] = field(default_factory=dict)

    def both_directions(self) -> Iterator[tuple[int, int, Floats, bool]]:
        """Legs that arrive in one direction at least.

        A tether may hang otherwise when the robot comes back: from there it then arrives in a state
        that is none or another one.

        Yields
        ------
        (int, int, ndarray, bool)
            The two states, the path from the first to the second, and whether the way back arrives,
            too: the lower number is then the first, and the path the shorter of the two.
        """
        for (v, w), path in self.arrives.items():
            back = self.arrives.get((w, v))
            if back is None:
                yield v, w, path, False
            elif v < w:
                yield v, w, min(path, back[::-1], key=polylines.length), True


@dataclass
class StateGrowth:
    """Legs and the states that they lead to: each state's own tether is driven along all ways to
    waypoints near, and what it arrives in is a state, too. The shortest legs come first, so that
    states are made in chains of neighbours, and what there is when the time is up joins them.

    Parameters
    ----------
    states : States
        Those so far; more are added.
    paths : RobotPaths
        The robot's ways.
    """

    states: States
    paths: RobotPaths
    legs: DrivenLegs = field(default_factory=DrivenLegs)
    _waiting: list[tuple[float, int, int, int, int]] = field(default_factory=list)
    _no_room: list[tuple[float, int, int, int, int]] = field(default_factory=list)
    _known: int = 0
    _count: int = 0
    _shortest: dict[tuple[int, int], float] = field(default_factory=dict)

    def grow(self, most: int, clock: Clock, tell: Callable[[str], None]) -> bool:
        """Drive legs until there are none left to drive, or the time is up.

        Parameters
        ----------
        most : int
            States of a waypoint.
        clock : Clock
            When it is up, legs and states are what they are by then.
        tell : callable
            Called with a line of text now and then.

        Returns
        -------
        bool
            Whether there are none left for so many states.
        """
        self.states.max_per_place = most
        for leg in self._no_room:
            heapq.heappush(self._waiting, leg)
        self._no_room.clear()
        while self._drive_on():
            tell(f"legs, {len(self.legs.arrives)} driven between {len(self.states.entries)} states")
            if clock.up:
                return False
        return True

    def _look_at_new(self) -> None:
        """Take the ways from new states on among those that wait."""
        for v in range(self._known, len(self.states.entries)):
            state = self.states.entries[v]
            key = state.place, state.word
            self._shortest[key] = min(state.tether.length, self._shortest.get(key, np.inf))
            for m in self.paths.neighbours[state.place]:
                for k, (_, path) in enumerate(self.paths.between(state.place, int(m))):
                    self._count += 1
                    heapq.heappush(
                        self._waiting, (polylines.length(path), self._count, v, int(m), k)
                    )
        self._known = len(self.states.entries)

    def _drive_on(self) -> bool:
        """Drive the next leg; whether there was one."""
        self._look_at_new()
        if not self._waiting:
            return False
        leg = heapq.heappop(self._waiting)
        _, _, v, m, k = leg
        states, legs = self.states, self.legs
        state = states.entries[v]
        word, path = self.paths.between(state.place, m)[k]
        writes = states.context.words.multiply(state.word, word)
        if not states.can_hold(m, writes):
            self._no_room.append(leg)
            return True
        if not self._may_fit(state, m, writes, path):
            return True
        there, longest = states.context.drive(state.tether, path)
        if longest > states.limit:
            return True
        w = states.find(m, writes, there)
        if w is None:
            w = states.add(m, writes, there)
        if w is None:
            self._no_room.append(leg)
        else:
            old = legs.arrives.get((v, w))
            if old is None or polylines.length(path) < polylines.length(old):
                legs.arrives[v, w] = path
        return True

    def _may_fit(self, state: State, m: int, writes: int, path: Floats) -> bool:
        """Whether the tether may be within its limit at the end of a way: a drive takes ten times
        as long as to pull it taut there."""
        key = m, writes
        if self._shortest.get(key, np.inf) > self.states.limit:
            line = np.vstack([state.tether.nodes, path[1:]])
            rounds = self.states.context.policy.states.max_pull_rounds
            length = self.states.context.model.relaxed(line, rounds).length
            self._shortest[key] = min(length, self._shortest.get(key, np.inf))
            return bool(length <= self.states.limit)
        return True

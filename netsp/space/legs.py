"""Ways of the robot from one waypoint to another, and what its tether does on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from netsp.arrays import Floats, Ints
from netsp.space.states import Effort, States
from netsp.space.water import Water, along, straight

NEIGHBOURS = 10
"""Waypoints nearest to each that legs are sought to."""

FARTHER = 2.2
"""Ways are no longer than so many times the distance: around a row of piles it is twice."""


@dataclass
class Ways:
    """The robot's ways between waypoints that are near one another, by the words they write.

    Parameters
    ----------
    water : Water
        Where they are.
    points : ndarray, shape (n, 3)
        The waypoints, metres.
    effort : Effort
        How many.
    """

    water: Water
    points: Floats
    effort: Effort
    _known: dict[tuple[int, int], list[tuple[int, Floats]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        apart = np.linalg.norm(self.points[:, None] - self.points[None], axis=2)
        np.fill_diagonal(apart, np.inf)
        count = min(NEIGHBOURS, len(self.points) - 1)
        nearest = np.argsort(apart, axis=1, kind="stable")[:, :count]
        both = np.zeros(apart.shape, dtype=bool)
        both[np.arange(len(apart))[:, None], nearest] = True
        both |= both.T
        self.near: list[Ints] = [np.flatnonzero(row) for row in both]
        self._apart = apart

    def prepare(self, n: int) -> None:
        """Seek the ways from a waypoint to those near it that have a greater number.

        Parameters
        ----------
        n : int
            The waypoint.
        """
        to = [int(m) for m in self.near[n] if m > n and (n, int(m)) not in self._known]
        if not to:
            return
        water, words = self.water, self.water.words
        here = words.held(self.points[n])
        found = None
        if here is not None:
            ends = {m: words.held(self.points[m]) for m in to}
            limits = {
                c: FARTHER * float(self._apart[n, m]) for m, c in ends.items() if c is not None
            }
            found = water.search(True, here, self.effort.ways, limits) if limits else None
        for m in to:
            ways = []
            if straight(water.field, self.points[n], self.points[m], water.mission.clearance):
                line = self.points[[n, m]]
                word = water.number(line)
                if word is not None:
                    ways.append((word, line))
            there = ends[m] if found is not None else None
            if found is not None and there is not None:
                for _, cells in water.ways(found, there):
                    path = water.taut(np.vstack([self.points[n], cells, self.points[m]]))
                    word = water.number(path)
                    if word is not None and all(word != w for w, _ in ways):
                        ways.append((word, path))
            ways.sort(key=lambda way: along(way[1]))
            back = []
            for _, path in ways:
                word = water.number(path[::-1])
                if word is not None:
                    back.append((word, path[::-1]))
            self._known[n, m], self._known[m, n] = ways, back

    def between(self, n: int, m: int) -> list[tuple[int, Floats]]:
        """Ways from one waypoint to another, shortest first.

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
        if (n, m) not in self._known:
            self.prepare(min(n, m))
        return self._known.get((n, m), [])


@dataclass
class Legs:
    """Legs between states: each was driven with the tether of the state that it begins at.

    Attributes
    ----------
    arrives : dict of (state, state) to ndarray of shape (k, 3)
        The shortest path from one to the other.
    """

    arrives: dict[tuple[int, int], Floats] = field(default_factory=dict)

    def both_ways(self) -> Iterator[tuple[int, int, Floats]]:
        """Legs that were driven in both directions.

        Yields
        ------
        (int, int, ndarray)
            The two states, the lower number first, and the shorter of the two paths.
        """
        for (v, w), path in self.arrives.items():
            back = self.arrives.get((w, v))
            if v < w and back is not None:
                yield v, w, min(path, back[::-1], key=along)


def grown(states: States, ways: Ways) -> Legs:
    """Drive each state's own tether along all ways to waypoints near, and make a state of what it
    arrives in; from there on, too.

    Parameters
    ----------
    states : States
        Those so far; more are added.
    ways : Ways
        The ways.

    Returns
    -------
    Legs
        Those on which the tether was never longer than its limit.
    """
    legs, model = Legs(), states.water.model
    v = 0
    while v < len(states.all):
        state = states.all[v]
        for m in ways.near[state.point]:
            for word, path in ways.between(state.point, int(m)):
                there, lengths = model.drive(state.tether, path[1:])
                if lengths.max() > states.limit:
                    continue
                writes = states.water.words.times(state.word, word)
                w = states.find(int(m), writes, there)
                if w is None:
                    w = states.add(int(m), writes, there)
                if w is None:
                    continue
                old = legs.arrives.get((v, w))
                if old is None or along(path) < along(old):
                    legs.arrives[v, w] = path
        v += 1
    return legs

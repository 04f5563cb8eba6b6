"""The classes in which a tether reaches places."""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field

import numpy as np

from netsp.arrays import Floats
from netsp.clock import Clock
from netsp.space.legs import Ways
from netsp.space.states import ROUNDS
from netsp.space.water import LONGER, Water, along

MOST_WORDS, LEAST_WORDS, MOST_ENTRIES, A_SECOND = 100, 4, 25_000_000, 600_000
"""Words of a cell that are sought, at most and at least; and of all cells together, at most (11
bytes each), and in a second."""

SEARCHING = 0.4
"""Of the time left, what a search for more words than the least may take; the rest is for pulling
their tethers taut."""

MOST_CLASSES = 3000
"""Of all places together: where there are more, they are not listed."""

MOST_PULLED = 40_000
"""Tethers that are pulled taut on their way to other classes."""

ACCURACY = 1e-3
"""Share of a tether at rest that its length may be off by (docs/tether.md: a tenth of that, where
an exact length is known)."""

ANY = -1
"""In place of a word: of a class that was not found."""


@dataclass(frozen=True)
class SpaceClass:
    """A class of the tether at a place.

    Parameters
    ----------
    point : int
        The place.
    word : int
        Number of the tether's word there; `ANY` of one that was not found.
    length : float
        Metres that the tether is at least long.
    line : ndarray, shape (k, 3), optional
        The tether; None where nothing is known of it.
    other_than : frozenset of int
        Words that it has none of, if it was not found.
    """

    point: int
    word: int
    length: float
    line: Floats | None = None
    other_than: frozenset[int] = frozenset()


@dataclass
class _Table:
    """What is known of the classes at a place.

    Parameters
    ----------
    point : int
        The place.
    beyond : float
        Metres that tethers of classes that were not found are at least long.
    tethers : dict of int to (float, ndarray of shape (k, 3))
        By the number of the word, the length and the line of the shortest tether that fits, metres.
    seen : set of int
        Words of those, and of tethers that are too long though a search found their way.
    """

    point: int
    beyond: float = np.inf
    tethers: dict[int, tuple[float, Floats]] = field(default_factory=dict)
    seen: set[int] = field(default_factory=set)

    def add(self, water: Water, word: int, line: Floats) -> bool:
        """A tether, pulled taut; whether it fits and there was none of its class that did."""
        tether = water.model.relaxed(line, ROUNDS)
        mission = water.mission
        at_rest = tether.residual <= mission.delta / 200.0  # docs/tether.md
        over = ACCURACY * mission.tether_length if at_rest else mission.delta
        if tether.length > mission.tether_length + over:
            return False
        known = self.tethers.get(word)
        if known is None or tether.length < known[0]:
            self.tethers[word] = tether.length, tether.nodes
        return known is None

    def classes(self, limit: float) -> list[SpaceClass]:
        """All of them, and one more in place of those not found, where there may be any."""
        out = [SpaceClass(self.point, word, *known) for word, known in self.tethers.items()]
        if self.beyond <= limit or not self.tethers:
            least = self.beyond if self.tethers else 0.0
            out.append(SpaceClass(self.point, ANY, least, other_than=frozenset(self.seen)))
        return out


def classes_within(ways: Ways, some: list[int], clock: Clock) -> list[SpaceClass] | None:
    """All classes in which the tether reaches places.

    Parameters
    ----------
    ways : Ways
        Of the robot between places.
    some : list of int
        The places.
    clock : Clock
        When it is up, those that were not found yet are told as one for each place.

    Returns
    -------
    list of SpaceClass or None
        None where words are not exact, or there is no room for enough of them.
    """
    water, places = ways.water, ways.places
    words, limit = water.words, water.mission.tether_length
    entries = min(MOST_ENTRIES, A_SECOND * clock.left)
    of_each = int(entries / words.cells.flags.size)
    if not words.exact or of_each < LEAST_WORDS:
        return None
    most = min(MOST_WORDS, max(LEAST_WORDS, int(SEARCHING * of_each)))
    tables = _searched(ways, [n for n in some if n != places.begin], most, clock)
    if not tables:
        return None
    _go_on(ways, tables, clock)
    out = [c for table in tables.values() for c in table.classes(limit)]
    if places.begin is not None:
        number, line = water.number(water.present.nodes), water.present.nodes
        out.append(SpaceClass(places.begin, ANY if number is None else number, 0.0, line))
    return out if len(out) <= MOST_CLASSES else None


def _searched(ways: Ways, some: list[int], most: int, clock: Clock) -> dict[int, _Table]:
    """Classes by a search from the anchor, so many of a cell; none if no place is in a cell."""
    water, places = ways.water, ways.places
    words, mission = water.words, water.mission
    limit, anchor = mission.tether_length, np.asarray(mission.anchor, dtype=float)[None]
    root = int(np.ravel_multi_index(tuple(words.root), words.cells.flags.shape))
    cells = {n: words.held(places.points[n]) for n in some}
    targets = {cell: limit for cell in cells.values() if cell is not None}
    if not targets:
        return {}
    found = water.search(False, root, most, targets)
    tables = {}
    for n, cell in cells.items():
        table = tables[n] = _Table(n)
        there = [] if cell is None else water.ways(found, cell)
        if len(there) >= most:
            table.beyond = _least_of(water, there[-1][1], places.points[n])
        for _, way in there:
            least = _least_of(water, way, places.points[n])
            if clock.up or least > limit + mission.delta:
                table.beyond = min(table.beyond, least)
                break
            path = np.vstack([anchor, way, places.points[n]])
            # of whole paths: those of cells lack the letters between a place and its cell
            word = water.number(path)
            if word is None:
                table.beyond = min(table.beyond, least)
            else:
                table.seen.add(word)
                table.add(water, word, path)
    return tables


def _go_on(ways: Ways, tables: dict[int, _Table], clock: Clock) -> None:
    """Classes that legs lead to from those that were found. With these, tours get to one that was
    not found by a leg only that was not found, either, or that seems to be too long for it. What is
    pulled taut from here may hang, where no search has found it: so one that does not fit is not
    taken for seen, and one that does is not taken to be longer than what no search has found."""
    if all(table.beyond > ways.water.mission.tether_length for table in tables.values()):
        return
    times, count = ways.water.words.times, 0
    waiting: list[tuple[float, int, int, int, Floats]] = []

    def look_on(n: int, word: int) -> None:
        nonlocal count
        length, line = tables[n].tethers[word]
        for m in map(int, ways.near[n]):
            for leg, path in ways.sought(n, m) if m in tables else ():
                to = times(word, leg)
                if to not in tables[m].tethers:
                    count += 1
                    way = length + along(path), count, m, to, np.vstack([line, path[1:]])
                    heapq.heappush(waiting, way)

    for n, table in tables.items():
        for word in table.tethers:
            look_on(n, word)
    while waiting and not clock.up and count < MOST_PULLED:
        _, _, m, to, line = heapq.heappop(waiting)
        table = tables[m]
        if to not in table.tethers and table.add(ways.water, to, line):
            length, nodes = table.tethers[to]
            table.tethers[to] = min(length, table.beyond), nodes
            table.seen.add(to)
            look_on(m, to)


def _least_of(water: Water, way: Floats, place: Floats) -> float:
    """Metres that tethers in the class of a way along cells are at least long. Such ways are longer
    than taut ones by no more than a factor, and end in the middles of cells."""
    ends = water.laid.nodes[0] - way[0], place - way[-1]
    return along(way) / LONGER - float(np.linalg.norm(ends, axis=1).sum())

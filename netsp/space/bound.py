"""A bound on every tour of a mission's waypoints, of two that are asked for.

The first knows nothing of the tether: no tour is shorter than the shortest one of the robot alone,
which goes from waypoint to waypoint along the shortest paths there are. Between waypoints in sight
of one another these are straight, and between those that are not near, the straight distance is a
bound, too. For the others the shortest of the ways found is taken, pulled taut in each of several
classes (`netsp.space.legs.Ways`): a measured length, which nothing proves the shortest.

The second asks for classes as well: at a waypoint the tether is of one of the classes in which it
is no longer than its limit, and a leg between two of these is as long as the shortest way of the
class that it must have. Of classes of tethers and of legs that no search has found, the least is
taken that they can be, and where the shortest tour goes along such legs, the search for them goes
on. That tethers hang on bodies with free ends, and what they do on the way, it leaves aside.

What is proven of either is the tour through these lengths.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations, pairwise

import numpy as np

from netsp.arrays import Bools, Floats, Ints
from netsp.clock import Clock
from netsp.roadmap.from_state import from_state
from netsp.solvers.solve import solve_graph
from netsp.space.classes import ANY, MOST_ENTRIES, SpaceClass, classes_within
from netsp.space.legs import Ways
from netsp.space.water import LONGER, Water, along
from netsp.travel.graph import TravelGraph
from netsp.travel.result import Result

PLAIN, CLASSES = 0.4, 0.5
"""Of the time left: for the first bound, and for the classes of the second."""

WORDS, MOST_WORDS = 24, 96
"""Words of legs that are sought between two places at first, and at most; twice as many each time
that it is not enough."""

FARTHER = 2.0
"""Legs are sought that are longer than those known by that factor."""


def bound_of_all(
    ways: Ways, reached: list[int], clock: Clock | None, seed: int = 0
) -> float | None:
    """A bound on all tours through waypoints.

    Parameters
    ----------
    ways : Ways
        Of the robot between waypoints.
    reached : list of int
        The waypoints of the tours.
    clock : Clock, optional
        When it is up, the bound is what is proven by then.
    seed : int
        Of the solver.

    Returns
    -------
    float or None
        Metres; None if there was no time for any, or nothing is to be visited but the start.
    """
    clock = clock or Clock()
    places, visited = ways.places, set(reached)
    some = [n for n in range(len(places)) if n == places.begin or places.waypoint[n] in visited]
    if not some:
        return None
    plain = [SpaceClass(n, ANY, 0.0) for n in some]
    first = _solved(ways, plain, clock.part(PLAIN), seed)
    if clock.up:
        return first
    classes = classes_within(ways, some, clock.part(CLASSES))
    second = None if classes is None else _solved(ways, classes, clock, seed)
    return max(first or 0.0, second or 0.0) or None


@dataclass
class LegLengths:
    """Lengths of the classes of legs between two places.

    Parameters
    ----------
    ways : Ways
        Those that are known.
    """

    ways: Ways
    _of: dict[tuple[int, int], tuple[list[tuple[int, float]], float]] = field(default_factory=dict)
    _words: dict[tuple[int, int], int] = field(default_factory=dict)

    def between(self, n: int, m: int) -> tuple[list[tuple[int, float]], float]:
        """What is known of the legs from a place to another.

        Parameters
        ----------
        n : int
            Where they begin.
        m : int
            Where they end.

        Returns
        -------
        known : list of (int, float)
            Number of the word, and metres.
        beyond : float
            Metres that all others are at least long.
        """
        if (n, m) not in self._of:
            ways = self.ways
            straight = float(np.linalg.norm(ways.points[n] - ways.points[m]))
            known = [(word, max(straight, along(path))) for word, path in ways.sought(n, m)]
            self._of[n, m] = known, max(straight, ways.beyond(n, m))
        return self._of[n, m]

    def go_on(self, n: int, m: int) -> bool:
        """Seek more classes between two places.

        Parameters
        ----------
        n : int
            One of them.
        m : int
            The other.

        Returns
        -------
        bool
            Whether they were sought: there is an end to it.
        """
        if n > m:
            n, m = m, n
        water, points = self.ways.water, self.ways.points
        most = self._words[n, m] = 2 * self._words.get((n, m), WORDS // 2)
        begin, end = water.words.held(points[n]), water.words.held(points[m])
        room = most * water.words.cells.flags.size <= MOST_ENTRIES
        if most > MOST_WORDS or not room or begin is None or end is None:
            return False
        (there, beyond), (back, _) = self.between(n, m), self.between(m, n)
        farthest = FARTHER * beyond
        found = water.ways(water.search(True, begin, most, {end: farthest}), end)
        there, back = list(there), list(back)
        for _, cells in found:
            path = water.taut(np.vstack([points[n], cells, points[m]]))
            for some, line in ((there, path), (back, path[::-1])):
                word = water.number(line)
                if word is not None:
                    some.append((word, along(line)))
        if len(found) >= most:
            # paths along cells are longer than those pulled taut by no more than that factor
            farthest = min(farthest, along(found[-1][1]) / LONGER)
        self._of[n, m] = there, max(beyond, farthest)
        self._of[m, n] = back, max(beyond, farthest)
        return True


def _solved(ways: Ways, classes: list[SpaceClass], clock: Clock, seed: int) -> float | None:
    """The bound that is proven on tours through one class of each waypoint. Legs of the shortest of
    these that were only estimated are measured, and it is sought again, until none is left."""
    legs = LegLengths(ways)
    costs, measured = _costs(legs, classes)
    places, best = ways.places, 0.0
    point = np.array([c.point for c in classes])
    cluster: Ints = np.r_[0, 1 + np.unique(places.waypoint[point], return_inverse=True)[1]]
    begin = None if places.begin is None else 1 + int(np.flatnonzero(point == places.begin)[0])
    while True:
        graph = TravelGraph.from_costs(costs, cluster)
        if begin is not None:
            graph = from_state(graph, begin)
        result = solve_graph(graph, "auto", time_limit=clock, seed=seed)
        best = max(best, result.lower_bound or 0.0)
        if (
            clock.up
            or result.tour is None
            or not _measure(legs, classes, costs, measured, result, clock)
        ):
            return best or None


def _costs(legs: LegLengths, classes: list[SpaceClass]) -> tuple[Floats, Bools]:
    """(v, v) least lengths of legs between the start and all classes, and which need not be
    measured."""
    places, water = legs.ways.places, legs.ways.water
    point = np.array([c.point for c in classes])
    straight = np.linalg.norm(places.points[point] - np.array(water.mission.start), axis=1)
    # a tether to the start, and on along the way from there, is no shorter than the taut one
    out = np.array([c.length for c in classes]) - water.laid.length
    costs = np.zeros((len(classes) + 1, len(classes) + 1))
    measured = np.zeros(costs.shape, dtype=np.bool_)
    costs[0, 1:] = costs[1:, 0] = np.maximum(straight, out)
    for n, m in combinations(np.unique(point).tolist(), 2):
        _put(legs, classes, n, m, costs, measured)
    return costs, measured


def _measure(
    legs: LegLengths, classes: list[SpaceClass], costs: Floats, measured: Bools,
    result: Result, clock: Clock,
) -> bool:  # fmt: skip
    """Seek the shortest ways in the classes of those legs of a tour that were only estimated.
    Whether any was longer."""
    assert result.tour is not None
    water, longer = legs.ways.water, False
    estimated = [(u, v) for u, v in pairwise((*result.tour, 0)) if not measured[u, v]]
    for u, v in estimated:
        if clock.up:
            break
        before = costs[u, v]
        if u == 0 or v == 0:
            line = classes[max(u, v) - 1].line
            measured[u, v] = measured[v, u] = True
            if line is not None:
                costs[u, v] = costs[v, u] = max(before, _least(water, water.laid.nodes, line))
        else:
            n, m = classes[u - 1].point, classes[v - 1].point
            if legs.go_on(n, m):
                _put(legs, classes, n, m, costs, measured)
            else:
                measured[u, v] = measured[v, u] = True
        longer = longer or costs[u, v] > before * (1.0 + 1e-9) + 1e-9
    return longer


def _put(
    legs: LegLengths, classes: list[SpaceClass], n: int, m: int, costs: Floats,
    measured: Bools,
) -> None:  # fmt: skip
    """Write the least lengths of legs between the classes of two places where they belong."""
    own, others = (np.array([k for k, c in enumerate(classes) if c.point == p]) for p in (n, m))
    block, known = _between(legs, [classes[k] for k in own], [classes[k] for k in others])
    for whole, part in ((costs, block), (measured, known)):
        whole[np.ix_(own + 1, others + 1)] = part
        whole[np.ix_(others + 1, own + 1)] = part.T


def _least(water: Water, one: Floats, other: Floats) -> float:
    """Metres that ways in the class of the leg between two tethers are at least long. Back along
    one and out along the other, pulled taut, is such a way, but need not be the shortest: in space
    it may hang on something. So shorter ones are sought."""
    there = water.taut(np.vstack([one[::-1], other[1:]]))
    length, word = along(there), water.number(there)
    begin, end = water.words.held(there[0]), water.words.held(there[-1])
    if word is None or begin is None or end is None:
        return float(np.linalg.norm(there[-1] - there[0]))
    found = water.ways(water.search(True, begin, WORDS, {end: length}), end)
    same = [way for number, way in found if number == word]
    if same:
        return min(length, *(along(water.taut(np.vstack([there[0], way, there[-1]])))
                             for way in same))  # fmt: skip
    if len(found) < WORDS:
        return length  # there is none along cells that is pulled to less
    # paths along cells are longer than those pulled taut by no more than that factor
    return min(length, along(found[-1][1]) / LONGER)


def _between(
    legs: LegLengths, own: list[SpaceClass], others: list[SpaceClass]
) -> tuple[Floats, Bools]:
    """(a, b) least lengths of legs between the classes of two places, and which of them are those
    of ways that were found."""
    n, m = own[0].point, others[0].point
    (out, far), (back, _) = legs.between(n, m), legs.between(m, n)
    # a tether, and on along the way to the next place, is no shorter than the taut one there
    here, there = (np.array([c.length for c in some]) for some in (own, others))
    apart = np.abs(here[:, None] - there[None])
    # of classes that were not found, the length is only a least one
    if own[-1].word == ANY:
        apart[-1] = np.maximum(0.0, here[-1] - there)
    if others[-1].word == ANY:
        apart[:, -1] = np.maximum(0.0, there[-1] - here)
    block = np.maximum(far, apart)
    measured = np.zeros(block.shape, dtype=np.bool_)
    column = {c.word: k for k, c in enumerate(others) if c.word != ANY}
    times = legs.ways.water.words.times

    def to_another(c: SpaceClass, known: list[tuple[int, float]], other: SpaceClass) -> float:
        """The shortest way from a class to one that was not found, be it known or not."""
        lengths = (d for w, d in known if times(c.word, w) not in other.other_than)
        return min(lengths, default=np.inf)

    for k, c in enumerate(own):
        if c.word == ANY:
            continue
        for word, length in out:
            to = column.get(times(c.word, word))
            if to is not None and not (measured[k, to] and block[k, to] <= length):
                block[k, to], measured[k, to] = length, True
        if others[-1].word == ANY:
            nearest = to_another(c, out, others[-1])
            block[k, -1], measured[k, -1] = max(min(far, nearest), apart[k, -1]), nearest <= far
    if own[-1].word == ANY:
        least = min((length for _, length in out), default=np.inf)
        for k, c in enumerate(others):
            nearest = least if c.word == ANY else to_another(c, back, own[-1])
            block[-1, k] = max(min(far, nearest), 0.0 if c.word == ANY else apart[-1, k])
            measured[-1, k] = nearest <= far
    return block, measured

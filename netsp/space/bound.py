"""A bound on every tour of a mission's waypoints, of two that are asked for.

The first knows nothing of the tether: no tour is shorter than the shortest one of the robot alone,
which goes from waypoint to waypoint along the shortest paths there are. Between waypoints in sight
of one another these are straight, and between those that are not near, the straight distance is a
bound, too. For the others the shortest of the ways found is taken, pulled taut in each of several
classes (`netsp.space.legs.Ways`): a measured length, which nothing proves the shortest.

The second asks for classes as well: at a waypoint the tether is of one of the classes in which it
is no longer than its limit, and a leg between two of these is as long as the shortest way of the
class that it must have: back along one tether and out along the other, pulled taut. Of classes that
no search has found, the least is taken that they can be. That tethers hang on bodies with free
ends, and what they do on the way, it leaves aside.

What is proven of either is the tour through these distances.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from netsp.arrays import Bools, Floats, Ints
from netsp.clock import Clock
from netsp.online.tether import Tether
from netsp.roadmap.from_state import from_state
from netsp.solvers.solve import solve_graph
from netsp.space.legs import Ways
from netsp.space.states import ROUNDS
from netsp.space.water import LONGER, Water, along
from netsp.travel.graph import TravelGraph
from netsp.travel.result import Result

PLAIN, CLASSES = 0.4, 0.5
"""Of the time left: for the first bound, and for the classes of the second."""

MOST_WORDS, LEAST_WORDS, MOST_ENTRIES, A_SECOND = 100, 4, 25_000_000, 600_000
"""Words of a cell that are sought, at most and at least; and of all cells together, at most (11
bytes each), and in a second."""

SEARCHING = 0.4
"""Of the time left, what a search for more words than the least may take; the rest is for pulling
their tethers taut."""

MOST_VERTICES = 3000
"""Classes of all waypoints together: of more there is the first bound only."""

ACCURACY = 1e-3
"""Share of a tether at rest that its length may be off by (docs/tether.md: a tenth of that, where
an exact length is known)."""

MOST_MEASURED = 24
"""Words that a leg's is sought among."""

ANY = -1
"""In place of a word: of a class that was not found."""


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
    plain = [_Class(n, ANY, 0.0) for n in some]
    first = _solved(ways, plain, clock.part(PLAIN), seed)
    if clock.up:
        return first
    classes = _classes(ways, some, clock.part(CLASSES))
    second = None if classes is None else _solved(ways, classes, clock, seed)
    return max(first or 0.0, second or 0.0) or None


@dataclass(frozen=True)
class _Class:
    """A place, the number of the tether's word there, its least length, metres, and the tether;
    None where nothing is known of that. One that was not found has none of the words that were."""

    point: int
    word: int
    length: float
    line: Floats | None = None
    other_than: frozenset[int] = frozenset()


def _classes(ways: Ways, some: list[int], clock: Clock) -> list[_Class] | None:
    """All classes in which the tether reaches places; None if it cannot be told."""
    water, places = ways.water, ways.places
    words, limit = water.words, water.mission.tether_length
    entries = min(MOST_ENTRIES, A_SECOND * clock.left)
    of_each = int(entries / words.cells.flags.size)
    if not words.exact or of_each < LEAST_WORDS:
        return None
    most = min(MOST_WORDS, max(LEAST_WORDS, int(SEARCHING * of_each)))
    root = int(np.ravel_multi_index(tuple(words.root), words.cells.flags.shape))
    cells = {n: words.held(places.points[n]) for n in some if n != places.begin}
    targets = {cell: limit for cell in cells.values() if cell is not None}
    if not targets:
        return None
    found = water.search(False, root, most, targets)
    anchor = np.asarray(water.mission.anchor, dtype=float)[None]
    out: list[_Class] = []
    for n in some:
        if n == places.begin:
            number = water.number(water.present.nodes)
            line = water.present.nodes
            out.append(_Class(n, ANY if number is None else number, 0.0, line))
            continue
        cell = cells[n]
        there = [] if cell is None else water.ways(found, cell)
        known: dict[int, Tether] = {}
        seen: set[int] = set()
        # classes that were not found are no shorter than that; paths along cells are longer than
        # those pulled taut by no more than that factor
        beyond = _least_of(water, there[-1][1], places.points[n]) if len(there) >= most else np.inf
        for _, way in there:
            least = _least_of(water, way, places.points[n])
            if clock.up or least > limit + water.mission.delta:
                beyond = min(beyond, least)
                break
            path = np.vstack([anchor, way, places.points[n]])
            tether = water.model.relaxed(path, ROUNDS)
            # of whole paths: those of cells lack the letters between a place and its cell
            key = water.number(path)
            if key is None:
                beyond = min(beyond, least)
                continue
            seen.add(key)
            delta = water.mission.delta
            at_rest = tether.residual <= delta / 200.0  # docs/tether.md
            if tether.length > limit + (ACCURACY * limit if at_rest else delta):
                continue
            if key not in known or tether.length < known[key].length:
                known[key] = tether
        out += [_Class(n, word, t.length, t.nodes) for word, t in known.items()]
        if beyond <= limit or not known:
            least = beyond if known else 0.0
            out.append(_Class(n, ANY, least, other_than=frozenset(seen)))
        if len(out) > MOST_VERTICES:
            return None
    return out


def _least_of(water: Water, way: Floats, place: Floats) -> float:
    """Metres that tethers in the class of a way along cells are at least long. Such ways are longer
    than taut ones by no more than a factor, and end in the middles of cells."""
    ends = water.laid.nodes[0] - way[0], place - way[-1]
    return along(way) / LONGER - float(np.linalg.norm(ends, axis=1).sum())


def _solved(ways: Ways, classes: list[_Class], clock: Clock, seed: int) -> float | None:
    """The bound that is proven on tours through one class of each waypoint. Legs of the shortest of
    these that were only estimated are measured, and it is sought again, until none is left."""
    costs, measured = _costs(ways, classes)
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
        if clock.up or result.tour is None or not _measure(ways, classes, costs, measured, result):
            return best or None


def _costs(ways: Ways, classes: list[_Class]) -> tuple[Floats, Bools]:
    """(v, v) least lengths of legs between the start and all classes, and which need not be
    measured."""
    places, water = ways.places, ways.water
    point = np.array([c.point for c in classes])
    straight = np.linalg.norm(places.points[point] - np.array(water.mission.start), axis=1)
    # a tether to the start, and on along the way from there, is no shorter than the taut one
    out = np.array([c.length for c in classes]) - water.laid.length
    costs = np.zeros((len(classes) + 1, len(classes) + 1))
    measured = np.zeros(costs.shape, dtype=np.bool_)
    costs[0, 1:] = costs[1:, 0] = np.maximum(straight, out)
    members = {int(n): np.flatnonzero(point == n) for n in np.unique(point)}
    for n, own in members.items():
        for m, others in members.items():
            if n >= m:
                continue
            block, known = _between(ways, [classes[k] for k in own], [classes[k] for k in others])
            for whole, part in ((costs, block), (measured, known)):
                whole[np.ix_(own + 1, others + 1)] = part
                whole[np.ix_(others + 1, own + 1)] = part.T
    return costs, measured


def _measure(
    ways: Ways, classes: list[_Class], costs: Floats, measured: Bools, result: Result
) -> bool:
    """Seek the shortest ways in the classes of those legs of a tour that were only estimated.
    Whether any was longer."""
    assert result.tour is not None
    water, longer = ways.water, False
    for u, v in pairwise((*result.tour, 0)):
        lines = [water.laid.nodes if w == 0 else classes[w - 1].line for w in (u, v)]
        if measured[u, v] or lines[0] is None or lines[1] is None:
            continue
        measured[u, v] = measured[v, u] = True
        length = _least(water, lines[0], lines[1])
        if length > costs[u, v] * (1.0 + 1e-9) + 1e-9:
            costs[u, v] = costs[v, u] = length
            longer = True
    return longer


def _least(water: Water, one: Floats, other: Floats) -> float:
    """Metres that ways in the class of the leg between two tethers are at least long. Back along
    one and out along the other, pulled taut, is such a way, but need not be the shortest: in space
    it may hang on something. So shorter ones are sought."""
    there = water.taut(np.vstack([one[::-1], other[1:]]))
    length, word = along(there), water.number(there)
    begin, end = water.words.held(there[0]), water.words.held(there[-1])
    if word is None or begin is None or end is None:
        return float(np.linalg.norm(there[-1] - there[0]))
    found = water.ways(water.search(True, begin, MOST_MEASURED, {end: length}), end)
    same = [way for number, way in found if number == word]
    if same:
        return min(length, *(along(water.taut(np.vstack([there[0], way, there[-1]])))
                             for way in same))  # fmt: skip
    if len(found) < MOST_MEASURED:
        return length  # there is none along cells that is pulled to less
    # paths along cells are longer than those pulled taut by no more than that factor
    return min(length, along(found[-1][1]) / LONGER)


def _between(ways: Ways, own: list[_Class], others: list[_Class]) -> tuple[Floats, Bools]:
    """(a, b) least lengths of legs between the classes of two places, and which of them are those
    of ways that were found."""
    n, m = own[0].point, others[0].point
    straight = float(np.linalg.norm(ways.points[n] - ways.points[m]))
    # a tether, and on along the way to the next place, is no shorter than the taut one there
    here, there = (np.array([c.length for c in some]) for some in (own, others))
    apart = np.abs(here[:, None] - there[None])
    # of classes that were not found, the length is only a least one
    if own[-1].word == ANY:
        apart[-1] = np.maximum(0.0, here[-1] - there)
    if others[-1].word == ANY:
        apart[:, -1] = np.maximum(0.0, there[-1] - here)
    far = max(straight, ways.beyond(n, m))
    out, back = (
        [(word, max(straight, along(path))) for word, path in ways.sought(a, b)]
        for a, b in ((n, m), (m, n))
    )
    block = np.maximum(far, apart)
    measured = np.zeros(block.shape, dtype=np.bool_)
    column = {c.word: k for k, c in enumerate(others) if c.word != ANY}
    times = ways.water.words.times

    def to_another(c: _Class, known: list[tuple[int, float]], other: _Class) -> float:
        """The shortest way from a class to one that was not found, be it known or not."""
        lengths = (d for w, d in known if times(c.word, w) not in other.other_than)
        return min([far, *lengths])

    for k, c in enumerate(own):
        if c.word == ANY:
            continue
        for word, length in reversed(out):  # the shortest of a class comes last
            to = column.get(times(c.word, word))
            if to is not None:
                block[k, to], measured[k, to] = length, True
        if others[-1].word == ANY:
            block[k, -1] = max(to_another(c, out, others[-1]), apart[k, -1])
    if own[-1].word == ANY:
        least = min((length for _, length in out), default=straight)
        for k, c in enumerate(others):
            nearest = least if c.word == ANY else to_another(c, back, own[-1])
            block[-1, k] = max(nearest, 0.0 if c.word == ANY else apart[-1, k])
    return block, measured

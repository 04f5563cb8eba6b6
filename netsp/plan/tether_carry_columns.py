"""Roadmaps that had to leave classes out: classes along good tours are put back.

Such a roadmap holds the classes of least tether. Over open water with many thin obstacles these are
all much alike: they differ in the side on which a tether passes obstacles half way, and tours among
them keep coming back towards the base. A good tour goes on from goal to goal, and the tether comes
along. So from the classes of a tour each goal near by is gone on to the shortest way; the classes
that the tether comes into there join the graph, a search over these few finds a better tour, and so
on until none is found. It begins with a short order along straight lines, along which a tether is
carried, too: whatever it is wound around on the way, back along it the robot comes home free. A
tour to start from is gone on from in the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.gtsp.search.layers import Instance
from netsp.gtsp.search.local_search import Search
from netsp.gtsp.travel.graph import TravelGraph, least_tethers
from netsp.gtsp.travel.result import OnProgress, Progress
from netsp.hsignature import Word, concatenate

SHARE = 0.5
"""Of the time, at most."""

NEAR = 8
"""Goals near by that are gone on to."""

ROUNDS_PER_GOAL, MOST_ROUNDS = 60, 4000
"""Of ruin and recreate, in each search."""

FEW = 2
"""Classes of least tether of each goal that are looked at besides."""

MOST_CLASSES, MOST_PER_GOAL = 2000, 40
"""Looked at in one search, in all and times the number of goals: with more, only those along the
last tour are; with half as many, a search in vain goes on from all of them."""

IN_VAIN = 4
"""Searches one after the other that bring no better tour, then it ends: there is no end of classes
to go on to."""

Class = tuple[int, Word]
"""Goal, from 1, and word."""


@dataclass(frozen=True)
class Carried:
    """A travel graph with the classes along a good tour, and the tour; None without any."""

    graph: TravelGraph
    tour: tuple[int, ...] | None = None


OnGraph = Callable[[TravelGraph], None]
"""Callback with a new travel graph, to which the tours of later progress rows refer."""


def with_carried(
    graph: TravelGraph, clock: Clock, rng: np.random.Generator,
    on_progress: OnProgress | None = None, on_graph: OnGraph | None = None,
    start: Sequence[int] | None = None,
) -> Carried:  # fmt: skip
    """Return the graph with the classes along good tours.

    Parameters
    ----------
    graph : TravelGraph
        From a roadmap that left classes out; another is given back as it is.
    clock : Clock
        Of the run.
    rng : numpy.random.Generator
        Of the searches.
    on_progress : callable, optional
        Told the best tour after each search.
    on_graph : callable, optional
        Called with the graph before each of these rows; it grows from search to search.
    start : sequence of int, optional
        A tour to start from, as vertices of the graph.

    Returns
    -------
    Carried
        The graph and the best tour found in it, or the start.
    """
    carrier = graph.carrier
    if graph.complete or carrier is None or graph.goal_count < 3:
        return Carried(graph, None if start is None else tuple(start))
    share = clock.part(SHARE)
    ways = {0: carrier.ways(0, graph.goal_count)}
    least = least_tethers(graph.costs_to_base, graph.cluster, FEW)
    few = _classes(graph, least)
    best: list[Class] = []
    shortest = np.inf
    if start is not None:
        shortest, best = graph.tour_length(start), _classes(graph, np.array(start, dtype=np.int64))

    def tell(graph: TravelGraph, length: float, classes: list[Class], vertices: int) -> None:
        if on_graph:
            on_graph(graph)
        if on_progress:
            told = (length, classes) if length < shortest else (shortest, best)
            tour = _vertices(graph, told[1])
            on_progress(Progress(clock.elapsed, "carried", told[0], vertices=vertices, tour=tour))

    # from either start the search may end in a tour that the other leads past
    for along in (True, False):
        if share.is_up and best:
            break
        looked = dict.fromkeys([*few, *(best if along else ())])
        if along and not best:
            graph = _put_back(graph, _along_straight_lines(graph, rng, share), looked, share)
        graph, length, classes = _improved(graph, looked, few, ways, rng, share, tell)
        if length < shortest:
            shortest, best = length, classes
    return Carried(graph, _vertices(graph, best) if best else None)


def _improved(
    graph: TravelGraph, looked: dict[Class, None], few: list[Class],
    ways: dict[int, list[tuple[int, Word]]], rng: np.random.Generator, share: Clock,
    tell: Callable[[TravelGraph, float, list[Class], int], None],
) -> tuple[TravelGraph, float, list[Class]]:  # fmt: skip
    """The graph with the classes along better and better tours, and the length and classes of the
    best, from those among the classes looked at on."""
    carrier = graph.carrier
    assert carrier is not None
    most = min(MOST_CLASSES, MOST_PER_GOAL * graph.goal_count)
    best: list[Class] = []
    shortest, vain = np.inf, 0
    while not share.is_up and vain < IN_VAIN:
        try:
            with graph.on_clock(share):
                length, classes = _searched(graph, list(looked), best, rng, share)
        except LimitReachedError:
            break
        improved = length < shortest * (1.0 - 1e-9)
        if improved:
            shortest, best = length, classes
        if not best:
            break
        tell(graph, shortest, best, len(looked))
        if len(looked) > most:
            looked = dict.fromkeys(few)
        looked |= dict.fromkeys([*best, *classes])
        wanted: dict[Class, None] = {}
        from_all = not improved and len(looked) < most // 2
        for goal, word in [(0, ()), *(looked if from_all else (*best, *classes))]:
            if goal not in ways and not share.is_up:
                ways[goal] = carrier.ways(goal, NEAR)
            wanted |= dict.fromkeys((k, concatenate(word, way)) for k, way in ways.get(goal, ()))
        graph = _put_back(graph, [c for c in wanted if c not in looked], looked, share)
        vain = 0 if improved else vain + 1
    return graph, shortest, best


def _along_straight_lines(
    graph: TravelGraph, rng: np.random.Generator, clock: Clock
) -> list[Class]:
    """Classes that the tether comes into along a short tour over straight lines. Where it does not
    reach the next goal, that one's class of least tether is gone on from. When the time is up, what
    was found till then."""
    carrier = graph.carrier
    assert carrier is not None
    apart, places = graph.between_goals(lambda: True), np.arange(graph.goal_count + 1)
    _, tour = _tour_of(Instance(places, apart, places, graph.before), rng, None, clock)
    least = dict(_classes(graph, least_tethers(graph.costs_to_base, graph.cluster, 1)))
    out: list[Class] = []
    word: Word = ()
    for start, goal in pairwise(tour):
        if clock.is_up:
            break
        there = carrier.carried(start, word, goal)
        word = least[goal] if there is None else there
        out.append((goal, word))
    return out


def _put_back(
    graph: TravelGraph, new: list[Class], looked: dict[Class, None], clock: Clock
) -> TravelGraph:
    """The graph with more classes, and what is looked at with those that the tether reaches."""
    assert graph.carrier is not None
    order = graph.before
    graph = graph.carrier.with_classes(new, lambda: clock.is_up)
    graph.before = order
    there = set(_classes(graph, np.arange(1, len(graph))))
    looked |= dict.fromkeys(c for c in new if c in there)
    return graph


def _classes(graph: TravelGraph, vertices: Ints) -> list[Class]:
    return [(int(graph.cluster[v]), graph.signatures[v]) for v in vertices.tolist() if v]


def _vertices(graph: TravelGraph, classes: list[Class]) -> tuple[int, ...]:
    found = graph.vertices_of([g for g, _ in classes], [w for _, w in classes])
    assert found is not None, "classes of the graph"
    return (0, *found)


def _searched(
    graph: TravelGraph, looked: list[Class], best: list[Class], rng: np.random.Generator,
    clock: Clock,
) -> tuple[float, list[Class]]:  # fmt: skip
    """Length and classes of a good tour among some classes, by the bounds of legs: among thin
    obstacles these are next to nothing less than the legs, which take long to measure."""
    core = np.sort(np.array(_vertices(graph, looked)))
    low = graph.lower_bounds(core)
    low[0] = low[:, 0] = graph.costs_to_base[core]
    start = [0, *(g for g, _ in best)] if best else None
    of_core = Instance(graph.cluster[core], low, core, graph.before)
    _, tour = _tour_of(of_core, rng, start, clock)
    return graph.tour_length(tour), _classes(graph, np.array(tour, dtype=np.int64))


def _tour_of(
    instance: Instance, rng: np.random.Generator, start: list[int] | None, clock: Clock
) -> tuple[float, tuple[int, ...]]:
    """A short tour, from an order of goals if there is one, and its length."""
    search = Search(instance, rng, start, clock)
    search.settle()
    goals = instance.clusters - 1
    search.run(min(ROUNDS_PER_GOAL * goals, MOST_ROUNDS), clock)
    return search.best()

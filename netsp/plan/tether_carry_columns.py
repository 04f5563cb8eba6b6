"""Column generation along good tours, for roadmaps that had to leave classes out.

Such a roadmap holds the classes of shortest tether. Over open water with many thin obstacles these
are much alike: they differ in the side on which a tether passes obstacles half way, and tours among
them keep returning towards the base. A good tour goes on from goal to goal and carries the tether
along. So from each class of a tour the tether is carried to nearby goals along the shortest paths.
The classes that it ends in join the graph, and a search over these few classes finds a better tour,
until a search finds none. The first tour is a short one over straight lines, along which the tether
is carried as well; whatever the tether wraps on the way, the robot frees it by driving back along
it. From a warm start the tether is carried in the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.gtsp.instance import cheapest_per_cluster
from netsp.gtsp.search.layers import LayeredInstance
from netsp.gtsp.search.local_search import Search
from netsp.gtsp.travel.result import OnProgress, Progress
from netsp.hsignature import Word, concatenate
from netsp.plan.solve_policy import CarryPolicy
from netsp.roadmap.travel_graph import TravelGraph

Class = tuple[int, Word]
"""Homotopy class of the tether at a goal: number of the goal, from 1, and word."""


@dataclass(frozen=True)
class Carried:
    """A travel graph with the classes along a good tour, and the tour, if there is one."""

    graph: TravelGraph
    tour: tuple[int, ...] | None = None


OnGraph = Callable[[TravelGraph], None]
"""Callback with a new travel graph, to which the tours of later progress rows refer."""


def with_carried(
    graph: TravelGraph,
    clock: Clock,
    rng: np.random.Generator,
    on_progress: OnProgress | None = None,
    on_graph: OnGraph | None = None,
    start: Sequence[int] | None = None,
    policy: CarryPolicy = CarryPolicy(),
) -> Carried:
    """Return the graph with the classes along good tours.

    Parameters
    ----------
    graph : TravelGraph
        Graph of a roadmap that left classes out; a complete one is returned as it is.
    clock : Clock
        Clock of the run.
    rng : numpy.random.Generator
        Random generator of the searches.
    on_progress : callable, optional
        Called with the best tour after each search.
    on_graph : callable, optional
        Called with the graph, which grows from search to search, before each of these calls.
    start : sequence of int, optional
        Warm start, as vertices of the graph.
    policy : CarryPolicy
        Effort of the searches.

    Returns
    -------
    Carried
        The graph and the best tour found in it, or the warm start.
    """
    carrier = graph.carrier
    if graph.is_complete or carrier is None or graph.goal_count < 3:
        return Carried(graph, None if start is None else tuple(start))
    share = clock.part(policy.time_share)
    paths = {0: carrier.ways(0, graph.goal_count)}
    core = cheapest_per_cluster(graph.costs_to_base, graph.cluster, policy.first_classes)
    first = _classes(graph, core)
    best: list[Class] = []
    shortest = np.inf
    if start is not None:
        shortest, best = graph.tour_length(start), _classes(graph, np.array(start, dtype=np.int64))

    def on_best(graph: TravelGraph, length: float, classes: list[Class], vertices: int) -> None:
        if on_graph:
            on_graph(graph)
        if on_progress:
            if not length < shortest:
                length, classes = shortest, best
            tour = _vertices(graph, classes)
            on_progress(Progress(clock.elapsed, "carried", length, vertices=vertices, tour=tour))

    columns = _Columns(first, paths, rng, share, policy, on_best)
    # two starts, because from either one the search may end in a tour that the other avoids
    for along in (True, False):
        if share.is_up and best:
            break
        searched = dict.fromkeys([*first, *(best if along else ())])
        if along and not best:
            new = _along_straight_lines(graph, rng, share, policy)
            graph = _with_classes(graph, new, searched, share)
        graph, length, classes = columns.improve(graph, searched)
        if length < shortest:
            shortest, best = length, classes
    return Carried(graph, _vertices(graph, best) if best else None)


@dataclass
class _Columns:
    """Column generation from searched classes.

    Attributes
    ----------
    first
        Classes of shortest tether.
    paths
        Goals near each goal, and the words of the shortest paths there.
    on_best
        Called after each search with graph, length and classes of the best tour, and the number of
        searched classes.
    """

    first: list[Class]
    paths: dict[int, list[tuple[int, Word]]]
    rng: np.random.Generator
    clock: Clock
    policy: CarryPolicy
    on_best: Callable[[TravelGraph, float, list[Class], int], None]

    def improve(
        self, graph: TravelGraph, searched: dict[Class, None]
    ) -> tuple[TravelGraph, float, list[Class]]:
        """Return the graph with the classes along better and better tours, and the best tour.

        After a vain search the tether is carried on from all searched classes, if they are few.

        Returns
        -------
        tuple
            Graph, length of the best tour, and its classes.
        """
        policy = self.policy
        limit = min(policy.max_classes, policy.max_classes_per_goal * graph.goal_count)
        best: list[Class] = []
        shortest, vain_searches = np.inf, 0
        while not self.clock.is_up and vain_searches < policy.max_vain_searches:
            try:
                with graph.on_clock(self.clock):
                    length, classes = self._search(graph, list(searched), best)
            except LimitReachedError:
                break
            improved = length < shortest * (1.0 - 1e-9)
            if improved:
                shortest, best = length, classes
            if not best:
                break
            self.on_best(graph, shortest, best, len(searched))
            if len(searched) > limit:
                searched = dict.fromkeys(self.first)
            searched |= dict.fromkeys([*best, *classes])
            from_all = not improved and len(searched) < limit // 2
            wanted = self._carried(graph, [*(searched if from_all else (*best, *classes))])
            new = [c for c in wanted if c not in searched]
            graph = _with_classes(graph, new, searched, self.clock)
            vain_searches = 0 if improved else vain_searches + 1
        return graph, shortest, best

    def _carried(self, graph: TravelGraph, classes: list[Class]) -> dict[Class, None]:
        """Return the classes that the tether comes into, carried from the base and some classes."""
        carrier = graph.carrier
        assert carrier is not None
        wanted: dict[Class, None] = {}
        for goal, word in [(0, ()), *classes]:
            if goal not in self.paths and not self.clock.is_up:
                self.paths[goal] = carrier.ways(goal, self.policy.near_goals)
            near = self.paths.get(goal, ())
            wanted |= dict.fromkeys((k, concatenate(word, path)) for k, path in near)
        return wanted

    def _search(
        self, graph: TravelGraph, searched: list[Class], best: list[Class]
    ) -> tuple[float, list[Class]]:
        """Return length and classes of a good tour among some classes, by bounds of legs.

        Among thin obstacles bounds are almost as long as the legs, which take long to measure.
        """
        core = np.sort(np.array(_vertices(graph, searched)))
        bounds = graph.lower_bounds(core)
        bounds[0] = bounds[:, 0] = graph.costs_to_base[core]
        start = [0, *(g for g, _ in best)] if best else None
        instance = LayeredInstance(graph.cluster[core], bounds, core, graph.before)
        _, tour = _search(instance, self.rng, start, self.clock, self.policy)
        return graph.tour_length(tour), _classes(graph, np.array(tour, dtype=np.int64))


def _along_straight_lines(
    graph: TravelGraph, rng: np.random.Generator, clock: Clock, policy: CarryPolicy = CarryPolicy()
) -> list[Class]:
    """Return the classes in which the tether ends along a short tour over straight lines.

    Where the tether does not reach the next goal, it continues from the class of shortest tether of
    that goal. The list is shorter if the clock is up.
    """
    carrier = graph.carrier
    assert carrier is not None
    distances, places = graph.distances_between_goals(lambda: True), np.arange(graph.goal_count + 1)
    instance = LayeredInstance(places, distances, places, graph.before)
    _, tour = _search(instance, rng, None, clock, policy)
    shortest_word = dict(
        _classes(graph, cheapest_per_cluster(graph.costs_to_base, graph.cluster, 1))
    )
    out: list[Class] = []
    word: Word = ()
    for start, goal in pairwise(tour):
        if clock.is_up:
            break
        carried = carrier.carried(start, word, goal)
        word = shortest_word[goal] if carried is None else carried
        out.append((goal, word))
    return out


def _with_classes(
    graph: TravelGraph, new: list[Class], searched: dict[Class, None], clock: Clock
) -> TravelGraph:
    """Return the graph with more classes; the new ones that the tether reaches join `searched`."""
    assert graph.carrier is not None
    order = graph.before
    graph = graph.carrier.with_classes(new, lambda: clock.is_up)
    graph.before = order
    reached = set(_classes(graph, np.arange(1, len(graph))))
    searched |= dict.fromkeys(c for c in new if c in reached)
    return graph


def _classes(graph: TravelGraph, vertices: Ints) -> list[Class]:
    return [(int(graph.cluster[v]), graph.signatures[v]) for v in vertices.tolist() if v]


def _vertices(graph: TravelGraph, classes: list[Class]) -> tuple[int, ...]:
    found = graph.vertices_of([g for g, _ in classes], [w for _, w in classes])
    assert found is not None, "classes of the graph"
    return (0, *found)


def _search(
    instance: LayeredInstance,
    rng: np.random.Generator,
    start: list[int] | None,
    clock: Clock,
    policy: CarryPolicy,
) -> tuple[float, tuple[int, ...]]:
    """Return length and vertices of a short tour, searched from an order of goals if given."""
    search = Search(instance, rng, start, clock)
    search.settle()
    goals = instance.clusters - 1
    search.run(min(policy.rounds_per_goal * goals, policy.max_rounds), clock)
    return search.best()

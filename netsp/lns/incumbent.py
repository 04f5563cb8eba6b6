"""A run of a solver that proves, with local search for its incumbents.

While legs are only bounded the search sees a core of classes whose legs it has measured; in the end
it sees all that are left.
"""

from __future__ import annotations

import numpy as np

from netsp.clock import TimeLimit
from netsp.legcosts import MEASURE_AT_ONCE, LegCosts
from netsp.lns.layers import Instance
from netsp.lns.search import Search
from netsp.result import OPTIMALITY_TOLERANCE, OnProgress
from netsp.run import Run
from netsp.travel import Ints, TravelGraph, least_tethers

CORE = 800
"""About so many vertices, those of least tether, are measured for the heuristic while the other
legs are only bounded."""

FEW_CLASSES = 3
"""Classes per goal of the first tour of all."""

MOST_CLASSES = 12
"""Most classes per goal among them."""


class SearchingRun(Run):
    """A run with local search. search_rounds : rounds of ruin and recreate of one search."""

    def __init__(
        self,
        graph: TravelGraph,
        time_limit: TimeLimit = None,
        iteration_limit: int | None = None,
        on_progress: OnProgress | None = None,
        *,
        rng: np.random.Generator | None = None,
        search_rounds: int = 500,
    ) -> None:
        super().__init__(graph, time_limit, iteration_limit, on_progress)
        self.rng = rng or np.random.default_rng(0)
        self.search_rounds = search_rounds
        self.bound = 0.0
        self._core: tuple[int, Instance] | None = None

    def begin(self) -> None:
        """A first tour, among few classes, before all legs are bounded: with very many classes that
        takes long, and whoever stops the run meanwhile wants a tour."""
        graph = self.graph
        if self.tour is not None or len(graph) <= MEASURE_AT_ONCE or not graph.roadmapped:
            return
        core = least_tethers(graph.costs_to_base, graph.cluster, FEW_CLASSES)
        search = Search(Instance.among(graph, core), self.rng, clock=self.clock)
        search.settle()
        self.take(search)
        self.report("begun", vertices=len(graph))

    def instance(self, costs: LegCosts, more: Ints) -> Instance:
        """What the heuristic searches: everything if it is measured, else the classes of least
        tether, the incumbent's, and more."""
        if costs.exact is None:
            if self._core is None or self._core[0] != len(costs):
                self._core = len(costs), Instance(costs.cluster, costs.values, costs.vertices)
            return self._core[1]
        classes = min(max(3, CORE // (self.graph.goal_count + 1)), MOST_CLASSES)
        least = least_tethers(costs.values[0], costs.cluster, classes)
        own = np.searchsorted(costs.vertices, np.array(self.tour or (0,)))
        core = np.unique(np.concatenate([least, own, more]))
        costs.measure(core)
        return Instance(costs.cluster[core], costs.values[np.ix_(core, core)], costs.vertices[core])

    def search(self, costs: LegCosts, more: Ints | None = None) -> None:
        """Local search, then ruin and recreate, from the incumbent if there is one."""
        instance = self.instance(costs, np.zeros(0, dtype=np.int64) if more is None else more)
        start = None if self.tour is None else self.graph.cluster[list(self.tour)]
        search = Search(instance, self.rng, start, self.clock)
        search.settle()
        search.run(self.search_rounds, self.clock)
        self.take(search)

    def take(self, search: Search) -> None:
        """Offer what a search found; its legs are measured, so its length is known."""
        length, tour = search.best()
        self.offer(tour, length=length)

    @property
    def cutoff(self) -> float:
        """Tours no shorter than this are of no interest: half the tolerance below the incumbent."""
        return self.length * (1.0 - 0.5 * OPTIMALITY_TOLERANCE)

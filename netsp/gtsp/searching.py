"""A run of a solver that proves, with local search for its incumbents.

While legs are only bounded, or many vertices are left, the search sees a core of classes, those of
least tether and those beside the best tour (`netsp.gtsp.neighbourhood`); in the end it sees all
that are left.

With very many classes the proof is made over the core first (`SearchingRun.core`): its tour is
often the best of all, and the program over all classes begins with its legs and cuts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Self

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.gtsp.cost_matrix import MEASURE_AT_ONCE, CostMatrix
from netsp.gtsp.limits import Limits
from netsp.gtsp.neighbourhood import classes_near_tour, searched_classes_per_goal
from netsp.gtsp.search.layers import Instance
from netsp.gtsp.search.local_search import Search
from netsp.gtsp.solver_run import SLIVER, RunStopped, SolverRun
from netsp.gtsp.travel.graph import TravelGraph, least_tethers
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE

CORE = 800
"""About so many vertices, those of least tether, are proven over before all are."""

SEARCHED_WHOLE = 1200
"""So many vertices whose legs are measured are searched altogether."""

FEW_CLASSES = 3
"""Classes per goal of the first tour of all."""

MOST_CLASSES = 12
"""Most classes per goal among them."""

CORE_SHARE = 0.4
"""Part of the time that is left which the core may take."""

TURNS, IN_VAIN, TURNS_SHARE = 8, 2, 0.1
"""So many times at most, until so many in a row were in vain, and in that part of the time, a tour
is sought beside the best one."""

MOST_ENDS = 8
"""Ends of searches that are kept."""

ENOUGH_BESIDE = 10
"""With fewer classes of a goal than these, a proof over those of least tether leaves cuts that are
worth more for all classes than those beside the tour: with 100 goals at tether 500, 2 % of a gap
are left where 5 % are; with 60 goals it is the other way round."""

LARGER, LARGER_OF_MANY, OF_MANY = 3.0, 1.5, 100
"""The core comes first where there are more than so many times as many vertices in all: below that
it costs more than it saves, and shows no bound meanwhile. With so many goals it is worth it sooner:
in a world of 200 with 1562 classes the program over all of them is as far after 72 s as it is after
140 s without."""


class SearchingRun(SolverRun):
    """A run with local search.

    Parameters
    ----------
    search_rounds
        Rounds of ruin and recreate of one search.
    outer
        For a run over a core, the run over all classes and the core's vertices there: its
        incumbent is updated, too, and its report shows it; bounds of the core mean nothing to it.
    local_optima
        Tours in which the last searches ended, `MOST_ENDS` at most, no two the same.
    """

    def __init__(
        self,
        graph: TravelGraph,
        limits: Limits | None = None,
        *,
        search_rounds: int = 500,
    ) -> None:
        super().__init__(graph, limits)
        self.search_rounds = search_rounds
        self.outer: tuple[SearchingRun, Ints] | None = None
        self.local_optima: list[tuple[int, ...]] = []
        self.bound = 0.0
        self._core: tuple[int, Instance] | None = None

    def run_over(self, graph: TravelGraph, limits: Limits) -> Self:
        """Return a run over another graph with the same settings."""
        return type(self)(graph, limits, search_rounds=self.search_rounds)

    def find_first_tour(self) -> None:
        """A first tour, among few classes, before all legs are bounded: with very many classes that
        takes long, and whoever stops the run meanwhile wants a tour."""
        graph = self.graph
        if self.tour is not None or len(graph) <= MEASURE_AT_ONCE or not graph.roadmapped:
            return
        core = least_tethers(graph.costs_to_base, graph.cluster, FEW_CLASSES)
        search = Search(Instance.among(graph, core), self.rng, clock=self.clock)
        search.settle()
        self.offer_incumbent_from(search)
        self.report("begun", vertices=len(graph))

    def search_near_incumbent(self) -> Ints:
        """Search among the classes of least tether, then among those beside the best tour, as long
        as that is improved; the classes of the last search."""
        graph, clock = self.graph, self.clock.part(TURNS_SHARE)
        core = least_tethers(graph.costs_to_base, graph.cluster, self.searched_classes_per_goal)
        vain = 0
        for _ in range(TURNS):
            before = self.length
            core = np.union1d(core, np.array(self.tour or (0,), dtype=np.int64))
            self._search(Instance.among(graph, core), clock)
            self.report("begun", vertices=len(graph))
            vain = 0 if self.length < before else vain + 1
            if clock.is_up or self.tour is None or vain == IN_VAIN:
                break
            core = self._beside()
        return core

    def on_cover_bound(self, bound: float, cells: int, classes: Ints) -> tuple[int, ...] | None:
        """Take the bound of a cover of so many cells, and search among classes, if there are any,
        and the tour's; the best tour."""
        self.raise_bound(bound)
        if len(classes):
            core = np.union1d(classes, np.array(self.tour or (0,), dtype=np.int64))
            self._search(Instance.among(self.graph, core), self.clock.part(TURNS_SHARE))
        self.report("covers", vertices=cells)
        return self.tour

    def search_afresh(self, count: int, clock: Clock) -> list[tuple[int, ...]]:
        """The tours of so many searches, each from the start, among the classes of least tether and
        those beside the best tour; the one that was best before comes first."""
        graph = self.graph
        core = least_tethers(graph.costs_to_base, graph.cluster, self.searched_classes_per_goal)
        if self.tour is not None:
            core = np.union1d(core, self._beside())
        instance = Instance.among(graph, core)
        tours = [] if self.tour is None else [self.tour]
        for _ in range(count):
            if clock.is_up:
                break
            search = Search(instance, self.rng, clock=clock)
            search.settle()
            search.run(self.search_rounds, clock)
            length, tour = search.best()
            self.update_incumbent(tour, length=length)
            self.report("begun", vertices=len(graph))
            if np.isfinite(length):
                tours.append(tour)
        return tours

    def _beside(self) -> Ints:
        """The classes beside the best tour."""
        graph, tour = self.graph, self.tour or (0,)
        return classes_near_tour(
            graph.costs_to_base, graph.cluster, graph.lower_bounds(rows=tour), tour,
            self.searched_classes_per_goal,
        )  # fmt: skip

    @contextmanager
    def core(self) -> Iterator[Self | None]:
        """A run like this one over the classes of least tether, and those beside the best tour if
        there is room for enough of them; None where they are too few to be worth it. Its share of
        the time begins with `start_time_share`; when that is over, the body is left early."""
        graph = self.graph
        core = least_tethers(graph.costs_to_base, graph.cluster, self.core_classes_per_goal)
        larger = LARGER_OF_MANY if graph.goal_count >= OF_MANY else LARGER
        few = len(graph) <= max(MEASURE_AT_ONCE, larger * len(core))
        if few or not graph.roadmapped or self.outer is not None:
            yield None
            return
        beside = self.search_near_incumbent()
        if self.core_classes_per_goal >= ENOUGH_BESIDE:
            core = beside
        core = np.union1d(core, np.array(self.tour or (0,), dtype=np.int64))
        inner = self.run_over(graph.subgraph(core), Limits(self.clock, rng=self.rng))
        inner.iteration_limit = self.iteration_limit - self.iterations
        inner.outer = self, core
        if self.tour is not None:
            inner.update_incumbent(np.searchsorted(core, np.array(self.tour)).tolist())
        try:
            yield inner
        except (RunStopped, LimitReachedError):
            self.check()
        finally:
            self.iterations += inner.iterations

    def start_time_share(self) -> None:
        """Give a run over a core its part of the time that is left now."""
        self.clock = self.clock.part(CORE_SHARE)

    @property
    def core_classes_per_goal(self) -> int:
        """In the core."""
        return min(max(3, CORE // (self.graph.goal_count + 1)), MOST_CLASSES)

    @property
    def searched_classes_per_goal(self) -> int:
        """In a search."""
        return searched_classes_per_goal(self.graph.goal_count)

    def update_incumbent(
        self,
        tour: Sequence[int] | None,
        walk: Sequence[int] | None = None,
        length: float | None = None,
    ) -> bool:
        """As `SolverRun.update_incumbent`; a tour of the core is one of the outer run as well."""
        taken = super().update_incumbent(tour, walk, length)
        if taken and self.outer and self.tour is not None:
            outer, core = self.outer
            outer.update_incumbent(core[list(self.tour)].tolist(), length=self.length)
        return taken

    def report(self, stage: str, **more: Any) -> None:
        """As `SolverRun.report`; work on the core is reported by the outer run."""
        if self.outer is None:
            super().report(stage, **more)
        else:
            self.outer[0].report("core", **more)

    def searches_all_vertices(self, costs: CostMatrix) -> bool:
        """Whether the heuristic searches all vertices that are left."""
        few = len(costs) <= SEARCHED_WHOLE or not self.graph.roadmapped
        return costs.exact is None and costs.rows is None and few

    def instance(self, costs: CostMatrix, more: Ints) -> Instance:
        """What the heuristic searches: everything if it is not too much, else the classes of least
        tether, those beside the incumbent, its own, and more."""
        if self.searches_all_vertices(costs):
            if self._core is None or self._core[0] != len(costs):
                values = np.asarray(costs.values, dtype=np.float64)
                whole = Instance(costs.cluster, values, costs.vertices, self.graph.before)
                self._core = len(costs), whole
            return self._core[1]
        tethers, own = (
            costs.base_costs,
            np.searchsorted(costs.vertices, np.array(self.tour or (0,))),
        )
        if self.tour is None:
            some = least_tethers(tethers, costs.cluster, self.searched_classes_per_goal)
        else:
            some = classes_near_tour(
                tethers,
                costs.cluster,
                costs.lower_bounds_from(own),
                own,
                self.searched_classes_per_goal,
            )
        core = np.unique(np.concatenate([some, own, more]))
        return Instance(
            costs.cluster[core], costs.among(core), costs.vertices[core], self.graph.before
        )

    def search(self, costs: CostMatrix, more: Ints | None = None) -> None:
        """Local search, then ruin and recreate, from the incumbent if there is one; again beside a
        better tour, where not all classes are looked at."""
        more = np.zeros(0, dtype=np.int64) if more is None else more
        clock = self.clock.part(TURNS_SHARE)
        vain = 0
        for _ in range(TURNS):
            before = self.length
            self._search(self.instance(costs, more), clock, rounded=costs.rounded)
            vain = 0 if self.length < before else vain + 1
            if self.searches_all_vertices(costs) or clock.is_up or vain == IN_VAIN:
                break

    def _search(self, instance: Instance, clock: Clock, *, rounded: bool = False) -> None:
        start = None if self.tour is None else self.graph.cluster[list(self.tour)]
        search = Search(instance, self.rng, start, clock)
        search.settle()
        search.run(self.search_rounds, clock)
        self.offer_incumbent_from(search, rounded=rounded)
        length, tour = search.best()
        if np.isfinite(length) and tour not in self.local_optima:
            self.local_optima = [*self.local_optima[1 - MOST_ENDS :], tour]

    def offer_incumbent_from(self, search: Search, *, rounded: bool = False) -> None:
        """Offer what a search found; its legs are measured, so its length is known unless they were
        rounded."""
        length, tour = search.best()
        self.update_incumbent(tour, length=None if rounded else length)

    @property
    def cutoff(self) -> float:
        """Tours no shorter than this are of no interest: half the tolerance below the incumbent, or
        the next multiple of a grain."""
        length, grain = min(self.length, self.known_length), self.graph.grain
        return min(length * (1.0 - 0.5 * OPTIMALITY_TOLERANCE), length - grain * (1.0 - 2 * SLIVER))

"""A run of a solver that proves, with local search for its incumbents.

While legs are only bounded, or many vertices remain, a search sees a selection of vertices: those
nearest to the base and those near the incumbent (`netsp.gtsp.neighbourhood`). In the end it sees
all that remain.

With very many vertices the proof is made over a core first (`SearchingRun.core`): its tour is often
the shortest of all, and the program over all vertices begins with its legs and cuts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Self

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.gtsp.cost_matrix import CostMatrix
from netsp.gtsp.gtsp_policy import GtspPolicy
from netsp.gtsp.instance import Instance, cheapest_per_cluster
from netsp.gtsp.limits import Limits
from netsp.gtsp.neighbourhood import classes_near_tour
from netsp.gtsp.resumable import Steps, run_to_end
from netsp.gtsp.search.layers import LayeredInstance
from netsp.gtsp.search.local_search import Search
from netsp.gtsp.solver_run import BOUND_ROUNDING, RunStopped, SolverRun
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE


class SearchingRun(SolverRun):
    """A run with local search.

    Parameters
    ----------
    search_rounds
        Rounds of ruin and recreate of one search.
    policy
        Policy of costs, searches and the core.

    Attributes
    ----------
    gtsp_policy
        Policy of costs, searches and the core; subclasses hold further policies.
    outer
        For a run over a core: the run over all vertices, and the core's vertices there. That run
        adopts the incumbents of the core and reports; bounds of the core stay here.
    local_optima
        Tours in which the last searches ended, no two the same.
    """

    def __init__(
        self,
        graph: Instance,
        limits: Limits | None = None,
        *,
        search_rounds: int = 500,
        policy: GtspPolicy = GtspPolicy(),
    ) -> None:
        super().__init__(graph, limits, policy=policy.costs)
        self.gtsp_policy = policy
        self.search_rounds = search_rounds
        self.outer: tuple[SearchingRun, Ints] | None = None
        self.local_optima: list[tuple[int, ...]] = []
        self.bound = 0.0
        self._whole: tuple[int, LayeredInstance] | None = None

    def find_first_tour(self) -> None:
        """Search for a tour among few vertices, before legs are bounded.

        With very many vertices bounds take long, and a run that is stopped meanwhile should have a
        tour.
        """
        graph, policy = self.graph, self.gtsp_policy
        is_small = len(graph) <= policy.costs.max_measured_vertices
        if self.tour is not None or is_small or graph.has_cost_matrix:
            return
        core = cheapest_per_cluster(
            graph.costs_to_base, graph.cluster, policy.proof_search.first_tour_vertices
        )
        search = Search(self.instance_among(core), self.rng, clock=self.clock)
        search.settle()
        self.offer_incumbent_from(search)
        self.report("begun", vertices=len(graph))

    def search_near_incumbent(self) -> Ints:
        """Search near the base, then near the incumbent while it improves.

        Returns
        -------
        ndarray of int
            Vertices of the last search.
        """
        graph, policy = self.graph, self.gtsp_policy.proof_search
        clock = self.clock.part(policy.search_time_share)
        core = cheapest_per_cluster(
            graph.costs_to_base, graph.cluster, self.searched_classes_per_goal
        )
        vain_searches = 0
        for _ in range(policy.max_searches):
            before = self.length
            core = np.union1d(core, np.array(self.tour or (0,), dtype=np.int64))
            self._search(self.instance_among(core), clock)
            self.report("begun", vertices=len(graph))
            vain_searches = 0 if self.length < before else vain_searches + 1
            if clock.is_up or self.tour is None or vain_searches == policy.max_vain_searches:
                break
            core = self.classes_near_incumbent()
        return core

    def on_cover_bound(self, bound: float, cells: int, classes: Ints) -> tuple[int, ...] | None:
        """Raise the bound to that of a cover, and search.

        Parameters
        ----------
        bound
            Lower bound that the cover proves.
        cells
            Number of cells of the cover.
        classes
            Vertices to search, besides those of the incumbent; none for no search.

        Returns
        -------
        tuple of int or None
            Incumbent.
        """
        self.raise_bound(bound)
        if len(classes):
            core = np.union1d(classes, np.array(self.tour or (0,), dtype=np.int64))
            share = self.gtsp_policy.proof_search.search_time_share
            self._search(self.instance_among(core), self.clock.part(share))
        self.report("covers", vertices=cells)
        return self.tour

    def search_afresh(self, count: int, clock: Clock) -> list[tuple[int, ...]]:
        """Search several times from scratch, near the base and the incumbent.

        Returns
        -------
        list of tuple of int
            The incumbent, if there is one, and the tour of each search.
        """
        graph = self.graph
        core = cheapest_per_cluster(
            graph.costs_to_base, graph.cluster, self.searched_classes_per_goal
        )
        if self.tour is not None:
            core = np.union1d(core, self.classes_near_incumbent())
        instance = self.instance_among(core)
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

    def classes_near_incumbent(self) -> Ints:
        """Return the vertices near the incumbent or the base that a search sees."""
        graph, tour = self.graph, self.tour or (0,)
        return classes_near_tour(
            graph.costs_to_base,
            graph.cluster,
            graph.lower_bounds(rows=tour),
            tour,
            self.searched_classes_per_goal,
            self.gtsp_policy.neighbourhood,
        )

    def instance_among(self, vertices: Ints) -> LayeredInstance:
        """Return the instance of some vertices that a search sees."""
        return LayeredInstance.among(self.graph, vertices, self.gtsp_policy.local_search)

    @contextmanager
    def core(self) -> Iterator[Self | None]:
        """Make a run like this one over a core, and leave the body early if its time is up.

        The core holds the vertices near the base, or those near the incumbent if there is room for
        enough of them. The run's share of the time begins with `start_time_share`.

        Yields
        ------
        SearchingRun or None
            The run; None if a core is too large a part of all vertices to pay.
        """
        graph, policy = self.graph, self.gtsp_policy
        core = cheapest_per_cluster(graph.costs_to_base, graph.cluster, self.core_classes_per_goal)
        ratio = policy.proof_search.core_ratio(graph.goal_count)
        is_small = len(graph) <= max(policy.costs.max_measured_vertices, ratio * len(core))
        if is_small or graph.has_cost_matrix or self.outer is not None:
            yield None
            return
        near = self.search_near_incumbent()
        if self.core_classes_per_goal >= policy.proof_search.min_near_tour_per_cluster:
            core = near
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

    def run_over(self, graph: Instance, limits: Limits) -> Self:
        """Return a run over another graph with the same settings."""
        return type(self)(graph, limits, search_rounds=self.search_rounds, policy=self.gtsp_policy)

    def start_time_share(self) -> None:
        """Begin the share of the time left that a run over a core has."""
        self.clock = self.clock.part(self.gtsp_policy.proof_search.core_time_share)

    @property
    def core_classes_per_goal(self) -> int:
        """Number of vertices of each cluster in the core."""
        return self.gtsp_policy.proof_search.core_vertices_per_cluster(self.graph.goal_count)

    @property
    def searched_classes_per_goal(self) -> int:
        """Number of vertices of each cluster in a search."""
        return self.gtsp_policy.neighbourhood.vertices_per_cluster(self.graph.goal_count)

    def update_incumbent(
        self,
        tour: Sequence[int] | None,
        walk: Sequence[int] | None = None,
        length: float | None = None,
    ) -> bool:
        """Update the incumbent of this run and, for a run over a core, of the outer run."""
        updated = super().update_incumbent(tour, walk, length)
        if updated and self.outer and self.tour is not None:
            outer, core = self.outer
            outer.update_incumbent(core[list(self.tour)].tolist(), length=self.length)
        return updated

    def report(self, stage: str, **more: Any) -> None:
        """Report as `SolverRun.report`; for a run over a core the outer run does."""
        if self.outer is None:
            super().report(stage, **more)
        else:
            self.outer[0].report("core", **more)

    def searches_all_vertices(self, costs: CostMatrix) -> bool:
        """Return whether a search sees all remaining vertices."""
        is_small = len(costs) <= self.gtsp_policy.proof_search.max_whole_search
        is_small = is_small or self.graph.has_cost_matrix
        return costs.exact is None and costs.rows is None and is_small

    def instance(self, costs: CostMatrix, more: Ints) -> LayeredInstance:
        """Return the instance that is searched.

        It holds all remaining vertices if they are few. Otherwise it holds those near the base or
        the incumbent, those of the incumbent, and `more` (positions).
        """
        policy = self.gtsp_policy
        if self.searches_all_vertices(costs):
            if self._whole is None or self._whole[0] != len(costs):
                values = np.asarray(costs.values, dtype=np.float64)
                whole = LayeredInstance(
                    costs.cluster, values, costs.vertices, self.graph.before, policy.local_search
                )
                self._whole = len(costs), whole
            return self._whole[1]
        base_costs = costs.base_costs
        tour_rows = np.searchsorted(costs.vertices, np.array(self.tour or (0,)))
        count = self.searched_classes_per_goal
        if self.tour is None:
            near = cheapest_per_cluster(base_costs, costs.cluster, count)
        else:
            bounds = costs.lower_bounds_from(tour_rows)
            near = classes_near_tour(
                base_costs, costs.cluster, bounds, tour_rows, count, policy.neighbourhood
            )
        core = np.unique(np.concatenate([near, tour_rows, more]))
        return LayeredInstance(
            costs.cluster[core],
            costs.among(core),
            costs.vertices[core],
            self.graph.before,
            policy.local_search,
        )

    def search(self, costs: CostMatrix, more: Ints | None = None) -> None:
        """Search from the incumbent, and again near a better one if not all vertices are seen."""
        policy = self.gtsp_policy.proof_search
        more = np.zeros(0, dtype=np.int64) if more is None else more
        clock = self.clock.part(policy.search_time_share)
        vain_searches = 0
        for _ in range(policy.max_searches):
            before = self.length
            self._search(self.instance(costs, more), clock, rounded=costs.rounded)
            vain_searches = 0 if self.length < before else vain_searches + 1
            if (
                self.searches_all_vertices(costs)
                or clock.is_up
                or vain_searches == policy.max_vain_searches
            ):
                break

    def _search(self, instance: LayeredInstance, clock: Clock, *, rounded: bool = False) -> None:
        run_to_end(self.search_steps(instance, clock, rounded=rounded))

    def search_steps(
        self, instance: LayeredInstance, clock: Clock, *, rounded: bool = False
    ) -> Steps[None]:
        """Search an instance from the incumbent, with a step for each temperature."""
        start = None if self.tour is None else self.graph.cluster[list(self.tour)]
        search = Search(instance, self.rng, start, clock)
        search.settle()
        done, temperature_steps = 0, self.gtsp_policy.local_search.temperature_steps
        rounds_per_step = max(1, self.search_rounds // temperature_steps)
        for count in search.chunks(self.search_rounds, clock):
            done += count
            if done % rounds_per_step == 0:
                yield
        self.offer_incumbent_from(search, rounded=rounded)
        length, tour = search.best()
        if np.isfinite(length) and tour not in self.local_optima:
            kept = self.gtsp_policy.proof_search.max_local_optima
            self.local_optima = [*self.local_optima[1 - kept :], tour]

    def offer_incumbent_from(self, search: Search, *, rounded: bool = False) -> None:
        """Update the incumbent with the best tour of a search, whose length is known exactly unless
        its costs were rounded."""
        length, tour = search.best()
        self.update_incumbent(tour, length=None if rounded else length)

    @property
    def cutoff(self) -> float:
        """Length from which on tours are of no interest.

        It is half the tolerance below the incumbent, or the next lower multiple of the grain.
        """
        length, grain = min(self.length, self.known_length), self.graph.grain
        by_grain = length - grain * (1.0 - 2 * BOUND_ROUNDING)
        return min(length * (1.0 - 0.5 * OPTIMALITY_TOLERANCE), by_grain)

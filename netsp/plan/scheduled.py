"""`auto` by a scheduler: every source of a bound or a tour is a task, and none is chosen by size.

The tasks are a search, one that never ends, dynamic programming over sets of goals, the bound over
goals, covers, ng-walks, cutting planes over a core of the classes, and cutting planes with branch
and cut over all classes. They share one incumbent and one bound. Which of them runs next is decided
by what they have closed of the gap (`netsp.gtsp.scheduler`); estimates of their time take the place
of the sizes at which `netsp.plan.auto` changes its route.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock
from netsp.gtsp.cost_matrix import CostMatrix
from netsp.gtsp.cost_oracle import Estimate
from netsp.gtsp.dp.dp_solver import fits as walks_fit
from netsp.gtsp.dp.dp_solver import walk_steps
from netsp.gtsp.instance import Instance, cheapest_per_cluster
from netsp.gtsp.limits import Limits
from netsp.gtsp.resumable import Steps
from netsp.gtsp.scheduler import Scheduler, Task
from netsp.gtsp.solver_run import RunStopped
from netsp.gtsp.travel.result import Result
from netsp.mip.cover_bounds import GoalBound
from netsp.mip.cuts import Cut
from netsp.mip.goal_relaxation import CoverCosts, goal_bound_steps
from netsp.mip.lp_warm_start import WarmStart
from netsp.mip.merging import merge
from netsp.mip.mip_solver import MipRun
from netsp.model.bound_scope import LowerBound
from netsp.model.solution import Status
from netsp.plan import exact
from netsp.plan.solve_policy import SolvePolicy

NO_VERTICES: Ints = np.zeros(0, dtype=np.int64)
"""Empty selection of vertices."""


def solve(graph: Instance, backend: str, policy: SolvePolicy, limits: Limits) -> Result:
    """Solve by tasks that share the time; iterations are those of the tasks."""
    run = ScheduledRun(graph, limits, policy)
    with run.until_stopped():
        run.update_incumbent(limits.warm_start)
        if not run.solve_if_trivial():
            for _ in Portfolio(run, backend).steps():
                pass
    return run.finish("proven" if run.is_done else "open")


class ScheduledRun(MipRun):
    """Run whose incumbent and bound all tasks share."""

    def __init__(self, graph: Instance, limits: Limits, policy: SolvePolicy) -> None:
        rounds = policy.search_effort.rounds(graph.goal_count)
        super().__init__(graph, limits, search_rounds=rounds, policy=policy.mip)
        self.solve_policy = policy

    def update_incumbent(
        self,
        tour: Sequence[int] | None,
        walk: Sequence[int] | None = None,
        length: float | None = None,
    ) -> bool:
        """Update the incumbent with a tour below the cutoff.

        A tour above it may use legs that another task has fixed out.
        """
        if tour is not None and self.tour is not None and self.graph.is_tour(tour):
            if length is None:
                length = self.graph.walk_length(walk) if walk else self.graph.tour_length(tour)
            if not length < self.cutoff:
                return False
        return super().update_incumbent(tour, walk, length)

    def run_over(self, graph: Instance, limits: Limits) -> ScheduledRun:
        """Return a run over another graph with the same settings."""
        return ScheduledRun(graph, limits, self.solve_policy)

    def gap(self) -> float:
        """Return the gap to the bound that holds for the problem; 0 once it is closed."""
        if self.tour is None:
            return math.inf
        bound = LowerBound(max(self.bound or 0.0, 0.0), self.graph.scope)
        problem_bound = self.graph.bound_for_problem(bound)
        if problem_bound is None:
            return self.length
        return 0.0 if problem_bound.proves(self.length) else self.length - problem_bound.length


class Portfolio:
    """Tasks over the tours of one run.

    Parameters
    ----------
    run : ScheduledRun
        Run that the tasks share.
    backend : str
        Backend of the cutting planes.
    """

    def __init__(self, run: ScheduledRun, backend: str) -> None:
        self.run, self.graph, self.backend = run, run.graph, backend
        self.policy = run.solve_policy
        self.times = run.solve_policy.task_times
        self.costs: CostMatrix | None = None
        self.core: ScheduledRun | None = None
        self.goal_bound: GoalBound | None = None
        self.has_searched_all = False
        self.tasks = self._tasks()

    def steps(self) -> Steps[None]:
        """Run the tasks until the gap is closed, or none is left but a search without end."""
        run = self.run
        scheduler = Scheduler(run, self.tasks, run.gap, self.policy.scheduler)
        for _ in scheduler.steps():
            yield
            if (
                all(t.is_over for t in self.tasks if t.name != "search on")
                and run.clock.limit is None
            ):
                return

    def _tasks(self) -> list[Task]:
        graph, policy = self.graph, self.policy
        search = self._estimate_of_search()
        search_on = Estimate(self.times.further_searches * search.seconds, search.bytes)
        tasks = [
            Task("search", self._search, search),
            Task("search on", self._search_on, search_on),
        ]
        if exact.fits(graph, policy.subsets):
            subsets = Task("subsets", self._subsets, exact.estimate(graph, policy.subsets))
            is_quicker = subsets.estimate.seconds < search.seconds
            tasks.insert(0 if is_quicker else 1, subsets)  # it needs no tour to begin with
        if len(graph.before):
            if walks_fit(graph, policy.gtsp.walks):
                tasks.append(Task("walks", self._walks, self._estimate_of_walks(len(graph))))
            tasks.append(Task("free", self._without_order, self._estimate_of_cuts(len(graph))))
            return tasks
        pairs = (graph.goal_count + 1) ** 2
        tasks.append(Task("goals", self._goals, Estimate(self.times.s_per_goal_pair * pairs, 0.0)))
        if graph.parity_oracle is not None:
            tasks.append(Task("covers", self._covers, self._estimate_of_covers()))
        if walks_fit(graph, policy.gtsp.walks):
            tasks.append(Task("walks", self._walks, self._estimate_of_walks(len(graph))))
        if not graph.has_cost_matrix:
            core = self.run.core_classes_per_goal * graph.goal_count
            if self.times.min_core_ratio * core < len(graph):
                tasks.append(Task("core", self._core, self._estimate_of_core(core)))
        tasks.append(Task("cuts", self._cuts, self._estimate_of_cuts(len(graph))))
        return tasks

    def _searches_all(self) -> bool:
        """Return whether the first search sees all vertices, with costs that the cuts need, too."""
        run = self.run
        is_small = len(self.graph) <= run.gtsp_policy.proof_search.max_whole_search
        return (is_small or self.graph.has_cost_matrix) and not run.uses_sparse_costs

    def _estimate_of_search(self) -> Estimate:
        run = self.run
        count = min(len(run.graph), run.searched_classes_per_goal * run.graph.goal_count)
        legs = run.graph.estimate(count)
        return Estimate(legs.seconds + self.times.s_per_round * run.search_rounds, legs.bytes)

    def _estimate_of_walks(self, count: int) -> Estimate:
        legs = self.graph.estimate(count)
        seconds = self.times.s_per_label * self.graph.goal_count**5 * count
        return Estimate(legs.seconds + seconds, 2.0 * legs.bytes)

    def _estimate_of_cuts(self, count: int) -> Estimate:
        legs = self.graph.estimate(count)
        seconds = self.times.s_per_priced_leg * count**2
        seconds += self.times.s_per_cut_pair * self.graph.goal_count**2
        return Estimate(legs.seconds + seconds, 2.0 * legs.bytes)

    def _estimate_of_core(self, count: int) -> Estimate:
        estimates = self._estimate_of_cuts(count), self._estimate_of_walks(count)
        return min(estimates, key=lambda estimate: estimate.seconds)

    def _estimate_of_covers(self) -> Estimate:
        seconds = self.times.s_per_covered_pair * (self.graph.goal_count + 1) ** 2
        return Estimate(seconds + self.times.s_per_covered_class * len(self.graph), 0.0)

    def _subsets(self) -> Steps[None]:
        exact.solve(self.run)
        yield

    def _search(self) -> Steps[None]:
        """Search until a search finds nothing better; one step, because proofs need a good tour."""
        run, graph = self.run, self.graph
        if self._searches_all():
            self.costs = CostMatrix(graph, policy=self.policy.gtsp.costs)
            run.search(self.costs)
            self.has_searched_all = True
        else:
            run.find_first_tour()
            run.search_near_incumbent()
        run.report("begun", vertices=len(graph))
        yield

    def _search_on(self) -> Steps[None]:
        """Search near the incumbent while that helps, then from scratch, and merge; never ends."""
        run, graph = self.run, self.graph
        policy = run.gtsp_policy.proof_search
        vain_searches = 0
        while run.tour is not None:
            before = run.length
            core = np.union1d(run.classes_near_incumbent(), np.array(run.tour, dtype=np.int64))
            yield from run.search_steps(run.instance_among(core), run.clock)
            run.report("begun", vertices=len(graph))
            yield
            vain_searches = 0 if run.length < before else vain_searches + 1
            if vain_searches == policy.max_vain_searches:
                vain_searches = 0
                yield from self._merge()

    def _merge(self) -> Steps[None]:
        """Search from scratch, and merge the tours found."""
        run, merging = self.run, self.policy.mip.merging
        tours = []
        for _ in range(merging.searches):
            tours += run.search_afresh(1, run.clock)
            yield
        if run.iteration_limit == math.inf and run.graph.goal_count >= merging.min_goals:
            merge(
                run, list(dict.fromkeys(tours)), run.solve_merged_tours, Clock.from_limit(run.clock)
            )
            yield

    def _goals(self) -> Steps[None]:
        """Bound tours by 1-trees over the goals and, where there are no covers, by a proof."""
        run, policy = self.run, self.policy.mip

        def prove_goals(graph: Instance, limits: Limits) -> tuple[Result, Sequence[Cut]]:
            goal_run = MipRun(graph, limits, policy=policy)
            return goal_run.solve(self.backend, None), goal_run.cuts

        limits = Limits(run.clock, rng=run.rng)
        prove = _prove_nothing if self.graph.parity_oracle is not None else prove_goals
        yield from goal_bound_steps(self.graph, prove, limits, policy=policy)
        self._adopt_bound_in_any_class()

    def _covers(self) -> Steps[None]:
        """Bound tours by covers, and search among the classes that they visit."""
        run, policy = self.run, self.policy.mip
        if run.tour is None:
            return
        any_size = replace(policy, covers=replace(policy.covers, min_classes=0))
        limits = Limits(run.clock, rng=run.rng)
        costs = run.cover_costs() if run.uses_sparse_costs else CoverCosts()
        found = yield from goal_bound_steps(
            self.graph, _prove_nothing, limits, run.tour, costs, run.on_cover_bound, any_size
        )
        self._adopt_bound_in_any_class()
        run.raise_bound(found.bound)
        self.goal_bound = found

    def _adopt_bound_in_any_class(self) -> None:
        self.run.raise_bound(self.graph.bound_in_any_class)

    def _walks(self) -> Steps[None]:
        """Bound tours by ng-walks, which leave fewer vertices to the cuts."""
        run, graph = self.run, self.graph
        costs, self.costs = self.costs or CostMatrix(graph, policy=self.policy.gtsp.costs), None
        yield
        yield from walk_steps(run, costs, self.policy.mip.handover)
        self.costs = costs
        for task in self.tasks:
            if task.name == "cuts":
                task.estimate = self._estimate_of_cuts(len(costs))

    def _core(self) -> Steps[None]:
        """Prove over a core of the classes; twice the tether of any other bounds its tours.

        A core whose proof would raise the bound no further is left out.
        """
        run, graph = self.run, self.graph
        near = run.classes_near_incumbent() if run.tour is not None else None
        core = cheapest_per_cluster(graph.costs_to_base, graph.cluster, run.core_classes_per_goal)
        core = core if near is None else np.union1d(core, near)
        core = np.union1d(core, np.array(run.tour or (0,), dtype=np.int64))
        others = np.ones(len(graph), dtype=bool)
        others[core] = False
        elsewhere = graph.min_length_through(np.flatnonzero(others))
        if elsewhere <= (run.bound or 0.0):
            return
        inner = self.core = run.run_over(graph.subgraph(core), Limits(run.clock, rng=run.rng))
        inner.iteration_limit = run.iteration_limit - run.iterations
        inner.outer = run, core
        if run.tour is not None:
            inner.update_incumbent(np.searchsorted(core, np.array(run.tour)).tolist())
        costs = CostMatrix(inner.graph, policy=self.policy.gtsp.costs)
        yield
        for _ in self._core_steps(inner, costs):
            inner.known_length = min(inner.known_length, run.length)
            run.raise_bound(min(inner.bound or 0.0, elsewhere))
            yield
        run.raise_bound(min(inner.bound or 0.0, elsewhere))

    def _core_steps(self, inner: ScheduledRun, costs: CostMatrix) -> Steps[None]:
        """Prove a core by cutting planes, after walks where these take less time."""
        cuts, walks = self._estimate_of_cuts(len(costs)), self._estimate_of_walks(len(costs))
        if walks.seconds < cuts.seconds and walks_fit(inner.graph, self.policy.gtsp.walks):
            yield from walk_steps(inner, costs, self.policy.mip.handover)
        if not (inner.is_done or inner.is_infeasible):
            yield from inner.cut_steps(costs, self.backend, None)

    def _cuts(self) -> Steps[None]:
        """Prove by cutting planes, then by branch and cut, over what walks and covers have left."""
        run = self.run
        warm: WarmStart | None = self.core.program() if self.core is not None else None
        run.goal_bound = self.goal_bound
        costs, self.costs = self.costs or run.starting_costs(), None
        yield
        if costs.rows is None and not self.has_searched_all:
            yield from run.search_steps(run.instance(costs, NO_VERTICES), run.clock)
        yield from run.cut_steps(costs, self.backend, warm)
        while not run.is_done and run.root is not None:
            # many legs are left: each search may find a tour that fixes more of them out
            before = run.length
            yield
            run.search(costs)
            if not run.length < before:
                raise RunStopped
            yield from run.root.steps()

    def _without_order(self) -> Steps[None]:
        """Bound tours by those in any order."""
        run = self.run
        free = run.run_over(self.graph.unordered(), Limits(run.clock, rng=run.rng))
        free.iteration_limit = run.iteration_limit - run.iterations
        for _ in Portfolio(free, self.backend).steps():
            run.raise_bound(free.bound or 0.0)
            yield
        run.raise_bound(free.bound or 0.0)


def _prove_nothing(graph: Instance, limits: Limits) -> tuple[Result, Sequence[Cut]]:
    """Return no bound, because the first cover, whose cells are the goals, gives one."""
    return Result(None, None, None, Status.NO_SOLUTION_FOUND, ()), ()

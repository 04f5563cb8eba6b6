"""`mip`: a heuristic, cutting planes at fractional points, then branch and cut or lazy rounds.

The root (`netsp.mip.root`) bounds every tour and fixes out most legs and vertices. The rest is
solved by branch and cut (`netsp.mip.branching`) or, as in the paper, by an integer program that is
solved, cut at its subtours, and solved again.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.gtsp.cost_matrix import CostMatrix
from netsp.gtsp.dp.dp_solver import bound_by_walks
from netsp.gtsp.instance import Instance
from netsp.gtsp.limits import Limits
from netsp.gtsp.resumable import Steps, run_to_end
from netsp.gtsp.search import Search
from netsp.gtsp.searching import SearchingRun
from netsp.gtsp.solver_run import RunStopped
from netsp.gtsp.sparse_costs import SparseCosts
from netsp.gtsp.travel.result import Result
from netsp.mip.branching import Tree
from netsp.mip.cost_fixing import surviving_legs
from netsp.mip.cover_bounds import GoalBound
from netsp.mip.cuts import Cut
from netsp.mip.goal_relaxation import CoverCosts, bound_over_goals
from netsp.mip.lp_warm_start import WarmStart
from netsp.mip.merging import merge, search_and_merge, visited_classes
from netsp.mip.mip_policy import MipPolicy
from netsp.mip.parity_cuts import odd_numbers
from netsp.mip.program import IntegerProgram, Point
from netsp.mip.root import Root, tour_legs
from netsp.mip.subtours import component_cuts, cycles_of, heaviest_walk

BACKENDS = {
    "highs": "netsp.mip.highs:HighsRelaxation",
    "cbc": "netsp.mip.cbc_program:CbcRelaxation",
}
"""Relaxations by backend. `highs` re-solves the LP in process, fast enough for branch and cut;
`cbc` solves an integer program in lazy rounds, as in the paper."""

LAZY = {"cbc": "netsp.mip.cbc_program:CbcInteger"}
"""Integer programs of the backends without branch and cut."""

DEFAULT_BACKEND = "highs"

INTEGRALITY_TOLERANCE = 1e-6
"""Tolerance within which a value of a point counts as a whole number, and below which as zero."""


@dataclass(frozen=True)
class Params:
    """Options of the solver.

    Attributes
    ----------
    backend
        ``highs``, with branch and cut, or ``cbc``, with rounds of an integer program.
    search_rounds
        Rounds of ruin and recreate at the start, and again after the root.
    policy
        Thresholds of cuts, prices, LPs, branching, covers and merging, and what to do by size.
    """

    backend: str = DEFAULT_BACKEND
    search_rounds: int = 500
    policy: MipPolicy = MipPolicy()

    def __post_init__(self) -> None:
        if self.backend not in BACKENDS:
            raise ValueError(
                f"option 'backend': unknown {self.backend!r}; expected one of {', '.join(BACKENDS)}"
            )
        if self.search_rounds < 0:
            raise ValueError(
                f"option 'search_rounds': expected 0 or more, got {self.search_rounds}"
            )


def solve(graph: Instance, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Solve the generalised TSP of a travel graph to proven optimality, or as far as time allows.

    An iteration is one linear or integer program solved. The program is that of McCammon &
    Hollinger 2017, section IV-B; reduced-cost fixing is netsp's (docs/theory/solvers.md).
    """
    chosen, limits = params or Params(), limits or Limits()
    run = MipRun(graph, limits, search_rounds=chosen.search_rounds, policy=chosen.policy)
    return run.solve(chosen.backend, limits.warm_start)


class MipRun(SearchingRun):
    """Run of the solver.

    Attributes
    ----------
    mip_policy
        Policy of the run and of its parts.
    root
        Root of the proof while it runs. It refers to the run, so it is dropped at the end: else its
        matrices would wait for the garbage collector.
    cuts
        Cuts that the root had in the end.
    goal_bound
        Bound over goals or covers, which the proof adopts; None if there is none.
    """

    root: Root | None = None
    cuts: Sequence[Cut] = ()
    goal_bound: GoalBound | None = None
    _costs: CostMatrix | None = None
    _merged: Ints = np.zeros(0, dtype=np.int64)

    def __init__(
        self,
        graph: Instance,
        limits: Limits | None = None,
        *,
        search_rounds: int = 500,
        policy: MipPolicy = MipPolicy(),
    ) -> None:
        super().__init__(graph, limits, search_rounds=search_rounds, policy=policy.gtsp)
        self.mip_policy = policy

    def run_over(self, graph: Instance, limits: Limits) -> Self:
        """Return a run over another graph with the same settings."""
        return type(self)(graph, limits, search_rounds=self.search_rounds, policy=self.mip_policy)

    def solve(
        self, backend: str, warm_start: Sequence[int] | None, *, walks: bool = False
    ) -> Result:
        """Search, prove, and return the result.

        Parameters
        ----------
        walks
            Whether walks bound the tours before cuts do.
        """
        policy = self.mip_policy
        with self.until_stopped():
            self.update_incumbent(warm_start)
            if not self.solve_if_trivial():
                self.find_first_tour()
                warm: WarmStart | None = None
                if not walks or len(self.graph) > policy.core_classes:
                    with self.core() as core:
                        has_many_goals = self.graph.goal_count >= policy.many_goals
                        if core is not None or (not self.graph.has_cost_matrix and has_many_goals):
                            self.bound_by_goals(backend)
                            if self._root_is_hopeless:
                                search_and_merge(self, self.solve_merged_tours, policy.merging)
                        if core is not None and not self.is_done:
                            # only now, because covers may take longer than the core's share
                            core.start_time_share()
                            # tours found meanwhile may visit other classes than the core's
                            core.known_length = min(core.known_length, self.length)
                            core.prove(backend, walks=walks)
                    warm = core.program() if core is not None else None
                if not (self.is_done and self.uses_sparse_costs):
                    self.prove(backend, walks=walks, warm=warm)
        if self.root is not None:
            self.cuts, self.root = self.root.lp.cuts, None
        return self.finish("proven" if self.is_done else "open")

    def prove(self, backend: str, *, walks: bool = False, warm: WarmStart | None = None) -> None:
        """Search, bound by walks if wanted, and cut until the incumbent is proven.

        Parameters
        ----------
        warm
            Program of a proof over a core of the classes, which has searched already.
        """
        costs = self.starting_costs()
        if warm is None:
            self.search(costs)
            self.report("heuristic", vertices=len(costs))
        if walks and costs.rows is None:
            bound_by_walks(self, costs, handover=self.mip_policy.handover)
        if not (self.is_done or self.is_infeasible):
            self.cut(costs, backend, warm)

    def starting_costs(self) -> CostMatrix:
        """Return the costs that a proof starts from, already measured if a bound needed them."""
        costs, self._costs = self._costs or self._initial_costs(), None
        return costs

    def _initial_costs(self) -> CostMatrix:
        """Return the costs of all legs or, if costs are sparse, of the legs that a cover leaves."""
        graph, bound, policy = self.graph, self.goal_bound, self.mip_policy
        if not self.uses_sparse_costs or bound is None or self.tour is None:
            return CostMatrix(graph, policy=self.gtsp_policy.costs)
        if bound.cells is None:
            # half of the time was too short for a cover, so a search is the better use of the rest
            search_and_merge(self, self.solve_merged_tours, policy.merging)
            self.check()
            return CostMatrix(graph, policy=self.gtsp_policy.costs)
        odd = odd_numbers(graph.labels)
        with graph.on_clock(self.clock):
            sparse = surviving_legs(graph, bound.cells, self.length, self.tour, odd, policy.pricing)
            return CostMatrix(graph, sparse, policy=self.gtsp_policy.costs)

    def bound_by_goals(self, backend: str) -> None:
        """Find a first bound over goals or covers, before the proof over all classes has one."""
        graph, policy = self.graph, self.mip_policy

        def prove(graph: Instance, limits: Limits) -> tuple[Result, Sequence[Cut]]:
            run = MipRun(graph, limits, policy=policy)
            return run.solve(backend, None), run.cuts

        try:
            self.goal_bound = bound_over_goals(
                graph,
                prove,
                self._goal_limits(),
                self.tour if self._uses_covers else None,
                self.cover_costs(),
                self.on_cover_bound,
                policy,
            )
        finally:
            self.raise_bound(graph.bound_in_any_class)
        self.raise_bound(self.goal_bound.bound)
        self.report("goals", vertices=len(self.graph))

    def _goal_limits(self) -> Limits:
        """Return the limits of the bound over goals or covers."""
        policy, uses_covers = self.mip_policy, self._uses_covers
        share = self._cover_time_share if uses_covers else policy.time.goal_share
        seconds = share * self.clock.left
        if self.uses_sparse_costs:
            seconds = max(seconds, min(policy.time.min_sparse_s, 0.5 * self.clock.left))
        clock = Clock(seconds, within=self.clock) if self.clock.limit else self.clock
        # the program over all classes says nothing of classes that were left out
        proof_follows = not uses_covers and self.graph.is_complete
        programs = policy.goals.max_programs_before_proof if proof_follows else None
        return Limits(clock, iterations=programs, rng=self.rng)

    def cover_costs(self) -> CoverCosts:
        """Return the costs of legs for covers, which the proof over all classes uses again."""
        graph = self.graph

        def matrix() -> Floats:
            self._costs = CostMatrix(graph, policy=self.gtsp_policy.costs)
            return self._costs.values

        def keep_sparse(sparse: SparseCosts) -> None:
            self._costs = CostMatrix(graph, sparse, policy=self.gtsp_policy.costs)

        if self.uses_sparse_costs:
            return CoverCosts(on_sparse=keep_sparse)
        is_known = self._uses_covers and graph.is_complete and self._measures_all_legs
        return CoverCosts(matrix=matrix if is_known else None)

    @property
    def _measures_all_legs(self) -> bool:
        """True if measuring all legs takes no longer than bounding them."""
        seconds = self.graph.oracle.estimate(len(self.graph)).seconds
        return self.gtsp_policy.costs.allows_all(seconds, len(self.graph))

    @property
    def _uses_covers(self) -> bool:
        """True if covers come first, which pays only with many goals and classes."""
        has_many_goals = self.graph.goal_count >= self.mip_policy.many_goals
        has_many_classes = len(self.graph) > self.mip_policy.covers.min_classes
        return (has_many_classes and has_many_goals) or self.uses_sparse_costs

    @property
    def uses_sparse_costs(self) -> bool:
        """True if there are too many classes for a matrix of all legs."""
        graph = self.graph
        # with many goals, all that covers prove is to hold for classes left out, too
        is_whole = graph.is_complete or graph.goal_count < self.mip_policy.many_goals
        is_known = is_whole and graph.parity_oracle is not None
        return is_known and len(graph) > self.gtsp_policy.costs.max_double_vertices

    @property
    def _cover_time_share(self) -> float:
        """Share of the time left that covers may take."""
        policy, classes = self.mip_policy.time, len(self.graph)
        if self.graph.goal_count > self.mip_policy.large_goal_count:
            return policy.cover_share  # covers close the gap there
        if self.uses_sparse_costs and self.graph.goal_count <= policy.max_sparse_goals:
            min_share = policy.min_sparse_share
            share = policy.cover_share * (classes / policy.sparse_classes) ** 3
        else:
            min_share = policy.goal_share
            share = policy.cover_share * (classes / policy.cover_classes) ** 2
        return min(max(share, min_share), policy.cover_share)

    @property
    def _core_is_for_warm_start(self) -> bool:
        """True if a core is solved for its legs and cuts, and searches find the tour."""
        return self.outer is not None and self.graph.goal_count >= self.mip_policy.many_goals

    @property
    def _root_is_hopeless(self) -> bool:
        """True if the program over all classes would not close the gap that covers leave."""
        policy, gap = self.mip_policy, self.length - (self.bound or 0.0)
        is_large = self._uses_covers and self.graph.goal_count > policy.large_goal_count
        return is_large and gap > policy.max_gap_after_covers * self.length

    def program(self) -> WarmStart | None:
        """Return the root's program of a run over a core, by vertices of the outer run.

        There is one even if the core's share of the time was too short for a proof.
        """
        if self.root is None or self.outer is None:
            return None
        core = self.outer[1][self.root.costs.vertices]
        return WarmStart(core, core[self.root.lp.legs], list(self.root.lp.cuts), self.outer[1])

    def cut(self, costs: CostMatrix, backend: str, warm: WarmStart | None) -> None:
        """Solve the root, search again, and branch and cut."""
        run_to_end(self.cut_steps(costs, backend, warm))

    def cut_steps(self, costs: CostMatrix, backend: str, warm: WarmStart | None) -> Steps[None]:
        """Do what `cut` does, with a step for each LP of the root and each node of the tree."""
        policy = self.mip_policy
        self._gap_at_last_search = self.length
        if warm is not None:
            # a core is proven over lengths; over estimates its cuts would prove less
            costs.measure(np.searchsorted(costs.vertices, warm.measured))
        self.root = root = Root(
            self, costs, _load(BACKENDS[backend]), self.round_point, warm, self.goal_bound, policy
        )
        yield from root.steps()
        if not self.is_done and root.point is not None:
            before, visited = self.length, np.flatnonzero(root.point.x > INTEGRALITY_TOLERANCE)
            self.search(costs, visited)
            self.report("heuristic", **root.size())
            if costs.exact is None and self.length < before:
                yield from root.steps()
        if not self.is_done and costs.exact is not None:
            self.check()
            root.measure()
            self.search(costs)
            self.report("measured", **root.size())
            yield from root.steps()
        for _ in range(policy.max_searches):
            if self.is_done or root.size()["legs"] <= policy.max_branching_legs:
                break
            before = self.length
            self.search(costs)
            self.report("heuristic", **root.size())
            if self.length < before:
                yield from root.steps()
        legs = root.size()["legs"]
        if self.is_done or legs > policy.max_branching_legs or self._core_is_for_warm_start:
            return
        if backend not in LAZY:
            yield from Tree(root).steps()
        elif legs <= self.clock.left / policy.min_integer_s_per_leg:
            self.solve_integer(root, _load(LAZY[backend]))

    def search_near_incumbent(self) -> Ints:
        """Search near the incumbent, and merge the local optima found."""
        core = super().search_near_incumbent()
        self.merge_recent_local_optima()
        return core

    def on_cover_bound(self, bound: float, cells: int, classes: Ints) -> tuple[int, ...] | None:
        """Take the bound of a cover, search among its classes, and merge the local optima."""
        super().on_cover_bound(bound, cells, classes)
        self.merge_recent_local_optima()
        return self.tour

    def search(self, costs: CostMatrix, more: Ints | None = None) -> None:
        """Search, and merge the local optima found."""
        super().search(costs, more)
        self.merge_recent_local_optima()

    def merge_recent_local_optima(self) -> None:
        """Merge the tours in which the last searches ended and the incumbent, once.

        With a limit of iterations nothing is merged, because merging would take uncounted ones.
        """
        graph, policy = self.graph, self.mip_policy.merging
        is_worth_it = not graph.has_cost_matrix and graph.goal_count >= policy.min_goals
        is_over = self.is_done or self.clock.is_up or self.iteration_limit < np.inf
        if not is_worth_it or is_over or not self.local_optima or self.tour is None:
            return
        tours = list(dict.fromkeys([self.tour, *self.local_optima]))
        classes = visited_classes(tours)
        if not np.isin(classes, self._merged).all():
            self._merged = classes
            share = self.gtsp_policy.proof_search.search_time_share
            merge(self, tours, self.solve_merged_tours, self.clock.part(share))

    def solve_merged_tours(self, graph: Instance, limits: Limits) -> Result:
        """Solve a graph of the classes of some tours by the run's policy, as `solve_merged`."""
        return solve_merged(graph, limits, self.mip_policy)

    def round_point(self, root: Root, point: Point) -> None:
        """Round a point of the root to a tour, or search among the classes that it visits.

        The search is made while not all vertices are searched, and whenever the gap has shrunk
        enough since the last one.
        """
        distance = np.abs(point.y - np.rint(point.y)).max(initial=0.0)
        is_whole = bool(distance < INTEGRALITY_TOLERANCE)
        if self.searches_all_vertices(root.costs) or (is_whole and root.costs.exact is None):
            self.offer_rounded(root.costs, point, is_whole=is_whole)
            return
        gap = self.length - (self.bound or 0.0)
        if gap < self.mip_policy.search_gap_ratio * self._gap_at_last_search:
            self._gap_at_last_search = gap
            self.search(root.costs, np.flatnonzero(point.x > INTEGRALITY_TOLERANCE))

    def offer_rounded(self, costs: CostMatrix, point: Point, *, is_whole: bool) -> None:
        """Offer a tour that joins the cycles of a point, or follows its heaviest legs, improved."""
        cluster = costs.cluster
        if is_whole:
            cycles = cycles_of(point.x, point.legs, point.y)
            if len(cycles) == 1:
                self.update_incumbent(costs.vertices[cycles[0]].tolist())
            order = [int(cluster[v]) for cycle in cycles for v in cycle]
        else:
            order = heaviest_walk(point.legs, point.y, cluster)
        if sorted(order) != list(range(self.graph.goal_count + 1)):
            return
        search = Search(
            self.instance(costs, np.flatnonzero(point.x > INTEGRALITY_TOLERANCE)),
            self.rng,
            order,
            self.clock,
        )
        search.settle()
        self.offer_incumbent_from(search, rounded=costs.rounded)

    def solve_integer(self, root: Root, program: Any) -> None:
        """Solve the integer program over the legs that are left, with lazy cuts."""
        costs = root.costs
        legs = root.dead.legs_left()
        legs = np.unique(np.vstack([legs, tour_legs(root.tour())]), axis=0)
        vertices = np.unique(np.concatenate([[0], legs.ravel()]))
        model: IntegerProgram = program(
            costs.cluster, vertices, legs, costs.costs_of(legs), root.lp.cuts
        )
        size = {"legs": len(legs), "vertices": len(vertices)}
        self.report("fixed", cuts=len(model.cuts), **size)
        while not self.is_done:
            self.check()
            outcome = model.solve(self.clock)
            self.iterations += 1
            point = outcome.point
            if outcome.infeasible:
                # no leg that is left is in a tour better than the incumbent, if there is one
                self.is_infeasible = self.tour is None
                if self.tour is not None:
                    self.raise_bound(self.cutoff)
                break
            if outcome.bound is not None:
                self.raise_bound(min(outcome.bound, self.cutoff))
            if point is not None:
                self.offer_rounded(costs, point, is_whole=True)
            self.report("integer", cuts=len(model.cuts), **size)
            if self.is_done:
                break
            if point is None or not outcome.finished:
                raise RunStopped
            cuts = component_cuts(np.rint(point.x), point.legs, np.rint(point.y), costs.cluster)
            if not cuts:
                # the optimum is a tour, so the bound equals the length of that tour
                break
            model.add_cuts(cuts)


def solve_merged(graph: Instance, limits: Limits, policy: MipPolicy = MipPolicy()) -> Result:
    """Solve a graph of few classes from a tour that is known, without a search."""
    run = MipRun(graph, limits, search_rounds=0, policy=policy)
    return run.solve(DEFAULT_BACKEND, limits.warm_start)


def _load(path: str) -> Any:
    """Return the attribute of a module that a path `module:attribute` names."""
    module, attribute = path.split(":")
    return getattr(importlib.import_module(module), attribute)

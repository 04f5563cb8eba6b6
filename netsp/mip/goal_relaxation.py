"""Lower bounds from the goals alone, found in seconds where there are thousands of classes.

No tour is shorter than the travelling salesperson's over the shortest paths between goals in any
class. That is 10 % below the optimum if tethers are long, because it goes around obstacles. If the
roadmap knows the paths between goals by the rays that they cross, covers of finitely many sheets
leave 2 % (`netsp.mip.covers`).

With hundreds of goals the proof of that tour may have no bound for long. So 1-trees come first
(Held and Karp 1970, 1971): a spanning tree of all goals but one, and two legs at that one. Prices
rise at goals with more than two legs and fall at goals with fewer. Each 1-tree gives a bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.gtsp.instance import Instance, cheapest_per_cluster
from netsp.gtsp.limits import Limits
from netsp.gtsp.resumable import Steps, run_to_end
from netsp.gtsp.sparse_costs import SparseCosts
from netsp.gtsp.travel.result import Result
from netsp.mip.cost_fixing import PATH_ROUNDING, surviving_legs
from netsp.mip.cover_bounds import CellBound, Cells, GoalBound
from netsp.mip.cover_costs import ClassCovers, Covers, PathCovers
from netsp.mip.covers import ParityTour, cover_steps
from netsp.mip.cuts import Cut
from netsp.mip.mip_policy import GoalBoundPolicy, MipPolicy
from netsp.mip.parity_cuts import odd_numbers

OnBound = Callable[[float, int, Ints], Sequence[int] | None]
"""Callback for each better bound, with the bound, the number of cells, and the classes of shortest
tether in the cells that the program's point visits. Returns a better tour, or None."""

Prove = Callable[[Instance, Limits], tuple[Result, Sequence[Cut]]]
"""Solver that proves, which returns its result and the cuts in its last LP."""


@dataclass(frozen=True)
class CoverCosts:
    """Costs of legs between classes for covers, and the callback that gets them.

    Without either callback, covers have the lengths of shortest paths, and their bound also holds
    for classes that a roadmap has left out.

    Attributes
    ----------
    matrix
        Returns the costs (V, V) of all legs, if no class was left out. Called once, after a first
        bound, because it may take all the time left.
    on_sparse
        Receives the costs of the legs that may be in a better tour, once they are known. Covers
        over paths come first then, and covers over those legs follow.
    """

    matrix: Callable[[], Floats] | None = None
    on_sparse: Callable[[SparseCosts], None] | None = None

    @property
    def is_over_kept_classes(self) -> bool:
        """True if bounds say nothing of classes that a roadmap has left out."""
        return self.matrix is not None or self.on_sparse is not None


def bound_over_goals(
    graph: Instance,
    prove: Prove,
    limits: Limits,
    tour: Sequence[int] | None = None,
    costs: CoverCosts = CoverCosts(),
    on_bound: OnBound = lambda *_: None,
    policy: MipPolicy = MipPolicy(),
) -> GoalBound:
    """Return a lower bound over goals or covers; 0 if the limits leave no time.

    Parameters
    ----------
    tour
        Best tour known; without one, covers are skipped.
    """
    return run_to_end(goal_bound_steps(graph, prove, limits, tour, costs, on_bound, policy))


def goal_bound_steps(
    graph: Instance,
    prove: Prove,
    limits: Limits,
    tour: Sequence[int] | None = None,
    costs: CoverCosts = CoverCosts(),
    on_bound: OnBound = lambda *_: None,
    policy: MipPolicy = MipPolicy(),
) -> Steps[GoalBound]:
    """Do what `bound_over_goals` does, with a step for each LP of a cover."""
    clock = Clock.from_limit(limits.time)
    distances = graph.distances_between_goals(lambda: clock.is_up)
    bound = one_tree_bound(_finite(distances), lambda: clock.is_up, policy.goals)
    cuts: tuple[Cut, ...] = ()
    cells: CellBound | None = None
    _raise_bound_in_any_class(graph, bound * (1.0 - PATH_ROUNDING))
    if tour is not None and len(graph) > policy.covers.min_classes:
        run = _CoverRun(graph, tour, replace(limits, time=clock), costs, on_bound, policy)
        cells = yield from run.steps()
    if cells is None or graph.goal_count < policy.goals.max_proven_goals:
        goal_graph = Instance.from_costs(distances, range(graph.goal_count + 1))
        programs = policy.goals.max_programs
        if limits.iterations is not None:
            programs = min(limits.iterations, programs)
        result, last_cuts = prove(goal_graph, replace(limits, time=clock, iterations=programs))
        bound, cuts = max(bound, result.lower_bound or 0.0), tuple(last_cuts)
    bound *= 1.0 - PATH_ROUNDING
    over_cells = cells.bound * (1.0 - PATH_ROUNDING) if cells else 0.0
    in_any_class = bound if costs.is_over_kept_classes else max(bound, over_cells)
    _raise_bound_in_any_class(graph, in_any_class)
    return GoalBound(max(bound, over_cells), cuts, cells)


def bound_by_one_trees(graph: Instance, policy: GoalBoundPolicy = GoalBoundPolicy()) -> None:
    """Give a graph a first bound when no time is left, without measuring legs.

    The bound comes from a few 1-trees over straight lines between goals, or over the lowest costs
    between clusters.
    """
    if not graph.bound_in_any_class:
        distances = graph.distances_between_goals(lambda: True)
        left = iter(range(policy.untimed_legs // distances.size))
        bound = one_tree_bound(_finite(distances), lambda: next(left, None) is None, policy)
        _raise_bound_in_any_class(graph, bound * (1.0 - PATH_ROUNDING))


def _finite(lengths: Floats) -> Floats:
    """Return lengths with infinities replaced by the longest leg, which a tree can avoid."""
    longest = float(lengths.max(where=np.isfinite(lengths), initial=0.0))
    return np.asarray(np.minimum(lengths, longest))


def _raise_bound_in_any_class(graph: Instance, bound: float) -> None:
    graph.bound_in_any_class = max(graph.bound_in_any_class, bound)


class _CoverRun:
    """Bound over covers from a travel graph and its best tour."""

    def __init__(
        self,
        graph: Instance,
        tour: Sequence[int],
        limits: Limits,
        costs: CoverCosts,
        on_bound: OnBound,
        policy: MipPolicy,
    ) -> None:
        self.graph, self.tour, self.limits = graph, list(tour), limits
        self.costs, self.on_bound, self.policy = costs, on_bound, policy
        self.clock = Clock.from_limit(limits.time)
        self.odd: Bools = np.zeros((0, 0), dtype=bool)

    def steps(self) -> Steps[CellBound | None]:
        """Return the bound; None if the paths between goals are not known."""
        matrix = None if self.costs.matrix is None else self.costs.matrix()
        covers = self._first_covers(matrix)
        if covers is None:
            return None
        return (
            yield from cover_steps(
                covers,
                self._parity_tour(),
                self.graph.tour_length(self.tour),
                replace(self.limits, time=self.clock),
                self._on_cover,
                None if self.costs.on_sparse is None else self._refine_costs,
                self.policy,
            )
        )

    def _first_covers(self, matrix: Floats | None) -> Covers | None:
        graph = self.graph
        if matrix is not None:
            self.odd = odd_numbers(graph.labels)
            return ClassCovers(matrix, graph.cluster, self.odd)
        share = self.clock.part(self.policy.covers.path_time_share)
        paths = graph.parity_oracle and graph.parity_oracle(lambda: share.is_up)
        if paths is None:
            return None
        self.odd = odd_numbers(graph.labels, paths.barriers)
        return PathCovers(paths, np.inf)

    def _parity_tour(self) -> ParityTour:
        return [(int(self.graph.cluster[v]), self.odd[v]) for v in self.tour]

    def _on_cover(
        self, bound: float, cells: Cells, visited: Ints
    ) -> tuple[ParityTour, float] | None:
        """Pass a bound on, and return the better tour that comes back."""
        graph, bound = self.graph, bound * (1.0 - PATH_ROUNDING)
        cell = cells.cells_of(graph.cluster, self.odd)
        above_visited = np.flatnonzero(np.isin(cell, visited))
        count = self.policy.covers.classes_per_cell
        chosen = cheapest_per_cluster(
            graph.costs_to_base[above_visited], cell[above_visited], count
        )
        if not self.costs.is_over_kept_classes:
            _raise_bound_in_any_class(graph, bound)
        better = self.on_bound(bound, len(cells.cluster), above_visited[chosen])
        if better is None:
            return None
        self.tour = list(better)
        return self._parity_tour(), graph.tour_length(better)

    def _refine_costs(self, bound: CellBound, length: float) -> Covers:
        """Measure the legs that may be in a better tour, and return covers with their costs."""
        assert self.costs.on_sparse is not None
        graph = self.graph
        with graph.on_clock(self.clock):
            sparse = surviving_legs(graph, bound, length, self.tour, self.odd, self.policy.pricing)
        _raise_bound_in_any_class(graph, bound.bound * (1.0 - PATH_ROUNDING))
        self.costs.on_sparse(sparse)
        return ClassCovers(sparse, graph.cluster, self.odd)


def one_tree_bound(
    lengths: Floats, is_up: Callable[[], bool], policy: GoalBoundPolicy = GoalBoundPolicy()
) -> float:
    """Return the best bound on a tour by 1-trees; that of the first tree if the time is up.

    Parameters
    ----------
    lengths
        (n, n) lengths between all places; the diagonal is ignored.
    is_up
        Returns whether the time is up.
    """
    n = len(lengths)
    if n < 3:
        return 0.0
    prices, best, step, vain_trees = np.zeros(n), -np.inf, policy.first_step, 0
    best_prices = prices
    for _ in range(policy.max_trees):
        bound, missing = _one_tree(lengths, prices)
        if bound > best:
            best, best_prices, vain_trees = bound, prices, 0
        else:
            vain_trees += 1
            if vain_trees % policy.patience == 0:
                step, prices = step * policy.step_decay, best_prices
                continue
        size = float(missing @ missing)
        if size == 0.0 or is_up():
            break
        prices = prices + step * (policy.tour_factor * abs(best) - bound) / size * missing
    return max(best, 0.0)


def _one_tree(lengths: Floats, prices: Floats) -> tuple[float, Floats]:
    """Return the bound of the minimum 1-tree at some prices, and the excess degree (n,) over 2."""
    from scipy.sparse.csgraph import minimum_spanning_tree

    priced = lengths + prices[:, None] + prices[None, :]
    two_legs = np.partition(priced[0, 1:], 1)[:2]
    at = np.argpartition(priced[0, 1:], 1)[:2] + 1
    # scipy takes a stored zero for no edge; adding a constant keeps the spanning tree
    rest = priced[1:, 1:]
    shift = 1.0 - float(rest[~np.eye(len(rest), dtype=bool)].min())
    tree = minimum_spanning_tree(rest + shift).tocoo()
    degree = np.bincount(np.concatenate([tree.row + 1, tree.col + 1, at]), minlength=len(lengths))
    degree[0] = 2
    length = float(rest[tree.row, tree.col].sum() + two_legs.sum())
    return length - 2.0 * float(prices.sum()), degree.astype(np.float64) - 2.0

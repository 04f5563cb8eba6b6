"""`dp`: dynamic programming over walks with limited memory, prices and elimination of states.

With few goals and very many classes this is by far the fastest proof: states are (visit, vertex,
remembered goals), it costs nothing to keep the legs of a class apart, and what a bound rules out
shrinks the next pass. If legs take long, it starts on their lower bounds, and most classes are
eliminated before a leg is measured.

Prices follow the walk (deflected subgradient): those of goals that it misses rise, those of goals
that it repeats fall. So does memory: a goal that the walk repeats is remembered from then on.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.gtsp.cost_matrix import CostMatrix
from netsp.gtsp.dp.handover import Handover
from netsp.gtsp.dp.walks import Walks
from netsp.gtsp.gtsp_policy import GtspPolicy, WalkPolicy
from netsp.gtsp.instance import Instance
from netsp.gtsp.limits import Limits
from netsp.gtsp.resumable import Steps, run_to_end
from netsp.gtsp.searching import SearchingRun
from netsp.gtsp.travel.result import Result
from netsp.model.arrangement import respects_precedences

NO_HANDOVER = Handover()
"""Handover that never happens: walks continue as long as they make progress."""


@dataclass(frozen=True)
class Params:
    """Options of the solver.

    Attributes
    ----------
    search_rounds
        Rounds of ruin and recreate at the start, and again when all legs are measured.
    policy
        Policy of walks, searches and costs.
    """

    search_rounds: int = 500
    policy: GtspPolicy = field(default_factory=GtspPolicy)

    def __post_init__(self) -> None:
        if self.search_rounds < 0:
            raise ValueError(
                f"option 'search_rounds': expected 0 or more, got {self.search_rounds}"
            )


def solve(graph: Instance, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Bound and prove by walks, for few goals with many classes.

    With many goals it ends with the gap at which walks make no more progress. An iteration is one
    pass over all layers.

    Raises
    ------
    InputError
        The tables would not fit into memory.
    """
    chosen, limits = params or Params(), limits or Limits()
    if not fits(graph, chosen.policy.walks):
        raise InputError(
            f"solver 'dp': {graph.goal_count} goals with {len(graph)} classes need too much memory;"
            " use 'auto' or 'lns'"
        )
    run = SearchingRun(graph, limits, search_rounds=chosen.search_rounds, policy=chosen.policy)
    with run.until_stopped():
        run.update_incumbent(limits.warm_start)
        if not run.solve_if_trivial():
            run.find_first_tour()
            costs = CostMatrix(graph, policy=chosen.policy.costs)
            run.search(costs)
            run.report("heuristic", vertices=len(costs))
            bound_by_walks(run, costs)
    return run.finish("proven" if run.is_done else "open")


def fits(graph: Instance, policy: WalkPolicy = WalkPolicy()) -> bool:
    """Return whether the tables of the walks over a graph are of a reasonable size."""
    return (graph.goal_count + 1) ** 2 * len(graph) <= policy.max_table_cells


def bound_by_walks(
    run: SearchingRun, costs: CostMatrix, *, handover: Handover = NO_HANDOVER
) -> None:
    """Raise the bound of a run and remove vertices.

    It ends with a proof, when progress stalls, or when few legs remain that are all measured; then
    the caller goes on with the proof over those.
    """
    run_to_end(walk_steps(run, costs, handover))


def walk_steps(
    run: SearchingRun, costs: CostMatrix, handover: Handover = NO_HANDOVER
) -> Steps[None]:
    """Do what `bound_by_walks` does, with a step for each pass over all layers."""
    policy = run.gtsp_policy.walks
    before = run.graph.before
    walks = Walks(costs.cluster, costs.values, run.clock.flag, before, policy)
    prices = initial_prices(run, costs)
    direction: Floats = np.zeros(walks.n + 1)
    best_bound, best_prices, step, vain_passes = -np.inf, prices, policy.first_step, 0
    history: list[tuple[float, int]] = []
    has_searched_all = run.searches_all_vertices(costs)
    while not run.is_done:
        yield
        run.check()
        cutoff = run.cutoff
        walk = walks.solve(prices, cutoff, run.check)
        run.iterations += 1
        if walk is None:
            run.is_infeasible = run.tour is None
            if run.tour is not None:
                run.raise_bound(cutoff - walks.rounding(prices))
            return
        run.raise_bound(min(walk.bound, cutoff))
        goals = costs.cluster[walk.rows]
        visits = np.bincount(goals, minlength=walks.n + 1)
        visits_each_once = bool((visits[1:] == 1).all())
        is_tour = visits_each_once and respects_precedences(goals.tolist(), before)
        if is_tour:
            was_measured = costs.exact is None
            costs.measure(np.concatenate([[0], walk.rows]))
            run.update_incumbent([0, *costs.vertices[walk.rows].tolist()])
            walks.set_values(costs.values)
        _remove_dead_vertices(run, walks, costs)
        if not has_searched_all and run.searches_all_vertices(costs):
            run.search(costs)
            has_searched_all = True
        run.report("walks", vertices=len(costs), legs=len(costs) * (len(costs) - 1) // 2)
        if is_tour:
            if was_measured and not run.is_done:
                return  # only rounding keeps the bound below the length, whatever the prices
            best_bound = -np.inf  # legs of the walk became longer when they were measured
            continue
        if walk.bound > best_bound:
            best_bound, best_prices, vain_passes = walk.bound, prices, 0
        else:
            vain_passes += 1
            if vain_passes % policy.patience == 0:
                step, prices = step * policy.step_decay, best_prices
        history.append((best_bound, int(walks.alive.sum())))
        has_stalled = _stalls(history, run.length, policy)
        if costs.exact is not None and (
            has_stalled or len(costs) <= costs.policy.max_measured_vertices
        ):
            _measure(run, walks, costs)
            has_searched_all = run.searches_all_vertices(costs)
            best_bound, step = -np.inf, policy.first_step
            history.clear()
        elif has_stalled:
            return
        if costs.exact is None and handover.is_due(len(costs), walk.labels):
            return
        widened = walk.labels < policy.max_widened_labels and walks.memory.widen(goals.tolist())
        if visits_each_once:  # in an order that breaks a precedence, which prices cannot mend
            if not widened:
                return
            continue
        missed: Floats = np.asarray(1.0 - visits, dtype=np.float64)
        missed[0] = 0.0
        direction = policy.deflection * missed + (1.0 - policy.deflection) * direction
        if direction @ direction < 0.1:
            direction = missed
        target = run.length if run.tour is not None else 1.1 * abs(walk.bound) + 1e-9
        prices = prices + step * (target - walk.bound) / (direction @ direction) * direction


def initial_prices(run: SearchingRun, costs: CostMatrix) -> Floats:
    """Return prices (n + 1,): half the sum of the incumbent's two legs at each goal.

    They sum to the length of the incumbent, less half of its two legs at the base.
    """
    prices = np.zeros(run.graph.goal_count + 1)
    if run.tour is not None:
        rows = np.searchsorted(costs.vertices, np.array(run.tour))
        legs = costs.values[rows, np.roll(rows, -1)]
        prices[costs.cluster[rows]] = 0.5 * (legs + np.roll(legs, 1))
    prices[0] = 0.0
    return prices


def _remove_dead_vertices(run: SearchingRun, walks: Walks, costs: CostMatrix) -> None:
    """Remove vertices without a state once they are many, except those of the incumbent."""
    keep = walks.left
    if run.tour is not None:
        keep[np.searchsorted(costs.vertices, np.array(run.tour))] = True
    if keep.sum() <= walks.policy.max_kept_share * len(keep):
        walks.restrict(keep)
        costs.restrict(keep)
        walks.set_values(costs.values)


def _measure(run: SearchingRun, walks: Walks, costs: CostMatrix) -> None:
    """Measure all remaining legs, and search among them."""
    run.check()
    costs.measure_all(np.isfinite(costs.values))
    run.search(costs)
    walks.set_values(costs.values)
    run.report("measured", vertices=len(costs), legs=len(costs) * (len(costs) - 1) // 2)


def _stalls(history: list[tuple[float, int]], length: float, policy: WalkPolicy) -> bool:
    """Return whether the last passes closed little of the gap and eliminated few states.

    `history` holds the bound and the number of states after each pass.
    """
    passes, progress = policy.stall_passes, policy.min_progress
    if len(history) <= passes:
        return False
    (bound_then, states_then), (bound, states) = history[-1 - passes], history[-1]
    gap = length - bound_then if length < np.inf else abs(bound)
    closed = bound - bound_then > progress * gap
    return not closed and states > (1.0 - progress) * states_then

"""`dp`: dynamic programming over partly remembered walks, with prices and elimination.

Where there are few goals and very many classes this is by far the fastest proof: the states are
(visit, vertex, remembered goals), the legs of a class cost nothing to keep apart, and what a bound
rules out shrinks the next pass. Where legs take long it starts on lower bounds of them; in most
worlds nine classes in ten are dead before a leg is measured.

Prices follow the walk (deflected subgradient): goals it misses become dearer to miss, goals it
repeats cheaper. Memory follows it too: where it repeats a goal, that is remembered from now on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.gtsp.cost_matrix import MEASURE_AT_ONCE, CostMatrix
from netsp.gtsp.dp.handover import Handover
from netsp.gtsp.dp.walks import Walks
from netsp.gtsp.limits import Limits
from netsp.gtsp.searching import SearchingRun
from netsp.gtsp.travel.graph import TravelGraph
from netsp.gtsp.travel.result import Result
from netsp.model.arrangement import respects_precedences

STEP, SHORTER = 0.5, 0.7
"""First step of the prices as a share of the gap, and its factor after `STALL` passes in vain."""

STALL = 5

DEFLECTION = 0.5
"""Weight of the present walk in the direction of the prices; the rest is that of the last step."""

MOST_LABELS = 2_000_000
"""With more labels in a pass the memory is not widened."""

SLOW_PASSES, WORTH = 12, 0.03
"""Passes after which something must have come of them: this share of the gap closed, or of the
states dead."""

SHRINK = 0.95
"""Vertices are forgotten when no more than this share of them is left."""

MOST_CELLS = 100_000_000
"""Most (goal, goal, vertex) cells: tables of 0.8 GiB."""

NO_HANDOVER = Handover()
"""Handover that never happens: walks go on as long as they make progress."""


@dataclass(frozen=True)
class Params:
    """Options of the solver.

    Attributes
    ----------
    search_rounds
        Rounds of ruin and recreate at the start, and again when all legs are measured.
    """

    search_rounds: int = 500

    def __post_init__(self) -> None:
        if self.search_rounds < 0:
            raise ValueError(
                f"option 'search_rounds': expected 0 or more, got {self.search_rounds}"
            )


def solve(graph: TravelGraph, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Bound and prove by walks, for few goals with many classes.

    With many goals it stops with the gap at which the walks make no more progress. An iteration is
    one pass over all layers.

    Parameters
    ----------
    graph : TravelGraph
        What to solve.
    params : Params, optional
        See `Params`.
    limits : Limits, optional
        Time, iterations, random generator, warm start, listener.

    Returns
    -------
    Result
        The best tour, and what is proven of it.

    Raises
    ------
    InputError
        The tables would not fit into memory.
    """
    chosen, limits = params or Params(), limits or Limits()
    if not fits(graph):
        raise InputError(
            f"solver 'dp': {graph.goal_count} goals with {len(graph)} classes need too much memory;"
            " use 'auto' or 'lns'"
        )
    run = SearchingRun(graph, limits, search_rounds=chosen.search_rounds)
    with run.until_stopped():
        run.update_incumbent(limits.warm_start)
        if not run.solve_if_trivial():
            run.find_first_tour()
            costs = CostMatrix(graph)
            run.search(costs)
            run.report("heuristic", vertices=len(costs))
            bound_by_walks(run, costs)
    return run.finish("proven" if run.is_done else "open")


def fits(graph: TravelGraph) -> bool:
    """Whether the tables of the walks over a graph are of a reasonable size."""
    return (graph.goal_count + 1) ** 2 * len(graph) <= MOST_CELLS


def bound_by_walks(
    run: SearchingRun, costs: CostMatrix, *, handover: Handover = NO_HANDOVER
) -> None:
    """Raise the bound of a run and forget vertices, until the proof is done or progress stalls, or
    few legs are left that are all measured: what is proven of those is up to the caller."""
    before = run.graph.before
    walks = Walks(costs.cluster, costs.values, run.clock.flag, before)
    prices = initial_prices(run, costs)
    direction: Floats = np.zeros(walks.n + 1)
    best, kept, step, vain = -np.inf, prices, STEP, 0
    history: list[tuple[float, int]] = []
    searched = run.searches_all_vertices(costs)
    while not run.is_done:
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
        once = bool((visits[1:] == 1).all())
        whole = once and respects_precedences(goals.tolist(), before)
        if whole:
            measured = costs.exact is None
            costs.measure(np.concatenate([[0], walk.rows]))
            run.update_incumbent([0, *costs.vertices[walk.rows].tolist()])
            walks.set_values(costs.values)
        _forget(run, walks, costs)
        if not searched and run.searches_all_vertices(costs):
            run.search(costs)
            searched = True
        run.report("walks", vertices=len(costs), legs=len(costs) * (len(costs) - 1) // 2)
        if whole:
            if measured and not run.is_done:
                return  # rounding is all that is missing, and no price can mend that
            best = -np.inf  # its legs have grown
            continue
        if walk.bound > best:
            best, kept, vain = walk.bound, prices, 0
        else:
            vain += 1
            if vain % STALL == 0:
                step, prices = step * SHORTER, kept
        history.append((best, int(walks.alive.sum())))
        stalls = _stalls(history, run.length)
        if costs.exact is not None and (stalls or len(costs) <= MEASURE_AT_ONCE):
            _measure(run, walks, costs)
            searched = run.searches_all_vertices(costs)
            best, step = -np.inf, STEP
            history.clear()
        elif stalls:
            return
        if costs.exact is None and handover.is_due(len(costs), walk.labels):
            return
        widened = walk.labels < MOST_LABELS and walks.memory.widen(goals.tolist())
        if once:  # in an order that is not allowed, which prices cannot mend
            if not widened:
                return
            continue
        missed: Floats = np.asarray(1.0 - visits, dtype=np.float64)
        missed[0] = 0.0
        direction = DEFLECTION * missed + (1.0 - DEFLECTION) * direction
        if direction @ direction < 0.1:
            direction = missed
        target = run.length if run.tour is not None else 1.1 * abs(walk.bound) + 1e-9
        prices = prices + step * (target - walk.bound) / (direction @ direction) * direction


def initial_prices(run: SearchingRun, costs: CostMatrix) -> Floats:
    """(n + 1,) for every goal half of the two legs of the incumbent there: its prices pay for its
    legs, but for half of those of the base."""
    prices = np.zeros(run.graph.goal_count + 1)
    if run.tour is not None:
        rows = np.searchsorted(costs.vertices, np.array(run.tour))
        legs = costs.values[rows, np.roll(rows, -1)]
        prices[costs.cluster[rows]] = 0.5 * (legs + np.roll(legs, 1))
    prices[0] = 0.0
    return prices


def _forget(run: SearchingRun, walks: Walks, costs: CostMatrix) -> None:
    """Drop vertices without a state, once they are many; the incumbent's stay."""
    keep = walks.left
    if run.tour is not None:
        keep[np.searchsorted(costs.vertices, np.array(run.tour))] = True
    if keep.sum() <= SHRINK * len(keep):
        walks.restrict(keep)
        costs.restrict(keep)
        walks.set_values(costs.values)


def _measure(run: SearchingRun, walks: Walks, costs: CostMatrix) -> None:
    """Measure all legs that are left, and search among them."""
    run.check()
    costs.measure_all(np.isfinite(costs.values))
    run.search(costs)
    walks.set_values(costs.values)
    run.report("measured", vertices=len(costs), legs=len(costs) * (len(costs) - 1) // 2)


def _stalls(history: list[tuple[float, int]], length: float) -> bool:
    """Whether the last `SLOW_PASSES` passes closed little of the gap and killed few states."""
    if len(history) <= SLOW_PASSES:
        return False
    (bound_then, states_then), (bound, states) = history[-1 - SLOW_PASSES], history[-1]
    closed = bound - bound_then > WORTH * (length - bound_then if length < np.inf else abs(bound))
    return not closed and states > (1.0 - WORTH) * states_then

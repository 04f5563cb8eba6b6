"""A bound from the goals alone: the travelling salesperson's tour over the shortest paths between
them in any class. It is weak, true, and had in a second where there are thousands of classes.

With hundreds of goals that tour is a proof of its own, and may have no bound for long. So 1-trees
come first (Held and Karp 1970, 1971): spanning trees of all goals but one, and two legs there, with
prices that goals of too many legs pay and those of too few get. Each is a bound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree

from netsp.arrays import Floats
from netsp.clock import Clock
from netsp.solving.limits import Limits
from netsp.travel.graph import TravelGraph
from netsp.travel.result import Result

ROUNDING = 1e-9
"""The paths are shortest up to this, relative."""

MOST_TREES, FIRST_STEP, SHORTER, PATIENCE = 60, 1.0, 0.7, 4
"""1-trees at most; the first step, as a share of Polyak's; and by how much steps get shorter when
so many trees have raised nothing."""

MOST_PROGRAMS = 300
"""Of the proof over goals: with hundreds of them it would take the time of that over classes."""

ABOVE = 1.1
"""The tour is taken to be so many times as long as the first bound, until one knows better."""

Prove = Callable[[TravelGraph, Limits], Result]


def bound_over_goals(graph: TravelGraph, prove: Prove, limits: Limits) -> float:
    """No tour of the graph is shorter; 0 if the limits leave nothing.

    Parameters
    ----------
    prove
        A solver that bounds.
    """
    clock = Clock.of(limits.time)
    least = graph.between_goals(lambda: clock.up)
    over = TravelGraph.from_costs(least, range(graph.goal_count + 1))
    trees = best_tree(least, lambda: clock.up)
    most = MOST_PROGRAMS if limits.iterations is None else min(limits.iterations, MOST_PROGRAMS)
    bound = prove(over, replace(limits, time=clock, iterations=most)).lower_bound or 0.0
    bound = max(bound, trees) * (1.0 - ROUNDING)
    graph.bound_in_any_class = max(graph.bound_in_any_class, bound)
    return bound


def best_tree(lengths: Floats, up: Callable[[], bool]) -> float:
    """The best bound on a tour by 1-trees; that of the first, whatever the time.

    Parameters
    ----------
    lengths
        (n, n) between all places; the diagonal does not count.
    up
        Whether the time is.
    """
    n = len(lengths)
    if n < 3:
        return 0.0
    prices, best, step, vain = np.zeros(n), -np.inf, FIRST_STEP, 0
    kept = prices
    for _ in range(MOST_TREES):
        bound, missing = _tree(lengths, prices)
        if bound > best:
            best, kept, vain = bound, prices, 0
        else:
            vain += 1
            if vain % PATIENCE == 0:
                step, prices = step * SHORTER, kept
                continue
        size = float(missing @ missing)
        if size == 0.0 or up():
            break
        prices = prices + step * (ABOVE * abs(best) - bound) / size * missing
    return max(best, 0.0)


def _tree(lengths: Floats, prices: Floats) -> tuple[float, Floats]:
    """Length of the least 1-tree at some prices, less what these come to, and (n,) how many legs
    more than two each place has."""
    priced = lengths + prices[:, None] + prices[None, :]
    two = np.partition(priced[0, 1:], 1)[:2]
    at = np.argpartition(priced[0, 1:], 1)[:2] + 1
    # scipy takes a stored zero for no edge; a spanning tree is the same for a constant more
    rest = priced[1:, 1:]
    shift = 1.0 - float(rest[~np.eye(len(rest), dtype=bool)].min())
    tree = minimum_spanning_tree(rest + shift).tocoo()
    legs = np.bincount(np.concatenate([tree.row + 1, tree.col + 1, at]), minlength=len(lengths))
    legs[0] = 2
    length = float(rest[tree.row, tree.col].sum() + two.sum())
    return length - 2.0 * float(prices.sum()), legs.astype(np.float64) - 2.0

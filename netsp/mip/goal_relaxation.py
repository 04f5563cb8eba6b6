"""A bound from the goals alone, had in seconds where there are thousands of classes.

No tour is shorter than the travelling salesperson's over the shortest paths between goals in any
class. That is 10 % short of the truth where tethers are long, because his tour goes around
obstacles. Where the roadmap knows the ways between goals by the rays that they cross, covers of
finitely many sheets leave 2 % (`netsp.mip.covers`).

With hundreds of goals his tour is a proof of its own, and may have no bound for long. So 1-trees
come first (Held and Karp 1970, 1971): spanning trees of all goals but one, and two legs there, with
prices that goals of too many legs pay and those of too few get. Each is a bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.gtsp.limits import Limits
from netsp.gtsp.sparse_costs import SparseCosts
from netsp.gtsp.travel.graph import TravelGraph, least_tethers
from netsp.gtsp.travel.result import Result
from netsp.mip.cost_fixing import surviving_legs
from netsp.mip.cover_bounds import CellBound, Cells, GoalBound
from netsp.mip.cover_costs import ClassCovers, Covers, PathCovers
from netsp.mip.covers import ParityTour, refine_covers
from netsp.mip.cuts import Cut
from netsp.mip.parity_cuts import odd_letters

ROUNDING = 1e-9
"""The paths are shortest up to this, relative."""

MOST_TREES, FIRST_STEP, SHORTER, PATIENCE = 60, 1.0, 0.7, 4
"""1-trees at most; the first step, as a share of Polyak's; and by how much steps get shorter when
so many trees have raised nothing."""

LEGS_AT_ONCE = 500_000
"""Looked at by 1-trees whatever the time, some hundredths of a second; but for the first tree."""

MOST_PROGRAMS = 300
"""Of the proof over goals: with hundreds of them it would take the time of that over classes."""

ABOVE = 1.1
"""The tour is taken to be so many times as long as the first bound, until one knows better."""

WAYS_SHARE = 0.3
"""Part of the time that finding ways may take."""

MANY_CLASSES = 3000
"""With fewer the covers in between are not worth their time."""

FEW_GOALS = 60
"""With fewer the tour over shortest paths is proven in any case, which takes a second."""

OnBound = Callable[[float, int, Ints], Sequence[int] | None]
"""Hears a bound as it rises, over how many cells, and the classes of least tether above those that
the program's point visits; may give a better tour."""

ABOVE_CELL = 2
"""So many of each."""

Prove = Callable[[TravelGraph, Limits], tuple[Result, Sequence[Cut]]]

Keep = Callable[[SparseCosts], None]
"""Is given the legs that may be in a better tour, once they are known."""


def bound_over_goals(
    graph: TravelGraph, prove: Prove, limits: Limits, tour: Sequence[int] | None = None,
    costs: Callable[[], Floats] | None = None, told: OnBound = lambda *_: None,
    keep: Keep | None = None,
) -> GoalBound:  # fmt: skip
    """No tour of the graph is shorter; a bound of 0 if the limits leave nothing.

    Parameters
    ----------
    prove
        A solver that bounds, and the cuts that it had in the end.
    tour
        The best one known; without one, covers are not looked at.
    costs
        Gives (V, V) of all legs, if no class was left out; called once there is a first bound, for
        it may take all the time that is left.
    told
        See `OnBound`.
    keep
        See `Keep`. If it is given, covers of ways come first, then those of the classes left, whose
        bound says nothing of classes that a roadmap has left out.
    """
    clock = Clock.from_limit(limits.time)
    least = graph.between_goals(lambda: clock.is_up)
    bound, cuts, cells = one_tree_bound(least, lambda: clock.is_up), tuple[Cut, ...](), None
    _holds_in_any_class(graph, bound * (1.0 - ROUNDING))
    if tour is not None and len(graph) > MANY_CLASSES:
        known = None if costs is None else costs()
        cells = _over_cells(graph, tour, clock, limits, known, told, keep)
    if cells is None or graph.goal_count < FEW_GOALS:
        over = TravelGraph.from_costs(least, range(graph.goal_count + 1))
        most = MOST_PROGRAMS if limits.iterations is None else min(limits.iterations, MOST_PROGRAMS)
        result, found = prove(over, replace(limits, time=clock, iterations=most))
        bound, cuts = max(bound, result.lower_bound or 0.0), tuple(found)
    bound *= 1.0 - ROUNDING
    over_cells = cells.bound * (1.0 - ROUNDING) if cells else 0.0
    # what lies over the classes that a roadmap has kept says nothing of the others
    over_kept = costs is not None or keep is not None
    _holds_in_any_class(graph, bound if over_kept else max(bound, over_cells))
    return GoalBound(max(bound, over_cells), cuts, cells)


def bound_by_one_trees(graph: TravelGraph) -> None:
    """A first bound for who has no time: a few 1-trees of straight lines between goals, or of the
    least costs between clusters."""
    if not graph.bound_in_any_class:
        least = graph.between_goals(lambda: True)
        left = iter(range(LEGS_AT_ONCE // least.size))
        bound = one_tree_bound(_finite(least), lambda: next(left, None) is None)
        _holds_in_any_class(graph, bound * (1.0 - ROUNDING))


def _finite(lengths: Floats) -> Floats:
    """With the longest of all where there is no leg: a tree can do without infinities."""
    longest = float(lengths.max(where=np.isfinite(lengths), initial=0.0))
    return np.asarray(np.minimum(lengths, longest))


def _holds_in_any_class(graph: TravelGraph, bound: float) -> None:
    graph.bound_in_any_class = max(graph.bound_in_any_class, bound)


def _over_cells(
    graph: TravelGraph, tour: Sequence[int], clock: Clock, limits: Limits, costs: Floats | None,
    told: OnBound, keep: Keep | None,
) -> CellBound | None:  # fmt: skip
    """What covers prove; None where the ways between goals are not known."""
    tower: Covers
    if costs is not None:
        odd = odd_letters(graph.signatures)
        tower = ClassCovers(costs, graph.cluster, odd)
    else:
        some = clock.part(WAYS_SHARE)
        ways = graph.ways_by_parity(lambda: some.is_up)
        if ways is None:
            return None
        tower = PathCovers(ways, np.inf)
        odd = odd_letters(graph.signatures, ways.obstacles)

    def stops(tour: Sequence[int]) -> ParityTour:
        return [(int(graph.cluster[v]), odd[v]) for v in tour]

    def heard(bound: float, cells: Cells, visited: Ints) -> tuple[ParityTour, float] | None:
        own = cells.of(graph.cluster, odd)
        above = np.flatnonzero(np.isin(own, visited))
        least = least_tethers(graph.costs_to_base[above], own[above], ABOVE_CELL)
        if costs is None and keep is None:  # covers of ways, whichever classes were kept
            _holds_in_any_class(graph, bound * (1.0 - ROUNDING))
        better = told(bound * (1.0 - ROUNDING), len(cells.cluster), above[least])
        if better is None:
            return None
        best[:] = better
        return stops(better), graph.tour_length(better)

    def finer(over: CellBound, length: float) -> Covers:
        assert keep is not None
        with graph.on_clock(clock):
            rows = surviving_legs(graph, over, length, best, odd)
        _holds_in_any_class(graph, over.bound * (1.0 - ROUNDING))
        keep(rows)
        return ClassCovers(rows, graph.cluster, odd)

    best, length = list(tour), graph.tour_length(tour)
    return refine_covers(tower, stops(tour), length, clock, limits, heard, finer if keep else None)


def one_tree_bound(lengths: Floats, up: Callable[[], bool]) -> float:
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
    from scipy.sparse.csgraph import minimum_spanning_tree

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

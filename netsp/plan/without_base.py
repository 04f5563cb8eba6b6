"""Travel graphs without a base: one run from each vertex of the smallest cluster.

What one run has found is of use to the next: no tour that is as long as it is of interest, and a
run that proves so much of its own tours is done.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock, until_interrupt
from netsp.gtsp.limits import Limits
from netsp.gtsp.search.lns_solver import Params as SearchParams
from netsp.gtsp.search.lns_solver import solve as search
from netsp.gtsp.travel.graph import BaselessGraph, TravelGraph
from netsp.gtsp.travel.result import OnProgress, Progress, Result, of_part, proven
from netsp.mip.goal_relaxation import bound_by_one_trees
from netsp.model.bound_scope import Scope
from netsp.model.solution import Status

ROUNDS_PER_CLUSTER = 2000
"""Of a first search, shared among the vertices: it says where to begin, and what is found ahead of
a proof spares it most of the work."""

FIRST_SHARE = 0.2
"""Part of the time that these may take."""

Run = Callable[[TravelGraph, Limits], Result]


def solve(graph: BaselessGraph, run: Run, limits: Limits, *, proves: bool) -> Result:
    """Run a solver from each vertex of the smallest cluster.

    Parameters
    ----------
    graph : BaselessGraph
        What to solve.
    run : callable
        The solver.
    limits : Limits
        Time and iterations are shared among the runs.
    proves : bool
        Whether the solver looks for a proof, so that a tour found otherwise is of use to it.

    Returns
    -------
    Result
        The best tour, by the graph's vertices, and the least of the bounds.
    """
    roots = graph.roots
    with until_interrupt(limits.time) as clock:
        limits = replace(limits, time=clock)
        best = _given(graph, limits)
        if proves:
            best, roots = _searched(graph, roots, limits, best)
        bounds, rows = [], list[Progress]()
        for k, root in enumerate(roots.tolist()):
            left = len(roots) - k
            if clock.is_up and best.tour is not None:
                bounds += [0.0] * left
                break
            part, vertices = graph.rooted(root)
            tell = _told(
                graph.scope, rows, limits.on_progress, clock, best, bounds if left == 1 else None
            )
            share = replace(
                limits, time=clock if left == 1 else clock.part(1.0 / left),
                iterations=None if limits.iterations is None
                else max(1, limits.iterations // len(roots)),
                on_progress=of_part(tell, vertices, lambda b: b),
                warm_start=_from(root, best, vertices),
                cutoff=math.inf if best.length is None else best.length,
            )  # fmt: skip
            found = run(part, share)
            if found.status is Status.INFEASIBLE:
                bounds.append(math.inf)
            else:
                bounds.append(found.lower_bound or 0.0)
            if found.length is not None and found.length < (best.length or math.inf):
                tour = tuple(int(vertices[v]) for v in found.tour or ())
                best = replace(found, tour=tour)
    bound = min(bounds)
    if proves and bound == 0.0:
        bound_by_one_trees(graph)
        bound = graph.bound_in_any_class
    best = replace(best, lower_bound_of=graph.scope)
    if best.length is None or best.tour is None:
        status = Status.INFEASIBLE if bound == math.inf else Status.NO_SOLUTION_FOUND
        return replace(best, status=status, lower_bound=None, trace=tuple(rows))
    bound = min(bound, best.length)
    status = Status.OPTIMAL if proven(best.length, bound) else Status.FEASIBLE
    told = None if bound == 0.0 and status is not Status.OPTIMAL else bound
    return replace(best, status=status, lower_bound=told, trace=tuple(rows))


def _given(graph: BaselessGraph, limits: Limits) -> Result:
    """The warm start, if any."""
    tour = limits.warm_start
    if tour is None:
        return Result(None, None, None, Status.NO_SOLUTION_FOUND)
    return Result(tuple(tour), graph.tour_length(tour), None, Status.FEASIBLE)


def _searched(
    graph: BaselessGraph, roots: Ints, limits: Limits, best: Result
) -> tuple[Result, Ints]:
    """A first tour from each root; the best of all, and the roots, that of the shortest first."""
    lengths = []
    clock = Clock.from_limit(limits.time).part(FIRST_SHARE)
    rounds = max(1, ROUNDS_PER_CLUSTER // len(roots)) * graph.cluster_count
    for k, root in enumerate(roots.tolist()):
        part, vertices = graph.rooted(root)
        share = Limits(clock.part(1.0 / (len(roots) - k)), rounds, limits.rng)
        found = search(part, SearchParams(), share)
        lengths.append(math.inf if found.length is None else found.length)
        if lengths[-1] < (best.length or math.inf):
            tour = tuple(int(vertices[v]) for v in found.tour or ())
            best = replace(found, tour=tour, trace=())
    return best, roots[np.argsort(lengths, kind="stable")]


def _from(root: int, best: Result, vertices: Ints) -> list[int] | None:
    """The best tour, if it is one from this root, by the vertices of the rooted graph."""
    if best.tour is None or root not in best.tour:
        return None
    k = best.tour.index(root)
    place = {int(v): i for i, v in enumerate(vertices)}
    return [place[v] for v in (*best.tour[k:], *best.tour[:k])]


def _told(
    scope: Scope, rows: list[Progress], listener: OnProgress | None, clock: Clock, best: Result,
    bounds: list[float] | None,
) -> OnProgress:  # fmt: skip
    """A listener to one run that tells the best tour of all runs, and in the last of them, when
    each has a bound, the least of these."""
    others = math.inf if bounds is None else min(bounds, default=math.inf)

    def tell(row: Progress) -> None:
        bound = None
        if bounds is not None and row.bound is not None:
            bound = row.bound.or_elsewhere(others, scope, "each other root has a bound")
        row = replace(row, bound=bound, time=clock.elapsed)
        if best.length is not None and best.length <= (row.incumbent or math.inf):
            row = replace(row, incumbent=best.length, tour=best.tour)
        rows.append(row)
        if listener is not None:
            listener(row)

    return tell

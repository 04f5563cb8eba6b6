"""Travel graphs without a base: one run from each vertex of the smallest cluster.

The best tour of the runs before is the cutoff of the next: a run ends once it proves that none of
its tours is shorter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock
from netsp.base.interrupt_signals import until_interrupt
from netsp.gtsp.instance import BaselessInstance, Instance
from netsp.gtsp.limits import Limits
from netsp.gtsp.search.lns_solver import Params as SearchParams
from netsp.gtsp.search.lns_solver import solve as search
from netsp.gtsp.travel.result import OnProgress, Progress, Result, of_part, proven
from netsp.mip.goal_relaxation import bound_by_one_trees
from netsp.model.bound_scope import Scope
from netsp.model.solution import Status
from netsp.plan.solve_policy import BaselessPolicy

Run = Callable[[Instance, Limits], Result]


def solve(
    graph: BaselessInstance,
    run: Run,
    limits: Limits,
    *,
    proves: bool,
    policy: BaselessPolicy = BaselessPolicy(),
) -> Result:
    """Run a solver from each vertex of the smallest cluster.

    Parameters
    ----------
    graph : BaselessInstance
        Graph without a base.
    run : callable
        Solver.
    limits : Limits
        Limits, whose time and iterations the runs share.
    proves : bool
        Whether the solver looks for a proof, so that a tour found before is of use to it.
    policy : BaselessPolicy
        Search before the runs.

    Returns
    -------
    Result
        Best tour, as vertices of the graph, and minimum of the bounds.
    """
    roots = graph.roots
    with until_interrupt(limits.time) as clock:
        limits = replace(limits, time=clock)
        best = _from_warm_start(graph, limits)
        if proves:
            best, roots = _search(graph, roots, limits, best, policy)
        bounds, rows = [], list[Progress]()
        for k, root in enumerate(roots.tolist()):
            left = len(roots) - k
            if clock.is_up and best.tour is not None:
                bounds += [0.0] * left
                break
            part, vertices = graph.rooted(root)
            listener = _listener(
                graph.scope, rows, limits.on_progress, clock, best, bounds if left == 1 else None
            )
            iterations = limits.iterations
            share = replace(
                limits,
                time=clock if left == 1 else clock.part(1.0 / left),
                iterations=None if iterations is None else max(1, iterations // len(roots)),
                on_progress=of_part(listener, vertices, lambda b: b),
                warm_start=_tour_from(root, best, vertices),
                cutoff=math.inf if best.length is None else best.length,
            )
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
    claimed = None if bound == 0.0 and status is not Status.OPTIMAL else bound
    return replace(best, status=status, lower_bound=claimed, trace=tuple(rows))


def _from_warm_start(graph: BaselessInstance, limits: Limits) -> Result:
    """Return the warm start as a result, if there is one."""
    tour = limits.warm_start
    if tour is None:
        return Result(None, None, None, Status.NO_SOLUTION_FOUND)
    return Result(tuple(tour), graph.tour_length(tour), None, Status.FEASIBLE)


def _search(
    graph: BaselessInstance, roots: Ints, limits: Limits, best: Result, policy: BaselessPolicy
) -> tuple[Result, Ints]:
    """Search from each root, and return the best tour and the roots by length of their tours."""
    lengths = []
    clock = Clock.from_limit(limits.time).part(policy.time_share)
    rounds = max(1, policy.rounds_per_cluster // len(roots)) * graph.cluster_count
    for k, root in enumerate(roots.tolist()):
        part, vertices = graph.rooted(root)
        share = Limits(clock.part(1.0 / (len(roots) - k)), rounds, limits.rng)
        found = search(part, SearchParams(), share)
        lengths.append(math.inf if found.length is None else found.length)
        if lengths[-1] < (best.length or math.inf):
            tour = tuple(int(vertices[v]) for v in found.tour or ())
            best = replace(found, tour=tour, trace=())
    return best, roots[np.argsort(lengths, kind="stable")]


def _tour_from(root: int, best: Result, vertices: Ints) -> list[int] | None:
    """Return the best tour from a root, as vertices of the rooted graph, if it visits the root."""
    if best.tour is None or root not in best.tour:
        return None
    k = best.tour.index(root)
    place = {int(v): i for i, v in enumerate(vertices)}
    return [place[v] for v in (*best.tour[k:], *best.tour[:k])]


def _listener(
    scope: Scope,
    rows: list[Progress],
    on_progress: OnProgress | None,
    clock: Clock,
    best: Result,
    bounds: list[float] | None,
) -> OnProgress:
    """Return a listener to one run that reports the best tour of all runs.

    In the last run, when each has a bound, it reports the minimum of the bounds as well.
    """
    others = math.inf if bounds is None else min(bounds, default=math.inf)

    def listen(row: Progress) -> None:
        bound = None
        if bounds is not None and row.bound is not None:
            bound = row.bound.or_elsewhere(others, scope, "each other root has a bound")
        row = replace(row, bound=bound, time=clock.elapsed)
        if best.length is not None and best.length <= (row.incumbent or math.inf):
            row = replace(row, incumbent=best.length, tour=best.tour)
        rows.append(row)
        if on_progress is not None:
            on_progress(row)

    return listen

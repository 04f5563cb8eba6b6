"""`lns`: ruin and recreate with exact choice of vertices, as a solver of its own."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock
from netsp.gtsp.gtsp_policy import GtspPolicy, NeighbourhoodPolicy
from netsp.gtsp.instance import Instance, cheapest_per_cluster
from netsp.gtsp.limits import Limits
from netsp.gtsp.neighbourhood import classes_near_tour
from netsp.gtsp.search.layers import LayeredInstance
from netsp.gtsp.search.local_search import Search
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.result import Result


@dataclass(frozen=True)
class Params:
    """Options of the solver.

    Attributes
    ----------
    classes
        Maximum number of classes per goal: at first those of shortest tether, then those near the
        incumbent. With 0, as many as make `max_vertices` in all, or as many as the neighbourhood
        policy has, whichever is more.
    restarts
        Searches that share the iterations or the time, each from the best tour so far.
    max_vertices
        Number of vertices in all, shared among the goals, if `classes` is 0.
    rounds_per_goal
        Rounds for each goal if neither time nor iterations are limited.
    policy
        Policy of costs, searches and neighbourhoods.
    """

    classes: int = 0
    restarts: int = 5
    max_vertices: int = 1000
    rounds_per_goal: int = 300
    policy: GtspPolicy = field(default_factory=GtspPolicy)

    def __post_init__(self) -> None:
        if self.classes < 0:
            raise ValueError(f"option 'classes': expected 0 or more, got {self.classes}")
        if self.restarts < 1:
            raise ValueError(f"option 'restarts': expected 1 or more, got {self.restarts}")
        for name in ("max_vertices", "rounds_per_goal"):
            if getattr(self, name) < 1:
                raise ValueError(f"option {name!r}: expected 1 or more, got {getattr(self, name)}")


def solve(graph: Instance, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Search orders of goals, without a bound.

    An iteration is one round of ruin and recreate. The search cools over the iterations, or over
    the time if only time is limited.
    """
    chosen, limits = params or Params(), limits or Limits()
    rng = limits.rng
    run = SolverRun(graph, limits, policy=chosen.policy.costs)
    with run.until_stopped():
        run.update_incumbent(limits.warm_start)
        if not run.solve_if_trivial():
            _search(run, rng, chosen)
    return run.finish("done")


def _search(run: SolverRun, rng: np.random.Generator, chosen: Params) -> None:
    graph = run.graph
    run.check()
    policy = chosen.policy
    count = chosen.classes or max(
        max_classes_per_goal(graph, chosen.max_vertices),
        policy.neighbourhood.vertices_per_cluster(graph.goal_count),
    )
    core = search_core(run, count)
    instance = LayeredInstance.among(graph, core, policy.local_search)
    is_timed = run.clock.limit is not None and run.iteration_limit == np.inf
    if not is_timed and run.iteration_limit == np.inf:
        run.iteration_limit = chosen.rounds_per_goal * graph.goal_count
    total = 0 if is_timed else int(run.iteration_limit)
    for k in range(chosen.restarts):
        start = None if run.tour is None else graph.cluster[list(run.tour)]
        run.check()
        if k and len(core) < len(graph) and run.tour is not None:
            core = _near_incumbent(run, count, policy.neighbourhood)
            instance = LayeredInstance.among(graph, core, policy.local_search)
        clock = run.clock.part(1.0 / (chosen.restarts - k))
        search = Search(instance, rng, start, clock)
        search.settle()
        _offer_incumbent(run, search)
        run.report("settled", current=search.length)

        def progress(clock: Clock = clock) -> float:
            return clock.elapsed / (clock.limit or 1.0)

        def on_chunk(count: int, search: Search = search) -> None:
            run.iterations += count
            if search.best_length < run.length * (1.0 - 1e-12):
                _offer_incumbent(run, search)
            run.report("search", current=search.length)

        rounds = total * (k + 1) // chosen.restarts - total * k // chosen.restarts
        search.run(np.inf if is_timed else rounds, clock, progress if is_timed else None, on_chunk)


def search_core(run: SolverRun, classes: int) -> Ints:
    """Return the vertices of each goal nearest to the base, and those of the incumbent."""
    graph = run.graph
    core = cheapest_per_cluster(graph.costs_to_base, graph.cluster, classes)
    return np.union1d(core, run.tour) if run.tour is not None else core


def _near_incumbent(run: SolverRun, classes: int, policy: NeighbourhoodPolicy) -> Ints:
    graph, tour = run.graph, run.tour or (0,)
    bounds = graph.lower_bounds(rows=tour)
    return classes_near_tour(graph.costs_to_base, graph.cluster, bounds, tour, classes, policy)


def _offer_incumbent(run: SolverRun, search: Search) -> None:
    length, tour = search.best()
    run.update_incumbent(tour, length=length)


def max_classes_per_goal(graph: Instance, vertices: int) -> int:
    """Return the number of classes per goal, at least 3, that keeps the total within `vertices`."""
    sizes = np.bincount(graph.cluster)
    k = 3
    while k < sizes.max() and np.minimum(sizes, k + 1).sum() <= vertices:
        k += 1
    return k

"""`lns`: ruin and recreate with exact choice of classes, as a solver of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.clock import Clock
from netsp.gtsp.limits import Limits
from netsp.gtsp.neighbourhood import classes_near_tour, searched_classes_per_goal
from netsp.gtsp.search.layers import Instance
from netsp.gtsp.search.local_search import Search
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.graph import TravelGraph, least_tethers
from netsp.gtsp.travel.result import Result

ROUNDS_PER_GOAL = 300
"""Default number of rounds, times the number of goals, when nothing is limited."""

MOST_VERTICES = 1000
"""By default so many classes of least tether are looked at, shared among the goals, but
no fewer of each than are worth a search (`netsp.gtsp.neighbourhood`)."""


@dataclass(frozen=True)
class Params:
    """Options of the solver.

    Attributes
    ----------
    classes
        Most classes per goal, at first those of least tether, then those beside the best tour; 0
        for as many as make `MOST_VERTICES` in all, or are worth a search, whichever is more.
    restarts
        Searches that share the iterations or the time, each from the best so far.
    """

    classes: int = 0
    restarts: int = 5

    def __post_init__(self) -> None:
        if self.classes < 0:
            raise ValueError(f"option 'classes': expected 0 or more, got {self.classes}")
        if self.restarts < 1:
            raise ValueError(f"option 'restarts': expected 1 or more, got {self.restarts}")


def solve(graph: TravelGraph, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Search orders of goals. An iteration is one round of ruin and recreate; the search cools over
    the iterations, or over the time if only that is limited. No bound is claimed."""
    chosen, limits = params or Params(), limits or Limits()
    rng = limits.rng
    run = SolverRun(graph, limits)
    with run.until_stopped():
        run.update_incumbent(limits.warm_start)
        if not run.solve_if_trivial():
            _search(run, rng, chosen)
    return run.finish("done")


def _search(run: SolverRun, rng: np.random.Generator, chosen: Params) -> None:
    graph = run.graph
    run.check()
    core = search_core(run, chosen.classes or _by_default(graph))
    instance = Instance.among(graph, core)
    by_clock = run.clock.limit is not None and run.iteration_limit == np.inf
    if not by_clock and run.iteration_limit == np.inf:
        run.iteration_limit = ROUNDS_PER_GOAL * graph.goal_count
    total = 0 if by_clock else int(run.iteration_limit)
    for k in range(chosen.restarts):
        start = None if run.tour is None else graph.cluster[list(run.tour)]
        run.check()
        if k and len(core) < len(graph) and run.tour is not None:
            core = core_near_incumbent(run, chosen.classes)
            instance = Instance.among(graph, core)
        clock = run.clock.part(1.0 / (chosen.restarts - k))
        search = Search(instance, rng, start, clock)
        search.settle()
        _take(run, search)
        run.report("settled", current=search.length)

        def progress(clock: Clock = clock) -> float:
            return clock.elapsed / (clock.limit or 1.0)

        def tell(count: int, search: Search = search) -> None:
            run.iterations += count
            if search.best_length < run.length * (1.0 - 1e-12):
                _take(run, search)
            run.report("search", current=search.length)

        rounds = total * (k + 1) // chosen.restarts - total * k // chosen.restarts
        search.run(np.inf if by_clock else rounds, clock, progress if by_clock else None, tell)


def search_core(run: SolverRun, classes: int = 0, vertices: int = MOST_VERTICES) -> Ints:
    """The classes of least tether that a search looks at, and those of the incumbent: so many of
    every goal, by default (0) as many as make so many vertices in all."""
    graph = run.graph
    some = classes or max_classes_per_goal(graph, vertices)
    core = least_tethers(graph.costs_to_base, graph.cluster, some)
    return np.union1d(core, run.tour) if run.tour is not None else core


def core_near_incumbent(run: SolverRun, classes: int = 0) -> Ints:
    """The classes that a search looks at once there is a tour: some of least tether, and those
    beside it."""
    graph, tour = run.graph, run.tour or (0,)
    some = classes or _by_default(graph)
    bounds = graph.lower_bounds(rows=tour)
    return classes_near_tour(graph.costs_to_base, graph.cluster, bounds, tour, some)


def _take(run: SolverRun, search: Search) -> None:
    length, tour = search.best()
    run.update_incumbent(tour, length=length)


def _by_default(graph: TravelGraph) -> int:
    """Classes per goal."""
    return max(
        max_classes_per_goal(graph, MOST_VERTICES), searched_classes_per_goal(graph.goal_count)
    )


def max_classes_per_goal(graph: TravelGraph, vertices: int) -> int:
    """The most classes per goal that give no more than so many vertices, at least 3."""
    sizes = np.bincount(graph.cluster)
    k = 3
    while k < sizes.max() and np.minimum(sizes, k + 1).sum() <= vertices:
        k += 1
    return k

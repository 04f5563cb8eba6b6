"""`auto`: the solver by the size of the problem; always a tour, a bound and a gap.

With up to eight goals or so all sets of goals are gone through (`netsp.plan.exact`). Up to
`PROVABLE` vertices it proves: the heuristic finds the tour; for up to `FEW_GOALS` goals walks
(`netsp.gtsp.dp`) bound it where legs are a matrix, which at that size ends with a proof more often
than not; cutting planes (`netsp.mip`) do the rest, or all of it with more goals or more vertices,
on the vertices that are left. Beyond `PROVABLE` few goals are proven over the classes of least
tether, which proves the tour for good where it is no longer than twice the tether of every other
class. With many, `lns` searches among them, and the bound comes from covers of finitely many sheets
(`netsp.mip.covers`), or where there are none from the goals alone, as the travelling salesperson's
tour over the shortest paths between them in any class.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from netsp.base.clock import Clock
from netsp.base.errors import MemoryLimitError
from netsp.gtsp.dp.dp_solver import Params as WalkParams
from netsp.gtsp.dp.dp_solver import fits as walks_fit
from netsp.gtsp.dp.dp_solver import solve as walk
from netsp.gtsp.limits import Limits
from netsp.gtsp.search.lns_solver import solve as search
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.graph import TravelGraph, least_tethers
from netsp.gtsp.travel.kept import with_bound, with_classes_left_out
from netsp.gtsp.travel.result import Result, of_part
from netsp.mip.goal_relaxation import OnBound, bound_by_one_trees, bound_over_goals
from netsp.mip.merging import search_and_merge
from netsp.mip.mip_solver import MipRun, solve_merged
from netsp.mip.mip_solver import Params as MipParams
from netsp.mip.mip_solver import solve as prove
from netsp.model.bound_scope import LowerBound, strongest
from netsp.plan import exact
from netsp.plan.search_effort import SearchEffort

PROVABLE = 22_000
"""Most vertices of a travel graph that `mip` is asked to bound: as many as the taut roadmap keeps,
unless it is asked for more."""

MOST_KEPT = 3_000
"""With more vertices and few goals, about so many, those of least tether, are proven over."""

FEW_GOALS = 24
"""Most goals for which walks come first: with more, remembering them costs more than cuts do."""

SEARCH_EFFORT = SearchEffort(max_proven_goals=FEW_GOALS)
"""Rounds of ruin and recreate before and after the root."""

FEW_CLASSES = 3
"""Of a goal, where the roadmap had to leave classes out: a tour over them comes first."""

FEW_SHARE = 0.4
"""Part of the time that this may take."""

GOALS_SHARE = 0.2
"""Part of the time that a first bound from the goals may take."""

SHARE = 0.6
"""Part of the time that the search has at least where it shares it with a bound that is weak."""

BOUND_SHARE = 0.8
"""Where a proof over all classes is not tried, part of the time that is left for the bound after
the first search."""


@dataclass(frozen=True)
class Params:
    """Options of the solver.

    Attributes
    ----------
    backend
        Of `mip`.
    """

    backend: str = "highs"

    def __post_init__(self) -> None:
        MipParams(backend=self.backend)


def solve(graph: TravelGraph, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Solve by size. Iterations are those of the solver chosen."""
    found = _by_size(graph, params or Params(), limits or Limits())
    if not found.lower_bound:
        bound_by_one_trees(graph)
    return found


def _by_size(graph: TravelGraph, chosen: Params, limits: Limits) -> Result:
    if exact.fits(graph):
        small = SolverRun(graph, limits)
        with small.until_stopped():
            small.update_incumbent(limits.warm_start)
            if not small.solve_if_trivial():
                exact.solve(small)
        return small.finish("proven" if small.is_done else "exact")
    if len(graph.before):
        return _in_part_ordered(graph, limits, chosen.backend)
    clock = Clock.from_limit(limits.time)
    limits = replace(limits, time=clock)
    if not graph.complete and graph.roadmapped:
        # it says that a proof over the classes that were kept may not come to an end
        if graph.goal_count <= FEW_GOALS or not graph.knows_ways:
            _bound_by_goals(graph, Limits(clock.part(GOALS_SHARE), rng=limits.rng))
        if graph.goal_count > FEW_GOALS:
            if limits.warm_start is None:
                limits = _from_few(graph, limits, chosen.backend)
            tour, otherwise = limits.warm_start, graph.least_by_way_of(graph.least_left_out)
            if tour is not None and graph.knows_ways and otherwise < graph.tour_length(tour):
                # no proof over the classes kept would count: others may be in a shorter tour
                return _beyond(graph, limits)
            if tour is None and graph.knows_ways:
                _bound_by_goals(graph, Limits(clock.part(GOALS_SHARE), rng=limits.rng))
    if len(graph) <= PROVABLE:
        run = MipRun(graph, limits, search_rounds=_rounds(graph))
        try:
            return run.solve(chosen.backend, limits.warm_start, walks=graph.goal_count <= FEW_GOALS)
        except MemoryLimitError:
            # a search and covers of ways need no matrix
            return _beyond(graph, replace(limits, warm_start=run.tour or limits.warm_start))
    if graph.goal_count <= FEW_GOALS and graph.roadmapped:
        return _over_shortest(graph, limits, chosen.backend)
    return _beyond(graph, limits)


def _beyond(graph: TravelGraph, limits: Limits) -> Result:
    """No proof over all classes: a search, the bound of covers with its tour, and more
    searches if there is time left."""
    run = MipRun(graph, limits, search_rounds=_rounds(graph))

    with run.until_stopped():
        run.update_incumbent(limits.warm_start)
        run.find_first_tour()
        run.search_near_incumbent()
        share = run.clock.part(BOUND_SHARE) if run.clock.limit else run.clock
        run.raise_bound(
            _bound_by_goals(graph, Limits(share, rng=limits.rng), run.tour, run.on_cover_bound)
        )
        run.report("goals")
        search_and_merge(run, solve_merged)
    return run.finish("proven" if run.is_done else "open")


def _rounds(graph: TravelGraph) -> int:
    """Return the number of rounds of one search."""
    return SEARCH_EFFORT.rounds(graph.goal_count)


def _in_part_ordered(graph: TravelGraph, limits: Limits, backend: str) -> Result:
    """With precedences: walks, which remember them, prove where goals are few; with many, a search.
    The bound of the tours in any order holds, too, and is quickly had."""
    clock = Clock.from_limit(limits.time)
    limits = replace(limits, time=clock)
    few = walks_fit(graph) and graph.goal_count <= FEW_GOALS
    rounds = _rounds(graph)
    bound: LowerBound | None = None
    if len(graph) <= PROVABLE:
        share = Clock((1.0 - SHARE) * clock.left, within=clock) if clock.limit else clock
        free = MipRun(
            graph.unordered(), replace(limits, time=share, warm_start=None, on_progress=None),
            search_rounds=rounds,
        ).solve(backend, None)  # fmt: skip
        if free.bound is not None:
            bound = free.bound.for_part(graph.scope, "tours in the order asked for are tours")
    found = (
        walk(graph, WalkParams(rounds), limits) if few else search(graph, limits=limits)
    )  # fmt: skip
    if found.length is None:
        return found
    best = strongest(found.bound, bound)
    return found if best is None else with_bound(found, best)


def _bound_by_goals(
    graph: TravelGraph, limits: Limits, tour: Sequence[int] | None = None,
    told: OnBound = lambda *_: None,
) -> float:  # fmt: skip
    """A bound on the tours in any class; the one that is known if there is one, and no tour."""
    if tour is not None or not graph.bound_in_any_class:
        bound_over_goals(
            graph, lambda g, limits: (prove(g, limits=limits), ()), limits, tour, on_bound=told
        )
    return graph.bound_in_any_class


def _from_few(graph: TravelGraph, limits: Limits, backend: str) -> Limits:
    """The limits with a tour to start from, the shortest over few classes. A roadmap that had to
    leave classes out has long words, whose legs take long: with all that it kept, a search would
    have little time left."""
    core = least_tethers(graph.costs_to_base, graph.cluster, FEW_CLASSES)
    if len(core) == len(graph):
        return limits
    share = Clock.from_limit(limits.time).part(FEW_SHARE)
    found = MipRun(
        graph.subgraph(core),
        # bounds over few classes say nothing of the others
        replace(limits, time=share, on_progress=of_part(limits.on_progress, core, lambda _: None)),
        search_rounds=_rounds(graph),
    ).solve(backend, None)  # fmt: skip
    if found.tour is None:
        return limits
    return replace(limits, warm_start=[int(core[v]) for v in found.tour])


def _over_shortest(graph: TravelGraph, limits: Limits, backend: str) -> Result:
    """Prove over the classes of least tether; tours by way of the others are bounded by
    twice its tether."""
    core = least_tethers(graph.costs_to_base, graph.cluster, MOST_KEPT // graph.goal_count)
    given = limits.warm_start
    if given is not None:
        core = np.union1d(core, np.asarray(given, dtype=np.int64))
    others = np.ones(len(graph), dtype=bool)
    others[core] = False
    place = {int(v): k for k, v in enumerate(core)}
    warm = None if given is None else [place[int(v)] for v in given]
    least = graph.least_by_way_of(float(graph.tethers[others].min(initial=np.inf)))
    because = "a tour by way of another class goes along its tether and back"

    def bound_of_whole(bound: LowerBound | None) -> LowerBound | None:
        return None if bound is None else bound.or_elsewhere(least, graph.scope, because)

    run = MipRun(
        graph.subgraph(core),
        replace(limits, on_progress=of_part(limits.on_progress, core, bound_of_whole)),
        search_rounds=_rounds(graph),
    )
    found = run.solve(backend, warm, walks=True)
    if found.tour is None:
        return with_classes_left_out(found, least, graph.scope, because)
    whole = replace(found, tour=tuple(int(core[v]) for v in found.tour))
    otherwise = min(least, graph.least_by_way_of(graph.least_left_out))
    clock = Clock.from_limit(limits.time)
    if otherwise < (whole.length or 0.0) and not clock.is_up:
        # of few goals the shortest tour in any class is soon known
        _bound_by_goals(graph, Limits(clock, rng=limits.rng))
    return with_classes_left_out(whole, least, graph.scope, because)

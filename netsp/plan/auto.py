"""`auto`: the solver by the size of the problem; always a tour, a bound and a gap.

Up to about eight goals it solves by sets of goals (`netsp.plan.exact`). Up to
`RoutePolicy.max_proven_vertices` it proves: a search finds the tour; with up to `max_walk_goals`
goals, walks (`netsp.gtsp.dp`) bound it if costs are a matrix, which at that size mostly ends with a
proof; cutting planes (`netsp.mip`) do the rest, or all of it, on the vertices that remain. Beyond
that size, few goals are proven over the classes of shortest tether, which proves the tour if it is
no longer than twice the tether of every other class. With many goals, the tour comes from a search,
and the bound from covers (`netsp.mip.covers`) or, without them, from the travelling salesperson's
tour over the shortest paths between goals in any class.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from netsp.base.clock import Clock
from netsp.base.errors import MemoryLimitError
from netsp.gtsp.dp.dp_solver import Params as WalkParams
from netsp.gtsp.dp.dp_solver import fits as walks_fit
from netsp.gtsp.dp.dp_solver import solve as walk
from netsp.gtsp.instance import Instance, cheapest_per_cluster
from netsp.gtsp.limits import Limits
from netsp.gtsp.search.lns_solver import Params as SearchParams
from netsp.gtsp.search.lns_solver import solve as search
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.kept import with_bound, with_classes_left_out
from netsp.gtsp.travel.result import Result, of_part
from netsp.mip.goal_relaxation import OnBound, bound_by_one_trees, bound_over_goals
from netsp.mip.merging import search_and_merge
from netsp.mip.mip_solver import MipRun, solve_merged
from netsp.mip.mip_solver import Params as MipParams
from netsp.mip.mip_solver import solve as prove
from netsp.model.bound_scope import LowerBound, strongest
from netsp.plan import exact, scheduled
from netsp.plan.solve_policy import SolvePolicy


@dataclass(frozen=True)
class Params:
    """Options of the solver.

    Attributes
    ----------
    backend
        Backend of `mip`.
    scheduler
        Whether a scheduler gives time to what closes the gap fastest, instead of a route by size
        (`netsp.plan.scheduled`). Experimental.
    policy
        Choice of solvers by size, and policies of the solvers.
    """

    backend: str = "highs"
    scheduler: bool = False
    policy: SolvePolicy = field(default_factory=SolvePolicy)

    def __post_init__(self) -> None:
        MipParams(backend=self.backend)


def solve(graph: Instance, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Solve by size; iterations are those of the solver chosen."""
    chosen = params or Params()
    if chosen.scheduler:
        found = scheduled.solve(graph, chosen.backend, chosen.policy, limits or Limits())
    else:
        found = _solve_by_size(graph, chosen, limits or Limits())
    if not found.lower_bound:
        bound_by_one_trees(graph, chosen.policy.mip.goals)
    return found


def _solve_by_size(graph: Instance, chosen: Params, limits: Limits) -> Result:
    routes = chosen.policy.routes
    if exact.fits(graph, chosen.policy.subsets):
        return _over_subsets(graph, limits)
    if len(graph.before):
        return _in_partial_order(graph, chosen, limits)
    limits = replace(limits, time=Clock.from_limit(limits.time))
    few_goals = graph.goal_count <= routes.max_walk_goals
    if not graph.is_complete and not graph.has_cost_matrix:
        limits, proves = _prepare_truncated(graph, chosen, limits)
        if not proves:
            return _by_search(graph, chosen, limits)
    if len(graph) <= routes.max_proven_vertices:
        run = _mip_run(graph, chosen, limits)
        try:
            return run.solve(chosen.backend, limits.warm_start, walks=few_goals)
        except MemoryLimitError:
            # a search and covers of paths need no matrix
            limits = replace(limits, warm_start=run.tour or limits.warm_start)
            return _by_search(graph, chosen, limits)
    if few_goals and not graph.has_cost_matrix:
        return _over_shortest(graph, chosen, limits)
    return _by_search(graph, chosen, limits)


def _over_subsets(graph: Instance, limits: Limits) -> Result:
    run = SolverRun(graph, limits)
    with run.until_stopped():
        run.update_incumbent(limits.warm_start)
        if not run.solve_if_trivial():
            exact.solve(run)
    return run.finish("proven" if run.is_done else "exact")


def _prepare_truncated(graph: Instance, chosen: Params, limits: Limits) -> tuple[Limits, bool]:
    """Bound by goals, and find a first tour, before a proof over a truncated roadmap.

    Such a proof may not come to an end. With many goals, a tour over few classes comes first.

    Returns
    -------
    limits : Limits
        Limits with the tour as warm start.
    proves : bool
        Whether a proof over the classes kept would count; not if a tour through another class may
        be shorter.
    """
    routes, clock = chosen.policy.routes, Clock.from_limit(limits.time)
    few_goals = graph.goal_count <= routes.max_walk_goals
    if few_goals or graph.parity_oracle is None:
        share = Limits(clock.part(routes.goal_bound_time_share), rng=limits.rng)
        _bound_by_goals(graph, chosen, share)
    if few_goals:
        return limits, True
    if limits.warm_start is None:
        limits = _warmed_by_few_classes(graph, chosen, limits)
    tour, elsewhere = limits.warm_start, graph.min_length_left_out
    if tour is not None and graph.parity_oracle is not None and elsewhere < graph.tour_length(tour):
        return limits, False
    if tour is None and graph.parity_oracle is not None:
        share = Limits(clock.part(routes.goal_bound_time_share), rng=limits.rng)
        _bound_by_goals(graph, chosen, share)
    return limits, True


def _by_search(graph: Instance, chosen: Params, limits: Limits) -> Result:
    """Search, bound by covers, and search on, without a proof over all classes."""
    run = _mip_run(graph, chosen, limits)
    with run.until_stopped():
        run.update_incumbent(limits.warm_start)
        run.find_first_tour()
        run.search_near_incumbent()
        clock = run.clock
        if clock.limit:
            clock = clock.part(chosen.policy.routes.cover_time_share)
        share = Limits(clock, rng=limits.rng)
        run.raise_bound(_bound_by_goals(graph, chosen, share, run.tour, run.on_cover_bound))
        run.report("goals")
        policy = chosen.policy.mip
        search_and_merge(run, partial(solve_merged, policy=policy), policy.merging)
    return run.finish("proven" if run.is_done else "open")


def _mip_run(graph: Instance, chosen: Params, limits: Limits) -> MipRun:
    policy = chosen.policy
    rounds = policy.search_effort.rounds(graph.goal_count)
    return MipRun(graph, limits, search_rounds=rounds, policy=policy.mip)


def _in_partial_order(graph: Instance, chosen: Params, limits: Limits) -> Result:
    """Solve with precedences: prove by walks, which remember them, if goals are few; else search.

    A bound on tours in any order holds as well, and takes little time.
    """
    policy, clock = chosen.policy, Clock.from_limit(limits.time)
    limits = replace(limits, time=clock)
    few_goals = graph.goal_count <= policy.routes.max_walk_goals
    bound: LowerBound | None = None
    if len(graph) <= policy.routes.max_proven_vertices:
        share = clock
        if clock.limit:
            share = Clock((1.0 - policy.routes.search_time_share) * clock.left, within=clock)
        part = replace(limits, time=share, warm_start=None, on_progress=None)
        free = _mip_run(graph.unordered(), chosen, part).solve(chosen.backend, None)
        if free.bound is not None:
            bound = free.bound.for_part(graph.scope, "tours in the order asked for are tours")
    if few_goals and walks_fit(graph, policy.gtsp.walks):
        rounds = policy.search_effort.rounds(graph.goal_count)
        found = walk(graph, WalkParams(rounds, policy.gtsp), limits)
    else:
        found = search(graph, SearchParams(policy=policy.gtsp), limits)
    if found.length is None:
        return found
    best = strongest(found.bound, bound)
    return found if best is None else with_bound(found, best)


def _bound_by_goals(
    graph: Instance,
    chosen: Params,
    limits: Limits,
    tour: Sequence[int] | None = None,
    on_bound: OnBound = lambda *_: None,
) -> float:
    """Return a bound on the tours in any class; without a tour, keep a bound that is known."""
    if tour is not None or not graph.bound_in_any_class:
        params = MipParams(policy=chosen.policy.mip)
        bound_over_goals(
            graph,
            lambda part, limits: (prove(part, params, limits), ()),
            limits,
            tour,
            on_bound=on_bound,
            policy=chosen.policy.mip,
        )
    return graph.bound_in_any_class


def _warmed_by_few_classes(graph: Instance, chosen: Params, limits: Limits) -> Limits:
    """Return the limits with the shortest tour over few classes as warm start, if there is one."""
    routes = chosen.policy.routes
    core = cheapest_per_cluster(graph.costs_to_base, graph.cluster, routes.first_tour_classes)
    if len(core) == len(graph):
        return limits
    share = Clock.from_limit(limits.time).part(routes.first_tour_time_share)
    # a bound over few classes says nothing about the others
    listener = of_part(limits.on_progress, core, lambda _: None)
    part = replace(limits, time=share, on_progress=listener)
    found = _mip_run(graph.subgraph(core), chosen, part).solve(chosen.backend, None)
    if found.tour is None:
        return limits
    return replace(limits, warm_start=[int(core[v]) for v in found.tour])


def _over_shortest(graph: Instance, chosen: Params, limits: Limits) -> Result:
    """Prove over the classes of shortest tether.

    A tour through any other class is at least twice as long as the tether of that class.
    """
    count = chosen.policy.routes.kept_vertices // graph.goal_count
    core = cheapest_per_cluster(graph.costs_to_base, graph.cluster, count)
    given = limits.warm_start
    if given is not None:
        core = np.union1d(core, np.asarray(given, dtype=np.int64))
    others = np.ones(len(graph), dtype=bool)
    others[core] = False
    place = {int(v): k for k, v in enumerate(core)}
    warm = None if given is None else [place[int(v)] for v in given]
    min_length = graph.min_length_through(np.flatnonzero(others))
    because = "a tour through another class goes along its tether and back"

    def bound_of_whole(bound: LowerBound | None) -> LowerBound | None:
        return None if bound is None else bound.or_elsewhere(min_length, graph.scope, because)

    listener = of_part(limits.on_progress, core, bound_of_whole)
    run = _mip_run(graph.subgraph(core), chosen, replace(limits, on_progress=listener))
    found = run.solve(chosen.backend, warm, walks=True)
    if found.tour is None:
        return with_classes_left_out(found, min_length, graph.scope, because)
    whole = replace(found, tour=tuple(int(core[v]) for v in found.tour))
    elsewhere = min(min_length, graph.min_length_left_out)
    clock = Clock.from_limit(limits.time)
    if elsewhere < (whole.length or 0.0) and not clock.is_up:
        # with few goals the shortest tour in any class is known soon
        _bound_by_goals(graph, chosen, Limits(clock, rng=limits.rng))
    return with_classes_left_out(whole, min_length, graph.scope, because)

"""Dynamic programming over sets of goals, after Held & Karp (1962), with classes, for few goals.

The shortest path that visits a set of goals and ends at a vertex is one leg longer than the
shortest that visits the set without that vertex's goal. So 2ⁿ V² sums over n goals and V classes
prove the tour, in milliseconds up to eight or nine goals, and nothing needs to be compiled.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.gtsp.cost_oracle import Estimate
from netsp.gtsp.instance import Instance
from netsp.gtsp.solver_run import SolverRun
from netsp.plan.solve_policy import SubsetPolicy


def fits(graph: Instance, policy: SubsetPolicy = SubsetPolicy()) -> bool:
    """Return whether a graph is small enough."""
    return len(graph) <= policy.max_vertices and _sums(graph, policy) <= policy.max_sums


def estimate(graph: Instance, policy: SubsetPolicy = SubsetPolicy()) -> Estimate:
    """Return the estimated time and memory of `solve`."""
    return Estimate(
        policy.s_per_sum * _sums(graph, policy), 8.0 * 2.0**graph.goal_count * len(graph)
    )


def _sums(graph: Instance, policy: SubsetPolicy) -> float:
    v, n = len(graph), graph.goal_count
    return float(2.0**n * (v * v + policy.sums_per_call * n))


def solve(run: SolverRun) -> None:
    """Prove the shortest tour of a run's graph in one iteration, within the run's limits."""
    graph = run.graph
    costs, n = graph.costs, graph.goal_count
    members = [graph.members(c) for c in range(1, n + 1)]
    # reach[s, v]: the shortest path from the base through the goals of the set s, ending at v
    reach: Floats = np.full((2**n, len(graph)), np.inf)
    # the set of goals that must come before each
    needed = [0] * n
    if len(graph.before):
        earlier = [np.flatnonzero(graph.before[1:, c + 1]).tolist() for c in range(n)]
        needed = [sum(1 << b for b in goals) for goals in earlier]
    for c in range(n):
        if not needed[c]:
            reach[1 << c, members[c]] = costs[0, members[c]]
    for s in range(1, 2**n):
        run.check()
        for c in range(n):
            rest = s & ~(1 << c)
            if s >> c & 1 and rest and not needed[c] & ~rest:
                inside = np.flatnonzero(np.isfinite(reach[rest]))
                lengths = reach[rest, inside, None] + costs[np.ix_(inside, members[c])]
                reach[s, members[c]] = lengths.min(axis=0, initial=np.inf)
    run.iterations += 1
    all_goals = 2**n - 1
    closed = reach[all_goals] + costs[:, 0]
    if not np.isfinite(closed).any():
        run.is_infeasible = run.tour is None
        return
    v, s, tour = int(np.argmin(closed)), all_goals, []
    length = float(closed[v])
    while s:
        tour.append(v)
        s &= ~(1 << (int(graph.cluster[v]) - 1))
        if s:
            v = int(np.argmin(reach[s] + costs[:, v]))
    run.update_incumbent([0, *reversed(tour)])
    run.raise_bound(min(length, run.length))

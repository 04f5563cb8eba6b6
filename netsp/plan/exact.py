"""Few goals: dynamic programming over sets of goals, after Held & Karp (1962), with classes.

The shortest path that visits a set of goals and ends at a vertex is one leg longer than the
shortest that visits the set without that vertex's goal. So over n goals and V classes 2ⁿ V² sums
prove the tour, in some milliseconds up to eight or nine goals, and nothing needs to be compiled for
it.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.graph import TravelGraph

MOST_SUMS = 5e7
"""About a quarter of a second."""

SUMS_PER_CALL = 1500
"""Every set is extended by every goal in a call of NumPy's, which takes as long as so many sums."""

MOST_VERTICES = 1000
"""All legs among so many are measured."""


def fits(graph: TravelGraph) -> bool:
    """Whether that takes about a quarter of a second at most."""
    v, n = len(graph), graph.goal_count
    return v <= MOST_VERTICES and 2.0**n * (v * v + SUMS_PER_CALL * n) <= MOST_SUMS


def solve(run: SolverRun) -> None:
    """Prove the shortest tour of a run's graph; the run's limits stop it. One iteration is all."""
    graph = run.graph
    costs, n = graph.costs, graph.goal_count
    members = [graph.members(c) for c in range(1, n + 1)]
    # reach[s, v]: the shortest path from the base through the goals of the set s, ending at v
    reach: Floats = np.full((2**n, len(graph)), np.inf)
    # the set of goals that come before each
    needed = [sum(1 << b for b in np.flatnonzero(graph.before[1:, c + 1]).tolist())
              if len(graph.before) else 0 for c in range(n)]  # fmt: skip
    for c in range(n):
        if not needed[c]:
            reach[1 << c, members[c]] = costs[0, members[c]]
    for s in range(1, 2**n):
        run.check()
        for c in range(n):
            rest = s & ~(1 << c)
            if s >> c & 1 and rest and not needed[c] & ~rest:
                inside = np.flatnonzero(np.isfinite(reach[rest]))
                detours = reach[rest, inside, None] + costs[np.ix_(inside, members[c])]
                reach[s, members[c]] = detours.min(axis=0, initial=np.inf)
    run.iterations += 1
    every = 2**n - 1
    home = reach[every] + costs[:, 0]
    if not np.isfinite(home).any():
        run.is_infeasible = run.tour is None
        return
    v, s, tour = int(np.argmin(home)), every, []
    length = float(home[v])
    while s:
        tour.append(v)
        s &= ~(1 << (int(graph.cluster[v]) - 1))
        if s:
            v = int(np.argmin(reach[s] + costs[:, v]))
    run.update_incumbent([0, *reversed(tour)])
    run.raise_bound(min(length, run.length))

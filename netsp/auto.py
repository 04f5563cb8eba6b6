"""`auto`: the solver by the size of the problem; always a tour, a bound and a gap.

Up to `PROVABLE` vertices it proves: the heuristic finds the tour; for up to `FEW_GOALS` goals walks
(`netsp.dp`) bound it, which at that size ends with a proof more often than not; cutting planes
(`netsp.mip`) do the rest, or all of it with more goals, on the vertices that are left. Beyond
`PROVABLE` the matrices would not fit into a few gigabytes: then `lns` searches among the classes of
least tether, and the bound comes from the goals alone, as the travelling salesperson's tour over
the shortest ways between them in any class. That bound is weak, and true.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from netsp.clock import Clock, TimeLimit
from netsp.lns import Instance
from netsp.lns.solve import solve as search
from netsp.mip.solve import MipRun
from netsp.mip.solve import solve as prove
from netsp.result import OnProgress, Progress, Result
from netsp.run import read_params
from netsp.travel import Floats, TravelGraph

PROVABLE = 7_000
"""Most vertices of a travel graph that `mip` is asked to bound: about 2 GiB of matrices."""

FEW_GOALS = 24
"""Most goals for which walks come first: with more, remembering them costs more than cuts do."""

ROUNDS_PER_GOAL = 40
"""Rounds of ruin and recreate before and after the root, times the number of goals."""

SHARE = 0.6
"""Part of the time that the search has where it shares it with the bound from the goals."""


@dataclass(frozen=True)
class Params:
    """backend : of `mip`."""

    backend: str = "highs"

    def __post_init__(self) -> None:
        from netsp.mip.solve import Params as MipParams

        MipParams(backend=self.backend)


def solve(
    graph: TravelGraph,
    *,
    time_limit: TimeLimit = None,
    iteration_limit: int | None = None,
    rng: np.random.Generator | None = None,
    params: Mapping[str, Any] | None = None,
    warm_start: Sequence[int] | None = None,
    on_progress: OnProgress | None = None,
) -> Result:
    """Solve by size. Iterations are those of the solver chosen."""
    chosen = read_params(Params, "auto", params)
    if len(graph) <= PROVABLE:
        rounds = max(500, ROUNDS_PER_GOAL * graph.goal_count)
        run = MipRun(graph, time_limit, iteration_limit, on_progress, rng=rng, search_rounds=rounds)
        return run.solve(chosen.backend, warm_start, walks=graph.goal_count <= FEW_GOALS)
    clock = Clock.of(time_limit)
    found = search(
        graph,
        time_limit=Clock(SHARE * clock.left, within=clock) if clock.limit else None,
        iteration_limit=iteration_limit,
        rng=rng,
        warm_start=warm_start,
        on_progress=on_progress,
    )
    if found.length is None:
        return found
    length = found.length
    rows: list[Progress] = list(found.trace)

    def tell(row: Progress) -> None:
        rows.append(replace(row, stage="goals", incumbent=length))
        if on_progress:
            on_progress(rows[-1])

    over_goals = TravelGraph.from_costs(_between_goals(graph), range(graph.goal_count + 1))
    bound = prove(over_goals, time_limit=clock, rng=rng, on_progress=tell).lower_bound
    return replace(
        found,
        # the ways are shortest up to rounding
        lower_bound=min(length, (bound or 0.0) * (1.0 - 1e-9)),
        trace=tuple(rows),
    )


def _between_goals(graph: TravelGraph) -> Floats:
    """(n + 1, n + 1) no more than any leg between two goals, in any class."""
    if not graph.geometric:
        return Instance.of(graph).cluster_costs
    ways = graph.ways(sub_goals=False)
    places = range(graph.goal_count + 1)
    shortest = np.array([[ways.length(a, b) for b in places] for a in places])
    return np.asarray(np.minimum(shortest, shortest.T))

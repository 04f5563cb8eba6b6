"""The reduced MIP heuristic: one class per goal, then an ordinary TSP.

McCammon & Hollinger 2017, section IV-C: every goal is taken in the class of its shortest tether;
two goals are joined by the direct leg if it shares the homotopy class of the way through the base,
else by the shortest leg that does. On the covering space both cases are one: the leg from (i, h_i)
to (j, h_j) is the shortest path of the class ``h_i^-1 h_j``, which is that of the way through the
base. So the reduced graph is the travel graph on the vertices of least tether, and the TSP on it
goes to the same machinery, with equation (2) trivially satisfied.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from netsp.mip.solve import MipRun, Params
from netsp.result import OnProgress, Progress, Result
from netsp.run import Run, read_params
from netsp.travel import Ints, TravelGraph


def solve(
    graph: TravelGraph,
    *,
    time_limit: float | None = None,
    iteration_limit: int | None = None,
    rng: np.random.Generator | None = None,
    params: Mapping[str, Any] | None = None,
    warm_start: Sequence[int] | None = None,
    on_progress: OnProgress | None = None,
) -> Result:
    """Solve the TSP over the classes of least tether; legs of other classes are never measured.

    The tour is optimal for those classes only, so no bound is claimed for the problem unless every
    goal has just one class. Iterations and params as of `netsp.mip.solve`.
    """
    chosen = read_params(Params, "reduced-mip", params)
    kept = least_tethers(graph)
    whole = len(kept) == len(graph)
    part = MipRun(graph.subgraph(kept), time_limit, iteration_limit, None)
    outer = Run(graph, time_limit, iteration_limit, on_progress)
    outer.offer(warm_start)

    def pass_on(row: Progress) -> None:
        if part.tour is not None:
            outer.offer(kept[np.array(part.tour)].tolist())
        if whole and part.bound is not None:
            outer.raise_bound(part.bound)
        outer.iterations = row.iteration
        outer.report(row.stage, cuts=row.cuts, legs=row.legs)

    part.on_progress = pass_on
    place = {int(v): k for k, v in enumerate(kept)}
    start = [place.get(int(v), -1) for v in warm_start or ()]
    result = part.solve(
        rng or np.random.default_rng(0), chosen, start if start and -1 not in start else None
    )
    if result.tour is not None:
        outer.offer(kept[np.array(result.tour)].tolist())
    if whole:
        outer.infeasible = part.infeasible
        if part.bound is not None:
            outer.raise_bound(part.bound)
    return outer.result()


def least_tethers(graph: TravelGraph) -> Ints:
    """The vertex of the shortest tether of every cluster, base first. In a graph made from costs,
    where the tether to a vertex is not known, the leg from the base stands for it."""
    tethers = graph.costs_to_base
    tethers[0] = 0.0
    order = np.lexsort((tethers, graph.cluster))
    first = np.searchsorted(graph.cluster[order], np.arange(graph.goal_count + 1))
    return np.asarray(order[first], dtype=np.int64)

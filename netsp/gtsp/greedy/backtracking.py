"""Greedy backtracking: the nearest goal by tether, then back along the path.

McCammon & Hollinger 2017, section V-A: the robot goes to the closest goal that does not violate the
tether length, again and again, and retraces its path after the last one (`greedy`).

The 2016 workshop paper has one sentence: the planner "also travels to the closest goal, but then
retraces its path back to the start position, ensuring no entanglements". It has two readings:

- *out and back*: the robot returns after every goal, so each time the goal closest to the base is
  next. This is `greedy-2016`, and its published figures are for this reading.
- *retrace once*: the robot goes from goal to goal, like the Greedy-TSP of the sentence before, and
  retraces its whole path from the last (`greedy-2016` with `retrace=end`). This is the reading of
  the 2017 paper, so the tour is that of `greedy`.

On the covering space a leg between two admissible classes never needs more tether than its ends do
(docs/theory), so "does not violate the tether length" means: is a vertex of the travel graph.
With a roadmap every vertex is joined to every other, so greedy always succeeds. On a graph made
from costs it can run into a dead end, and then finds no tour. Such a graph has no path to retrace
(its costs need not be those of a metric), so there the tour is closed by its own leg.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.gtsp.gtsp_policy import CostPolicy
from netsp.gtsp.instance import Instance
from netsp.gtsp.limits import Limits
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.result import Result


@dataclass(frozen=True)
class Params:
    """Options of the solver.

    Attributes
    ----------
    retrace
        ``path``, home along the outward path as in the paper, or ``tether``, home along the
        taut tether from the last goal, which is never longer.
    policy
        How costs are measured.
    """

    retrace: str = "path"
    policy: CostPolicy = field(default_factory=CostPolicy)

    def __post_init__(self) -> None:
        if self.retrace not in ("path", "tether"):
            raise ValueError(f"option 'retrace': expected path or tether, got {self.retrace!r}")


def solve(graph: Instance, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Go to the nearest goal not yet visited, in its nearest class, and home from the last.

    One iteration builds the whole tour. There is no bound.
    """
    chosen, limits = params or Params(), limits or Limits()
    run = SolverRun(graph, limits, policy=chosen.policy)
    stage = "trivial"
    with run.until_stopped():
        run.update_incumbent(limits.warm_start)
        if not run.solve_if_trivial():
            retrace = chosen.retrace == "path" and graph.can_retrace
            stage = _nearest_neighbour_tour(run, retrace=retrace)
    return run.finish(stage)


def _nearest_neighbour_tour(run: SolverRun, *, retrace: bool) -> str:
    """Build the greedy tour, and return the stage that the run reports at its end."""
    graph = run.graph
    tour = [0]
    left = graph.cluster != 0
    is_small = len(graph) <= run.cost_policy.max_measured_vertices
    exact = is_small or not graph.estimate(len(graph)).seconds
    all_vertices = np.arange(len(graph))
    while left.any():
        run.check()
        at = tour[-1]
        bounds = graph.costs[at] if exact else graph.lower_bounds(all_vertices, [at])[0]
        nearest = _nearest(run, at, np.flatnonzero(left), bounds, exact=exact)
        if nearest is None:
            return "dead end"
        tour.append(nearest)
        left &= graph.cluster != graph.cluster[nearest]
    run.iterations = 1
    run.update_incumbent(tour, walk=[*tour, *tour[-2::-1]] if retrace else None)
    return "greedy"


def _nearest(
    run: SolverRun, at: int, candidates: Ints, bounds: Floats, *, exact: bool
) -> int | None:
    """Return the candidate with the cheapest leg from vertex `at`; None if no leg leads on.

    Unless the bounds are exact, legs are measured in their order, until no bound is below the
    cheapest leg.
    """
    graph = run.graph
    candidates = candidates[np.argsort(bounds[candidates], kind="stable")]
    if exact:
        return int(candidates[0]) if np.isfinite(bounds[candidates[0]]) else None
    best, nearest = np.inf, None
    for batch in np.array_split(candidates, -(-len(candidates) // run.cost_policy.tried_legs)):
        if bounds[batch[0]] >= best:
            break
        star = np.zeros((len(batch) + 1, len(batch) + 1), dtype=bool)
        star[0] = star[:, 0] = True
        legs = graph.costs_among([at, *batch], star)[0, 1:]
        k = int(np.argmin(legs))
        if legs[k] < best:
            best, nearest = float(legs[k]), int(batch[k])
    return nearest


@dataclass(frozen=True)
class Params2016:
    """Options of `greedy-2016`.

    Attributes
    ----------
    retrace
        When the robot retraces its path: ``goal``, after every goal, or ``end``, after the last
        goal only. The paper's sentence can be read either way.
    policy
        How costs are measured.
    """

    retrace: str = "goal"
    policy: CostPolicy = field(default_factory=CostPolicy)

    def __post_init__(self) -> None:
        if self.retrace not in ("goal", "end"):
            raise ValueError(f"option 'retrace': expected goal or end, got {self.retrace!r}")


def solve_2016(
    graph: Instance, params: Params2016 | None = None, limits: Limits | None = None
) -> Result:
    """Go out to the goal nearest to the base and back, then to the next.

    This is the first of two readings of the paper's sentence (see `Params2016`). No leg between
    goals is measured. One iteration builds the whole tour; there is no bound. Source: McCammon &
    Hollinger 2016, section IV.
    """
    chosen, limits = params or Params2016(), limits or Limits()
    run = SolverRun(graph, limits, policy=chosen.policy)
    stage = "greedy"
    with run.until_stopped():
        run.update_incumbent(limits.warm_start)
        if not run.solve_if_trivial():
            run.check()
            if chosen.retrace == "goal":
                _out_and_back(run)
            else:
                stage = _nearest_neighbour_tour(run, retrace=graph.can_retrace)
    return run.finish(stage)


def _out_and_back(run: SolverRun) -> None:
    graph = run.graph
    out = graph.costs_to_base
    nearest = []
    for c in range(1, graph.goal_count + 1):
        members = graph.members(c)
        nearest.append(int(members[np.argmin(out[members])]))
    nearest.sort(key=lambda v: (out[v], v))
    run.iterations = 1
    if graph.can_retrace:
        walk = [0]
        for v in nearest:
            walk += [v, 0]
        run.update_incumbent([0, *nearest], walk=walk, length=2.0 * float(out[nearest].sum()))
    else:
        run.update_incumbent([0, *nearest])

"""`anneal`: simulated annealing over orders and classes.

Source: McCammon & Hollinger 2017, section IV-D. A state is an augmented trajectory: an order of the
goals, and a homotopy class for each. A proposal is one of two mutations: goal-swapping exchanges
two goals, which keep their classes, and path-inversion changes the class of one goal. Both replace
at most four legs, so the time of a proposal does not depend on the number of goals.

In the paper a mutation may raise the entanglement of the path. Here it cannot: each state is a
non-entangling tour of the covering space, and the only cost is its length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from netsp.anneal.cooling import Cooling, Schedule
from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.base.compiled.rng import below, metropolis, seeded
from netsp.gtsp.instance import Instance
from netsp.gtsp.limits import Limits
from netsp.gtsp.search.layers import LayeredInstance
from netsp.gtsp.search.lns_solver import max_classes_per_goal, search_core
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.result import Result


@dataclass(frozen=True)
class Params(Cooling):
    """Options of the solver, in addition to those of `Cooling`.

    Attributes
    ----------
    swaps
        Share of proposals that swap goals; the others change a class.
    max_vertices
        Maximum number of classes, chosen by tether length; all their legs are measured.
    proposals_per_goal
        Number of proposals for each goal if neither time nor iterations are limited.
    chunk
        Number of proposals between two checks of the clock; 100,000 take some milliseconds.
    """

    swaps: float = 0.5
    max_vertices: int = 4000
    proposals_per_goal: int = 1_000_000
    chunk: int = 100_000

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.swaps <= 1.0:
            raise ValueError(f"option 'swaps': expected a share from 0 to 1, got {self.swaps}")
        for name in ("max_vertices", "proposals_per_goal", "chunk"):
            if getattr(self, name) < 1:
                raise ValueError(f"option {name!r}: expected 1 or more, got {getattr(self, name)}")


def solve(graph: Instance, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Anneal as in the 2017 paper, from a random tour or the warm start, without a lower bound.

    An iteration is one proposal. Source: McCammon & Hollinger 2017, section IV-D.
    """
    chosen, limits = params or Params(), limits or Limits()
    rng = limits.rng
    run = SolverRun(graph, limits)
    with run.until_stopped():
        run.update_incumbent(limits.warm_start)
        if not run.solve_if_trivial():
            _anneal(run, rng, chosen)
    return run.finish("done", entangled=0)


def _anneal(run: SolverRun, rng: np.random.Generator, chosen: Params) -> None:
    warm = run.tour is not None
    run.check()
    graph = run.graph
    core = search_core(run, max_classes_per_goal(graph, chosen.max_vertices))
    instance = LayeredInstance.among(graph, core)
    goals = graph.goal_count
    state = np.zeros(goals + 1, dtype=np.int64)
    if warm:
        place = np.empty(len(graph), dtype=np.int64)
        place[instance.labels] = np.arange(len(instance.labels))
        state[:] = place[np.array(run.tour)]
    else:
        for k, c in enumerate(rng.permutation(np.arange(1, goals + 1))):
            state[k + 1] = rng.integers(instance.start[c], instance.start[c + 1])
    of_vertex = np.repeat(np.arange(goals + 1), np.diff(instance.start))
    length = float(instance.costs[state, np.roll(state, -1)].sum())
    proposals = chosen.proposals_per_goal * goals
    schedule = Schedule(chosen, run, length / (goals + 1), default=proposals)
    best = state.copy()
    best_length = length
    chance = seeded(rng)
    run.update_incumbent(instance.original(best))
    run.report("anneal", current=length, entangled=0)
    while run.iterations < run.iteration_limit:
        run.check()
        count = schedule.chunk(chosen.chunk)
        length, best_length = anneal(
            state,
            best,
            length,
            best_length,
            count,
            schedule.temperature,
            chosen.swaps,
            instance.costs,
            instance.start,
            of_vertex,
            chance,
        )
        run.iterations += count
        run.update_incumbent(instance.original(best))
        run.report("anneal", current=length, entangled=0)


@kernel
def anneal(
    tour: Ints,
    best: Ints,
    length: float,
    best_length: float,
    count: int,
    theta: float,
    swaps: float,
    costs: Floats,
    start: Ints,
    cluster: Ints,
    chance: npt.NDArray[np.uint64],
) -> tuple[float, float]:
    """Make `count` proposals at temperature `theta`, in place.

    Returns
    -------
    tuple of float
        Lengths of the current tour and of the best one, which is in `best`.
    """
    n = len(tour)
    for _ in range(count):
        if n > 2 and (below(1 << 30, chance) < swaps * (1 << 30)):
            i = 1 + below(n - 1, chance)
            j = 1 + below(n - 2, chance)
            if j >= i:
                j += 1
            if i > j:
                i, j = j, i
            u, v = tour[i], tour[j]
            before, after = tour[i - 1], tour[j + 1 if j + 1 < n else 0]
            if j == i + 1:
                rise = costs[before, v] + costs[u, after] - costs[before, u] - costs[v, after]
            else:
                p, q = tour[i + 1], tour[j - 1]
                rise = (
                    costs[before, v] + costs[v, p] + costs[q, u] + costs[u, after]
                    - costs[before, u] - costs[u, p] - costs[q, v] - costs[v, after]
                )  # fmt: skip
            if metropolis(rise, theta, chance):
                tour[i], tour[j] = v, u
                length += rise
        else:
            i = 1 + below(n - 1, chance)
            u = tour[i]
            c = cluster[u]
            size = start[c + 1] - start[c]
            if size == 1:
                continue
            v = start[c] + below(size - 1, chance)
            if v >= u:
                v += 1
            before, after = tour[i - 1], tour[i + 1 if i + 1 < n else 0]
            rise = costs[before, v] + costs[v, after] - costs[before, u] - costs[u, after]
            if metropolis(rise, theta, chance):
                tour[i] = v
                length += rise
        if length < best_length - 1e-12 * best_length:
            best_length = length
            for k in range(n):
                best[k] = tour[k]
    # computed from scratch, so that rounding errors do not accumulate
    length = 0.0
    for k in range(n):
        length += costs[tour[k], tour[k + 1 if k + 1 < n else 0]]
    return length, best_length

"""`anneal-2016`: simulated annealing over free paths, with a cost for entangled obstacles.

Source: McCammon & Hollinger 2016, section III. A configuration (the paper's state) is an order of
the goals and a path for each leg: the shortest path (the paper's A*) or one through a sub-goal.
Goal-swapping exchanges two goals and plans their legs again; path-inversion leads one leg through a
sub-goal on the far side of an obstacle. Equation (3) is the cost ``C(T) = k (E + 1) L`` with E the
number of obstacles that the trajectory entangles, by its reduced word.

Differences from the paper:

- E counts the obstacles that the path winds around, and those that keep the word from cancelling
  without them (`netsp.hsignature.entangled`), not the letters of the word.
- the tether of the paper is unlimited. Here, a goal that is reached in a class beyond the tether's
  length counts like an entangled obstacle. With a long tether the cost is that of the paper.
- the result is the best *valid* trajectory found, not the last one, and its legs are pulled taut
  within their classes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.anneal.cooling import Cooling, Schedule
from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.base.compiled.rng import below, metropolis, seeded
from netsp.gtsp.limits import Limits
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.result import Result
from netsp.roadmap.travel_graph import TravelGraph


@dataclass(frozen=True)
class Params(Cooling):
    """Options of the solver, in addition to those of `Cooling`.

    Attributes
    ----------
    k
        Factor k of equation (3), above 0. With a larger one, entanglement disappears sooner.
    swaps
        Share of proposals that swap goals; the others invert a path.
    proposals_per_goal
        Proposals for each goal if neither time nor iterations are limited.
    chunk
        Maximum number of proposals between two checks of the clock.
    max_reports
        Maximum number of progress reports under an iteration limit.
    """

    k: float = 1.0
    swaps: float = 0.5
    proposals_per_goal: int = 20_000
    chunk: int = 2_000
    max_reports: int = 1_000

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.k > 0.0:
            raise ValueError(f"option 'k': expected a positive number, got {self.k}")
        if not 0.0 <= self.swaps <= 1.0:
            raise ValueError(f"option 'swaps': expected a share from 0 to 1, got {self.swaps}")
        for name in ("proposals_per_goal", "chunk", "max_reports"):
            if getattr(self, name) < 1:
                raise ValueError(f"option {name!r}: expected 1 or more, got {getattr(self, name)}")


class Table(NamedTuple):
    """Constant tables of a run: those of `netsp.roadmap.tether_blind_legs.Detours` (planar to
    near), and those of `_admissible` words (trie, vertex)."""

    planar: Floats
    height: Floats
    letters: Ints
    row: Ints
    far: Ints
    near: Floats
    trie: Ints
    vertex: Ints


class Configuration(NamedTuple):
    """Trajectory, and workspace of the kernels.

    Attributes
    ----------
    order
        Clusters (legs + 1,) in the order of their visits.
    via
        Sub-goal (legs,) of each leg, -1 for none.
    visits, best
        Vertices (legs,) of the visits, now and in the best valid configuration.
    stack, turns
        Workspace (3, letters) and (obstacles + 1,) for words.
    """

    order: Ints
    via: Ints
    visits: Ints
    stack: Ints
    turns: Ints
    best: Ints


def solve(graph: TravelGraph, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Anneal as in the 2016 paper, from direct legs in a random order or that of the warm start.

    An iteration is one proposal. Source: McCammon & Hollinger 2016, section III.

    Returns
    -------
    Result
        Best tour found; `no_solution_found` if each configuration entangled an obstacle or reached
        a goal beyond the tether.

    Raises
    ------
    InputError
        The graph has no geometry.
    """
    chosen, limits = params or Params(), limits or Limits()
    rng = limits.rng
    run = SolverRun(graph, limits)
    with run.until_stopped(blind=True):
        run.update_incumbent(limits.warm_start)
        if not run.solve_if_trivial():
            _anneal(graph, run, rng, chosen)
    return run.finish("done")


def _anneal(graph: TravelGraph, run: SolverRun, rng: np.random.Generator, chosen: Params) -> None:
    run.check()
    detours = graph.detours(sub_goals=True, check=run.check)
    goals = graph.goal_count
    order = np.zeros(goals + 2, dtype=np.int64)
    if run.tour is not None:
        order[1:-1] = graph.cluster[list(run.tour[1:])]
    else:
        order[1:-1] = rng.permutation(np.arange(1, goals + 1))
    via = np.full(goals + 1, -1, dtype=np.int64)
    trie, vertex = _admissible(graph)
    table = Table(
        detours.planar,
        detours.height,
        detours.letters,
        detours.row,
        detours.far,
        detours.near,
        trie,
        vertex,
    )
    longest = (goals + 1) * 2 * int((detours.row[:, 1:] - detours.row[:, :-1]).max(initial=0)) + 1
    now = Configuration(
        order,
        via,
        visits=np.zeros(goals + 1, dtype=np.int64),
        stack=np.zeros((3, longest), dtype=np.int64),
        turns=np.zeros(detours.far.shape[2] + 1, dtype=np.int64),
        best=np.zeros(goals + 1, dtype=np.int64),
    )
    length, entangled, _ = evaluate(now, table)
    proposals = chosen.proposals_per_goal * goals
    schedule = Schedule(chosen, run, length / (goals + 1), default=proposals)
    chunk = int(max(1, min(chosen.chunk, run.iteration_limit / chosen.max_reports)))
    chance = seeded(rng)
    best_length = math.inf
    run.report("anneal", current=length, entangled=int(entangled))
    while run.iterations < run.iteration_limit:
        run.check()
        count = schedule.chunk(chunk)
        before = best_length
        length, entangled, best_length = anneal(
            now, best_length, count, schedule.temperature, chosen.k, chosen.swaps, table, chance
        )
        run.iterations += count
        if best_length < before:
            run.update_incumbent(now.best.tolist())
        run.report("anneal", current=length, entangled=int(entangled))


def _admissible(graph: TravelGraph) -> tuple[Ints, Ints]:
    """Return a trie of the words of all vertices.

    Returns
    -------
    trie
        Child (nodes, 2 n + 1) by letter + n, -1 for none.
    vertex
        Vertex (nodes, clusters) with that word in each cluster, -1 for none.
    """
    n = max((abs(x) for w in graph.signatures for x in w), default=0)
    children = [[-1] * (2 * n + 1)]
    vertex = [[-1] * (graph.goal_count + 1)]
    for v, word in enumerate(graph.signatures):
        node = 0
        for x in word:
            if children[node][x + n] < 0:
                children[node][x + n] = len(children)
                children.append([-1] * (2 * n + 1))
                vertex.append([-1] * (graph.goal_count + 1))
            node = children[node][x + n]
        vertex[node][graph.cluster[v]] = v
    return np.array(children, dtype=np.int64), np.array(vertex, dtype=np.int64)


@kernel
def _detour_length(a: int, b: int, via: int, planar: Floats, height: Floats) -> float:
    p = planar[a, b] if via < 0 else planar[a, via] + planar[b, via]
    return math.hypot(p, height[b] - height[a])


@kernel
def _push(letter: int, size: int, stack: Ints, trie: Ints) -> int:
    """Append a letter to the reduced word on the stack, with its trie node; return the new size."""
    if size > 0 and stack[0, size - 1] == -letter:
        return size - 1
    node = 0 if size == 0 else stack[1, size - 1]
    half = (trie.shape[1] - 1) // 2
    stack[0, size] = letter
    if node < 0 or letter > half or letter < -half:
        stack[1, size] = -1
    else:
        stack[1, size] = trie[node, letter + half]
    return size + 1


@kernel
def evaluate(now: Configuration, table: Table) -> tuple[float, int, int]:
    """Write the vertices of a configuration into `now.visits`; return its length, its number of
    entangled obstacles, and its number of goals beyond the tether."""
    order, via, visits = now.order, now.via, now.visits
    stack, turns = now.stack, now.turns
    planar, height, letters, row = table.planar, table.height, table.letters, table.row
    trie, vertex = table.trie, table.vertex
    length = 0.0
    size = 0
    missed = 0
    obstacles = len(turns) - 1
    legs = len(order) - 1
    for k in range(legs):
        a, b, s = order[k], order[k + 1], via[k]
        length += _detour_length(a, b, s, planar, height)
        if s < 0:
            for i in range(row[a, b], row[a, b + 1]):
                size = _push(letters[i], size, stack, trie)
        else:
            for i in range(row[a, s], row[a, s + 1]):
                size = _push(letters[i], size, stack, trie)
            for i in range(row[b, s + 1] - 1, row[b, s] - 1, -1):
                size = _push(-letters[i], size, stack, trie)
        if k < legs - 1:
            node = 0 if size == 0 else stack[1, size - 1]
            v = -1 if node < 0 else vertex[node, b]
            visits[k + 1] = v
            if v < 0:
                missed += 1
    # as in `netsp.hsignature.entangled`, with the third row of the stack
    for o in range(obstacles + 1):
        turns[o] = 0
    for i in range(size):
        x = stack[0, i]
        turns[abs(x)] += 1 if x > 0 else -1
    rest = 0
    for i in range(size):
        x = stack[0, i]
        if turns[abs(x)] != 0:
            continue
        if rest > 0 and stack[2, rest - 1] == -x:
            rest -= 1
        else:
            stack[2, rest] = x
            rest += 1
    low, high = 0, rest - 1
    while low < high and stack[2, low] == -stack[2, high]:
        low += 1
        high -= 1
    for i in range(low, high + 1):
        turns[abs(stack[2, i])] = 1
    entangled = 0
    for o in range(1, obstacles + 1):
        if turns[o] != 0:
            entangled += 1
    return length, entangled, missed


@kernel
def anneal(
    now: Configuration,
    best_length: float,
    count: int,
    theta: float,
    k: float,
    swaps: float,
    table: Table,
    chance: npt.NDArray[np.uint64],
) -> tuple[float, int, float]:
    """Make `count` proposals at temperature `theta`, in place.

    Returns
    -------
    tuple
        Length and number of entangled obstacles of the current configuration, and length of the
        best valid one, whose vertices are in `now.best`.
    """
    order, via, visits, best = now.order, now.via, now.visits, now.best
    planar, far, near = table.planar, table.far, table.near
    legs = len(order) - 1
    obstacles = far.shape[2]
    length, entangled, missed = evaluate(now, table)
    cost = k * (entangled + missed + 1) * length
    kept = np.empty(4, dtype=np.int64)
    for _ in range(count):
        i = j = leg = -1
        if legs > 2 and (obstacles == 0 or below(1 << 30, chance) < swaps * (1 << 30)):
            i = 1 + below(legs - 1, chance)
            j = 1 + below(legs - 2, chance)
            if j >= i:
                j += 1
            kept[0], kept[1], kept[2], kept[3] = via[i - 1], via[i], via[j - 1], via[j]
            order[i], order[j] = order[j], order[i]
            via[i - 1] = via[i] = via[j - 1] = via[j] = -1
        elif obstacles > 0:
            leg = below(legs, chance)
            a, b, s = order[leg], order[leg + 1], via[leg]
            o = below(obstacles, chance)
            if s < 0:
                new_via = far[a, b, o]
            elif near[a, s, o] <= near[b, s, o]:
                new_via = far[a, s, o]
            else:
                new_via = far[b, s, o]
            if new_via < 0 or not (planar[a, new_via] + planar[b, new_via] < np.inf):
                continue
            kept[0] = s
            via[leg] = new_via
        else:
            continue
        new_length, new_entangled, new_missed = evaluate(now, table)
        new_cost = k * (new_entangled + new_missed + 1) * new_length
        if metropolis(new_cost - cost, theta, chance):
            length, entangled, missed, cost = new_length, new_entangled, new_missed, new_cost
            if entangled == 0 and missed == 0 and length < best_length:
                best_length = length
                for m in range(len(visits)):
                    best[m] = visits[m]
        elif leg >= 0:
            via[leg] = kept[0]
        else:
            order[i], order[j] = order[j], order[i]
            via[i - 1], via[i], via[j - 1], via[j] = kept[0], kept[1], kept[2], kept[3]
    return length, entangled, best_length

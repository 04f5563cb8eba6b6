"""The entangling baseline: nearest neighbour, blind to what the tether does.

McCammon & Hollinger 2016, section IV-A: "Greedy-TSP" goes to the closest goal not yet visited, by
the shortest path whatever its class. Its tours may entangle obstacles, loop, or need more tether
than there is; then the status is `invalid` and the trajectory tells what was walked.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from netsp.gtsp.limits import Limits
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.graph import TravelGraph
from netsp.gtsp.travel.result import Result, Trajectory
from netsp.hsignature import Word, concatenate, entangled
from netsp.model.solution import Status


def solve(graph: TravelGraph, params: None = None, limits: Limits | None = None) -> Result:
    """`greedy-tsp`: to the nearest goal not yet visited, blind to the tether.

    A warm start is not used: a baseline shows what it does by itself. One iteration builds the
    whole tour. Source: McCammon & Hollinger 2016, section IV.

    Parameters
    ----------
    graph : TravelGraph
        What to solve.
    params : None
        It has no options.
    limits : Limits, optional
        Time, iterations, random generator, warm start, listener.

    Returns
    -------
    Result
        The tour, or status `invalid` with what was walked.

    Raises
    ------
    InputError
        There is no geometry beneath the graph.
    """
    limits = limits or Limits()
    run = SolverRun(graph, limits)
    walked: Trajectory | None = None
    with run.until_stopped(blind=True):
        if not run.solve_if_trivial():
            run.check()
            walked = _nearest_neighbour(run)
    if walked is None:
        return run.finish("greedy")
    held = len(entangled(walked.word))
    seen = run.finish("greedy", current=walked.length, entangled=held)
    return Result(None, walked.length, None, Status.INVALID, seen.trace, trajectory=walked)


def _nearest_neighbour(run: SolverRun) -> Trajectory | None:
    """The trajectory, or None if it is a tour of the graph: then that is the incumbent."""
    graph = run.graph
    detours = graph.detours(sub_goals=False, check=run.check)
    order, here = [], 0
    left = set(range(1, graph.goal_count + 1))
    while left:
        here = min(left, key=lambda b: (detours.length(here, b), b))
        left.remove(here)
        order.append(here)
    run.iterations = 1
    visits = [0, *order, 0]
    words: list[Word] = [()]
    for a, b in pairwise(visits):
        words.append(concatenate(words[-1], detours.word(a, b)))
    tour = graph.vertices_of(order, words[1:-1])
    if not words[-1] and tour is not None:
        # it happens to keep all promises; the walk is the same, for its legs are taut
        run.update_incumbent([0, *tour])
        return None
    legs = [detours.path(a, b) for a, b in pairwise(visits)]
    path = np.vstack([legs[0], *(leg[1:] for leg in legs[1:])])
    length = sum(detours.length(a, b) for a, b in pairwise(visits))
    return Trajectory(tuple(order), tuple(words[1:-1]), words[-1], path, length)

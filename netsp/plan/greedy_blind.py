"""Nearest-neighbour baseline that ignores the tether and may entangle it.

McCammon & Hollinger 2016, section IV-A: "Greedy-TSP" goes to the closest goal not yet visited, by
the shortest path in any class. Its tours may entangle obstacles, loop, or need more tether than
there is; then the status is `invalid` and the trajectory holds the path.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from netsp.gtsp.limits import Limits
from netsp.gtsp.solver_run import SolverRun
from netsp.gtsp.travel.result import Result
from netsp.hsignature import Word, concatenate, entangled
from netsp.model.solution import Status
from netsp.roadmap.tether_blind_legs import BlindTrajectory
from netsp.roadmap.travel_graph import TravelGraph


def solve(graph: TravelGraph, params: None = None, limits: Limits | None = None) -> Result:
    """Go to the nearest goal not yet visited by the shortest path in any class.

    A warm start is not used, because a baseline shows what it does by itself. One iteration builds
    the whole tour. Source: McCammon & Hollinger 2016, section IV.

    Returns
    -------
    Result
        The tour, or status `invalid` with the trajectory.

    Raises
    ------
    InputError
        The graph has no geometry.
    """
    limits = limits or Limits()
    run = SolverRun(graph, limits)
    trajectory: BlindTrajectory | None = None
    with run.until_stopped(blind=True):
        if not run.solve_if_trivial():
            run.check()
            trajectory = _nearest_neighbour(graph, run)
    if trajectory is None:
        return run.finish("greedy")
    length, wrapped = trajectory.length, len(entangled(trajectory.word))
    trace = run.finish("greedy", current=length, entangled=wrapped).trace
    return Result(None, length, None, Status.INVALID, trace, trajectory=trajectory)


def _nearest_neighbour(graph: TravelGraph, run: SolverRun) -> BlindTrajectory | None:
    """Return the trajectory, or None if it is a tour of the graph and so the incumbent."""
    detours = graph.detours(sub_goals=False, check=run.check)
    order, at = [], 0
    left = set(range(1, graph.goal_count + 1))
    while left:
        at = min(left, key=lambda goal: (detours.length(at, goal), goal))
        left.remove(at)
        order.append(at)
    run.iterations = 1
    visits = [0, *order, 0]
    words: list[Word] = [()]
    for a, b in pairwise(visits):
        words.append(concatenate(words[-1], detours.word(a, b)))
    tour = graph.vertices_of(order, words[1:-1])
    if not words[-1] and tour is not None:
        # a valid tour after all, and the same path, because its legs are taut
        run.update_incumbent([0, *tour])
        return None
    legs = [detours.path(a, b) for a, b in pairwise(visits)]
    path = np.vstack([legs[0], *(leg[1:] for leg in legs[1:])])
    length = sum(detours.length(a, b) for a, b in pairwise(visits))
    return BlindTrajectory(tuple(order), path, length, tuple(words[1:-1]), words[-1])

"""Conversion of a result on a travel graph into the solution of a problem."""

from __future__ import annotations

import functools
import importlib.metadata
import platform
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from netsp.base.errors import warn_left_out
from netsp.gtsp.travel.result import Result
from netsp.hsignature import Word, entangled
from netsp.model.problem import Problem
from netsp.model.solution import ProblemReference, Solution, Timings, Visit
from netsp.roadmap.tether_blind_legs import BlindTrajectory
from netsp.roadmap.travel_graph import TravelGraph


def to_solution(
    problem: Problem,
    graph: TravelGraph,
    result: Result,
    solver: str,
    seed: int | None,
    timings: Timings | None = None,
) -> Solution:
    """Return a solver's result as a solution of the problem, with the path of its tour."""
    if isinstance(result.trajectory, BlindTrajectory):
        visits, path = _blind_visits(problem, result.trajectory), result.trajectory.path
        wrapped = tuple(k - 1 for k in entangled(result.trajectory.word))
    else:
        visits, wrapped = _visits(problem, graph, result.tour or ()), ()
        walk = result.walk or (*(result.tour or ()), 0)
        legs = [graph.path(u, v) for u, v in pairwise(walk)]
        path = np.vstack([legs[0], *(leg[1:] for leg in legs[1:])]) if legs else np.zeros((0, 3))
    return Solution(
        problem=ProblemReference(name=problem.name, sha256=problem.sha256),
        solver=solver,
        roadmap=graph.roadmap,
        classes=graph.classes,
        seed=seed,
        status=result.status,
        length=result.length,
        lower_bound=result.lower_bound,
        lower_bound_of=None if result.bound is None else result.bound.scope,
        gap=result.gap,
        entangled=wrapped,
        tour=visits,
        path=tuple((float(x), float(y), float(z)) for x, y, z in path),
        start_tether=tuple((float(x), float(y), float(z)) for x, y, z in graph.start_tether),
        legs_left_out=tuple(
            (int(graph.goal[u]) - 1, int(graph.goal[v]) - 1)
            for u, v in graph.legs_left_out
            if graph.start not in (u, v)
        ),
        timings=timings or Timings(),
        versions=versions(),
    )


def _visits(problem: Problem, graph: TravelGraph, tour: Sequence[int]) -> tuple[Visit, ...]:
    return tuple(
        _visit(problem, int(graph.goal[v]) - 1, graph.signatures[v], float(graph.tethers[v]))
        for v in tour[1:]
        if v != graph.start
    )


def _visit(problem: Problem, goal: int, word: Word, tether: float) -> Visit:
    place = problem.goals[goal]
    return Visit(
        goal=goal, signature=word, tether_length=tether, name=place.name, position=place.position
    )


def _blind_visits(problem: Problem, walked: BlindTrajectory) -> tuple[Visit, ...]:
    """Return the visits of a blind baseline, with the taut tether that its path would need.

    If the taut tether is not found, the length of the path up to the visit is returned instead,
    with a warning. It is an upper bound: the tether cannot be longer than the path.
    """
    from netsp.roadmap.paths import TautPaths, UnknownPathError

    longest = float(np.hypot(*np.diff(walked.path[:, :2], axis=0).T).sum())
    paths = TautPaths(problem, longest * (1.0 + 1e-6))
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(walked.path, axis=0), axis=1)))
    visits, at = [], 0
    for goal, word in zip(walked.order, walked.words, strict=True):
        off = np.linalg.norm(walked.path[at:] - problem.points[goal], axis=1)
        # the first place of the path that is at the goal
        at += int(np.argmax(off <= off.min() + problem.tolerance))
        try:
            tether = paths.length(0, goal, word)
        except UnknownPathError:
            tether = float(along[at])
            warn_left_out(
                f"taut tether to {problem.goal_label(goal - 1)} not found; the length of the path "
                "that leads there stands in its place"
            )
        visits.append(_visit(problem, goal - 1, word, tether))
    return tuple(visits)


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that compute solutions."""
    return dict(_versions())


@functools.cache
def _versions() -> dict[str, str]:
    names = ("netsp", "numpy", "numba", "highspy", "pulp", "ompl")
    out = {"python": platform.python_version()}
    for name in names:
        try:
            out[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return out

"""Bounds on the tours of a problem in the plane, from few of its obstacles.

A problem with fewer obstacles has no longer tours, and far fewer classes, so it is soon solved. Its
shortest tour is usually entangled with some of the obstacles that were left out. Those are added,
the deepest inside the tour first, because tours that are not entangled with them have the longest
detours. Then the problem is solved again, and so on, until no obstacle blocks the shortest tour.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Set
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.base.errors import NetspError
from netsp.hsignature.rays import crossings
from netsp.hsignature.words import Word, reduce
from netsp.model.bound_scope import Scope
from netsp.model.problem import Problem
from netsp.model.solution import Status
from netsp.plan.solve_problem import solve


@dataclass(frozen=True)
class ReducedProblem:
    """Problem with few of the obstacles of another, and the length of its shortest tour.

    Attributes
    ----------
    problem
        The problem with few obstacles.
    bound
        Lower bound on its tours, and so on those of the whole problem.
    is_solved
        Whether the tour found is proven shortest.
    blocking
        Indices of the obstacles left out that block its shortest tour, the deepest inside it
        first.
    """

    problem: Problem
    bound: float
    is_solved: bool
    blocking: tuple[int, ...]


def solve_with_few_obstacles(
    problem: Problem, clock: Clock, max_added: int
) -> Iterator[ReducedProblem]:
    """Yield problems with ever more obstacles of a problem, whose bounds rise.

    Parameters
    ----------
    problem : Problem
        The whole problem.
    clock : Clock
        Clock of the run.
    max_added : int
        Maximum number of obstacles added at a time, at least 1.

    Yields
    ------
    ReducedProblem
        Problems that are solved with proof, and at last one that may not be. None follows a tour
        that no obstacle blocks.
    """
    kept: set[int] = set()
    while not clock.is_up:
        reduced = problem.model_copy(
            update={"obstacles": tuple(problem.obstacles[n] for n in sorted(kept))}
        )
        try:
            solution = solve(reduced, time_limit=clock)
        except NetspError:
            return
        bound = solution.bound
        if bound is None or bound.scope is not Scope.ALL_TOURS:
            return
        blocking = blocking_obstacles(problem, kept, np.array(solution.path))
        is_solved = solution.status is Status.OPTIMAL
        yield ReducedProblem(reduced, bound.length, is_solved, blocking)
        if not blocking or not is_solved:
            return
        kept.update(blocking[:max_added])


def blocking_obstacles(problem: Problem, kept: Set[int], path: Floats) -> tuple[int, ...]:
    """Return the indices of a problem's obstacles with which a closed path (k, 2) or (k, 3) is
    entangled, besides those in `kept`, the deepest inside it first.

    If there are none, return the obstacles that the path crosses, the longest crossing first.
    Obstacles with which only several together entangle the path are not looked for.

    Examples
    --------
    >>> posts = [{"center": (x, 1.0), "radius": 0.2} for x in (1.0, 5.0)]
    >>> problem = Problem(base=(0, 0), goals=[(2, 2)], obstacles=posts, tether_length=9.0)
    >>> blocking_obstacles(problem, set(), np.array([(0, 0), (2, 0), (2, 2), (0, 2), (0, 0)]))
    (0,)
    """
    import shapely

    word = crossings(path, problem.representative_points)
    line = shapely.LineString(path[:, :2])
    entangled = [
        n for n in range(len(problem.obstacles)) if n not in kept and _part(word, kept | {n})
    ]
    if entangled:
        centres = shapely.points(problem.representative_points[entangled])
        depths = shapely.distance(line, centres)
        return tuple(entangled[k] for k in np.argsort(-depths, kind="stable"))
    others = [n for n in range(len(problem.obstacles)) if n not in kept]
    inside = [line.intersection(problem.obstacles[n].shape(0.0)).length for n in others]
    order = np.argsort(-np.array(inside), kind="stable")
    return tuple(others[k] for k in order if inside[k] > 0.0)


def _part(word: Iterable[int], obstacles: Set[int]) -> Word:
    """Return the reduced word of the letters of some obstacles, by their indices from 0."""
    return reduce(letter for letter in word if abs(letter) - 1 in obstacles)

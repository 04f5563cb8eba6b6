"""What is told of a tour besides its length: margins, the tether along it, the shortest tether."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np

from netsp.app.tethers import Cursor
from netsp.errors import InputError
from netsp.problem import Problem
from netsp.roadmap.tethers import Tethers
from netsp.sizing.margins import margins
from netsp.solution import Solution

SAMPLES = 120
"""Places along the tour at which the tether is told, its visits besides."""


def facts(
    problem: Problem, solution: Solution, should_stop: Callable[[], bool] = lambda: False
) -> dict[str, Any] | None:
    """Margins and profile of a tour, and the shortest sufficient tether.

    Parameters
    ----------
    problem : Problem
        What was solved.
    solution : Solution
        With a tour.
    should_stop : callable
        Asked now and then; nobody waits for an answer any more.

    Returns
    -------
    dict or None
        ``sufficient`` (m, None if unknown), ``margins`` (as of `Margins`, None where the tour has
        none), ``profile`` (rows of: share of the tour, tether out, height) and ``visits`` (shares);
        None if stopped.
    """
    cursor = Cursor(problem, solution.path)
    path = np.array(solution.path)
    visited = [cursor.share_at(p) for p in _places(problem, solution)]
    rows = []
    for share in sorted({*np.linspace(0.0, 1.0, SAMPLES + 1).tolist(), *visited}):
        if should_stop():
            return None
        told = cursor.along(share)
        z = float(np.interp(share, cursor.shares, path[:, 2]))
        rows.append([round(share, 5), told["length"], round(z, 4)])
    found = None
    if problem.state is None:
        try:
            found = asdict(margins(problem, solution))
        except InputError:  # found with limits of its own; the judge says more
            found = None
    return {
        "sufficient": shortest_sufficient(problem), "margins": found, "profile": rows,
        "visits": visited,
    }  # fmt: skip


def shortest_sufficient(problem: Problem) -> float | None:
    """The shortest tether with which every goal can be visited, one of each choice.

    Parameters
    ----------
    problem : Problem
        Base, goals and obstacles count.

    Returns
    -------
    float or None
        In the problem's units; None if the tether there is does not suffice.
    """
    tethers = Tethers(problem)
    least = np.full(problem.visits + 1, np.inf)
    for goal, choice in zip(problem.goals, problem.clusters, strict=True):
        x, y, z = goal.position
        found = tethers.to(x, y, z=z)
        if found is not None:
            least[choice] = min(least[choice], found.length)
    longest = float(least[1:].max())
    return longest if np.isfinite(longest) else None


def _places(problem: Problem, solution: Solution) -> list[Any]:
    return [np.array(problem.goals[v.goal].position) for v in solution.tour]

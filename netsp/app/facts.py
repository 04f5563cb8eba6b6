"""Figures of a tour besides its length: margins, tether along it, and shortest tether."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from netsp.app.app_policy import AppPolicy
from netsp.app.dragged_tethers import Cursor
from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.model.bound_scope import LowerBound
from netsp.model.problem import Problem
from netsp.model.solution import Solution, Status, proof
from netsp.plan.sizing.base_placement import shortest_paths
from netsp.plan.sizing.tether_margins import margins


def facts(
    problem: Problem,
    solution: Solution,
    should_stop: Callable[[], bool] = lambda: False,
    policy: AppPolicy = AppPolicy(),
) -> dict[str, Any] | None:
    """Return margins and profile of a tour, and the shortest sufficient tether.

    Parameters
    ----------
    problem : Problem
        Problem that was solved.
    solution : Solution
        Solution with a tour.
    should_stop : callable
        Called at each place; true if nobody waits for the answer any more.
    policy : AppPolicy
        Number of places at which the tether is measured.

    Returns
    -------
    dict or None
        ``sufficient`` (m, None if unknown), ``margins`` (as `Margins.to_json`, None if the tour has
        none), ``profile`` (rows of: share of the tour, tether length, height) and ``visits``
        (shares); None if stopped.
    """
    cursor = Cursor(problem, solution.path)
    path = np.array(solution.path)
    visited = [cursor.share_at(p) for p in _places(problem, solution)]
    rows = []
    for share in sorted({*np.linspace(0.0, 1.0, policy.tether_samples + 1).tolist(), *visited}):
        if should_stop():
            return None
        tether_at_share = cursor.along(share)
        z = float(np.interp(share, cursor.shares, path[:, 2]))
        rows.append([round(share, 5), tether_at_share["length"], round(z, 4)])
    tour_margins = None
    if problem.state is None:
        try:
            tour_margins = json.loads(margins(problem, solution).to_json())
        except InputError:  # found with limits of its own; the judge says more
            tour_margins = None
    return {
        "sufficient": shortest_sufficient(problem),
        "margins": tour_margins,
        "profile": rows,
        "visits": visited,
    }


def bound_message(status: Status, length: float | None, bound: LowerBound | None) -> dict[str, Any]:
    """Return the fields of a tour's bound for the page: length, scope and the words shown."""
    return {
        "lower_bound": None if bound is None else bound.length,
        "lower_bound_of": None if bound is None else bound.scope.value,
        "proof": proof(status, length, bound),
    }


def shortest_sufficient(problem: Problem) -> float | None:
    """Return the shortest tether with which every goal, one of each choice, can be visited.

    Parameters
    ----------
    problem : Problem
        Base, goals and obstacles count.

    Returns
    -------
    float or None
        In the problem's units; None where no tether would do, or places are too far apart to be
        measured with one.
    """
    try:
        to = needed(problem)
    except InputError:
        return None
    tether_by_choice = [min(to[problem.clusters == c]) for c in range(1, problem.visits + 1)]
    longest = float(max(tether_by_choice))
    return longest if np.isfinite(longest) else None


def needed(problem: Problem) -> Floats:
    """Return the shortest tether to every goal, for any length of the tether.

    Parameters
    ----------
    problem : Problem
        Base, goals and obstacles count.

    Returns
    -------
    ndarray, shape (goals,)
        Lengths in the problem's units; infinite where nothing leads there.

    Raises
    ------
    InputError
        Places are too far apart to be measured with one tether.
    """
    return np.asarray(shortest_paths(problem, problem.points[:1])[0][0])


def plain(value: Any) -> Any:
    """Return a value with None for numbers that are not finite, which JSON cannot express."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _places(problem: Problem, solution: Solution) -> list[Any]:
    return [np.array(problem.goals[v.goal].position) for v in solution.tour]

"""Which goals a tether reaches among the obstacles, in some class."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from netsp.errors import InfeasibleError
from netsp.problem import Problem
from netsp.roadmap.reach import shortest_tethers, why_unreached

HAIR = 1e-6
"""Relative; what is so little too far is left to the roadmap to judge."""


def within_reach(
    problem: Problem, removable: Collection[str] | None = None
) -> tuple[Problem, list[str]]:
    """The problem without the goals that its tether cannot reach.

    Parameters
    ----------
    problem : Problem
        Any.
    removable : collection of str, optional
        Goals that may be left out; default all.

    Returns
    -------
    problem : Problem
        The same if all are in reach; goals that come after one left out do so no more.
    why : list of str
        A line for every goal left out.

    Raises
    ------
    InfeasibleError
        No goal is in reach.
    """
    needed = shortest_tethers(problem)
    far = needed > problem.tether_length * (1.0 + HAIR)
    if removable is not None:
        far &= np.array([g.name in removable for g in problem.goals])
    if not far.any():
        return problem, []
    why = [str(why_unreached(problem, needed, [int(k)])) for k in np.flatnonzero(far)]
    if far.all():
        raise InfeasibleError(f"no goal is in reach: {why[0]}")
    kept = [g for g, out in zip(problem.goals, far, strict=True) if not out]
    names = {n for g in kept for n in (g.name, g.choice)}
    goals = tuple(
        g.model_copy(update={"after": tuple(n for n in g.after if n in names)}) for g in kept
    )
    return problem.model_copy(update={"goals": goals}), why

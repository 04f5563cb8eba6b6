"""Which goals a tether reaches among the obstacles, in some class."""

from __future__ import annotations

import numpy as np

from netsp.arrays import Floats
from netsp.errors import InfeasibleError
from netsp.problem import Problem
from netsp.roadmap.outline import Outline, build_outline
from netsp.roadmap.reach import explain_unreached
from netsp.roadmap.shortest import ContactGraph

HAIR = 1e-6
"""Relative; what is so little too far is left to the roadmap to judge."""


def shortest_tethers(problem: Problem, outline: Outline | None = None) -> Floats:
    """The shortest tether that reaches each goal, in any class.

    Parameters
    ----------
    problem : Problem
        Its tether length does not matter.
    outline : Outline, optional
        Of the problem, if it is at hand.

    Returns
    -------
    ndarray, shape (n,)
        Lengths in 3D; inf where a goal cannot be reached.
    """
    planar = ContactGraph(outline or build_outline(problem)).lengths([0])[0, 1:]
    return np.asarray(np.hypot(planar, problem.points[1:, 2] - problem.points[0, 2]))


def within_reach(problem: Problem) -> tuple[Problem, list[str]]:
    """The problem without the goals that its tether cannot reach.

    Parameters
    ----------
    problem : Problem
        Any.

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
    outline = build_outline(problem)
    far = shortest_tethers(problem, outline) > problem.tether_length * (1.0 + HAIR)
    if not far.any():
        return problem, []
    why = [explain_unreached(problem, outline, [int(k) + 1]) for k in np.flatnonzero(far)]
    if far.all():
        raise InfeasibleError(f"no goal is in reach: {why[0]}")
    kept = [g for g, out in zip(problem.goals, far, strict=True) if not out]
    names = {n for g in kept for n in (g.name, g.choice)}
    goals = tuple(
        g.model_copy(update={"after": tuple(n for n in g.after if n in names)}) for g in kept
    )
    return problem.model_copy(update={"goals": goals}), why

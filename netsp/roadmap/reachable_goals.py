"""Goals that a tether reaches among the obstacles, in any class."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from netsp.base.errors import InfeasibleError, counted
from netsp.model.problem import Goal, Problem
from netsp.roadmap.explain_unreachable import shortest_tethers, unreached_error
from netsp.roadmap.roadmap_policy import RoadmapPolicy

UNREACHED = "out of the tether's reach among the obstacles"
"""Reason for leaving a goal out, in the record of an import."""

REACH_TOLERANCE = 1e-6
"""Tolerance of the tether length that a goal needs, as a share of it; within it, the roadmap
decides whether the goal is in reach."""


def keep_reachable_goals(
    problem: Problem, removable: Collection[str] | None = None, policy: RoadmapPolicy | None = None
) -> tuple[Problem, list[str]]:
    """Return the problem without the goals out of reach of its tether, and a line for each of them.

    Precedences of goals that are left out are removed. The same problem is returned if all goals
    are in reach.

    Parameters
    ----------
    removable : collection of str, optional
        Names of the goals that may be left out; by default all.

    Raises
    ------
    InfeasibleError
        No goal is in reach.
    """
    policy = policy or RoadmapPolicy()
    needed = shortest_tethers(problem, policy=policy)
    far = needed > problem.tether_length * (1.0 + REACH_TOLERANCE)
    if removable is not None:
        far &= np.array([g.name in removable for g in problem.goals])
    if not far.any():
        return problem, []
    why = []
    enclosed = 0
    for k in np.flatnonzero(far).tolist():
        enclosed += bool(np.isinf(needed[k]))
        if np.isinf(needed[k]) and enclosed > policy.reach.max_explained:
            why.append(f"{problem.goal_label(k)} cannot be reached with a tether of any length")
        else:
            why.append(str(unreached_error(problem, needed, [k])))
    if far.all():
        raise InfeasibleError(f"no goal is in reach: {why[0]}")
    kept = [g for g, out in zip(problem.goals, far, strict=True) if not out]
    names = {n for g in kept for n in (g.name, g.choice)}
    goals = tuple(
        g.model_copy(update={"after": tuple(n for n in g.after if n in names)}) for g in kept
    )
    return problem.model_copy(update={"goals": goals}), why


def unreached_note(before: Sequence[Goal], after: Sequence[Goal], max_names: int = 5) -> str:
    """Return one line on the goals of `before` that are not in `after`: their number and some
    names."""
    kept = {goal.name for goal in after}
    names = [str(goal.name) for goal in before if goal.name not in kept]
    shown = ", ".join(names[:max_names]) + (", …" if len(names) > max_names else "")
    return (
        f"{counted(len(names), 'viewpoint')} left out: the tether cannot reach there among the "
        f"obstacles ({shown})"
    )

"""Depths of a problem's goals: one depth for all, and warnings about heights."""

from __future__ import annotations

from netsp.base.errors import counted
from netsp.base.field_types import checked_argument
from netsp.model.problem import Problem

HEIGHTS_REMEDY = "give depths as positive numbers, or z as negative ones"
"""Remedy for goals of a map that are above the water."""


def with_depth(problem: Problem, depth: float) -> Problem:
    """Return the problem with all goals at one depth.

    Parameters
    ----------
    depth : float
        Distance below z = 0, in the problem's units; 0 or more.

    Raises
    ------
    InputError
        The depth is negative.
    """
    z = 0.0 - checked_argument("depth", depth, 0.0)
    goals = tuple(
        g.model_copy(update={"position": (g.position[0], g.position[1], z)}) for g in problem.goals
    )
    return problem.model_copy(update={"goals": goals})


def surface_warning(
    problem: Problem, remedy: str = "give one depth for all with --depth D"
) -> str | None:
    """Return a warning if all goals are at depth 0, as in files without heights; None otherwise.

    Parameters
    ----------
    remedy : str
        Advice for goals that are deeper.
    """
    if not problem.goals or any(g.position[2] != 0.0 for g in problem.goals):
        return None
    return f"all goals are at depth 0; if they are deeper, {remedy}"


def height_warning(problem: Problem, remedy: str, max_named: int = 3) -> str | None:
    """Return a warning if goals are above the water, else None.

    Parameters
    ----------
    remedy : str
        Advice, or what is done about it.
    max_named : int
        Maximum number of goals that the warning names.
    """
    above = [problem.goal_name(k) for k, g in enumerate(problem.goals) if g.position[2] > 0.0]
    if not above:
        return None
    named = f"{', '.join(above[:max_named])}{', …' if len(above) > max_named else ''}"
    return f"{counted(len(above), 'goal')} above the water ({named}): {remedy}"

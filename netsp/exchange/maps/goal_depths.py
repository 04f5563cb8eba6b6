"""One depth for all goals of a problem."""

from __future__ import annotations

from netsp.base.errors import counted
from netsp.base.field_types import checked_argument
from netsp.model.problem import Problem

HEIGHTS_REMEDY = "give depths as positive numbers, or z as negative ones"
"""What to do about goals of a map that are above the water."""


def with_depth(problem: Problem, depth: float) -> Problem:
    """Return the problem with all goals at one depth.

    Parameters
    ----------
    problem : Problem
        Problem whose goals keep their x and y.
    depth : float
        Distance below z = 0, in the problem's units; 0 or more.

    Raises
    ------
    InputError
        A negative depth.
    """
    z = 0.0 - checked_argument("depth", depth, 0.0)
    goals = tuple(
        g.model_copy(update={"position": (g.position[0], g.position[1], z)}) for g in problem.goals
    )
    return problem.model_copy(update={"goals": goals})


def surface_warning(
    problem: Problem, remedy: str = "give one depth for all with --depth D"
) -> str | None:
    """Return a warning where all goals are at depth 0, as tables and maps without heights have
    them; None otherwise.

    Parameters
    ----------
    problem : Problem
        Problem that was imported or is to be exported.
    remedy : str
        What to do if the goals are deeper.
    """
    if not problem.goals or any(g.position[2] != 0.0 for g in problem.goals):
        return None
    return f"all goals are at depth 0; if they are deeper, {remedy}"


def height_warning(problem: Problem, remedy: str, max_named: int = 3) -> str | None:
    """Return a warning where goals are above the water; None otherwise.

    Parameters
    ----------
    problem : Problem
        Problem that was imported or is to be exported.
    remedy : str
        What to do, or what is done.
    max_named : int
        Maximum number of goals that the warning names.
    """
    above = [problem.goal_name(k) for k, g in enumerate(problem.goals) if g.position[2] > 0.0]
    if not above:
        return None
    named = f"{', '.join(above[:max_named])}{', …' if len(above) > max_named else ''}"
    return f"{counted(len(above), 'goal')} above the water ({named}): {remedy}"

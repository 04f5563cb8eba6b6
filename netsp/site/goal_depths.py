"""One depth for all goals of a problem."""

from __future__ import annotations

from netsp.fields import checked_argument
from netsp.problem import Problem


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


def surface_warning(problem: Problem) -> str | None:
    """Return a warning where all goals are at depth 0, as tables and maps without heights have
    them; None otherwise.

    Parameters
    ----------
    problem : Problem
        Problem that was imported or is to be exported.
    """
    if not problem.goals or any(g.position[2] != 0.0 for g in problem.goals):
        return None
    return "all goals are at depth 0; if they are deeper, give one depth for all with --depth D"

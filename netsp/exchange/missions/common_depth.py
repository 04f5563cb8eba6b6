"""Tour with all goals at one depth, for export."""

from __future__ import annotations

import math

from netsp.base.errors import InputError
from netsp.exchange.maps.goal_depths import with_depth
from netsp.model.problem import Problem
from netsp.model.solution import Solution


def at_depth(problem: Problem, solution: Solution, depth: float) -> tuple[Problem, Solution]:
    """Return a problem and its tour with all goals at one depth.

    The robot dives on the leg to the first goal, keeps the depth between goals, and rises on the
    leg home. Obstacles stand through all depths, so the tether's class and its taut length in the
    plane do not change at any goal.

    Parameters
    ----------
    depth : float
        Distance below z = 0, in the problem's units.

    Raises
    ------
    InputError
        The tether is too short for the depth at a goal.
    """
    deep = with_depth(problem, depth)
    z, base_z = 0.0 - depth, problem.base[2]
    tour = []
    for visit in solution.tour:
        x, y, old = problem.goals[visit.goal].position
        flat = math.sqrt(max(0.0, visit.tether_length**2 - (old - base_z) ** 2))
        needed = math.hypot(flat, z - base_z)
        if needed > problem.tether_length:
            raise InputError(
                f"--depth: {problem.goal_label(visit.goal)} at a depth of {depth:g} needs "
                f"{needed:.4g} {problem.units} of tether in this tour; expected at most "
                f"{problem.tether_length:g}"
            )
        tour.append(visit.model_copy(update={"tether_length": needed, "position": (x, y, z)}))
    path = list(solution.path)
    path[1:-1] = [(point[0], point[1], z) for point in path[1:-1]]
    return deep, solution.model_copy(update={"tour": tuple(tour), "path": tuple(path)})

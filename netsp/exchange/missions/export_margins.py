"""Warnings about plans that are too tight for a real vehicle."""

from __future__ import annotations

from netsp.exchange.missions.waypoints import Waypoint, clearance_of
from netsp.model.problem import Problem
from netsp.model.solution import Solution


def warnings(
    problem: Problem, solution: Solution, points: list[Waypoint], slack: float, clearance: float
) -> list[str]:
    """Return warnings about goals with little tether left and lines close to obstacles.

    Parameters
    ----------
    slack : float
        Tether left at a goal below which a warning is due, in the problem's units.
    clearance : float
        Distance from obstacles below which a warning is due, in the problem's units.
    """
    lines = []
    longest = max(solution.tour, key=lambda v: v.tether_length, default=None)
    if longest is not None and problem.tether_length - longest.tether_length < slack:
        left = problem.tether_length - longest.tether_length
        lines.append(
            f"only {left:.2f} {problem.units} of tether is left at "
            f"{problem.goal_label(longest.goal)}, less than the margin of {slack:g}: plan with a "
            "shorter tether_length, or set another margin"
        )
    nearest = clearance_of(problem, points)
    if nearest < clearance:
        lines.append(
            f"the lines between waypoints come within {nearest:.2f} {problem.units} of an "
            f"obstacle; less than the margin of {clearance:g}: plan with a larger clearance, or "
            "set another margin"
        )
    return lines

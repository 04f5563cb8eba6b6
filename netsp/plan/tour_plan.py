"""Tour as it is carried out: a leg for every goal that is left, and the leg home."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import ComparesArrays, Floats
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.hsignature import Word, signature
from netsp.model.problem import Problem
from netsp.model.solution import Solution

HOME = -1
"""Sentinel for the base in place of a goal: the goal of the last leg."""


@dataclass(frozen=True, eq=False)
class Leg(ComparesArrays):
    """Path to one goal.

    Attributes
    ----------
    goal
        Number of the goal in the problem, HOME for the base.
    path
        (k, 3) points; the first one is the end of the previous leg.
    word, tether
        Word and length of the tether at the goal.
    """

    goal: int
    path: Floats
    word: Word
    tether: float

    @property
    def length(self) -> float:
        """Length of the path."""
        return polylines.length(self.path)


def legs_of(problem: Problem, solution: Solution, numbers: list[int] | None = None) -> list[Leg]:
    """Return a solution's path, cut at its goals.

    Parameters
    ----------
    numbers
        Numbers of the problem's goals in a larger problem.

    Raises
    ------
    InputError
        The path does not pass the goals in order.
    """
    path = np.array(solution.path)
    rays = problem.representative_points
    before = np.array(solution.start_tether).reshape(-1, 3)
    tolerance = 1e-6 * problem.scale
    legs, at = [], 0
    for visit in solution.tour:
        target = np.array(problem.goals[visit.goal].position)
        near = at + np.flatnonzero(np.linalg.norm(path[at:] - target, axis=1) <= tolerance)
        # of several points of the path at the goal, take the one with the stated word
        words = (signature(np.vstack([before, path[: k + 1]])[:, :2], rays) for k in near)
        k = next((k for k, w in zip(near, words, strict=True) if w == visit.signature), None)
        if k is None:
            raise InputError(f"solution: its path does not visit {problem.goal_label(visit.goal)}")
        goal = visit.goal if numbers is None else numbers[visit.goal]
        legs.append(Leg(goal, path[at : k + 1], visit.signature, visit.tether_length))
        at = int(k)
    legs.append(Leg(HOME, path[at:], (), 0.0))
    return legs

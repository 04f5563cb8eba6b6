"""Obstacles that stood there for a time only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from netsp.model.problem import Obstacle, Problem

Maps = Sequence[tuple[float, Problem]]
"""A problem as it was from some seconds on; the first from 0."""


@dataclass(frozen=True)
class Passing:
    """One of them.

    Parameters
    ----------
    obstacle : Circle or Polygon
        What stood there.
    name : str
        Of it.
    begin : float
        Seconds; 0 for what was there at first.
    end : float or None
        Seconds; None for what is there at the end.
    """

    obstacle: Obstacle
    name: str
    begin: float
    end: float | None

    @property
    def when(self) -> str:
        """From when until when, in words."""
        if self.end is None:
            return f"from {self.begin:.0f} s"
        return f"{self.begin:.0f} to {self.end:.0f} s" if self.begin else f"until {self.end:.0f} s"


def lasting(maps: Maps) -> Problem:
    """The first problem, with those of its obstacles that stand there all the time.

    Parameters
    ----------
    maps : sequence of (float, Problem)
        One at least.

    Returns
    -------
    Problem
        That one.
    """
    first = maps[0][1]
    every = [p.obstacles for _, p in maps]
    kept = tuple(o for o in first.obstacles if all(o in obstacles for obstacles in every))
    return first.model_copy(update={"obstacles": kept})


def passing(maps: Maps) -> list[Passing]:
    """The others, of any of the problems.

    Parameters
    ----------
    maps : sequence of (float, Problem)
        One at least.

    Returns
    -------
    list of Passing
        By when they came.
    """
    found: list[Passing] = []
    always = lasting(maps).obstacles
    for k, (time, problem) in enumerate(maps):
        for i, obstacle in enumerate(problem.obstacles):
            if obstacle in always or (k and obstacle in maps[k - 1][1].obstacles):
                continue
            gone = (t for t, later in maps[k:] if obstacle not in later.obstacles)
            found.append(Passing(obstacle, problem.obstacle_name(i), time, next(gone, None)))
    return found

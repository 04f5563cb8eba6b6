"""Obstacles that stood in a problem for a time only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from netsp.model.problem import Obstacle, Problem

Maps = Sequence[tuple[float, Problem]]
"""Problem from each of some times (s) on; the first from 0."""


@dataclass(frozen=True)
class TemporaryObstacle:
    """Obstacle that stood for a time only.

    Parameters
    ----------
    obstacle : Circle or Polygon
        The obstacle.
    name : str
        Its name.
    begin : float
        Seconds; 0 for one that was there at first.
    end : float or None
        Seconds; None for one that is there at the end.
    """

    obstacle: Obstacle
    name: str
    begin: float
    end: float | None

    @property
    def when(self) -> str:
        """Begin and end in words."""
        if self.end is None:
            return f"from {self.begin:.0f} s"
        return f"{self.begin:.0f} to {self.end:.0f} s" if self.begin else f"until {self.end:.0f} s"


def lasting_problem(maps: Maps) -> Problem:
    """Return the first problem with only those obstacles that stand there all the time."""
    first = maps[0][1]
    obstacles_of_maps = [p.obstacles for _, p in maps]
    lasting = tuple(
        o for o in first.obstacles if all(o in obstacles for obstacles in obstacles_of_maps)
    )
    return first.model_copy(update={"obstacles": lasting})


def temporary_obstacles(maps: Maps) -> list[TemporaryObstacle]:
    """Return the other obstacles of all problems, in the order in which they came."""
    found: list[TemporaryObstacle] = []
    lasting = lasting_problem(maps).obstacles
    for k, (time, problem) in enumerate(maps):
        for i, obstacle in enumerate(problem.obstacles):
            if obstacle in lasting or (k and obstacle in maps[k - 1][1].obstacles):
                continue
            end_times = (t for t, later in maps[k:] if obstacle not in later.obstacles)
            found.append(
                TemporaryObstacle(obstacle, problem.obstacle_name(i), time, next(end_times, None))
            )
    return found

"""Visits of a path to goals, in order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats


@dataclass(frozen=True)
class Passing:
    """Passing of a path within the radius of a goal.

    Parameters
    ----------
    goal : int
        Index of the goal.
    place : float
        Place at which the path is nearest to the goal, in segments from the beginning.
    miss : float
        Distance from the goal at that place, in the units of the path.
    """

    goal: int
    place: float
    miss: float


def passings(path: Floats, goals: Floats, radius: float, leave: float) -> list[Passing]:
    """Return the passings of a path within a radius of goals.

    Parameters
    ----------
    path : ndarray, shape (n, d)
        The path.
    goals : ndarray, shape (m, d)
        The goals.
    radius : float
        Distance at which a goal counts as visited.
    leave : float
        Distance by which the path must leave a goal before another passing counts.

    Returns
    -------
    list of Passing
        Passings in their order along the path.

    Examples
    --------
    >>> import numpy as np
    >>> out = passings(np.array([[0.0, 0], [4, 0], [0, 0]]), np.array([[1.0, 0]]), 0.1, 0.2)
    >>> [p.place for p in out]
    [0.25, 1.75]
    """
    found = []
    begin, step = path[:-1], np.diff(path, axis=0)
    size = np.maximum((step * step).sum(axis=1), 1e-300)
    for goal, position in enumerate(goals):
        share = np.clip(((position - begin) * step).sum(axis=1) / size, 0.0, 1.0)
        away = np.linalg.norm(begin + share[:, None] * step - position, axis=1)
        corner = np.linalg.norm(path - position, axis=1)
        group: list[int] = []
        for k in np.flatnonzero(away <= radius).tolist():
            if group and corner[group[-1] + 1 : k + 1].max() > leave:
                found.append(_nearest(goal, group, share, away))
                group = []
            group.append(k)
        if group:
            found.append(_nearest(goal, group, share, away))
    return sorted(found, key=lambda p: (p.place, p.goal))


def _nearest(goal: int, group: list[int], share: Floats, away: Floats) -> Passing:
    k = group[int(np.argmin(away[group]))]
    return Passing(goal, k + float(share[k]), float(away[k]))

"""What the operator knows: on which side of an obstacle the tether passes."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.hsignature import Word
from netsp.model.problem import Problem
from netsp.online.execute.events import index_of
from netsp.roadmap.tether_classes import Tethers
from netsp.world.side_names import AXES

SIDES = {"north": 0, "east": 2, "south": 4, "west": 6}
"""Where in `WINDS`; `AXES` has the same order."""


def direction_of(problem: Problem, side: str) -> Floats:
    """Where a side of an obstacle is.

    Parameters
    ----------
    problem : Problem
        The site.
    side : str
        One of `SIDES`, or `AXES` where north is not known.

    Returns
    -------
    ndarray, shape (2,)
        A unit vector in the plan.

    Raises
    ------
    InputError
        No such side.
    """
    names = {**SIDES, **{AXES[k]: k for k in range(0, 8, 2)}}
    if not isinstance(side, str) or side not in names:
        raise InputError(f"side: expected north, east, south or west, got {side!r}")
    heading = problem.origin.heading if problem.origin else 0.0
    angle = np.radians(45.0 * names[side] - heading)
    return np.array([np.sin(angle), np.cos(angle)])


def crosses(path: Floats, begin: Floats, way: Floats) -> bool:
    """Whether a path goes over a ray from one of its sides to the other; what begins or ends on it
    does not.

    Parameters
    ----------
    path : ndarray, shape (n, 2)
        Metres.
    begin : ndarray, shape (2,)
        Of the ray, metres.
    way : ndarray, shape (2,)
        Its direction, a unit vector.

    Returns
    -------
    bool
        Whether it does.
    """
    off = path - begin
    along, side = off @ way, off[:, 1] * way[0] - off[:, 0] * way[1]
    clear = np.flatnonzero(np.abs(side) > 1e-9 * (1.0 + np.abs(off).max()))
    # between the places that are clear of the ray's line
    for i, j in pairwise(clear):
        if side[i] * side[j] < 0.0:
            k = j - 1  # on the line, or before it
            share = side[k] / (side[k] - side[j])
            if along[k] + share * (along[j] - along[k]) > 0.0:
                return True
    return False


def agrees(problem: Problem, path: Floats, side: str, obstacle: int | str) -> bool:
    """Whether a tether passes an obstacle on one side, and not on the opposite one.

    Parameters
    ----------
    problem : Problem
        The site.
    path : ndarray, shape (n, 2) or (n, 3)
        The tether, metres.
    side : str
        Side of the obstacle.
    obstacle : int or str
        Its index or name.

    Returns
    -------
    bool
        Whether it does.

    Raises
    ------
    InputError
        No such obstacle or side.
    """
    index = index_of(obstacle, list(problem.obstacles), "obstacle")
    way, middle = direction_of(problem, side), problem.representative_points[index]
    return crosses(path[:, :2], middle, way) and not crosses(path[:, :2], middle, -way)


def corrected(
    problem: Problem, believed: Iterable[Word], robot: Floats, side: str, obstacle: int | str
) -> dict[Word, Floats]:
    """The classes that agree with what the operator says.

    Parameters
    ----------
    problem : Problem
        The site.
    believed : iterable of Word
        Classes that were believed; at least one.
    robot : ndarray, shape (3,)
        Where the robot is, metres.
    side : str
        Side of the obstacle on which the tether passes.
    obstacle : int or str
        Its index or name.

    Returns
    -------
    dict of Word to ndarray, shape (n, 3)
        Of all classes that the tether reaches the robot in and that agree, those that differ least
        from one that was believed, and the taut tethers.

    Raises
    ------
    InputError
        No such obstacle or side; no class agrees.
    """
    index = index_of(obstacle, list(problem.obstacles), "obstacle")
    ways = Tethers(problem).classes(*robot)
    agree = {t.word: t.path for t in ways if agrees(problem, t.path, side, index)}
    if not agree:
        raise InputError(
            f"side: no tether within {problem.tether_length:g} {problem.units} reaches the robot "
            f"{side} of {problem.obstacle_name(index)}"
        )
    return {word: agree[word] for word in least_changed(agree, believed)}


def least_changed(others: Iterable[Word], believed: Iterable[Word]) -> set[Word]:
    """Of some classes those that differ least from one that was believed.

    Parameters
    ----------
    others : iterable of Word
        At least one.
    believed : iterable of Word
        At least one.

    Returns
    -------
    set of Word
        One or more.
    """
    known = list(believed)
    apart = {w: min(_apart(w, one) for one in known) for w in others}
    least = min(apart.values())
    return {w for w, far in apart.items() if far == least}


def _apart(a: Word, b: Word) -> int:
    """Letters that must be put in or left out to make one word of the other."""
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        before, row[0] = row[0], i
        for j, y in enumerate(b, 1):
            before, row[j] = row[j], min(row[j] + 1, row[j - 1] + 1, before + 2 * (x != y))
    return row[-1]

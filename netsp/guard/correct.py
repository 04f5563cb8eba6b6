"""What the operator knows: on which side of an obstacle the tether passes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import shapely

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.execute.events import index_of
from netsp.hsignature import Word
from netsp.problem import Problem
from netsp.report.wording import AXES
from netsp.roadmap.tethers import Tethers

SIDES = {"north": 0, "east": 2, "south": 4, "west": 6}
"""Where in `WINDS`; `AXES` has the same order."""


def rays_of(
    problem: Problem, obstacle: int, side: str
) -> tuple[shapely.LineString, shapely.LineString]:
    """From an obstacle's middle to one of its sides and to the opposite one, as far as a tether
    goes.

    Parameters
    ----------
    problem : Problem
        The site.
    obstacle : int
        Its index.
    side : str
        One of `SIDES`, or `AXES` where north is not known.

    Returns
    -------
    pair of shapely.LineString
        In the plan, metres.

    Raises
    ------
    InputError
        No such side.
    """
    names = {**SIDES, **{AXES[k]: k for k in range(0, 8, 2)}}
    if side not in names:
        raise InputError(f"side: expected north, east, south or west, got {side!r}")
    heading = problem.origin.heading if problem.origin else 0.0
    angle = np.radians(45.0 * names[side] - heading)
    middle = np.asarray(problem.representative_points[obstacle], dtype=float)
    far = 2.0 * (problem.tether_length + problem.scale)
    way = far * np.array([np.sin(angle), np.cos(angle)])
    return shapely.LineString([middle, middle + way]), shapely.LineString([middle, middle - way])


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
    on, off = rays_of(problem, index, side)
    line = shapely.LineString(path[:, :2])
    return bool(line.intersects(on)) and not line.intersects(off)


def corrected(
    problem: Problem, believed: Iterable[Word], robot: Floats, side: str, obstacle: int | str
) -> set[Word]:
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
    set of Word
        Of all classes that the tether reaches the robot in and that agree, those that differ least
        from one that was believed.

    Raises
    ------
    InputError
        No such obstacle or side; no class agrees.
    """
    index = index_of(obstacle, list(problem.obstacles), "obstacle")
    ways = Tethers(problem).classes(*robot)
    agree = {t.word for t in ways if agrees(problem, t.path, side, index)}
    if not agree:
        raise InputError(
            f"side: no tether within {problem.tether_length:g} {problem.units} reaches the robot "
            f"{side} of {problem.obstacle_name(index)}"
        )
    return least_changed(agree, believed)


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
    """Letters that must be put in, left out or changed to make one word of the other."""
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        before, row[0] = row[0], i
        for j, y in enumerate(b, 1):
            before, row[j] = row[j], min(row[j] + 1, row[j - 1] + 1, before + (x != y))
    return row[-1]

"""Correction of the class by the side of an obstacle on which the tether passes."""

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
"""Index of each side in `WINDS` and in `AXES`."""


def side_direction(problem: Problem, side: str) -> Floats:
    """Return the direction of a side of an obstacle, a unit vector in the plan.

    Raises
    ------
    InputError
        The side is none of `SIDES`, nor of `AXES`, which are for sites whose north is unknown.
    """
    names = {**SIDES, **{AXES[k]: k for k in range(0, 8, 2)}}
    if not isinstance(side, str) or side not in names:
        raise InputError(f"side: expected north, east, south or west, got {side!r}")
    heading = problem.origin.heading if problem.origin else 0.0
    angle = np.radians(45.0 * names[side] - heading)
    return np.array([np.sin(angle), np.cos(angle)])


def crosses_ray(path: Floats, begin: Floats, direction: Floats) -> bool:
    """Return whether a path, shape (n, 2), crosses a ray from one of its sides to the other.

    A path that begins or ends on the ray does not cross it there. The ray's direction is a unit
    vector.
    """
    off = path - begin
    along, side = off @ direction, off[:, 1] * direction[0] - off[:, 0] * direction[1]
    clear = np.flatnonzero(np.abs(side) > 1e-9 * (1.0 + np.abs(off).max()))
    # between places that are clear of the ray's line
    for i, j in pairwise(clear):
        if side[i] * side[j] < 0.0:
            k = j - 1  # on the line, or before it
            share = side[k] / (side[k] - side[j])
            if along[k] + share * (along[j] - along[k]) > 0.0:
                return True
    return False


def passes_on_side(problem: Problem, path: Floats, side: str, obstacle: int | str) -> bool:
    """Return whether a tether passes an obstacle on one side, and not on the opposite one.

    Raises
    ------
    InputError
        There is no such obstacle or side.
    """
    index = index_of(obstacle, list(problem.obstacles), "obstacle")
    ray, middle = side_direction(problem, side), problem.representative_points[index]
    return crosses_ray(path[:, :2], middle, ray) and not crosses_ray(path[:, :2], middle, -ray)


def classes_on_side(
    problem: Problem, believed: Iterable[Word], robot: Floats, side: str, obstacle: int | str
) -> dict[Word, Floats]:
    """Return the taut tethers to the robot that pass an obstacle on a side, by their class.

    Of these, only the classes that differ least from a believed one are returned.

    Parameters
    ----------
    problem : Problem
        The site.
    believed : iterable of Word
        Classes that were believed; at least one.
    robot : ndarray, shape (3,)
        Place of the robot, m.
    side : str
        Side of the obstacle on which the tether passes.
    obstacle : int or str
        Index or name of the obstacle.

    Raises
    ------
    InputError
        There is no such obstacle, side or class.
    """
    index = index_of(obstacle, list(problem.obstacles), "obstacle")
    tethers = Tethers(problem).classes(*robot)
    agree = {t.word: t.path for t in tethers if passes_on_side(problem, t.path, side, index)}
    if not agree:
        raise InputError(
            f"side: no tether within {problem.tether_length:g} {problem.units} reaches the robot "
            f"{side} of {problem.obstacle_name(index)}"
        )
    return {word: agree[word] for word in least_changed(agree, believed)}


def least_changed(others: Iterable[Word], believed: Iterable[Word]) -> set[Word]:
    """Return the words, of `others`, that differ least from a believed one."""
    known = list(believed)
    distances = {w: min(_edit_distance(w, other) for other in known) for w in others}
    smallest = min(distances.values())
    return {w for w, distance in distances.items() if distance == smallest}


def _edit_distance(a: Word, b: Word) -> int:
    """Return how many letters must be inserted or deleted to make one word of the other."""
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        before, row[0] = row[0], i
        for j, y in enumerate(b, 1):
            before, row[j] = row[j], min(row[j] + 1, row[j - 1] + 1, before + 2 * (x != y))
    return row[-1]

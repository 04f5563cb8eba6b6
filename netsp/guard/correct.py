"""What the operator knows: on which side of an obstacle the tether passes."""

from __future__ import annotations

import numpy as np
import shapely

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.execute.events import index_of
from netsp.hsignature import Word
from netsp.problem import Problem
from netsp.report.wording import AXES, WINDS
from netsp.roadmap.tethers import Tethers

SIDES = {"north": 0, "east": 2, "south": 4, "west": 6}
"""Where in `WINDS`; `AXES` has the same order."""


def ray_to(problem: Problem, obstacle: int, side: str) -> shapely.LineString:
    """From an obstacle's middle to one of its sides, as far as a tether goes.

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
    shapely.LineString
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
    end = middle + far * np.array([np.sin(angle), np.cos(angle)])
    return shapely.LineString([middle, end])


def corrected(
    problem: Problem, words: dict[Word, float], robot: Floats, side: str, obstacle: int | str
) -> dict[Word, float]:
    """The classes that agree with what the operator says.

    Parameters
    ----------
    problem : Problem
        The site.
    words : dict of Word to float
        Classes that are believed, and their costs.
    robot : ndarray, shape (3,)
        Where the robot is, metres.
    side : str
        Side of the obstacle on which the tether passes.
    obstacle : int or str
        Its index or name.

    Returns
    -------
    dict of Word to float
        Those believed that agree; where none does, of all classes that the tether reaches the
        robot in, those that agree and differ least from one that is believed.

    Raises
    ------
    InputError
        No such obstacle or side; no class agrees.
    """
    index = index_of(obstacle, list(problem.obstacles), "obstacle")
    opposite = WINDS[(SIDES.get(side, 0) + 4) % 8] if side in SIDES else AXES[
        (AXES.index(side) + 4) % 8 if side in AXES else 0
    ]  # fmt: skip
    on, off = ray_to(problem, index, side), ray_to(problem, index, opposite)
    found = {t.word: t.path for t in Tethers(problem).classes(*robot)}

    def agrees(path: Floats) -> bool:
        line = shapely.LineString(path[:, :2])
        return bool(line.intersects(on)) and not line.intersects(off)

    kept = {w: cost for w, cost in words.items() if w in found and agrees(found[w])}
    if kept:
        return kept
    others = {w for w, path in found.items() if agrees(path)}
    if not others:
        raise InputError(
            f"side: no tether within {problem.tether_length:g} {problem.units} reaches the robot "
            f"{side} of {problem.obstacle_name(index)}"
        )
    apart = {w: min(_apart(w, known) for known in words) for w in others}
    least = min(apart.values())
    return {w: 0.0 for w, far in apart.items() if far == least}


def _apart(a: Word, b: Word) -> int:
    """Letters that must be put in, left out or changed to make one word of the other."""
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        before, row[0] = row[0], i
        for j, y in enumerate(b, 1):
            before, row[j] = row[j], min(row[j] + 1, row[j - 1] + 1, before + (x != y))
    return row[-1]

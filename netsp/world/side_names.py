"""Words for the course of a tether: obstacles, and the sides on which it passes them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.hsignature import Word
from netsp.hsignature.rays import crossings
from netsp.model.problem import Circle, Polygon, Problem

WINDS = (
    "north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west"
)  # fmt: skip
AXES = ("+y", "+x +y", "+x", "+x −y", "−y", "−x −y", "−x", "−x +y")
"""Sides where north is not known."""

SIDES = {"north": 0, "east": 2, "south": 4, "west": 6}
"""Index of each side in `WINDS` and in `AXES`."""

AXIS_SIDES = {AXES[k]: k for k in SIDES.values()}
"""Index of each side in `AXES`, where north is not known."""

ARC_TOLERANCE = 2e-3
"""Tolerance of touching, as a share of the size of an obstacle: the corners of polylines that stand
for arcs lie this far from the arc."""


def bearing(problem: Problem, direction: npt.ArrayLike) -> float:
    """Return the bearing of a direction in the plan.

    Parameters
    ----------
    problem : Problem
        Problem whose origin states where north is.
    direction : array_like
        (x, y, …).

    Returns
    -------
    float
        Degrees clockwise from north, or from the y axis where north is not known; from 0 to 360.
    """
    x, y = np.asarray(direction, dtype=float)[:2]
    heading = problem.origin.heading if problem.origin else 0.0
    return (math.degrees(math.atan2(x, y)) + heading) % 360.0


def side(problem: Problem, direction: npt.ArrayLike) -> str:
    """Return the name of a direction: a compass point, or an axis if north is unknown."""
    names = WINDS if problem.origin else AXES
    return names[int((bearing(problem, direction) + 22.5) // 45.0) % 8]


def side_direction(problem: Problem, side: str) -> Floats:
    """Return the direction of a side of an obstacle, a unit vector in the plan.

    Raises
    ------
    InputError
        The side is none of `SIDES`, nor of `AXIS_SIDES`.
    """
    names = {**SIDES, **AXIS_SIDES}
    if not isinstance(side, str) or side not in names:
        expected = ", ".join(SIDES if problem.origin else AXIS_SIDES)
        raise InputError(f"side: expected one of {expected}, got {side!r}")
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


def beside(side: str, name: str) -> str:
    """Return a side of an obstacle as a phrase, such as "north of A2" or "above A2"."""
    return f"{side} {name}" if side in ("above", "below") else f"{side} of {name}"


@dataclass(frozen=True)
class Passage:
    """Passage of a tether at an obstacle.

    Parameters
    ----------
    obstacle : int
        Index of the obstacle, from 0.
    side : str
        Side of the obstacle on which the tether passes.
    rests : bool
        Whether the tether touches the obstacle.
    """

    obstacle: int
    side: str
    rests: bool


def passages(problem: Problem, tether: Floats, word: Word) -> list[Passage]:
    """Return the obstacles that make the class of a taut tether, from the base on: those that it
    lies against, and those whose letters its word has.

    Parameters
    ----------
    problem : Problem
        Problem of the tether.
    tether : ndarray, shape (n, 3)
        Polyline of the taut tether.
    word : Word
        Word of the tether.

    Returns
    -------
    list of Passage
        Each obstacle once for every time that the tether comes to it.
    """
    rays, letters = problem.representative_points, {abs(a) for a in word}
    out: list[Passage] = []
    run: list[int] = []
    on = -1

    def leave() -> None:
        if run:
            away = tether[run, :2].mean(0) - rays[on]
            out.append(Passage(on, side(problem, away), True))
            run.clear()

    lies_on = _touched(problem, tether[:-1])
    right = tether[:, :1] >= rays[:, 0]
    may_cross = (right[1:] != right[:-1]).any(axis=1)
    for k in range(len(tether) - 1):
        if k > 0:
            here = int(lies_on[k])
            if here != on:
                leave()
            on = here
            if here >= 0:
                run.append(k)
        for a in crossings(tether[k : k + 2], rays) if may_cross[k] else ():
            i = abs(a) - 1
            known = i == on or (out and out[-1].obstacle == i)
            if i + 1 in letters and not known:
                leave()
                on = -1
                out.append(Passage(i, side(problem, (0.0, 1.0)), False))
    leave()
    return out


def _touched(problem: Problem, points: Floats) -> npt.NDArray[np.intp]:
    """Return the obstacles (k,) that corners (k, 3) of a taut tether lie on; -1 for none."""
    if not problem.obstacles:
        return np.full(len(points), -1, dtype=np.intp)
    clearance = problem.clearance
    gaps = np.array([
        np.abs(o.signed_distance(points[:, :2]) - clearance) / _size(o, clearance)
        for o in problem.obstacles
    ])  # fmt: skip
    on = gaps.argmin(axis=0)
    return np.where(gaps.min(axis=0) <= ARC_TOLERANCE, on, -1)


@lru_cache(maxsize=4096)
def _size(obstacle: Circle | Polygon, clearance: float) -> float:
    """Return the longer side of an obstacle's bounding box."""
    return float(np.ptp(np.array(obstacle.shape(clearance).bounds).reshape(2, 2), axis=0).max())


def listed(problem: Problem, run: list[Passage]) -> str:
    """Return passages as a phrase."""
    if not run:
        return "straight from the base"
    return ", ".join(
        f"{p.side} of {problem.obstacle_name(p.obstacle)}" + (" (rests on it)" if p.rests else "")
        for p in run
    )


def back_from(problem: Problem, runs: list[list[Passage]], names: list[str], k: int) -> str:
    """Return what to do if the tether snags at visit k or on the leg after it.

    Parameters
    ----------
    problem : Problem
        Problem of the tour.
    runs : list of list of Passage
        Passages at each visit.
    names : list of str
        Names of the goals visited.
    k : int
        Index of the visit, from 0.

    Returns
    -------
    str
        Where to go back to: the latest visit at which the tether touches fewer of these obstacles,
        and the path home along the tether.
    """
    touched = [p for p in runs[k] if p.rests]
    if not touched:
        return "straight home: the tether lies against nothing"
    for j in range(k - 1, -1, -1):
        earlier = [p for p in runs[j] if p.rests]
        if len(earlier) < len(touched) and touched[: len(earlier)] == earlier:
            freed = ", ".join(problem.obstacle_name(p.obstacle) for p in touched[len(earlier) :])
            return f"back the way it came to visit {j + 1} ({names[j]}), which clears {freed}"
    home = ", ".join(f"{p.side} of {problem.obstacle_name(p.obstacle)}" for p in reversed(touched))
    return f"home along the tether: {home}"

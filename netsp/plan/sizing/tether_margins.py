"""Margins of a tour: how far the world may be off before the tour does not fit any more.

Say that every obstacle is moved or grown so that none of its points comes to lie farther than r
from where the obstacle was assumed. The obstacles grown by r then hold those of that world: what is
free among grown obstacles is free in it, and paths there have the same class in it. So the taut
tether of a class is no longer than among the grown obstacles, and the tour, pulled taut in its own
classes, is free. Tethers never get shorter as r grows: the largest r for which all tethers of a
tour fit is found by bisection, and the stated r is one for which all were measured.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.data_frames import frame_of
from netsp.base.deprecated import deprecated_method, deprecated_names
from netsp.base.errors import InputError, NetspError
from netsp.base.field_types import checked_argument
from netsp.model.problem import Circle, Problem
from netsp.model.solution import MAX_FRICTION, Solution, tension_ratio
from netsp.plan.sizing.sizing_policy import SizingPolicy
from netsp.roadmap.paths import TautPaths

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True)
class VisitMargin:
    """Margin at one visit.

    Parameters
    ----------
    goal : int
        Index of the goal, from 0.
    name : str
        Name of the goal.
    tether : float
        Length of the taut tether.
    slack : float
        Length that may be lost of the tether before this goal is out of reach in its class.
    turning : float
        Sum of the angles by which the tether bends in the plane, radians.
    tension_ratio : float
        Tension at the far end over that at the robot, by the capstan equation.
    clearance : float
        Distance from the tether or the goal to the nearest obstacle, as drawn.
    """

    goal: int
    name: str
    tether: float
    slack: float
    turning: float
    tension_ratio: float
    clearance: float


@dataclass(frozen=True)
class Margins:
    """Margins of a tour; lengths are in the problem's units.

    Parameters
    ----------
    obstacles : float
        Distance by which every obstacle may be off, moved or grown.
    limited_by : str
        What ends that.
    tether : float
        Length by which the tether may shrink before a goal is out of reach.
    cross_track : float
        Distance by which the robot may be beside its path without leaving its class or
        outstretching the tether. What its body needs beyond its centre is in the problem's
        clearance.
    friction : float
        Coefficient of friction for the tension ratios.
    visits : tuple of VisitMargin
        Margins in the order of the visits.
    """

    obstacles: float
    limited_by: str
    tether: float
    cross_track: float
    friction: float
    visits: tuple[VisitMargin, ...]
    stops = deprecated_method("stops", "visits")

    def to_frame(self) -> pandas.DataFrame:
        """Return the visits as a pandas DataFrame, with a column for each field of `VisitMargin`.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        return frame_of(self.visits)

    def to_json(self) -> str:
        """Return the margins as a JSON object with the visits in a list, `stops`. A margin without
        limit, as without obstacles, is null."""
        data = asdict(self)
        data["stops"] = data.pop("visits")
        for part in (data, *data["stops"]):
            part.update({k: None for k, v in part.items() if v == math.inf})
        return json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def margins(
    problem: Problem,
    solution: Solution,
    friction: float = 0.0,
    *,
    policy: SizingPolicy | None = None,
) -> Margins:
    """Return the margins of a tour in its own classes, whatever margin it was planned with.

    Parameters
    ----------
    problem : Problem
        Problem that was solved.
    solution : Solution
        Solution with a tour that fits.
    friction : float
        Coefficient of friction of the tether on obstacles, 0 to 10.
    policy : SizingPolicy, optional
        Number of bisections.

    Raises
    ------
    InputError
        Friction out of range; no tour, one of another problem, one that starts with the robot out,
        or one that does not fit.
    """
    friction = checked_argument("friction", friction, 0.0, MAX_FRICTION)
    if solution.problem.sha256 != problem.sha256:
        raise InputError(
            "solution: is for another problem or another version of it; plan again, or take the "
            "problem that it was planned for"
        )
    if not solution.tour:
        raise InputError("solution: has no tour")
    if problem.state is not None:
        raise InputError("state: margins are those of a tour from the base; expected none")
    paths = TautPaths(problem)
    visits = tuple(
        _visit_margin(problem, paths, v.goal, v.signature, friction) for v in solution.tour
    )
    slack = min(v.slack for v in visits)
    if slack < -problem.tolerance:
        raise InputError(f"solution: its tether is {-slack:.6g} too short; expected one that fits")
    growth, limited_by = _max_growth(problem, solution, policy or SizingPolicy())
    beside = _obstacle_distance(problem, np.array(solution.path))
    return Margins(
        growth, limited_by, max(slack, 0.0), max(min(beside, slack), 0.0), friction, visits
    )


def _visit_margin(
    problem: Problem, paths: TautPaths, goal: int, word: tuple[int, ...], friction: float
) -> VisitMargin:
    tether = paths.tether(goal, word)
    length = paths.length(0, goal + 1, word)
    turning = _turning(tether[:, :2])
    return VisitMargin(
        goal,
        problem.goal_name(goal),
        length,
        problem.tether_length - length,
        turning,
        tension_ratio(friction, turning),
        _obstacle_distance(problem, tether),
    )


def _turning(xy: Floats) -> float:
    """Return the sum of the angles of a polyline; circumscribed arcs turn as far as the arcs
    themselves."""
    steps = np.diff(xy, axis=0)
    steps = steps[np.hypot(*steps.T) > 0.0]
    if len(steps) < 2:
        return 0.0
    a, b = steps[:-1], steps[1:]
    turns = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(1))
    return float(np.abs(turns).sum())


def _obstacle_distance(problem: Problem, path: Floats) -> float:
    """Return the smallest distance from a polyline to an obstacle, without the clearance; inf
    without obstacles."""
    import shapely

    line = shapely.LineString(path[:, :2]) if len(path) > 1 else shapely.Point(path[0, :2])
    out = np.inf
    for o in problem.obstacles:
        if isinstance(o, Circle):
            gap = line.distance(shapely.Point(o.center)) - o.radius
        else:
            gap = line.distance(o.shape())
        out = min(out, float(gap))
    return out


def _max_growth(problem: Problem, solution: Solution, policy: SizingPolicy) -> tuple[float, str]:
    """Return the largest growth for which all tethers were measured to fit, and what ends it."""
    if not problem.obstacles:
        return math.inf, "there are no obstacles"
    xy = problem.points[:, :2]
    gaps = np.array([o.signed_distance(xy) for o in problem.obstacles]) - problem.clearance
    low, high = 0.0, max(float(gaps.min()), 0.0)
    i, k = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
    place = "the base" if k == 0 else problem.goal_label(int(k) - 1)
    nearer = "would be within the clearance of" if problem.clearance else "would lie in"
    reason = f"{place} {nearer} {problem.obstacle_label(int(i))}"
    high *= 1.0 - 1e-9
    if high <= 0.0:
        return 0.0, reason
    why = _misfit(problem, solution, high)
    if why is None:
        return high, reason
    for _ in range(policy.bisections):
        middle = 0.5 * (low + high)
        found = _misfit(problem, solution, middle)
        if found is None:
            low = middle
        else:
            high, why = middle, found
    return low, why


def _misfit(problem: Problem, solution: Solution, growth: float) -> str | None:
    """Return what does not fit among obstacles grown by a length; None if all does."""
    try:
        paths = TautPaths(problem.grown(growth), problem.tether_length * (1.0 + 1e-9))
    except InputError as error:
        return str(error)
    for visit in solution.tour:
        label = problem.goal_label(visit.goal)
        try:
            length = paths.length(0, visit.goal + 1, visit.signature)
        except NetspError:
            return f"{label}: no tether of its class fits any more, or its path is closed"
        if length > problem.tether_length * (1.0 + 1e-12):
            return f"{label}: its tether does not fit any more"
    return None


__getattr__ = deprecated_names(globals(), StopMargin="VisitMargin")

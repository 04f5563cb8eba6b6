"""Tour as waypoints joined by straight lines, safe for a vehicle that cuts corners.

A vehicle goes on to the next waypoint when it is within its acceptance radius of one. So at a bend
it may cut off the triangle between the bend and the points at that distance before and after it. If
an obstacle reaches into that triangle, the bend is moved outwards; if that does not help, the
radius is too large for the site, which raises an error.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.exchange.missions.export_policy import DEFAULT_EXPORT, ExportPolicy
from netsp.hsignature import Word, concatenate, crossings, signature
from netsp.model.problem import Circle, Problem
from netsp.model.solution import Solution
from netsp.plan.tour_plan import HOME, legs_of

Mark = tuple[int | None, Word, float]
"""Goal, word and tether of a waypoint, as in `Waypoint`."""

TURN_TOLERANCE = 1e-6
"""Tolerance of rounding: a smaller turn is no bend, radians."""


@dataclass(frozen=True)
class Waypoint:
    """Waypoint of an exported tour.

    Parameters
    ----------
    position : tuple of float
        (x, y, z), z up, in the problem's units.
    goal : int or None
        Goal visited here, HOME (-1) for the base at the end; None for a bend and for the start.
    word : Word
        Word of the taut tether at a goal.
    tether : float
        Length of the taut tether at a goal, in the problem's units.
    start : bool
        Whether it is the start.
    heading : float, optional
        Degrees clockwise from north; None for any.
    stay : int, optional
        Hold that the mission states, s; None if it states none.
    """

    position: tuple[float, float, float]
    goal: int | None
    word: Word = ()
    tether: float = 0.0
    start: bool = False
    heading: float | None = None
    stay: int | None = None


def waypoints_of(
    problem: Problem, solution: Solution, radius: float = 0.0, policy: ExportPolicy = DEFAULT_EXPORT
) -> list[Waypoint]:
    """Return the waypoints of a solution in the order of the tour, without the start.

    Parameters
    ----------
    radius : float
        Acceptance radius of the vehicle, in the problem's units.

    Raises
    ------
    InputError
        With this radius a vehicle could cut a corner through an obstacle, or the class of the
        straight lines is not the plan's.
    """
    legs = legs_of(problem, solution)
    solids = [o.shape() for o in problem.obstacles]
    shapely.prepare(solids)
    points: list[Floats] = [legs[0].path[0]]
    all_marks: list[Mark] = [(None, (), 0.0)]
    for leg in legs:
        for point in leg.path[1:-1]:
            points.append(point)
            all_marks.append((None, (), 0.0))
        points.append(leg.path[-1])
        all_marks.append((leg.goal, leg.word, leg.tether))
    kept = [0]
    for k in range(1, len(points)):
        previous = points[kept[-1]]
        if np.linalg.norm(points[k] - previous) == 0.0 and all_marks[k][0] is None:
            continue
        if (
            k + 1 < len(points)
            and all_marks[k][0] is None
            and turn(previous, points[k], points[k + 1]) < TURN_TOLERANCE
        ):
            continue
        kept.append(k)
    line = np.array([points[k] for k in kept])
    marks = [all_marks[k] for k in kept]
    line, marks = _coarsened(
        line, marks, [o.shape(problem.clearance) for o in problem.obstacles], policy.max_arc_turn
    )
    line = _widened(line, marks, solids, radius, policy.bend_shifts)
    _check_class(problem, solution, line, marks)
    return [
        Waypoint((float(x), float(y), float(z)), *mark)
        for (x, y, z), mark in zip(line[1:], marks[1:], strict=True)
    ]


def clearance_of(problem: Problem, points: list[Waypoint]) -> float:
    """Return the distance of the lines between waypoints from the nearest obstacle, not grown."""
    line = shapely.LineString([p.position[:2] for p in points])
    return min(
        (
            line.distance(shapely.Point(o.center)) - o.radius
            if isinstance(o, Circle)
            else line.distance(shapely.Polygon(o.polygon))
            for o in problem.obstacles
        ),
        default=float("inf"),
    )


def _coarsened(
    line: Floats, marks: list[Mark], grown: list[shapely.Polygon], max_turn: float
) -> tuple[Floats, list[Mark]]:
    """Return a path with fewer bends along its arcs.

    Consecutive bends that turn one way by `max_turn` or less in all become the one where the line
    before them meets the line after them, farther out, if that is free.
    """
    slim = [g.buffer(-1e-6 * float(np.ptp(line[:, :2]))) for g in grown]
    tree = shapely.STRtree(slim) if slim else None
    points, kept_marks, k = [line[0]], [marks[0]], 1
    while k < len(line):
        best = None
        m = k
        total = 0.0
        while m + 1 < len(line) and marks[m][0] is None:
            total += _side(points[-1] if m == k else line[m - 1], line[m], line[m + 1])
            if abs(total) > max_turn:
                break
            corner = _meeting(points[-1], line[k], line[m], line[m + 1]) if m > k else line[k]
            if corner is not None:
                paths = [
                    shapely.LineString([a[:2], b[:2]])
                    for a, b in ((points[-1], corner), (corner, line[m + 1]))
                ]
                if tree is None or not any(len(tree.query(w, "intersects")) for w in paths):
                    best = (m, corner)
            m += 1
        if best is None:
            points.append(line[k])
            kept_marks.append(marks[k])
            k += 1
        else:
            points.append(best[1])
            kept_marks.append(marks[k])
            k = best[0] + 1
    return np.array(points), kept_marks


def _side(a: Floats, b: Floats, c: Floats) -> float:
    """Return the signed angle in the plane by which a path turns at b."""
    u, v = (b - a)[:2], (c - b)[:2]
    return float(np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v))


def _meeting(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats | None:
    """Return the point between b and c where the line a b meets the line c d; None if they do not.

    Its height is between those of b and c.
    """
    u, v, w = (b - a)[:2], (d - c)[:2], (c - a)[:2]
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) < 1e-12:
        return None
    s, t = (w[0] * v[1] - w[1] * v[0]) / cross, (w[0] * u[1] - w[1] * u[0]) / cross
    if s < 1.0 - 1e-9 or t > 1e-9:
        return None
    return np.array([*(a[:2] + s * u), 0.5 * (b[2] + c[2])])


def turn(a: Floats, b: Floats, c: Floats) -> float:
    """Return the angle by which a path turns at b, radians; pi if two points coincide.

    Parameters
    ----------
    a, b, c : ndarray, shape (k,)
        Consecutive points.
    """
    u, v = b - a, c - b
    lu, lv = np.linalg.norm(u), np.linalg.norm(v)
    if lu == 0.0 or lv == 0.0:
        return np.pi
    return float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))


def _widened(
    line: Floats,
    marks: list[Mark],
    solids: list[shapely.Polygon],
    radius: float,
    shifts: tuple[float, ...],
) -> Floats:
    """Return a path with bends moved outwards where a vehicle could cut through an obstacle."""
    if radius <= 0.0 or not solids:
        return line
    tree = shapely.STRtree(solids)
    widened = line.copy()
    for k in range(1, len(line) - 1):
        if marks[k][0] is not None or not _cuts(tree, widened, k, radius):
            continue
        middle = 0.5 * (widened[k - 1, :2] + widened[k + 1, :2])
        outward = widened[k, :2] - middle
        distance = float(np.linalg.norm(outward))
        if distance == 0.0:
            continue
        for shift in shifts:
            tried = widened.copy()
            tried[k, :2] += outward / distance * shift * radius
            is_free = not any(
                len(tree.query(shapely.LineString(tried[[i, i + 1], :2]), "intersects"))
                for i in (k - 1, k)
            )
            if is_free and not _cuts(tree, tried, k, radius):
                widened = tried
                break
    cut_bends = [k for k in range(1, len(widened) - 1) if _cuts(tree, widened, k, radius)]
    if cut_bends:
        x, y, _ = widened[cut_bends[0]]
        raise InputError(
            f"acceptance: {radius:g} would let the vehicle cut a corner at ({x:.6g}, {y:.6g}) "
            "through an obstacle; expected a smaller radius, or a plan with a larger clearance"
        )
    return widened


def _cuts(tree: shapely.STRtree, line: Floats, k: int, radius: float) -> bool:
    """Return whether an obstacle reaches into the triangle that may be cut off at bend k."""
    a, b, c = line[k - 1, :2], line[k, :2], line[k + 1, :2]
    u, v = a - b, c - b
    lu, lv = float(np.linalg.norm(u)), float(np.linalg.norm(v))
    if lu == 0.0 or lv == 0.0:
        return False
    corner = [b + u * min(1.0, radius / lu), b, b + v * min(1.0, radius / lv)]
    return bool(len(tree.query(shapely.LineString(corner).convex_hull, "intersects")))


def _check_class(problem: Problem, solution: Solution, line: Floats, marks: list[Mark]) -> None:
    """Check that the straight lines have the plan's word at every goal, and none at the end."""
    rays = problem.representative_points
    tether = np.array(solution.start_tether).reshape(-1, 3)
    word = signature(tether[:, :2], rays) if len(tether) else ()
    solids = [o.shape() for o in problem.obstacles]
    for (a, b), (goal, planned, _) in zip(pairwise(line), marks[1:], strict=True):
        word = concatenate(word, crossings(np.array([a, b])[:, :2], rays))
        step = shapely.LineString([a[:2], b[:2]])
        entered = [s for s in solids if s.buffer(-1e-6 * problem.scale).intersects(step)]
        if entered:
            raise InputError("solution: straight lines between its waypoints enter an obstacle")
        if goal is not None and word != (planned if goal != HOME else ()):
            raise InputError("solution: its waypoints are not of the plan's homotopy class")

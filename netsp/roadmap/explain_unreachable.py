"""Tether length that each goal needs, and the reason why a goal is out of reach."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.base.errors import InfeasibleError, counted
from netsp.model.problem import Circle, Problem
from netsp.roadmap.outline import Outline, build_outline
from netsp.roadmap.roadmap_policy import RoadmapPolicy
from netsp.roadmap.shortest import ContactGraph

if TYPE_CHECKING:
    import shapely


def shortest_tethers(
    problem: Problem,
    outline: Outline | None = None,
    clock: Clock | None = None,
    policy: RoadmapPolicy | None = None,
) -> Floats:
    """Return the 3D lengths (n,) of the shortest tethers to the goals, in any class.

    The lengths are inf for goals that cannot be reached. The problem's tether length does not
    count.

    Parameters
    ----------
    outline : Outline, optional
        Outline of the problem; built if None.

    Raises
    ------
    LimitReachedError
        The clock was up before they were known.
    """
    policy = policy or RoadmapPolicy()
    points = problem.points
    far = np.hypot(*(points[1:, :2] - points[0, :2]).T)
    away = np.array([o.signed_distance(points[0, :2]) for o in problem.obstacles])
    within = policy.reach.first_ratio * float(far.max(initial=0.0)) + problem.clearance
    while True:
        near = away <= within + problem.clearance
        if len(away) <= policy.reach.max_whole_obstacles or near.all():
            outline = outline or build_outline(problem, clock)
            planar = ContactGraph(outline, clock=clock, policy=policy).lengths([0])[0, 1:]
            break
        near_obstacles = tuple(
            o for o, is_near in zip(problem.obstacles, near, strict=True) if is_near
        )
        local = build_outline(problem.model_copy(update={"obstacles": near_obstacles}), clock)
        planar = ContactGraph(local, clock=clock, policy=policy).lengths([0])[0, 1:]
        # paths up to this length reach no other goal
        longest = float(planar[np.isfinite(planar)].max(initial=0.0))
        if longest <= within:
            break
        within = longest
    return np.asarray(np.hypot(planar, points[1:, 2] - points[0, 2]))


def unreached_message(problem: Problem, outline: Outline, missing: list[int]) -> str:
    """Return one line on goals (as point numbers, base 0) that no admissible tether reaches."""
    return str(find_unreached_error(problem, outline, missing))


def find_unreached_error(
    problem: Problem,
    outline: Outline,
    missing: list[int],
    clock: Clock | None = None,
    policy: RoadmapPolicy | None = None,
) -> InfeasibleError:
    """Return the error about goals (as point numbers, base 0) that no admissible tether reaches.
    Raise LimitReachedError when the clock is up before the reason is known."""
    needed = shortest_tethers(problem, outline, clock, policy)
    return unreached_error(problem, needed, [g - 1 for g in missing])


def unreached_error(problem: Problem, needed: Floats, missing: list[int]) -> InfeasibleError:
    """Return the error about goals that no admissible tether reaches, given the shortest tether of
    each goal."""
    parts: list[str] = []
    enclosing: tuple[int, ...] = ()
    missing = sorted(missing, key=lambda g: -needed[g])  # the largest need first
    for g in missing[:3]:
        label = problem.goal_label(g)
        if math.isinf(needed[g]):
            why, around = _enclosure(problem, g + 1)
            if g == missing[0]:
                enclosing = around
            parts.append(f"{label} cannot be reached with a tether of any length: {why}")
        elif needed[g] <= problem.tether_length:
            parts.append(
                f"{label} has a tether of {needed[g]:.6f}, within the tether_length of "
                f"{problem.tether_length:g}, but the rule for classes leaves out every class that "
                "fits; allow all classes, or lengthen the tether"
            )
        else:
            shortest = math.ceil(needed[g] * 1e6) / 1e6
            parts.append(
                f"{label} is out of reach: tether_length is {problem.tether_length:g}; "
                f"expected at least {shortest:.6f}"
            )
    if len(missing) > 3:
        more = len(missing) - 3
        parts.append(f"{counted(more, 'more goal')} {'is' if more == 1 else 'are'} out of reach")
    first = missing[0]
    return InfeasibleError(
        "; ".join(parts), goal=first, needed=float(needed[first]), enclosing=enclosing
    )


def _enclosure(problem: Problem, g: int) -> tuple[str, tuple[int, ...]]:
    """Return a phrase for what separates a goal from the base, and the obstacles that do."""
    import shapely

    grown = [
        o.shape(problem.clearance + (0.0 if isinstance(o, Circle) else problem.tolerance))
        for o in problem.obstacles
    ]
    base, goal = (shapely.Point(problem.points[k, :2]) for k in (0, g))
    box = shapely.box(*problem.bounds) if problem.bounds else None
    for sealed, label in ((goal, "it"), (base, "the base")):
        around, bounded = _ring_around(sealed, grown, box, problem)
        if around:
            names = _listed([problem.obstacle_name(i) for i in around])
            if bounded:
                return f"{label} is cut off by the bounds and {names}", around
            return f"{label} is enclosed by {names}", around
    return "the obstacles in between block every path", ()


def _ring_around(
    point: shapely.Point,
    shapes: list[shapely.Polygon],
    box: shapely.Polygon | None,
    problem: Problem,
) -> tuple[tuple[int, ...], bool]:
    """Return the obstacles around the free pocket of a point, and whether bounds help to close
    it."""
    import shapely

    tolerance = 1e-6 * problem.scale
    union = shapely.union_all([s.buffer(tolerance) for s in shapes])
    everything = box if box is not None else shapely.box(*union.bounds).buffer(problem.scale)
    free = everything.difference(union)
    pockets = [p for p in getattr(free, "geoms", [free]) if p.distance(point) <= 2 * tolerance]
    if not pockets:
        return (), False
    pocket = min(pockets, key=lambda p: p.area)
    if box is None and pocket.buffer(tolerance).contains(everything.exterior):
        return (), False
    near = [i for i, s in enumerate(shapes) if s.distance(pocket) <= 3 * tolerance]
    bounded = box is not None and pocket.distance(box.exterior) <= tolerance
    return tuple(near), bounded


def _listed(names: list[str]) -> str:
    return f"obstacle{'s' if len(names) > 1 else ''} {', '.join(names)}"

"""Detours in any class between base, goals and sub-goals beside the obstacles.

McCammon & Hollinger 2016, section III-B, change the class of a path by planning it again "through
an additional sub-goal placed on the opposite side of an obstacle"; they do not say where exactly.
Here each obstacle has eight places around it, slightly off its boundary, and those in free space
are sub-goals. The sub-goal for a path is the one most opposite to the point where the path comes
nearest to the obstacle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.base.compiled.kernel import kernel
from netsp.hsignature import signature
from netsp.model.problem import Problem
from netsp.roadmap.outline import Outline, build_outline
from netsp.roadmap.roadmap_policy import DetourPolicy, RoadmapPolicy
from netsp.roadmap.shortest import ContactGraph, ShortestPaths
from netsp.roadmap.tangents import build_tangents
from netsp.roadmap.tether_blind_legs import Detours


def taut_detours(
    problem: Problem,
    with_sub_goals: bool,
    check: Callable[[], None] = lambda: None,
    clock: Clock | None = None,
    policy: RoadmapPolicy | None = None,
) -> Detours:
    """Return the exact detours: shortest paths over tangents and arcs.

    Parameters
    ----------
    check
        Called now and then; may raise to stop.

    Raises
    ------
    LimitReachedError
        The clock was up.
    """
    policy = policy or RoadmapPolicy()
    places, side = sub_goals(problem, with_sub_goals, policy.detours)
    check()
    outline = build_outline(problem, clock)
    outline = replace(
        outline,
        points=np.vstack([outline.points, places]),
        places=np.vstack([outline.places, places]),
    )
    tangents = build_tangents(outline, np.inf, clock, policy.sight)
    check()
    graph = ContactGraph(outline, tangents, policy=policy)
    check()
    return tabulate_detours(problem, outline, graph, np.arange(graph.points), places, side, check)


def sub_goals(
    problem: Problem, wanted: bool = True, policy: DetourPolicy | None = None
) -> tuple[Floats, Ints]:
    """Return the places (k, 2) beside the obstacles, relative to the base, and the obstacle of
    each; none if they are not wanted."""
    if not wanted:
        return np.zeros((0, 2)), np.zeros(0, dtype=np.int64)
    policy = policy or DetourPolicy()
    around = policy.sub_goals_per_obstacle
    origin = problem.points[0, :2]
    shapes = [o.shape(problem.clearance) for o in problem.obstacles]
    solid = shapely.union_all([s.buffer(1e-6 * problem.scale) for s in shapes])
    shapely.prepare(solid)
    places, side = [], []
    for i, (shape, middle) in enumerate(zip(shapes, problem.representative_points, strict=True)):
        xmin, ymin, xmax, ymax = shape.bounds
        size = max(xmax - xmin, ymax - ymin)
        for k in range(around):
            angle = 2.0 * np.pi * k / around
            sense = np.array([np.cos(angle), np.sin(angle)])
            ray = shapely.LineString([middle, middle + 2.0 * size * sense])
            inside = shape.intersection(ray)
            reach = max(
                float(np.hypot(*(np.array(c) - middle))) for c in shapely.get_coordinates(inside)
            )
            p = middle + (reach + policy.sub_goal_offset * size) * sense
            in_bounds = problem.bounds is None or (
                problem.bounds[0] <= p[0] <= problem.bounds[2]
                and problem.bounds[1] <= p[1] <= problem.bounds[3]
            )
            if in_bounds and not shapely.contains_xy(solid, *p):
                places.append(p - origin)
                side.append(i)
    return np.array(places).reshape(-1, 2), np.array(side, dtype=np.int64)


def tabulate_detours(
    problem: Problem,
    outline: Outline,
    graph: ShortestPaths,
    terminals: Ints,
    places: Floats,
    side: Ints,
    check: Callable[[], None] = lambda: None,
) -> Detours:
    """Return all detours from base and goals to base, goals and sub-goals over a graph.

    Parameters
    ----------
    terminals
        (m + 1 + k,) nodes of base, goals and sub-goals.
    side
        (k,) obstacle of each sub-goal.
    check
        Called for every base or goal; may raise to stop.
    """
    fixed = len(problem.points)
    count = len(terminals)
    middles = problem.representative_points - outline.origin
    n = len(middles)
    planar = np.full((fixed, count), np.inf)
    far = np.full((fixed, count, n), -1, dtype=np.int64)
    near = np.full((fixed, count, n), np.inf)
    row = np.zeros((fixed, count + 1), dtype=np.int64)
    letters: list[int] = []
    trees = []
    for a in range(fixed):
        check()
        length, before = graph.tree(int(terminals[a]))
        trees.append(before)
        planar[a] = length[terminals]
        row[a, 0] = len(letters)
        for p in range(count):
            check()
            if np.isfinite(planar[a, p]) and p != a:
                xy = graph.draw(int(terminals[a]), int(terminals[p]), before)
                letters += signature(xy, middles)
                near[a, p], far[a, p] = _far_sides(xy, middles, places, side, fixed)
            row[a, p + 1] = len(letters)

    def draw(a: int, p: int) -> Floats:
        xy = graph.draw(int(terminals[a]), int(terminals[p]), trees[a]) + outline.origin
        xy[0] = problem.points[a, :2]
        if p < fixed:
            xy[-1] = problem.points[p, :2]
        return xy

    return Detours(
        planar=planar,
        height=problem.points[:, 2],
        letters=np.array(letters, dtype=np.int64),
        row=row,
        far=far,
        near=near,
        draw=draw,
    )


@kernel
def _far_sides(
    xy: Floats, middles: Floats, places: Floats, side: Ints, first: int
) -> tuple[Floats, Ints]:
    """Return the distance of a path from every obstacle's middle, and the sub-goal most opposite to
    it."""
    n = len(middles)
    near = np.full(n, np.inf)
    far = np.full(n, -1, dtype=np.int64)
    away = np.zeros((n, 2))
    for o in range(n):
        for k in range(len(xy) - 1):
            px, py = xy[k, 0], xy[k, 1]
            dx, dy = xy[k + 1, 0] - px, xy[k + 1, 1] - py
            ax, ay = middles[o, 0] - px, middles[o, 1] - py
            square = dx * dx + dy * dy
            t = 0.0 if square == 0.0 else min(1.0, max(0.0, (ax * dx + ay * dy) / square))
            fx, fy = ax - t * dx, ay - t * dy
            gap = math.hypot(fx, fy)
            if gap < near[o]:
                near[o], away[o, 0], away[o, 1] = gap, fx, fy
    best = np.full(n, -np.inf)
    for k in range(len(side)):
        o = side[k]
        x, y = places[k, 0] - middles[o, 0], places[k, 1] - middles[o, 1]
        score = (x * away[o, 0] + y * away[o, 1]) / max(math.hypot(x, y), 1e-300)
        if score > best[o]:
            best[o], far[o] = score, first + k
    return near, far

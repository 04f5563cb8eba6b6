"""Why a goal is out of reach: the shortest tether that would do, or what encloses it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from netsp.problem import Circle, Problem
from netsp.roadmap.outline import Outline
from netsp.roadmap.tangents import build_tangents


def explain_unreached(problem: Problem, outline: Outline, missing: list[int]) -> str:
    """One line on goals (as point numbers, base 0) that no admissible tether reaches."""
    planar = shortest_lengths(outline)
    dz = problem.points[:, 2] - problem.points[0, 2]
    needed = np.hypot(planar, dz)
    parts = []
    for g in missing[:3]:
        label = problem.goal_label(g - 1)
        if math.isinf(needed[g]):
            parts.append(f"{label} cannot be reached with any tether: {_enclosure(problem, g)}")
        else:
            shortest = math.ceil(needed[g] * 1e6) / 1e6
            parts.append(
                f"{label} is out of reach: tether_length {problem.tether_length:g}, the shortest "
                f"tether that would do is {shortest:.6f}"
            )
    if len(missing) > 3:
        parts.append(f"{len(missing) - 3} more goals are out of reach")
    return "; ".join(parts)


def shortest_lengths(outline: Outline, source: int = 0) -> npt.NDArray[np.float64]:
    """Shortest planar path length from a point (the base) to every point in any class; inf if there
    is none.

    Dijkstra over contact points: tangents join them across free space, arcs along the outline.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    t = build_tangents(outline, np.inf)
    arcs, points = len(t.arcs), len(t.points)
    edges = len(t.target)
    tail = np.repeat(np.arange(len(t.start) - 1), np.diff(t.start))
    # contact 0 … points-1 are the points; contact points + 2 e (+ 1) the departure (arrival) of e
    leave = np.where(tail >= 2 * arcs, tail - 2 * arcs, points + 2 * np.arange(edges))
    arrive = np.where(t.target >= 2 * arcs, t.target - 2 * arcs, points + 2 * np.arange(edges) + 1)
    rows, cols, cost = [leave], [arrive], [t.length]
    for a in range(arcs):
        out_e = np.flatnonzero(tail // 2 == a)
        in_e = np.flatnonzero(t.target // 2 == a)
        contact = np.concatenate([leave[out_e], arrive[in_e]])
        theta = np.concatenate([t.angle[out_e, 0], t.angle[in_e, 1]])
        key = np.mod(theta - t.arcs[a, 3] + 1e-6, 2.0 * np.pi)
        order = np.argsort(key)
        contact, key = contact[order], key[order]
        step = np.diff(key) * t.arcs[a, 2]
        rows.append(contact[:-1])
        cols.append(contact[1:])
        cost.append(step)
        if t.full[a] and len(contact) > 1:
            rows.append(contact[-1:])
            cols.append(contact[:1])
            cost.append(np.array([(key[0] + 2.0 * np.pi - key[-1]) * t.arcs[a, 2]]))
    r, c, d = np.concatenate(rows), np.concatenate(cols), np.concatenate(cost)
    size = points + 2 * edges
    # scipy takes a stored zero for no edge
    graph = csr_array((np.maximum(d, 1e-300), (r, c)), shape=(size, size))
    return np.asarray(dijkstra(graph, directed=False, indices=source)[:points])


def _enclosure(problem: Problem, g: int) -> str:
    """Which obstacles stand between the base and a goal that no path joins."""
    import shapely

    grown = [
        (
            shapely.Point(o.center).buffer(o.radius + problem.clearance, quad_segs=64)
            if isinstance(o, Circle)
            else shapely.Polygon(o.polygon).buffer(problem.clearance + problem.tolerance)
        )
        for o in problem.obstacles
    ]
    base, goal = (shapely.Point(problem.points[k, :2]) for k in (0, g))
    box = shapely.box(*problem.bounds) if problem.bounds else None
    for sealed, label in ((goal, "it"), (base, "the base")):
        names = _ring_around(sealed, grown, box, problem)
        if names:
            return f"{label} is enclosed by {', '.join(names)}"
    return "the obstacles between close every way"


def _ring_around(point, shapes, box, problem):
    import shapely

    tolerance = 1e-6 * problem.scale
    union = shapely.union_all([s.buffer(tolerance) for s in shapes])
    everything = box if box is not None else shapely.box(*union.bounds).buffer(problem.scale)
    free = everything.difference(union)
    pockets = [p for p in getattr(free, "geoms", [free]) if p.distance(point) <= 2 * tolerance]
    if not pockets:
        return []
    pocket = min(pockets, key=lambda p: p.area)
    if box is None and pocket.buffer(tolerance).contains(everything.exterior):
        return []
    near = [i for i, s in enumerate(shapes) if s.distance(pocket) <= 3 * tolerance]
    return [problem.obstacle_label(i) for i in near]

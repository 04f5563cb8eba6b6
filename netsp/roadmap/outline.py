"""Outline of free space: blockers of segments, and arcs around which a taut path can bend.

A circle grown by the clearance is a disk. A polygon grown by the clearance has a disk at each
convex vertex, of which only the part between the normals of the two edges shows. So a circle is the
one-vertex polygon, and every bend of a taut path is an arc of some disk. Where grown obstacles
overlap, the covered part of an arc is cut away.

Coordinates are relative to the base. Each obstacle is grown by a further `margin`. Obstacles that
touch then overlap, so no path slips between them, and a polygon without clearance has arcs, too.
Lengths change by at most the margin times the turning.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.base.compiled.dynamic_array import longer, more_rows, sort_in_place
from netsp.base.compiled.kernel import kernel
from netsp.base.geometry.kernels import (
    TWO_PI,
    Blockers,
    circle_circle_angles,
    circle_line_angles,
    depth_in_obstacle,
    is_covered,
    make_blockers,
    point_in_polygon,
    segment_blocked,
)
from netsp.base.geometry.polygons import counterclockwise
from netsp.model.problem import Circle, Problem

GROWTH_MARGIN = 1e-10
"""Tolerance of obstacles that touch: further growth of each, as a share of the problem's size."""

COVER_TOLERANCE = 1e-12
"""Tolerance of the test whether an obstacle covers a point, as a share of the problem's size."""

OUTLINING = "outlining the obstacles"
"""Name of the stage, in messages about the time limit."""

STAND_OFF = 1e-8
"""Tolerance of a point on a grown boundary: the distance to which it is moved off, as a share of
the problem's size. Tangents at the tiny arcs of a polygon without clearance are then well
conditioned, and no length changes by more."""


@kernel
def depths(x: float, y: float, blockers: Blockers) -> Floats:
    """Return the (n,) depths of a point in the grown obstacles, negative outside."""
    out = np.empty(len(blockers.grow))
    for o in range(len(out)):
        out[o] = depth_in_obstacle(x, y, o, blockers)
    return out


def is_free(points: Floats, blockers: Blockers) -> bool:
    """Return whether a polyline (k, 2 or 3) enters no grown obstacle."""
    xy = np.asarray(points, dtype=float)[:, :2]
    return not any(segment_blocked(p[0], p[1], q[0], q[1], blockers) for p, q in pairwise(xy))


@dataclass(frozen=True)
class Outline:
    """Free space for the taut roadmap.

    Attributes
    ----------
    blockers
        Grown obstacles, which a segment must not enter.
    arcs
        (a, 5) centre x, y, radius, start angle, end angle (counter-clockwise, end > start).
    full
        (a,) whether the arc is a whole circle.
    origin
        (2,) the base, which is the origin of all coordinates here.
    places
        (1 + m, 2) base and goals.
    points
        The same places; those nearer to a grown boundary than `STAND_OFF` are moved to that
        distance.
    rays
        (n, 2) representative points.
    margin
        Extra growth of all obstacles.
    """

    blockers: Blockers
    arcs: Floats
    full: npt.NDArray[np.bool_]
    origin: Floats
    places: Floats
    points: Floats
    rays: Floats
    margin: float


def build_outline(problem: Problem, clock: Clock | None = None) -> Outline:
    """Return the outline of a problem's free space in the plane.

    Raises
    ------
    LimitReachedError
        The time was up before the outline was complete.
    """
    scale = problem.scale
    margin, eps = GROWTH_MARGIN * scale, COVER_TOLERANCE * scale
    origin = np.array(problem.base[:2])
    blockers, disks = _grow(problem, origin, problem.clearance + margin, eps)
    bounds = np.array(problem.bounds if problem.bounds else (-np.inf, -np.inf, np.inf, np.inf))
    bounds = bounds - np.tile(origin, 2)
    parts = len(blockers.box) + len(blockers.edges)
    steps = 4 * len(disks) * parts
    rows = (clock or Clock()).finish(
        OUTLINING, steps, lambda stop: _visible_arcs(disks, blockers, bounds, stop)
    )
    places = problem.points[:, :2] - origin
    points = np.array([push_out(p, blockers, STAND_OFF * scale) for p in places])
    rays = problem.representative_points - origin
    arcs, full = np.ascontiguousarray(rows[:, :5]), rows[:, 5] > 0.0
    return Outline(blockers, arcs, full, origin, places, points, rays, margin)


def _grow(problem: Problem, origin: Floats, growth: float, eps: float) -> tuple[Blockers, Floats]:
    """Return the blockers, and disks (x, y, r, cone start, cone end); a whole circle's cone is 0 to
    2 pi."""
    circles, edges, edge_start, box = [], [], [0], []
    disks: list[tuple[float, float, float, float, float]] = []
    for obstacle in problem.obstacles:
        if isinstance(obstacle, Circle):
            x, y = (float(c) for c in np.array(obstacle.center) - origin)
            r = obstacle.radius + growth
            circles.append((x, y, r))
            box.append((x - r, y - r, x + r, y + r))
            disks.append((x, y, r, 0.0, TWO_PI))
        else:
            v = counterclockwise(np.array(obstacle.polygon) - origin)
            following = np.roll(v, -1, axis=0)
            edges.extend(np.hstack([v, following]).tolist())
            circles.append((0.0, 0.0, -1.0))
            box.append((*(v.min(axis=0) - growth), *(v.max(axis=0) + growth)))
            disks.extend(_vertex_disks(v, growth))
        edge_start.append(len(edges))
    unique = list(dict.fromkeys(disks))
    blockers = make_blockers(
        np.array(circles, dtype=float).reshape(-1, 3),
        np.array(edges, dtype=float).reshape(-1, 4),
        np.array(edge_start, dtype=np.int64),
        np.full(len(circles), growth),
        np.array(box, dtype=float).reshape(-1, 4),
        eps,
    )
    return blockers, np.array(unique, dtype=float).reshape(-1, 5)


def _vertex_disks(v: Floats, growth: float) -> list[tuple[float, float, float, float, float]]:
    """Return the disks at the convex vertices of a counter-clockwise polygon, with their normal
    cones."""
    incoming = v - np.roll(v, 1, axis=0)
    outgoing = np.roll(v, -1, axis=0) - v
    disks = []
    for (x, y), (ax, ay), (bx, by) in zip(v, incoming, outgoing, strict=True):
        if ax * by - ay * bx > 0.0:
            start = math.atan2(-ax, ay) % TWO_PI
            turn = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
            disks.append((float(x), float(y), growth, start, start + turn))
    return disks


def push_out(point: Floats, blockers: Blockers, distance: float) -> Floats:
    """Return a point, moved to a distance from a grown boundary if it is nearer."""
    p = np.array(point, dtype=float)
    for _ in range(32):
        depth = depths(p[0], p[1], blockers)
        if len(depth) == 0 or depth.max() <= -0.5 * distance:
            break
        o = int(np.argmax(depth))
        if blockers.circles[o, 2] >= 0.0:
            away = p - blockers.circles[o, :2]
            clear = blockers.circles[o, 2] + distance
            p = blockers.circles[o, :2] + away / np.hypot(*away) * clear
        else:
            p = _push_out_of_polygon(p, o, blockers, distance)
    return p


def _push_out_of_polygon(p: Floats, o: int, blockers: Blockers, stand_off: float) -> Floats:
    """Return a point moved away from the nearest point of the outline; along the normal if it lies
    on it."""
    e = blockers.edges[blockers.edge_start[o] : blockers.edge_start[o + 1]]
    a, d = e[:, :2], e[:, 2:] - e[:, :2]
    t = np.clip(((p - a) * d).sum(axis=1) / (d**2).sum(axis=1), 0.0, 1.0)
    foot = a + t[:, None] * d
    away = p - foot
    k = int(np.argmin(np.hypot(away[:, 0], away[:, 1])))
    distance = np.hypot(*away[k])
    if distance <= 1e-6 * stand_off:
        unit = np.array([d[k, 1], -d[k, 0]]) / np.hypot(*d[k])
    else:
        inside = point_in_polygon(
            p[0], p[1], blockers.edges, blockers.edge_start[o], blockers.edge_start[o + 1]
        )
        unit = away[k] / distance * (-1.0 if inside else 1.0)
    return np.asarray(foot[k] + unit * (blockers.grow[o] + stand_off))


@kernel
def _is_blocked(x: float, y: float, blockers: Blockers, bounds: Floats) -> bool:
    eps = blockers.eps
    if x < bounds[0] - eps or x > bounds[2] + eps or y < bounds[1] - eps or y > bounds[3] + eps:
        return True
    return is_covered(x, y, blockers)


@kernel
def is_disjoint(cx: float, cy: float, r: float, boxes: Floats, k: int) -> bool:
    """Return whether the box of a disk and box k have no point in common."""
    return bool(
        boxes[k, 0] > cx + r or boxes[k, 2] < cx - r or boxes[k, 1] > cy + r or boxes[k, 3] < cy - r
    )


@kernel
def _visible_arcs(disks: Floats, blockers: Blockers, bounds: Floats, stop: Ints) -> Floats:
    """Return the parts of each disk's cone that no other obstacle covers and that lie within
    bounds. Some are missing when the flag of a clock is set."""
    circles, edges, grow, eps = blockers.circles, blockers.edges, blockers.grow, blockers.eps
    part, part_box, skip = blockers.part, blockers.part_box, blockers.tree.skip
    tree_box, tree_first, tree_stop = blockers.tree.box, blockers.tree.first, blockers.tree.stop
    arcs = np.empty((16, 6))  # the sixth column is 1 for a whole circle
    zero = int(np.int64(0))  # no literal: numba would compile every callee for it again
    count = zero
    cuts = np.empty(64)
    inside = np.empty(64)
    for k in range(len(disks)):
        if stop[0] != 0:
            break
        cx, cy, r = disks[k, 0], disks[k, 1], disks[k, 2]
        start, end = disks[k, 3], disks[k, 4]
        n = zero
        node = zero
        while node < len(skip):
            if is_disjoint(cx, cy, r, tree_box, node):
                node = skip[node]
                continue
            node += 1
            if skip[node - 1] > node:
                continue
            for p in range(tree_first[node - 1], tree_stop[node - 1]):
                if is_disjoint(cx, cy, r, part_box, p):
                    continue
                o, e = part[p, 0], part[p, 1]
                if n + 6 > len(cuts):
                    cuts = longer(cuts)
                if e < 0:
                    n = circle_circle_angles(
                        cx, cy, r, circles[o, 0], circles[o, 1], circles[o, 2] - eps, cuts, n
                    )
                    continue
                ax, ay, bx, by = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
                n = circle_circle_angles(cx, cy, r, ax, ay, grow[o] - eps, cuts, n)
                length = math.hypot(bx - ax, by - ay)
                ux = (by - ay) / length * (grow[o] - eps)
                uy = -(bx - ax) / length * (grow[o] - eps)
                n = circle_line_angles(cx, cy, r, ax + ux, ay + uy, bx + ux, by + uy, cuts, n)
                n = circle_line_angles(cx, cy, r, ax, ay, bx, by, cuts, n)
        if n + 8 > len(cuts):
            cuts = longer(cuts)
        if n + 10 > len(inside):
            inside = np.empty(2 * n + 10)
        for side in range(4):
            b = bounds[side]
            if math.isinf(b):
                continue
            if side % 2 == 0:
                n = circle_line_angles(cx, cy, r, b, cy - 1.0, b, cy + 1.0, cuts, n)
            else:
                n = circle_line_angles(cx, cy, r, cx - 1.0, b, cx + 1.0, b, cuts, n)
        whole = end - start >= TWO_PI
        m = 1
        inside[0] = start
        for i in range(n):
            a = start + (cuts[i] - start) % TWO_PI
            if start < a < end:
                inside[m] = a
                m += 1
        inside[m] = end
        m += 1
        sort_in_place(inside, m)
        first = count
        open_start = np.nan
        for i in range(m - 1):
            mid = 0.5 * (inside[i] + inside[i + 1])
            hidden = inside[i + 1] <= inside[i] or _is_blocked(
                cx + r * math.cos(mid), cy + r * math.sin(mid), blockers, bounds
            )
            if inside[i + 1] <= inside[i]:
                continue
            if not hidden and math.isnan(open_start):
                open_start = inside[i]
            if hidden and not math.isnan(open_start):
                arcs, count = _append_arc(arcs, count, cx, cy, r, open_start, inside[i], 0.0)
                open_start = np.nan
        if not math.isnan(open_start):
            if whole and open_start == start:
                arcs, count = _append_arc(arcs, count, cx, cy, r, 0.0, TWO_PI, 1.0)
            elif whole and count > first and arcs[first, 3] == start:
                # the arc runs on through the angle where the cone was cut open
                arcs[first, 3] = open_start
                arcs[first, 4] += TWO_PI
            else:
                arcs, count = _append_arc(arcs, count, cx, cy, r, open_start, end, 0.0)
    return arcs[:count]


@kernel
def _append_arc(
    arcs: Floats, count: int, cx: float, cy: float, r: float, start: float, end: float, whole: float
) -> tuple[Floats, int]:
    if count == len(arcs):
        arcs = more_rows(arcs)
    arcs[count, 0], arcs[count, 1], arcs[count, 2] = cx, cy, r
    arcs[count, 3], arcs[count, 4], arcs[count, 5] = start, end, whole
    return arcs, count + 1

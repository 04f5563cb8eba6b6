"""Planar kernels: distances, containment, crossings. Compiled, cached, no policy.

Obstacles come as *blockers*: circles ``(x, y, R)`` and polygons given by their edges, each grown by
a margin. Everything is decided by distances, so a polygon and a circle obey one rule.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from netsp.arrays import Floats, Ints
from netsp.compiled.kernel import kernel

TWO_PI = 2.0 * math.pi


class Blockers(NamedTuple):
    """Grown obstacles.

    Attributes
    ----------
    circles
        (n, 3) centre and grown radius, radius negative for a polygon.
    edges
        (k, 4) polygon edges; obstacle o owns edge_start[o]:edge_start[o + 1], grown by grow[o].
    box
        (n, 4) bounding boxes.
    eps
        What goes no deeper touches.
    """

    circles: Floats
    edges: Floats
    edge_start: Ints
    grow: Floats
    box: Floats
    eps: float


@kernel
def point_segment_distance(
    px: float, py: float, ax: float, ay: float, bx: float, by: float
) -> float:
    """Distance from a point to the segment ab."""
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    t = 0.0
    if length2 > 0.0:
        t = min(1.0, max(0.0, ((px - ax) * dx + (py - ay) * dy) / length2))
    return math.hypot(px - ax - t * dx, py - ay - t * dy)


@kernel
def segments_cross(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> bool:
    """Whether two segments properly cross."""
    d1 = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    d2 = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
    d3 = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
    d4 = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
    return (d1 > 0.0) != (d2 > 0.0) and (d3 > 0.0) != (d4 > 0.0)


@kernel
def segment_segment_distance(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> float:
    """Distance between the segments ab and cd; 0 where they cross."""
    if segments_cross(ax, ay, bx, by, cx, cy, dx, dy):
        return 0.0
    return min(
        point_segment_distance(ax, ay, cx, cy, dx, dy),
        point_segment_distance(bx, by, cx, cy, dx, dy),
        point_segment_distance(cx, cy, ax, ay, bx, by),
        point_segment_distance(dx, dy, ax, ay, bx, by),
    )


@kernel
def point_in_polygon(px: float, py: float, edges: Floats, start: int, stop: int) -> bool:
    """Whether a point lies in the polygon of edges (n, 4) start to stop - 1."""
    inside = False
    for e in range(start, stop):
        ay, by = edges[e, 1], edges[e, 3]
        if (ay > py) != (by > py):
            x = edges[e, 0] + (py - ay) / (by - ay) * (edges[e, 2] - edges[e, 0])
            if px < x:
                inside = not inside
    return inside


@kernel
def depth_in_obstacle(px: float, py: float, o: int, blockers: Blockers) -> float:
    """How deep a point lies inside obstacle `o`; negative outside."""
    circles, edges, edge_start = blockers.circles, blockers.edges, blockers.edge_start
    if circles[o, 2] >= 0.0:
        return float(circles[o, 2] - math.hypot(px - circles[o, 0], py - circles[o, 1]))
    d = np.inf
    for e in range(edge_start[o], edge_start[o + 1]):
        d = min(
            d, point_segment_distance(px, py, edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3])
        )
    if point_in_polygon(px, py, edges, edge_start[o], edge_start[o + 1]):
        d = -d
    return float(blockers.grow[o] - d)


@kernel
def enters_obstacle(ax: float, ay: float, bx: float, by: float, o: int, blockers: Blockers) -> bool:
    """Whether a segment enters obstacle `o` deeper than eps."""
    circles, edges, edge_start = blockers.circles, blockers.edges, blockers.edge_start
    if circles[o, 2] >= 0.0:
        d = point_segment_distance(circles[o, 0], circles[o, 1], ax, ay, bx, by)
        return bool(d < circles[o, 2] - blockers.eps)
    growth = blockers.grow[o] - blockers.eps
    return enters_polygon(ax, ay, bx, by, edges, edge_start[o], edge_start[o + 1], growth)


@kernel
def enters_polygon(
    ax: float, ay: float, bx: float, by: float, edges: Floats, start: int, stop: int, growth: float
) -> bool:
    """Whether a segment comes nearer than `growth` to the polygon of edges (n, 4) start to
    stop - 1."""
    for e in range(start, stop):
        d = segment_segment_distance(
            ax, ay, bx, by, edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        )
        if d < growth:
            return True
    return point_in_polygon(ax, ay, edges, start, stop)


@kernel
def segment_blocked(ax: float, ay: float, bx: float, by: float, blockers: Blockers) -> bool:
    """Whether the segment ab enters any of the blockers by more than eps."""
    box = blockers.box
    left, right, low, high = min(ax, bx), max(ax, bx), min(ay, by), max(ay, by)
    for o in range(len(box)):
        if right < box[o, 0] or left > box[o, 2] or high < box[o, 1] or low > box[o, 3]:
            continue
        if enters_obstacle(ax, ay, bx, by, o, blockers):
            return True
    return False


@kernel
def circle_line_angles(
    cx: float, cy: float, r: float, ax: float, ay: float, bx: float, by: float, out: Floats, n: int
) -> int:
    """Append the angles at which a circle meets the line through two points; returns the count."""
    dx, dy = bx - ax, by - ay
    length = math.hypot(dx, dy)
    if length == 0.0:
        return n
    nx, ny = dy / length, -dx / length
    h = (ax - cx) * nx + (ay - cy) * ny
    if abs(h) < r:
        mid = math.atan2(ny, nx)
        half = math.acos(h / r)
        out[n] = mid - half
        out[n + 1] = mid + half
        n += 2
    return n


@kernel
def circle_circle_angles(
    cx: float, cy: float, r: float, ox: float, oy: float, q: float, out: Floats, n: int
) -> int:
    """Append the angles (on the first circle) at which two circles meet; returns the count."""
    d = math.hypot(ox - cx, oy - cy)
    if d == 0.0 or r == 0.0:
        return n
    c = (d * d + r * r - q * q) / (2.0 * d * r)
    if -1.0 < c < 1.0:
        mid = math.atan2(oy - cy, ox - cx)
        half = math.acos(c)
        out[n] = mid - half
        out[n + 1] = mid + half
        n += 2
    return n

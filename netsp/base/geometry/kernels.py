"""Planar kernels: distances, containment, crossings. Compiled.

Obstacles are *blockers*: circles ``(x, y, R)`` and polygons given by their edges, each grown by a
margin. All tests compare distances, so one rule holds for polygons and circles.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.base.geometry.box_tree import BoxTree, build_box_tree, spatial_order

TWO_PI = 2.0 * math.pi


class Blockers(NamedTuple):
    """Grown obstacles.

    Attributes
    ----------
    circles
        Centre and grown radius (n, 3) of each obstacle; the radius is negative for a polygon.
    edges
        Edges (k, 4) of polygons. Those of obstacle o are edge_start[o]:edge_start[o + 1].
    grow
        Margin (n,) by which each polygon is grown.
    box
        Bounding boxes (n, 4).
    eps
        Depth up to which a point inside an obstacle counts as touching it.
    part
        Circles and edges (parts, 2), as the obstacle and its edge, -1 for a circle. The edges of a
        polygon follow each other in order.
    part_box
        Bounding boxes (parts, 4) of the grown parts.
    tree
        `BoxTree` over the parts.
    """

    circles: Floats
    edges: Floats
    edge_start: Ints
    grow: Floats
    box: Floats
    eps: float
    part: Ints
    part_box: Floats
    tree: BoxTree


def make_blockers(
    circles: Floats, edges: Floats, edge_start: Ints, grow: Floats, box: Floats, eps: float
) -> Blockers:
    """Return the blockers of grown obstacles, with their parts and the tree over these."""
    count = np.maximum(np.diff(edge_start), 1)
    order = spatial_order(box)
    owner = np.repeat(order, count[order])
    within = np.arange(len(owner)) - np.repeat(np.cumsum(count[order]) - count[order], count[order])
    edge = np.where(circles[owner, 2] < 0.0, edge_start[owner] + within, -1)
    part_box = box[owner]
    of_polygon = edge >= 0
    e, growth = edges[edge[of_polygon]], grow[owner[of_polygon]][:, None]
    part_box[of_polygon, :2] = np.minimum(e[:, :2], e[:, 2:]) - growth
    part_box[of_polygon, 2:] = np.maximum(e[:, :2], e[:, 2:]) + growth
    part = np.ascontiguousarray(np.column_stack([owner, edge]).astype(np.int64))
    return Blockers(
        circles, edges, edge_start, grow, box, eps, part, part_box, build_box_tree(part_box)
    )


@kernel
def point_segment_distance(
    px: float, py: float, ax: float, ay: float, bx: float, by: float
) -> float:
    """Return the distance from a point to the segment ab."""
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
    """Return whether the segments ab and cd properly cross."""
    d1 = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    d2 = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
    d3 = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
    d4 = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
    return (d1 > 0.0) != (d2 > 0.0) and (d3 > 0.0) != (d4 > 0.0)


@kernel
def segment_segment_distance(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> float:
    """Return the distance between the segments ab and cd; 0 if they cross."""
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
    """Return whether a point lies in the polygon of edges (n, 4) start to stop - 1."""
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
    """Return the depth of a point inside obstacle `o`, negative outside."""
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
def enters_polygon(
    ax: float, ay: float, bx: float, by: float, edges: Floats, start: int, stop: int, growth: float
) -> bool:
    """Return whether a segment comes nearer than `growth` to a polygon, or lies in it.

    The polygon has the edges (n, 4) start to stop - 1.
    """
    for e in range(start, stop):
        d = segment_segment_distance(
            ax, ay, bx, by, edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        )
        if d < growth:
            return True
    return point_in_polygon(ax, ay, edges, start, stop)


@kernel
def segment_blocked(ax: float, ay: float, bx: float, by: float, blockers: Blockers) -> bool:
    """Return whether the segment ab enters any of the blockers by more than eps."""
    skip, box = blockers.tree.skip, blockers.tree.box
    first, stop = blockers.tree.first, blockers.tree.stop
    part, part_box, edges, eps = blockers.part, blockers.part_box, blockers.edges, blockers.eps
    left, right, low, high = min(ax, bx), max(ax, bx), min(ay, by), max(ay, by)
    dx, dy = bx - ax, by - ay
    node = int(np.int64(0))  # no literal: callees are compiled once
    while node < len(skip):
        x0, y0, x1, y1 = box[node, 0], box[node, 1], box[node, 2], box[node, 3]
        apart = right < x0 or left > x1 or high < y0 or low > y1
        if not apart:
            # does the line of the segment miss the box?
            side = dx * (0.5 * (y0 + y1) - ay) - dy * (0.5 * (x0 + x1) - ax)
            apart = 2.0 * abs(side) > abs(dx) * (y1 - y0) + abs(dy) * (x1 - x0)
        if apart:
            node = skip[node]
            continue
        node += 1
        if skip[node - 1] > node:
            continue
        for k in range(first[node - 1], stop[node - 1]):
            if right < part_box[k, 0] or left > part_box[k, 2]:
                continue
            if high < part_box[k, 1] or low > part_box[k, 3]:
                continue
            o, e = part[k, 0], part[k, 1]
            if e < 0:
                d = point_segment_distance(
                    blockers.circles[o, 0], blockers.circles[o, 1], ax, ay, bx, by
                )
                if d < blockers.circles[o, 2] - eps:
                    return True
            else:
                d = segment_segment_distance(
                    ax, ay, bx, by, edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
                )
                if d < blockers.grow[o] - eps:
                    return True
    return in_any_polygon(ax, ay, blockers)


@kernel
def in_any_polygon(px: float, py: float, blockers: Blockers) -> bool:
    """Return whether a point lies in a polygon of the blockers, before it is grown."""
    skip, box = blockers.tree.skip, blockers.tree.box
    first, stop = blockers.tree.first, blockers.tree.stop
    part, edges = blockers.part, blockers.edges
    obstacle = int(np.int64(-1))  # no literal: callees are compiled once
    inside = False
    node = int(np.int64(0))
    while node < len(skip):
        if box[node, 1] > py or box[node, 3] < py or box[node, 2] < px:
            node = skip[node]
            continue
        node += 1
        if skip[node - 1] > node:
            continue
        for k in range(first[node - 1], stop[node - 1]):
            e = part[k, 1]
            if e < 0:
                continue
            if part[k, 0] != obstacle:
                if inside:
                    return True
                obstacle = part[k, 0]
            ay, by = edges[e, 1], edges[e, 3]
            if (ay > py) != (by > py):
                x = edges[e, 0] + (py - ay) / (by - ay) * (edges[e, 2] - edges[e, 0])
                if px < x:
                    inside = not inside
    return inside


@kernel
def is_covered(px: float, py: float, blockers: Blockers) -> bool:
    """Return whether a point lies in any of the blockers by more than eps."""
    skip, box = blockers.tree.skip, blockers.tree.box
    first, stop = blockers.tree.first, blockers.tree.stop
    part, edges, eps = blockers.part, blockers.edges, blockers.eps
    node = int(np.int64(0))  # no literal: callees are compiled once
    while node < len(skip):
        if px < box[node, 0] or px > box[node, 2] or py < box[node, 1] or py > box[node, 3]:
            node = skip[node]
            continue
        node += 1
        if skip[node - 1] > node:
            continue
        for k in range(first[node - 1], stop[node - 1]):
            o, e = part[k, 0], part[k, 1]
            if e < 0:
                d = math.hypot(px - blockers.circles[o, 0], py - blockers.circles[o, 1])
                if blockers.circles[o, 2] - d > eps:
                    return True
            else:
                d = point_segment_distance(
                    px, py, edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
                )
                if blockers.grow[o] - d > eps:
                    return True
    return in_any_polygon(px, py, blockers)


@kernel
def circle_line_angles(
    cx: float, cy: float, r: float, ax: float, ay: float, bx: float, by: float, out: Floats, n: int
) -> int:
    """Append the angles at which a circle meets the line through two points; return the count."""
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
    """Append the angles on the first circle at which two circles meet; return the count."""
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

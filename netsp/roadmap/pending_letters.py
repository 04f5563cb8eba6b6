"""Boxes in which a taut path stays while a letter is pending.

A taut path may cross the ray of an obstacle and cross it back without going round the obstacle, if
the ray cuts a part off another obstacle and the path bends around that part. The part is on the far
side of the ray, as seen from the representative point of the other obstacle. In between, the path
stays in the convex hull of the piece of the ray between both crossings and these parts (Lemma 13
of docs/theory).
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.base.geometry.kernels import Blockers

XMIN, YMIN, XMAX, YMAX, MAX_PENDING = range(5)
"""Columns of a box. XMIN is infinite where nothing is cut off, so that the letter is final;
MAX_PENDING says how often the letter can be pending at one time."""


@kernel
def pending_boxes(rays: Floats, blockers: Blockers) -> Floats:
    """Return the (2, n, 5) boxes of the letters +i (first) and -i.

    Rays of equal x count as ordered by their numbers. The ray of x stands an infinitesimal step to
    the left of x, because a point on it counts as right of it.
    """
    circles, edges, edge_start = blockers.circles, blockers.edges, blockers.edge_start
    n = len(rays)
    out = np.empty((2, n, 5))
    for side in range(2):
        for i in range(n):
            out[side, i, XMIN], out[side, i, YMIN] = np.inf, np.inf
            out[side, i, XMAX], out[side, i, YMAX] = -np.inf, -np.inf
            out[side, i, MAX_PENDING] = 1.0
    height = np.empty(len(edges))
    edge = np.empty(len(edges), dtype=np.int64)
    for o in range(n):
        first, stop = edge_start[o], edge_start[o + 1]
        convex = circles[o, 2] >= 0.0 or _is_convex(edges, first, stop)
        for i in range(n):
            x, y = rays[i, 0], rays[i, 1]
            box = blockers.box[o]
            if box[0] > x or box[2] < x or box[3] < y:
                continue
            if not convex:
                count = _crossed_edges(x, edges, first, stop, height, edge)
                _add_parts(i, o, rays, blockers, count, height, edge, out)
                _add_corners(i, o, rays, blockers, out)
            elif o != i:
                side = 0 if rays[o, 0] < x or (rays[o, 0] == x and o < i) else 1
                _add_convex(side, i, o, rays, blockers, out)
    for side in range(2):
        for i in range(n):
            if out[side, i, XMIN] < np.inf:
                out[side, i, YMAX] = np.inf
                out[side, i, YMIN] = min(out[side, i, YMIN], rays[i, 1])
                out[side, i, XMIN] = min(out[side, i, XMIN], rays[i, 0])
                out[side, i, XMAX] = max(out[side, i, XMAX], rays[i, 0])
                beyond = out[1, i, XMAX] > rays[i, 0] if side else out[0, i, XMIN] < rays[i, 0]
                if not beyond:
                    # the path stays on one side of the ray, and cannot cross it in one sense twice
                    out[side, i, MAX_PENDING] = 1.0
    return out


@kernel
def _is_convex(edges: Floats, first: int, stop: int) -> bool:
    """Return whether counter-clockwise edges bound a convex polygon."""
    for e in range(first, stop):
        f = e + 1 if e + 1 < stop else first
        ax, ay = edges[e, 2] - edges[e, 0], edges[e, 3] - edges[e, 1]
        bx, by = edges[f, 2] - edges[f, 0], edges[f, 3] - edges[f, 1]
        if ax * by - ay * bx < 0.0:
            return False
    return True


@kernel
def _include(side: int, i: int, x0: float, y0: float, x1: float, y1: float, out: Floats) -> None:
    """Grow the box of a letter so that it holds another box."""
    out[side, i, XMIN], out[side, i, YMIN] = (
        min(out[side, i, XMIN], x0),
        min(out[side, i, YMIN], y0),
    )
    out[side, i, XMAX], out[side, i, YMAX] = (
        max(out[side, i, XMAX], x1),
        max(out[side, i, YMAX], y1),
    )


@kernel
def _add_convex(side: int, i: int, o: int, rays: Floats, blockers: Blockers, out: Floats) -> None:
    """Add the part of a convex obstacle beyond a ray."""
    x, edges, growth = rays[i, 0], blockers.edges, blockers.grow[o]
    box = blockers.box[o]
    if blockers.circles[o, 2] >= 0.0:
        # no part of a disk beyond a chord lies below the chord
        low, high = (x, box[2]) if side == 0 else (box[0], x)
        _include(side, i, low, rays[i, 1], high, box[3], out)
        return
    for e in range(blockers.edge_start[o], blockers.edge_start[o + 1]):
        vx, vy = edges[e, 0], edges[e, 1]
        if side == 0 and vx + growth >= x:
            _include(side, i, x, vy - growth, vx + growth, vy + growth, out)
        if side == 1 and vx - growth <= x:
            _include(side, i, vx - growth, vy - growth, x, vy + growth, out)


@kernel
def _crossed_edges(
    x: float, edges: Floats, first: int, stop: int, height: Floats, edge: Ints
) -> int:
    """Write the edges that cross a vertical line, from below, and their heights there; return how
    many."""
    count = int(np.int64(0))  # no literal: callees are compiled once
    for e in range(first, stop):
        if (edges[e, 0] >= x) == (edges[e, 2] >= x):
            continue
        at = _height(x, e, edges)
        k = count
        while k > 0 and height[k - 1] > at:
            height[k], edge[k] = height[k - 1], edge[k - 1]
            k -= 1
        height[k], edge[k] = at, e
        count += 1
    return count


@kernel
def _add_parts(
    i: int,
    o: int,
    rays: Floats,
    blockers: Blockers,
    count: int,
    height: Floats,
    edge: Ints,
    out: Floats,
) -> None:
    """Add what each chord of a polygon on a ray cuts off from the polygon's point."""
    edges, growth = blockers.edges, blockers.grow[o]
    first, stop = blockers.edge_start[o], blockers.edge_start[o + 1]
    x, y = rays[i, 0], rays[i, 1]
    for side in range(2):
        out[side, i, MAX_PENDING] = max(out[side, i, MAX_PENDING], 2.0 * (count // 2 + 1))
    for k in range(0, count - 1, 2):
        if height[k] <= y:
            continue
        # counter-clockwise: the boundary enters the right-hand part at the chord's lower end
        enter, leave = edge[k], edge[k + 1]
        rightward = edges[enter, 2] >= x
        if rightward == (edges[leave, 2] >= x):
            # heights of touching edges, confused by rounding: whatever may be cut off
            for e in range(first, stop):
                for side in range(2):
                    _include(
                        side,
                        i,
                        edges[e, 0] - growth,
                        edges[e, 1] - growth,
                        edges[e, 0] + growth,
                        edges[e, 1] + growth,
                        out,
                    )
            continue
        if not rightward:
            enter, leave = leave, enter
        px, py = rays[o, 0], rays[o, 1]
        if px == x and height[k] <= py <= height[k + 1]:
            inside = o > i
        else:
            inside = _in_right_part(px, py, enter, leave, x, edges, first, stop)
        # the part without the point
        side = 1 if inside else 0
        e, last = (leave, enter) if inside else (enter, leave)
        while e != last:
            vx, vy = edges[e, 2], edges[e, 3]
            _include(side, i, vx - growth, vy - growth, vx + growth, vy + growth, out)
            e = e + 1 if e + 1 < stop else first


@kernel
def _in_right_part(
    px: float, py: float, enter: int, leave: int, x: float, edges: Floats, first: int, stop: int
) -> bool:
    """Return whether a point lies in the part of a polygon right of a chord on the line of x, given
    the edges at which the boundary enters and leaves that part."""
    inside = False
    low, high = _height(x, enter, edges), _height(x, leave, edges)
    ax, ay = x, low
    e = enter
    while e != leave:
        bx, by = edges[e, 2], edges[e, 3]
        if (ay > py) != (by > py) and px < ax + (py - ay) / (by - ay) * (bx - ax):
            inside = not inside
        ax, ay = bx, by
        e = e + 1 if e + 1 < stop else first
    if (ay > py) != (high > py) and px < ax + (py - ay) / (high - ay) * (x - ax):
        inside = not inside
    if (high > py) != (low > py) and px < x:
        inside = not inside
    return inside


@kernel
def _height(x: float, e: int, edges: Floats) -> float:
    """Return the height at which an edge crosses a vertical line."""
    ax, ay, bx, by = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
    return float(ay + (x - ax) / (bx - ax) * (by - ay))


@kernel
def _add_corners(i: int, o: int, rays: Floats, blockers: Blockers, out: Floats) -> None:
    """Add the rounded corners that reach across a ray although their vertices lie before it."""
    edges, growth = blockers.edges, blockers.grow[o]
    x, y = rays[i, 0], rays[i, 1]
    for e in range(blockers.edge_start[o], blockers.edge_start[o + 1]):
        vx, vy = edges[e, 0], edges[e, 1]
        if vy + growth < y or vx - growth > x or vx + growth < x:
            continue
        if vx < x:
            _include(0, i, x, vy - growth, vx + growth, vy + growth, out)
        else:
            _include(1, i, vx - growth, vy - growth, x, vy + growth, out)

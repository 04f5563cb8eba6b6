"""Pairs of arcs and points that may see each other, in worlds too large to test all pairs.

The directed tangents that leave an arc in one sense, its *pencil*, sweep the plane outside the disk
once. The pencil is cut into sectors by direction. The horizon of a sector is a distance beyond
which all its tangents are blocked: by a circle, an edge, or a chain of edges that spans the sector.
A pair is ruled out if its common tangent ends beyond the horizon of either pencil. Boxes rule out
many pairs at once, and nearly all pairs are ruled out. The others are tested exactly
(`netsp.roadmap.tangents`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints, Singles
from netsp.base.compiled.dynamic_array import more_int_rows
from netsp.base.compiled.kernel import kernel
from netsp.base.geometry.box_tree import BoxTree, build_box_tree, spatial_order
from netsp.base.geometry.kernels import TWO_PI, Blockers, point_segment_distance
from netsp.roadmap.roadmap_policy import SightPolicy

HORIZON_TOLERANCE = 1e-6
"""Tolerance of horizons: angle, radians, by which a pencil reaches beyond its arc, and share by
which its horizons are put farther. Rounding to single precision is less."""

ARCSINE_RATIO = 1.05
"""Tolerance of arcsines that are not computed: asin(x) is at most this times x for x up to 1/2."""


class Horizons(NamedTuple):
    """Horizons of the pencils of all arcs (2 each, counter-clockwise first) and points.

    Attributes
    ----------
    farthest
        (pencils, sectors) length beyond which no tangent of the sector is free.
    low
        (pencils,) direction in which the first sector begins.
    width
        (pencils,) angle of a sector.
    min_distance_ratio, min_clearance_ratio, max_shift_share
        Those of `SightPolicy`.
    """

    farthest: Singles
    low: Floats
    width: Floats
    min_distance_ratio: float
    min_clearance_ratio: float
    max_shift_share: float


class Targets(NamedTuple):
    """Arcs and points in spatial order, with a tree over the boxes of their disks.

    Attributes
    ----------
    last
        Largest number in each subtree.
    """

    order: Ints
    tree: BoxTree
    last: Ints


def build_targets(place: Floats) -> Targets:
    """Return the targets of arcs and points (n, 5), numbered by row."""
    r = place[:, 2:3]
    boxes = np.hstack([place[:, :2] - r, place[:, :2] + r])
    order = spatial_order(boxes)
    tree = build_box_tree(boxes[order])
    last = np.zeros(len(tree.skip), dtype=np.int64)
    leaf = tree.skip == np.arange(len(last)) + 1
    for k in range(len(last) - 1, -1, -1):
        if leaf[k]:
            last[k] = order[tree.first[k] : tree.stop[k]].max()
        else:
            last[k] = max(last[k + 1], last[tree.skip[k + 1]])
    return Targets(order, tree, last)


def empty_horizons(place: Floats, arc_count: int, full: Bools, policy: SightPolicy) -> Horizons:
    """Return horizons at infinity."""
    start, span = np.zeros(len(place)), np.full(len(place), TWO_PI)
    part = np.flatnonzero(~full)
    start[part] = place[part, 3]
    span[part] = place[part, 4] - place[part, 3]
    whole = span + 2.0 * HORIZON_TOLERANCE >= TWO_PI
    start, span = (
        np.where(whole, 0.0, start - HORIZON_TOLERANCE),
        np.where(whole, TWO_PI, span + 2.0 * HORIZON_TOLERANCE),
    )
    turned = np.column_stack([start + 0.5 * math.pi, start - 0.5 * math.pi])
    low = np.concatenate([turned[:arc_count].ravel(), start[arc_count:]])
    width = np.concatenate([np.repeat(span[:arc_count], 2), span[arc_count:]]) / policy.sectors
    return Horizons(
        np.full((len(low), policy.sectors), np.inf, dtype=np.float32),
        low,
        width,
        policy.min_distance_ratio,
        policy.min_clearance_ratio,
        policy.max_shift_share,
    )


@kernel
def _lower_sectors(begin: float, angle: float, far: float, pencil: int, horizons: Horizons) -> None:
    """Lower the horizon of all sectors wholly within an angle to a length. The angle begins at
    `begin` after the first sector."""
    farthest, width = horizons.farthest, horizons.width[pencil]
    sectors = farthest.shape[1]
    far *= 1.0 + HORIZON_TOLERANCE
    begin %= TWO_PI
    end = begin + angle
    for k in range(math.ceil(begin / width), min(sectors, math.floor(end / width))):
        farthest[pencil, k] = min(farthest[pencil, k], far)
    # the angle may reach once round
    for k in range(min(sectors, math.floor((end - TWO_PI) / width))):
        farthest[pencil, k] = min(farthest[pencil, k], far)


@kernel
def _is_hidden(begin: float, angle: float, near: float, pencil: int, horizons: Horizons) -> bool:
    """Return whether the horizon of all sectors that meet an angle is nearer than a length."""
    farthest, width = horizons.farthest, horizons.width[pencil]
    sectors = farthest.shape[1]
    begin %= TWO_PI
    end = begin + angle
    for k in range(math.floor(begin / width), min(sectors, math.floor(end / width) + 1)):
        if farthest[pencil, k] >= near:
            return False
    if end >= TWO_PI:
        for k in range(min(sectors, math.floor((end - TWO_PI) / width) + 1)):
            if farthest[pencil, k] >= near:
                return False
    return True


@kernel
def _lower_horizons(
    cx: float,
    cy: float,
    offset: float,
    p: Floats,
    q: Floats,
    radius: float,
    far: float,
    pencil: int,
    horizons: Horizons,
) -> None:
    """Lower horizons to what a connected set blocks.

    The set holds the disks of a radius about p and q, and stays clear of the pencil's own disk.

    Parameters
    ----------
    offset
        Radius of the pencil's disk times its sense.
    far
        Longest tangent to the set.
    """
    width = horizons.width[pencil]
    ux, uy, vx, vy = p[0] - cx, p[1] - cy, q[0] - cx, q[1] - cy
    a, b = math.hypot(ux, uy), math.hypot(vx, vy)
    near = min(a, b)
    cross, dot = ux * vy - uy * vx, ux * vx + uy * vy
    is_slim = abs(offset) + radius < horizons.max_shift_share * width * near
    if is_slim and dot > 0.0 and abs(cross) < 0.5 * width * a * b:
        return  # most edges subtend less than a sector
    first = math.atan2(uy, ux)
    # the set subtends less than half a turn
    turn = math.atan2(cross, dot)
    if is_slim:
        shift = ARCSINE_RATIO * abs(offset) / near
        begin = first + min(turn, 0.0) + shift
        end = first + max(turn, 0.0) - shift
    else:
        begin = first + min(
            -math.asin((radius - offset) / a), turn - math.asin((radius - offset) / b)
        )
        end = first + max(math.asin((radius + offset) / a), turn + math.asin((radius + offset) / b))
    if end - begin >= width:
        _lower_sectors(begin - horizons.low[pencil], end - begin, far, pencil, horizons)


@kernel
def find_horizons(
    place: Floats,
    a_count: int,
    blockers: Blockers,
    horizons: Horizons,
    begin: int,
    end: int,
    stop: Ints,
) -> None:
    """Lower the horizons of pencils `begin` to `end` - 1 to what blocks them. Some stay too far
    when the flag of a clock is set."""
    min_clearance_ratio = horizons.min_clearance_ratio
    box, skip = blockers.tree.box, blockers.tree.skip
    tree_first, tree_stop, part = blockers.tree.first, blockers.tree.stop, blockers.part
    edges, circles, grow, eps = blockers.edges, blockers.circles, blockers.grow, blockers.eps
    stack = np.empty(256, dtype=np.int64)
    for pencil in range(begin, end if len(skip) else begin):
        if stop[0] != 0:
            break
        i = pencil // 2 if pencil < 2 * a_count else pencil - a_count
        cx, cy, r = place[i, 0], place[i, 1], place[i, 2]
        offset = r if pencil % 2 == 0 else -r
        low, width = horizons.low[pencil], horizons.width[pencil]
        stack[0] = 0
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            near = _box_distance(cx, cy, box, node)
            if near > 2.0 * r:
                away, angle = _subtended(cx, cy, box, node)
                shift = ARCSINE_RATIO * r / near
                if angle + 2.0 * shift < width:
                    continue
                away -= low + shift
                if _is_hidden(away, angle + 2.0 * shift, near, pencil, horizons):
                    continue
                first, last = tree_first[node], tree_stop[node] - 1
                o, e = part[first, 0], part[first, 1]
                if e >= 0 and part[last, 0] == o:
                    far = math.hypot(
                        max(box[node, 2] - cx, cx - box[node, 0]),
                        max(box[node, 3] - cy, cy - box[node, 1]),
                    )
                    _lower_horizons(
                        cx,
                        cy,
                        offset,
                        edges[e, :2],
                        edges[part[last, 1], 2:],
                        grow[o] - 2.0 * eps,
                        far,
                        pencil,
                        horizons,
                    )
            if skip[node] > node + 1:
                one, other = node + 1, skip[node + 1]
                if _box_distance(cx, cy, box, one) < _box_distance(cx, cy, box, other):
                    one, other = other, one
                stack[top], stack[top + 1] = one, other
                top += 2
                continue
            for k in range(tree_first[node], tree_stop[node]):
                o, e = part[k, 0], part[k, 1]
                if e < 0:
                    d = math.hypot(circles[o, 0] - cx, circles[o, 1] - cy)
                    radius = circles[o, 2] - 2.0 * eps
                    if radius > 0.0 and d > min_clearance_ratio * (r + radius):
                        _lower_horizons(
                            cx,
                            cy,
                            offset,
                            circles[o, :2],
                            circles[o, :2],
                            radius,
                            d,
                            pencil,
                            horizons,
                        )
                    continue
                radius = grow[o] - 2.0 * eps
                ux, uy = edges[e, 0] - cx, edges[e, 1] - cy
                vx, vy = edges[e, 2] - cx, edges[e, 3] - cy
                far = math.hypot(max(abs(ux), abs(vx)), max(abs(uy), abs(vy)))
                if (abs(ux * vy - uy * vx) + radius * far) < 0.2 * width * (ux * vx + uy * vy):
                    continue  # most edges subtend less than a sector
                d = point_segment_distance(
                    cx, cy, edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
                )
                if d > min_clearance_ratio * (r + radius):
                    far = max(math.hypot(ux, uy), math.hypot(vx, vy))
                    _lower_horizons(
                        cx, cy, offset, edges[e, :2], edges[e, 2:], radius, far, pencil, horizons
                    )


@kernel
def _box_distance(cx: float, cy: float, box: Floats, k: int) -> float:
    """Return the distance from a point to a box; 0 inside."""
    dx = max(box[k, 0] - cx, cx - box[k, 2], 0.0)
    dy = max(box[k, 1] - cy, cy - box[k, 3], 0.0)
    return math.hypot(dx, dy)


@kernel
def _subtended(cx: float, cy: float, box: Floats, k: int) -> tuple[float, float]:
    """Return the direction in which a box begins, counter-clockwise, seen from a point outside it,
    and the angle that it subtends."""
    x0, y0, x1, y1 = box[k, 0] - cx, box[k, 1] - cy, box[k, 2] - cx, box[k, 3] - cy
    # corners of the silhouette: begin (ax, ay), end (bx, by)
    ax = x1 if y0 > 0.0 else x0
    bx = x0 if y0 > 0.0 else x1
    ay = y1 if x1 < 0.0 else y0
    by = y0 if x1 < 0.0 else y1
    if y0 <= 0.0 <= y1:
        ax = bx = x0 if x0 > 0.0 else x1
    if x0 <= 0.0 <= x1:
        ay = by = y0 if y0 > 0.0 else y1
    return math.atan2(ay, ax), math.atan2(ax * by - ay * bx, ax * bx + ay * by)


@kernel
def _may_see(direction: float, length: float, pencil: int, horizons: Horizons) -> bool:
    """Return whether the horizon of a pencil is no nearer than a length in some direction."""
    width = horizons.width[pencil]
    k = math.floor(((direction - horizons.low[pencil]) % TWO_PI) / width)
    sectors = horizons.farthest.shape[1]
    if k >= sectors:
        # rounding may put the first direction last
        whole = abs(width * sectors - TWO_PI) < HORIZON_TOLERANCE
        return bool(whole and horizons.farthest[pencil, 0] >= length)
    return bool(horizons.farthest[pencil, k] >= length)


@kernel
def pairs_in_sight(
    place: Floats,
    a_count: int,
    targets: Targets,
    horizons: Horizons,
    begin: int,
    end: int,
    stop: Ints,
) -> Ints:
    """Return the pairs (n, 2) of places i < j, i from `begin` to `end` - 1, that horizons do not
    rule out, in no order. Some are missing when the flag of a clock is set."""
    order, last = targets.order, targets.last
    box, skip = targets.tree.box, targets.tree.skip
    tree_first, tree_stop = targets.tree.first, targets.tree.stop
    out = np.empty((1024, 2), dtype=np.int64)
    n = int(np.int64(0))  # no literal: callees are compiled once
    seen = np.full(len(place), -1, dtype=np.int64)
    for i in range(begin, end):
        cx, cy, r = place[i, 0], place[i, 1], place[i, 2]
        for ti in range(1 if i >= a_count else 2):
            if stop[0] != 0:
                break
            pencil = 2 * i + ti if i < a_count else a_count + i
            low = horizons.low[pencil]
            node = int(np.int64(0))
            while node < len(skip):
                if last[node] <= i:
                    node = skip[node]
                    continue
                near = _box_distance(cx, cy, box, node)
                if near > 2.0 * r:
                    away, angle = _subtended(cx, cy, box, node)
                    shift = ARCSINE_RATIO * r / near
                    if _is_hidden(
                        away - low - shift, angle + 2.0 * shift, near - r, pencil, horizons
                    ):
                        node = skip[node]
                        continue
                node += 1
                if skip[node - 1] > node:
                    continue
                for k in range(tree_first[node - 1], tree_stop[node - 1]):
                    j = order[k]
                    if j <= i or seen[j] == i:
                        continue
                    dx, dy, rj = place[j, 0] - cx, place[j, 1] - cy, place[j, 2]
                    d = math.hypot(dx, dy)
                    visible = d <= horizons.min_distance_ratio * (r + rj)
                    for tj in range(1 if j >= a_count else 2):
                        if visible:
                            break
                        offset = (1 - 2 * tj) * rj - (1 - 2 * ti) * r
                        direction = math.atan2(dy, dx) - math.asin(offset / d)
                        length = math.sqrt(d * d - offset * offset)
                        reverse = 2 * j + 1 - tj if j < a_count else a_count + j
                        visible = _may_see(direction, length, pencil, horizons) and _may_see(
                            direction + math.pi, length, reverse, horizons
                        )
                    if visible:
                        seen[j] = i
                        if n == len(out):
                            out = more_int_rows(out)
                        out[n, 0], out[n, 1] = i, j
                        n += 1
    return out[:n]

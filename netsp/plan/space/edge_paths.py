"""Shortest paths over pieces of the edges of polytopes: a lower bound and its refinement. Compiled.

Nodes are the two ends and pieces of edges. A link from one piece to another costs no more than any
straight segment between them, and is left out if all of these pass through a polytope. So the
shortest path over pieces is no longer than any path around the polytopes (docs/theory, Section 21).

Each piece has a slope κ. A segment from the point at distance t from the middle of its piece counts
κt more, and a segment to that point κt less, which cancels along a path. If κ is the component
along the edge of the direction in which the path bends there, the cost changes little with t, and
pieces may be long.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.base.time_flags import Flag
from netsp.plan.space.inscribed_polytopes import Polytopes

BLOCK_TOLERANCE = 1e-9
"""Tolerance of sight lines, metres: they must pass this deep inside a polytope to be blocked."""

UNKNOWN = -1.0
"""Format of links: one whose cost has not been computed. Costs are not negative."""


class Pieces(NamedTuple):
    """Pieces of edges; the first two are the ends of the path, as points.

    Attributes
    ----------
    begins, ends
        (m, 3) ends of each piece, metres.
    edge
        (m,) number of its edge; -1 and -2 for the ends of the path.
    slope
        (m,) κ, between -1 and 1.
    to_end
        (m,) distance to the end of the path, metres.
    """

    begins: Floats
    ends: Floats
    edge: Ints
    slope: Floats
    to_end: Floats


@kernel
def segments_distance(a: Floats, b: Floats, c: Floats, d: Floats) -> float:
    """Return the least distance of the segments ab and cd, metres."""
    uu, vv, uv, uw, vw = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        u, v, w = b[k] - a[k], d[k] - c[k], a[k] - c[k]
        uu += u * u
        vv += v * v
        uv += u * v
        uw += u * w
        vw += v * w
    det = uu * vv - uv * uv
    best = math.inf
    for start in range(3):
        p = 0.0
        if start == 0:
            if det <= 1e-12 * uu * vv:
                continue
            p = min(1.0, max(0.0, (uv * vw - vv * uw) / det))
        elif start == 2:
            p = 1.0
        q = min(1.0, max(0.0, (vw + uv * p) / vv)) if vv > 0.0 else 0.0
        p = min(1.0, max(0.0, (uv * q - uw) / uu)) if uu > 0.0 else 0.0
        gap = 0.0
        for k in range(3):
            gap += (a[k] - c[k] + p * (b[k] - a[k]) - q * (d[k] - c[k])) ** 2
        best = min(best, gap)
    return math.sqrt(best)


@kernel
def _length(a: Floats, b: Floats) -> float:
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@kernel
def _height(normals: Floats, offsets: Floats, face: int, p: Floats) -> float:
    """Return the distance of a point in front of a face, metres."""
    return float(
        normals[face, 0] * p[0] + normals[face, 1] * p[1] + normals[face, 2] * p[2] - offsets[face]
    )


@kernel
def _sees_both_faces(shapes: Polytopes, pieces: Pieces, i: int, j: int) -> bool:
    """Return whether all points of piece i are in front of both faces at the edge of piece j; a
    shortest path does not bend there then."""
    if j < 2:
        return False
    for k in range(2):
        face = shapes.faces[pieces.edge[j], k]
        for p in (pieces.begins[i], pieces.ends[i]):
            if _height(shapes.normals, shapes.offsets, face, p) <= BLOCK_TOLERANCE:
                return False
    return True


@kernel
def link_cost(pieces: Pieces, i: int, j: int) -> float:
    """Return a lower bound on the cost of all segments from piece i to piece j, metres."""
    a, b, c, d = pieces.begins[i], pieces.ends[i], pieces.begins[j], pieces.ends[j]
    size_i, size_j = _length(a, b), _length(c, d)
    slope_i, slope_j = pieces.slope[i], pieces.slope[j]
    gap = segments_distance(a, b, c, d)
    best = gap - 0.5 * (size_i * abs(slope_i) + size_j * abs(slope_j))
    if size_i == 0.0 and size_j == 0.0:
        return gap
    # alternate between the best points of both pieces, which gives a direction n; then
    # |q - p| >= n·(q - p) bounds the cost at all points
    s, t = 0.0, 0.0
    for turn in range(4):
        nx, ny, nz = _vector(a, b, c, d, s, t)
        norm = math.sqrt(nx * nx + ny * ny + nz * nz)
        if norm > 1e-12:
            nx, ny, nz = nx / norm, ny / norm, nz / norm
            mx, my, mz = _vector(a, b, c, d, 0.0, 0.0)
            value = nx * mx + ny * my + nz * mz
            if size_i > 0.0:
                along = (nx * (b[0] - a[0]) + ny * (b[1] - a[1]) + nz * (b[2] - a[2])) / size_i
                value -= 0.5 * size_i * abs(slope_i - along)
            if size_j > 0.0:
                along = (nx * (d[0] - c[0]) + ny * (d[1] - c[1]) + nz * (d[2] - c[2])) / size_j
                value -= 0.5 * size_j * abs(along - slope_j)
            best = max(best, value)
        if turn == 3:
            break
        if size_i > 0.0:
            s = _best_place(a, b, size_i, c, d, t, -slope_i)
        if size_j > 0.0:
            t = _best_place(c, d, size_j, a, b, s, slope_j)
    return float(max(0.0, best))


@kernel
def _vector(
    a: Floats, b: Floats, c: Floats, d: Floats, s: float, t: float
) -> tuple[float, float, float]:
    """Return the vector from ab to cd between the points at shares s and t from their middles."""
    return (
        (0.5 - t) * c[0] + (0.5 + t) * d[0] - (0.5 - s) * a[0] - (0.5 + s) * b[0],
        (0.5 - t) * c[1] + (0.5 + t) * d[1] - (0.5 - s) * a[1] - (0.5 + s) * b[1],
        (0.5 - t) * c[2] + (0.5 + t) * d[2] - (0.5 - s) * a[2] - (0.5 + s) * b[2],
    )


@kernel
def _best_place(
    a: Floats, b: Floats, size: float, c: Floats, d: Floats, t: float, slope: float
) -> float:
    """Return the share from the middle of ab whose distance from a point of cd, less the slope
    times the position along ab, is least."""
    along, squares = 0.0, 0.0
    for k in range(3):
        v = (0.5 - t) * c[k] + (0.5 + t) * d[k] - 0.5 * (a[k] + b[k])
        along += v * (b[k] - a[k]) / size
        squares += v * v
    away = math.sqrt(max(0.0, squares - along * along))
    place = along + away * slope / math.sqrt(max(1e-6, 1.0 - slope * slope))
    return min(0.5, max(-0.5, place / size))


@kernel
def is_blocked(shapes: Polytopes, a: Floats, b: Floats, c: Floats, d: Floats) -> bool:
    """Return whether all sight lines from segment ab to segment cd pass through one polytope.

    At a share x of their length, all sight lines are in the polytope if their greatest height over
    each face, which is a mean of the greatest heights at both segments, is negative.
    """
    mx, my, mz = 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])
    vx = 0.5 * (c[0] + d[0]) - mx
    vy = 0.5 * (c[1] + d[1]) - my
    vz = 0.5 * (c[2] + d[2]) - mz
    vv = vx * vx + vy * vy + vz * vz
    for n in range(len(shapes.radii)):
        wx = shapes.centres[n, 0] - mx
        wy = shapes.centres[n, 1] - my
        wz = shapes.centres[n, 2] - mz
        x = min(1.0, max(0.0, (wx * vx + wy * vy + wz * vz) / vv)) if vv > 0.0 else 0.0
        squares = (wx - x * vx) ** 2 + (wy - x * vy) ** 2 + (wz - x * vz) ** 2
        if squares >= shapes.radii[n] ** 2:
            continue
        low, high = 0.0, 1.0
        for face in range(shapes.first[n], shapes.first[n + 1]):
            at_i = BLOCK_TOLERANCE + max(
                _height(shapes.normals, shapes.offsets, face, a),
                _height(shapes.normals, shapes.offsets, face, b),
            )
            at_j = BLOCK_TOLERANCE + max(
                _height(shapes.normals, shapes.offsets, face, c),
                _height(shapes.normals, shapes.offsets, face, d),
            )
            if at_i > 0.0 and at_j > 0.0:
                low = 2.0
                break
            if at_i > 0.0:
                low = max(low, at_i / (at_i - at_j))
            elif at_j > 0.0:
                high = min(high, at_i / (at_i - at_j))
            if low > high:
                break
        if low <= high:
            return True
    return False


@kernel
def is_inside(shapes: Polytopes, a: Floats, b: Floats) -> bool:
    """Return whether a segment lies inside of one polytope."""
    for n in range(len(shapes.radii)):
        inside = True
        for face in range(shapes.first[n], shapes.first[n + 1]):
            if (
                _height(shapes.normals, shapes.offsets, face, a) > -BLOCK_TOLERANCE
                or _height(shapes.normals, shapes.offsets, face, b) > -BLOCK_TOLERANCE
            ):
                inside = False
                break
        if inside:
            return True
    return False


@kernel
def shortest_over_pieces(
    shapes: Polytopes, pieces: Pieces, links: Floats, count: int, longest: float, stop: Flag
) -> tuple[float, Ints]:
    """Return the length of the shortest path over pieces and its pieces.

    Parameters
    ----------
    links
        (m, m) known costs of links, filled in where they are needed.
    count
        Number of pieces.
    longest
        Longer paths are not searched for, metres.

    Returns
    -------
    float, ndarray
        At most `longest`, and then no pieces; 0 if the flag `stop` was set.
    """
    far = np.full(count, math.inf)
    before, done = np.full(count, -1), np.zeros(count, dtype=np.bool_)
    # A*: an estimate of the rest that is too low in places, so pieces may come up again
    key = np.full(count, math.inf)
    far[0], key[0] = 0.0, pieces.to_end[0]
    none = np.empty(0, dtype=np.int64)
    while True:
        i = -1
        for j in range(count):
            if not done[j] and far[j] < math.inf and (i < 0 or key[j] < key[i]):
                i = j
        if i < 0:
            return longest, none
        if i == 1:
            break
        if stop[0]:
            return 0.0, none
        done[i] = True
        for j in range(1, count):
            cost = links[i, j]
            if cost != UNKNOWN and far[i] + cost >= far[j]:
                continue
            if cost == UNKNOWN:
                if pieces.edge[i] == pieces.edge[j]:
                    links[i, j] = math.inf
                    continue
                # cheap tests first: most pieces are too far away
                near = far[i] + _cheap_bound(pieces, i, j)
                if near >= far[j] or near + pieces.to_end[j] - _slack(pieces, j) > longest:
                    continue
                if _sees_both_faces(shapes, pieces, i, j) or _sees_both_faces(shapes, pieces, j, i):
                    links[i, j] = math.inf
                    continue
                cost = link_cost(pieces, i, j)
                if far[i] + cost >= far[j]:
                    continue
                if is_blocked(
                    shapes, pieces.begins[i], pieces.ends[i], pieces.begins[j], pieces.ends[j]
                ):
                    cost = math.inf
                links[i, j] = cost
            after = far[i] + cost
            rest = pieces.to_end[j] - _slack(pieces, j)
            if after < far[j] and after + rest <= longest:
                far[j], key[j] = after, after + max(0.0, rest)
                before[j] = i
                done[j] = False
    path, at, size = np.empty(count, dtype=np.int64), 1, 0
    while at >= 0:
        path[size] = at
        size += 1
        at = before[at]
    return min(longest, far[1]), path[:size][::-1].copy()


@kernel
def _slack(pieces: Pieces, j: int) -> float:
    """Return the most by which the length of a path to a point of a piece exceeds its cost,
    metres."""
    return float(0.5 * abs(pieces.slope[j]) * _length(pieces.begins[j], pieces.ends[j]))


@kernel
def _cheap_bound(pieces: Pieces, i: int, j: int) -> float:
    """Return a quick lower bound on the cost of a link, metres."""
    squares = 0.0
    for k in range(3):
        middle_i = pieces.begins[i, k] + pieces.ends[i, k]
        middle_j = pieces.begins[j, k] + pieces.ends[j, k]
        squares += 0.25 * (middle_i - middle_j) ** 2
    sizes = _length(pieces.begins[i], pieces.ends[i]) + _length(pieces.begins[j], pieces.ends[j])
    return max(0.0, math.sqrt(squares) - sizes)


@kernel
def shortest_on_pieces(pieces: Pieces, path: Ints) -> tuple[float, Floats, Floats]:
    """Return the length of the shortest polyline with a corner on each piece of a path.

    Returns
    -------
    float, ndarray, ndarray
        Length, metres; the corners (n, 3); for each corner the component of the direction of the
        polyline along its piece.
    """
    n = len(path)
    corners, slopes = np.empty((n, 3)), np.zeros(n)
    for k in range(n):
        corners[k] = 0.5 * (pieces.begins[path[k]] + pieces.ends[path[k]])
    for _ in range(200):
        moved = 0.0
        for k in range(1, n - 1):
            a, b = pieces.begins[path[k]], pieces.ends[path[k]]
            size = _length(a, b)
            if size == 0.0:
                continue
            x, rx = _along(a, b, size, corners[k - 1])
            y, ry = _along(a, b, size, corners[k + 1])
            t = 0.5 * (x + y) if rx + ry == 0.0 else (x * ry + y * rx) / (rx + ry)
            t = min(1.0, max(0.0, t / size))
            for m in range(3):
                place = a[m] + t * (b[m] - a[m])
                moved = max(moved, abs(place - corners[k, m]))
                corners[k, m] = place
        if moved < 1e-7:
            break
    total = 0.0
    for k in range(1, n):
        total += _length(corners[k - 1], corners[k])
    for k in range(1, n - 1):
        a, b = pieces.begins[path[k]], pieces.ends[path[k]]
        size, count = _length(a, b), 0
        for other in (k - 1, k):
            long = _length(corners[other], corners[other + 1])
            if size > 0.0 and long > 1e-9:
                for m in range(3):
                    step = corners[other + 1, m] - corners[other, m]
                    slopes[k] += (b[m] - a[m]) / size * step / long
                count += 1
        slopes[k] /= max(1, count)
    return total, corners, slopes


@kernel
def _along(a: Floats, b: Floats, size: float, p: Floats) -> tuple[float, float]:
    """Return how far along the line ab the point closest to p is, and its distance from p."""
    along, squares = 0.0, 0.0
    for k in range(3):
        along += (p[k] - a[k]) * (b[k] - a[k]) / size
        squares += (p[k] - a[k]) ** 2
    return along, math.sqrt(max(0.0, squares - along * along))


@kernel
def apart_from_edges(
    begins: Floats, ends: Floats, first: Floats, last: Floats, p: Floats, q: Floats, left_out: int
) -> float:
    """Return the least distance of segment pq from all edges but one and from both ends of the
    path, metres."""
    best = min(segments_distance(p, q, first, first), segments_distance(p, q, last, last))
    for e in range(len(begins)):
        if e != left_out:
            best = min(best, segments_distance(p, q, begins[e], ends[e]))
    return best

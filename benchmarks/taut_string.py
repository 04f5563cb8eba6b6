"""Taut string among solids, by other means than the tether of netsp.

Distances to solids are measured in closed form. The string is shortened across triangles that balls
of free water cover, and by small moves that sweep free water only, so it stays in its class. It may
catch at corners where it should slip, and is too long then: of several, the shortest counts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

CAPSULE, CYLINDER, BOX, TORUS, POST, PRISM, HALF_SPACE = range(7)

WIDTH = 16
"""Numbers of a solid's row: its kind, and up to 15 parameters."""

GRAIN = 0.012
"""Radius of the pieces of a triangle of which only the centre is tested, metres; far below the
thinnest solid."""

MERGED = 1e-3
"""Distance of two nodes below which one of them is left out, metres."""

MAX_NODES = 6000
"""Capacity of a string, nodes."""


@dataclass(frozen=True)
class StringOptions:
    """Options of a string.

    Attributes
    ----------
    dip
        Depth to which the string may cut into a solid between its nodes, metres.
    cut
        Depth to which a segment of nodes that slide along a surface may cut into a solid, metres.
    is_mixed
        Whether nodes slide with twice this depth, too.
    slack
        Depth to which a move of nodes may cut into a solid, metres; far below the thinnest solid,
        and more than the chords of nodes on a curved surface cut into it.
    fine
        Distance between nodes at contacts, metres.
    reach
        Largest move of a node in one sweep, metres.
    slide
        Largest move of a group of nodes along a surface, metres.
    sweeps
        Number of sweeps over the nodes in one round.
    rounds, quick_rounds
        Maximum number of rounds of a relaxation, and of a quick one.
    least, quick_least
        Decrease of the length at which a relaxation ends, and a quick one, metres.
    """

    dip: float = 0.005
    cut: float = 0.01
    is_mixed: bool = False
    slack: float = 0.03
    fine: float = 0.06
    reach: float = 0.08
    slide: float = 0.8
    sweeps: int = 8
    rounds: int = 30
    quick_rounds: int = 8
    least: float = 1e-4
    quick_least: float = 2e-3


def packed(solids: Sequence) -> tuple[np.ndarray, np.ndarray]:
    """Return the solids as rows (n, WIDTH) for the kernels, and the corners of prisms (k, 2)."""
    rows, corners = np.zeros((len(solids), WIDTH)), [np.zeros((0, 2))]
    for row, solid in zip(rows, solids, strict=True):
        s = solid.shape
        name = type(s).__name__
        if name == "Sphere":
            row[:8] = CAPSULE, *s.center, *s.center, s.radius
        elif name in ("Capsule", "Cylinder"):
            row[:8] = CAPSULE if name == "Capsule" else CYLINDER, *s.a, *s.b, s.radius
        elif name == "Box":
            x, y, z = np.radians(s.rotation)
            about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
            about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
            about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
            turn = about_z @ about_y @ about_x
            row[:7] = BOX, *s.center, *(0.5 * np.array(s.size))
            row[7:16] = turn.T.ravel()
        elif name == "Torus":
            axis = np.array(s.axis) / np.linalg.norm(s.axis)
            begin = np.array(s.start or np.eye(3)[np.abs(axis).argmin()], dtype=float)
            begin -= (begin @ axis) * axis
            begin /= np.linalg.norm(begin)
            row[:13] = (TORUS, *s.center, *axis, *begin, s.major_radius, s.minor_radius,
                        math.radians(s.angle))  # fmt: skip
        elif name == "Post":
            row[:4] = POST, *s.center, s.radius
        elif name == "Prism":
            begin = sum(map(len, corners))
            corners.append(np.array(s.polygon))
            row[:4] = PRISM, begin, begin + len(s.polygon), s.grow
        else:
            row[:7] = HALF_SPACE, *s.point, *(np.array(s.normal) / np.linalg.norm(s.normal))
    return rows, np.vstack(corners)


@numba.njit(cache=True)
def _gap(row, corners, x, y, z):
    """Return the signed distance of a point from the surface of one solid."""
    kind = int(row[0])
    if kind == POST:
        return math.hypot(x - row[1], y - row[2]) - row[3]
    if kind == HALF_SPACE:
        return (x - row[1]) * row[4] + (y - row[2]) * row[5] + (z - row[3]) * row[6]
    if kind == PRISM:
        begin, end = int(row[1]), int(row[2])
        best, inside = math.inf, False
        for i in range(begin, end):
            j = i + 1 if i + 1 < end else begin
            ax, ay = corners[i, 0], corners[i, 1]
            ex, ey = corners[j, 0] - ax, corners[j, 1] - ay
            t = ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey)
            t = min(1.0, max(0.0, t))
            best = min(best, math.hypot(x - ax - t * ex, y - ay - t * ey))
            if (ay > y) != (ay + ey > y) and x < ax + (y - ay) / ey * ex:
                inside = not inside
        return (-best if inside else best) - row[3]
    vx, vy, vz = x - row[1], y - row[2], z - row[3]
    if kind in (CAPSULE, CYLINDER):
        ax, ay, az = row[4] - row[1], row[5] - row[2], row[6] - row[3]
        aa = ax * ax + ay * ay + az * az
        t = (vx * ax + vy * ay + vz * az) / aa if aa > 0.0 else 0.0
        if kind == CAPSULE:
            t = min(1.0, max(0.0, t))
            vx, vy, vz = vx - t * ax, vy - t * ay, vz - t * az
            return math.sqrt(vx * vx + vy * vy + vz * vz) - row[7]
        wx, wy, wz = vx - t * ax, vy - t * ay, vz - t * az
        side = math.sqrt(wx * wx + wy * wy + wz * wz) - row[7]
        end = max(-t, t - 1.0) * math.sqrt(aa)
        if side > 0.0 and end > 0.0:
            return math.hypot(side, end)
        return max(side, end)
    if kind == BOX:
        deepest, square = -math.inf, 0.0
        for k in range(3):
            along = vx * row[7 + 3 * k] + vy * row[8 + 3 * k] + vz * row[9 + 3 * k]
            out = abs(along) - row[4 + k]
            deepest = max(deepest, out)
            square += max(0.0, out) ** 2
        return math.sqrt(square) if square > 0.0 else deepest
    # an arc of a circle, in the plane of its axis
    h = vx * row[4] + vy * row[5] + vz * row[6]
    u = vx * row[7] + vy * row[8] + vz * row[9]
    tx = row[5] * row[9] - row[6] * row[8]
    ty = row[6] * row[7] - row[4] * row[9]
    tz = row[4] * row[8] - row[5] * row[7]
    v = vx * tx + vy * ty + vz * tz
    angle = math.atan2(v, u) % (2.0 * math.pi)
    if angle <= row[12]:
        return math.hypot(math.hypot(u, v) - row[10], h) - row[11]
    first = math.sqrt((u - row[10]) ** 2 + v * v + h * h)
    cu, cv = row[10] * math.cos(row[12]), row[10] * math.sin(row[12])
    return min(first, math.sqrt((u - cu) ** 2 + (v - cv) ** 2 + h * h)) - row[11]


@numba.njit(cache=True)
def _room(rows, corners, x, y, z):
    """Return the distance of a point from the nearest solid, negative inside."""
    best = math.inf
    for n in range(len(rows)):
        best = min(best, _gap(rows[n], corners, x, y, z))
    return best


@numba.njit(cache=True)
def rooms(rows, corners, points):
    """Return the distances of points (n, 3) from the nearest solid, negative inside."""
    out = np.empty(len(points))
    for n in range(len(points)):
        out[n] = _room(rows, corners, points[n, 0], points[n, 1], points[n, 2])
    return out


@numba.njit(cache=True)
def _distance(a, b):
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@numba.njit(cache=True)
def _radius(a, b, c, x, y, z):
    """Return the largest distance of the corners of a triangle from a point."""
    best = 0.0
    for v in (a, b, c):
        best = max(best, math.sqrt((v[0] - x) ** 2 + (v[1] - y) ** 2 + (v[2] - z) ** 2))
    return best


@numba.njit(cache=True)
def is_free(rows, corners, a, b, c, dip):
    """Return whether balls of water, which may reach `dip` below the surfaces, cover a triangle. Of
    pieces smaller than `GRAIN`, only the centres are tested."""
    x, y, z = (a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3, (a[2] + b[2] + c[2]) / 3
    radius = _radius(a, b, c, x, y, z)
    near, close = np.empty(len(rows), dtype=np.int64), 0
    for n in range(len(rows)):
        room = _gap(rows[n], corners, x, y, z) + dip
        if room < 0.0:
            return False
        if room < radius:
            near[close] = n
            close += 1
    if close == 0:
        return True
    stack = np.empty((128, 9))
    stack[0, :3], stack[0, 3:6], stack[0, 6:] = a, b, c
    count = 1
    while count:
        count -= 1
        p, q, r = stack[count, :3].copy(), stack[count, 3:6].copy(), stack[count, 6:].copy()
        x, y, z = (p[0] + q[0] + r[0]) / 3, (p[1] + q[1] + r[1]) / 3, (p[2] + q[2] + r[2]) / 3
        radius, room = _radius(p, q, r, x, y, z), math.inf
        for n in range(close):
            room = min(room, _gap(rows[near[n]], corners, x, y, z) + dip)
        if room >= radius:
            continue
        if room < 0.0 or count + 2 > 128:
            return False
        if radius < GRAIN:
            continue
        pq, qr, rp = _distance(p, q), _distance(q, r), _distance(r, p)
        if qr >= pq and qr >= rp:
            p, q, r = q, r, p
        elif rp >= pq:
            p, q, r = r, p, q
        m = 0.5 * (p + q)
        stack[count, :3], stack[count, 3:6], stack[count, 6:] = p, m, r
        stack[count + 1, :3], stack[count + 1, 3:6], stack[count + 1, 6:] = m, q, r
        count += 2
    return True


@numba.njit(cache=True)
def _gradient(rows, corners, p):
    """Return the gradient of the distance at a point, by differences."""
    g, h = np.empty(3), 1e-6
    for k in range(3):
        q = p.copy()
        q[k] += h
        g[k] = _room(rows, corners, q[0], q[1], q[2])
        q[k] -= 2.0 * h
        g[k] = (g[k] - _room(rows, corners, q[0], q[1], q[2])) / (2.0 * h)
    return g


@numba.njit(cache=True)
def _outside(rows, corners, point):
    """Push a point out to the nearest surface, if it is inside; at most a few steps."""
    p = point.copy()
    for _ in range(6):
        d = _room(rows, corners, p[0], p[1], p[2])
        if d >= -1e-6:
            break
        g = _gradient(rows, corners, p)
        norm = math.sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
        if norm == 0.0:
            break
        p = p - (d - 1e-6) / norm * g
    return p


@numba.njit(cache=True)
def _length(nodes, count):
    total = 0.0
    for i in range(count - 1):
        total += _distance(nodes[i], nodes[i + 1])
    return total


@numba.njit(cache=True)
def _shortcut(rows, corners, nodes, count, dip):
    """Leave out nodes where the triangles that this sweeps are free; return how many are left."""
    kept, i = 1, 0
    while i < count - 1:
        j = i + 1
        while j + 1 < count and (
            _distance(nodes[j], nodes[j + 1]) < MERGED
            or is_free(rows, corners, nodes[i], nodes[j], nodes[j + 1], dip)
        ):
            j += 1
        nodes[kept] = nodes[j]
        kept += 1
        i = j
    return kept


@numba.njit(cache=True)
def _refined(rows, corners, nodes, count, fine):
    """Return a string with more nodes: near the ends of a segment, their distances grow from `fine`
    by factors of two."""
    out, n = np.empty((20 * count + 20, 3)), 1
    out[0] = nodes[0]
    for i in range(count - 1):
        a, c = nodes[i], nodes[i + 1]
        far = _distance(a, c)
        steps, s, gap = [0.0], fine, fine
        while s < 0.5 * far - 0.25 * gap and len(steps) < 9:
            steps.append(s / far)
            gap *= 2.0
            s += gap
        for k in range(1, len(steps)):
            out[n] = _outside(rows, corners, a + steps[k] * (c - a))
            n += 1
        for k in range(len(steps) - 1, 0, -1):
            out[n] = _outside(rows, corners, c + steps[k] * (a - c))
            n += 1
        out[n] = c
        n += 1
    return out, n


@numba.njit(cache=True)
def _smooth(rows, corners, nodes, count, sweeps, reach, cut, slack):
    """Move nodes, one by one, towards the lines between their neighbours and out of solids, by at
    most `reach`, if this shortens the string and sweeps free water only."""
    for sweep in range(sweeps):
        for step in range(1, count - 1):
            i = step if sweep % 2 == 0 else count - 1 - step
            a, b, c = nodes[i - 1], nodes[i].copy(), nodes[i + 1]
            old, ac = _distance(a, b) + _distance(b, c), _distance(a, c)
            if ac < 1e-9:
                continue
            t = min(1.0, max(0.0, np.dot(b - a, c - a) / (ac * ac)))
            way = a + t * (c - a) - b
            far = math.sqrt(np.dot(way, way))
            if far < 1e-7:
                continue
            for factor in (1.6, 1.0, 0.4):
                share = min(factor, factor * reach / far)
                q = _outside(rows, corners, b + share * way)
                if (
                    _room(rows, corners, q[0], q[1], q[2]) >= -1e-3
                    and _distance(a, q) + _distance(q, c) < old - 1e-9
                    and is_free(rows, corners, a, q, 0.5 * (a + q), cut)
                    and is_free(rows, corners, q, c, 0.5 * (q + c), cut)
                    and is_free(rows, corners, a, b, q, slack)
                    and is_free(rows, corners, b, q, c, slack)
                ):
                    nodes[i] = q
                    break


@numba.njit(cache=True)
def _along_surfaces(rows, corners, nodes, begin, end, pull, touch):
    """Return the part of a pull that is along the surfaces nearer than `touch` to the nodes from
    `begin` to `end`; two surfaces at most, or else nothing is left."""
    normals, count = np.empty((2, 3)), 0
    for i in range(begin, end + 1):
        if _room(rows, corners, nodes[i, 0], nodes[i, 1], nodes[i, 2]) > touch:
            continue
        normal = _gradient(rows, corners, nodes[i])
        for k in range(count):
            normal -= np.dot(normal, normals[k]) * normals[k]
        size = math.sqrt(np.dot(normal, normal))
        if size > 0.3:
            if count == 2:
                return np.zeros(3)
            normals[count] = normal / size
            count += 1
    out = pull.copy()
    for k in range(count):
        out -= np.dot(out, normals[k]) * normals[k]
    return out


@numba.njit(cache=True)
def _slide(rows, corners, nodes, begin, end, cut, slack, reach):
    """Slide the nodes from `begin` to `end` as a whole where their neighbours pull them, by at most
    `reach`, if this shortens the string and sweeps free water only; return whether it did."""
    pull = np.zeros(3)
    for inner, outer in ((begin, begin - 1), (end, end + 1)):
        far = _distance(nodes[inner], nodes[outer])
        if far > 0.0:
            pull += (nodes[outer] - nodes[inner]) / far
    total = end - begin + 3
    old, new = nodes[begin - 1 : end + 2].copy(), nodes[begin - 1 : end + 2].copy()
    length = _length(old, total)
    for touch in (0.02, 0.12):
        way = _along_surfaces(rows, corners, nodes, begin, end, pull, touch)
        norm, step = math.sqrt(np.dot(way, way)), reach
        while norm >= 1e-3 and step > 0.01:
            for k in range(1, total - 1):
                new[k] = _outside(rows, corners, old[k] + step / norm * way)
            if _length(new, total) < length - 1e-4:
                free = True
                for k in range(total - 1):
                    middle = 0.5 * (new[k] + new[k + 1])
                    free = (
                        free
                        and _room(rows, corners, new[k, 0], new[k, 1], new[k, 2]) >= -1e-3
                        and is_free(rows, corners, new[k], new[k + 1], middle, cut)
                        and is_free(rows, corners, old[k], old[k + 1], new[k + 1], slack)
                        and is_free(rows, corners, old[k], new[k], new[k + 1], slack)
                    )
                if free:
                    nodes[begin - 1 : end + 2] = new
                    return True
            step *= 0.4
    return False


@numba.njit(cache=True)
def _slide_groups(rows, corners, nodes, count, cut, slack, gap, reach):
    """Slide each group of nodes that are nearer to one another than `gap`."""
    begin = 1
    while begin < count - 1:
        end = begin
        while end < count - 2 and _distance(nodes[end], nodes[end + 1]) < gap:
            end += 1
        for _ in range(6):
            if not _slide(rows, corners, nodes, begin, end, cut, slack, reach):
                break
        begin = end + 1


@numba.njit(cache=True)
def _over_corners(rows, corners, nodes, count, cut, slack, reach):
    """Take the string over the corners of boxes that it lies around, if this shortens it and sweeps
    free water only; return the number of its nodes.

    Near a corner the string may lie across three faces. No single node can slide off there: only
    all of them together, past the corner. The nodes nearer to the corner than `reach` go to it.
    """
    for n in range(len(rows)):
        if int(rows[n, 0]) != BOX:
            continue
        for corner in range(8):
            tip = rows[n, 1:4].copy()
            for k in range(3):
                half = rows[n, 4 + k] + 1e-3
                tip += (half if corner >> k & 1 else -half) * rows[n, 7 + 3 * k : 10 + 3 * k]
            begin = 1
            while begin < count - 1 and _distance(nodes[begin], tip) > reach:
                begin += 1
            end = begin
            while end < count - 1 and _distance(nodes[end], tip) <= reach:
                end += 1
            if end - begin < 2:
                continue
            before, after = nodes[begin - 1].copy(), nodes[end].copy()
            length = _distance(before, tip) + _distance(tip, after)
            free = (
                length < _length(nodes[begin - 1 :], end - begin + 2) - 1e-4
                and _room(rows, corners, tip[0], tip[1], tip[2]) >= 0.0
                and is_free(rows, corners, before, tip, 0.5 * (before + tip), cut)
                and is_free(rows, corners, tip, after, 0.5 * (tip + after), cut)
            )
            for k in range(begin - 1, end):
                free = free and is_free(rows, corners, nodes[k], nodes[k + 1], tip, slack)
            if free:
                nodes[begin] = tip
                nodes[begin + 1 : count - end + begin + 1] = nodes[end:count].copy()
                count -= end - begin - 1
    return count


@numba.njit(cache=True)
def _near(rows, corners, nodes, count, room):
    """Return the solids that are nearer than `room` to a node."""
    near = np.zeros(len(rows), dtype=np.bool_)
    for n in range(len(rows)):
        for i in range(count):
            if _gap(rows[n], corners, nodes[i, 0], nodes[i, 1], nodes[i, 2]) < room:
                near[n] = True
                break
    return rows[near]


@numba.njit(cache=True)
def _relaxed(
    rows,
    corners,
    nodes,
    count,
    dip,
    cut,
    is_mixed,
    slack,
    fine,
    reach,
    slide,
    sweeps,
    rounds,
    least,
):
    """Shorten a string in place; return the number of its nodes."""
    count = _shortcut(rows, corners, nodes, count, dip)
    length = _length(nodes, count)
    for n in range(rounds):
        if count == 2:
            break
        for gap in (slide, 3.0 * fine):
            _slide_groups(rows, corners, nodes, count, cut, slack, gap, slide)
            if is_mixed:
                _slide_groups(rows, corners, nodes, count, 2.0 * cut, slack, gap, slide)
        dense, many = _refined(rows, corners, nodes, count, fine)
        # no node moves farther than this
        near = _near(rows, corners, dense, many, (1.0 + sweeps) * reach)
        _smooth(near, corners, dense, many, sweeps, reach, 2.0 * dip, slack)
        if n % 2:
            many = _shortcut(rows, corners, dense, many, dip)
        else:
            dense[:many] = dense[:many][::-1].copy()
            many = _shortcut(rows, corners, dense, many, dip)
            dense[:many] = dense[:many][::-1].copy()
        nodes[:many], count = dense[:many], many
        before, length = length, _length(nodes, count)
        if before - length >= least:
            continue
        # a string that still moves would skip the corner that it comes to rest around
        for near_tip in (slide, 3.0 * fine):
            count = _over_corners(rows, corners, nodes, count, cut, slack, near_tip)
        if length - _length(nodes, count) < least:
            break
        length = _length(nodes, count)
    return count


class TautString:
    """String that is laid along a path and shortened in its class.

    Parameters
    ----------
    points : ndarray, shape (k, 3)
        Line along which it lies at first, metres.
    """

    def __init__(
        self,
        rows: np.ndarray,
        corners: np.ndarray,
        points: np.ndarray,
        options: StringOptions = StringOptions(),
    ) -> None:
        self.rows, self.corners, self.options = rows, corners, options
        self.nodes = np.zeros((MAX_NODES, 3))
        self.nodes[: len(points)] = points
        self.count = len(points)

    @property
    def length(self) -> float:
        """Length, metres."""
        return float(_length(self.nodes, self.count))

    def relax(self, is_quick: bool = False) -> None:
        """Shorten the string."""
        o = self.options
        self.count = _relaxed(
            self.rows, self.corners, self.nodes, self.count, o.dip, o.cut, o.is_mixed, o.slack,
            o.fine, o.reach, o.slide, o.sweeps, o.quick_rounds if is_quick else o.rounds,
            o.quick_least if is_quick else o.least,
        )  # fmt: skip

    def move_end(self, place: np.ndarray) -> None:
        """Move the end in a straight line to a place (3,), and shorten the string there."""
        if np.linalg.norm(place - self.nodes[self.count - 1]) < 1e-9:
            return
        self.nodes[self.count] = place
        self.count += 1
        if self.count > 2:
            tail = self.nodes[self.count - 3 :]
            self.count += _shortcut(self.rows, self.corners, tail, 3, self.options.dip) - 3

    def move_anchor(self, places: np.ndarray) -> None:
        """Move the anchor along a line (k, 3)."""
        for place in places:
            if np.linalg.norm(place - self.nodes[0]) > 1e-9:
                self.nodes[1 : self.count + 1] = self.nodes[: self.count].copy()
                self.nodes[0] = place
                self.count += 1

    def change_scene(self, rows: np.ndarray, corners: np.ndarray) -> float:
        """Take another scene; return the depth of the string in its solids, metres."""
        self.rows, self.corners = rows, corners
        line = [self.nodes[:1]]
        for a, b in itertools.pairwise(self.nodes[: self.count]):
            parts = max(1, math.ceil(np.linalg.norm(b - a) / 0.05))
            line.append(a + np.linspace(0.0, 1.0, parts + 1)[1:, None] * (b - a))
        points = np.vstack(line)
        depth = float(max(0.0, -rooms(rows, corners, points).min()))
        for k in range(1, len(points) - 1):
            points[k] = _outside(rows, corners, points[k])
        self.nodes[: len(points)], self.count = points, len(points)
        self.relax()
        return depth


VARIANTS = (
    StringOptions(),
    StringOptions(cut=0.02),
    StringOptions(is_mixed=True),
    StringOptions(cut=0.02, fine=0.08),
)
"""Options of the strings of a bundle."""


class StringBundle:
    """Strings of one class that are shortened in different ways; the shortest of them counts.

    A string may catch at a corner where it should slip, and is then too long. It takes the place of
    the shortest one when it is longer by more than `max_excess`.

    Parameters
    ----------
    points : ndarray, shape (k, 3)
        Line along which the strings lie at first, metres.
    max_excess : float
        Largest excess over the shortest string, metres.
    """

    def __init__(
        self, rows: np.ndarray, corners: np.ndarray, points: np.ndarray, max_excess: float = 0.02
    ) -> None:
        self.strings = [TautString(rows, corners, points, options) for options in VARIANTS]
        self.max_excess = max_excess

    @property
    def length(self) -> float:
        """Length of the shortest string, metres."""
        return min(string.length for string in self.strings)

    @property
    def end(self) -> np.ndarray:
        """End (3,), metres."""
        first = self.strings[0]
        return first.nodes[first.count - 1].copy()

    def relax(self, is_quick: bool = False, enough: float = -math.inf) -> None:
        """Shorten the first string, and the others if it stays longer than `enough`, metres."""
        self.strings[0].relax(is_quick)
        if self.strings[0].length <= enough:
            return
        for string in self.strings[1:]:
            string.relax(is_quick)
        best = min(self.strings, key=lambda string: string.length)
        for string in self.strings:
            if string.length > best.length + self.max_excess:
                string.nodes[: best.count], string.count = best.nodes[: best.count], best.count

    def move_end(self, place: np.ndarray) -> None:
        """See `TautString`."""
        for string in self.strings:
            string.move_end(place)

    def move_anchor(self, places: np.ndarray) -> None:
        """See `TautString`."""
        for string in self.strings:
            string.move_anchor(places)

    def change_scene(self, rows: np.ndarray, corners: np.ndarray) -> float:
        """See `TautString`; return the depth of the shortest string."""
        best = min(self.strings, key=lambda string: string.length)
        return [s.change_scene(rows, corners) for s in self.strings][self.strings.index(best)]


def main() -> None:
    """Compare strings about a post with their closed form: two tangents and a helix."""
    from netsp.world import Scene

    radius, far = 0.5, 3.0
    solids = packed(Scene(solids=[{"post": {"center": [0, 0], "radius": radius}}]).all_solids())
    tangent, worst = math.sqrt(far**2 - radius**2), 0.0
    for turns in (0.5, 1.5, 2.5):
        for rise in (0.0, 1.0, 5.0):
            begin = np.array([-far, 0.0, 0.0])
            string = TautString(*solids, np.array([begin, begin]))
            angles = np.linspace(0.0, 2.0 * math.pi * turns, int(200 * turns))
            for n, angle in enumerate(angles):
                x, y = -far * math.cos(angle), far * math.sin(angle)
                string.move_end(np.array([x, y, rise * n / (len(angles) - 1)]))
                if n % 10 == 0:
                    string.relax(is_quick=True)
            string.relax()
            arc = radius * (2.0 * math.pi * turns - 2.0 * math.acos(radius / far))
            exact = math.hypot(2.0 * tangent + arc, rise)
            worst = max(worst, abs(string.length / exact - 1.0))
            print(f"{turns:g} turns, {rise:g} m up: {string.length:.4f} m, exact {exact:.4f}")
    print(f"worst {100 * worst:.2f} %")


if __name__ == "__main__":
    main()

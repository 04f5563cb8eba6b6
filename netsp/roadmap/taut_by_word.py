"""Taut path of a word without a search: a string among slits, pulled over the obstacles.

The class of a path determines on which side it passes each obstacle, and so the string among slits
(`netsp.roadmap.slits`), which is of the same class. The bends of the string give obstacles and
senses, which become directed arcs of the tangent graph. Then, from the start on:

- where the tangent between two consecutive arcs is blocked, the arc that stands out farthest is
  inserted between them, on the side on which the string passes its representative point;
- where a path would slide backwards on an arc, the arc is removed.

This is a funnel (Lee and Preparata 1984) with arcs for corners. The procedure may fail, because the
path may sweep over obstacles or enter a bay, so its result is verified. A path of tangents that
slides forwards on every arc is taut, a class has one taut path, and the letters of the graph give
its word (docs/theory, Proposition 16). If the verification fails, a search finds the path
(`netsp.roadmap.explore`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.base.geometry.kernels import TWO_PI, enters_polygon
from netsp.roadmap.arcs import (
    AFTER_ARRIVAL,
    AFTER_EDGES,
    AFTER_LETTERS,
    AFTER_SEGMENT,
    ALONG,
    ARRIVAL,
    ARRIVES,
    BEGIN,
    CX,
    CY,
    END,
    FIRST,
    FIRST_EDGE,
    GAPS,
    GROWTH,
    LEAVES,
    LENGTH,
    LETTERS,
    MIDDLE_X,
    MIDDLE_Y,
    OWNER,
    RADIUS,
    RANK,
    RAY_X,
    RAY_Y,
    ROUND,
    SEGMENT,
    TURN,
    XMAX,
    XMIN,
    YMAX,
    YMIN,
    Arcs,
    find_tangent,
)
from netsp.roadmap.slits import (
    HIGH,
    LINE,
    LOW,
    Ends,
    Slits,
    Workspace,
    empty_workspace,
    max_word_length,
    string,
)
from netsp.roadmap.tangents import ANGLE_TOLERANCE

SAME_ANGLE = 1e-6
"""Tolerance of angles on an arc that count as one, radians."""

SLIT_LINE_TOLERANCE = 1e-9
"""Tolerance of a string that runs along the line of a slit: it is moved off the line by this share
of its length."""

TOUCH_TOLERANCE = 1e-9
"""Tolerance of a segment that touches a circle, as a share of the radius."""

NOT_PULLED = -1.0
"""Sentinel: the length of a path that was not found."""

ARRIVING, LEAVING, X_IN, Y_IN, X_OUT, Y_OUT, STRIP, SLID = range(8)
"""Columns of the floats of a path's node: angles on its arc where the string first and last bends
(arrival and departure are less than half a turn from them, so that whole turns are counted); where
the string is then; the strip that it comes from; and the angle slid before the departure."""

NODE, EDGE = range(2)
"""Columns of the integers of a path's node: directed arc or point, and departure."""


class Path(NamedTuple):
    """Path that is being pulled taut.

    Attributes
    ----------
    floats, ints
        (k, 8) and (k, 2) columns ARRIVING … and NODE ….
    word
        (w,) letters written, reduced as they come, from index 1 on.
    """

    floats: Floats
    ints: Ints
    word: Ints


@kernel
def empty_path(longest: int, max_bends: int) -> Path:
    """Return a path of up to `max_bends` nodes for words of up to twice `longest` letters."""
    return Path(
        np.empty((max_bends, 8)),
        np.empty((max_bends, 2), dtype=np.int64),
        np.empty(2 * longest + 64, dtype=np.int64),
    )


def path_from_pieces(a: int, pieces: Sequence[tuple[int, float]], target: Ints, arcs: Arcs) -> Path:
    """Return a path from point a that was found by a search.

    Parameters
    ----------
    pieces
        Departures, and the angle slid before each.
    target
        (e,) node at which each departure ends.
    """
    path = Path(
        np.zeros((len(pieces) + 1, 8)),
        np.zeros((len(pieces) + 1, 2), dtype=np.int64),
        np.zeros(0, dtype=np.int64),
    )
    path.ints[0, NODE] = arcs.points + a
    for k, (e, slid) in enumerate(pieces):
        path.ints[k, EDGE], path.floats[k, SLID] = e, slid
        path.ints[k + 1, NODE] = target[e]
    return path


@kernel
def pull(
    u: int, v: int, ends: Ends, point: Ints, slits: Slits, arcs: Arcs, room: Workspace, path: Path
) -> tuple[float, float, int]:
    """Pull the path from u to v of the word inverse(word of u) times (word of v) taut.

    Parameters
    ----------
    point
        (V,) number of the point at which each end is.

    Returns
    -------
    tuple
        Length, `NOT_PULLED` if it was not found; length among slits; number of tangents. The
        tangents, and the angles slid before them, are in `path`.
    """
    low, bends = string(u, v, ends, slits, room)
    count = _initial_arcs(u, v, bends, ends, point, slits, arcs, room, path)
    count = _tighten(count, arcs, path)
    length = _verified_length(u, v, count, ends, arcs, path)
    return length, low, count - 1


@kernel
def pull_each(
    us: Ints, vs: Ints, ends: Ends, point: Ints, slits: Slits, arcs: Arcs, out: Floats
) -> None:
    """Write the lengths of (k,) taut paths, as `pull` returns them, into `out`."""
    longest = max_word_length(ends.row)
    room, path = empty_workspace(longest, slits), empty_path(longest, arcs.max_bends)
    for k in range(len(us)):
        out[k], _, _ = pull(us[k], vs[k], ends, point, slits, arcs, room, path)


@kernel
def pull_one(ends: Ends, point: Ints, slits: Slits, arcs: Arcs) -> tuple[float, Ints, Floats]:
    """Return the length, as `pull` does, of the taut path between two ends, with its departures and
    the angles slid before them."""
    longest = max_word_length(ends.row)
    path = empty_path(longest, arcs.max_bends)
    length, _, count = pull(0, 1, ends, point, slits, arcs, empty_workspace(longest, slits), path)
    return length, path.ints[:count, EDGE].copy(), path.floats[:count, SLID].copy()


@kernel
def _tighten(count: int, arcs: Arcs, path: Path) -> int:
    """Pull a path taut and return its number of nodes; 0 if that is not possible."""
    disk, edge_floats, table = arcs.disk, arcs.edge_floats, arcs.table
    floats, ints = path.floats, path.ints
    nodes = len(disk)
    floats[0, SLID] = 0.0
    i, left = 0, 16 + 8 * count
    while i + 1 < count:
        left -= 1
        if left < 0 or count + 1 >= len(floats):
            return 0
        a, b = ints[i, NODE], ints[i + 1, NODE]
        if a == b:
            # on along the arc, from where it was left to where it was met again
            sense = 1.0 - 2.0 * (a % 2)
            on_by = sense * (floats[i + 1, ARRIVING] - floats[i, LEAVING])
            turns = math.floor((on_by + arcs.max_backward_turn) / TWO_PI)
            floats[i, LEAVING] = floats[i + 1, LEAVING] - sense * turns * TWO_PI
            floats[i, X_OUT], floats[i, Y_OUT] = floats[i + 1, X_OUT], floats[i + 1, Y_OUT]
            _delete_node(i + 1, count, floats, ints)
            count -= 1
            continue
        e = find_tangent(a * nodes + b, table)
        if e < 0:
            new, angle = _arc_between(a, b, i, arcs, floats)
            if new < 0 or new in (a, b):
                return 0
            for k in range(count, i + 1, -1):
                _copy_node(k - 1, k, floats, ints)
            ints[i + 1, NODE], floats[i + 1, ARRIVING], floats[i + 1, LEAVING] = new, angle, angle
            _set_position(
                i + 1,
                disk[new, CX] + disk[new, RADIUS] * math.cos(angle),
                disk[new, CY] + disk[new, RADIUS] * math.sin(angle),
                floats[i, STRIP],
                floats,
            )
            count += 1
            continue
        if i > 0:
            arrival = _unwrapped(edge_floats[ints[i - 1, EDGE], ARRIVES], floats[i, ARRIVING])
            departure = _unwrapped(edge_floats[e, LEAVES], floats[i, LEAVING])
            by = departure - arrival if a % 2 == 0 else arrival - departure
            if by < -SAME_ANGLE:
                _delete_node(i, count, floats, ints)
                count -= 1
                i -= 1
                continue
            floats[i, SLID] = by
        ints[i, EDGE] = e
        i += 1
    return count


@kernel
def _delete_node(i: int, count: int, floats: Floats, ints: Ints) -> None:
    """Delete node i."""
    for k in range(i, count - 1):
        _copy_node(k + 1, k, floats, ints)


@kernel
def _copy_node(k: int, to: int, floats: Floats, ints: Ints) -> None:
    ints[to, NODE] = ints[k, NODE]
    for c in range(SLID):
        floats[to, c] = floats[k, c]


@kernel
def _set_position(i: int, x: float, y: float, strip: float, floats: Floats) -> None:
    floats[i, X_IN], floats[i, Y_IN], floats[i, X_OUT], floats[i, Y_OUT], floats[i, STRIP] = (
        x,
        y,
        x,
        y,
        strip,
    )


@kernel
def _unwrapped(angle: float, to: float) -> float:
    """Return the angle plus whole turns, within half a turn of another angle."""
    return angle - TWO_PI * math.floor((angle - to + math.pi) / TWO_PI)


@kernel
def _contact_angle(node: int, ux: float, uy: float) -> float:
    """Return the angle on a directed arc at which a line along (ux, uy) touches it."""
    return math.atan2(-ux, uy) if node % 2 == 0 else math.atan2(ux, -uy)


@kernel
def _initial_arcs(
    u: int,
    v: int,
    bends: int,
    ends: Ends,
    point: Ints,
    slits: Slits,
    arcs: Arcs,
    room: Workspace,
    path: Path,
) -> int:
    """Write the directed arcs that the bends of a string name, between its two ends, into a path.
    Return the number of nodes; 0 if an arc is not known."""
    place, cell, obstacle, line_x = ends.place, ends.cell, slits.obstacle, slits.x
    gate, corner = room.gate, room.corner
    numbers, row, disk = arcs.numbers, arcs.row, arcs.disk
    floats, ints = path.floats, path.ints
    if bends and gate[corner[bends - 1, 0], LOW] == gate[corner[bends - 1, 0], HIGH]:
        bends -= 1  # the last gate is the end of the path
    ints[0, NODE] = arcs.points + point[u]
    x, y = place[u, 0], place[u, 1]
    _set_position(0, x, y, float(cell[u]), floats)
    count = 1
    before = -1
    for c in range(bends):
        k, high = corner[c, 0], corner[c, 1]
        rightward = gate[k, LINE] > 0.0
        line = int(abs(gate[k, LINE])) - 1
        o = obstacle[line]
        ccw = rightward == (high == 1)
        if row[o + 1] == row[o]:
            return 0
        new = 2 * numbers[row[o]] + (0 if ccw else 1)
        here_x, here_y = line_x[line], gate[k, LOW + high]
        if disk[new, END] == np.inf:
            if new == before:  # on, to the other end of the slit
                floats[count - 1, LEAVING] += math.pi if ccw else -math.pi
                floats[count - 1, X_OUT], floats[count - 1, Y_OUT] = here_x, here_y
                x, y = here_x, here_y
                continue
            angle = -0.5 * math.pi if high == 1 else 0.5 * math.pi
        else:
            # what stands out from a line past it
            to_x, to_y = place[v, 0], place[v, 1]
            if c + 1 < bends:
                k_next = corner[c + 1, 0]
                to_x = line_x[int(abs(gate[k_next, LINE])) - 1]
                to_y = gate[k_next, LOW + corner[c + 1, 1]]
            far = math.hypot(to_x - x, to_y - y)
            ux, uy = 1.0 if rightward else -1.0, 0.0
            if far > 0.0:
                ux, uy = (to_x - x) / far, (to_y - y) / far
            new, _ = _farthest_arc(o, not ccw, x, y, ux, uy, -1, -1, numbers, row, disk)
            angle = _contact_angle(new, ux, uy)
        ints[count, NODE], floats[count, ARRIVING], floats[count, LEAVING] = new, angle, angle
        _set_position(count, here_x, here_y, line + (0.0 if rightward else 1.0), floats)
        count += 1
        before = new
        x, y = here_x, here_y
        if count + 2 >= len(floats):
            return 0
    ints[count, NODE] = arcs.points + point[v]
    _set_position(count, place[v, 0], place[v, 1], float(cell[v]), floats)
    return count + 1


@kernel
def _farthest_arc(
    o: int,
    left: bool,
    x: float,
    y: float,
    ux: float,
    uy: float,
    a: int,
    b: int,
    numbers: Ints,
    row: Ints,
    disk: Floats,
) -> tuple[int, float]:
    """Return the directed arc of an obstacle that stands out farthest to one side of a line through
    (x, y) along (ux, uy), and how far; -1 if there is none but those of nodes a and b."""
    side = 1.0 if left else -1.0
    nx, ny = -side * uy, side * ux
    best, farthest = -1, -np.inf
    for k in range(row[o], row[o + 1]):
        n = 2 * numbers[k]
        if n <= a <= n + 1 or n <= b <= n + 1:
            continue
        middle = nx * (disk[n, CX] - x) + ny * (disk[n, CY] - y)
        out = middle + disk[n, RADIUS]
        begin, end = disk[n, BEGIN], disk[n, END]
        if end < np.inf and (math.atan2(ny, nx) - begin) % TWO_PI > end - begin:
            out = middle + disk[n, RADIUS] * max(
                nx * math.cos(begin) + ny * math.sin(begin), nx * math.cos(end) + ny * math.sin(end)
            )
        if out > farthest:
            best, farthest = n + (1 if left else 0), out
    return best, farthest


@kernel
def _arc_between(a: int, b: int, i: int, arcs: Arcs, floats: Floats) -> tuple[int, float]:
    """Return the directed arc that a path has to pass between node a, number i of the path, and the
    next node b, and the angle at which it stands out; -1 if it is not known."""
    disk, span, solid, edges = arcs.disk, arcs.span, arcs.solid, arcs.edges
    numbers, row = arcs.numbers, arcs.row
    ra = 0.0 if span[a, OWNER] < 0 else disk[a, RADIUS] * (1.0 - 2.0 * (a % 2))
    rb = 0.0 if span[b, OWNER] < 0 else disk[b, RADIUS] * (1.0 - 2.0 * (b % 2))
    dx, dy = disk[b, CX] - disk[a, CX], disk[b, CY] - disk[a, CY]
    apart, k = math.hypot(dx, dy), rb - ra
    if apart <= abs(k):
        return -1, 0.0
    length = math.sqrt((apart - abs(k)) * (apart + abs(k)))
    ux, uy = (dx * length + dy * k) / apart**2, (dy * length - dx * k) / apart**2
    px, py = disk[a, CX] + ra * uy, disk[a, CY] - ra * ux
    qx, qy = disk[b, CX] + rb * uy, disk[b, CY] - rb * ux
    x0, x1, y0, y1 = min(px, qx), max(px, qx), min(py, qy), max(py, qy)
    best, farthest = -1, 0.0
    for o in range(len(solid)):
        if x1 < solid[o, XMIN] or x0 > solid[o, XMAX] or y1 < solid[o, YMIN] or y0 > solid[o, YMAX]:
            continue
        if solid[o, ROUND] >= 0.0:
            cx, cy = solid[o, MIDDLE_X] - px, solid[o, MIDDLE_Y] - py
            t = min(max(cx * ux + cy * uy, 0.0), length)
            if (
                math.hypot(cx - t * ux, cy - t * uy)
                >= solid[o, ROUND] - TOUCH_TOLERANCE * solid[o, ROUND]
            ):
                continue
        elif not enters_polygon(
            px,
            py,
            qx,
            qy,
            edges,
            int(solid[o, FIRST_EDGE]),
            int(solid[o, AFTER_EDGES]),
            solid[o, GROWTH],
        ):
            continue
        if span[a, OWNER] == o:
            left = a % 2 == 1
        elif span[b, OWNER] == o:
            left = b % 2 == 1
        else:
            # past the side on which the string has not its representative point; where it runs
            # straight along its line, the strip that it is in tells
            sx, sy = floats[i + 1, X_IN] - floats[i, X_OUT], floats[i + 1, Y_IN] - floats[i, Y_OUT]
            shift = SLIT_LINE_TOLERANCE * (abs(sx) + abs(sy))
            shift = shift if solid[o, RANK] < floats[i + 1, STRIP] else -shift
            rx, ry = solid[o, RAY_X] - floats[i, X_OUT] - shift, solid[o, RAY_Y] - floats[i, Y_OUT]
            left = sx * ry - sy * rx < 0.0
        new, out = _farthest_arc(o, left, px, py, ux, uy, a, b, numbers, row, disk)
        if new >= 0 and out > farthest:
            best, farthest = new, out
    return best, 0.0 if best < 0 else _contact_angle(best, ux, uy)


@kernel
def _verified_length(u: int, v: int, count: int, ends: Ends, arcs: Arcs, path: Path) -> float:
    """Return the length of a path if it is taut and has the word of the leg from u to v; otherwise
    `NOT_PULLED`."""
    letters, row = ends.letters, ends.row
    disk, span, edge_floats, edge_ints, written = (
        arcs.disk,
        arcs.span,
        arcs.edge_floats,
        arcs.edge_ints,
        arcs.letters,
    )
    floats, ints, word = path.floats, path.ints, path.word
    if count < 2:
        return NOT_PULLED
    n, total = 0, 0.0
    for i in range(count - 1):
        e = ints[i, EDGE]
        first, last = edge_ints[e, SEGMENT], edge_ints[e, AFTER_SEGMENT]
        if i > 0:
            arrived, node = ints[i - 1, EDGE], ints[i, NODE]
            f = edge_ints[arrived, FIRST]
            if f < 0:
                return NOT_PULLED
            by = edge_floats[arrived, TURN] + edge_floats[e, ALONG] - edge_floats[f, ALONG]
            turns = round((floats[i, SLID] - by) / TWO_PI)
            by += turns * TWO_PI
            whole_circle = disk[node, END] == np.inf
            if turns < 0 or by < -ANGLE_TOLERANCE:
                return NOT_PULLED
            if (turns and not whole_circle) or (turns == 0 and e < f):
                return NOT_PULLED
            floats[i, SLID] = max(by, 0.0)
            total += disk[node, RADIUS] * floats[i, SLID]
            n = _append_letters(
                edge_ints[arrived, ARRIVAL], edge_ints[arrived, AFTER_ARRIVAL], written, word, n
            )
            begin = edge_ints[f, GAPS]
            for _ in range(turns):
                n = _append_letters(begin, span[node, AFTER_LETTERS], written, word, n)
                begin = span[node, LETTERS]
            n = _append_letters(begin, edge_ints[e, GAPS], written, word, n)
        n = _append_letters(first, last, written, word, n)
        total += edge_floats[e, LENGTH]
        if n < 0:
            return NOT_PULLED
    # inverse(word of u) times (word of v)
    a, a_end, b, b_end = row[u], row[u + 1], row[v], row[v + 1]
    while a < a_end and b < b_end and letters[a] == letters[b]:
        a += 1
        b += 1
    n_inverse, n_after = a_end - a, b_end - b
    same = n == n_inverse + n_after
    if same:
        for k in range(n_inverse):
            same = same and word[1 + k] == -letters[a_end - 1 - k]
        for k in range(n_after):
            same = same and word[1 + n_inverse + k] == letters[b + k]
    return total if same else NOT_PULLED


@kernel
def _append_letters(first: int, last: int, letters: Ints, word: Ints, n: int) -> int:
    """Append letters to a reduced word; return its new length, or -1 if there is no room."""
    for k in range(first, last):
        a = letters[k]
        if n > 0 and word[n] == -a:
            n -= 1
        elif n < 0 or n + 1 >= len(word):
            return -1
        else:
            n += 1
            word[n] = a
    return n

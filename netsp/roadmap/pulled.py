"""The taut path of a word without a search: a string among slits, pulled over the obstacles.

Its class names the strip and the side on which a path passes every obstacle, so the string among
slits (`netsp.roadmap.slits`) is known at once, and has the right class. Its bends name obstacles
and senses; these become directed arcs of the tangent graph, and then, from the start on, wherever

- the tangent between two that follow one another is blocked, what stands out farthest comes
  between them, on the side on which the string passes its representative point;
- a path would have to slide backwards on an arc, the arc is left out.

This is a funnel (Lee and Preparata 1984) with arcs for corners. It proves nothing: what is swept
over may end up on the wrong side, and a bay needs more care. What is proven is the result. A path
of tangents of the graph that slides forwards on every arc is taut, a class holds one taut path
(docs/theory.md), and its word is read off the letters of the graph. What is not so is left to the
search (`netsp.roadmap.explore`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from netsp.arrays import Floats, Ints
from netsp.compiled.kernel import kernel
from netsp.geometry.kernels import TWO_PI, Blockers, enters_obstacle
from netsp.problem import Circle, Problem
from netsp.roadmap.outline import Outline
from netsp.roadmap.slits import HIGH, LINE, LOW, Ends, Room, Slits, room_for, string
from netsp.roadmap.tangents import ANGLE_TOLERANCE, TangentGraph

MOST_NODES = 256
"""Arcs that a path may bend around; longer ones are searched for."""

SAME_ANGLE = 1e-6
"""Radians, between angles that are one."""

ON_LINE = 1e3
"""A string that runs along the line of a slit is taken so many times the tolerance off it."""

NOT_PULLED = -1.0
"""Instead of a length."""

CX, CY, RADIUS, BEGIN, END = range(5)
"""Columns of a disk: a directed arc, or a point of no radius. BEGIN to END are the angles that
show; END is infinite where all do."""

LENGTH, LEAVES, ARRIVES, TURN, ALONG = range(5)
"""Columns of a departure: length, angles at both ends, angle from the arrival to the first
departure there, and from the first departure of its own arc to itself."""

FIRST, SEGMENT, AFTER_SEGMENT, ARRIVAL, AFTER_ARRIVAL, GAPS = range(6)
"""And of these numbers: the first departure at its end, and rows into the letters: of the segment,
of the arc to that departure, and of the arc before itself."""


class Arcs(NamedTuple):
    """The tangent graph as paths are pulled over it.

    Attributes
    ----------
    of, row
        Arcs of each obstacle: of[row[o]] … of[row[o + 1] - 1].
    owner
        (nodes,) an obstacle of each directed arc, -1 for points.
    disk
        (nodes, 5) columns CX … END.
    table
        (slots, 2) hash table of departures by `source * nodes + target`, -1 where empty.
    real, whole
        (e, 5) and (e, 6) columns LENGTH … and FIRST … of the departures.
    span
        (nodes, 3) first departure of each node, and where the letters of its whole arc begin and
        end.
    letters
        Of segments and arcs.
    rays
        (n, 2) representative points.
    blockers
        Obstacles.
    points
        How many nodes are directed arcs; points follow.
    """

    of: Ints
    row: Ints
    owner: Ints
    disk: Floats
    table: Ints
    real: Floats
    whole: Ints
    span: Ints
    letters: Ints
    rays: Floats
    blockers: Blockers
    points: int


class Path(NamedTuple):
    """Where a path is worked out.

    Attributes
    ----------
    node
        (k,) directed arcs between two points.
    facing
        (k, 2) angles on each arc where the string first and last bends: arrival and departure are
        less than half a turn from them, so that whole turns are counted.
    spot
        (k, 5) where the string first and last bends there, and the strip that it comes from.
    edge, slid
        (k,) departures, and the angle slid before each.
    word
        (w,) letters written, reduced as they come; their number first.
    """

    node: Ints
    facing: Floats
    spot: Floats
    edge: Ints
    slid: Floats
    word: Ints


@kernel
def path_for(longest: int) -> Path:
    """For words of at most twice so many letters."""
    return Path(
        np.empty(MOST_NODES, dtype=np.int64), np.empty((MOST_NODES, 2)),
        np.empty((MOST_NODES, 5)), np.empty(MOST_NODES, dtype=np.int64), np.empty(MOST_NODES),
        np.empty(2 * longest + 64, dtype=np.int64),
    )  # fmt: skip


def arcs_of(problem: Problem, outline: Outline, graph: TangentGraph) -> Arcs:
    """What paths are pulled over."""
    arcs, nodes = len(graph.arcs), len(graph.start) - 1
    disk = np.zeros((nodes, 5))
    disk[: 2 * arcs] = np.repeat(graph.arcs, 2, axis=0)
    disk[2 * arcs :, :2] = graph.points
    disk[: 2 * arcs, END][np.repeat(graph.full, 2)] = np.inf
    owner = np.full(nodes, -1, dtype=np.int64)
    of, row = [np.zeros(0, dtype=np.int64)], [0]
    at: dict[tuple[float, ...], list[int]] = {}
    for k, (x, y, r) in enumerate(graph.arcs[:, :3].tolist()):
        at.setdefault((x, y, r), []).append(k)
    for o, obstacle in enumerate(problem.obstacles):
        if isinstance(obstacle, Circle):
            corners, radius = np.array([obstacle.center]), outline.blockers.circles[o, 2]
        else:
            corners, radius = np.array(obstacle.polygon), outline.blockers.grow[o]
        disks = dict.fromkeys((x, y, float(radius)) for x, y in (corners - outline.origin).tolist())
        own = np.array([k for disk in disks for k in at.get(disk, [])], dtype=np.int64)
        owner[2 * own] = owner[2 * own + 1] = o
        of.append(own)
        row.append(row[-1] + len(own))
    source = np.repeat(np.arange(nodes), np.diff(graph.start))
    real = np.column_stack(
        [graph.length, graph.angle, graph.turn, np.zeros(len(source))]
    )  # fmt: skip
    gap_letters, gaps, span = _gap_letters(graph)
    real[:, ALONG] = _along(graph)
    whole = np.column_stack([graph.first, graph.segment_row, graph.arrival_row, gaps])
    table = np.full((1 << max(4, (3 * len(source)).bit_length()), 2), -1, dtype=np.int64)
    _fill(source * nodes + graph.target, table)
    return Arcs(
        np.concatenate(of), np.array(row), owner, disk, table, real, whole, span,
        np.concatenate([graph.letters.astype(np.int64), gap_letters]), graph.rays,
        outline.blockers, 2 * arcs,
    )  # fmt: skip


def _along(graph: TangentGraph) -> Floats:
    """(e,) angle from the first departure of an arc to each."""
    step = np.maximum(graph.gap, 0.0)
    before = np.concatenate([[0.0], np.cumsum(step)])
    first = np.repeat(graph.start[:-1], np.diff(graph.start))
    return np.asarray(before[:-1] - before[first])


def _gap_letters(graph: TangentGraph) -> tuple[Ints, Ints, Ints]:
    """The letters of whole arcs, each in one row, to come after those of the graph; (e,) where in
    them each departure is; and (nodes, 3) as in `Arcs`."""
    count = graph.gap_row[:, 1] - graph.gap_row[:, 0]
    base = len(graph.letters)
    begin = base + np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    letters = [graph.letters[a:b] for a, b in graph.gap_row[count > 0].tolist()]
    span = np.column_stack([graph.start[:-1], begin[graph.start[:-1]], begin[graph.start[1:]]])
    together = np.concatenate([*letters, np.zeros(0)]).astype(np.int64)
    return together, begin[:-1], span.astype(np.int64)


@kernel
def _slot(code: int, slots: int) -> int:
    """Where to look first: Knuth's multiplicative hashing."""
    return int(((code * 0x9E3779B1) >> 7) & (slots - 1))


@kernel
def _fill(code: Ints, table: Ints) -> None:
    slots = len(table)
    for e in range(len(code)):
        slot = _slot(code[e], slots)
        while table[slot, 0] >= 0:
            slot = (slot + 1) & (slots - 1)
        table[slot, 0], table[slot, 1] = code[e], e


@kernel
def _tangent(code: int, table: Ints) -> int:
    """The departure of a code; -1 if there is none."""
    slots = len(table)
    slot = _slot(code, slots)
    while table[slot, 0] >= 0:
        if table[slot, 0] == code:
            return int(table[slot, 1])
        slot = (slot + 1) & (slots - 1)
    return -1


@kernel
def pull(
    u: int, v: int, ends: Ends, point: Ints, slits: Slits, arcs: Arcs, room: Room, path: Path
) -> tuple[float, float, int]:
    """The taut path from u to v of the word inverse(word of u) times (word of v).

    Parameters
    ----------
    point
        (V,) number of the point at which each end is.

    Returns
    -------
    tuple
        Its length, `NOT_PULLED` where it was not found; the length among slits; how many tangents
        it has. These, and the angles slid before them, are in `path`.
    """
    low, bends = string(u, v, ends, slits, room)
    # taken out once: to take an array out of a tuple costs a count of its references
    of, row, owner, disk, table = arcs.of, arcs.row, arcs.owner, arcs.disk, arcs.table
    real, rank, rays = arcs.real, slits.rank, arcs.rays
    node, facing, spot, edge, slid = path.node, path.facing, path.spot, path.edge, path.slid
    nodes = len(disk)
    count = _named(
        u, v, bends, arcs.points + point[u], arcs.points + point[v], ends, slits, of, row, disk,
        room, node, facing, spot,
    )  # fmt: skip
    slid[0] = 0.0
    i, left = 0, 16 + 8 * count
    while i + 1 < count:
        left -= 1
        if left < 0 or count + 1 >= MOST_NODES:
            return NOT_PULLED, low, 0
        a, b = node[i], node[i + 1]
        if a == b:
            facing[i, 1] = _near(facing[i + 1, 1], facing[i, 1])
            spot[i, 2], spot[i, 3] = spot[i + 1, 2], spot[i + 1, 3]
            for k in range(i + 1, count - 1):
                _copy(k + 1, k, node, facing, spot)
            count -= 1
            continue
        e = _tangent(a * nodes + b, table)
        if e < 0:
            new, at = _between(a, b, i, spot, rank, rays, of, row, owner, disk, arcs.blockers)
            if new < 0 or new in (a, b):
                return NOT_PULLED, low, 0
            for k in range(count, i + 1, -1):
                _copy(k - 1, k, node, facing, spot)
            node[i + 1], facing[i + 1, 0], facing[i + 1, 1] = new, at, at
            _note(
                i + 1, disk[new, CX] + disk[new, RADIUS] * math.cos(at),
                disk[new, CY] + disk[new, RADIUS] * math.sin(at), spot[i, 4], spot,
            )  # fmt: skip
            count += 1
            continue
        if i > 0:
            arrival = _near(real[edge[i - 1], ARRIVES], facing[i, 0])
            departure = _near(real[e, LEAVES], facing[i, 1])
            slid[i] = departure - arrival if a % 2 == 0 else arrival - departure
            if slid[i] < -SAME_ANGLE:
                for k in range(i, count - 1):
                    _copy(k + 1, k, node, facing, spot)
                count -= 1
                i -= 1
                continue
        edge[i] = e
        i += 1
    length = _written(
        count - 1, node, edge, slid, real, arcs.whole, arcs.span, arcs.letters, disk, path.word
    )
    if count < 2 or length < 0.0 or not _is_word(u, v, ends.letters, ends.row, path.word):
        return NOT_PULLED, low, 0
    return length, low, count - 1


@kernel
def pull_each(
    us: Ints, vs: Ints, ends: Ends, point: Ints, slits: Slits, arcs: Arcs, out: Floats
) -> None:  # fmt: skip
    """The lengths of (k,) taut paths as of `pull`, into `out`."""
    longest = int(np.int64(0))  # no literal: callees are compiled once
    for v in range(len(ends.cell)):
        longest = max(longest, ends.row[v + 1] - ends.row[v])
    room, path = room_for(longest, slits), path_for(longest)
    for k in range(len(us)):
        out[k], _, _ = pull(us[k], vs[k], ends, point, slits, arcs, room, path)


@kernel
def pull_one(
    ends: Ends, point: Ints, slits: Slits, arcs: Arcs
) -> tuple[float, Ints, Floats]:  # fmt: skip
    """The taut path between two ends: its length as of `pull`, departures and angles slid before
    them."""
    longest = max(ends.row[1] - ends.row[0], ends.row[2] - ends.row[1])
    path = path_for(longest)
    length, _, count = pull(0, 1, ends, point, slits, arcs, room_for(longest, slits), path)
    return length, path.edge[:count].copy(), path.slid[:count].copy()


@kernel
def _named(
    u: int, v: int, bends: int, from_: int, to: int, ends: Ends, slits: Slits, of: Ints, row: Ints,
    disk: Floats, room: Room, node: Ints, facing: Floats, spot: Floats,
) -> int:  # fmt: skip
    """The directed arcs that the bends of a string name, between its two ends; how many, 0 where
    that is not known."""
    gate, corner, place = room.gate, room.corner, ends.place
    obstacle, line_x = slits.obstacle, slits.x
    if bends and gate[corner[bends - 1, 0], LOW] == gate[corner[bends - 1, 0], HIGH]:
        bends -= 1  # that is its end
    node[0] = from_
    _note(0, place[u, 0], place[u, 1], ends.cell[u], spot)
    count = 1
    x, y = place[u, 0], place[u, 1]
    before = -1
    for c in range(bends):
        k, high = corner[c, 0], corner[c, 1]
        rightward = gate[k, LINE] > 0.0
        line = int(abs(gate[k, LINE])) - 1
        o = obstacle[line]
        ccw = rightward == (high == 1)
        if row[o + 1] == row[o]:
            return 0
        new = 2 * of[row[o]] + (0 if ccw else 1)
        here_x, here_y = line_x[line], gate[k, LOW + high]
        if disk[new, END] == np.inf:
            if new == before:  # on, to the other end of the slit
                facing[count - 1, 1] += math.pi if ccw else -math.pi
                spot[count - 1, 2], spot[count - 1, 3] = here_x, here_y
                x, y = here_x, here_y
                continue
            at = -0.5 * math.pi if high == 1 else 0.5 * math.pi
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
            new, _ = _standing_out(o, not ccw, x, y, ux, uy, -1, -1, of, row, disk)
            at = _facing(new, ux, uy)
        node[count], facing[count, 0], facing[count, 1] = new, at, at
        _note(count, here_x, here_y, line + (0.0 if rightward else 1.0), spot)
        count += 1
        before = new
        x, y = here_x, here_y
        if count + 2 >= MOST_NODES:
            return 0
    node[count] = to
    _note(count, place[v, 0], place[v, 1], ends.cell[v], spot)
    return count + 1


@kernel
def _standing_out(
    o: int, left: bool, x: float, y: float, ux: float, uy: float, a: int, b: int, of: Ints,
    row: Ints, disk: Floats,
) -> tuple[int, float]:  # fmt: skip
    """The directed arc of an obstacle that stands out farthest to one side of a line through (x, y)
    along (ux, uy), and how far; -1 if there is none but those of nodes a and b."""
    side = 1.0 if left else -1.0
    nx, ny = -side * uy, side * ux
    best, farthest = -1, -np.inf
    for k in range(row[o], row[o + 1]):
        n = 2 * of[k]
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
def _between(
    a: int, b: int, i: int, spot: Floats, rank: Ints, rays: Floats, of: Ints, row: Ints,
    owner: Ints, disk: Floats, blockers: Blockers,
) -> tuple[int, float]:  # fmt: skip
    """The directed arc that a path from node a to node b, number i and the one after it, has to
    pass in between, -1 if it is not known; and the angle at which it stands out."""
    ra = 0.0 if owner[a] < 0 else disk[a, RADIUS] * (1.0 - 2.0 * (a % 2))
    rb = 0.0 if owner[b] < 0 else disk[b, RADIUS] * (1.0 - 2.0 * (b % 2))
    dx, dy = disk[b, CX] - disk[a, CX], disk[b, CY] - disk[a, CY]
    apart, k = math.hypot(dx, dy), rb - ra
    if apart <= abs(k):
        return -1, 0.0
    length = math.sqrt((apart - abs(k)) * (apart + abs(k)))
    ux, uy = (dx * length + dy * k) / apart**2, (dy * length - dx * k) / apart**2
    px, py = disk[a, CX] + ra * uy, disk[a, CY] - ra * ux
    qx, qy = disk[b, CX] + rb * uy, disk[b, CY] - rb * ux
    x0, x1, y0, y1 = min(px, qx), max(px, qx), min(py, qy), max(py, qy)
    box, circles, eps = blockers.box, blockers.circles, blockers.eps
    best, farthest = -1, 0.0
    for o in range(len(box)):
        if x1 < box[o, 0] or x0 > box[o, 2] or y1 < box[o, 1] or y0 > box[o, 3]:
            continue
        if circles[o, 2] >= 0.0:
            cx, cy = circles[o, 0] - px, circles[o, 1] - py
            t = min(max(cx * ux + cy * uy, 0.0), length)
            if math.hypot(cx - t * ux, cy - t * uy) >= circles[o, 2] - eps:
                continue
        elif not enters_obstacle(px, py, qx, qy, o, blockers):
            continue
        if owner[a] == o:
            left = a % 2 == 1
        elif owner[b] == o:
            left = b % 2 == 1
        else:
            # past the side on which the string has not its representative point; where it runs
            # straight along its line, the strip that it is in tells
            shift = ON_LINE * eps if rank[o] < spot[i + 1, 4] else -ON_LINE * eps
            sx, sy = spot[i + 1, 0] - spot[i, 2], spot[i + 1, 1] - spot[i, 3]
            rx, ry = rays[o, 0] - spot[i, 2] - shift, rays[o, 1] - spot[i, 3]
            left = sx * ry - sy * rx < 0.0
        new, out = _standing_out(o, left, px, py, ux, uy, a, b, of, row, disk)
        if new >= 0 and out > farthest:
            best, farthest = new, out
    return best, 0.0 if best < 0 else _facing(best, ux, uy)


@kernel
def _facing(node: int, ux: float, uy: float) -> float:
    """The angle on a directed arc that a line along (ux, uy) touches it at."""
    return math.atan2(-ux, uy) if node % 2 == 0 else math.atan2(ux, -uy)


@kernel
def _near(angle: float, to: float) -> float:
    """The same angle, but for whole turns, within half a turn of another."""
    return angle - TWO_PI * math.floor((angle - to + math.pi) / TWO_PI)


@kernel
def _copy(k: int, to: int, node: Ints, facing: Floats, spot: Floats) -> None:
    node[to], facing[to, 0], facing[to, 1] = node[k], facing[k, 0], facing[k, 1]
    for c in range(5):
        spot[to, c] = spot[k, c]


@kernel
def _note(i: int, x: float, y: float, strip: float, spot: Floats) -> None:
    spot[i, 0], spot[i, 1], spot[i, 2], spot[i, 3], spot[i, 4] = x, y, x, y, strip


@kernel
def _written(
    count: int, node: Ints, edge: Ints, slid: Floats, real: Floats, whole: Ints, span: Ints,
    letters: Ints, disk: Floats, word: Ints,
) -> float:  # fmt: skip
    """Length of a path of so many tangents; its word is written. `NOT_PULLED` where it does not
    slide forwards."""
    n, total = 0, 0.0
    for i in range(count):
        e = edge[i]
        if i > 0:
            arrived = edge[i - 1]
            f = whole[arrived, FIRST]
            if f < 0:
                return NOT_PULLED
            n = _append(whole[arrived, ARRIVAL], whole[arrived, AFTER_ARRIVAL], letters, word, n)
            on = node[i]
            by = real[arrived, TURN] + real[e, ALONG] - real[f, ALONG]
            turns = round((slid[i] - by) / TWO_PI)
            if turns < 0 or (turns == 0 and e < f) or (turns and disk[on, END] < np.inf):
                return NOT_PULLED
            if turns == 0:
                n = _append(whole[f, GAPS], whole[e, GAPS], letters, word, n)
            else:
                n = _append(whole[f, GAPS], span[on, 2], letters, word, n)
                for _ in range(turns - 1):
                    n = _append(span[on, 1], span[on, 2], letters, word, n)
                n = _append(span[on, 1], whole[e, GAPS], letters, word, n)
            by += turns * TWO_PI
            if by < -ANGLE_TOLERANCE:
                return NOT_PULLED
            slid[i] = max(by, 0.0)
            total += disk[on, RADIUS] * slid[i]
        n = _append(whole[e, SEGMENT], whole[e, AFTER_SEGMENT], letters, word, n)
        total += real[e, LENGTH]
        if n < 0:
            return NOT_PULLED
    word[0] = n
    return total


@kernel
def _append(first: int, last: int, letters: Ints, word: Ints, n: int) -> int:
    """How many letters there are when some more are written; -1 if there is no room for them."""
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


@kernel
def _is_word(u: int, v: int, letters: Ints, row: Ints, word: Ints) -> bool:
    """Whether the word written is inverse(word of u) times (word of v)."""
    a, a_end, b, b_end = row[u], row[u + 1], row[v], row[v + 1]
    while a < a_end and b < b_end and letters[a] == letters[b]:
        a += 1
        b += 1
    back, on = a_end - a, b_end - b
    same = bool(word[0] == back + on)
    for k in range(back):
        same = same and word[1 + k] == -letters[a_end - 1 - k]
    for k in range(on):
        same = same and word[1 + back + k] == letters[b + k]
    return same

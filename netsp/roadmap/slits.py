"""Lower bounds on leg lengths from obstacles shrunk to vertical slits.

Replace every obstacle by the vertical chord through its representative point. This removes
obstruction but keeps the words, so the shortest path of a class gets no longer, and it is found
without a search. The vertical lines through the points cut the plane into strips. A path of a
given reduced word passes from strip to strip through *gates*: above the slit where the word has a
letter, below it where it must pass the line without one. No strip is entered and left through the
same gate (the word is reduced), and the strips and gates of the cover form a tree, so the gates and
their order are known from the word and the two ends alone.

Unfold the path at its turns: let s be the distance travelled in x. Then every gate is a half-line
over a place s, from the slit's top up or from its bottom down, and the shortest path is the taut
string through them, found in one sweep. Unfolding reflects strips, so it keeps lengths.

On random worlds the bound is a few per cent below the leg. It takes a fraction of a microsecond,
and a leg takes a search, so with a long tether most legs need not be measured.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import shapely

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.base.time_flags import NEVER, Flag
from netsp.hsignature import Word
from netsp.model.problem import Circle, Problem
from netsp.roadmap.roadmap_policy import LegPolicy


class Slits(NamedTuple):
    """Vertical chords of the obstacles, in coordinates relative to the base.

    Attributes
    ----------
    rank
        (n,) place of each obstacle's line from left to right, ties by number.
    obstacle, x, bottom, top
        (n,) by rank.
    """

    rank: Ints
    obstacle: Ints
    x: Floats
    bottom: Floats
    top: Floats

    def cells(self, x: Floats) -> Ints:
        """Return the strips in which points lie: the number of lines at or left of each."""
        return np.searchsorted(self.x, x, side="right").astype(np.int64)


class Workspace(NamedTuple):
    """Scratch arrays for the string between two ends.

    Attributes
    ----------
    gate
        (g, 4) columns `PLACE` … `LINE`.
    corner
        (g, 2) gates at which the string bends, and whether at their `HIGH` end.
    """

    gate: Floats
    corner: Ints


PLACE, LOW, HIGH, LINE = range(4)
"""Columns of a gate: distance travelled in x, its lower and its upper end, and the number of its
line plus 1, negative where it is passed from right to left."""


class Ends(NamedTuple):
    """Ends of legs.

    Attributes
    ----------
    place, cell
        (V, 2) place and (V,) strip of every vertex.
    letters, row
        Word of vertex v: letters row[v] to row[v + 1].
    """

    place: Floats
    cell: Ints
    letters: Ints
    row: Ints


def build_slits(problem: Problem) -> Slits:
    """Return the vertical chords through the representative points, grown by the clearance."""
    origin = problem.points[0, :2]
    points = problem.representative_points - origin
    ends = np.zeros((len(points), 2))
    for k, obstacle in enumerate(problem.obstacles):
        if isinstance(obstacle, Circle):
            reach = obstacle.radius + problem.clearance
            ends[k] = points[k, 1] - reach, points[k, 1] + reach
            continue
        x, y = obstacle.representative_point
        shape = shapely.Polygon(obstacle.polygon)
        _, low, _, high = shape.bounds
        chord = shape.intersection(shapely.LineString([(x, low - 1.0), (x, high + 1.0)]))
        pieces = getattr(chord, "geoms", [chord])
        piece = min(pieces, key=lambda g: g.distance(shapely.Point(x, y)))
        _, low, _, high = piece.bounds
        low, high = min(low, y), max(high, y)
        ends[k] = low - problem.clearance - origin[1], high + problem.clearance - origin[1]
    order = np.argsort(points[:, 0], kind="stable") if len(points) else np.zeros(0, dtype=np.int64)
    rank = np.empty(len(points), dtype=np.int64)
    rank[order] = np.arange(len(points))
    return Slits(rank, order, points[order, 0], ends[order, 0], ends[order, 1])


def slit_lengths(
    slits: Slits,
    places: Floats,
    cluster: Ints,
    signatures: Sequence[Word],
    rows: Ints | None = None,
    stop: Flag = NEVER,
    policy: LegPolicy | None = None,
) -> Floats:
    """Return the (V, V) planar lengths among slits of the legs between vertices; 0 within a
    cluster.

    Parameters
    ----------
    places
        (m + 1, 2) base and goals.
    rows
        (r,) vertices whose legs are wanted; the result is then (r, V).
    stop
        Flag of a clock; lengths are missing when it is set.
    """
    policy = policy or LegPolicy()
    n = len(cluster)
    letters, row = flatten_words(signatures)
    whole = rows is None
    vertices: Ints = np.arange(n) if rows is None else rows
    out = np.zeros((len(vertices), n))
    ends = Ends(places[cluster], slits.cells(places[:, 0])[cluster], letters, row)
    args = (vertices, whole, cluster, ends, slits, out, stop)
    blocks = [
        (k, min(k + policy.bound_rows, len(vertices)))
        for k in range(0, len(vertices), policy.bound_rows)
    ]
    if len(blocks) < 4:
        _fill_rows(0, len(vertices), *args)
    else:
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(lambda b: _fill_rows(b[0], b[1], *args), blocks))
    return out


def flatten_words(signatures: Sequence[Word]) -> tuple[Ints, Ints]:
    """Return words as one array of letters, and the row starts into it."""
    flat = [np.array(w, dtype=np.int64) for w in signatures]
    row = np.concatenate([[0], np.cumsum([len(w) for w in flat])]).astype(np.int64)
    return (np.concatenate(flat).astype(np.int64) if row[-1] else np.zeros(0, np.int64)), row


@kernel
def _fill_rows(
    first: int,
    last: int,
    vertices: Ints,
    whole: bool,
    cluster: Ints,
    ends: Ends,
    slits: Slits,
    out: Floats,
    stop: Ints,
) -> None:
    """Fill rows first … last - 1, those of `vertices`. Of the whole matrix only the part
    beyond the diagonal is computed, and mirrored."""
    room = empty_workspace(max_word_length(ends.row), slits)
    for k in range(first, last):
        if stop[0] != 0:
            return
        u = vertices[k]
        for v in range(u + 1 if whole else 0, len(cluster)):
            if cluster[u] == cluster[v]:
                continue
            out[k, v], _ = string(u, v, ends, slits, room)
            if whole:
                out[v, k] = out[k, v]


@kernel
def max_word_length(row: Ints) -> int:
    """Return the largest number of letters of a word, given row starts."""
    longest = int(np.int64(0))  # no literal: callees are compiled once
    for k in range(len(row) - 1):
        longest = max(longest, row[k + 1] - row[k])
    return longest


@kernel
def empty_workspace(longest: int, slits: Slits) -> Workspace:
    """Return a workspace for words of up to twice `longest` letters."""
    gates = (2 * longest + 2) * (len(slits.x) + 2) + 2
    return Workspace(np.empty((gates, 4)), np.empty((gates, 2), dtype=np.int64))


@kernel
def string(u: int, v: int, ends: Ends, slits: Slits, room: Workspace) -> tuple[float, int]:
    """Return the length of the path from u to v of the word inverse(word of u) times (word of v),
    and the number of its bends, which are written into `room`."""
    letters, row = ends.letters, ends.row
    rank, x, bottom, top = slits.rank, slits.x, slits.bottom, slits.top
    gate = room.gate
    a, a_end, b, b_end = row[u], row[u + 1], row[v], row[v + 1]
    shared = 0
    while a + shared < a_end and b + shared < b_end and letters[a + shared] == letters[b + shared]:
        shared += 1
    n_inverse = a_end - a - shared
    count = n_inverse + b_end - b - shared
    strip, s, before = ends.cell[u], 0.0, ends.place[u, 0]
    k = 0
    for i in range(count + 1):
        letter = 0
        if i < n_inverse:
            letter = -letters[a_end - 1 - i]
        elif i < count:
            letter = letters[b + shared + i - n_inverse]
        if letter > 0:
            target = rank[letter - 1]
        elif letter < 0:
            target = rank[-letter - 1] + 1
        else:
            target = ends.cell[v]
        while strip != target:
            line = strip if target > strip else strip - 1
            s += abs(x[line] - before)
            before = x[line]
            gate[k, PLACE], gate[k, LOW], gate[k, HIGH] = s, -np.inf, bottom[line]
            gate[k, LINE] = line + 1 if target > strip else -line - 1
            k += 1
            strip += 1 if target > strip else -1
        if letter != 0:
            line = strip if letter > 0 else strip - 1
            s += abs(x[line] - before)
            before = x[line]
            gate[k, PLACE], gate[k, LOW], gate[k, HIGH] = s, top[line], np.inf
            gate[k, LINE] = line + 1 if letter > 0 else -line - 1
            k += 1
            strip += 1 if letter > 0 else -1
    s += abs(ends.place[v, 0] - before)
    gate[k, PLACE], gate[k, LOW], gate[k, HIGH] = s, ends.place[v, 1], ends.place[v, 1]
    return _taut_string(ends.place[u, 1], gate, k + 1, room.corner)


@kernel
def _taut_string(y: float, gate: Floats, count: int, corner: Ints) -> tuple[float, int]:
    """Return the length of the taut string from (0, y) through the first `count` gates, and the
    number of its bends."""
    s = 0.0
    total = 0.0
    k = bends = 0
    low_k = high_k = 0
    low, high = -np.inf, np.inf
    while k < count:
        ds = gate[k, PLACE] - s
        bottom, top = gate[k, LOW], gate[k, HIGH]
        if ds <= 0.0:
            to = min(max(y, bottom), top)
            total += abs(to - y)
            if to != y:
                corner[bends, 0], corner[bends, 1] = k, 0 if to > y else 1
                bends += 1
                y = to
                low, high = -np.inf, np.inf
            k += 1
            continue
        a, b = (bottom - y) / ds, (top - y) / ds
        if a > high or b < low:
            at, end = (high_k, HIGH) if a > high else (low_k, LOW)
            corner[bends, 0], corner[bends, 1] = at, end - LOW
            bends += 1
            total += math.hypot(gate[at, PLACE] - s, gate[at, end] - y)
            s, y, k = gate[at, PLACE], gate[at, end], at + 1
            low, high = -np.inf, np.inf
            continue
        if a >= low:
            low, low_k = a, k
        if b <= high:
            high, high_k = b, k
        k += 1
    return total + math.hypot(gate[count - 1, PLACE] - s, gate[count - 1, LOW] - y), bends

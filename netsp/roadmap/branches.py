"""All legs at once: one taut leg gives all legs between two branches of the tree of tethers.

A leg leaves the tether of its start at a bend p, crosses over, and joins the tether of its end at a
bend q. For any two other classes, one beyond p and one beyond q, the same crossing gives a path of
tangents: back along the first tether, across, and along the second tether. It slides forwards on
every arc, except perhaps at p and q, where the angle is known. If it slides forwards there, too, it
is taut, and a class has one taut path (docs/theory, Proposition 17). So, with T the lengths of
tethers,

    leg(u, v) = T(u) + T(v) - c(p, q)

for all u and v beyond p and q that leave their arcs late enough. (c is twice the Gromov product of
u and v.) Millions of legs have some ten thousand crossings. For each crossing one leg is pulled
(`netsp.roadmap.taut_by_word`); the others are sums.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.interpretation import interpreted, interprets
from netsp.base.compiled.kernel import kernel
from netsp.roadmap.arcs import Arcs
from netsp.roadmap.slits import Ends, Slits, empty_workspace, max_word_length
from netsp.roadmap.taut_by_word import NODE, SAME_ANGLE, SLID, Path, empty_path, pull
from netsp.roadmap.tethertree import TetherTree

SLIDE_TOLERANCE = 1e-9
"""Tolerance of the angle slid on an arc, radians. A path that slides backwards by an angle is
longer than the taut one by the square of that angle only."""

OPEN = -1.0
"""Sentinel: a length that is still unknown."""


class Branches(NamedTuple):
    """Vertices in the order of the tree of their tethers. Those beyond a bend are contiguous, and
    so are those among them that leave its arc from some angle on.

    Attributes
    ----------
    node, parent, turned
        Arrays of `TetherTree`.
    last, slid
        (k,) arrays of `TetherTree`, for these vertices.
    order, rank
        (k,) vertices in order, and the place of each vertex.
    end
        (bends,) place after the last vertex beyond each bend.
    row, angle, begin
        Bends and vertices that leave each bend, by the angle slid there: rows row[b] to row[b + 1]
        of the angles, and of the places at which each begins.
    """

    node: Ints
    parent: Ints
    turned: Floats
    last: Ints
    slid: Floats
    order: Ints
    rank: Ints
    end: Ints
    row: Ints
    angle: Floats
    begin: Ints


class Lengths(NamedTuple):
    """Matrix of legs that is being filled.

    Attributes
    ----------
    planar, height
        (k,) planar lengths of the tethers, and heights.
    share
        Factor on each stored length, a little less than 1 where lengths are rounded down.
    out
        (r, k) 3D lengths, `OPEN` where not known yet.
    row
        (k,) row of the vertex at each place in the order; -1 for vertices without a row.
    """

    planar: Floats
    height: Floats
    share: float
    out: Floats
    row: Ints


def build_branches(tree: TetherTree, vertices: Ints) -> Branches:
    """Return the branches of vertices of a tree."""
    last, slid = tree.last[vertices], tree.slid[vertices]
    size = _subtree_sizes(tree.parent, last)
    # what leaves a bend: bends with vertices beyond them, as negative numbers (the root leaves
    # none), and vertices
    bends = np.flatnonzero(size[1:]) + 1
    owner = np.concatenate([tree.parent[bends], last])
    angle = np.concatenate([tree.turned[bends], slid])
    what = np.concatenate([-bends, np.arange(len(last))])
    by_angle = np.lexsort((angle, owner))
    row = np.searchsorted(owner[by_angle], np.arange(len(size) + 1)).astype(np.int64)
    order, begin, end = _order_vertices(what[by_angle], row, size, len(last))
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return Branches(
        tree.node,
        tree.parent,
        tree.turned,
        last,
        slid,
        order,
        rank,
        end,
        row,
        angle[by_angle],
        begin,
    )


@kernel
def _subtree_sizes(parent: Ints, last: Ints) -> Ints:
    """Return the number of vertices beyond each bend."""
    size = np.zeros(len(parent), dtype=np.int64)
    for v in range(len(last)):
        size[last[v]] += 1
    for b in range(len(parent) - 1, 0, -1):
        size[parent[b]] += size[b]
    return size


@kernel
def _order_vertices(what: Ints, row: Ints, size: Ints, count: int) -> tuple[Ints, Ints, Ints]:
    """Return `Branches.order`, `begin` and `end`."""
    order = np.empty(count, dtype=np.int64)
    begin = np.empty(len(what), dtype=np.int64)
    start, end = np.zeros_like(size), np.zeros_like(size)
    for b in range(len(size)):
        at = start[b]
        end[b] = at + size[b]
        for k in range(row[b], row[b + 1]):
            begin[k] = at
            if what[k] < 0:
                start[-what[k]] = at
                at += size[-what[k]]
            else:
                order[at] = what[k]
                at += 1
    return order, begin, end


@kernel
def fill(
    branches: Branches,
    lengths: Lengths,
    point: Ints,
    ends: Ends,
    slits: Slits,
    arcs: Arcs,
    stop: Ints,
    i: int,
    j: int,
) -> tuple[int, int]:
    """Find the open legs between different goals, from places i and j of the order on.

    Return the next pair of places whose leg cannot be pulled, or numbers beyond the last place.

    Entries within a goal and legs of the base (point 0) stay undefined.

    Parameters
    ----------
    point
        (k,) point at which each vertex is.
    """
    order, out, row = branches.order, lengths.out, lengths.row
    whole = len(out) == len(order)  # then legs to earlier places are known from their other ends
    longest = max_word_length(ends.row)
    room, path = empty_workspace(longest, slits), empty_path(longest, arcs.max_bends)
    while i < len(order) and stop[0] == 0:
        u = order[i]
        while j < len(order) and row[i] >= 0 and point[u] != 0:
            v = order[j]
            if out[row[i], v] == OPEN and point[u] != point[v] and point[v] != 0:
                # from the one that comes first, in all blocks of rows alike
                a, b = (u, v) if i < j else (v, u)
                length, _, count = pull(a, b, ends, point, slits, arcs, room, path)
                if length < 0.0:
                    return i, j
                fill_parallel(a, b, length, count, path, branches, lengths)
            j += 1
        i += 1
        j = i + 1 if whole else 0
    return i, j


@interprets(fill)
def _fill_in_numpy(
    branches: Branches,
    lengths: Lengths,
    point: Ints,
    ends: Ends,
    slits: Slits,
    arcs: Arcs,
    stop: Ints,
    i: int,
    j: int,
) -> tuple[int, int]:
    """Vectorise the search of `fill` for the open legs of a row."""
    order, out, row = branches.order, lengths.out, lengths.row
    whole, place = len(out) == len(order), point[order]
    longest = interpreted(max_word_length)(ends.row)
    room, path = (
        interpreted(empty_workspace)(longest, slits),
        interpreted(empty_path)(longest, arcs.max_bends),
    )
    pull_one, note_alike = interpreted(pull), interpreted(fill_parallel)
    while i < len(order) and stop[0] == 0:
        u = order[i]
        if row[i] >= 0 and point[u] != 0:
            row_values = out[row[i]]
            is_open = (row_values[order[j:]] == OPEN) & (place[j:] != point[u]) & (place[j:] != 0)
            for k in (np.flatnonzero(is_open) + j).tolist():
                v = order[k]
                if row_values[v] != OPEN:
                    continue  # filled together with an earlier leg
                a, b = (u, v) if i < k else (v, u)
                length, _, count = pull_one(a, b, ends, point, slits, arcs, room, path)
                if length < 0.0:
                    return i, k
                note_alike(a, b, length, count, path, branches, lengths)
        i += 1
        j = i + 1 if whole else 0
    return i, j


@kernel
def fill_parallel(
    u: int, v: int, length: float, count: int, path: Path, branches: Branches, lengths: Lengths
) -> None:
    """Fill in all legs with the same crossing as the leg from u to v, given its planar length and
    its path of `count` tangents."""
    i0, i1, j0, j1 = _parallel_ranges(u, v, count, path, branches)
    order, planar, row = branches.order, lengths.planar, lengths.row
    saved = planar[u] + planar[v] - length
    # row by row, to save memory
    for x in range(i0, i1):
        if row[x] >= 0:
            _write_legs(lengths.out[row[x]], order[x], j0, j1, saved, order, lengths)
    for y in range(j0, j1):
        if row[y] >= 0:
            _write_legs(lengths.out[row[y]], order[y], i0, i1, saved, order, lengths)


@kernel
def _write_legs(
    out: Floats, a: int, begin: int, end: int, saved: float, order: Ints, lengths: Lengths
) -> None:
    """Write the legs from vertex a to the vertices at places begin … end - 1: both tethers less
    `saved`."""
    planar, height, share = lengths.planar, lengths.height, lengths.share
    for y in range(begin, end):
        b = order[y]
        rise = height[b] - height[a]
        length = planar[a] + planar[b] - saved
        if rise != 0.0:
            length = np.sqrt(length * length + rise * rise)
        out[b] = share * length


@interprets(fill_parallel)
def _fill_parallel_in_numpy(
    u: int, v: int, length: float, count: int, path: Path, branches: Branches, lengths: Lengths
) -> None:
    """Vectorise `fill_parallel` over all legs."""
    i0, i1, j0, j1 = interpreted(_parallel_ranges)(u, v, count, path, branches)
    order, planar, row = branches.order, lengths.planar, lengths.row
    saved = planar[u] + planar[v] - length
    a, b = order[i0:i1], order[j0:j1]
    legs = planar[a, None] + planar[b] - saved
    rise = lengths.height[b] - lengths.height[a, None]
    if rise.any():
        legs = np.where(rise != 0.0, np.sqrt(legs * legs + rise * rise), legs)
    legs = lengths.share * legs
    for rows, others, block in ((row[i0:i1], b, legs), (row[j0:j1], a, legs.T)):
        is_kept = rows >= 0
        lengths.out[rows[is_kept, None], others] = block[is_kept]


@kernel
def _parallel_ranges(
    u: int, v: int, count: int, path: Path, branches: Branches
) -> tuple[int, int, int, int]:
    """Return the ranges of places of the vertices whose legs have the same crossing as that of u
    and v: on the side of u, and on the side of v."""
    p, p_angle, p_place = _find_fork(u, 1, 1, 1, count, path, branches)
    q, q_angle, q_place = _find_fork(v, count - 1, -1, 0, count, path, branches)
    i0, j0 = branches.rank[u], branches.rank[v]
    i1, j1 = i0 + 1, j0 + 1
    if p >= 0 and q >= 0 and p_place >= q_place:
        # around one arc from tether to tether: how far it slides is up to both ends, so those on
        # the side of u are to leave no earlier than u does
        if p_place == q_place:
            i0, i1 = (
                _first_place(p, p_angle + path.floats[p_place, SLID], branches),
                branches.end[p],
            )
            j0, j1 = _first_place(q, q_angle, branches), branches.end[q]
    else:
        if p >= 0:
            i0, i1 = _first_place(p, p_angle, branches), branches.end[p]
        if q >= 0:
            j0, j1 = _first_place(q, q_angle, branches), branches.end[q]
    return i0, i1, j0, j1


@kernel
def _find_fork(
    v: int, first: int, step: int, flip: int, count: int, path: Path, branches: Branches
) -> tuple[int, float, int]:
    """Return the bend at which a leg leaves the tether of its end v (-1 if there is none), the
    smallest angle at which what leaves that bend has the same crossing, and the leg's node there.
    Nodes are visited from `first` on by `step`. From its start a leg follows a tether backwards,
    and arcs in the other sense (flip 1)."""
    bend, slid = branches.last[v], branches.slid[v]
    found, min_angle, place = -1, 0.0, -1
    k = first
    while 0 < k < count and bend > 0 and (path.ints[k, NODE] ^ flip) == branches.node[bend]:
        found, min_angle, place = bend, slid - path.floats[k, SLID], k
        if abs(min_angle) > SAME_ANGLE:
            break
        k += step
        slid, bend = branches.turned[bend], branches.parent[bend]
    return found, min_angle, place


@kernel
def _first_place(bend: int, min_angle: float, branches: Branches) -> int:
    """Return the first place of what leaves a bend at an angle or later."""
    k, after = branches.row[bend], branches.row[bend + 1]
    while k < after and branches.angle[k] < min_angle - SLIDE_TOLERANCE:
        k += 1
    return int(branches.begin[k]) if k < after else int(branches.end[bend])

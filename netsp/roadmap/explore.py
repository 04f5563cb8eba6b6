"""Depth-first search for taut paths over the tangent graph, guided by words.

One kernel answers two questions. *Which classes reach a goal within the tether?* The trie of words
grows during the search; it holds all words, or all that do not loop. *How long are the legs between
given classes?* The trie is given; it holds their words with all prefixes. These words are the
*core* of the trie. Each taut path is generated once, and is the only one of its class
(docs/theory).

A taut path can cross a ray and cross it back where the ray passes through another obstacle, so the
word of its beginnings may leave the core for a while. Such *pending* letters are followed as long
as they can still be cancelled: the path then stays in the hull of the ray and of what the ray cuts
off other obstacles (Lemma 13 of docs/theory).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.dynamic_array import longer, more_int_rows, more_rows
from netsp.base.compiled.hash_map import rehashed
from netsp.base.compiled.kernel import kernel
from netsp.base.time_flags import NEVER, Flag
from netsp.roadmap.pending_letters import MAX_PENDING, XMAX, XMIN, YMAX, YMIN
from netsp.roadmap.tangents import TangentGraph
from netsp.roadmap.trie import CORE, LETTER, PARENT, Trie, add_child, trie_child

ARRIVAL_TOLERANCE = 1e4
"""Tolerance of the lengths of two arrivals at a directed arc with one word that count as one path,
as a multiple of the outline's margin (1e-6 of the size). Where outlines touch from inside, a path
may switch between them at no cost but rounding, forever if the tolerance were smaller."""

Letters = npt.NDArray[np.int32]

GIVEN, NON_LOOPING, ALL = range(3)
"""Codes of the words that may join the trie: only the given words, words that do not loop, all."""


class TangentArrays(NamedTuple):
    """Arrays of a `TangentGraph` that the kernel walks.

    Attributes
    ----------
    arc_nodes
        Number of nodes that are directed arcs; points follow.
    longest
        Maximum number of letters that one step can write.
    """

    start: Ints
    target: Ints
    length: Floats
    ends: Floats
    first: Ints
    turn: Floats
    gap: Floats
    segment_row: Ints
    arrival_row: Ints
    gap_row: Ints
    radius: Floats
    arc_nodes: int
    longest: int


class WordRules(NamedTuple):
    """Rules by which words grow.

    Attributes
    ----------
    letters
        Letters that the rows of `TangentArrays` point into.
    pending
        Boxes in which letters may be pending, grown by the margin of positions.
    rule
        Which new words join the core: `GIVEN`, `NON_LOOPING` or `ALL`.
    same
        Difference of lengths up to which two arrivals are one.
    """

    letters: Letters
    pending: Floats
    rule: int
    same: float


class SearchRequest(NamedTuple):
    """Request for paths.

    Attributes
    ----------
    keeps_tree
        Whether the search tree is kept, so that paths can be written out.
    max_states
        Maximum number of departures expanded.
    min_remaining
        (e,) lower bound on the length from the end of each tangent to the target; 0 without a
        target.
    target
        Target point; -1 for all points.
    max_lengths
        (points,) length of the longest path that is reported.
    max_hits
        Number of reports that ends the search.
    """

    keeps_tree: bool
    max_states: int
    min_remaining: Floats
    target: int
    max_lengths: Floats
    max_hits: int


NODE, NEXT, WORD, BEFORE, TAKEN = range(5)
"""Columns of a state's integers. A state is an arrival: its node, the first departure there, its
word, the state before and the departure taken from that state."""

TURN, REACHED, SLID = range(3)
"""Columns of a state's floats: angle to the first departure, length at arrival, and angle slid
before the departure taken."""


@kernel
def _can_cancel(node: int, x: float, y: float, trie: Ints, pending: Floats) -> bool:
    """Return whether all letters outside the core can still be cancelled from a bend at (x, y)."""
    v = node
    while trie[v, CORE] == 0:
        a = trie[v, LETTER]
        if not _in_box(a, x, y, pending):
            return False
        count = 1.0
        u = trie[v, PARENT]
        while trie[u, CORE] == 0:
            if trie[u, LETTER] == a:
                count += 1.0
            u = trie[u, PARENT]
        if count > pending[0 if a > 0 else 1, abs(a) - 1, MAX_PENDING]:
            return False
        v = trie[v, PARENT]
    return True


@kernel
def _in_box(a: int, x: float, y: float, pending: Floats) -> bool:
    side = 0 if a > 0 else 1
    i = abs(a) - 1
    return bool(
        x >= pending[side, i, XMIN]
        and y >= pending[side, i, YMIN]
        and x <= pending[side, i, XMAX]
        and y <= pending[side, i, YMAX]
    )


@kernel
def _joins_core(node: int, a: int, rule: int, trie: Ints) -> bool:
    """Return whether the word of a core node, with one more letter, joins the core."""
    if rule == GIVEN or trie[node, CORE] == 0:
        return False
    if rule == NON_LOOPING:
        v = node
        while v > 0:
            if trie[v, LETTER] == a:
                return False
            v = trie[v, PARENT]
    return True


@kernel
def _follow_letters(
    node: int,
    lo: int,
    hi: int,
    x: float,
    y: float,
    words: WordRules,
    trie: Ints,
    limit: Floats,
    size: int,
) -> tuple[int, int]:
    """Return the trie node after the letters lo … hi of the segment to a bend at (x, y), and the
    size of the trie. Missing nodes are added; the node is -1 if no wanted word can follow."""
    letters, pending = words.letters, words.pending
    for k in range(lo, hi):
        a = int(letters[k])
        if node > 0 and trie[node, LETTER] == -a:
            node = trie[node, PARENT]
            continue
        c = trie_child(node, a, trie)
        if c < 0:
            joins = _joins_core(node, a, words.rule, trie)
            if not joins and pending[0 if a > 0 else 1, abs(a) - 1, XMIN] == np.inf:
                return -1, size
            c = size
            add_child(node, a, 1 if joins else 0, c, trie)
            limit[c] = limit[node]
            size += 1
        node = c
    if trie[node, CORE] == 0 and not _can_cancel(node, x, y, trie, pending):
        return -1, size
    return node, size


@kernel
def _is_new_arrival(code: int, mark: float, same: float, key: Ints, length: Floats) -> bool:
    """Return whether an arrival with this code (word and directed arc) and length is new; record
    it.

    Collinear tangents give several spellings of one path.
    """
    slots = len(key)
    slot = (code * 0x9E3779B1) % slots
    while key[slot] >= 0:
        if key[slot] == code and abs(length[slot] - mark) <= same:
            return False
        slot += 1
        if slot == slots:
            slot = 0
    key[slot] = code
    length[slot] = mark
    return True


@kernel
def explore(
    net: TangentArrays,
    words: WordRules,
    request: SearchRequest,
    source: int,
    trie: Ints,
    limit: Floats,
    size: int,
    stop: Ints,
) -> tuple[tuple[Ints, Floats, int], tuple[Ints, Floats], tuple[Ints, Floats], bool]:
    """Find all taut paths from node `source` whose words are in the core of the trie, or pending.

    Parameters
    ----------
    limit
        (capacity,) longest path for each of the `size` nodes of the trie.
    stop
        Flag of a clock; the search ends when it is set.

    Returns
    -------
    tuple
        Trie, limit and size; for each hit (point, trie node, state, departure) and (length, angle
        slid before the departure); the search tree as rows of states; whether the search was cut
        short.
    """
    # unpacked once, because each access to an array in a tuple changes a reference count
    start, target, length, ends = net.start, net.target, net.length, net.ends
    first, turn, gap, radius = net.first, net.turn, net.gap, net.radius
    segment_row, arrival_row, gap_row = net.segment_row, net.arrival_row, net.gap_row
    arc_nodes, min_remaining, max_lengths = (
        net.arc_nodes,
        request.min_remaining,
        request.max_lengths,
    )
    state = np.empty((1024, 5), dtype=np.int64)
    real = np.empty((1024, 3))
    stack = np.empty((1024, 1), dtype=np.int64)
    hit = np.empty((256, 4), dtype=np.int64)
    hit_real = np.empty((256, 2))
    hits = 0
    seen_key = np.full(4096, -1, dtype=np.int64)
    seen_length = np.empty(4096)
    seen = 0

    state[0, NODE], state[0, NEXT], state[0, WORD] = source, start[source], 0
    state[0, BEFORE], state[0, TAKEN] = -1, -1
    real[0, TURN], real[0, REACHED], real[0, SLID] = 0.0, 0.0, 0.0
    stack[0, 0] = 0
    top, count, visited = 1, 1, 0
    while top > 0:
        top -= 1
        current = stack[top, 0]
        node, e, word = state[current, NODE], state[current, NEXT], state[current, WORD]
        slid, so_far = real[current, TURN], real[current, REACHED]
        if not request.keeps_tree:
            count = top
        begin, end = start[node], start[node + 1]
        if begin == end:
            continue
        while True:
            visited += 1
            if visited > request.max_states or hits >= request.max_hits or stop[0] != 0:
                # the state that is being expanded is in the tree
                tree = state[: count + 1], real[: count + 1]
                return (trie, limit, size), (hit[:hits], hit_real[:hits]), tree, True
            departed = so_far + radius[node] * slid
            if departed > limit[word]:
                break
            if size + net.longest >= len(trie):
                trie = more_int_rows(trie)
                limit = longer(limit)
            reached = departed + length[e]
            min_total = reached + min_remaining[e]
            w = -1
            if min_total <= limit[0]:  # no word may be longer
                w, size = _follow_letters(
                    word,
                    segment_row[e, 0],
                    segment_row[e, 1],
                    ends[e, 2],
                    ends[e, 3],
                    words,
                    trie,
                    limit,
                    size,
                )
            if w >= 0 and min_total > limit[w]:
                w = -1
            goal = target[e]
            if w >= 0 and goal >= arc_nodes:
                point = goal - arc_nodes
                is_wanted = (
                    request.target < 0 or point == request.target
                ) and reached <= max_lengths[point]
                if trie[w, CORE] == 1 and is_wanted:
                    if hits == len(hit):
                        hit = more_int_rows(hit)
                        hit_real = more_rows(hit_real)
                    hit[hits, 0], hit[hits, 1], hit[hits, 2], hit[hits, 3] = point, w, current, e
                    hit_real[hits, 0], hit_real[hits, 1] = reached, slid
                    hits += 1
            elif w >= 0 and first[e] >= 0:
                f = first[e]
                mark = reached + radius[goal] * turn[e]
                code = w * len(radius) + goal
                if _is_new_arrival(code, mark, words.same, seen_key, seen_length):
                    seen += 1
                    if 2 * seen > len(seen_key):
                        seen_key, seen_length = rehashed(seen_key, seen_length)
                    w, size = _follow_letters(
                        w,
                        arrival_row[e, 0],
                        arrival_row[e, 1],
                        ends[f, 0],
                        ends[f, 1],
                        words,
                        trie,
                        limit,
                        size,
                    )
                else:
                    w = -1
                if w >= 0:
                    if count == len(state) or top == len(stack):
                        state = more_int_rows(state)
                        real = more_rows(real)
                        stack = more_int_rows(stack)
                    state[count, NODE], state[count, NEXT] = goal, f
                    state[count, WORD], state[count, BEFORE] = w, current
                    state[count, TAKEN] = e
                    real[count, TURN], real[count, REACHED] = max(turn[e], 0.0), reached
                    real[count, SLID] = slid
                    stack[top, 0] = count
                    top += 1
                    count += 1
            if gap[e] < 0.0:
                break
            slid += gap[e]
            following = e + 1 if e + 1 < end else begin
            word, size = _follow_letters(
                word,
                gap_row[e, 0],
                gap_row[e, 1],
                ends[following, 0],
                ends[following, 1],
                words,
                trie,
                limit,
                size,
            )
            if word < 0:
                break
            e = following
    return (trie, limit, size), (hit[:hits], hit_real[:hits]), (state[:count], real[:count]), False


@dataclass(frozen=True)
class FoundPaths:
    """Result of a search: hits, and the search tree if it was kept.

    Attributes
    ----------
    goal, word, length, state, departure, slid
        For each hit: point, trie node of its word, length, last state, last departure and the angle
        slid before it.
    tree, tree_length, tree_slid
        For each state: its integers, the length at arrival, and the angle slid before the
        departure.
    capped
        Whether the search was cut short.
    """

    goal: Ints
    word: Ints
    length: Floats
    state: Ints
    departure: Ints
    slid: Floats
    tree: Ints
    tree_length: Floats
    tree_slid: Floats
    capped: bool

    def pieces(self, hit: int) -> list[tuple[int, float]]:
        """Return (departure, angle slid before it) along the path of a hit, from the source on."""
        out = [(int(self.departure[hit]), float(self.slid[hit]))]
        s = int(self.state[hit])
        while self.tree[s, BEFORE] >= 0:
            out.append((int(self.tree[s, TAKEN]), float(self.tree_slid[s])))
            s = int(self.tree[s, BEFORE])
        return out[::-1]


def run_explore(
    graph: TangentGraph,
    source: int,
    trie: Trie,
    *,
    margin: float,
    rule: int = GIVEN,
    keeps_tree: bool = False,
    max_states: int | None = None,
    target: tuple[int, Floats] | None = None,
    max_lengths: Floats | None = None,
    max_hits: int | None = None,
    stop: Flag = NEVER,
) -> FoundPaths:
    """Run the kernel from point `source`; the trie is updated.

    Parameters
    ----------
    target
        A point, and for each tangent a lower bound on the length from its end to that point. Only
        paths to the point are searched for.
    max_lengths
        (points,) length of the longest path to each point that counts.
    max_hits
        Approximate maximum number of hits.
    """
    no_limit = np.iinfo(np.int64).max
    point, min_remaining = target or (-1, np.zeros(len(graph.target)))
    net = TangentArrays(
        graph.start,
        graph.target,
        graph.length,
        graph.ends,
        graph.first,
        graph.turn,
        graph.gap,
        graph.segment_row,
        graph.arrival_row,
        graph.gap_row,
        graph.radius,
        2 * len(graph.arcs),
        graph.longest_step,
    )
    wide = graph.pending + margin * np.array([-1.0, -1.0, 1.0, 1.0, 0.0])
    words = WordRules(graph.letters, wide, rule, ARRIVAL_TOLERANCE * margin)
    request = SearchRequest(
        keeps_tree,
        no_limit if max_states is None else max_states,
        min_remaining,
        point,
        np.full(len(graph.points), np.inf) if max_lengths is None else max_lengths,
        no_limit if max_hits is None else max_hits,
    )
    (trie.nodes, trie.limit, trie.size), (h_i, h_f), (s_i, s_f), capped = explore(
        net, words, request, graph.point_node(source), trie.nodes, trie.limit, trie.size, stop
    )
    return FoundPaths(
        h_i[:, 0],
        h_i[:, 1],
        h_f[:, 0],
        h_i[:, 2],
        h_i[:, 3],
        h_f[:, 1],
        s_i,
        s_f[:, REACHED],
        s_f[:, SLID],
        capped,
    )

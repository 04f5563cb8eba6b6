"""Enumeration of taut paths by depth-first search over the tangent graph, guided by words.

One kernel serves two questions. *Which classes reach a goal within the tether?* — the trie of words
grows as the search goes, holding all words, or the non-looping ones. *How long are the legs between
given classes?* — the trie is given, holding the wanted words and their prefixes. These are the
trie's *core*. Each taut path is generated once, and in its class it is the only one
(docs/theory.md).

A ray that passes through another obstacle can be crossed and crossed back by one taut path, so the
word on the way may leave the core for a while. Such *pending* letters are followed exactly as long
as they can still be cancelled: the obstacle that interrupts the ray lies on the other side of it,
no pending letter repeats, and the robot stays on the side it crossed to (the lemma on pending
letters).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from netsp.arrays import Floats, Ints
from netsp.clock import NEVER, Flag
from netsp.compiled.growing import longer, more_int_rows, more_rows
from netsp.compiled.slots import rehashed
from netsp.roadmap.tangents import TangentGraph
from netsp.roadmap.trie import CORE, LETTER, PARENT, Trie, add_child, trie_child

SAME = 1e4
"""Two arrivals at a directed arc with one word are one path when their lengths agree to this many
margins (1e-6 of the size). Where outlines touch from inside, hopping between them and back takes no
length but rounding; less tolerance would let that go on for ever."""

GIVEN, NON_LOOPING, ALL = range(3)
"""Which words may join the trie: none but those given, those that do not loop, or all."""


@njit(cache=True, nogil=True)
def _may_wait(node, x, y, trie, pending, margin):
    """Whether the letters that lead out of the core can all still be cancelled from a bend at
    (x, y)."""
    v = node
    while trie[v, CORE] == 0:
        a = trie[v, LETTER]
        if not _in_box(a, x, y, pending, margin):
            return False
        u = trie[v, PARENT]
        while trie[u, CORE] == 0:
            if trie[u, LETTER] == a:
                return False
            u = trie[u, PARENT]
        v = trie[v, PARENT]
    return True


@njit(cache=True, nogil=True)
def _in_box(a, x, y, pending, margin):
    side = 0 if a > 0 else 1
    i = abs(a) - 1
    return (
        x >= pending[side, i, 0] - margin
        and y >= pending[side, i, 1] - margin
        and x <= pending[side, i, 2] + margin
        and y <= pending[side, i, 3] + margin
    )


@njit(cache=True, nogil=True)
def _walk(node, lo, hi, x, y, letters, trie, limit, size, rule, pending, margin):
    """The trie node after the letters lo … hi on the way to a bend at (x, y), made where it may
    exist; -1 if no wanted word can follow. Returns node, size."""
    for k in range(lo, hi):
        a = np.int64(letters[k])
        if node > 0 and trie[node, LETTER] == -a:
            node = trie[node, PARENT]
            continue
        c = trie_child(node, a, trie)
        if c < 0:
            joins = rule != GIVEN and trie[node, CORE] == 1
            if joins and rule == NON_LOOPING:
                v = node
                while v > 0:
                    if trie[v, LETTER] == a:
                        joins = False
                        break
                    v = trie[v, PARENT]
            if not joins and pending[0 if a > 0 else 1, abs(a) - 1, 0] == np.inf:
                return -1, size
            c = size
            add_child(node, a, 1 if joins else 0, c, trie)
            limit[c] = limit[node]
            size += 1
        node = c
    if trie[node, CORE] == 0 and not _may_wait(node, x, y, trie, pending, margin):
        return -1, size
    return node, size


@njit(cache=True, nogil=True)
def explore(
    source, start, target, length, ends, first, turn, gap, letters, segment_row, arrival_row,
    gap_row, radius, arc_nodes, pending, margin, longest, trie, limit, size, rule, keep, cap,
    rest, aim, within, most, stop,
):  # fmt: skip
    """All taut paths from node `source` whose words stay in (or pend from) the core.

    longest : most letters that one step can write. rule : which new words join the core. keep :
    whether to keep the search tree, so that paths can be written out. cap : most departures to
    look at.
    rest : per tangent, the least length from its end to where the search is going (0 where it goes
    everywhere). aim : the one point asked for, -1 for all. within : per point, the longest path
    that is reported; most : so many reports end the search. stop : ends it when its first number is
    not 0.

    Returns trie, limit, size; per hit (goal point, trie node, state, departure) and (length, angle
    slid before the departure); the tree as (parent state, departure) and angle slid; whether the
    cap stopped the search.
    """
    # a state is an arrival: node, first departure, word there, parent state, departure taken;
    # angle to the first departure, length at arrival, angle slid before the departure taken
    s_i = np.empty((1024, 5), dtype=np.int64)
    s_f = np.empty((1024, 3))
    stack = np.empty((1024, 1), dtype=np.int64)
    h_i = np.empty((256, 4), dtype=np.int64)
    h_f = np.empty((256, 2))
    hits = 0
    # arrivals seen, by (word, directed arc): collinear tangents give one path several spellings
    slots = 4096
    seen_key = np.full(slots, -1, dtype=np.int64)
    seen_length = np.empty(slots)
    seen_used = 0
    nodes = len(radius)

    s_i[0, 0], s_i[0, 1], s_i[0, 2], s_i[0, 3], s_i[0, 4] = source, start[source], 0, -1, -1
    s_f[0, 0], s_f[0, 1], s_f[0, 2] = 0.0, 0.0, 0.0
    stack[0, 0] = 0
    top, count, visited = 1, 1, 0
    while top > 0:
        top -= 1
        sid = stack[top, 0]
        node, e, t = s_i[sid, 0], s_i[sid, 1], s_i[sid, 2]
        slid, so_far = s_f[sid, 0], s_f[sid, 1]
        if not keep:
            count = top
        if start[node] == start[node + 1]:
            continue
        r = radius[node]
        while True:
            visited += 1
            if visited > cap or hits >= most or stop[0] != 0:
                # the state that is being looked at counts as kept
                hit, tree = (h_i[:hits], h_f[:hits]), (s_i[: count + 1], s_f[: count + 1])
                return (trie, limit, size), hit, tree, True
            here = so_far + r * slid
            if here > limit[t]:
                break
            if size + longest >= len(trie):
                trie = more_int_rows(trie)
                limit = longer(limit)
            reached = here + length[e]
            w = -1
            if reached + rest[e] <= limit[0]:  # no word may be longer
                x, y = ends[e, 2], ends[e, 3]
                w, size = _walk(
                    t, segment_row[e, 0], segment_row[e, 1], x, y, letters, trie, limit, size,
                    rule, pending, margin,
                )  # fmt: skip
            goal = target[e]
            if w >= 0 and reached + rest[e] <= limit[w]:
                if goal >= arc_nodes:
                    point = goal - arc_nodes
                    asked = (aim < 0 or point == aim) and reached <= within[point]
                    if trie[w, CORE] == 1 and asked:
                        if hits == len(h_i):
                            h_i = more_int_rows(h_i)
                            h_f = more_rows(h_f)
                        h_i[hits, 0], h_i[hits, 1] = point, w
                        h_i[hits, 2], h_i[hits, 3] = sid, e
                        h_f[hits, 0], h_f[hits, 1] = reached, slid
                        hits += 1
                elif first[e] >= 0:
                    f = first[e]
                    mark = reached + radius[goal] * turn[e]
                    code = w * nodes + goal
                    slot = (code * 0x9E3779B1) % slots
                    fresh = True
                    while seen_key[slot] >= 0:
                        if (
                            seen_key[slot] == code
                            and abs(seen_length[slot] - mark) <= SAME * margin
                        ):
                            fresh = False
                            break
                        slot += 1
                        if slot == slots:
                            slot = 0
                    if fresh:
                        seen_key[slot] = code
                        seen_length[slot] = mark
                        seen_used += 1
                        if 2 * seen_used > slots:
                            seen_key, seen_length = rehashed(seen_key, seen_length)
                            slots = len(seen_key)
                        w, size = _walk(
                            w, arrival_row[e, 0], arrival_row[e, 1], ends[f, 0], ends[f, 1],
                            letters, trie, limit, size, rule, pending, margin,
                        )  # fmt: skip
                        if w >= 0:
                            if count == len(s_i) or top == len(stack):
                                s_i = more_int_rows(s_i)
                                s_f = more_rows(s_f)
                                stack = more_int_rows(stack)
                            s_i[count, 0], s_i[count, 1], s_i[count, 2] = goal, f, w
                            s_i[count, 3], s_i[count, 4] = sid, e
                            s_f[count, 0], s_f[count, 1] = max(turn[e], 0.0), reached
                            s_f[count, 2] = slid
                            stack[top, 0] = count
                            top += 1
                            count += 1
            if gap[e] < 0.0:
                break
            following = e + 1 if e + 1 < start[node + 1] else start[node]
            t, size = _walk(
                t, gap_row[e, 0], gap_row[e, 1], ends[following, 0], ends[following, 1], letters,
                trie, limit, size, rule, pending, margin,
            )  # fmt: skip
            if t < 0:
                break
            slid += gap[e]
            e = following
    return (trie, limit, size), (h_i[:hits], h_f[:hits]), (s_i[:count], s_f[:count]), False


@dataclass(frozen=True)
class Found:
    """What a search hit: goal points, trie nodes of their words, lengths; and the search tree if it
    was kept: per state (arrival) the rows of the kernel, length at arrival, angle slid before."""

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
        """(departure, angle slid before it) along the path of a hit, from the source on."""
        out = [(int(self.departure[hit]), float(self.slid[hit]))]
        s = int(self.state[hit])
        while self.tree[s, 3] >= 0:
            out.append((int(self.tree[s, 4]), float(self.tree_slid[s])))
            s = int(self.tree[s, 3])
        return out[::-1]


def run_explore(
    graph: TangentGraph,
    source: int,
    trie: Trie,
    *,
    margin: float,
    rule: int = GIVEN,
    keep: bool = False,
    cap: int | None = None,
    toward: tuple[int, Floats] | None = None,
    within: Floats | None = None,
    most: int | None = None,
    stop: Flag = NEVER,
) -> Found:
    """Run the kernel from point `source`; updates the trie.

    toward : a point, and per tangent the least length from its end to that point: only paths to it
    are sought. within : (points,) longest path to each that counts. most : hits, about. stop : of a
    clock.
    """
    no_limit = np.iinfo(np.int64).max
    aim, rest = toward or (-1, np.zeros(len(graph.target)))
    if within is None:
        within = np.full(len(graph.points), np.inf)
    (trie.nodes, trie.limit, trie.size), (h_i, h_f), (s_i, s_f), capped = explore(
        graph.point_node(source), graph.start, graph.target, graph.length, graph.ends,
        graph.first, graph.turn, graph.gap, graph.letters, graph.segment_row, graph.arrival_row,
        graph.gap_row, graph.radius, 2 * len(graph.arcs), graph.pending, margin,
        graph.longest_step, trie.nodes, trie.limit, trie.size, rule, keep,
        no_limit if cap is None else cap, rest, aim, within, no_limit if most is None else most,
        stop,
    )  # fmt: skip
    return Found(
        h_i[:, 0],
        h_i[:, 1],
        h_f[:, 0],
        h_i[:, 2],
        h_i[:, 3],
        h_f[:, 1],
        s_i,
        s_f[:, 1],
        s_f[:, 2],
        capped,
    )

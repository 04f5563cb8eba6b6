"""Enumeration of taut paths by depth-first search over the tangent graph, guided by words.

One kernel serves two questions. *Which classes reach a goal within the tether?* — the trie of words
grows as the search goes, holding the non-looping words. *How long are the legs between given
classes?* — the trie is given, holding the wanted words and their prefixes. These are the trie's
*core*. Each taut path is generated once, and in its class it is the only one (docs/theory.md).

A ray that passes through another obstacle can be crossed and crossed back by one taut path, so the
word on the way may leave the core for a while. Such *pending* letters are followed exactly as long
as they can still be cancelled: the obstacle that interrupts the ray lies on the other side of it,
no pending letter repeats, and the robot stays on the side it crossed to (the lemma on pending
letters).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from netsp.roadmap.tangents import TangentGraph

Ints = npt.NDArray[np.int64]


@dataclass
class Trie:
    """Words as a tree; node 0 is the empty word. Arrays are over-allocated, `size` is the count.

    core : whether the node is in the core; limit : longest path allowed at or below the node.
    """

    parent: Ints
    letter: Ints
    child: Ints
    sibling: Ints
    core: npt.NDArray[np.bool_]
    limit: npt.NDArray[np.float64]
    size: int = 1
    words: dict[int, tuple[int, ...]] = field(default_factory=dict)

    @classmethod
    def root(cls, limit: float, capacity: int = 256) -> Trie:
        """The trie that holds the empty word only."""
        trie = cls(
            np.full(capacity, -1, dtype=np.int64),
            np.zeros(capacity, dtype=np.int64),
            np.full(capacity, -1, dtype=np.int64),
            np.full(capacity, -1, dtype=np.int64),
            np.zeros(capacity, dtype=np.bool_),
            np.zeros(capacity),
        )
        trie.core[0] = True
        trie.limit[0] = limit
        return trie

    def word(self, node: int) -> tuple[int, ...]:
        """The word of a node."""
        if node == 0:
            return ()
        if node not in self.words:
            self.words[node] = (*self.word(int(self.parent[node])), int(self.letter[node]))
        return self.words[node]


@njit(cache=True)
def trie_grown(parent, letter, child, sibling, core, limit):
    """The trie's arrays at twice their capacity."""
    n = len(parent)
    parent2 = np.full(2 * n, -1, dtype=np.int64)
    letter2 = np.zeros(2 * n, dtype=np.int64)
    child2 = np.full(2 * n, -1, dtype=np.int64)
    sibling2 = np.full(2 * n, -1, dtype=np.int64)
    core2 = np.zeros(2 * n, dtype=np.bool_)
    limit2 = np.zeros(2 * n)
    parent2[:n] = parent
    letter2[:n] = letter
    child2[:n] = child
    sibling2[:n] = sibling
    core2[:n] = core
    limit2[:n] = limit
    return parent2, letter2, child2, sibling2, core2, limit2


@njit(cache=True)
def trie_child(node, a, letter, child, sibling):
    """The child of a node along letter a, or -1."""
    c = child[node]
    while c >= 0 and letter[c] != a:
        c = sibling[c]
    return c


@njit(cache=True)
def _may_wait(node, x, y, parent, letter, core, pending, margin):
    """Whether the letters that lead out of the core can all still be cancelled from a bend at
    (x, y)."""
    v = node
    while not core[v]:
        a = letter[v]
        side = 0 if a > 0 else 1
        i = abs(a) - 1
        if (
            x < pending[side, i, 0] - margin
            or y < pending[side, i, 1] - margin
            or x > pending[side, i, 2] + margin
            or y > pending[side, i, 3] + margin
        ):
            return False
        u = parent[v]
        while not core[u]:
            if letter[u] == a:
                return False
            u = parent[u]
        v = parent[v]
    return True


@njit(cache=True)
def explore(
    source, start, target, length, ends, first, turn, gap, letters, segment_row, arrival_row,
    gap_row, radius, arc_nodes, pending, margin,
    parent, letter, child, sibling, core, limit, size, grow, keep, cap,
):  # fmt: skip
    """All taut paths from node `source` whose words stay in (or pend from) the core.

    grow : whether new non-looping words join the core. keep : whether to keep the search tree, so
    that paths can be written out. cap : most states to visit.

    Returns the trie's arrays, and per hit: goal point, trie node, length, state, departure, angle
    slid before the departure; then the tree (parent state, departure, angle slid); then whether
    the cap stopped the search.
    """
    room = 1024
    s_node = np.empty(room, dtype=np.int64)
    s_first = np.empty(room, dtype=np.int64)
    s_turn = np.empty(room)
    s_word = np.empty(room, dtype=np.int64)
    s_length = np.empty(room)
    s_parent = np.empty(room, dtype=np.int64)
    s_edge = np.empty(room, dtype=np.int64)
    s_slid = np.empty(room)
    stack = np.empty(room, dtype=np.int64)
    hits = 0
    h_room = 256
    h_goal = np.empty(h_room, dtype=np.int64)
    h_word = np.empty(h_room, dtype=np.int64)
    h_length = np.empty(h_room)
    h_state = np.empty(h_room, dtype=np.int64)
    h_edge = np.empty(h_room, dtype=np.int64)
    h_slid = np.empty(h_room)
    # arrivals seen, by (word, directed arc): collinear tangents give one path several spellings
    slots = 4096
    seen_key = np.full(slots, -1, dtype=np.int64)
    seen_length = np.empty(slots)
    seen_used = 0
    nodes = len(radius)
    capped = False

    s_node[0], s_first[0], s_turn[0], s_word[0] = source, start[source], 0.0, 0
    s_length[0], s_parent[0], s_edge[0], s_slid[0] = 0.0, -1, -1, 0.0
    stack[0] = 0
    top, count, visited = 1, 1, 0
    while top > 0:
        top -= 1
        sid = stack[top]
        node, e, slid, t, base_length = (
            s_node[sid], s_first[sid], s_turn[sid], s_word[sid], s_length[sid],
        )  # fmt: skip
        if not keep:
            count = top
        visited += 1
        if visited > cap:
            capped = True
            break
        row_start = start[node]
        if row_start == start[node + 1]:
            continue
        r = radius[node]
        while True:
            here = base_length + r * slid
            if here > limit[t]:
                break
            reached = here + length[e]
            w = t
            for k in range(segment_row[e, 0], segment_row[e, 1]):
                a = letters[k]
                w, size = _step(
                    w, a, parent, letter, child, sibling, core, limit, size, grow, pending
                )
                if w < 0:
                    break
                if size == len(parent):
                    parent, letter, child, sibling, core, limit = trie_grown(
                        parent, letter, child, sibling, core, limit
                    )
            goal = target[e]
            if w >= 0 and reached <= limit[w]:
                if goal >= arc_nodes:
                    if core[w]:
                        if hits == h_room:
                            h_room *= 2
                            h_goal = _grown_int(h_goal, h_room)
                            h_word = _grown_int(h_word, h_room)
                            h_length = _grown_float(h_length, h_room)
                            h_state = _grown_int(h_state, h_room)
                            h_edge = _grown_int(h_edge, h_room)
                            h_slid = _grown_float(h_slid, h_room)
                        h_goal[hits], h_word[hits], h_length[hits] = goal - arc_nodes, w, reached
                        h_state[hits], h_edge[hits], h_slid[hits] = sid, e, slid
                        hits += 1
                elif first[e] >= 0 and (
                    core[w]
                    or _may_wait(w, ends[e, 2], ends[e, 3], parent, letter, core, pending, margin)
                ):
                    # one arrival per (word, directed arc) and place along it
                    f = first[e]
                    mark = reached + radius[goal] * turn[e]
                    code = w * nodes + goal
                    slot = (code * 0x9E3779B1) % slots
                    fresh = True
                    while seen_key[slot] >= 0:
                        if seen_key[slot] == code and abs(seen_length[slot] - mark) <= margin:
                            fresh = False
                            break
                        slot += 1
                        if slot == slots:
                            slot = 0
                    w2 = w
                    if fresh:
                        for k in range(arrival_row[e, 0], arrival_row[e, 1]):
                            a = letters[k]
                            w2, size = _step(
                                w2, a, parent, letter, child, sibling, core, limit, size, grow,
                                pending,
                            )  # fmt: skip
                            if w2 < 0:
                                break
                            if size == len(parent):
                                parent, letter, child, sibling, core, limit = trie_grown(
                                    parent, letter, child, sibling, core, limit
                                )
                    if fresh and w2 >= 0:
                        seen_key[slot] = code
                        seen_length[slot] = mark
                        seen_used += 1
                        if 2 * seen_used > slots:
                            seen_key, seen_length = _rehashed(seen_key, seen_length)
                            slots = len(seen_key)
                        if count == room or top == room:
                            room *= 2
                            s_node = _grown_int(s_node, room)
                            s_first = _grown_int(s_first, room)
                            s_turn = _grown_float(s_turn, room)
                            s_word = _grown_int(s_word, room)
                            s_length = _grown_float(s_length, room)
                            s_parent = _grown_int(s_parent, room)
                            s_edge = _grown_int(s_edge, room)
                            s_slid = _grown_float(s_slid, room)
                            stack = _grown_int(stack, room)
                        s_node[count], s_first[count] = goal, f
                        s_turn[count], s_word[count] = max(turn[e], 0.0), w2
                        s_length[count] = reached
                        s_parent[count], s_edge[count], s_slid[count] = sid, e, slid
                        stack[top] = count
                        top += 1
                        count += 1
            if gap[e] < 0.0:
                break
            dead = False
            for k in range(gap_row[e, 0], gap_row[e, 1]):
                a = letters[k]
                t, size = _step(
                    t, a, parent, letter, child, sibling, core, limit, size, grow, pending
                )
                if t < 0:
                    dead = True
                    break
                if size == len(parent):
                    parent, letter, child, sibling, core, limit = trie_grown(
                        parent, letter, child, sibling, core, limit
                    )
            if dead:
                break
            slid += gap[e]
            e += 1
            if e == start[node + 1]:
                e = row_start
            if not core[t] and not _may_wait(
                t, ends[e, 0], ends[e, 1], parent, letter, core, pending, margin
            ):
                break
    return (
        (parent, letter, child, sibling, core, limit, size),
        (h_goal[:hits], h_word[:hits], h_length[:hits], h_state[:hits], h_edge[:hits],
         h_slid[:hits]),
        (s_parent[:count].copy(), s_edge[:count].copy(), s_slid[:count].copy()),
        capped,
    )  # fmt: skip


@njit(cache=True)
def _step(node, a, parent, letter, child, sibling, core, limit, size, grow, pending):
    """The trie node after one more letter, made if it may exist; -1 if no wanted word follows."""
    if node > 0 and letter[node] == -a:
        return parent[node], size
    c = trie_child(node, a, letter, child, sibling)
    if c >= 0:
        return c, size
    joins = False
    if grow and core[node]:
        joins = True
        v = node
        while v > 0:
            if letter[v] == a:
                joins = False
                break
            v = parent[v]
    if not joins:
        side = 0 if a > 0 else 1
        if pending[side, abs(a) - 1, 0] > pending[side, abs(a) - 1, 2]:
            return -1, size
    c = size
    parent[c], letter[c], core[c], limit[c] = node, a, joins, limit[node]
    child[c] = -1
    sibling[c] = child[node]
    child[node] = c
    return c, size + 1


@njit(cache=True)
def _grown_int(a, n):
    b = np.empty(n, dtype=np.int64)
    b[: len(a)] = a
    return b


@njit(cache=True)
def _grown_float(a, n):
    b = np.empty(n)
    b[: len(a)] = a
    return b


@njit(cache=True)
def _rehashed(key, value):
    n = 2 * len(key)
    key2 = np.full(n, -1, dtype=np.int64)
    value2 = np.empty(n)
    for i in range(len(key)):
        if key[i] >= 0:
            slot = (key[i] * 0x9E3779B1) % n
            while key2[slot] >= 0:
                slot += 1
                if slot == n:
                    slot = 0
            key2[slot] = key[i]
            value2[slot] = value[i]
    return key2, value2


def run_explore(
    graph: TangentGraph,
    source: int,
    trie: Trie,
    *,
    grow: bool,
    keep: bool,
    margin: float,
    cap: int,
) -> tuple[tuple[npt.NDArray[Any], ...], tuple[npt.NDArray[Any], ...], bool]:
    """Run the kernel from point `source`; updates the trie. Returns hits, tree, capped."""
    arrays, hits, tree, capped = explore(
        graph.point_node(source), graph.start, graph.target, graph.length, graph.ends,
        graph.first, graph.turn, graph.gap, graph.letters, graph.segment_row, graph.arrival_row,
        graph.gap_row, graph.radius, 2 * len(graph.arcs), graph.pending, margin,
        trie.parent, trie.letter, trie.child, trie.sibling, trie.core, trie.limit, trie.size,
        grow, keep, cap,
    )  # fmt: skip
    (trie.parent, trie.letter, trie.child, trie.sibling, trie.core, trie.limit, trie.size) = arrays
    return hits, tree, capped

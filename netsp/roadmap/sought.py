"""Legs from the classes of a goal by one search for all their relative words.

Lengths are translation-invariant on the cover: pairs with the same goals and the same relative word
share one taut path.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from netsp.arrays import Bools, Floats, Ints
from netsp.clock import Flag
from netsp.compiled.growing import longer, more_int_rows
from netsp.compiled.kernel import kernel
from netsp.errors import NetspError
from netsp.hsignature import concatenate, invert
from netsp.roadmap.explore import run_explore
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.slits import Ends, Slits, room_for, string
from netsp.roadmap.trie import CORE, LETTER, PARENT, Trie, add_child, trie_child

EXCESS, WORTH = 0.1, 0.7
"""A search costs far more the longer the paths may be, and no class has two taut paths. Legs are
first sought up to the first share beyond their lengths among slits, which they rarely exceed, if
the longest path that is then allowed is at most the second share of what the tethers allow."""

GOAL, FOLLOWING, NODE = range(3)
"""Columns of an entry: goal, the next entry of the same node, node of the trie."""


class Tethers(NamedTuple):
    """Vertices for the kernel: words as rows of `letters` from row[v] to row[v + 1], cluster,
    planar tether length, last bend; and of the bends (`TetherTree`) parent, depth and length."""

    letters: Ints
    row: Ints
    cluster: Ints
    planar: Floats
    last: Ints
    parent: Ints
    depth: Ints
    length: Floats


def sought(
    paths: TautPaths, g: int, here: Ints, there: Ints, asked: Bools, tethers: Tethers, ends: Ends,
    stop: Flag,
) -> Floats:  # fmt: skip
    """(len(here), len(there)) planar lengths of the legs asked for, from classes of goal g; inf
    where none is asked for, and everywhere when the flag is set."""
    margin, pending = paths.margin, paths.tangents.pending
    nodes, size, head, entry, low, most, pair = _wanted(
        here, there, asked, tethers, margin, ends, paths.slits
    )
    found = np.full(len(entry), np.inf)
    likely = np.minimum(most, (1.0 + EXCESS) * low + margin)
    first = likely.max(initial=0.0) <= WORTH * most.max(initial=0.0)
    for longest in (likely, most) if first else (most,):
        left = np.flatnonzero(np.isinf(found))
        if not len(left):
            break
        limit = _limits(nodes, size, entry[left, NODE], longest[left], pending)
        hits = run_explore(
            paths.tangents, g, Trie(nodes.copy(), limit, size), margin=paths.outline.margin,
            stop=stop,
        )  # fmt: skip
        if hits.capped:
            return np.full((len(here), len(there)), np.inf)
        _match(hits.goal, hits.word, hits.length, head, entry, found)
    if np.isinf(found).any():
        k = int(np.argmax(np.isinf(found)))
        a, b = np.argwhere(pair == k)[0]
        u, v = (
            tuple(tethers.letters[tethers.row[i] : tethers.row[i + 1]].tolist())
            for i in (here[a], there[b])
        )
        raise NetspError(
            f"internal: no taut leg found between goal #{g - 1} and goal "
            f"#{tethers.cluster[there[b]] - 1} for word {concatenate(invert(u), v)}; please "
            "report the problem file"
        )
    return np.where(pair >= 0, np.append(found, np.inf)[pair], np.inf)


@kernel
def longest_word(here: Ints, there: Ints, row: Ints) -> int:
    """Most letters of a vertex of two lists."""
    longest = int(np.int64(0))  # no literal: callees are compiled once
    for v in here:
        longest = max(longest, row[v + 1] - row[v])
    for v in there:
        longest = max(longest, row[v + 1] - row[v])
    return longest


@kernel
def _together(u: int, v: int, last: Ints, parent: Ints, depth: Ints) -> int:
    """The last bend that the tethers of two vertices share."""
    s, t = last[u], last[v]
    while s != t:
        if depth[s] >= depth[t]:
            s = parent[s]
        else:
            t = parent[t]
    return int(s)


@kernel
def _shared(u: int, v: int, letters: Ints, row: Ints) -> int:
    """How many letters two words begin with in common."""
    n = min(row[u + 1] - row[u], row[v + 1] - row[v])
    for k in range(n):
        if letters[row[u] + k] != letters[row[v] + k]:
            return k
    return int(n)


@kernel
def _entry(goal: int, node: int, head: Ints, entry: Ints) -> int:
    """The entry of a goal in a node's list, -1 if there is none."""
    e = head[node, 0]
    while e >= 0 and entry[e, GOAL] != goal:
        e = entry[e, FOLLOWING]
    return int(e)


@kernel
def _wanted(
    here: Ints, there: Ints, asked: Bools, tethers: Tethers, margin: float, ends: Ends,
    slits: Slits,
) -> tuple[Ints, int, Ints, Ints, Floats, Floats, Ints]:  # fmt: skip
    """The trie of all relative words between two lists of vertices.

    Returns the trie and its size; per node the head of a list of entries; the entries, each of
    which is a goal and a relative word, with the bounds of its leg from below (among slits) and
    above (along the tethers); and the entry of each pair.
    """
    letters, row, cluster, planar = tethers.letters, tethers.row, tethers.cluster, tethers.planar
    last, parent, depth, length = tethers.last, tethers.parent, tethers.depth, tethers.length
    trie = np.full((256, 5), -1, dtype=np.int64)
    trie[0, LETTER], trie[0, CORE] = 0, 1
    zero, one = int(np.int64(0)), int(np.int64(1))  # no literals: callees are compiled once
    size = one
    head = np.full((256, 1), -1, dtype=np.int64)
    entry = np.empty((1024, 3), dtype=np.int64)
    low, most = np.empty(1024), np.empty(1024)
    entries = zero
    longest = longest_word(here, there, row)
    room = room_for(longest, slits)
    pair = np.full((len(here), len(there)), -1, dtype=np.int64)
    for a in range(len(here)):
        u = here[a]
        for b in range(len(there)):
            v = there[b]
            if not asked[a, b]:
                continue
            # the tethers run together up to where they part, and a leg need not go back so far
            part = length[_together(u, v, last, parent, depth)]
            bound = planar[u] + planar[v] - 2.0 * part + margin
            shared = _shared(u, v, letters, row)
            back, on = row[u + 1] - row[u] - shared, row[v + 1] - row[v] - shared
            while size + back + on >= len(trie):
                trie = more_int_rows(trie)
                head = more_int_rows(head)
            node = zero
            for k in range(back + on):
                if k < back:
                    x = -letters[row[u + 1] - 1 - k]
                else:
                    x = letters[row[v] + shared + k - back]
                c = trie_child(node, x, trie)
                if c < 0:
                    c = size
                    add_child(node, x, one, c, trie)
                    head[c, 0] = -1
                    size += 1
                node = c
            e = _entry(cluster[v], node, head, entry)
            if e < 0:
                if entries == len(entry):
                    entry = more_int_rows(entry)
                    low, most = longer(low), longer(most)
                e = entries
                entries += 1
                entry[e, GOAL], entry[e, FOLLOWING], entry[e, NODE] = (
                    cluster[v], head[node, 0], node
                )  # fmt: skip
                head[node, 0] = e
                (low[e], _), most[e] = string(u, v, ends, slits, room), bound
            most[e] = min(most[e], bound)
            pair[a, b] = e
    return trie, size, head[:size, 0], entry[:entries], low[:entries], most[:entries], pair


@kernel
def _limits(trie: Ints, size: int, node: Ints, longest: Floats, pending: Floats) -> Floats:
    """Per node of the trie, the longest path that may stand there on its way to a word that is
    sought, given the nodes of these and how long their paths may be; -1 if there is none."""
    limit = np.full(len(trie), -1.0)
    for k in range(len(node)):
        c = node[k]
        while c >= 0 and limit[c] < longest[k]:
            limit[c] = longest[k]
            c = trie[c, PARENT]
    # a path may stand on a longer word whose last letters it will still cancel
    for c in range(1, size):
        x = trie[c, LETTER]
        side, i = (0, x - 1) if x > 0 else (1, -x - 1)
        if pending[side, i, 0] <= pending[side, i, 2]:
            limit[c] = max(limit[c], limit[trie[c, PARENT]])
    return limit


@kernel
def _match(
    goal: Ints, node: Ints, length: Floats, head: Ints, entry: Ints, found: Floats
) -> None:  # fmt: skip
    """The shortest hit of every entry, into `found`."""
    for i in range(len(goal)):
        if node[i] < len(head):
            e = head[node[i]]
            while e >= 0:
                if entry[e, GOAL] == goal[i]:
                    found[e] = min(found[e], length[i])
                    break
                e = entry[e, FOLLOWING]

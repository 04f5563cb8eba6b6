"""Exact legs between augmented goals, searched goal by goal."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import NamedTuple

import numpy as np

from netsp.arrays import Bools, Floats, Ints
from netsp.clock import NEVER, Clock, Flag
from netsp.compiled.growing import longer, more_int_rows
from netsp.compiled.kernel import kernel
from netsp.errors import LimitReachedError, NetspError
from netsp.hsignature import Word, concatenate, invert
from netsp.memory import ask
from netsp.roadmap.arcs import Arcs
from netsp.roadmap.classes import TetherTree
from netsp.roadmap.explore import run_explore
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.pulled import path_for, pull, pull_each
from netsp.roadmap.slits import Ends, Slits, flattened, room_for, slit_lengths, string
from netsp.roadmap.trie import CORE, LETTER, PARENT, Trie, add_child, trie_child
from netsp.travel.graph import UNTIMED

BLOCK = 256
"""Rows of a matrix that are worked on at a time, so that what is in between stays small."""

FEW = 20_000
"""So many entries of a matrix are pulled one by one, hundredths of a second; more by both cores."""

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


class TautLegs:
    """Exact legs between given augmented goals. Satisfies `netsp.travel.graph.Legs`.

    Parameters
    ----------
    cluster, signatures, planar
        Goal (0 is the base), word and planar taut tether length of each vertex.
    tree
        Where their tethers part, if known.
    """

    def __init__(
        self,
        paths: TautPaths,
        cluster: Ints,
        signatures: Sequence[Word],
        planar: Floats,
        tree: TetherTree | None = None,
    ) -> None:
        self.paths, self.cluster, self.planar = paths, cluster, planar
        self.signatures = list(signatures)
        self._z = paths.problem.points[:, 2]
        nothing = np.zeros(1, dtype=np.int64)
        self._tree = tree or TetherTree(np.zeros_like(cluster), nothing - 1, np.zeros(1))

    def lengths(
        self, vertices: Ints, asked: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        """(k, k) 3D leg lengths among the given vertices; inf within a cluster, and where `asked`
        is given and false. LimitReachedError when the clock is up before all of many are measured.

        Lengths are translation-invariant on the cover: all pairs with the same goals and the same
        relative word share one taut path, so each goal is searched once, for all relative words.
        """
        vertices = np.asarray(vertices, dtype=np.int64)
        cluster = self.cluster[vertices]
        if asked is not None and asked.sum() <= max(FEW, 2 * len(vertices)):
            return self._few(vertices, asked)
        ask(
            2.0 * 8.0 * len(vertices) ** 2,
            f"legs between {len(vertices)} homotopy classes",
            "lower tether_length or max_classes",
        )
        # what takes a fraction of a second is measured all the same, or there would be no tour
        count = len(vertices) ** 2 if asked is None else int(asked.sum())
        stop = clock.flag if clock is not None and count > UNTIMED**2 else NEVER
        out = np.full((len(vertices), len(vertices)), np.inf)
        letters, row = flattened([self.signatures[v] for v in vertices])
        tethers = Tethers(
            letters, row, cluster, self.planar[vertices], self._tree.last[vertices],
            self._tree.parent, self._tree.depth, self._tree.length,
        )  # fmt: skip
        if asked is None:
            asked = np.ones(out.shape, dtype=bool)
        goals = np.unique(cluster)

        def measure(g: int) -> None:
            here = np.flatnonzero(cluster == g)
            there = np.flatnonzero(cluster > g)
            if len(there) == 0 or stop[0]:
                return
            if g == 0:
                block = np.broadcast_to(tethers.planar[there], (len(here), len(there)))
            else:
                block = self._legs_from(g, here, there, asked, tethers, stop)
            block = np.hypot(block, (self._z[g] - self._z[cluster[there]])[None, :])
            out[np.ix_(here, there)] = block
            out[np.ix_(there, here)] = block.T

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(measure, goals.tolist()))
        if stop[0]:
            raise LimitReachedError(
                f"time limit reached while measuring the legs between {len(vertices)} homotopy "
                "classes; lower tether_length or raise the limit"
            )
        return out

    def _legs_from(
        self, g: int, here: Ints, there: Ints, asked: Bools, tethers: Tethers, stop: Flag
    ) -> Floats:
        """(len(here), len(there)) planar lengths of all legs from the classes of goal g."""
        paths = self.paths
        places, cluster = paths.outline.places, tethers.cluster
        cells = paths.slits.cells(places[:, 0])
        ends = Ends(places[cluster], cells[cluster], tethers.letters, tethers.row)
        out = np.full((len(here), len(there)), np.inf)
        left = _pulled(here, there, asked, cluster, ends, paths.slits, paths.arcs, out, stop)
        if left and not stop[0]:
            asked = asked[np.ix_(here, there)] & np.isinf(out)
            found = self._sought(g, here, there, asked, tethers, ends, stop)
            np.minimum(out, found, out=out)
        return out

    def _sought(
        self, g: int, here: Ints, there: Ints, asked: Bools, tethers: Tethers, ends: Ends,
        stop: Flag,
    ) -> Floats:  # fmt: skip
        """As `_legs_from`, by one search for all relative words of those asked, which is as large
        as the block."""
        paths = self.paths
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
            if hits.capped:  # the time is up; the caller says so
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

    def to_base(self) -> Floats:
        """(V,) 3D lengths of the legs from the base, which are the tethers."""
        return np.asarray(np.hypot(self.planar, self._z[self.cluster] - self._z[0]))

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        """(k, k) lower bounds on leg lengths: a leg is no shorter than its class among slits
        (`netsp.roadmap.slits`), nor than the difference of its two tethers (triangle inequality
        on the cover).

        Parameters
        ----------
        rows
            (r,) positions among the vertices; then (r, k).
        """
        vertices = np.asarray(vertices, dtype=np.int64)
        cluster, planar, z = self.cluster[vertices], self.planar[vertices], self._z
        own = np.arange(len(vertices)) if rows is None else np.asarray(rows, dtype=np.int64)
        ask(
            3.0 * 8.0 * len(own) * len(vertices),
            f"bounds on the legs between {len(vertices)} homotopy classes",
            "lower tether_length or max_classes",
        )
        stop = NEVER if clock is None else clock.flag
        words = [self.signatures[v] for v in vertices]
        low = slit_lengths(self.paths.slits, self.paths.outline.places, cluster, words, rows, stop)
        if stop[0]:
            raise LimitReachedError(
                f"time limit reached while bounding the legs between {len(vertices)} homotopy "
                "classes; lower tether_length or raise the limit"
            )
        for first in range(0, len(own), BLOCK):
            part, block = own[first : first + BLOCK], low[first : first + BLOCK]
            np.maximum(block, np.abs(planar[part][:, None] - planar[None, :]), out=block)
            # rounding must not lift a bound above the length
            block -= self.paths.margin
            np.maximum(block, 0.0, out=block)
            if np.ptp(z) > 0.0:
                np.hypot(block, z[cluster[part]][:, None] - z[cluster][None, :], out=block)
        return low

    def relative_word(self, u: int, v: int) -> Word:
        """The word of the leg from vertex u to vertex v."""
        return concatenate(invert(self.signatures[u]), self.signatures[v])

    def path(self, u: int, v: int) -> Floats:
        """(n, 3) polyline of the taut leg from vertex u to vertex v, arcs circumscribed; height
        changes in proportion to planar length."""
        if u > v:  # searched once for both senses
            return self.path(v, u)[::-1].copy()
        word, longest = self.relative_word(u, v), self._longest(u, v)
        return self.paths.path(int(self.cluster[u]), int(self.cluster[v]), word, longest)

    def _longest(self, u: int, v: int) -> float:
        """More than the planar length of a leg: back along one tether to where the other parts."""
        s, t, tree = int(self._tree.last[u]), int(self._tree.last[v]), self._tree
        while s != t:
            if tree.depth[s] >= tree.depth[t]:
                s = int(tree.parent[s])
            else:
                t = int(tree.parent[t])
        return float(self.planar[u] + self.planar[v] - 2.0 * tree.length[s])

    def _few(self, vertices: Ints, asked: Bools) -> Floats:
        """As `lengths`, for a few legs; those that cannot be pulled are searches of their own."""
        out = np.full(asked.shape, np.inf)
        rows, columns = np.nonzero(np.triu(asked, 1) | np.tril(asked, -1).T)
        us, vs = vertices[rows], vertices[columns]
        apart = self.cluster[us] != self.cluster[vs]
        rows, columns, us, vs = rows[apart], columns[apart], us[apart], vs[apart]
        out[rows, columns] = out[columns, rows] = self.pairs(us, vs)
        return out

    def pairs(self, us: Ints, vs: Ints) -> Floats:
        """(k,) 3D lengths of legs between vertices of different goals."""
        planar = self._each(us, vs)
        for k in np.flatnonzero(planar < 0.0).tolist():
            u, v = int(us[k]), int(vs[k])
            a, b = int(self.cluster[u]), int(self.cluster[v])
            planar[k] = self.paths.planar_length(
                a, b, self.relative_word(u, v), self._longest(u, v)
            )
        return np.asarray(np.hypot(planar, self._z[self.cluster[us]] - self._z[self.cluster[vs]]))

    def _each(self, us: Ints, vs: Ints) -> Floats:
        """(k,) planar lengths of legs, negative where they could not be pulled."""
        paths, (ends, point) = self.paths, self._ends
        out = np.empty(len(us))

        def some(first: int) -> None:
            k = slice(first, first + FEW)
            pull_each(us[k], vs[k], ends, point, paths.slits, paths.arcs, out[k])

        if len(us) <= FEW:
            some(0)
        else:
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                list(pool.map(some, range(0, len(us), FEW)))
        return out

    @cached_property
    def _ends(self) -> tuple[Ends, Ints]:
        """Of all vertices, and their points."""
        places, point = self.paths.outline.places, np.asarray(self.cluster, dtype=np.int64)
        letters, row = flattened(self.signatures)
        return Ends(places[point], self.paths.slits.cells(places[:, 0])[point], letters, row), point


@kernel
def _pulled(
    here: Ints, there: Ints, asked: Bools, cluster: Ints, ends: Ends, slits: Slits, arcs: Arcs,
    out: Floats, stop: Ints,
) -> int:  # fmt: skip
    """The planar lengths of legs between two lists of vertices, into (len(here), len(there)) `out`;
    how many of those asked for could not be pulled."""
    longest_word = _longest_word(here, there, ends.row)
    room, path = room_for(longest_word, slits), path_for(longest_word)
    left = 0
    for a in range(len(here)):
        if stop[0] != 0:
            break
        u = here[a]
        for b in range(len(there)):
            v = there[b]
            if asked[u, v]:
                length, _, _ = pull(u, v, ends, cluster, slits, arcs, room, path)
                if length >= 0.0:
                    out[a, b] = length
                else:
                    left += 1
    return left


@kernel
def _longest_word(here: Ints, there: Ints, row: Ints) -> int:
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
    longest_word = _longest_word(here, there, row)
    room = room_for(longest_word, slits)
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

"""Exact legs between augmented goals, searched goal by goal."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from netsp.arrays import Bools, Floats, Ints
from netsp.clock import NEVER, Clock, Flag
from netsp.compiled.growing import longer, more_int_rows
from netsp.compiled.kernel import kernel
from netsp.errors import LimitReachedError, NetspError
from netsp.hsignature import Word, concatenate, invert
from netsp.memory import ask
from netsp.roadmap.classes import TetherTree
from netsp.roadmap.explore import run_explore
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.slits import Slits, build_slits, slit_lengths
from netsp.roadmap.trie import CORE, LETTER, PARENT, Trie, add_child, trie_child
from netsp.travel.graph import UNTIMED

BLOCK = 256
"""Rows of a matrix that are worked on at a time, so that what is in between stays small."""


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
        self._slits: Slits | None = None
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
        if asked is not None and asked.sum() <= 2 * len(vertices):
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
        flat = [np.array(self.signatures[v], dtype=np.int64) for v in vertices]
        row = np.concatenate([[0], np.cumsum([len(w) for w in flat])]).astype(np.int64)
        letters = np.concatenate(flat).astype(np.int64) if row[-1] else np.zeros(0, np.int64)
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
        nodes, limit, size, head, entry_goal, entry_next, pair = _wanted(
            here, there, asked, tethers, self.paths.margin, self.paths.tangents.pending
        )
        hits = run_explore(
            self.paths.tangents,
            g,
            Trie(nodes, limit, size),
            margin=self.paths.outline.margin,
            stop=stop,
        )
        if hits.capped:  # the time is up; the caller says so
            return np.full((len(here), len(there)), np.inf)
        found = _match(
            hits.goal, hits.word, hits.length, head[:size], entry_goal, entry_next, len(entry_goal)
        )
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
        if self._slits is None:
            self._slits = build_slits(self.paths.problem)
        cluster, planar, z = self.cluster[vertices], self.planar[vertices], self._z
        own = np.arange(len(vertices)) if rows is None else np.asarray(rows, dtype=np.int64)
        ask(
            3.0 * 8.0 * len(own) * len(vertices),
            f"bounds on the legs between {len(vertices)} homotopy classes",
            "lower tether_length or max_classes",
        )
        stop = NEVER if clock is None else clock.flag
        words = [self.signatures[v] for v in vertices]
        low = slit_lengths(self._slits, self.paths.outline.places, cluster, words, rows, stop)
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
        """As `lengths`, for a few legs: each is a search of its own."""
        out = np.full(asked.shape, np.inf)
        for i, j in np.argwhere(np.triu(asked, 1)):
            u, v = int(vertices[i]), int(vertices[j])
            a, b = int(self.cluster[u]), int(self.cluster[v])
            if a == b:
                continue
            word, longest = self.relative_word(u, v), self._longest(u, v)
            planar = self.paths.planar_length(a, b, word, longest)
            out[i, j] = out[j, i] = math.hypot(planar, self._z[a] - self._z[b])
        return out


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
    while e >= 0 and entry[e, 0] != goal:
        e = entry[e, 1]
    return int(e)


@kernel
def _wanted(
    here: Ints, there: Ints, asked: Bools, tethers: Tethers, margin: float, pending: Floats
) -> tuple[Ints, Floats, int, Ints, Ints, Ints, Ints]:
    """The trie of all relative words between two lists of vertices.

    Returns the trie, per node the head of a list of (goal, entry), and the entry of each pair.
    """
    letters, row, cluster, planar = tethers.letters, tethers.row, tethers.cluster, tethers.planar
    last, parent, depth, length = tethers.last, tethers.parent, tethers.depth, tethers.length
    trie = np.full((256, 5), -1, dtype=np.int64)
    limit = np.zeros(256)
    trie[0, LETTER], trie[0, CORE] = 0, 1
    zero, one = int(np.int64(0)), int(np.int64(1))  # no literals: callees are compiled once
    size = one
    head = np.full((256, 1), -1, dtype=np.int64)
    entry = np.empty((1024, 2), dtype=np.int64)
    entries = zero
    pair = np.full((len(here), len(there)), -1, dtype=np.int64)
    for a in range(len(here)):
        u = here[a]
        for b in range(len(there)):
            v = there[b]
            if not asked[u, v]:
                continue
            # the tethers run together up to where they part, and a leg need not go back so far
            part = length[_together(u, v, last, parent, depth)]
            bound = planar[u] + planar[v] - 2.0 * part + margin
            shared = _shared(u, v, letters, row)
            back, on = row[u + 1] - row[u] - shared, row[v + 1] - row[v] - shared
            while size + back + on >= len(trie):
                trie = more_int_rows(trie)
                limit = longer(limit)
                head = more_int_rows(head)
            node = zero
            limit[0] = max(limit[0], bound)
            for k in range(back + on):
                if k < back:
                    x = -letters[row[u + 1] - 1 - k]
                else:
                    x = letters[row[v] + shared + k - back]
                c = trie_child(node, x, trie)
                if c < 0:
                    c = size
                    add_child(node, x, one, c, trie)
                    limit[c] = bound
                    head[c, 0] = -1
                    size += 1
                elif limit[c] < bound:
                    limit[c] = bound
                node = c
            e = _entry(cluster[v], node, head, entry)
            if e < 0:
                if entries == len(entry):
                    entry = more_int_rows(entry)
                e = entries
                entries += 1
                entry[e, 0], entry[e, 1] = cluster[v], head[node, 0]
                head[node, 0] = e
            pair[a, b] = e
    # a path may stand on a longer word whose last letters it will still cancel
    for c in range(1, size):
        x = trie[c, LETTER]
        side, i = (0, x - 1) if x > 0 else (1, -x - 1)
        if pending[side, i, 0] <= pending[side, i, 2]:
            limit[c] = max(limit[c], limit[trie[c, PARENT]])
    return trie, limit, size, head[:, 0], entry[:entries, 0], entry[:entries, 1], pair


@kernel
def _match(
    goal: Ints,
    node: Ints,
    length: Floats,
    head: Ints,
    entry_goal: Ints,
    entry_next: Ints,
    entries: int,
) -> Floats:
    """Shortest hit of every entry; inf where there is none."""
    out = np.full(entries, np.inf)
    for i in range(len(goal)):
        if node[i] < len(head):
            e = head[node[i]]
            while e >= 0:
                if entry_goal[e] == goal[i]:
                    out[e] = min(out[e], length[i])
                    break
                e = entry_next[e]
    return out

"""Homotopy-augmented graph of Bhattacharya, Likhachev & Kumar 2012 over any roadmap.

A vertex is (milestone, word): a milestone with the class of the path from the base. As in McCammon
& Hollinger 2017, section IV-A, a vertex exists only if the tether reaches it along the roadmap and
its word does not loop. An edge of the roadmap becomes one edge for every word at its tail; it leads
to the word with the edge's crossings appended and reduced.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.dynamic_array import longer, more_int_rows
from netsp.base.compiled.kernel import kernel
from netsp.base.errors import InputError, NetspError
from netsp.base.time_flags import NEVER, Flag
from netsp.hsignature import Word
from netsp.roadmap.trie import LETTER, PARENT, Trie, add_child, trie_child

if TYPE_CHECKING:
    import networkx


@dataclass(frozen=True)
class AugmentedGraph:
    """Graph over vertices (milestone, word); vertex 0 is (base, empty word).

    Attributes
    ----------
    points
        (milestones, 3) places.
    milestone, node, length
        (n,) milestone, word (as a trie node), and shortest length from the base.
    start, target, cost
        Edges in both directions, in compressed rows.
    complete
        Whether all vertices were found before the time was up.
    """

    points: Floats
    milestone: Ints
    node: Ints
    length: Floats
    start: Ints
    target: Ints
    cost: Floats
    trie: Trie
    complete: bool = True

    def __len__(self) -> int:
        return len(self.milestone)

    def word(self, v: int) -> Word:
        """Return the word of a vertex."""
        return self.trie.word(int(self.node[v]))

    @cached_property
    def _matrix(self) -> Any:
        from scipy.sparse import csr_array

        n = len(self)
        return csr_array((self.cost, self.target, self.start), shape=(n, n))

    def distances(
        self, sources: Ints, targets: Ints, check: Callable[[], None] = lambda: None
    ) -> Floats:
        """Return the shortest lengths (sources, targets) within the graph; inf if there is no path.

        Parameters
        ----------
        check
            Called now and then; may raise to stop.
        """
        from scipy.sparse.csgraph import dijkstra

        out = np.empty((len(sources), len(targets)))
        step = max(1, 1_000_000 // max(len(self), 1))
        for k in range(0, len(sources), step):
            check()
            rows = dijkstra(self._matrix, directed=True, indices=sources[k : k + step])
            out[k : k + step] = rows[:, targets]
        return out

    def tree(self, source: int) -> Ints:
        """Return the (n,) predecessors on shortest paths from a source."""
        from scipy.sparse.csgraph import dijkstra

        _, before = dijkstra(self._matrix, directed=True, indices=source, return_predecessors=True)
        return np.asarray(before, dtype=np.int64)

    def path(self, u: int, v: int, method: Literal["astar", "dijkstra"] = "astar") -> list[int]:
        """Return the vertices of a shortest path from u to v.

        The heuristic of A* is the straight distance, so both methods find the same length.
        """
        goal = self.points[self.milestone[v]]
        guide = np.zeros(len(self.points))
        if method == "astar":
            guide = np.linalg.norm(self.points - goal, axis=1)
        best = {u: 0.0}
        before = {u: -1}
        done: set[int] = set()
        queue = [(float(guide[self.milestone[u]]), u)]
        while queue:
            _, a = heapq.heappop(queue)
            if a == v:
                out = [v]
                while before[out[-1]] >= 0:
                    out.append(before[out[-1]])
                return out[::-1]
            if a in done:
                continue
            done.add(a)
            for e in range(self.start[a], self.start[a + 1]):
                b = int(self.target[e])
                d = best[a] + float(self.cost[e])
                if d < best.get(b, np.inf):
                    best[b], before[b] = d, a
                    heapq.heappush(queue, (d + float(guide[self.milestone[b]]), b))
        raise NetspError(f"internal: vertices {u} and {v} of the augmented graph are not joined")

    def to_networkx(self) -> networkx.Graph:
        """Return a networkx Graph: nodes are (milestone, word), with ``pos`` and ``length``; edges
        have ``weight``."""
        try:
            import networkx
        except ImportError:
            raise InputError("to_networkx needs networkx: pip install 'netsp[prm]'") from None
        graph = networkx.Graph()
        keys = [(int(m), self.word(v)) for v, m in enumerate(self.milestone)]
        for v, key in enumerate(keys):
            graph.add_node(key, pos=tuple(self.points[key[0]]), length=float(self.length[v]))
        for v in range(len(self)):
            for e in range(self.start[v], self.start[v + 1]):
                graph.add_edge(keys[v], keys[self.target[e]], weight=float(self.cost[e]))
        return graph


class DirectedEdges(NamedTuple):
    """Edges of a roadmap in both directions, in compressed rows.

    Attributes
    ----------
    start
        (milestones + 1,) row starts into the two arrays that follow.
    number
        Number of each edge; -1 - number if it is run backwards.
    head
        Milestone to which each edge leads.
    letters, row
        Ray crossings of the undirected edges, and row starts into them.
    """

    start: Ints
    number: Ints
    head: Ints
    letters: Ints
    row: Ints


def augment(
    points: Floats,
    edges: Ints,
    letters: tuple[Ints, Ints],
    tether_length: float,
    max_vertices: int,
    stop: Flag = NEVER,
) -> AugmentedGraph:
    """Augment a roadmap from milestone 0, the base.

    Parameters
    ----------
    points
        (n, 3) milestones.
    edges
        (k, 2) pairs of milestones.
    letters
        Ray crossings of all edges, and row starts into them.
    max_vertices
        Maximum number of vertices; more raise InputError.
    stop
        Flag of a clock; the graph then holds the vertices nearest to the base.
    """
    n = len(points)
    cost = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    tail = np.concatenate([edges[:, 0], edges[:, 1]])
    order = np.argsort(tail, kind="stable")
    start = np.searchsorted(tail[order], np.arange(n + 1)).astype(np.int64)
    # a directed edge is its undirected number, with the sign of its sense
    number = np.concatenate([np.arange(len(edges)), -1 - np.arange(len(edges))])[order]
    head = np.concatenate([edges[:, 1], edges[:, 0]])[order]
    directed = DirectedEdges(start, number, head, letters[0], letters[1])
    milestone, node, length, trie, size, ok, complete = _reach_vertices(
        directed, cost, float(tether_length), max_vertices, stop
    )
    if not ok:
        raise InputError(
            f"tether_length: {tether_length:g} gives more than {max_vertices} vertices "
            "(milestone, word); lower tether_length or samples, or raise max_augmented"
        )
    row, target, edge = _expand_edges(directed, milestone, node, trie, n)
    return AugmentedGraph(
        points,
        milestone,
        node,
        length,
        row,
        target,
        cost[edge],
        Trie(trie, np.zeros(0), size),
        complete,
    )


@kernel
def _slot(key: int, keys: Ints) -> int:
    """Return the slot of a key in a hash table with open addressing, or the empty slot for it."""
    slots = len(keys)
    slot = (key * 0x9E3779B1) % slots
    while keys[slot] >= 0 and keys[slot] != key:
        slot += 1
        if slot == slots:
            slot = 0
    return int(slot)


@kernel
def _word_after_edge(
    node: int, k: int, letters: Ints, row: Ints, trie: Ints, size: int
) -> tuple[int, int]:
    """Return the trie node after edge k (negative: backwards), and the size of the trie. Nodes are
    added if size >= 0; otherwise the node is -1 where the word is not in the trie."""
    backward = k < 0
    if backward:
        k = -1 - k
    for j in range(row[k], row[k + 1]):
        a = -letters[row[k + 1] - 1 - (j - row[k])] if backward else letters[j]
        if node > 0 and trie[node, LETTER] == -a:
            node = trie[node, PARENT]
            continue
        c = trie_child(node, a, trie)
        if c < 0:
            if size < 0:
                return -1, size
            add_child(node, a, 1, size, trie)
            c = size
            size += 1
        node = c
    return node, size


@kernel
def _is_looping(node: int, trie: Ints) -> bool:
    v = node
    while v > 0:
        u = trie[v, PARENT]
        while u > 0:
            if trie[u, LETTER] == trie[v, LETTER]:
                return True
            u = trie[u, PARENT]
        v = trie[v, PARENT]
    return False


@kernel
def _reach_vertices(
    edges: DirectedEdges, cost: Floats, limit: float, max_vertices: int, stop: Ints
) -> tuple[Ints, Ints, Floats, Ints, int, bool, bool]:
    """Search (milestone, word) by Dijkstra from (0, empty word), up to the tether length."""
    start, number, head, letters, row = edges
    trie = np.full((256, 5), -1, dtype=np.int64)
    trie[0, LETTER] = 0
    size = 1
    longest = 0
    for k in range(len(row) - 1):
        longest = max(longest, row[k + 1] - row[k])
    n = len(start) - 1
    # index of (milestone, word): open addressing
    slots = 4096
    slot_key = np.full(slots, -1, dtype=np.int64)
    slot_id = np.empty(slots, dtype=np.int64)
    ids = np.empty((1024, 2), dtype=np.int64)
    length = np.full(1024, np.inf)
    closed = np.zeros((1024, 1), dtype=np.int64)
    count = 1
    ids[0, 0], ids[0, 1], length[0] = 0, 0, 0.0
    slot_key[0], slot_id[0] = 0, 0
    heap_d = np.empty(4096)
    heap_v = np.empty((4096, 1), dtype=np.int64)
    heap_d[0], heap_v[0, 0] = 0.0, 0
    heap = 1
    while heap > 0:
        if stop[0] != 0:
            # what is not closed yet may still be reached by shorter paths
            kept = 0
            for i in range(count):
                if closed[i, 0] == 1:
                    ids[kept, 0], ids[kept, 1], length[kept] = ids[i, 0], ids[i, 1], length[i]
                    kept += 1
            return (
                ids[:kept, 0].copy(),
                ids[:kept, 1].copy(),
                length[:kept].copy(),
                trie,
                size,
                True,
                False,
            )
        d, v = heap_d[0], heap_v[0, 0]
        heap -= 1
        _sift_down(heap_d, heap_v, heap)
        if closed[v, 0] == 1:
            continue
        closed[v, 0] = 1
        m, w = ids[v, 0], ids[v, 1]
        for e in range(start[m], start[m + 1]):
            k = number[e]
            reached = d + cost[k if k >= 0 else -1 - k]
            if reached > limit:
                continue
            if size + longest >= len(trie):
                trie = more_int_rows(trie)
            w2, size = _word_after_edge(w, k, letters, row, trie, size)
            key = w2 * n + head[e]
            slot = _slot(key, slot_key)
            if slot_key[slot] < 0:
                if w2 != w and _is_looping(w2, trie):
                    continue
                if count == max_vertices:
                    return (
                        ids[:count, 0].copy(),
                        ids[:count, 1].copy(),
                        length[:count].copy(),
                        trie,
                        size,
                        False,
                        False,
                    )
                if count == len(ids):
                    ids = more_int_rows(ids)
                    longer_length = longer(length)
                    for i in range(count, len(longer_length)):
                        longer_length[i] = np.inf
                    length = longer_length
                    closed2 = np.zeros((2 * count, 1), dtype=np.int64)
                    for i in range(count):
                        closed2[i, 0] = closed[i, 0]
                    closed = closed2
                u = count
                count += 1
                ids[u, 0], ids[u, 1] = head[e], w2
                slot_key[slot], slot_id[slot] = key, u
                if 2 * count > slots:
                    slots *= 2
                    slot_key = np.full(slots, -1, dtype=np.int64)
                    slot_id = np.empty(slots, dtype=np.int64)
                    for i in range(count):
                        code = ids[i, 1] * n + ids[i, 0]
                        s = _slot(code, slot_key)
                        slot_key[s], slot_id[s] = code, i
            else:
                u = slot_id[slot]
            if reached < length[u]:
                length[u] = reached
                if heap == len(heap_d):
                    heap_d = longer(heap_d)
                    heap_v = more_int_rows(heap_v)
                _sift_up(heap_d, heap_v, heap, reached, u)
                heap += 1
    return (
        ids[:count, 0].copy(),
        ids[:count, 1].copy(),
        length[:count].copy(),
        trie,
        size,
        True,
        True,
    )


@kernel
def _sift_up(heap_d: Floats, heap_v: Ints, at: int, d: float, v: int) -> None:
    while at > 0:
        up = (at - 1) // 2
        if heap_d[up] <= d:
            break
        heap_d[at], heap_v[at, 0] = heap_d[up], heap_v[up, 0]
        at = up
    heap_d[at], heap_v[at, 0] = d, v


@kernel
def _sift_down(heap_d: Floats, heap_v: Ints, heap: int) -> None:
    """Put the last entry of the heap in the place of the first."""
    d, v = heap_d[heap], heap_v[heap, 0]
    at = 0
    while True:
        c = 2 * at + 1
        if c >= heap:
            break
        if c + 1 < heap and heap_d[c + 1] < heap_d[c]:
            c += 1
        if heap_d[c] >= d:
            break
        heap_d[at], heap_v[at, 0] = heap_d[c], heap_v[c, 0]
        at = c
    heap_d[at], heap_v[at, 0] = d, v


@kernel
def _expand_edges(
    edges: DirectedEdges, milestone: Ints, node: Ints, trie: Ints, n: int
) -> tuple[Ints, Ints, Ints]:
    """Return the edges among augmented vertices: row starts, targets and undirected edge
    numbers."""
    start, number, head, letters, row = edges
    count = len(milestone)
    slots = 4
    while slots < 2 * count + 2:
        slots *= 2
    slot_key = np.full(slots, -1, dtype=np.int64)
    slot_id = np.empty(slots, dtype=np.int64)
    total = 0
    for i in range(count):
        code = node[i] * n + milestone[i]
        s = _slot(code, slot_key)
        slot_key[s], slot_id[s] = code, i
        total += start[milestone[i] + 1] - start[milestone[i]]
    out_row = np.zeros(count + 1, dtype=np.int64)
    target = np.empty(total, dtype=np.int64)
    edge = np.empty(total, dtype=np.int64)
    m = 0
    for v in range(count):
        for e in range(start[milestone[v]], start[milestone[v] + 1]):
            k = number[e]
            w, _ = _word_after_edge(node[v], k, letters, row, trie, -1)
            if w < 0:
                continue
            code = w * n + head[e]
            s = _slot(code, slot_key)
            if slot_key[s] == code:
                target[m] = slot_id[s]
                edge[m] = k if k >= 0 else -1 - k
                m += 1
        out_row[v + 1] = m
    return out_row, target[:m].copy(), edge[:m].copy()

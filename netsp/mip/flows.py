"""Minimum cuts between the base and each cluster at a fractional point, by Dinic's algorithm."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.dynamic_array import order_of
from netsp.base.compiled.kernel import kernel

TINY = 1e-11
"""Residual capacity that counts as none."""

ALIKE = 1e-11
"""Share of a capacity up to which two are the same."""


@kernel
def joined(n: int, tail: Ints, head: Ints, capacity: Floats, sink: int) -> Ints:
    """(n,) what each vertex is part of: two are joined by an edge that is no less than all others
    of either together. A set that has one of them is cut no more with the other as well. The sink,
    which no set may have, is joined to nothing."""
    degree = np.zeros(n)
    for e in range(len(tail)):
        degree[tail[e]] += capacity[e]
        degree[head[e]] += capacity[e]
    parent = np.arange(n)
    for e in range(len(tail)):
        u, v = tail[e], head[e]
        if sink in (u, v) or 2.0 * capacity[e] < (1.0 - ALIKE) * max(degree[u], degree[v]):
            continue
        while parent[u] != u:
            parent[u] = parent[parent[u]]
            u = parent[u]
        while parent[v] != v:
            parent[v] = parent[parent[v]]
            v = parent[v]
        parent[max(u, v)] = min(u, v)
    out, count = np.empty(n, dtype=np.int64), 0
    for v in range(n):
        if parent[v] == v:
            out[v] = count
            count += 1
        else:
            u = parent[v]
            while parent[u] != u:
                u = parent[u]
            out[v] = out[u]
    return out


@kernel
def min_cuts(
    n: int,
    tail: Ints,
    head: Ints,
    capacity: Floats,
    cluster: Ints,
    sink: int,
    wanted: Ints,
    enough: float,
) -> tuple[Bools, Ints, Floats]:
    """For every wanted cluster C the vertex set S of least ``capacity(δ(S))`` with all of C and
    without the sink, if that is below `enough`.

    Vertices that no set is cut more for having together count as one (`joined`), and clusters that
    lie within the same one are asked for once. Where the value is not below `enough` and C lies
    within one, that one is in no set below `enough` without the sink, and counts as the sink from
    then on (as in Padberg & Rinaldi 1990): flows become short. Clusters come in the order of their
    distance to the sink, in edges: most are then beside one that counts as it.

    Returns (k, n) flags of the vertices in the sets found, the cluster and the value of each. A
    source joined to each vertex of C without limit makes it one maximum flow; it ends as soon as
    the flow is enough.

    Parameters
    ----------
    n
        Vertices.
    tail, head, capacity
        Undirected edges.
    """
    node = joined(n, tail, head, capacity, sink)
    nodes, sink = node.max() + 1, node[sink]
    crossing = node[tail] != node[head]
    tail, head, capacity = node[tail[crossing]], node[head[crossing]], capacity[crossing]
    edges = len(tail)
    arcs = 2 * edges + 2 * nodes
    # arc 2 e and 2 e + 1 are the two senses of edge e, then come source -> v and back
    first = np.full(nodes + 1, -1, dtype=np.int64)
    following = np.empty(arcs, dtype=np.int64)
    to = np.empty(arcs, dtype=np.int64)
    rest = np.empty(arcs)
    for e in range(edges):
        to[2 * e], to[2 * e + 1] = head[e], tail[e]
        following[2 * e] = first[tail[e]]
        first[tail[e]] = 2 * e
        following[2 * e + 1] = first[head[e]]
        first[head[e]] = 2 * e + 1
    for v in range(nodes):
        a = 2 * edges + 2 * v
        to[a], to[a + 1] = v, nodes
        following[a] = first[nodes]
        first[nodes] = a
        following[a + 1] = first[v]
        first[v] = a + 1
    level = np.empty(nodes + 1, dtype=np.int64)
    queue = np.empty(nodes + 1, dtype=np.int64)
    at = np.empty(nodes + 1, dtype=np.int64)
    path = np.empty(nodes + 2, dtype=np.int64)
    inside = np.zeros((len(wanted), n), dtype=np.bool_)
    which = np.empty(len(wanted), dtype=np.int64)
    value = np.empty(len(wanted))
    found = 0
    is_sink = np.zeros(nodes + 1, dtype=np.bool_)
    is_sink[sink] = True
    # breadth first from the sink
    level[:] = nodes + 1
    level[sink], queue[0] = 0, sink
    low, high = 0, 1
    while low < high:
        v = queue[low]
        low += 1
        a = first[v]
        while a >= 0:
            w = to[a]
            if w < nodes and level[w] > nodes:
                level[w] = level[v] + 1
                queue[high] = w
                high += 1
            a = following[a]
    far = np.full(max(cluster.max(), wanted.max() if len(wanted) else 0) + 1, nodes + 1.0)
    for v in range(n):
        far[cluster[v]] = min(far[cluster[v]], level[node[v]])
    met = np.zeros(nodes, dtype=np.bool_)
    for c in wanted[order_of(far[wanted])]:
        rest[2 * edges :] = 0.0
        last, in_one = -1, True
        for v in range(n):
            if cluster[v] == c:
                rest[2 * edges + 2 * node[v]] = np.inf
                in_one = in_one and last in (-1, node[v])
                last = node[v]
        if last < 0 or (in_one and met[last]):
            continue
        met[last] = met[last] or in_one
        for e in range(edges):
            rest[2 * e] = rest[2 * e + 1] = capacity[e]
        flow = 0.0
        while flow < enough:
            for v in range(nodes + 1):
                level[v] = -1
            level[nodes] = 0
            queue[0] = nodes
            low, high = 0, 1
            reached = nodes + 1
            while low < high:
                v = queue[low]
                low += 1
                if level[v] >= reached:
                    break
                a = first[v]
                while a >= 0:
                    w = to[a]
                    if rest[a] > TINY and level[w] < 0:
                        level[w] = level[v] + 1
                        queue[high] = w
                        high += 1
                        if is_sink[w]:
                            reached = level[w]
                    a = following[a]
            if reached > nodes:
                break
            for v in range(nodes + 1):
                at[v] = first[v]
            depth = 0
            v = nodes
            while True:
                if is_sink[v]:
                    push = np.inf
                    for k in range(depth):
                        push = min(push, rest[path[k]])
                    back = depth
                    for k in range(depth - 1, -1, -1):
                        a = path[k]
                        rest[a] -= push
                        rest[a ^ 1] += push
                        if rest[a] <= TINY:
                            back = k
                    flow += push
                    if flow >= enough:
                        break
                    depth = back
                    v = to[path[depth] ^ 1]
                    continue
                a = at[v]
                while a >= 0 and not (rest[a] > TINY and level[to[a]] == level[v] + 1):
                    a = following[a]
                at[v] = a
                if a >= 0:
                    path[depth] = a
                    depth += 1
                    v = to[a]
                elif depth == 0:
                    break
                else:
                    level[v] = -1
                    depth -= 1
                    v = to[path[depth] ^ 1]
        if flow >= enough:
            if in_one:
                is_sink[last] = True
            continue
        # level marks what the source still reaches
        some = False
        for v in range(n):
            inside[found, v] = level[node[v]] >= 0
            some = some or inside[found, v]
        if some:
            which[found], value[found] = c, flow
            found += 1
    return inside[:found], which[:found], value[:found]

"""Minimum cuts between the base and each cluster at a fractional point, by Dinic's algorithm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.dynamic_array import order_of
from netsp.base.compiled.kernel import kernel

RESIDUAL_TOLERANCE = 1e-11
"""Tolerance below which a residual capacity counts as zero."""

CAPACITY_TOLERANCE = 1e-11
"""Tolerance, relative, within which two capacities count as equal."""


class Edges(NamedTuple):
    """Undirected edges of a flow network."""

    tail: Ints
    head: Ints
    capacity: Floats


class _Network(NamedTuple):
    """Arcs of a flow network whose last node is the source.

    Arcs 2 e and 2 e + 1 are the two directions of edge e; then come, for each node, the arc from
    the source and its reverse. `first` is the first arc of each node, `following` the next arc of
    the same node.
    """

    first: Ints
    following: Ints
    to: Ints
    residual: Floats


@kernel
def contracted(n: int, edges: Edges, sink: int) -> Ints:
    """Return the contracted node of each vertex.

    An edge is contracted if it has at least the capacity of all other edges of either end: a set
    that holds one end is then cut no more with both. The sink is not contracted.
    """
    tail, head, capacity = edges.tail, edges.head, edges.capacity
    degree = np.zeros(n)
    for e in range(len(tail)):
        degree[tail[e]] += capacity[e]
        degree[head[e]] += capacity[e]
    parent = np.arange(n)
    for e in range(len(tail)):
        u, v = tail[e], head[e]
        largest = max(degree[u], degree[v])
        if sink in (u, v) or 2.0 * capacity[e] < (1.0 - CAPACITY_TOLERANCE) * largest:
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
    n: int, edges: Edges, cluster: Ints, sink: int, wanted: Ints, max_capacity: float
) -> tuple[Bools, Ints, Floats]:
    """Return the minimum cuts below `max_capacity` between the sink and each wanted cluster.

    A source with unlimited edges to the vertices of a cluster makes its cut one maximum flow, which
    ends as soon as it is that large. Vertices are contracted first, and clusters within one
    contracted node are cut once. If such a node has no cut below `max_capacity`, it counts as a
    sink from then on (Padberg & Rinaldi 1990), which makes flows short. Clusters come in the order
    of their distance from the sink in edges, so that most lie beside a sink.

    Parameters
    ----------
    n
        Number of vertices.

    Returns
    -------
    inside : ndarray of bool, shape (k, n)
        Vertices on the cluster's side of each cut.
    which : ndarray of int, shape (k,)
        Cluster of each cut.
    value : ndarray, shape (k,)
        Capacity of each cut.
    """
    node = contracted(n, edges, sink)
    nodes, sink = node.max() + 1, node[sink]
    crossing = node[edges.tail] != node[edges.head]
    tail, head = node[edges.tail[crossing]], node[edges.head[crossing]]
    capacity = edges.capacity[crossing]
    network = _network(nodes, tail, head)
    inside = np.zeros((len(wanted), n), dtype=np.bool_)
    which = np.empty(len(wanted), dtype=np.int64)
    value = np.empty(len(wanted))
    found = 0
    is_sink = np.zeros(nodes + 1, dtype=np.bool_)
    is_sink[sink] = True
    level = _distances(sink, network)
    distance = np.full(max(cluster.max(), wanted.max() if len(wanted) else 0) + 1, nodes + 1.0)
    for v in range(n):
        distance[cluster[v]] = min(distance[cluster[v]], level[node[v]])
    is_done = np.zeros(nodes, dtype=np.bool_)
    for c in wanted[order_of(distance[wanted])]:
        last, in_one = _join_source(network, node, cluster == c)
        if last < 0 or (in_one and is_done[last]):
            continue
        is_done[last] = is_done[last] or in_one
        for e in range(len(tail)):
            network.residual[2 * e] = network.residual[2 * e + 1] = capacity[e]
        flow = _max_flow(network, is_sink, level, max_capacity)
        if flow >= max_capacity:
            is_sink[last] = is_sink[last] or in_one
            continue
        # level marks what the source still reaches
        for v in range(n):
            inside[found, v] = level[node[v]] >= 0
        if inside[found].any():
            which[found], value[found] = c, flow
            found += 1
    return inside[:found], which[:found], value[:found]


@kernel
def _join_source(network: _Network, node: Ints, members: Bools) -> tuple[int, bool]:
    """Join the source to the nodes of some vertices, and to no other, without limit.

    Return the last node, -1 for none, and whether it is the only one.
    """
    nodes = len(network.first) - 1
    start = len(network.to) - 2 * nodes
    network.residual[start:] = 0.0
    last, in_one = -1, True
    for v in range(len(members)):
        if members[v]:
            network.residual[start + 2 * node[v]] = np.inf
            in_one = in_one and last in (-1, node[v])
            last = node[v]
    return last, in_one


@kernel
def _network(nodes: int, tail: Ints, head: Ints) -> _Network:
    edges = len(tail)
    arcs = 2 * edges + 2 * nodes
    first = np.full(nodes + 1, -1, dtype=np.int64)
    following = np.empty(arcs, dtype=np.int64)
    to = np.empty(arcs, dtype=np.int64)
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
    return _Network(first, following, to, np.empty(arcs))


@kernel
def _distances(start: int, network: _Network) -> Ints:
    """Return the distance of each node from a node in edges, without the source's arcs."""
    nodes = len(network.first) - 1
    level = np.full(nodes + 1, nodes + 1, dtype=np.int64)
    queue = np.empty(nodes + 1, dtype=np.int64)
    level[start], queue[0] = 0, start
    low, high = 0, 1
    while low < high:
        v = queue[low]
        low += 1
        a = network.first[v]
        while a >= 0:
            w = network.to[a]
            if w < nodes and level[w] > nodes:
                level[w] = level[v] + 1
                queue[high] = w
                high += 1
            a = network.following[a]
    return level


@kernel
def _max_flow(network: _Network, is_sink: Bools, level: Ints, max_capacity: float) -> float:
    """Return the maximum flow from the source to the sinks by Dinic's algorithm, or `max_capacity`.

    `level` becomes the distance of each node from the source along residual arcs, -1 if there is no
    such path.
    """
    nodes = len(network.first) - 1
    queue = np.empty(nodes + 1, dtype=np.int64)
    path = np.empty(nodes + 2, dtype=np.int64)
    flow = 0.0
    while flow < max_capacity:
        if not _layer(network, is_sink, level, queue):
            break
        flow = _augmented(network, is_sink, level, path, flow, max_capacity)
    return flow


@kernel
def _layer(network: _Network, is_sink: Bools, level: Ints, queue: Ints) -> bool:
    """Fill in `level` breadth first and return whether a sink is reached."""
    nodes = len(network.first) - 1
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
        a = network.first[v]
        while a >= 0:
            w = network.to[a]
            if network.residual[a] > RESIDUAL_TOLERANCE and level[w] < 0:
                level[w] = level[v] + 1
                queue[high] = w
                high += 1
                if is_sink[w]:
                    reached = level[w]
            a = network.following[a]
    return bool(reached <= nodes)


@kernel
def _augmented(
    network: _Network, is_sink: Bools, level: Ints, path: Ints, flow: float, max_capacity: float
) -> float:
    """Return the flow after augmenting along all paths of a layered network, or `max_capacity`."""
    to, residual = network.to, network.residual
    at = network.first.copy()
    depth = 0
    v = len(at) - 1
    while True:
        if is_sink[v]:
            push = np.inf
            for k in range(depth):
                push = min(push, residual[path[k]])
            first_full = depth
            for k in range(depth - 1, -1, -1):
                a = path[k]
                residual[a] -= push
                residual[a ^ 1] += push
                if residual[a] <= RESIDUAL_TOLERANCE:
                    first_full = k
            flow += push
            if flow >= max_capacity:
                return flow
            depth = first_full
            v = to[path[depth] ^ 1]
            continue
        a = at[v]
        while a >= 0 and not (residual[a] > RESIDUAL_TOLERANCE and level[to[a]] == level[v] + 1):
            a = network.following[a]
        at[v] = a
        if a >= 0:
            path[depth] = a
            depth += 1
            v = to[a]
        elif depth == 0:
            return flow
        else:
            level[v] = -1
            depth -= 1
            v = to[path[depth] ^ 1]

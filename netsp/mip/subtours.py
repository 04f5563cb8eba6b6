"""Finding violated subtour cuts, at fractional points by minimum cuts, at integer ones by sight."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, maximum_flow

from netsp.mip.program import Cut

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

VIOLATION = 1e-4
"""Least violation worth a cut."""

_SCALE = 10_000_000


def components(x: Floats, legs: Ints, y: Floats) -> tuple[int, Ints]:
    """Connected components of the support (vertices with x > 0); label -1 elsewhere."""
    on = y > 1e-9
    n = len(x)
    u, v = legs[on].T
    graph = coo_array((np.ones(len(u)), (u, v)), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    label = np.where(x > 1e-9, label, -1)
    used = np.unique(label[label >= 0])
    renumber = {int(old): new for new, old in enumerate(used)}
    return len(used), np.array([renumber.get(int(k), -1) for k in label], dtype=np.int64)


def whole_clusters(
    inside: npt.NDArray[np.bool_], x: Floats, cluster: Ints
) -> npt.NDArray[np.bool_]:
    """S with each cluster completed whose support lies inside: no weaker, and often stronger."""
    m = int(cluster.max()) + 1
    weight = np.bincount(cluster[inside], weights=x[inside], minlength=m)
    return np.asarray(inside | (weight[cluster] > 1.0 - 1e-9))


def component_cuts(x: Floats, legs: Ints, y: Floats, cluster: Ints) -> list[Cut]:
    """One cut for each component of the support that the base is not in."""
    count, label = components(x, legs, y)
    cuts = []
    for k in range(count):
        inside = label == k
        if label[0] == k or not inside.any():
            continue
        weight = np.bincount(cluster[inside], weights=x[inside])
        best = int(np.argmax(weight))
        cuts.append(Cut(whole_clusters(inside, x, cluster), best))
    return cuts


def fractional_cuts(x: Floats, legs: Ints, y: Floats, cluster: Ints) -> list[Cut]:
    """Cuts violated by a fractional point: for every cluster C the most violated S.

    Minimum cut between the base and a source joined to each v of C by capacity 2 x_v: its value is
    the minimum over S of y(δ(S)) + 2 x(C \\ S), and (S, C) is violated when that is below 2.
    """
    cuts = component_cuts(x, legs, y, cluster)
    if cuts:
        return cuts
    support = np.flatnonzero(x > 1e-9)
    local = np.full(len(x), -1)
    local[support] = np.arange(len(support))
    on = y > 1e-9
    u, v = local[legs[on, 0]], local[legs[on, 1]]
    weight = np.rint(y[on] * _SCALE).astype(np.int64)
    n = len(support)
    seen: set[bytes] = set()
    for c in range(1, int(cluster.max()) + 1):
        members = local[support[cluster[support] == c]]
        into = np.rint(2.0 * x[support[members]] * _SCALE).astype(np.int64)
        rows = np.concatenate([u, v, np.full(len(members), n)])
        cols = np.concatenate([v, u, members])
        capacity = np.concatenate([weight, weight, into]).astype(np.int32)
        graph = csr_array((capacity, (rows, cols)), shape=(n + 1, n + 1), dtype=np.int32)
        flow = maximum_flow(graph, n, int(local[0]))
        if flow.flow_value >= (2.0 - VIOLATION) * _SCALE:
            continue
        residual = graph - flow.flow
        residual.data[residual.data < 0] = 0
        residual.eliminate_zeros()
        reached = breadth_first_order(residual, n, return_predecessors=False)
        inside = np.zeros(len(x), dtype=bool)
        inside[support[reached[reached < n]]] = True
        if not inside.any() or inside[0]:
            continue
        full = whole_clusters(inside, x, cluster)
        # the cluster best served inside S makes the cut as deep as S allows
        served = np.bincount(cluster[full], weights=x[full])
        key = full.tobytes()
        if key not in seen:
            seen.add(key)
            cuts.append(Cut(full, int(np.argmax(served))))
    return cuts


def tour_from(x: Floats, legs: Ints, y: Floats) -> list[list[int]]:
    """The cycles of an integer point, each a list of vertices; the base's cycle first."""
    on = legs[y > 0.5]
    neighbours: dict[int, list[int]] = {}
    for u, v in on.tolist():
        neighbours.setdefault(u, []).append(v)
        neighbours.setdefault(v, []).append(u)
    cycles = []
    left = dict.fromkeys([0, *np.flatnonzero(x > 0.5).tolist()])
    while left:
        first = next(iter(left))
        cycle, before, here = [], -1, first
        while here in left:
            del left[here]
            cycle.append(here)
            onward = [w for w in neighbours.get(here, []) if w != before and w in left]
            if not onward:
                break
            before, here = here, onward[0]
        cycles.append(cycle)
    return cycles

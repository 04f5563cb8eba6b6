"""Finding violated subtour cuts.

At integer points by sight: the components of the support. At fractional points by components, too,
by minimum cuts among the clusters, by the branches of the cover (for every prefix of a word, the
vertices whose word begins with it: sets that belong together in space and need no search) and by
minimum cuts among the vertices, which find a violated cut for a cluster if there is one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.hsignature import Word
from netsp.mip.blossoms import cluster_flows
from netsp.mip.cuts import Cut
from netsp.mip.flows import min_cuts

VIOLATION = 1e-4
"""Least violation worth a cut."""

MOST_CUTS = 60
"""Most cuts from one point beside those of components."""


def components(x: Floats, legs: Ints, y: Floats) -> tuple[int, Ints]:
    """Connected components of the support (vertices with x > 0); label -1 elsewhere."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    on = y > 1e-9
    n = len(x)
    u, v = legs[on].T
    graph = coo_array((np.ones(len(u)), (u, v)), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    label = np.where(x > 1e-9, label, -1)
    used = np.unique(label[label >= 0])
    renumber = {int(old): new for new, old in enumerate(used)}
    return len(used), np.array([renumber.get(int(k), -1) for k in label], dtype=np.int64)


def complete_clusters(inside: Bools, x: Floats, cluster: Ints) -> Bools:
    """S with each cluster completed whose support lies inside: no weaker, and often stronger."""
    m = int(cluster.max()) + 1
    weight = np.bincount(cluster[inside], weights=x[inside], minlength=m)
    return np.asarray(inside | (weight[cluster] > 1.0 - 1e-9))


def component_cuts(
    x: Floats, legs: Ints, y: Floats, cluster: Ints, near: Ints | None = None
) -> list[Cut]:
    """One cut for each component of the support that the base is not in.

    Parameters
    ----------
    near
        (V,) the visited vertex nearest to each, itself if it is visited. Vertices that are not
        visited then go with it: they carry no flow, so the cut is as violated, and the same subtour
        in a neighbouring class, which the next LP would pay for instead, is cut with it.
    """
    count, label = components(x, legs, y)
    cuts = []
    for k in range(count):
        inside = label == k
        if label[0] == k or not inside.any():
            continue
        if near is not None:
            inside = inside[near]
        full = complete_clusters(inside, x, cluster)
        cuts.append(strongest_cut(full, x, legs, y, cluster)[1])
    return cuts


def strongest_cut(
    inside: Bools, x: Floats, legs: Ints, y: Floats, cluster: Ints
) -> tuple[float, Cut]:
    """How much a point violates y(δ(S ∪ C)) >= 2 with the cluster C for which that is most, and the
    cut. All of C in S is stronger than the part of it that is in S already: by (3) the cut is
    y(E(S)) <= x(S \\ C), and more of C adds to the left side alone."""
    ends = cluster[legs]
    u, v = inside[legs].T
    # by cluster, half of what the violation gains when all of it is in S
    gain = np.zeros(int(cluster.max()) + 1)
    np.add.at(gain, cluster[inside], x[inside])
    np.add.at(gain, ends[u & ~v, 1], y[u & ~v])
    np.add.at(gain, ends[v & ~u, 0], y[v & ~u])
    gain[0] = -np.inf
    c = int(np.argmax(gain))
    violation = 2.0 * float(gain[c]) - float(y[u ^ v].sum())
    return violation, Cut(inside | (cluster == c), c)


def goal_cuts(legs: Ints, y: Floats, cluster: Ints) -> list[Cut]:
    """Violated cuts of sets of whole clusters: those of least crossing, one for each cluster, or
    for some that no set is crossed more for having together. They say nothing of classes, so that
    no other class of a goal gets round them."""
    between = cluster_flows(legs, y, cluster)
    tail, head = map(np.ascontiguousarray, np.nonzero(np.triu(between)))
    goals = np.arange(1, len(between))
    sets, which, _ = min_cuts(
        len(between), tail, head, between[tail, head], np.arange(len(between)), 0, goals,
        2.0 - VIOLATION,
    )  # fmt: skip
    distinct = {s.tobytes(): (s, int(c)) for s, c in zip(sets, which, strict=True)}
    return [Cut(s[cluster], c) for s, c in distinct.values()]


def cover_branches(signatures: Sequence[Word]) -> Bools:
    """(k, V) vertices of every branch of the cover with more than one vertex and not all."""
    rows: dict[Word, list[int]] = {}
    for v, word in enumerate(signatures):
        for k in range(1, len(word) + 1):
            rows.setdefault(word[:k], []).append(v)
    distinct = {tuple(r) for r in rows.values() if len(r) > 1}
    out = np.zeros((len(distinct), len(signatures)), dtype=bool)
    for k, row in enumerate(sorted(distinct)):
        out[k, list(row)] = True
    return out


def fractional_cuts(
    x: Floats,
    legs: Ints,
    y: Floats,
    cluster: Ints,
    branch: Bools | None = None,
    near: Ints | None = None,
) -> list[Cut]:
    """Cuts violated by a fractional point: of components, and the most violated of others; `near`
    as of `component_cuts`. An LP costs far more than looking for cuts, so that all are taken at
    once: with thousands of classes it takes a quarter of the rounds."""
    cuts = component_cuts(x, legs, y, cluster, near) + goal_cuts(legs, y, cluster)
    known = {np.packbits(c.inside).tobytes() for c in cuts}
    support = np.flatnonzero(x > 1e-9)
    on = y > 1e-9
    legs, y = legs[on], y[on]
    found: dict[bytes, tuple[float, Bools, int]] = {}
    if branch is not None and len(branch):
        crossing = (branch[:, legs[:, 0]] ^ branch[:, legs[:, 1]]) @ y
        served = np.zeros((len(branch), int(cluster.max()) + 1))
        for v in support:
            served[:, cluster[v]] += branch[:, v] * x[v]
        worst = 2.0 * served.max(axis=1) - crossing
        for k in np.argsort(-worst, kind="stable"):
            if worst[k] <= VIOLATION or len(found) >= MOST_CUTS:
                break
            _add(found, branch[k], x, legs, y, cluster)
    if len(found) < MOST_CUTS // 2:
        local = np.full(len(x), -1, dtype=np.int64)
        local[support] = np.arange(len(support))
        sets, _, _ = min_cuts(
            len(support),
            local[legs[:, 0]],
            local[legs[:, 1]],
            y,
            cluster[support],
            int(local[0]),
            np.arange(1, int(cluster.max()) + 1),
            2.0 - VIOLATION,
        )
        for row in sets:
            inside = np.zeros(len(x), dtype=bool)
            inside[support[row]] = True
            if near is not None:
                inside = inside[near]
            _add(found, inside, x, legs, y, cluster)
    new = [f for key, f in found.items() if key not in known]
    best = sorted(new, key=lambda f: -f[0])[:MOST_CUTS]
    return cuts + [Cut(inside, c) for _, inside, c in best]


def _add(
    found: dict[bytes, tuple[float, Bools, int]],
    inside: Bools,
    x: Floats,
    legs: Ints,
    y: Floats,
    cluster: Ints,
) -> None:
    """Keep the cut of a set, completed by whole clusters, for the cluster it serves best."""
    if inside[0]:
        return
    full = complete_clusters(inside, x, cluster)
    violation, cut = strongest_cut(full, x, legs, y, cluster)
    key = np.packbits(cut.inside).tobytes()
    if violation > VIOLATION / 2.0 and (key not in found or violation > found[key][0]):
        found[key] = (violation, cut.inside, cut.cluster)


def cycles_of(x: Floats, legs: Ints, y: Floats) -> list[list[int]]:
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


def heaviest_walk(legs: Ints, y: Floats, cluster: Ints) -> list[int]:
    """Clusters by walking from the base along the heaviest leg to one not yet visited."""
    m = int(cluster.max())
    weight = np.zeros((m + 1, m + 1))
    np.add.at(weight, (cluster[legs[:, 0]], cluster[legs[:, 1]]), y)
    weight += weight.T
    left = np.ones(m + 1, dtype=bool)
    left[0] = False
    order, here = [0], 0
    while left.any():
        here = int(np.argmax(np.where(left, weight[here] + 1e-9, -1.0)))
        left[here] = False
        order.append(here)
    return order

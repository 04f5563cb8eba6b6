"""Separation of subtour cuts.

At integer points they are the components of the support. At fractional points they are found by
components, too, by minimum cuts among clusters, by families of labels (for every prefix of a label,
the vertices whose label begins with it, which lie together), and by minimum cuts among vertices,
which find a violated cut of a cluster if there is one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.deprecated import deprecated_names
from netsp.gtsp.instance import Label
from netsp.mip.blossoms import cluster_flows
from netsp.mip.cuts import Cut
from netsp.mip.flows import Edges, min_cuts
from netsp.mip.mip_policy import CutPolicy

SUPPORT_TOLERANCE = 1e-9
"""Tolerance below which a value of an LP's point counts as zero."""


def components(x: Floats, legs: Ints, y: Floats) -> tuple[int, Ints]:
    """Return the number of components of the support, and each vertex's, -1 where x is 0."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    is_used = y > SUPPORT_TOLERANCE
    n = len(x)
    u, v = legs[is_used].T
    graph = coo_array((np.ones(len(u)), (u, v)), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    label = np.where(x > SUPPORT_TOLERANCE, label, -1)
    used = np.unique(label[label >= 0])
    renumber = {int(old): new for new, old in enumerate(used)}
    return len(used), np.array([renumber.get(int(k), -1) for k in label], dtype=np.int64)


def complete_clusters(inside: Bools, x: Floats, cluster: Ints) -> Bools:
    """Return S with each cluster completed whose support lies inside, which strengthens a cut."""
    m = int(cluster.max()) + 1
    weight = np.bincount(cluster[inside], weights=x[inside], minlength=m)
    return np.asarray(inside | (weight[cluster] > 1.0 - SUPPORT_TOLERANCE))


def component_cuts(
    x: Floats, legs: Ints, y: Floats, cluster: Ints, near: Ints | None = None
) -> list[Cut]:
    """Return a cut for each component of the support without the base.

    Parameters
    ----------
    near
        (V,) the visited vertex nearest to each, itself if it is visited. An unvisited vertex joins
        the set of its nearest: it carries no flow, so the cut is as violated, and also cuts off the
        same subtour in neighbouring classes, which the next LP would choose instead.
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
    """Return the largest violation of y(δ(S ∪ C)) >= 2 over all clusters C, and its cut.

    With all of C in S the cut is stronger than with a part: by (3) the cut is
    y(E(S)) <= x(S \\ C), and more of C adds to the left side alone.
    """
    ends = cluster[legs]
    u, v = inside[legs].T
    # half of the gain in violation if all of a cluster is in S, by cluster
    gain = np.zeros(int(cluster.max()) + 1)
    np.add.at(gain, cluster[inside], x[inside])
    np.add.at(gain, ends[u & ~v, 1], y[u & ~v])
    np.add.at(gain, ends[v & ~u, 0], y[v & ~u])
    gain[0] = -np.inf
    c = int(np.argmax(gain))
    violation = 2.0 * float(gain[c]) - float(y[u ^ v].sum())
    return violation, Cut(inside | (cluster == c), c)


def goal_cuts(legs: Ints, y: Floats, cluster: Ints, policy: CutPolicy = CutPolicy()) -> list[Cut]:
    """Return violated cuts of sets of whole clusters: a minimum cut for each contracted cluster.

    They hold whichever classes are visited, so no other class of a goal evades them.
    """
    flow = cluster_flows(legs, y, cluster)
    tail, head = map(np.ascontiguousarray, np.nonzero(np.triu(flow)))
    goals, numbers = np.arange(1, len(flow)), np.arange(len(flow))
    enough = 2.0 - policy.min_subtour_violation
    edges = Edges(tail, head, flow[tail, head])
    sets, which, _ = min_cuts(len(flow), edges, numbers, 0, goals, enough)
    distinct = {s.tobytes(): (s, int(c)) for s, c in zip(sets, which, strict=True)}
    return [Cut(s[cluster], c) for s, c in distinct.values()]


def label_families(labels: Sequence[Label]) -> Bools:
    """Return masks (k, V) of the sets of several vertices whose labels begin alike."""
    rows: dict[Label, list[int]] = {}
    for v, label in enumerate(labels):
        for k in range(1, len(label) + 1):
            rows.setdefault(label[:k], []).append(v)
    distinct = {tuple(r) for r in rows.values() if len(r) > 1}
    out = np.zeros((len(distinct), len(labels)), dtype=bool)
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
    policy: CutPolicy = CutPolicy(),
) -> list[Cut]:
    """Return cuts violated by a fractional point.

    All separation procedures add their cuts at once, because an LP costs far more than separation:
    with thousands of classes this takes a quarter of the rounds.

    Parameters
    ----------
    branch
        Result of `label_families`.
    near
        Nearest visited vertices, for `component_cuts`.
    """
    cuts = component_cuts(x, legs, y, cluster, near)
    if "goals" in policy.families:
        cuts += goal_cuts(legs, y, cluster, policy)
    known = {np.packbits(c.inside).tobytes() for c in cuts}
    support = np.flatnonzero(x > SUPPORT_TOLERANCE)
    is_used = y > SUPPORT_TOLERANCE
    sets = _SetCuts(x, legs[is_used], y[is_used], cluster, policy)
    if branch is not None and len(branch) and "branches" in policy.families:
        sets.add_branches(branch, support)
    if "minimum cuts" in policy.families and len(sets.found) < policy.max_subtour_cuts // 2:
        sets.add_minimum_cuts(support, near)
    new = [f for key, f in sets.found.items() if key not in known]
    best = sorted(new, key=lambda f: -f[0])[: policy.max_subtour_cuts]
    return cuts + [cut for _, cut in best]


class _SetCuts:
    """Violated cuts of vertex sets, with their violation, by set.

    The legs of the point are those with y above 0.
    """

    def __init__(self, x: Floats, legs: Ints, y: Floats, cluster: Ints, policy: CutPolicy) -> None:
        self.x, self.legs, self.y, self.cluster, self.policy = x, legs, y, cluster, policy
        self.found: dict[bytes, tuple[float, Cut]] = {}

    def add_branches(self, branch: Bools, support: Ints) -> None:
        """Add the most violated cuts of branches of the cover."""
        cluster, policy = self.cluster, self.policy
        crossing = (branch[:, self.legs[:, 0]] ^ branch[:, self.legs[:, 1]]) @ self.y
        served = np.zeros((len(branch), int(cluster.max()) + 1))
        for v in support:
            served[:, cluster[v]] += branch[:, v] * self.x[v]
        violation = 2.0 * served.max(axis=1) - crossing
        for k in np.argsort(-violation, kind="stable"):
            is_weak = violation[k] <= policy.min_subtour_violation
            if is_weak or len(self.found) >= policy.max_subtour_cuts:
                break
            self.add(branch[k])

    def add_minimum_cuts(self, support: Ints, near: Ints | None) -> None:
        """Add the minimum cuts of all clusters among the visited vertices."""
        local = np.full(len(self.x), -1, dtype=np.int64)
        local[support] = np.arange(len(support))
        edges = Edges(local[self.legs[:, 0]], local[self.legs[:, 1]], self.y)
        goals = np.arange(1, int(self.cluster.max()) + 1)
        enough = 2.0 - self.policy.min_subtour_violation
        sets, _, _ = min_cuts(
            len(support), edges, self.cluster[support], int(local[0]), goals, enough
        )
        for row in sets:
            inside = np.zeros(len(self.x), dtype=bool)
            inside[support[row]] = True
            if near is not None:
                inside = inside[near]
            self.add(inside)

    def add(self, inside: Bools) -> None:
        """Add the strongest cut of a set that is completed by whole clusters, if it is violated."""
        if inside[0]:
            return
        full = complete_clusters(inside, self.x, self.cluster)
        violation, cut = strongest_cut(full, self.x, self.legs, self.y, self.cluster)
        key = np.packbits(cut.inside).tobytes()
        is_violated = violation > self.policy.min_subtour_violation / 2.0
        if is_violated and (key not in self.found or violation > self.found[key][0]):
            self.found[key] = (violation, cut)


def cycles_of(x: Floats, legs: Ints, y: Floats) -> list[list[int]]:
    """Return the cycles of an integer point as lists of vertices, the base's cycle first."""
    used_legs = legs[y > 0.5]
    neighbours: dict[int, list[int]] = {}
    for u, v in used_legs.tolist():
        neighbours.setdefault(u, []).append(v)
        neighbours.setdefault(v, []).append(u)
    cycles = []
    left = dict.fromkeys([0, *np.flatnonzero(x > 0.5).tolist()])
    while left:
        first = next(iter(left))
        cycle, before, current = [], -1, first
        while current in left:
            del left[current]
            cycle.append(current)
            onward = [w for w in neighbours.get(current, []) if w != before and w in left]
            if not onward:
                break
            before, current = current, onward[0]
        cycles.append(cycle)
    return cycles


def heaviest_walk(legs: Ints, y: Floats, cluster: Ints) -> list[int]:
    """Return the clusters in the order of a walk along the heaviest legs, from the base."""
    m = int(cluster.max())
    weight = np.zeros((m + 1, m + 1))
    np.add.at(weight, (cluster[legs[:, 0]], cluster[legs[:, 1]]), y)
    weight += weight.T
    left = np.ones(m + 1, dtype=bool)
    left[0] = False
    order, current = [0], 0
    while left.any():
        # the small constant picks a cluster even if no leg leads to any
        current = int(np.argmax(np.where(left, weight[current] + 1e-9, -1.0)))
        left[current] = False
        order.append(current)
    return order


__getattr__ = deprecated_names(globals(), cover_branches="label_families")

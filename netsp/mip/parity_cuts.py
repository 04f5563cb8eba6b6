"""Parity cuts: a tour crosses every barrier an even number of times.

A barrier is a number in the labels of vertices, in the plane the ray of an obstacle. A leg crosses
it if one of its ends is in the set H of vertices whose labels hold the number an odd number of
times, and the other is not. An LP that visits halves of vertices can cross a barrier once at no
cost, because it returns through other vertices of the same clusters. As in generalised 2-matching
inequalities (`netsp.mip.blossoms`), for an odd number k of teeth, pairs of clusters,

    y(δ(H)) - 2 Σ y(legs of a tooth in δ(H)) >= 1 - k,

because a tour has at most one leg between two clusters, and a tour with all k of these and no other
leg in δ(H) would cross it an odd number of times. If H is a union of clusters, these are 2-matching
inequalities; together they are the {0, 1/2}-cuts (Caprara & Fischetti 1996) of the equations of
degree and parity. For a set of barriers and a set of clusters, H holds the vertices whose labels
hold those numbers, plus one in those clusters, an odd number of times in all.

Separation chooses the clusters. A pair of clusters with the flow q across H costs min(q, 1 - q),
and is a tooth if q is more than a half; if the number of teeth is even, one pair is changed. A cut
is violated if its cost is below 1. To find the cheapest cut is NP-hard (it is the frustration index
of a signed graph), so clusters change sides one after another while the cost falls.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.interpretation import interprets
from netsp.base.compiled.kernel import kernel
from netsp.base.deprecated import deprecated_names
from netsp.gtsp.instance import Label
from netsp.mip.cuts import Cut
from netsp.mip.mip_policy import CutPolicy

FLOW_TOLERANCE = 1e-9
"""Tolerance below which a flow counts as zero, and two costs as equal."""


def odd_numbers(labels: Sequence[Label], count: int | None = None) -> Bools:
    """Return the mask (V, n) of the numbers that each label holds an odd number of times, whatever
    their sign.

    Parameters
    ----------
    count
        Largest number n; by default that in any label.
    """
    largest = max((abs(a) for label in labels for a in label), default=0)
    out = np.zeros((len(labels), largest if count is None else count), dtype=bool)
    for v, label in enumerate(labels):
        for a in label:
            out[v, abs(a) - 1] ^= True
    return out


def parity_cuts(
    legs: Ints,
    y: Floats,
    cluster: Ints,
    odd: Bools,
    check: Callable[[], None] = lambda: None,
    policy: CutPolicy = CutPolicy(),
) -> list[Cut]:
    """Return violated parity cuts, the most violated first.

    Parameters
    ----------
    odd
        Result of `odd_numbers`.
    check
        Called for each set of barriers; may raise to stop.
    """
    is_used = y > FLOW_TOLERANCE
    u, v = legs[is_used].T
    clusters = int(cluster.max()) + 1
    pairs, pair = _pairs_of(np.column_stack([cluster[u], cluster[v]]), clusters)
    row = np.searchsorted(np.sort(pairs.ravel()), np.arange(clusters + 1)).astype(np.int64)
    found: dict[tuple[object, ...], tuple[float, Cut]] = {}
    for size in (1, 2):
        if len(found) >= policy.max_cuts_before_pairs:
            break
        if math.comb(odd.shape[1], size) > policy.max_barrier_sets:
            break
        for barriers in combinations(range(odd.shape[1]), size):
            check()
            side_of = _sides(odd, barriers)
            flow = _flow(pair, side_of[u] ^ side_of[v], y[is_used], len(pairs))
            if not flow[:, 1].any():
                continue
            for sides in (np.zeros(clusters, dtype=np.bool_), _along_tree(pairs, flow, clusters)):
                cost, teeth = _cheapest(pairs, flow, row, sides, policy.max_parity_passes)
                if cost > 1.0 - policy.min_parity_violation or not teeth.any():
                    continue
                inside = side_of ^ sides[cluster]
                cut = Cut(inside, -1, tuple((int(a), int(b)) for a, b in pairs[teeth]))
                found.setdefault((inside.tobytes(), cut.teeth), (1.0 - cost, cut))
    best = sorted(found.values(), key=lambda f: -f[0])[: policy.max_parity_cuts]
    return [cut for _, cut in best]


def _pairs_of(ends: Ints, size: int) -> tuple[Ints, Ints]:
    """Return the pairs (p, 2) of numbers that occur as ends, and the pair (k,) of each leg."""
    g, h = np.sort(ends, axis=1).T
    keys, pair = np.unique(g * size + h, return_inverse=True)
    return np.column_stack([keys // size, keys % size]), pair


def _flow(pair: Ints, odd: Bools, y: Floats, pairs: int) -> Floats:
    """Return y of each pair's legs (p, 2) that cross barriers an even, and an odd, number of
    times."""
    out = np.zeros((pairs, 2))
    np.add.at(out, (pair, odd.astype(np.int64)), y)
    return out


def _sides(odd: Bools, barriers: tuple[int, ...]) -> Bools:
    """Return the mask (V,) of vertices whose labels hold an odd number of some barriers in all."""
    return np.asarray(np.logical_xor.reduce(odd[:, list(barriers)], axis=1))


def _along_tree(ends: Ints, flow: Floats, clusters: int) -> Bools:
    """Return sides (m + 1,) that a spanning tree of the most fractional pairs does not cross."""
    cost = np.minimum(flow, 1.0 - flow)
    order = np.argsort(-cost.ravel(), kind="stable")
    root, turned = np.arange(clusters), np.zeros(clusters, dtype=bool)
    pair_ends, costs = ends.tolist(), cost.ravel().tolist()
    for k in order.tolist():
        p, label = divmod(k, 2)
        if costs[k] <= FLOW_TOLERANCE:
            break
        a, b = pair_ends[p]
        if root[a] != root[b]:
            # the pair does not cross if its sides differ exactly where its legs cross
            is_crossing = bool(turned[a] ^ turned[b]) != bool(label)
            moved = root == root[b]
            turned[moved] ^= is_crossing
            root[moved] = root[a]
    return turned


@kernel
def _cheapest(
    ends: Ints, flow: Floats, row: Ints, sides: Bools, max_passes: int
) -> tuple[float, Bools]:
    """Change sides while the cost falls, and return the cost and the mask of pairs that are teeth.

    Parameters
    ----------
    flow
        (pairs, 2) y of the legs between two clusters that stay on one side, and that change.
    row
        Cluster c is in no pair if row[c] equals row[c + 1].
    """
    cost, change = _cost(ends, flow, sides)
    for _ in range(max_passes):
        best = cost
        for c in range(len(sides)):
            if row[c] == row[c + 1]:
                continue
            sides[c] ^= True
            now, at = _cost(ends, flow, sides)
            if now < cost - FLOW_TOLERANCE:
                cost, change = now, at
            else:
                sides[c] ^= True
        if cost > best - FLOW_TOLERANCE:
            break
    teeth = np.zeros(len(ends), dtype=np.bool_)
    for p in range(len(ends)):
        teeth[p] = _across(p, ends, flow, sides) > 0.5
    if change >= 0:
        teeth[change] = not teeth[change]
    return cost, teeth


@kernel
def _across(p: int, ends: Ints, flow: Floats, sides: Bools) -> float:
    """Return the flow of a pair of clusters across the handle."""
    return float(flow[p, 1] if sides[ends[p, 0]] == sides[ends[p, 1]] else flow[p, 0])


@kernel
def _cost(ends: Ints, flow: Floats, sides: Bools) -> tuple[float, int]:
    """Return the cost of sides, and the pair that is changed for it, -1 if none is."""
    total, odd, lowest, at = 0.0, False, np.inf, -1
    for p in range(len(ends)):
        q = _across(p, ends, flow, sides)
        if q > 0.5:
            total += 1.0 - q
            odd = not odd
        else:
            total += q
        if abs(1.0 - 2.0 * q) < lowest:
            lowest, at = abs(1.0 - 2.0 * q), p
    if odd:
        return total, -1
    return total + lowest, at


@interprets(_cheapest)
def _cheapest_in_numpy(
    ends: Ints, flow: Floats, row: Ints, sides: Bools, max_passes: int
) -> tuple[float, Bools]:
    """Vectorise `_cheapest`: cost the moves of all clusters together, and again after each move."""
    cost, change = _cost_in_numpy(ends, flow, sides)
    movable = np.flatnonzero(row[:-1] != row[1:])
    is_end = ((ends[:, :1] == movable) ^ (ends[:, 1:] == movable)).T
    for _ in range(max_passes):
        best, first = cost, 0
        while first < len(movable):
            is_whole = (sides[ends[:, 0]] == sides[ends[:, 1]]) ^ is_end[first:]
            costs, changes = _costs_of(np.where(is_whole, flow[:, 1], flow[:, 0]))
            cheaper = np.flatnonzero(costs < cost - FLOW_TOLERANCE)
            if not len(cheaper):
                break
            k = int(cheaper[0])
            sides[movable[first + k]] ^= True
            cost, change = float(costs[k]), int(changes[k])
            first += k + 1
        if cost > best - FLOW_TOLERANCE:
            break
    is_whole = sides[ends[:, 0]] == sides[ends[:, 1]]
    teeth = np.where(is_whole, flow[:, 1], flow[:, 0]) > 0.5
    if change >= 0:
        teeth[change] = not teeth[change]
    return cost, teeth


@interprets(_cost)
def _cost_in_numpy(ends: Ints, flow: Floats, sides: Bools) -> tuple[float, int]:
    """Vectorise `_cost` over all pairs."""
    q = np.where(sides[ends[:, 0]] == sides[ends[:, 1]], flow[:, 1], flow[:, 0])
    costs, changes = _costs_of(q[None])
    return float(costs[0]), int(changes[0])


def _costs_of(across: Floats) -> tuple[Floats, Ints]:
    """Return the costs of several sets of sides, and the pairs changed for them, -1 for none.

    Each row of `across` holds the values that `_across` returns for one set of sides.
    """
    if not across.shape[1]:
        return np.full(len(across), np.inf), np.full(len(across), -1)
    is_tooth = across > 0.5
    # a cumulative sum adds in the order of the pairs, as `_cost` does
    total = np.cumsum(np.where(is_tooth, 1.0 - across, across), axis=1)[:, -1]
    distance = np.abs(1.0 - 2.0 * across)
    at = distance.argmin(axis=1)
    is_odd = np.count_nonzero(is_tooth, axis=1) % 2 == 1
    return np.where(is_odd, total, total + distance[np.arange(len(at)), at]), np.where(
        is_odd, -1, at
    )


__getattr__ = deprecated_names(globals(), odd_letters="odd_numbers")

"""Generalised combs: 2-matching inequalities whose teeth are sets of clusters.

For a handle H and an odd number k of disjoint teeth T, unions of clusters each of which is partly
in H and partly not,

    y(δ(H)) + Σ y(δ(T)) >= 3 k + 1

(Chvátal 1973, Grötschel & Padberg 1979; over clusters: Fischetti, Salazar & Toth 1997). A set that
the point enters and leaves once behaves like one cluster. So disjoint such sets are shrunk, and
teeth are searched for between two of them as those of 2-matching inequalities between two clusters
(Padberg & Rinaldi 1990). Several limits on the size of shrunk sets are tried.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.mip.blossoms import fractional_components
from netsp.mip.cuts import Cut
from netsp.mip.mip_policy import CutPolicy
from netsp.mip.program import Point

CROSSING_TOLERANCE = 1e-6
"""Tolerance by which the crossing of a set that is entered and left once may exceed two."""


def tight_sets(cuts: Sequence[Cut], point: Point, flow: Floats, cluster: Ints) -> list[Bools]:
    """Return masks (m + 1,) of the sets of clusters that a point enters and leaves once.

    They are the sets of cuts of which the point visits whole clusters only.
    """
    out: dict[bytes, Bools] = {}
    visited = np.flatnonzero(point.x > CROSSING_TOLERANCE)
    for cut in cuts:
        if cut.teeth:
            continue
        inside = visited[cut.inside[visited]]
        weight = np.bincount(cluster[inside], point.x[inside], minlength=len(flow))
        held = weight > 0.5
        is_whole = np.abs(weight - held).max() <= CROSSING_TOLERANCE
        if not 2 <= held.sum() < len(held) - 1 or not is_whole:
            continue
        if flow[np.ix_(held, ~held)].sum() <= 2.0 + CROSSING_TOLERANCE:
            out[held.tobytes()] = held
    return list(out.values())


def comb_cuts(
    cluster_flow: Floats, tight: Sequence[Bools], cluster: Ints, policy: CutPolicy = CutPolicy()
) -> list[Cut]:
    """Return violated combs, the most violated first.

    Parameters
    ----------
    cluster_flow
        (m + 1, m + 1) sums of y between clusters, at a point that violates no other cut.
    tight
        Result of `tight_sets`.
    """
    found: dict[tuple[bytes, tuple[tuple[int, ...], ...]], tuple[float, Cut]] = {}
    seen = set()
    by_size = sorted(tight, key=lambda s: -int(s.sum()))
    for max_size in policy.shrunk_sizes:
        label = _set_numbers([s for s in by_size if s.sum() <= max_size], len(cluster_flow))
        if label.tobytes() in seen:
            continue
        seen.add(label.tobytes())
        count = int(label.max()) + 1
        shrink = np.zeros((count, len(cluster_flow)))
        shrink[label, np.arange(len(cluster_flow))] = 1.0
        flow = shrink @ cluster_flow @ shrink.T
        np.fill_diagonal(flow, 0.0)
        for handle in fractional_components(flow, 2, policy):
            violation, pairs = _teeth(flow, handle, policy.min_tooth_flow)
            if violation <= policy.min_comb_violation:
                continue
            teeth = tuple(
                tuple(np.flatnonzero((label == a) | (label == b)).tolist()) for a, b in pairs
            )
            inside = handle[label]
            cut = Cut(inside[cluster], -1, teeth)
            found[inside.tobytes(), teeth] = (violation, cut)
    best = sorted(found.values(), key=lambda f: -f[0])[: policy.max_combs]
    return [cut for _, cut in best]


def _set_numbers(sets: Sequence[Bools], size: int) -> Ints:
    """Return for each cluster the number of its set; of sets that overlap, the first one counts."""
    label = np.arange(size)
    taken = np.zeros(size, dtype=bool)
    for s in sets:
        if not (taken & s).any():
            label[s] = int(np.argmax(s))
            taken |= s
    return np.unique(label, return_inverse=True)[1]


def _teeth(
    flow: Floats, handle: Bools, min_tooth_flow: float
) -> tuple[float, list[tuple[int, int]]]:
    """Return the violation of a handle's comb, and its teeth: disjoint pairs of largest flow."""
    inside, outside = np.flatnonzero(handle), np.flatnonzero(~handle)
    across = flow[np.ix_(inside, outside)]
    around = flow.sum(axis=1)
    pairs: list[tuple[int, int]] = []
    gains: list[float] = []
    used: set[int] = set()
    rows, cols = np.nonzero(across > min_tooth_flow)
    for k in np.argsort(-across[rows, cols], kind="stable"):
        a, b = int(inside[rows[k]]), int(outside[cols[k]])
        if a in used or b in used:
            continue
        used |= {a, b}
        pairs.append((a, b))
        # a tooth adds 3 less the flow across it to the violation
        gains.append(3.0 - float(around[a] + around[b] - 2.0 * flow[a, b]))
    best, count = -np.inf, 0
    for k in range(3, len(pairs) + 1, 2):
        violation = sum(gains[:k]) + 1.0 - float(across.sum())
        if violation > best:
            best, count = violation, k
    return best, pairs[:count]

"""Generalised 2-matching inequalities: cuts for points that are fractional between clusters.

With every cluster shrunk to a point, a tour is a tour of the m + 1 clusters, so inequalities of the
TSP hold (Fischetti, Salazar & Toth 1997 call these generalised combs with teeth of two clusters).
For a handle H of clusters and an odd number of teeth F, pairs of clusters with one end in H,

    y(δ(H) \\ F) - y(F) >= 1 - |F|

(Edmonds 1965): a tour that used all of F and nothing else would cross δ(H) an odd number of times.
Handles are components of the fractional pairs (Padberg & Hong 1980).
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.mip.cuts import Cut
from netsp.mip.mip_policy import CutPolicy


def cluster_flows(legs: Ints, y: Floats, cluster: Ints) -> Floats:
    """Return the sums of y between clusters, shape (m + 1, m + 1), symmetric."""
    m = int(cluster.max()) + 1
    out = np.zeros((m, m))
    np.add.at(out, (cluster[legs[:, 0]], cluster[legs[:, 1]]), y)
    return np.asarray(out + out.T)


def fractional_components(
    flow: Floats, min_size: int, policy: CutPolicy = CutPolicy()
) -> list[Bools]:
    """Return the components of fractional pairs of clusters, at several levels.

    Parameters
    ----------
    flow
        (m + 1, m + 1) sums of y between clusters.
    min_size
        Minimum number of clusters in a component.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    out: dict[bytes, Bools] = {}
    for level in policy.fractional_levels:
        part = coo_array((flow > level) & (flow < 1.0 - level))
        count, label = connected_components(part, directed=False)
        for k in range(count):
            handle = label == k
            if min_size <= handle.sum() < len(handle):
                out[handle.tobytes()] = handle
    return list(out.values())


def blossom_cuts(flow: Floats, cluster: Ints, policy: CutPolicy = CutPolicy()) -> list[Cut]:
    """Return violated 2-matching inequalities, the most violated first.

    Parameters
    ----------
    flow
        Result of `cluster_flows`.
    """
    found = []
    for handle in fractional_components(flow, 3, policy):
        violation, teeth = best_teeth(flow, handle)
        if violation > policy.min_comb_violation and len(teeth) >= 3:
            found.append((violation, Cut(handle[cluster], -1, teeth)))
    return [cut for _, cut in sorted(found, key=lambda f: -f[0])]


def best_teeth(flow: Floats, handle: Bools) -> tuple[float, tuple[tuple[int, int], ...]]:
    """Return the largest violation of a handle's inequality, and the teeth that give it.

    Teeth are the pairs that carry more than a half; if they are even in number, the pair nearest to
    a half is changed.
    """
    inside, outside = np.flatnonzero(handle), np.flatnonzero(~handle)
    across = flow[np.ix_(inside, outside)]
    is_tooth = across > 0.5
    if is_tooth.sum() % 2 == 0:
        nearest = np.unravel_index(np.argmin(np.abs(across - 0.5)), across.shape)
        is_tooth[nearest] = ~is_tooth[nearest]
    missing = float((1.0 - across[is_tooth]).sum() + across[~is_tooth].sum())
    first, second = inside[np.nonzero(is_tooth)[0]], outside[np.nonzero(is_tooth)[1]]
    pairs = sorted(
        (min(g, h), max(g, h)) for g, h in zip(first.tolist(), second.tolist(), strict=True)
    )
    return 1.0 - missing, tuple(pairs)

"""Generalised 2-matching inequalities: what is fractional between clusters where no subtour is.

With every cluster shrunk to a point, a tour is a tour of the m + 1 clusters, and what holds there
holds here (Fischetti, Salazar & Toth 1997 call them generalised combs with teeth of two clusters).
For a handle H of clusters and an odd number of teeth F, pairs of clusters with one end in H,

    y(δ(H) \\ F) - y(F) >= 1 - |F|

(Edmonds 1965): a tour that used all of F and nothing else would cross δ(H) an odd number of times.
Handles are sought as in Padberg & Hong (1980): components of what is fractional.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.mip.cuts import Cut

VIOLATION = 0.02
"""Least violation worth a cut."""

LEVELS = (1e-6, 0.05, 0.15, 0.3)
"""A pair of clusters counts as fractional between such a level and one less it."""


def cluster_flows(legs: Ints, y: Floats, cluster: Ints) -> Floats:
    """(m + 1, m + 1) symmetric sums of y between clusters."""
    m = int(cluster.max()) + 1
    out = np.zeros((m, m))
    np.add.at(out, (cluster[legs[:, 0]], cluster[legs[:, 1]]), y)
    return np.asarray(out + out.T)


def fractional_components(between: Floats, least: int) -> list[Bools]:
    """Components of what is fractional between so many clusters or more, at several levels."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    out: dict[bytes, Bools] = {}
    for level in LEVELS:
        part = coo_array((between > level) & (between < 1.0 - level))
        count, label = connected_components(part, directed=False)
        for k in range(count):
            handle = label == k
            if least <= handle.sum() < len(handle):
                out[handle.tobytes()] = handle
    return list(out.values())


def blossom_cuts(between: Floats, cluster: Ints) -> list[Cut]:
    """Return the violated 2-matching inequalities of `cluster_flows`, the most violated first."""
    found = []
    for handle in fractional_components(between, 3):
        violation, teeth = best_teeth(between, handle)
        if violation > VIOLATION and len(teeth) >= 3:
            found.append((violation, Cut(handle[cluster], -1, teeth)))
    return [cut for _, cut in sorted(found, key=lambda f: -f[0])]


def best_teeth(between: Floats, handle: Bools) -> tuple[float, tuple[tuple[int, int], ...]]:
    """How much the inequality of a handle is violated with the teeth that suit it best: pairs that
    carry more than a half, one of them changed if that makes an even number."""
    inside, outside = np.flatnonzero(handle), np.flatnonzero(~handle)
    flow = between[np.ix_(inside, outside)]
    tooth = flow > 0.5
    if tooth.sum() % 2 == 0:
        nearest = np.unravel_index(np.argmin(np.abs(flow - 0.5)), flow.shape)
        tooth[nearest] = ~tooth[nearest]
    left = float((1.0 - flow[tooth]).sum() + flow[~tooth].sum())
    pairs = sorted(
        (min(g, h), max(g, h))
        for g, h in zip(
            inside[np.nonzero(tooth)[0]].tolist(), outside[np.nonzero(tooth)[1]].tolist(),
            strict=True,
        )
    )  # fmt: skip
    return 1.0 - left, tuple(pairs)

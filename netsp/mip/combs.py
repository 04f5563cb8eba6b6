"""Generalised combs: 2-matching inequalities whose teeth are sets of clusters.

For a handle H and an odd number k of disjoint teeth T, unions of clusters each of which is partly
in H and partly not,

    y(δ(H)) + Σ y(δ(T)) >= 3 k + 1

(Chvátal 1973, Grötschel & Padberg 1979; over clusters: Fischetti, Salazar & Toth 1997). A set that
the point enters and leaves once is as good as one cluster: with disjoint such sets shrunk, teeth
are sought between two of them as those of 2-matching inequalities are between two clusters (Padberg
& Rinaldi 1990). Which sets are shrunk together is tried by their size.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.mip.blossoms import VIOLATION, fractional_components
from netsp.mip.cuts import Cut
from netsp.mip.program import Point

TIGHT = 1e-6
"""The most by which a set may be entered and left more than once."""

SIZES = (2, 3, 4, 6, 9, 14, 25)
"""Most clusters of a set that is shrunk, in turn."""

MOST_CUTS = 40
"""Most combs from one point."""

WEAK = 0.3
"""Sets joined by less are no tooth."""


def tight_sets(cuts: Sequence[Cut], point: Point, between: Floats, cluster: Ints) -> list[Bools]:
    """(m + 1,) flags of sets of clusters that a point enters and leaves once: of its cuts those
    whose sets hold, of what it visits, clusters as a whole."""
    out: dict[bytes, Bools] = {}
    visited = np.flatnonzero(point.x > TIGHT)
    for cut in cuts:
        if cut.teeth:
            continue
        inside = visited[cut.inside[visited]]
        weight = np.bincount(cluster[inside], point.x[inside], minlength=len(between))
        whole = weight > 0.5
        if not 2 <= whole.sum() < len(whole) - 1 or np.abs(weight - whole).max() > TIGHT:
            continue
        if between[np.ix_(whole, ~whole)].sum() <= 2.0 + TIGHT:
            out[whole.tobytes()] = whole
    return list(out.values())


def comb_cuts(between: Floats, tight: Sequence[Bools], cluster: Ints) -> list[Cut]:
    """Violated combs, the most violated first.

    Parameters
    ----------
    between
        (m + 1, m + 1) sums of y between clusters, those of no other cut violated.
    tight
        Sets of clusters, as of `tight_sets`.
    cluster
        (V,) of the vertices.
    """
    found: dict[tuple[bytes, tuple[tuple[int, ...], ...]], tuple[float, Cut]] = {}
    seen = set()
    by_size = sorted(tight, key=lambda s: -int(s.sum()))
    for most in SIZES:
        label = _shrunk_to([s for s in by_size if s.sum() <= most], len(between))
        if label.tobytes() in seen:
            continue
        seen.add(label.tobytes())
        count = int(label.max()) + 1
        to = np.zeros((count, len(between)))
        to[label, np.arange(len(between))] = 1.0
        flow = to @ between @ to.T
        np.fill_diagonal(flow, 0.0)
        for handle in fractional_components(flow, 2):
            violation, pairs = _teeth(flow, handle)
            if violation <= VIOLATION:
                continue
            teeth = tuple(
                tuple(np.flatnonzero((label == a) | (label == b)).tolist()) for a, b in pairs
            )
            inside = handle[label]
            cut = Cut(inside[cluster], -1, teeth)
            found[inside.tobytes(), teeth] = (violation, cut)
    best = sorted(found.values(), key=lambda f: -f[0])[:MOST_CUTS]
    return [cut for _, cut in best]


def _shrunk_to(sets: Sequence[Bools], size: int) -> Ints:
    """(m + 1,) numbers of disjoint sets, the first of these, or of clusters alone."""
    label = np.arange(size)
    taken = np.zeros(size, dtype=bool)
    for s in sets:
        if not (taken & s).any():
            label[s] = int(np.argmax(s))
            taken |= s
    return np.unique(label, return_inverse=True)[1]


def _teeth(flow: Floats, handle: Bools) -> tuple[float, list[tuple[int, int]]]:
    """How much the comb of a handle is violated, and its teeth: disjoint pairs across the handle,
    those of the greatest flow first."""
    inside, outside = np.flatnonzero(handle), np.flatnonzero(~handle)
    across = flow[np.ix_(inside, outside)]
    around = flow.sum(axis=1)
    pairs: list[tuple[int, int]] = []
    short: list[float] = []
    used: set[int] = set()
    rows, cols = np.nonzero(across > WEAK)
    for k in np.argsort(-across[rows, cols], kind="stable"):
        a, b = int(inside[rows[k]]), int(outside[cols[k]])
        if a in used or b in used:
            continue
        used |= {a, b}
        pairs.append((a, b))
        # what the tooth's own crossing leaves of 3
        short.append(3.0 - float(around[a] + around[b] - 2.0 * flow[a, b]))
    best, count = -np.inf, 0
    for k in range(3, len(pairs) + 1, 2):
        violation = sum(short[:k]) + 1.0 - float(across.sum())
        if violation > best:
            best, count = violation, k
    return best, pairs[:count]

"""Estimate the lengths of legs between viewpoints, around solids.

A leg is straight where it keeps the clearance. Other legs are shortest paths in a sparse graph over
the viewpoints and over points that stand off from the surface by the clearance, where paths round
solids turn. Along all legs the tether stays in the class of the shortest ones if these classes are
given (`netsp.plan.cover.leg_classes`). Lengths rank tours, and the planner drives the legs.
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.plan.cover.cover_policy import CoverPolicy
from netsp.plan.cover.leg_classes import TetherClasses
from netsp.plan.cover.viewpoints import Viewer, coarsen, spread_out


def estimate_distances(
    viewer: Viewer,
    places: Floats,
    policy: CoverPolicy | None = None,
    classes: TetherClasses | None = None,
) -> Floats:
    """Return the estimated lengths of legs between places, shape (n, n), metres.

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Places, metres; they may repeat.
    policy : CoverPolicy, optional
        Effort; by default that of the viewer.
    classes : TetherClasses, optional
        Classes of tethers; legs keep to those of the shortest ones. By default the tether is
        ignored.
    """
    from scipy import sparse
    from scipy.sparse.csgraph import dijkstra

    policy = policy or viewer.policy
    distinct, which = np.unique(places, axis=0, return_inverse=True)
    which = which.ravel()
    count = len(distinct)
    nodes = np.vstack([distinct, _turning_points(viewer, policy)])
    a, b = neighbour_pairs(distinct, max(policy.sparse_neighbours, policy.max_sight_lines // count))
    is_straight = are_clear(viewer, distinct[a], distinct[b])
    if classes is not None:
        is_straight &= classes.stay(distinct[a], distinct[b])
    a, b = a[is_straight], b[is_straight]
    u, v = neighbour_pairs(nodes, policy.sparse_neighbours)
    is_leg = are_clear(viewer, nodes[u], nodes[v])
    if classes is not None:
        is_leg &= classes.stay(nodes[u], nodes[v])
    u, v = u[is_leg], v[is_leg]
    lengths = np.maximum(np.linalg.norm(nodes[u] - nodes[v], axis=1), 1e-9)
    graph = sparse.csr_matrix((lengths, (u, v)), shape=(len(nodes), len(nodes)))
    around = dijkstra(graph, directed=False, indices=np.arange(count))[:, :count]
    straight = np.linalg.norm(distinct[:, None] - distinct[None], axis=2)
    around = np.where(np.isfinite(around), around, policy.blocked_ratio * straight)
    around[a, b] = around[b, a] = straight[a, b]
    np.fill_diagonal(around, 0.0)
    return np.asarray(np.minimum(around, around.T)[np.ix_(which, which)])


def _turning_points(viewer: Viewer, policy: CoverPolicy) -> Floats:
    """Return points (k, 3) where paths turn round solids: they keep the clearance, and stand off
    from the surface by some multiples of it."""
    # fine patches are many, and points half a stand-off apart are chosen from them
    patches = coarsen(viewer.patches, policy.turning_patch_ratio * viewer.standoff)
    room = max(viewer.clearance, 0.05 * viewer.standoff)
    shells = [patches.centres + ratio * room * patches.normals for ratio in policy.turning_ratios]
    kept = [points[viewer.field.distance(points) >= viewer.clearance] for points in shells]
    return np.vstack(
        [points[spread_out(points, 0.5 * viewer.standoff)] for points in kept if len(points)]
        or [np.zeros((0, 3))]
    )


def neighbour_pairs(points: Floats, count: int) -> tuple[Ints, Ints]:
    """Return the pairs (a < b) of points (n, 3) of which one is among the nearest of the other.

    Parameters
    ----------
    count : int
        Number of nearest points of each that make pairs.
    """
    from scipy.spatial import cKDTree

    count = min(count, len(points) - 1)
    if count < 1:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    _, near = cKDTree(points).query(points, k=count + 1)
    pairs = np.sort(
        np.column_stack([np.repeat(np.arange(len(points)), count + 1), near.ravel()]), axis=1
    )
    pairs = np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0)
    return pairs[:, 0], pairs[:, 1]


def are_clear(viewer: Viewer, a: Floats, b: Floats) -> Bools:
    """Return whether each of n straight legs keeps the clearance, tested at points along it.

    Parameters
    ----------
    a, b : ndarray, shape (n, 3)
        Ends of the legs, metres.
    """
    room = 0.99 * viewer.clearance
    spacing = max(viewer.clearance, 0.05 * viewer.standoff) / viewer.policy.samples_per_clearance
    counts = np.ceil(np.linalg.norm(b - a, axis=1) / spacing).astype(np.int64)
    is_clear = np.ones(len(a), dtype=bool)
    if not len(a):
        return is_clear
    # the middle first, then ever finer fractions: most blocked legs are found early
    for level in range(1, max(1, math.ceil(math.log2(max(2, int(counts.max())))) + 1)):
        tested = np.flatnonzero(is_clear & (counts > 2 ** (level - 1)))
        shares = (np.arange(2 ** (level - 1)) + 0.5) / 2 ** (level - 1)
        for share in shares:
            points = a[tested] + share * (b[tested] - a[tested])
            is_clear[tested] &= viewer.field.distance(points) >= room
    return is_clear

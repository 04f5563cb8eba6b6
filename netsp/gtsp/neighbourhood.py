"""Vertices of each cluster that a search sees: near the base, or near a tour.

With long tethers the shortest tours use vertices far from the base, and a search among those near
the base alone ends percents above them. Near the tour that it finds are the vertices of a better
one.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.gtsp.gtsp_policy import NeighbourhoodPolicy
from netsp.gtsp.instance import cheapest_per_cluster


def cheapest_insertions(bounds: Floats, tour: npt.ArrayLike, cluster: Ints, count: int) -> Ints:
    """Return the vertices of each cluster that lengthen a tour least, by lower bounds on legs.

    Parameters
    ----------
    bounds : ndarray, shape (m, V)
        Bounds on the legs from the tour's vertices to all, inf within a cluster.
    tour : array_like of int, shape (m,)
        Vertices, the base first.
    cluster : ndarray of int, shape (V,)
        Cluster of each vertex.
    count : int
        Maximum number of vertices of each cluster.

    Returns
    -------
    ndarray of int
        Vertices in order, the base among them.
    """
    t = np.asarray(tour, dtype=np.int64)
    after = np.roll(np.arange(len(t)), -1)
    legs = bounds[np.arange(len(t)), t[after]]
    increase = np.full(len(cluster), np.inf)
    for k in range(len(t)):
        np.minimum(increase, bounds[k] + bounds[after[k]] - legs[k], out=increase)
    # or in place of the tour's vertex in the same cluster
    for k in range(1, len(t)):
        members = np.flatnonzero(cluster == cluster[t[k]])
        instead = bounds[k - 1, members] + bounds[after[k], members] - legs[k - 1] - legs[k]
        increase[members] = np.minimum(increase[members], instead)
    order = np.lexsort((increase, cluster))
    first = np.searchsorted(cluster[order], cluster[order])
    return np.sort(order[np.arange(len(order)) - first < count])


def classes_near_tour(
    base_costs: Floats,
    cluster: Ints,
    bounds: Floats,
    tour: npt.ArrayLike,
    count: int,
    policy: NeighbourhoodPolicy = NeighbourhoodPolicy(),
) -> Ints:
    """Return the vertices that a search sees once there is a tour.

    Parameters
    ----------
    base_costs : ndarray, shape (V,)
        Costs of the legs from the base.
    cluster : ndarray of int, shape (V,)
        Cluster of each vertex.
    bounds, tour
        As in `cheapest_insertions`.
    count : int
        Number of vertices of each cluster near the tour.
    policy : NeighbourhoodPolicy
        Its `near_tour_ratio` gives the number of vertices near the base.

    Returns
    -------
    ndarray of int
        Vertices in order, the tour's among them.
    """
    near_base = cheapest_per_cluster(base_costs, cluster, max(1, count // policy.near_tour_ratio))
    near_tour = cheapest_insertions(bounds, tour, cluster, count)
    return np.unique(np.concatenate([near_base, near_tour, np.asarray(tour, dtype=np.int64)]))

"""Which classes of a goal are worth a look, given a tour: those that lengthen it least.

Where tethers are long, the best tours take classes far from those of least tether: with 60 goals at
a tether of 500, a search among the twelve of least tether of each goal ends 2 % above the best
one, however long it takes. Beside the tour that it finds are those of a better one.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.gtsp.travel.graph import least_tethers

LEAST_SHARE = 3
"""Besides those beside a tour, of least tether there are one in so many as of them."""

SEARCHED, FEWEST, ENOUGH = 2400, 3, 12
"""About so many classes are searched while there are too many for all, and so many of each goal at
least and at most. With 200 goals at tether 500, three of each end 3 % above the tour that ten end
at, after a few seconds or a minute."""


def searched_classes_per_goal(goals: int) -> int:
    """So many classes of each goal are worth a search.

    Parameters
    ----------
    goals : int
        Of the problem.

    Returns
    -------
    int
        From 3 to 12.
    """
    return min(max(FEWEST, SEARCHED // (goals + 1)), ENOUGH)


def cheapest_insertions(bounds: Floats, tour: npt.ArrayLike, cluster: Ints, classes: int) -> Ints:
    """The classes of each goal that lengthen a tour least, by bounds on their legs.

    Parameters
    ----------
    bounds : ndarray, shape (m, V)
        Of the legs from the tour's vertices to all, inf within a cluster.
    tour : array_like of int, shape (m,)
        The vertices, base first.
    cluster : ndarray of int, shape (V,)
        Of all vertices.
    classes : int
        So many of each goal.

    Returns
    -------
    ndarray of int
        The vertices, in order; the base is among them.
    """
    t = np.asarray(tour, dtype=np.int64)
    after = np.roll(np.arange(len(t)), -1)
    legs = bounds[np.arange(len(t)), t[after]]
    longer = np.full(len(cluster), np.inf)
    for k in range(len(t)):
        np.minimum(longer, bounds[k] + bounds[after[k]] - legs[k], out=longer)
    # in place of the tour's own class of a goal
    for k in range(1, len(t)):
        own = np.flatnonzero(cluster == cluster[t[k]])
        instead = bounds[k - 1, own] + bounds[after[k], own] - legs[k - 1] - legs[k]
        longer[own] = np.minimum(longer[own], instead)
    order = np.lexsort((longer, cluster))
    first = np.searchsorted(cluster[order], cluster[order])
    return np.sort(order[np.arange(len(order)) - first < classes])


def classes_near_tour(
    tethers: Floats, cluster: Ints, bounds: Floats, tour: npt.ArrayLike, classes: int
) -> Ints:
    """What a search looks at once there is a tour.

    Parameters
    ----------
    tethers : ndarray, shape (V,)
        Of all vertices.
    cluster : ndarray of int, shape (V,)
        Of all vertices.
    bounds, tour
        As of `cheapest_insertions`.
    classes : int
        So many of each goal beside the tour, and one in `LEAST_SHARE` as many of least tether.

    Returns
    -------
    ndarray of int
        The vertices, in order; the tour's are among them.
    """
    least = least_tethers(tethers, cluster, max(1, classes // LEAST_SHARE))
    beside = cheapest_insertions(bounds, tour, cluster, classes)
    return np.unique(np.concatenate([least, beside, np.asarray(tour, dtype=np.int64)]))

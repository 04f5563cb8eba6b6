"""Reduced costs of legs: how much longer than a bound a tour is with a leg, at least.

They come from the linear program of the tour problem with subtour constraints (Dantzig, Fulkerson &
Johnson 1954). Whatever its duals, the length of every tour is at least the bound plus the reduced
costs of its legs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock

CUT_TOLERANCE = 1e-6
"""Tolerance of the linear program: least amount by which a cut is violated."""


class ReducedCosts(NamedTuple):
    """Bound on all tours, and reduced costs.

    Attributes
    ----------
    bound
        No tour is shorter, metres.
    legs
        (v, v) symmetric, not negative: a tour is longer than the bound by at least the sum over
        its legs, metres.
    """

    bound: float
    legs: Floats


def reduced_leg_costs(costs: Floats, clock: Clock) -> ReducedCosts:
    """Return a bound on all tours through all nodes, and the reduced costs of legs.

    Parameters
    ----------
    costs : ndarray of shape (v, v)
        Symmetric lengths of legs, metres; v is at least 3.
    clock : Clock
        Clock of the run; when it is up, the bound is that of the cuts so far.

    Examples
    --------
    >>> import numpy as np
    >>> far = np.array([[0, 1, 5, 1], [1, 0, 1, 5], [5, 1, 0, 1], [1, 5, 1, 0]], dtype=float)
    >>> reduced = reduced_leg_costs(far, Clock())
    >>> round(reduced.bound, 6), bool(reduced.legs[0, 2] > 0.0)
    (4.0, True)
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_matrix

    n = len(costs)
    one, other = np.triu_indices(n, 1)
    c = costs[one, other]
    degrees = csr_matrix(
        (np.ones(2 * len(c)), (np.r_[one, other], np.tile(np.arange(len(c)), 2))), (n, len(c))
    )
    sets: list[Bools] = []
    while True:
        rows = [(s[one] != s[other]) for s in sets]
        cuts = csr_matrix(-np.array(rows, dtype=float).reshape(len(rows), len(c)))
        inequalities = {"A_ub": cuts, "b_ub": np.full(len(rows), -2.0)} if rows else {}
        equalities = {"A_eq": degrees, "b_eq": np.full(n, 2.0)}
        result = linprog(c, **inequalities, **equalities, bounds=(0.0, 1.0), method="highs")
        if result.x is None:
            return ReducedCosts(0.0, np.zeros((n, n)))
        node = np.asarray(result.eqlin.marginals)
        cut = np.maximum(0.0, -np.asarray(result.ineqlin.marginals)) if rows else np.zeros(0)
        weights = np.zeros((n, n))
        weights[one, other] = weights[other, one] = np.maximum(result.x, 0.0)
        new = [] if clock.is_up else violated_sets(weights)
        if not new:
            break
        sets += new
    reduced = c - node[one] - node[other] - (np.array(rows, dtype=float).T @ cut if rows else 0.0)
    # a leg is in a tour once at most
    bound = 2.0 * float(node.sum() + cut.sum()) + float(np.minimum(reduced, 0.0).sum())
    legs = np.zeros((n, n))
    legs[one, other] = legs[other, one] = np.maximum(reduced, 0.0)
    return ReducedCosts(bound, legs)


def violated_sets(weights: Floats) -> list[Bools]:
    """Return sets of nodes that fewer than two legs leave, by weights of legs.

    Parameters
    ----------
    weights : ndarray of shape (n, n)
        Symmetric weights of legs, with sum 2 at each node.

    Returns
    -------
    list of ndarray of bool, shape (n,)
        Connected components if there are several, else the least cut if it is violated.
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    count, label = connected_components(csr_matrix(weights > CUT_TOLERANCE), directed=False)
    if count > 1:
        return [label == k for k in range(count if count > 2 else 1)]
    value, cut = _minimum_cut(weights)
    return [cut] if value < 2.0 - CUT_TOLERANCE else []


def _minimum_cut(weights: Floats) -> tuple[float, Bools]:
    """Return the least weight of a cut, and one side (Stoer & Wagner 1997)."""
    n = len(weights)
    w = weights.copy()
    np.fill_diagonal(w, 0.0)
    members = np.eye(n, dtype=np.bool_)
    left: Ints = np.arange(n)
    best, side = np.inf, members[0]
    while len(left) > 1:
        joined = w[left[0], left].copy()
        waiting = np.ones(len(left), dtype=np.bool_)
        waiting[0] = False
        last, before = 0, 0
        while waiting.any():
            before, last = last, int(np.where(waiting, joined, -1.0).argmax())
            waiting[last] = False
            if waiting.any():
                joined += w[left[last], left]
        if joined[last] < best:
            best, side = float(joined[last]), members[left[last]].copy()
        u, v = left[before], left[last]
        w[u] += w[v]
        w[:, u] = w[u]
        w[u, u] = 0.0
        members[u] |= members[v]
        left = np.delete(left, last)
    return best, side

"""Fewest viewpoints that see a share of the surface: a partial, weighted set cover.

First greedily: the viewpoint that shows most of what is not seen yet (within a factor of 1 + ln n
of the fewest; Chvátal 1979, for a partial cover Slavík 1997). Then by an integer program, whose
relaxation gives a bound on every choice among these viewpoints:

    minimise   sum of x_c
    subject to y_p <= sum of x_c over the viewpoints c that see patch p,
               sum of area_p y_p >= share of what any of them sees, 0 <= y <= 1, x in {0, 1}.

Patches that the same viewpoints see count as one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Bools, ComparesArrays, Floats, Ints
from netsp.base.clock import Clock
from netsp.plan.cover.cover_policy import CoverPolicy


@dataclass(frozen=True, eq=False)
class Choice(ComparesArrays):
    """Chosen viewpoints.

    Parameters
    ----------
    chosen : ndarray of int
        Numbers of the viewpoints, ascending.
    bound : int
        Lower bound on the number of viewpoints that see as much.
    """

    chosen: Ints
    bound: int


def choose(
    sees: Bools, areas: Floats, share: float, clock: Clock, policy: CoverPolicy | None = None
) -> Choice:
    """Choose few viewpoints.

    Parameters
    ----------
    sees : ndarray of bool, shape (n, m)
        Whether each viewpoint sees each patch.
    areas : ndarray, shape (m,)
        Areas of the patches.
    share : float
        Share, by area, of what any viewpoint sees.
    clock : Clock
        When it is up, the integer program ends with what it has.
    """
    policy = policy or CoverPolicy()
    matrix, weights = merge_patches(sees, areas)
    needed = share * float(weights.sum())
    chosen = prune(matrix, weights, choose_greedily(matrix, weights, needed), needed)
    bound = counting_bound(matrix, weights, needed)
    if matrix.sum() <= policy.max_matrix_entries and not clock.is_up and bound < len(chosen):
        optimised, proven = solve_program(matrix, weights, needed, clock)
        bound = max(bound, proven)
        if optimised is not None and len(optimised) < len(chosen):
            chosen = prune(matrix, weights, optimised, needed)
    return Choice(np.sort(chosen), min(bound, len(chosen)))


def merge_patches(sees: Bools, areas: Floats) -> tuple[Bools, Floats]:
    """Merge patches that the same viewpoints see, and drop patches that no viewpoint sees.

    Returns
    -------
    matrix : ndarray of bool, shape (n, k)
        Whether each viewpoint sees each merged patch.
    weights : ndarray, shape (k,)
        Areas.
    """
    is_seen = sees.any(axis=0) & (areas > 0.0)
    packed = np.ascontiguousarray(np.packbits(sees[:, is_seen], axis=0).T)
    # rows as single items of their bytes, which sort many times faster than columns
    rows = packed.view(np.dtype((np.void, packed.shape[1]))).ravel()
    _, first, which = np.unique(rows, return_index=True, return_inverse=True)
    weights: Floats = np.bincount(which.ravel(), areas[is_seen], len(first)).astype(float)
    return sees[:, is_seen][:, first], weights


def choose_greedily(matrix: Bools, weights: Floats, needed: float) -> Ints:
    """Choose, again and again, the viewpoint that shows most of what is not seen yet, until the
    needed area is seen."""
    from scipy import sparse

    sees = sparse.csr_matrix(matrix, dtype=float)
    seen_by = sees.T.tocsr()
    is_unseen = weights > 0.0
    gains = sees @ weights
    seen_area, chosen = 0.0, []
    while seen_area < needed * (1.0 - 1e-12) and gains.max(initial=0.0) > 0.0:
        k = int(gains.argmax())
        shown = sees.indices[sees.indptr[k] : sees.indptr[k + 1]]
        new = shown[is_unseen[shown]]
        if len(new):
            chosen.append(k)
            seen_area += float(weights[new].sum())
            is_unseen[new] = False
            gains -= weights[new] @ seen_by[new]
        gains[k] = 0.0  # what the subtraction leaves of it is rounding
    return np.array(chosen, dtype=np.int64)


def prune(matrix: Bools, weights: Floats, taken: Ints, needed: float) -> Ints:
    """Drop viewpoints, the least useful first, as long as the others see the needed area."""
    from scipy import sparse

    taken = np.asarray(taken, dtype=np.int64)
    sees = sparse.csr_matrix(matrix[taken], dtype=float)
    seen_by = sees.T.tocsr()
    n_views = np.asarray(sees.sum(axis=0)).ravel()
    seen_area = float(weights[n_views > 0].sum())
    sole_areas = sees @ np.where(n_views == 1, weights, 0.0)
    is_left = np.ones(len(taken), dtype=bool)
    while is_left.any():
        weakest = int(np.where(is_left, sole_areas, np.inf).argmin())
        if seen_area - sole_areas[weakest] < needed * (1.0 - 1e-12):
            break
        seen_area -= float(sole_areas[weakest])
        is_left[weakest] = False
        shown = sees.indices[sees.indptr[weakest] : sees.indptr[weakest + 1]]
        n_views[shown] -= 1
        sole = shown[n_views[shown] == 1]
        sole_areas += weights[sole] @ seen_by[sole]
    return taken[is_left]


def counting_bound(matrix: Bools, weights: Floats, needed: float) -> int:
    """Return a lower bound on the number of viewpoints: as if no patch were seen from two of
    them."""
    if needed <= 0.0:
        return 0
    shown = np.sort(matrix.astype(float) @ weights)[::-1]
    return int(np.searchsorted(np.cumsum(shown), needed * (1.0 - 1e-9))) + 1


def solve_program(
    matrix: Bools, weights: Floats, needed: float, clock: Clock
) -> tuple[Ints | None, int]:
    """Solve the integer program as far as time allows. Return the viewpoints, None if there was no
    time for any, and a lower bound on their number."""
    from scipy import sparse
    from scipy.optimize import Bounds, LinearConstraint, milp

    n, k = matrix.shape
    link_rows = sparse.hstack([sparse.csr_matrix(matrix.T.astype(float)), -sparse.eye(k)])
    area_row = sparse.hstack([sparse.csr_matrix((1, n)), sparse.csr_matrix(weights / needed)])
    options = {} if clock.limit is None else {"time_limit": max(clock.left, 0.1)}
    found = milp(
        np.r_[np.ones(n), np.zeros(k)],
        integrality=np.r_[np.ones(n), np.zeros(k)],
        bounds=Bounds(0.0, 1.0),
        constraints=[
            LinearConstraint(link_rows, 0.0, np.inf),
            LinearConstraint(area_row, 1.0 - 1e-9, np.inf),
        ],
        options=options,
    )
    proven = getattr(found, "mip_dual_bound", None)
    bound = 0 if proven is None or not math.isfinite(proven) else math.ceil(proven - 1e-6)
    if found.x is None:
        return None, bound
    chosen = np.flatnonzero(found.x[:n] > 0.5)
    seen_area = float(weights[matrix[chosen].any(axis=0)].sum())
    return (chosen if seen_area >= needed * (1.0 - 1e-6) else None), bound

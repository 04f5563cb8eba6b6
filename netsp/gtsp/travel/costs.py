"""Given costs: their checks and their grain."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.errors import InputError


def rounded_down(values: Floats) -> Floats:
    """Return values in single precision, rounded down."""
    out = values.astype(np.float32)
    np.nextafter(out, np.float32(-np.inf), out=out, where=out > values)
    return out  # type: ignore[return-value]


MAX_WHOLE_COST = 2.0**40
"""Tolerance of whole numbers: double precision adds up to 8192 costs of this size exactly."""


def grain_of(costs: Floats) -> float:
    """Return 1 if all costs are whole numbers, so that all lengths of tours are; else 0."""
    finite = costs[np.isfinite(costs)]
    whole = bool((finite == np.rint(finite)).all()) and finite.max(initial=0.0) <= MAX_WHOLE_COST
    return 1.0 if whole else 0.0


def checked_costs(
    costs: npt.ArrayLike, clusters: npt.ArrayLike, *, base: bool = True
) -> tuple[Floats, Ints]:
    """Return the matrix with inf within clusters, and the clusters; raise InputError if wrong.

    Parameters
    ----------
    base
        Whether vertex 0 must be alone in cluster 0.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    try:
        c = np.array(costs, dtype=float)
        numbers = np.array(clusters, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"costs, clusters: expected numbers: {error}") from None
    if c.ndim != 2 or c.shape[0] != c.shape[1] or len(c) == 0:
        raise InputError(f"costs: expected a square matrix, got shape {c.shape}")
    n = len(c)
    if numbers.shape != (n,):
        raise InputError(
            f"clusters: expected {n} numbers, one per row of costs, got {numbers.shape}"
        )
    good = np.isfinite(numbers) & (numbers >= 0) & (numbers == np.floor(numbers))
    if not good.all():
        raise InputError(f"clusters: expected whole numbers from 0 on, got {numbers[~good][0]:g}")
    if numbers.max() >= n:
        raise InputError(
            f"clusters: {n} vertices cannot fill clusters 0 to {numbers.max():g}; expected numbers "
            "without gaps"
        )
    cluster = numbers.astype(np.int64)
    if base and (cluster[0] != 0 or (cluster == 0).sum() != 1):
        raise InputError(
            "clusters: vertex 0, where the tour starts, must be alone in cluster 0; cluster 0 is "
            f"{np.flatnonzero(cluster == 0).tolist()}; expected that (numbers "
            "begin at 0), or base=None"
        )
    missing = sorted(set(range(int(cluster.max()) + 1)) - set(cluster.tolist()))
    if missing:
        raise InputError(
            f"clusters: cluster {missing[0]} has no vertex; expected 0 to {cluster.max()} all used"
        )
    c[cluster[:, None] == cluster[None, :]] = np.inf
    if np.isnan(c).any():
        u, v = np.argwhere(np.isnan(c))[0]
        raise InputError(f"costs: costs[{u}][{v}] is not a number")
    if (c < 0).any():
        u, v = np.argwhere(c < 0)[0]
        raise InputError(f"costs: costs[{u}][{v}] is {c[u, v]:g}; expected no negative cost")
    scale = float(np.max(c[np.isfinite(c)], initial=0.0))
    if scale > 1e100:
        raise InputError(f"costs: {scale:g} is too large; expected at most 1e100")
    with np.errstate(invalid="ignore"):
        uneven = (c != c.T) & ~(np.abs(c - c.T) <= 1e-9 * scale)
    if uneven.any():
        u, v = np.argwhere(uneven)[0]
        raise InputError(
            f"costs: expected a symmetric matrix, but costs[{u}][{v}] is {c[u, v]:g} and "
            f"costs[{v}][{u}] is {c[v, u]:g}"
        )
    c = np.minimum(c, c.T)
    _, part = connected_components(csr_array(np.isfinite(c)), directed=False)
    every = set(cluster.tolist())
    starts = [0] if base else np.unique(part, return_index=True)[1].tolist()
    missed = [sorted(every - set(cluster[part == part[k]].tolist())) for k in starts]
    if all(missed):
        where = "vertex 0" if base else "the others"
        raise InputError(
            f"costs: infinite costs cut cluster {min(missed, key=len)[0]} off from {where}, so "
            "there is no tour"
        )
    return c, cluster

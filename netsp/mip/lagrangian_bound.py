"""A lower bound from dual values, computed here and not taken from the solver.

For any λ, π free and μ <= 0 the Lagrangian gives, for every tour,

    length >= Σ_C λ_C + Σ_k μ_k rhs_k + Σ over its vertices of r_v + Σ over its legs of r_uv,

with reduced costs r_uv = c_uv - π_u - π_v - Σ_k μ_k [u, v ∈ S_k or uv in a tooth of k] and
r_v = 2 π_v - λ_C(v) + Σ_k μ_k [v ∈ S_k \\ C_k]. A tour takes one vertex of each cluster, and there
two legs (m >= 2), each of which has two ends; so

    length >= Σ_k μ_k rhs_k + Σ_C (λ_C + min over v in C of (r_v + half of its two lowest r_uv)).

It holds whatever the solver's tolerances were. At an LP optimum no r_uv is negative, and the bound
is at least the optimum. Before, while many legs of negative r_uv are not in the LP yet, it is far
better than the bound that counts all of them.

It is summed in floating point (`netsp.mip.prices`), so `BOUND_ROUNDING` times the size of the terms
is subtracted. The test suite compares it with the formula in exact rationals (`exact_bound`).
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.mip.cuts import Cut
from netsp.mip.program import Duals

BOUND_ROUNDING = 1e-12
"""Tolerance, relative, of summing a bound: several thousand additions at 1.1e-16 each."""


def rounding(duals: Duals, longest: float) -> float:
    """Return the largest rounding error of a bound.

    It is `BOUND_ROUNDING` times the sum of all absolute duals and, for each leg of a tour, of the
    largest reduced cost.

    Parameters
    ----------
    longest
        Largest absolute reduced cost of a leg.
    """
    size = float(np.abs(duals.cluster).sum() + np.abs(duals.cut).sum() - duals.constant)
    largest = longest + float(np.abs(duals.degree).max(initial=0.0))
    return BOUND_ROUNDING * (size + len(duals.cluster) * largest)


def lowest_of_clusters(values: Floats, cluster: Ints) -> Floats:
    """Return the lowest value of the vertices of each cluster, shape (m + 1,)."""
    lowest = np.full(int(cluster.max()) + 1, np.inf)
    np.minimum.at(lowest, cluster, values)
    return lowest


def exact_bound(costs: Floats, cluster: Ints, cuts: list[Cut], duals: Duals) -> Fraction:
    """Return the module's bound in exact rationals of the same floating-point numbers.

    For small instances in which every vertex has two legs.
    """
    n = len(cluster)
    cluster_dual = [Fraction(x) for x in duals.cluster.tolist()]
    degree = [Fraction(x) for x in duals.degree.tolist()]
    active = [(c, Fraction(x)) for c, x in zip(cuts, duals.cut.tolist(), strict=True) if x]
    legs: list[list[Fraction]] = [[] for _ in range(n)]
    for u in range(n):
        for v in range(n):
            if u != v and np.isfinite(costs[u, v]):
                r = Fraction(float(costs[u, v])) - degree[u] - degree[v]
                pair = {int(cluster[u]), int(cluster[v])}
                r -= sum(mu for c, mu in active if c.inside[u] and c.inside[v])
                teeth = sum(
                    mu
                    for c, mu in active
                    if any(pair <= set(t) for t in c.teeth)
                    and (c.inside[u] != c.inside[v] or any(len(t) > 2 for t in c.teeth))
                )
                legs[u].append(r - teeth)
    vertex = []
    for v in range(n):
        r = 2 * degree[v] - cluster_dual[cluster[v]]
        r += sum(mu for c, mu in active if c.inside[v] and c.cluster != cluster[v])
        vertex.append(r + sum(sorted(legs[v])[:2]) / 2)
    lowest = [min(vertex[v] for v in range(n) if cluster[v] == c) for c in range(max(cluster) + 1)]
    constant = sum((mu * Fraction(c.rhs) for c, mu in active), Fraction(0))
    return Fraction(sum(cluster_dual) + sum(lowest) + constant)

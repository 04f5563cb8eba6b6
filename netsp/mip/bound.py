"""A lower bound from dual values, computed here and not taken from the solver.

For any λ, π free and μ <= 0 the Lagrangian gives, for every tour,

    length >= Σ_C (λ_C + min over v in C of r_v) + Σ_k μ_k room_k
              + max( Σ over legs of min(0, r_uv), (m + 1) · min(0, min over legs of r_uv) ),

with reduced costs r_uv = c_uv - π_u - π_v - Σ_k μ_k [u, v ∈ S_k or uv in a tooth of k] and
r_v = 2 π_v - λ_C(v) + Σ_k μ_k [v ∈ S_k \\ C_k], because a tour takes one vertex of each cluster and
m + 1 legs, none of them twice (m >= 2). It holds whatever the solver's tolerances were; it is tight
at an LP optimum.

It is summed in floating point, so `ROUNDING` times the size of what is summed is taken off; the
test suite compares with the same formula in exact rationals (`exact_bound`).
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import numpy.typing as npt

from netsp.arrays import Floats
from netsp.mip.cuts import Cut
from netsp.mip.program import Duals

ROUNDING = 1e-12
"""Relative rounding allowed for: some thousand additions at 1.1e-16 each, with room to spare."""


def reduced_costs(
    costs: Floats, cluster: npt.NDArray[np.int64], cuts: list[Cut], duals: Duals
) -> tuple[Floats, Floats]:
    """(V, V) reduced costs of legs, (V,) of vertices."""
    legs = costs - duals.degree[:, None] - duals.degree[None, :]
    vertices = 2.0 * duals.degree - duals.cluster[cluster]
    active = np.flatnonzero(duals.cut < 0.0)
    if len(active):
        inside = np.array([cuts[k].inside for k in active], dtype=float)
        mu = duals.cut[active]
        # the product of a matrix with its own transpose takes BLAS half the work
        root = inside * np.sqrt(-mu)[:, None]
        legs += root.T @ root
        outside_c = inside * (
            np.array([cuts[k].cluster for k in active])[:, None] != cluster[None, :]
        )
        vertices += mu @ outside_c
        m = int(cluster.max()) + 1
        bitten = np.zeros((m, m))
        for k in active:
            for g, h in cuts[k].teeth:
                bitten[g, h] += duals.cut[k]
                bitten[h, g] += duals.cut[k]
        if bitten.any():
            legs -= bitten[np.ix_(cluster, cluster)]
    return legs, vertices


def dual_bound(
    leg_costs: Floats, vertex_costs: Floats, cluster: npt.NDArray[np.int64], duals: Duals
) -> float:
    """The bound of the module's formula from reduced costs."""
    m = int(cluster.max())
    fixed = _vertex_part(vertex_costs, cluster, duals)
    worst = (m + 1) * min(0.0, float(leg_costs.min()))
    return fixed + max(worst, _negative_legs(leg_costs)) - rounding(leg_costs, duals)


def rounding(leg_costs: Floats, duals: Duals) -> float:
    """What the sums of a bound can be off by: `ROUNDING` of all duals and of the longest reduced
    cost for every leg of a tour."""
    finite = leg_costs[np.isfinite(leg_costs)]
    longest = float(np.abs(finite).max(initial=0.0))
    size = float(np.abs(duals.cluster).sum() + np.abs(duals.cut).sum() - duals.constant)
    return ROUNDING * (size + len(duals.cluster) * (longest + float(np.abs(duals.degree).max())))


def exact_bound(
    costs: Floats, cluster: npt.NDArray[np.int64], cuts: list[Cut], duals: Duals
) -> Fraction:
    """The module's formula in exact rationals, of the very same floating-point numbers; for small
    instances."""
    n = len(cluster)
    cluster_dual = [Fraction(x) for x in duals.cluster.tolist()]
    degree = [Fraction(x) for x in duals.degree.tolist()]
    active = [(c, Fraction(x)) for c, x in zip(cuts, duals.cut.tolist(), strict=True) if x]
    vertex = []
    for v in range(n):
        r = 2 * degree[v] - cluster_dual[cluster[v]]
        r += sum(mu for c, mu in active if c.inside[v] and c.cluster != cluster[v])
        vertex.append(r)
    legs = []
    for u in range(n):
        for v in range(u + 1, n):
            if np.isfinite(costs[u, v]):
                r = Fraction(float(costs[u, v])) - degree[u] - degree[v]
                pair = tuple(sorted((int(cluster[u]), int(cluster[v]))))
                r -= sum(mu for c, mu in active if c.inside[u] and c.inside[v])
                legs.append(r - sum(mu for c, mu in active if pair in c.teeth))
    least = [min(vertex[v] for v in range(n) if cluster[v] == c) for c in range(max(cluster) + 1)]
    fixed = sum(cluster_dual) + sum(least) + sum(mu * Fraction(c.room) for c, mu in active)
    negative = sum(min(r, Fraction(0)) for r in legs)
    worst = (int(max(cluster)) + 1) * min(min(legs, default=Fraction(0)), Fraction(0))
    return Fraction(fixed + max(negative, worst))


def fixing_costs(
    leg_costs: Floats, vertex_costs: Floats, cluster: npt.NDArray[np.int64], duals: Duals
) -> tuple[float, Floats, Floats]:
    """A bound; per leg how much at least it rises when the leg is used: the leg's own reduced cost
    and what its two vertices cost above the best of their clusters; per vertex the latter alone."""
    bound = _vertex_part(vertex_costs, cluster, duals) + _negative_legs(leg_costs)
    bound -= rounding(leg_costs, duals)
    above = vertex_costs - least_of_clusters(vertex_costs, cluster)[cluster]
    return bound, np.maximum(leg_costs, 0.0) + above[:, None] + above[None, :], above


def least_of_clusters(vertex_costs: Floats, cluster: npt.NDArray[np.int64]) -> Floats:
    """(m + 1,) the least cost of any vertex, by cluster."""
    least = np.full(int(cluster.max()) + 1, np.inf)
    np.minimum.at(least, cluster, vertex_costs)
    return least


def _vertex_part(vertex_costs: Floats, cluster: npt.NDArray[np.int64], duals: Duals) -> float:
    return float((duals.cluster + least_of_clusters(vertex_costs, cluster)).sum()) + duals.constant


def _negative_legs(leg_costs: Floats) -> float:
    return float(np.minimum(leg_costs, 0.0).sum()) / 2.0

"""A lower bound from dual values, computed here and not taken from the solver.

For any λ, π free and μ <= 0 the Lagrangian gives, for every tour,

    length >= Σ_C (λ_C + min over v in C of r_v) + (m + 1) · min(0, min over legs of r_uv),

with reduced costs r_uv = c_uv - π_u - π_v - Σ_k μ_k [u, v ∈ S_k] and
r_v = 2 π_v - λ_C(v) + Σ_k μ_k [v ∈ S_k \\ C_k], because a tour takes one vertex of each cluster and
m + 1 legs. It holds whatever the solver's tolerances were; it is tight at an LP optimum.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from netsp.mip.program import Cut, Duals

Floats = npt.NDArray[np.float64]


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
        legs -= (inside * mu[:, None]).T @ inside
        outside_c = inside * (
            np.array([cuts[k].cluster for k in active])[:, None] != cluster[None, :]
        )
        vertices += mu @ outside_c
    return legs, vertices


def dual_bound(
    leg_costs: Floats, vertex_costs: Floats, cluster: npt.NDArray[np.int64], duals: Duals
) -> float:
    """The bound of the module's formula from reduced costs."""
    m = int(cluster.max())
    least = np.full(m + 1, np.inf)
    np.minimum.at(least, cluster, vertex_costs)
    worst = min(0.0, float(leg_costs.min()))
    return float((duals.cluster + least).sum() + (m + 1) * worst)

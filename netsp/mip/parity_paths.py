"""Paths from the base: what it costs above a bound to reach a vertex.

The bound of `netsp.mip.lagrangian_bound` counts for every vertex its two legs of lowest reduced
cost, wherever they lead. So it misses what a tour pays to go far: on the cover the classes of one
sheet lie close together, and each looks cheap by itself, but a tour has to go there from the base
and back. Let the excess of v be r_v + half of the two lowest r_uv at v, less the lowest such sum in
the cluster of v, and let l_u and s_u be the lowest and second lowest r at u. Then

    length >= bound + Σ over its vertices of their excess
              + Σ over its legs of half of max(r_uv - s_u, 0) + max(r_uv - s_v, 0):

the two legs at u have r_a + r_b >= l_u + s_u, and more by what each has above s_u. No term is
negative, so a tour through v pays for a path to v and for another, from v, with another leg at v;
both have only v in common. This fixes out whole sheets long before the LP has the cuts for it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.mip.mip_policy import PricingPolicy
from netsp.mip.reducedcosts import Terms, reduced_costs_at, work_arrays


class BasePaths(NamedTuple):
    """Cheapest paths from the base to every vertex, by cost above the bound.

    Attributes
    ----------
    cost
        (V,) cost of the cheapest path; a number above the gap where there is none within it.
    second_cost
        (V,) cost of the cheapest path with another last leg.
    before
        (V,) vertex before the last one on the cheapest path, -1 for none.
    """

    cost: Floats
    second_cost: Floats
    before: Ints


@kernel
def leg_excess(u: int, v: int, price: float, terms: Terms) -> float:
    """Return half of the reduced cost of a leg above the second cheapest legs of its ends."""
    above = max(price - terms.second[u], 0.0) + max(price - terms.second[v], 0.0)
    return float(0.5 * above)


def paths_from_base(
    terms: Terms,
    excess: Floats,
    gap: float,
    check: Callable[[], None] = lambda: None,
    vertices_per_check: int = PricingPolicy.vertices_per_check,
) -> BasePaths:
    """Return the cheapest paths from the base within a gap, by Dijkstra's algorithm.

    Parameters
    ----------
    excess
        (V,) excess of every vertex.
    check
        Called every `vertices_per_check` vertices; may raise to stop.
    """
    n = len(terms.cluster)
    paths = BasePaths(np.full(n, np.inf), np.full(n, np.inf), np.full(n, -1, dtype=np.int64))
    is_settled = np.zeros(n, dtype=bool)
    paths.cost[0] = paths.second_cost[0] = 0.0
    while _settle(vertices_per_check, terms, excess, gap, paths, is_settled):
        check()
    return paths


@kernel
def _settle(
    count: int, terms: Terms, excess: Floats, gap: float, paths: BasePaths, is_settled: Bools
) -> bool:
    """Settle up to `count` more vertices, and return whether others may be within the gap."""
    other, price, shared = work_arrays(terms)
    cost, second_cost = paths.cost, paths.second_cost
    for _ in range(count):
        u, lowest = -1, np.inf
        for v in range(len(cost)):
            if not is_settled[v] and cost[v] < lowest:
                u, lowest = v, cost[v]
        if u < 0 or lowest > gap:
            return False
        is_settled[u] = True
        for i in range(reduced_costs_at(u, terms, other, price, shared)):
            v = other[i]
            if v == 0:
                continue
            new = lowest + leg_excess(u, v, price[i], terms) + excess[v]
            if new < cost[v]:
                cost[v], second_cost[v], paths.before[v] = new, cost[v], u
            elif new < second_cost[v]:
                second_cost[v] = new
    return True

"""What it costs above a bound to get to a vertex from the base.

The bound of `netsp.mip.lagrangian_bound` takes of every vertex two legs of least reduced cost,
wherever they lead. So it does not see what a tour pays that goes far: on the cover the classes of
one sheet lie close together, and are left for nothing in the bound of each. But a tour gets there
from the base, and home again. With r_v + half of the two least r_uv at v, less the least of its
cluster, as the excess of v, and with s_u the second least r at u,

    length >= bound + Σ over its vertices of their excess
              + Σ over its legs of half of max(r_uv - s_u, 0) + max(r_uv - s_v, 0):

the two legs at u have r_a + r_b >= l_u + s_u, and more by what each has above s_u. No term is
negative, so a tour through v pays for a way to v and for another, from v, which takes another leg
at v; what lies on both is v. That rules out whole sheets long before the LP has the cuts for it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.mip.reducedcosts import Terms, reduced_costs_at, rooms

AT_ONCE = 500
"""Vertices between two looks at the clock."""


@kernel
def beyond(u: int, v: int, price: float, terms: Terms) -> float:
    """What a leg costs its ends more than the second cheapest of theirs."""
    above = max(price - terms.second[u], 0.0) + max(price - terms.second[v], 0.0)
    return float(0.5 * above)


def paths_from_base(
    terms: Terms, excess: Floats, missing: float, check: Callable[[], None] = lambda: None
) -> tuple[Floats, Floats, Ints]:
    """(V,) the least that a way from the base to a vertex costs above the bound, the least with
    another last leg, and the vertex before it on the first; something above what is missing where
    they are more. Dijkstra's algorithm: nothing on a way is negative.

    Parameters
    ----------
    check
        Called every so many vertices; may raise to stop.
    """
    n = len(terms.cluster)
    way, other_way = np.full(n, np.inf), np.full(n, np.inf)
    before, done = np.full(n, -1, dtype=np.int64), np.zeros(n, dtype=bool)
    way[0] = other_way[0] = 0.0
    while _settle(AT_ONCE, terms, excess, missing, way, other_way, before, done):
        check()
    return way, other_way, before


@kernel
def _settle(
    most: int, terms: Terms, excess: Floats, missing: float, way: Floats, other_way: Floats,
    before: Ints, done: Bools,
) -> bool:  # fmt: skip
    """Go on from so many vertices more; whether there may be others."""
    other, price, room = rooms(terms)
    for _ in range(most):
        u, least = -1, np.inf
        for v in range(len(way)):
            if not done[v] and way[v] < least:
                u, least = v, way[v]
        if u < 0 or least > missing:
            return False
        done[u] = True
        for i in range(reduced_costs_at(u, terms, other, price, room)):
            v = other[i]
            if v == 0:
                continue
            new = least + beyond(u, v, price[i], terms) + excess[v]
            if new < way[v]:
                way[v], other_way[v], before[v] = new, way[v], u
            elif new < other_way[v]:
                other_way[v] = new
    return True

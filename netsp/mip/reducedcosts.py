"""Kernels for the reduced costs of one leg, and of all legs at a vertex.

Reduced costs are computed when they are needed. With thousands of classes a matrix of them would
take more memory than the costs themselves, and more time to write than to compute. The terms of
cuts are summed cut by cut over the sets that hold a vertex: most sets hold few of all vertices, so
this is far quicker than a product of matrices.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.gtsp.sparse_costs import Rows, place_of
from netsp.mip.deadlegs import Bits, write_alive


class Terms(NamedTuple):
    """Terms of reduced costs c - π_u - π_v + shared - teeth, for kernels.

    The term `shared` is the sum over the cuts that hold both ends. Vertex v is in the cuts
    `cut_at[first_at[v] : first_at[v + 1]]`, cut k holds the vertices
    `member[first_member[k] : first_member[k + 1]]`, both ascending, and has the term `weight[k]`.
    `tooth_pairs` (m + 1, m + 1) is the sum over the teeth that hold both clusters, `vertex` r_v,
    `lowest` and `second` are r_uv of the two cheapest legs of each vertex. The legs are those of
    the matrix `costs` without `dead`, the bits of `DeadLegs`; or those of `rows`, if it is not
    empty.
    """

    costs: Floats
    dead: Bits
    rows: Rows
    cluster: Ints
    degree: Floats
    first_at: Ints
    cut_at: Ints
    first_member: Ints
    member: Ints
    weight: Floats
    tooth_pairs: Floats
    vertex: Floats
    lowest: Floats
    second: Floats


@kernel
def reduced_cost(u: int, v: int, cost: float, shared: float, terms: Terms) -> float:
    """Return r_uv, which equals r_vu to the bit."""
    teeth = terms.tooth_pairs[terms.cluster[u], terms.cluster[v]]
    return float(cost - (terms.degree[u] + terms.degree[v]) + shared - teeth)


@kernel
def legs_at(u: int, terms: Terms, other: Ints, cost: Floats) -> int:
    """Write the ends, ascending, and costs of the legs left at u, and return their number."""
    if len(terms.rows.first) > 0:
        first, count = terms.rows.first[u], terms.rows.size[u]
        for i in range(count):
            other[i], cost[i] = terms.rows.other[first + i], terms.rows.cost[first + i]
        return int(count)
    count = write_alive(u, terms.dead, other)
    for i in range(count):
        cost[i] = terms.costs[u, other[i]]
    return int(count)


@kernel
def reduced_costs_at(u: int, terms: Terms, other: Ints, price: Floats, work: Floats) -> int:
    """Write the ends, ascending, and reduced costs of the legs left at u, and return their number.

    The terms of cuts are summed over the sets of u or, if few legs are left, over those of their
    other ends. The order of the sums is the same, so that r_uv equals r_vu to the bit.

    Parameters
    ----------
    work
        Work array of zeros, one for each vertex or cut; zero again afterwards.
    """
    count, extra_terms = legs_at(u, terms, other, price), 0
    for v in other[:count]:
        extra_terms += terms.first_at[v + 1] - terms.first_at[v]
    cuts = terms.cut_at[terms.first_at[u] : terms.first_at[u + 1]]
    for k in cuts:
        extra_terms -= terms.first_member[k + 1] - terms.first_member[k]
    if extra_terms > 0:
        for k in cuts:
            for v in terms.member[terms.first_member[k] : terms.first_member[k + 1]]:
                work[v] += terms.weight[k]
    else:
        for k in cuts:
            work[k] = terms.weight[k]
    for i in range(count):
        v = other[i]
        shared = 0.0
        if extra_terms > 0:
            shared = work[v]
        else:
            for k in terms.cut_at[terms.first_at[v] : terms.first_at[v + 1]]:
                shared += work[k]
        price[i] = reduced_cost(u, v, price[i], shared, terms)
    if extra_terms > 0:
        for k in cuts:
            for v in terms.member[terms.first_member[k] : terms.first_member[k + 1]]:
                work[v] = 0.0
    else:
        for k in cuts:
            work[k] = 0.0
    return count


@kernel
def work_arrays(terms: Terms) -> tuple[Ints, Floats, Floats]:
    """Return `other`, `price` and `work` for `reduced_costs_at`."""
    n = len(terms.cluster)
    return np.empty(n, np.int64), np.empty(n), np.zeros(max(n, len(terms.weight)))


@kernel
def reduced_costs(legs: Ints, terms: Terms) -> Floats:
    """Return the reduced cost of each leg (k, 2), inf for legs that sparse costs lack.

    Sums are in the order of `reduced_costs_at`.
    """
    out = np.empty(len(legs))
    for k in range(len(legs)):
        u, v = legs[k]
        shared = 0.0
        i, j = terms.first_at[u], terms.first_at[v]
        while i < terms.first_at[u + 1] and j < terms.first_at[v + 1]:
            a, b = terms.cut_at[i], terms.cut_at[j]
            if a == b:
                shared += terms.weight[a]
            i += a <= b
            j += b <= a
        if len(terms.rows.first) > 0:
            at = place_of(u, v, terms.rows)
            cost = terms.rows.cost[at] if at >= 0 else np.inf
        else:
            cost = terms.costs[u, v]
        out[k] = reduced_cost(u, v, cost, shared, terms)
    return out

"""One leg's reduced cost, and those of all legs at a vertex: kernels over a matrix of costs.

Reduced costs are never held. With thousands of classes a matrix of them, and those that are in
between, would take more memory than the costs themselves, and more time to write than to compute.
What cuts add to the legs of one vertex is summed up cut by cut, over the sets that it lies in: most
sets hold few of all vertices, so that takes far less than a product of matrices.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.gtsp.sparse_costs import Rows, place_of
from netsp.mip.deadlegs import Bits, not_dead


class Terms(NamedTuple):
    """What a reduced cost is made of, c - π_u - π_v + shared - bitten, for the kernels.

    `shared` is what the cuts that hold both ends cost: those of vertex v are
    `cut_at[first_at[v] : first_at[v + 1]]`, cut k holds
    `member[first_member[k] : first_member[k + 1]]`, both ascending, and costs `weight[k]`.
    `tooth_pairs` (m + 1, m + 1) is what teeth that hold both clusters do; `vertex` r_v; `least` and
    `second` are r_uv of the two cheapest legs of each vertex. Legs are those of the matrix `costs`
    but for `dead`, the bits of `DeadLegs`, or those of `rows`, where these are not empty.
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
    least: Floats
    second: Floats


@kernel
def reduced(u: int, v: int, cost: float, shared: float, terms: Terms) -> float:
    """r_uv, the same as r_vu."""
    tooth_pairs = terms.tooth_pairs[terms.cluster[u], terms.cluster[v]]
    return float(cost - (terms.degree[u] + terms.degree[v]) + shared - tooth_pairs)


@kernel
def legs_at(u: int, terms: Terms, other: Ints, cost: Floats) -> int:
    """How many legs at u are left, and the first so many of `other` and `cost`: their other ends,
    ascending, and costs."""
    if len(terms.rows.first) > 0:
        first, count = terms.rows.first[u], terms.rows.size[u]
        for i in range(count):
            other[i], cost[i] = terms.rows.other[first + i], terms.rows.cost[first + i]
        return int(count)
    count = not_dead(u, terms.dead, other)
    for i in range(count):
        cost[i] = terms.costs[u, other[i]]
    return int(count)


@kernel
def reduced_costs_at(u: int, terms: Terms, other: Ints, price: Floats, room: Floats) -> int:
    """As `legs_at`, with reduced costs. `room` has one place for each vertex or cut and is zero
    before and after.

    What cuts add is summed over the sets of u, or, where few legs are left, over those of their
    other ends; the order of the sums is the same, and makes r_uv the same as r_vu.
    """
    count, work = legs_at(u, terms, other, price), 0
    for v in other[:count]:
        work += terms.first_at[v + 1] - terms.first_at[v]
    cuts = terms.cut_at[terms.first_at[u] : terms.first_at[u + 1]]
    for k in cuts:
        work -= terms.first_member[k + 1] - terms.first_member[k]
    if work > 0:
        for k in cuts:
            for v in terms.member[terms.first_member[k] : terms.first_member[k + 1]]:
                room[v] += terms.weight[k]
    else:
        for k in cuts:
            room[k] = terms.weight[k]
    for i in range(count):
        v = other[i]
        shared = 0.0
        if work > 0:
            shared = room[v]
        else:
            for k in terms.cut_at[terms.first_at[v] : terms.first_at[v + 1]]:
                shared += room[k]
        price[i] = reduced(u, v, price[i], shared, terms)
    if work > 0:
        for k in cuts:
            for v in terms.member[terms.first_member[k] : terms.first_member[k + 1]]:
                room[v] = 0.0
    else:
        for k in cuts:
            room[k] = 0.0
    return count


@kernel
def rooms(terms: Terms) -> tuple[Ints, Floats, Floats]:
    """`other`, `price` and `room` of `reduced_costs_at`."""
    n = len(terms.cluster)
    return np.empty(n, np.int64), np.empty(n), np.zeros(max(n, len(terms.weight)))


@kernel
def reduced_costs(legs: Ints, terms: Terms) -> Floats:
    """The reduced cost of each leg, as `reduced_costs_at` has it; inf where rows have none."""
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
        out[k] = reduced(u, v, cost, shared, terms)
    return out

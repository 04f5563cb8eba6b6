"""The prices of all legs at dual values: one pass for the bound, one for what it rules out.

The bound is that of `netsp.mip.bound`. A tour through a given vertex, or along a given leg, pays
what these cost above the cheapest of their clusters.

Reduced costs are never held. With thousands of classes a matrix of them, and those that are in
between, would take more memory than the costs themselves, and more time to write than to compute.
What cuts add to the legs of one vertex is summed up cut by cut, over the sets that it lies in: most
sets hold few of all vertices, so that takes far less than a product of matrices.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from netsp.arrays import Bools, Floats, Ints
from netsp.compiled.kernel import kernel
from netsp.mip.bound import least_of_clusters, rounding
from netsp.mip.cuts import Cut
from netsp.mip.program import Duals

ROWS = 256
"""Rows of a matrix that a thread works on at a time."""

CHEAPEST = 8
"""Legs of negative reduced cost that are kept for each vertex."""


class Terms(NamedTuple):
    """What a reduced cost is made of, c - π_u - π_v + shared - bitten, for the kernels.

    `shared` is what the cuts that hold both ends cost: those of vertex v are
    `cut_at[first_at[v] : first_at[v + 1]]`, cut k holds
    `member[first_member[k] : first_member[k + 1]]`, both ascending, and costs `weight[k]`.
    `bitten` (m + 1, m + 1) is what teeth that hold both clusters do; `vertex` r_v; `least` and
    `second` are r_uv of the two cheapest legs of each vertex.
    """

    costs: Floats
    dead: Bools
    cluster: Ints
    degree: Floats
    first_at: Ints
    cut_at: Ints
    first_member: Ints
    member: Ints
    weight: Floats
    bitten: Floats
    vertex: Floats
    least: Floats
    second: Floats


class Prices:
    """The reduced costs of `netsp.mip.bound` over a matrix of costs.

    Parameters
    ----------
    costs : ndarray, shape (V, V)
        Of legs; inf where there is none.
    dead : ndarray of bool, shape (V, V)
        Legs that are of no interest, and those that there are none of.
    cluster : ndarray of int, shape (V,)
        Of the vertices.
    cuts : sequence of Cut
        Of the program.
    duals : Duals
        Any; the better they are, the better the bound.
    check : callable
        Called every few million legs, from several threads; may raise to stop.

    Attributes
    ----------
    bound : float
        No tour without a dead leg is shorter.
    """

    def __init__(
        self, costs: Floats, dead: Bools, cluster: Ints, cuts: Sequence[Cut], duals: Duals,
        check: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self._check = check
        self._size = len(cluster)
        active = np.flatnonzero(duals.cut < 0.0).tolist()
        inside = np.array([cuts[k].inside for k in active], dtype=bool).reshape(-1, self._size)
        of_cut, member = np.nonzero(inside)
        first_member = np.searchsorted(of_cut, np.arange(len(active) + 1))
        by_vertex = np.argsort(member, kind="stable")
        first_at = np.searchsorted(member[by_vertex], np.arange(self._size + 1))
        m = int(cluster.max(initial=0)) + 1
        bitten = np.zeros((m, m))
        for k in active:
            if cuts[k].teeth:
                bitten[cuts[k].bitten(m)] += duals.cut[k]
        vertex = 2.0 * duals.degree - duals.cluster[cluster]
        for k in active:
            vertex[cuts[k].inside & (cluster != cuts[k].cluster)] += duals.cut[k]
        least, second, longest = np.empty((3, self._size))
        terms = self._terms = Terms(
            costs, dead, cluster, duals.degree, first_at, of_cut[by_vertex], first_member, member,
            -duals.cut[active], bitten, vertex, least, second,
        )  # fmt: skip
        self._by_rows(lambda a, b: _scan(a, b, terms, longest), self._size)
        self._more = least < 0.0
        self._cost = vertex + 0.5 * (least + second)
        self._cheapest = least_of_clusters(self._cost, cluster)
        fixed = float((duals.cluster + self._cheapest).sum()) + duals.constant
        self.bound = fixed - rounding(duals, float(longest.max(initial=0.0)))

    def rule_out(self, cutoff: float) -> None:
        """Mark as dead the legs and vertices that are in no tour shorter than the cutoff."""
        missing = cutoff - self.bound
        if not np.isfinite(missing):
            return
        terms = self._terms
        above = terms.vertex - self._cheapest[terms.cluster]
        excess = self._cost - self._cheapest[terms.cluster]
        way, other_way, before = _ways(terms, excess, missing)
        self._by_rows(
            lambda a, b: _rule_out(a, b, terms, above, way, other_way, before, missing), self._size
        )
        gone = (excess > missing) | (way + other_way > missing + excess)
        gone[0] = False
        terms.dead[gone] = True
        terms.dead[:, gone] = True

    def cheapest(self, tolerance: float) -> tuple[Ints, Floats]:
        """(k, 2) legs u < v of reduced costs below minus the tolerance, and these: of each vertex
        the `CHEAPEST` at most. Costs may have risen since it was last called: then those of
        vertices of which all such legs had been given are not looked for again."""
        rows = np.flatnonzero(self._more)
        other = np.full((self._size, CHEAPEST), -1, dtype=np.int64)
        price = np.zeros((self._size, CHEAPEST))
        terms = self._terms
        self._by_rows(lambda a, b: _cheapest(rows[a:b], terms, tolerance, other, price), len(rows))
        self._more = other[:, -1] >= 0
        u, k = np.nonzero(other >= 0)
        pairs = np.sort(np.column_stack([u, other[u, k]]), axis=1)
        legs, where = np.unique(pairs.reshape(-1, 2), axis=0, return_index=True)
        return legs, price[u, k][where]

    def of(self, legs: Ints) -> Floats:
        """(k,) the reduced costs of legs (k, 2)."""
        return _of(legs, self._terms)

    def _by_rows(self, work: Callable[[int, int], None], count: int) -> None:
        blocks = [(k, min(k + ROWS, count)) for k in range(0, count, ROWS)]
        if len(blocks) < 4:
            work(0, count)
            return

        def checked(block: tuple[int, int]) -> None:
            self._check()
            work(*block)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(checked, blocks))


@kernel
def _reduced(u: int, v: int, shared: float, terms: Terms) -> float:
    """r_uv, the same as r_vu."""
    bitten = terms.bitten[terms.cluster[u], terms.cluster[v]]
    return float(terms.costs[u, v] - (terms.degree[u] + terms.degree[v]) + shared - bitten)


@kernel
def _row(u: int, terms: Terms, other: Ints, price: Floats, room: Floats) -> int:
    """How many legs at u are not dead, and the first so many of `other` and `price`: their other
    ends, ascending, and reduced costs. `room` has one place for each vertex or cut and is zero
    before and after.

    What cuts add is summed over the sets of u, or, where few legs are left, over those of their
    other ends; the order of the sums is the same, and makes r_uv the same as r_vu.
    """
    count, work = 0, 0
    for v in range(len(terms.cluster)):
        if not terms.dead[u, v]:
            other[count] = v
            count += 1
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
        price[i] = _reduced(u, v, shared, terms)
    if work > 0:
        for k in cuts:
            for v in terms.member[terms.first_member[k] : terms.first_member[k + 1]]:
                room[v] = 0.0
    else:
        for k in cuts:
            room[k] = 0.0
    return count


@kernel
def _rooms(terms: Terms) -> tuple[Ints, Floats, Floats]:
    """`other`, `price` and `room` of `_row`."""
    n = len(terms.cluster)
    return np.empty(n, np.int64), np.empty(n), np.zeros(max(n, len(terms.weight)))


@kernel
def _scan(first: int, last: int, terms: Terms, longest: Floats) -> None:
    """Per row the two least reduced costs, and the largest size of any."""
    other, price, room = _rooms(terms)
    for u in range(first, last):
        least = second = np.inf
        size = 0.0
        for i in range(_row(u, terms, other, price, room)):
            r = price[i]
            size = max(size, abs(r))
            if r < least:
                least, second = r, least
            elif r < second:
                second = r
        terms.least[u], terms.second[u], longest[u] = least, second, size


@kernel
def _beyond(u: int, v: int, price: float, terms: Terms) -> float:
    """What a leg costs its ends more than the second cheapest of theirs."""
    return 0.5 * (max(price - terms.second[u], 0.0) + max(price - terms.second[v], 0.0))


@kernel
def _ways(terms: Terms, excess: Floats, missing: float) -> tuple[Floats, Floats, Ints]:
    """(V,) the least that a way from the base to a vertex costs above the bound, that of a way whose
    last leg is another, and the vertex before it on the first; inf where that is more than what is
    missing. Dijkstra's algorithm: nothing on a way is negative."""
    n = len(terms.cluster)
    way, other_way = np.full(n, np.inf), np.full(n, np.inf)
    before = np.full(n, -1, np.int64)
    done = np.zeros(n, np.bool_)
    other, price, room = _rooms(terms)
    way[0] = other_way[0] = 0.0
    while True:
        u, least = -1, np.inf
        for v in range(n):
            if not done[v] and way[v] < least:
                u, least = v, way[v]
        if u < 0 or least > missing:
            break
        done[u] = True
        for i in range(_row(u, terms, other, price, room)):
            v = other[i]
            if v == 0:
                continue
            new = least + _beyond(u, v, price[i], terms) + excess[v]
            if new < way[v]:
                way[v], other_way[v], before[v] = new, way[v], u
            elif new < other_way[v]:
                other_way[v] = new
    return way, other_way, before


@kernel
def _rule_out(
    first: int, last: int, terms: Terms, above: Floats, way: Floats, other_way: Floats,
    before: Ints, missing: float,
) -> None:  # fmt: skip
    """Mark the legs whose ends cost more than what is missing if they are used: an end pays for
    half of the leg, and half of its cheapest other one; or to which and from which the ways cost as
    much."""
    other, price, room = _rooms(terms)
    for u in range(first, last):
        for i in range(_row(u, terms, other, price, room)):
            v, r = other[i], price[i]
            there = other_way[u] if before[u] == v else way[u]
            home = other_way[v] if before[v] == u else way[v]
            if there + _beyond(u, v, r, terms) + home > missing:
                terms.dead[u, v] = True
                continue
            on = terms.second[u] if r <= terms.least[u] else terms.least[u]
            back = terms.second[v] if r <= terms.least[v] else terms.least[v]
            if above[u] + above[v] + r + 0.5 * (on + back) > missing:
                terms.dead[u, v] = True


@kernel
def _cheapest(
    rows: Ints, terms: Terms, tolerance: float, held_at: Ints, held_price: Floats
) -> None:  # fmt: skip
    """Per row the legs of least reduced cost, if it is negative, in no order."""
    most = held_at.shape[1]
    other, price, room = _rooms(terms)
    for u in rows:
        held, worst = 0, 0
        for i in range(_row(u, terms, other, price, room)):
            r = price[i]
            if r >= -tolerance or (held == most and r >= held_price[u, worst]):
                continue
            at = worst
            if held < most:
                at = held
                held += 1
            held_at[u, at], held_price[u, at] = other[i], r
            if held == most:
                worst = 0
                for k in range(most):
                    if held_price[u, k] > held_price[u, worst]:
                        worst = k


@kernel
def _of(legs: Ints, terms: Terms) -> Floats:
    """The reduced cost of each leg, as `_row` has it."""
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
        out[k] = _reduced(u, v, shared, terms)
    return out

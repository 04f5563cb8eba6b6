"""The prices of all legs at dual values: one pass for the bound, one for what it rules out.

The bound is that of `netsp.mip.lagrangian_bound`. A tour through a given vertex, or along a given
leg, pays what these cost above the cheapest of their clusters.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.gtsp.sparse_costs import EMPTY_ROWS, Rows, SparseCosts
from netsp.mip.cuts import Cut
from netsp.mip.deadlegs import NO_BITS, Bits, DeadLegs, mark_dead
from netsp.mip.lagrangian_bound import least_of_clusters, rounding
from netsp.mip.parity_paths import beyond, paths_from_base
from netsp.mip.program import Duals
from netsp.mip.reducedcosts import Terms, reduced_costs, reduced_costs_at, rooms

ROWS = 256
"""Rows of a matrix that a thread works on at a time."""

CHEAPEST = 8
"""Legs of negative reduced cost that are kept for each vertex."""


class Prices:
    """The reduced costs of `netsp.mip.lagrangian_bound` over a matrix of costs.

    Parameters
    ----------
    costs : ndarray, shape (V, V)
        Of legs; inf where there is none.
    dead : DeadLegs or SparseCosts
        Legs that are of no interest, and those that there are none of; or the others, with costs,
        and then the matrix is not looked at.
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
        self, costs: Floats, dead: DeadLegs | SparseCosts, cluster: Ints, cuts: Sequence[Cut],
        duals: Duals, check: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self._check, self._dead = check, dead
        self._size = len(cluster)
        active = np.flatnonzero(duals.cut < 0.0).tolist()
        sets, weight = [cuts[k].inside for k in active], [-duals.cut[k] for k in active]
        split = {k for k in active if cuts[k].splits(cluster)}
        for k in sorted(split):
            of_teeth = cuts[k].tooth_sets(cluster)
            sets += of_teeth
            weight += [-duals.cut[k]] * len(of_teeth)
        inside = np.array(sets, dtype=bool).reshape(-1, self._size)
        of_cut, member = map(np.ascontiguousarray, np.nonzero(inside))
        first_member = np.searchsorted(of_cut, np.arange(len(sets) + 1))
        by_vertex = np.argsort(member, kind="stable")
        first_at = np.searchsorted(member[by_vertex], np.arange(self._size + 1))
        m = int(cluster.max(initial=0)) + 1
        tooth_pairs = np.zeros((m, m))
        for k in active:
            if cuts[k].teeth and k not in split:
                tooth_pairs[cuts[k].tooth_pairs(m)] += duals.cut[k]
        vertex = 2.0 * duals.degree - duals.cluster[cluster]
        for k in active:
            vertex[cuts[k].inside & (cluster != cuts[k].cluster)] += duals.cut[k]
        least, second, longest = np.empty((3, self._size))
        terms = self._terms = Terms(
            costs, *_held(dead), cluster, duals.degree, first_at, of_cut[by_vertex], first_member,
            member, np.array(weight, dtype=float), tooth_pairs, vertex, least, second,
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
        way, other_way, before = paths_from_base(terms, excess, missing, self._check)
        self._by_rows(
            lambda a, b: _rule_out(a, b, terms, above, way, other_way, before, missing), self._size
        )
        gone = (excess > missing) | (way + other_way > missing + excess)
        gone[0] = False
        self._dead.add_vertices(gone)

    def room(self, cutoff: float) -> Floats:
        """(V, V) by how much more a leg may cost than it does and be in a tour shorter than the
        cutoff; -inf where it is dead."""
        terms, out = self._terms, np.full((self._size, self._size), -np.inf)
        above = terms.vertex - self._cheapest[terms.cluster]
        missing = cutoff - self.bound
        self._by_rows(lambda a, b: _room(a, b, terms, above, missing, out), self._size)
        return out

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
        return reduced_costs(legs, self._terms)

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


def _held(dead: DeadLegs | SparseCosts) -> tuple[Bits, Rows]:
    """For the kernels."""
    return (dead.bits, EMPTY_ROWS) if isinstance(dead, DeadLegs) else (NO_BITS, dead.held)


@kernel
def _scan(first: int, last: int, terms: Terms, longest: Floats) -> None:
    """Per row the two least reduced costs, and the largest size of any."""
    other, price, room = rooms(terms)
    for u in range(first, last):
        least = second = np.inf
        size = 0.0
        for i in range(reduced_costs_at(u, terms, other, price, room)):
            r = price[i]
            size = max(size, abs(r))
            if r < least:
                least, second = r, least
            elif r < second:
                second = r
        terms.least[u], terms.second[u], longest[u] = least, second, size


@kernel
def _rule_out(
    first: int, last: int, terms: Terms, above: Floats, way: Floats, other_way: Floats,
    before: Ints, missing: float,
) -> None:  # fmt: skip
    """Mark the legs whose ends cost more than what is missing if they are used, or to which and
    from which the ways cost as much; rows let go of them."""
    other, price, room = rooms(terms)
    rows = terms.rows
    held = len(rows.first) > 0
    for u in range(first, last):
        kept = 0
        for i in range(reduced_costs_at(u, terms, other, price, room)):
            v, r = other[i], price[i]
            there = other_way[u] if before[u] == v else way[u]
            home = other_way[v] if before[v] == u else way[v]
            if (
                there + home + beyond(u, v, r, terms) > missing
                or with_ends(u, v, r, above, terms) > missing
            ):
                if not held:
                    mark_dead(u, v, terms.dead)
            elif held:
                at = rows.first[u]
                rows.other[at + kept], rows.cost[at + kept] = v, rows.cost[at + i]
                kept += 1
        if held:
            rows.size[u] = kept


@kernel
def with_ends(u: int, v: int, price: float, above: Floats, terms: Terms) -> float:
    """What a tour along a leg costs above the bound, by what its ends do: an end pays for half of
    the leg, and half of its cheapest other one."""
    on = terms.second[u] if price <= terms.least[u] else terms.least[u]
    back = terms.second[v] if price <= terms.least[v] else terms.least[v]
    return float(above[u] + above[v] + price + 0.5 * (on + back))


@kernel
def _room(first: int, last: int, terms: Terms, above: Floats, missing: float, out: Floats) -> None:
    other, price, room = rooms(terms)
    for u in range(first, last):
        for i in range(reduced_costs_at(u, terms, other, price, room)):
            v = other[i]
            out[u, v] = missing - with_ends(u, v, price[i], above, terms)


@kernel
def _cheapest(
    rows: Ints, terms: Terms, tolerance: float, held_at: Ints, held_price: Floats
) -> None:  # fmt: skip
    """Per row the legs of least reduced cost, if it is negative, in no order."""
    most = held_at.shape[1]
    other, price, room = rooms(terms)
    for u in rows:
        held, worst = 0, 0
        for i in range(reduced_costs_at(u, terms, other, price, room)):
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

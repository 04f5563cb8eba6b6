"""Reduced costs of all legs: one pass for the Lagrangian bound, one for reduced-cost fixing.

The bound is that of `netsp.mip.lagrangian_bound`. A tour through a given vertex, or along a given
leg, costs at least the bound plus the excess of that vertex or leg over the cheapest choice in its
clusters.
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
from netsp.mip.lagrangian_bound import lowest_of_clusters, rounding
from netsp.mip.mip_policy import PricingPolicy
from netsp.mip.parity_paths import BasePaths, leg_excess, paths_from_base
from netsp.mip.program import Duals
from netsp.mip.reducedcosts import Terms, reduced_costs, reduced_costs_at, work_arrays


class Prices:
    """Reduced costs of all legs at given dual values.

    Parameters
    ----------
    costs : ndarray, shape (V, V)
        Costs of legs, inf for missing ones. Ignored if costs are sparse.
    dead : DeadLegs or SparseCosts
        Mask of the legs that are fixed out or missing; or the costs of all other legs.
    cluster : ndarray of int, shape (V,)
        Cluster of each vertex.
    cuts : sequence of Cut
        Cuts of the program.
    duals : Duals
        Any dual values; better ones give a better bound.
    check : callable
        Called every few million legs, from several threads; may raise to stop.
    policy : PricingPolicy
        Sizes of blocks, and candidates of each vertex.

    Attributes
    ----------
    bound : float
        Lower bound on all tours without a dead leg.
    """

    def __init__(
        self,
        costs: Floats,
        dead: DeadLegs | SparseCosts,
        cluster: Ints,
        cuts: Sequence[Cut],
        duals: Duals,
        check: Callable[[], None] = lambda: None,
        policy: PricingPolicy = PricingPolicy(),
    ) -> None:
        self.policy = policy
        self._check, self._dead = check, dead
        self._size = len(cluster)
        terms = self._terms = _terms(costs, dead, cluster, cuts, duals)
        lowest, second, vertex = terms.lowest, terms.second, terms.vertex
        longest = np.empty(self._size)
        self._by_rows(lambda a, b: _scan(a, b, terms, longest), self._size)
        self._has_more = lowest < 0.0
        self._cost = vertex + 0.5 * (lowest + second)
        self._cheapest = lowest_of_clusters(self._cost, cluster)
        fixed = float((duals.cluster + self._cheapest).sum()) + duals.constant
        self.bound = fixed - rounding(duals, float(longest.max(initial=0.0)))

    def fix_out(self, cutoff: float) -> None:
        """Mark as dead the legs and vertices that are in no tour shorter than the cutoff."""
        gap = cutoff - self.bound
        if not np.isfinite(gap):
            return
        terms = self._terms
        above = terms.vertex - self._cheapest[terms.cluster]
        excess = self._cost - self._cheapest[terms.cluster]
        paths = paths_from_base(terms, excess, gap, self._check, self.policy.vertices_per_check)
        self._by_rows(lambda a, b: _fix_out(a, b, terms, above, paths, gap), self._size)
        gone = (excess > gap) | (paths.cost + paths.second_cost > gap + excess)
        gone[0] = False
        self._dead.add_vertices(gone)

    def max_increases(self, cutoff: float) -> Floats:
        """Return by how much each leg (V, V) may cost more and be in a tour below the cutoff.

        The increase of a dead leg is -inf.
        """
        terms, out = self._terms, np.full((self._size, self._size), -np.inf)
        above = terms.vertex - self._cheapest[terms.cluster]
        gap = cutoff - self.bound
        self._by_rows(lambda a, b: _max_increases(a, b, terms, above, gap, out), self._size)
        return out

    def most_negative(self, tolerance: float) -> tuple[Ints, Floats]:
        """Return legs (k, 2), u < v, of reduced cost below minus the tolerance, and the costs (k,).

        They are the `candidates_per_vertex` most negative legs of each vertex. In a later call,
        after costs have risen, vertices that had fewer such legs are skipped.
        """
        rows, count = np.flatnonzero(self._has_more), self.policy.candidates_per_vertex
        other = np.full((self._size, count), -1, dtype=np.int64)
        price = np.zeros((self._size, count))
        terms = self._terms
        self._by_rows(
            lambda a, b: _most_negative(rows[a:b], terms, tolerance, other, price), len(rows)
        )
        self._has_more = other[:, -1] >= 0
        u, k = np.nonzero(other >= 0)
        pairs = np.sort(np.column_stack([u, other[u, k]]), axis=1)
        legs, where = np.unique(pairs.reshape(-1, 2), axis=0, return_index=True)
        return legs, price[u, k][where]

    def reduced_costs(self, legs: Ints) -> Floats:
        """Return the reduced costs (k,) of legs (k, 2)."""
        return reduced_costs(legs, self._terms)

    def _by_rows(self, work: Callable[[int, int], None], count: int) -> None:
        step = self.policy.rows_per_task
        blocks = [(k, min(k + step, count)) for k in range(0, count, step)]
        if len(blocks) < 4:
            work(0, count)
            return

        def checked(block: tuple[int, int]) -> None:
            self._check()
            work(*block)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(checked, blocks))


def _terms(
    costs: Floats, dead: DeadLegs | SparseCosts, cluster: Ints, cuts: Sequence[Cut], duals: Duals
) -> Terms:
    """Return the terms of reduced costs; `lowest` and `second` are to be filled in."""
    size, m = len(cluster), int(cluster.max(initial=0)) + 1
    active = np.flatnonzero(duals.cut < 0.0).tolist()
    sets, weight = [cuts[k].inside for k in active], [-duals.cut[k] for k in active]
    split = {k for k in active if cuts[k].splits_clusters(cluster)}
    for k in sorted(split):
        tooth_sets = cuts[k].tooth_sets(cluster)
        sets += tooth_sets
        weight += [-duals.cut[k]] * len(tooth_sets)
    inside = np.array(sets, dtype=bool).reshape(-1, size)
    holder, member = map(np.ascontiguousarray, np.nonzero(inside))
    by_vertex = np.argsort(member, kind="stable")
    tooth_pairs = np.zeros((m, m))
    vertex = 2.0 * duals.degree - duals.cluster[cluster]
    for k in active:
        if cuts[k].teeth and k not in split:
            tooth_pairs[cuts[k].tooth_pairs(m)] += duals.cut[k]
        vertex[cuts[k].inside & (cluster != cuts[k].cluster)] += duals.cut[k]
    return Terms(
        costs,
        *_alive_legs(dead),
        cluster=cluster,
        degree=duals.degree,
        first_at=np.searchsorted(member[by_vertex], np.arange(size + 1)),
        cut_at=holder[by_vertex],
        first_member=np.searchsorted(holder, np.arange(len(sets) + 1)),
        member=member,
        weight=np.array(weight, dtype=float),
        tooth_pairs=tooth_pairs,
        vertex=vertex,
        lowest=np.empty(size),
        second=np.empty(size),
    )


def _alive_legs(dead: DeadLegs | SparseCosts) -> tuple[Bits, Rows]:
    """Return the mask and the sparse costs for kernels, one of them empty."""
    return (dead.bits, EMPTY_ROWS) if isinstance(dead, DeadLegs) else (NO_BITS, dead.held)


@kernel
def _scan(first: int, last: int, terms: Terms, longest: Floats) -> None:
    """Find the two lowest reduced costs of each row, and the largest absolute one."""
    other, price, shared = work_arrays(terms)
    for u in range(first, last):
        lowest = second = np.inf
        size = 0.0
        for i in range(reduced_costs_at(u, terms, other, price, shared)):
            r = price[i]
            size = max(size, abs(r))
            if r < lowest:
                lowest, second = r, lowest
            elif r < second:
                second = r
        terms.lowest[u], terms.second[u], longest[u] = lowest, second, size


@kernel
def _fix_out(
    first: int, last: int, terms: Terms, above: Floats, paths: BasePaths, gap: float
) -> None:
    """Mark as dead, or remove from sparse costs, the legs of rows that exceed the gap.

    A leg exceeds the gap by what its ends cost if it is used, or by the paths from the base to its
    ends.
    """
    other, price, shared = work_arrays(terms)
    rows = terms.rows
    is_sparse = len(rows.first) > 0
    for u in range(first, last):
        kept = 0
        for i in range(reduced_costs_at(u, terms, other, price, shared)):
            v, r = other[i], price[i]
            to_u = paths.second_cost[u] if paths.before[u] == v else paths.cost[u]
            to_v = paths.second_cost[v] if paths.before[v] == u else paths.cost[v]
            if (
                to_u + to_v + leg_excess(u, v, r, terms) > gap
                or excess_with_ends(u, v, r, above, terms) > gap
            ):
                if not is_sparse:
                    mark_dead(u, v, terms.dead)
            elif is_sparse:
                at = rows.first[u]
                rows.other[at + kept], rows.cost[at + kept] = v, rows.cost[at + i]
                kept += 1
        if is_sparse:
            rows.size[u] = kept


@kernel
def excess_with_ends(u: int, v: int, price: float, above: Floats, terms: Terms) -> float:
    """Return what a tour along a leg costs above the bound by the choices at its ends.

    Each end pays for half of the leg and half of its cheapest other leg.
    """
    at_u = terms.second[u] if price <= terms.lowest[u] else terms.lowest[u]
    at_v = terms.second[v] if price <= terms.lowest[v] else terms.lowest[v]
    return float(above[u] + above[v] + price + 0.5 * (at_u + at_v))


@kernel
def _max_increases(
    first: int, last: int, terms: Terms, above: Floats, gap: float, out: Floats
) -> None:
    other, price, shared = work_arrays(terms)
    for u in range(first, last):
        for i in range(reduced_costs_at(u, terms, other, price, shared)):
            v = other[i]
            out[u, v] = gap - excess_with_ends(u, v, price[i], above, terms)


@kernel
def _most_negative(
    rows: Ints, terms: Terms, tolerance: float, held_at: Ints, held_price: Floats
) -> None:
    """Find the legs of most negative reduced cost of each row, in no order."""
    capacity = held_at.shape[1]
    other, price, shared = work_arrays(terms)
    for u in rows:
        held, worst = 0, 0
        for i in range(reduced_costs_at(u, terms, other, price, shared)):
            r = price[i]
            if r >= -tolerance or (held == capacity and r >= held_price[u, worst]):
                continue
            at = worst
            if held < capacity:
                at = held
                held += 1
            held_at[u, at], held_price[u, at] = other[i], r
            if held == capacity:
                worst = 0
                for k in range(capacity):
                    if held_price[u, k] > held_price[u, worst]:
                        worst = k

"""The prices of all legs at dual values: one pass for the bound, one for what it rules out.

The bound is that of `netsp.mip.bound`. A tour through a given vertex, or along a given leg, pays
what these cost above the cheapest of their clusters.

Reduced costs are never held. With thousands of classes a matrix of them, and those that are in
between, would take more memory than the costs themselves, and more time to write than to compute:
classes that lie in the same sets of all cuts pay the same for these, so that part is computed once
for each two groups of such classes.
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

    `group` is that of each vertex, of vertices that the same cuts hold; `shared` (groups, groups)
    what the cuts that hold both ends cost; `bitten` (m + 1, m + 1) what teeth that hold both
    clusters do; `vertex` r_v; `least` and `second` are r_uv of the two cheapest legs of each
    vertex.
    """

    costs: Floats
    dead: Bools
    cluster: Ints
    degree: Floats
    group: Ints
    shared: Floats
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
        first, group = _alike(inside)
        mu = duals.cut[active]
        # the product of a matrix with its own transpose takes BLAS half the work
        root = inside[:, first] * np.sqrt(-mu)[:, None]
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
            costs, dead, cluster, duals.degree, group, root.T @ root, bitten, vertex, least, second
        )
        self._by_rows(lambda a, b: _scan(a, b, terms, longest))
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
        self._by_rows(lambda a, b: _rule_out(a, b, terms, above, missing))
        gone = self._cost - self._cheapest[terms.cluster] > missing
        gone[0] = False
        terms.dead[gone] = True
        terms.dead[:, gone] = True

    def cheapest(self, tolerance: float) -> tuple[Ints, Floats]:
        """(k, 2) legs u < v of reduced costs below minus the tolerance, and these: of each vertex
        the `CHEAPEST` at most."""
        other = np.full((self._size, CHEAPEST), -1, dtype=np.int64)
        price = np.zeros((self._size, CHEAPEST))
        self._by_rows(lambda a, b: _cheapest(a, b, self._terms, tolerance, other, price))
        u, k = np.nonzero(other >= 0)
        pairs = np.sort(np.column_stack([u, other[u, k]]), axis=1)
        legs, where = np.unique(pairs.reshape(-1, 2), axis=0, return_index=True)
        return legs, price[u, k][where]

    def of(self, legs: Ints) -> Floats:
        """(k,) the reduced costs of legs (k, 2)."""
        return _of(legs, self._terms)

    def _by_rows(self, work: Callable[[int, int], None]) -> None:
        blocks = [(k, min(k + ROWS, self._size)) for k in range(0, self._size, ROWS)]
        if len(blocks) < 4:
            work(0, self._size)
            return

        def checked(block: tuple[int, int]) -> None:
            self._check()
            work(*block)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(checked, blocks))


def _alike(inside: Bools) -> tuple[Ints, Ints]:
    """The first of every group of columns that are the same, and the group of each column."""
    if not len(inside):
        return np.zeros(1, dtype=np.int64), np.zeros(inside.shape[1], dtype=np.int64)
    packed = np.ascontiguousarray(np.packbits(inside, axis=0).T)
    rows = packed.view(np.dtype((np.void, packed.shape[1]))).ravel()
    _, first, group = np.unique(rows, return_index=True, return_inverse=True)
    return first, group


@kernel
def _reduced(u: int, v: int, terms: Terms) -> float:
    """r_uv; its terms in an order that makes it the same as r_vu."""
    return float(
        terms.costs[u, v] - (terms.degree[u] + terms.degree[v])
        + terms.shared[terms.group[u], terms.group[v]]
        - terms.bitten[terms.cluster[u], terms.cluster[v]]
    )  # fmt: skip


@kernel
def _scan(first: int, last: int, terms: Terms, longest: Floats) -> None:
    """Per row the two least reduced costs, and the largest size of any."""
    n = len(terms.cluster)
    for u in range(first, last):
        least = second = np.inf
        size = 0.0
        for v in range(n):
            if terms.dead[u, v]:
                continue
            r = _reduced(u, v, terms)
            size = max(size, abs(r))
            if r < least:
                least, second = r, least
            elif r < second:
                second = r
        terms.least[u], terms.second[u], longest[u] = least, second, size


@kernel
def _rule_out(first: int, last: int, terms: Terms, above: Floats, missing: float) -> None:
    """Mark the legs whose ends cost more than what is missing if they are used: an end pays for
    half of the leg, and half of its cheapest other one."""
    n = len(terms.cluster)
    for u in range(first, last):
        for v in range(n):
            if terms.dead[u, v]:
                continue
            r = _reduced(u, v, terms)
            on = terms.second[u] if r <= terms.least[u] else terms.least[u]
            back = terms.second[v] if r <= terms.least[v] else terms.least[v]
            if above[u] + above[v] + r + 0.5 * (on + back) > missing:
                terms.dead[u, v] = True


@kernel
def _cheapest(
    first: int, last: int, terms: Terms, tolerance: float, other: Ints, price: Floats
) -> None:  # fmt: skip
    """Per row the legs of least reduced cost, if it is negative, in no order."""
    n, most = len(terms.cluster), other.shape[1]
    for u in range(first, last):
        held, worst = 0, 0
        for v in range(n):
            if terms.dead[u, v]:
                continue
            r = _reduced(u, v, terms)
            if r >= -tolerance or (held == most and r >= price[u, worst]):
                continue
            at = worst
            if held < most:
                at = held
                held += 1
            other[u, at], price[u, at] = v, r
            if held == most:
                worst = 0
                for k in range(most):
                    if price[u, k] > price[u, worst]:
                        worst = k


@kernel
def _of(legs: Ints, terms: Terms) -> Floats:
    """The reduced cost of each leg."""
    out = np.empty(len(legs))
    for k in range(len(legs)):
        out[k] = _reduced(legs[k, 0], legs[k, 1], terms)
    return out

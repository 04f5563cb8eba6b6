"""Ruin and recreate on orders of clusters, with the classes of every order chosen exactly.

Slack induction by string removals (Christiaens & Vanden Berghe 2020, "Slack induction by string
removals for vehicle routing problems"), carried over to the generalised TSP: a stretch of the tour
near a random goal is taken out, its clusters are put back one by one where they cost least, and the
new tour is accepted by simulated annealing.

What an insertion costs is exact in the sense of the whole tour: with ``ahead[p, i]`` the shortest
path from the base to vertex i of cluster p, through all clusters before it, and ``behind[q, i]``
from vertex i of cluster q home, the best tour that has cluster c between p and q is ``min over
i, j, l of ahead[p, i] + c_ij + c_jl + behind[q, l]``, every class of every other goal chosen anew.
Most of what they hold outlives a change: what lies far away has no say in which classes are best.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.arrays import Bools, Floats, Ints
from netsp.compiled.chance import below, uniform
from netsp.compiled.kernel import kernel

LONGEST_STRING = 10
"""Most clusters in one removed stretch."""

REMOVED = 10
"""Average number of clusters removed together."""

EVEN = 1e-12
"""Share of a length up to which two differences are the same."""

BLINK = 0.01
"""Chance that a place is overlooked (same paper, section 3.3)."""

AFRESH = 64
"""Orders accepted, after which the tables are filled afresh: every change adds its rounding."""


class Tables(NamedTuple):
    """Of an instance: where the vertices of each cluster begin; legs; least legs between clusters
    (m + 1, m + 1); which clusters are near which; the nearest clusters of each (m + 1, k), nearest
    first; which clusters come before which, (0, 0) for none. The kernels that are called most take
    what they need of it one by one: handing a tuple of arrays on costs them more than the work."""

    start: Ints
    costs: Floats
    nearest: Floats
    near: Bools
    rank: Ints
    before: Bools


@kernel
def forward(
    order: Ints, n: int, first: int, settled: int, start: Ints, costs: Floats, ahead: Floats
) -> None:
    """Fill ``ahead`` from position `first` on; order[0] is the base, positions run to n - 1.

    From position `settled` on (n for nowhere) the order is that of before, and ``ahead`` holds what
    was true then. Once all paths to a cluster there have become longer by the same, those to all
    after it have, too."""
    for k in range(first, n):
        c, p = order[k], order[k - 1]
        longer, even = 0.0, True
        for j in range(start[c], start[c + 1]):
            best = np.inf
            for i in range(start[p], start[p + 1]):
                d = ahead[p, i - start[p]] + costs[i, j]
                if d < best:
                    best = d
            by = best - ahead[c, j - start[c]]
            if j == start[c]:
                longer = by
            elif abs(by - longer) > EVEN * best:
                even = False
            ahead[c, j - start[c]] = best
        if even and k >= settled:
            for q in range(k + 1, n):
                c = order[q]
                for j in range(start[c + 1] - start[c]):
                    ahead[c, j] += longer
            return


@kernel
def backward(
    order: Ints, n: int, last: int, settled: int, start: Ints, costs: Floats, behind: Floats
) -> None:
    """Fill ``behind`` from position `last` down to 1, as `forward`; up to position `settled` (0 for
    nowhere) it holds what was true before."""
    for k in range(last, 0, -1):
        c = order[k]
        q = order[k + 1] if k + 1 < n else 0
        longer, even = 0.0, True
        for j in range(start[c], start[c + 1]):
            best = np.inf
            for i in range(start[q], start[q + 1]):
                d = behind[q, i - start[q]] + costs[j, i]
                if d < best:
                    best = d
            by = best - behind[c, j - start[c]]
            if j == start[c]:
                longer = by
            elif abs(by - longer) > EVEN * best:
                even = False
            behind[c, j - start[c]] = best
        if even and k <= settled:
            for p in range(k - 1, 0, -1):
                c = order[p]
                for j in range(start[c + 1] - start[c]):
                    behind[c, j] += longer
            return


@kernel
def fill(order: Ints, start: Ints, costs: Floats, ahead: Floats, behind: Floats) -> None:
    """Fill both tables for an order."""
    n = len(order)
    ahead[0, 0] = behind[0, 0] = 0.0
    forward(order, n, 1, n, start, costs, ahead)
    backward(order, n, n - 1, 0, start, costs, behind)


@kernel
def inserted(
    c: int,
    k: int,
    order: Ints,
    n: int,
    start: Ints,
    costs: Floats,
    ahead: Floats,
    behind: Floats,
    limit: float,
) -> float:
    """Length of the best tour with cluster c after position k."""
    p = order[k]
    q = order[k + 1] if k + 1 < n else 0
    best = limit
    for j in range(start[c], start[c + 1]):
        there = np.inf
        for i in range(start[p], start[p + 1]):
            d = ahead[p, i - start[p]] + costs[i, j]
            if d < there:
                there = d
        if there >= best:
            continue
        for i in range(start[q], start[q + 1]):
            d = there + costs[j, i] + behind[q, i - start[q]]
            if d < best:
                best = d
    return best


@kernel
def insert_best(
    c: int,
    order: Ints,
    n: int,
    start: Ints,
    costs: Floats,
    near: Bools,
    before: Bools,
    ahead: Floats,
    behind: Floats,
    blink: float,
    chance: npt.NDArray[np.uint64],
) -> tuple[int, float]:
    """Put a cluster where it costs least, next to one of its near clusters or the base, and between
    those that come before and after it; returns the new size and the length of the tour. With
    precedences closed transitively there is such a place, whatever is still to be put back."""
    best, at = np.inf, -1
    tried = False
    low, high = 0, n - 1
    for k in range(1, n if len(before) > 0 else 0):
        if before[order[k], c]:
            low = k
        if before[c, order[k]]:
            high = k - 1
            break
    for k in range(low, high + 1):
        close = k in (low, high) or near[c, order[k]]
        if not close:
            q = order[k + 1] if k + 1 < n else 0
            close = near[c, q]
        if not close:
            continue
        if blink > 0.0 and tried and uniform(chance) < blink:
            continue
        tried = True
        d = inserted(c, k, order, n, start, costs, ahead, behind, best)
        if d < best:
            best, at = d, k
    for k in range(n, at + 1, -1):
        order[k] = order[k - 1]
    order[at + 1] = c
    n += 1
    forward(order, n, at + 1, at + 2, start, costs, ahead)
    backward(order, n, at + 1, at, start, costs, behind)
    return n, best


@kernel
def descend(
    order: Ints,
    tables: Tables,
    ahead: Floats,
    behind: Floats,
    chance: npt.NDArray[np.uint64],
    stop: Ints,
) -> float:
    """Take every cluster out and put it back where it costs least, until nothing improves; returns
    the length."""
    start, costs, near, before = tables.start, tables.costs, tables.near, tables.before
    n = len(order)
    work = np.empty(n + 1, dtype=np.int64)
    length = tour_length(order, start, costs, ahead, behind)
    improved = True
    while improved:
        improved = False
        for c in range(1, n):
            if stop[0] != 0:
                return length
            size = 0
            for k in range(n):
                if order[k] != c:
                    work[size] = order[k]
                    size += 1
            fill(work[:size], start, costs, ahead, behind)
            size, d = insert_best(
                c, work, size, start, costs, near, before, ahead, behind, 0.0, chance
            )
            if d < length * (1.0 - 1e-12):
                length = d
                improved = True
                for k in range(n):
                    order[k] = work[k]
    return length


@kernel
def tour_length(order: Ints, start: Ints, costs: Floats, ahead: Floats, behind: Floats) -> float:
    """Length of the best tour in the given order."""
    n = len(order)
    if n == 1:
        return 0.0
    ahead[0, 0] = 0.0
    forward(order, n, 1, n, start, costs, ahead)
    c = order[n - 1]
    best = np.inf
    for j in range(start[c], start[c + 1]):
        best = min(best, ahead[c, j - start[c]] + costs[j, 0])
    return best


@kernel
def two_opt(
    order: Ints,
    tables: Tables,
    ahead: Floats,
    behind: Floats,
    stop: Ints,
) -> float:
    """Reverse stretches of the order as long as that shortens the tour; candidates are those whose
    two new legs could be shorter than the two old ones; returns the length."""
    start, costs, nearest, before = tables.start, tables.costs, tables.nearest, tables.before
    n = len(order)
    work = np.empty(n, dtype=np.int64)
    tour = np.empty(n, dtype=np.int64)
    length = tour_length(order, start, costs, ahead, behind)
    trace(order, start, costs, ahead, tour)
    improved = True
    while improved:
        improved = False
        for i in range(1, n - 1):
            if stop[0] != 0:
                return length
            for j in range(i + 1, n):
                if len(before) > 0 and _bound_to_any(order, i, j, before):
                    break
                after = tour[j + 1] if j + 1 < n else 0
                c_after = order[j + 1] if j + 1 < n else 0
                old = costs[tour[i - 1], tour[i]] + costs[tour[j], after]
                new = nearest[order[i - 1], order[j]] + nearest[order[i], c_after]
                if new >= old:
                    continue
                for k in range(n):
                    work[k] = order[k] if k < i or k > j else order[i + j - k]
                d = tour_length(work, start, costs, ahead, behind)
                if d < length * (1.0 - 1e-12):
                    length = d
                    improved = True
                    for k in range(n):
                        order[k] = work[k]
                    trace(order, start, costs, ahead, tour)
    return length


@kernel
def _bound_to_any(order: Ints, i: int, j: int, before: Bools) -> bool:
    """Whether a cluster from position i on must come before the one at position j."""
    return bool(before[order[i:j], order[j]].any())


@kernel
def trace(order: Ints, start: Ints, costs: Floats, ahead: Floats, tour: Ints) -> None:
    """The vertices of the best tour, from ``ahead`` filled for the order."""
    n = len(order)
    tour[0] = 0
    v = 0
    for k in range(n - 1, 0, -1):
        c = order[k]
        best, pick = np.inf, start[c]
        for j in range(start[c], start[c + 1]):
            d = ahead[c, j - start[c]] + costs[j, v]
            if d < best:
                best, pick = d, j
        tour[k] = pick
        v = pick


@kernel
def ruin_and_recreate(
    order: Ints,
    best: Ints,
    length: float,
    best_length: float,
    count: int,
    theta: float,
    tables: Tables,
    ahead: Floats,
    behind: Floats,
    age: Ints,
    chance: npt.NDArray[np.uint64],
) -> tuple[float, float]:
    """Make `count` rounds at temperature θ, in place; returns the lengths of the present order and
    of the best, which is kept in `best`. ``ahead`` and ``behind`` are those of the present order,
    and age[0] counts the orders accepted since they were filled: rounding must not depend on how
    rounds are counted out."""
    start, costs, nearest = tables.start, tables.costs, tables.nearest
    near, rank, before = tables.near, tables.rank, tables.before
    n = len(order)
    present, home = ahead, behind
    ahead, behind = present.copy(), home.copy()
    work = np.empty(n + 1, dtype=np.int64)
    out = np.zeros(n, dtype=np.bool_)
    position = np.empty(n, dtype=np.int64)
    gone = np.empty(n, dtype=np.int64)
    key = np.empty(n)
    for _ in range(count):
        for k in range(n):
            out[k] = False
            position[order[k]] = k
        # strings around clusters near a seed, as in the paper, section 3.1
        longest = min(LONGEST_STRING, n - 1)
        strings = int(uniform(chance) * (4.0 * REMOVED / (1.0 + longest))) + 1
        seed = 1 + below(n - 1, chance)
        removed = 0
        first, last = n, 0
        for r in range(-1, rank.shape[1]):
            if strings == 0:
                break
            c = seed if r < 0 else rank[seed, r]
            if c == 0 or out[c]:
                continue
            strings -= 1
            size = 1 + below(longest, chance)
            low = position[c] - below(size, chance)
            for k in range(low, low + size):
                if 1 <= k < n and not out[order[k]]:
                    out[order[k]] = True
                    gone[removed] = order[k]
                    removed += 1
                    first, last = min(first, k), max(last, k)
        size = 0
        for k in range(n):
            if not out[order[k]]:
                work[size] = order[k]
                size += 1
        # put back in random order, the farthest from the base first, or the nearest first
        mode = below(4, chance)
        for r in range(removed):
            if mode == 0:
                key[r] = -nearest[0, gone[r]]
            elif mode == 1:
                key[r] = nearest[0, gone[r]]
            else:
                key[r] = uniform(chance)
        for r in range(1, removed):
            c, x = gone[r], key[r]
            q = r - 1
            while q >= 0 and key[q] > x:
                gone[q + 1], key[q + 1] = gone[q], key[q]
                q -= 1
            gone[q + 1], key[q + 1] = c, x
        ahead[:] = present
        behind[:] = home
        after = last + 1 - removed
        forward(work, size, first, after, start, costs, ahead)
        backward(work, size, after - 1, first - 1, start, costs, behind)
        d = 0.0
        for r in range(removed):
            size, d = insert_best(
                gone[r], work, size, start, costs, near, before, ahead, behind, BLINK, chance
            )
        if d < length - theta * np.log(max(uniform(chance), 1e-300)):
            length = d
            for k in range(n):
                order[k] = work[k]
            age[0] += 1
            if age[0] == AFRESH:
                fill(order, start, costs, ahead, behind)
                age[0] = 0
            present[:] = ahead
            home[:] = behind
            if d < best_length * (1.0 - 1e-12):
                best_length = d
                for k in range(n):
                    best[k] = work[k]
    return length, best_length

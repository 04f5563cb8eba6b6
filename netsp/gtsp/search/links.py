"""A tour as links between clusters, with what each place in it costs.

For each cluster c of the tour, ``ahead[c, j]`` is the shortest path from the base through all
clusters before it to its vertex j, less the minimum over j, and ``step_ahead[c]`` is the increase
of that minimum over the one of the cluster before; ``behind[c, j]`` and ``step_behind[c]`` are the
same for paths home. The base begins and ends the tour: ``step_behind[0]`` belongs to its first leg,
``step_ahead[0]`` to its last. The tour's length is the sum of ``step_ahead``. Between p and its
successor q, cluster c costs

    min over i, j, l of ahead[p, i] + c_ij + c_jl + behind[q, l]
    less min over i, l of ahead[p, i] + c_il + behind[q, l],

where the vertex of every other cluster is chosen again.

Both tables are known up to a constant for each cluster. So a change is written only as far as it
changes which vertices are best, which is seldom more than a few clusters, however long the tour.
Costs are symmetric.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.interpretation import interprets
from netsp.base.compiled.kernel import kernel
from netsp.base.compiled.rng import uniform

EQUAL_LENGTHS = 1e-13
"""Tolerance, relative, within which two lengths are equal. At each cluster along the tour a table
may be off by this share of its largest number (`LayeredInstance.rounding`)."""


class Tables(NamedTuple):
    """Arrays of an instance for kernels.

    ``nearest`` is (m + 1, m + 1), ``rank`` (m + 1, k). The clusters that cluster c may be inserted
    next to are ``neighbours[first[c]:first[c + 1]]``, as in ``near``. ``min_gain`` is the share of
    the tour's length that a move must save, ``rounding`` the gain that rounding may feign
    (`LayeredInstance`). The kernels that are called most often get these arrays one by one, because
    passing a tuple of arrays on would cost more than their work.
    """

    start: Ints
    costs: Floats
    nearest: Floats
    near: Bools
    first: Ints
    neighbours: Ints
    rank: Ints
    before: Bools
    min_gain: float
    rounding: float


class Links(NamedTuple):
    """A tour: the clusters after and before each, -1 for one that is out of it, and its tables."""

    after: Ints
    prior: Ints
    ahead: Floats
    behind: Floats
    step_ahead: Floats
    step_behind: Floats


def no_links(clusters: int, largest: int) -> Links:
    """Return empty links of some clusters, the base included, of at most `largest` vertices."""
    ahead, behind = np.zeros((2, clusters, largest))
    step_ahead, step_behind = np.zeros((2, clusters))
    after, prior = np.full((2, clusters), -1, dtype=np.int64)
    return Links(after, prior, ahead, behind, step_ahead, step_behind)


@kernel
def propagate(
    c: int,
    min_clusters: int,
    after: Ints,
    prior: Ints,
    start: Ints,
    costs: Floats,
    ahead: Floats,
    step_ahead: Floats,
    row: Floats,
) -> float:
    """Fill ``ahead`` and ``step_ahead`` from cluster c on, and return the tour's change in length.

    It ends at a cluster, after the next `min_clusters` ones, whose numbers do not change. With
    ``after`` and ``prior`` exchanged it fills ``behind`` and ``step_behind``, towards the base.
    Numbers that are equal within rounding are not rewritten: if they were, and the numbers after
    them were not, the tables would drift apart.
    """
    longer = 0.0
    while True:
        p, begin, size = prior[c], start[c], start[c + 1] - start[c]
        lowest = np.inf
        for j in range(size):
            best = np.inf
            for i in range(start[p], start[p + 1]):
                d = ahead[p, i - start[p]] + costs[i, begin + j]
                if d < best:
                    best = d
            row[j] = best
            lowest = min(lowest, best)
        if c == p:
            lowest = 0.0  # the base alone
        longer += lowest - step_ahead[c]
        step_ahead[c] = lowest
        if c == 0:
            return float(longer)
        is_unchanged = min_clusters <= 0
        for j in range(size):
            if abs(row[j] - lowest - ahead[c, j]) > EQUAL_LENGTHS * row[j]:
                is_unchanged = False
        if is_unchanged:
            return float(longer)
        for j in range(size):
            ahead[c, j] = row[j] - lowest
        min_clusters -= 1
        c = after[c]


@interprets(propagate)
def _propagate_in_numpy(
    c: int,
    min_clusters: int,
    after: Ints,
    prior: Ints,
    start: Ints,
    costs: Floats,
    ahead: Floats,
    step_ahead: Floats,
    row: Floats,
) -> float:
    """Vectorise `propagate` over the vertices of a cluster."""
    longer = 0.0
    while True:
        p, begin, end = prior[c], start[c], start[c + 1]
        legs = costs[start[p] : start[p + 1], begin:end]
        best = np.fmin.reduce(ahead[p, : len(legs), None] + legs, axis=0, initial=np.inf)
        row[: len(best)] = best
        lowest = 0.0 if c == p else float(best.min(initial=np.inf))
        longer += lowest - float(step_ahead[c])
        step_ahead[c] = lowest
        if c == 0:
            return longer
        above_lowest = best - lowest
        if (
            min_clusters <= 0
            and not (np.abs(above_lowest - ahead[c, : len(best)]) > EQUAL_LENGTHS * best).any()
        ):
            return longer
        ahead[c, : len(best)] = above_lowest
        min_clusters -= 1
        c = int(after[c])


@kernel
def link(order: Ints, links: Links, start: Ints, costs: Floats, row: Floats) -> float:
    """Link clusters in an order, base first, fill the tables, and return the tour's length."""
    after, prior, ahead, behind, step_ahead, step_behind = links
    n = len(order)
    after[:], prior[:] = -1, -1
    step_ahead[:], step_behind[:] = 0.0, 0.0
    for k in range(n):
        after[order[k]], prior[order[k]] = order[(k + 1) % n], order[k - 1]
    propagate(after[0], n, after, prior, start, costs, ahead, step_ahead, row)
    propagate(prior[0], n, prior, after, start, costs, behind, step_behind, row)
    return tour_length(after, step_ahead)


@kernel
def tour_length(after: Ints, step_ahead: Floats) -> float:
    """Return the length of the tour."""
    length, c = step_ahead[0], after[0]
    while c != 0:
        length += step_ahead[c]
        c = after[c]
    return float(length)


@kernel
def write_order(after: Ints, order: Ints) -> None:
    """Write the clusters of the tour into `order`, base first."""
    c = 0
    for k in range(len(order)):
        order[k] = c
        c = after[c]


@kernel
def put(
    c: int,
    p: int,
    after: Ints,
    prior: Ints,
    start: Ints,
    costs: Floats,
    ahead: Floats,
    behind: Floats,
    step_ahead: Floats,
    step_behind: Floats,
    row: Floats,
) -> float:
    """Insert cluster c after p and return the change of the tour's length."""
    q = after[p]
    after[p], prior[c], after[c], prior[q] = c, p, q, c
    propagate(c, 1, prior, after, start, costs, behind, step_behind, row)
    return float(propagate(c, 1, after, prior, start, costs, ahead, step_ahead, row))


@kernel
def take_out(
    c: int,
    after: Ints,
    prior: Ints,
    start: Ints,
    costs: Floats,
    ahead: Floats,
    behind: Floats,
    step_ahead: Floats,
    step_behind: Floats,
    row: Floats,
) -> float:
    """Remove cluster c and return the change of the tour's length, which is negative."""
    p, q, old_growth = prior[c], after[c], step_ahead[c]
    after[p], prior[q], after[c], prior[c] = q, p, -1, -1
    step_ahead[c] = 0.0
    propagate(p, 0, prior, after, start, costs, behind, step_behind, row)
    return float(propagate(q, 0, after, prior, start, costs, ahead, step_ahead, row) - old_growth)


@kernel
def between(
    c: int,
    p: int,
    limit: float,
    after: Ints,
    start: Ints,
    costs: Floats,
    nearest: Floats,
    ahead: Floats,
    behind: Floats,
    step_behind: Floats,
) -> float:
    """Return by how much inserting cluster c after p lengthens the best tour, at most `limit`."""
    q = after[p]
    now = np.inf
    for i in range(start[p + 1] - start[p]):
        now = min(now, ahead[p, i] + behind[p, i])
    now += step_behind[p]
    # no leg is cheaper than the cheapest between its clusters, and both tables are 0 or more
    if nearest[p, c] + nearest[c, q] - now >= limit:
        return limit
    bar = limit + now
    best = bar
    for j in range(start[c], start[c + 1]):
        reached = np.inf
        for i in range(start[p], start[p + 1]):
            d = ahead[p, i - start[p]] + costs[j, i]
            if d < reached:
                reached = d
        if reached >= best:
            continue
        for i in range(start[q], start[q + 1]):
            d = reached + costs[j, i] + behind[q, i - start[q]]
            if d < best:
                best = d
    return best - now if best < bar else limit


@interprets(between)
def _between_in_numpy(
    c: int,
    p: int,
    limit: float,
    after: Ints,
    start: Ints,
    costs: Floats,
    nearest: Floats,
    ahead: Floats,
    behind: Floats,
    step_behind: Floats,
) -> float:
    """Vectorise `between` over the vertices of the clusters."""
    q = after[p]
    left, right = start[p], start[q]
    left_end, right_end = start[p + 1], start[q + 1]
    far = ahead[p, : left_end - left]
    now = float(np.fmin.reduce(far + behind[p, : left_end - left]) + step_behind[p])
    if nearest[p, c] + nearest[c, q] - now >= limit:
        return limit
    bar = float(limit + now)
    legs = costs[start[c] : start[c + 1]]
    reached = np.fmin.reduce(legs[:, left:left_end] + far, 1)
    onward = reached[:, None] + legs[:, right:right_end]
    onward += behind[q, : right_end - right]
    best = float(np.fmin.reduce(onward, None))
    return best - now if best < bar else limit


@kernel
def best_place(
    c: int,
    after: Ints,
    prior: Ints,
    start: Ints,
    costs: Floats,
    nearest: Floats,
    near: Bools,
    first: Ints,
    neighbours: Ints,
    before: Bools,
    ahead: Floats,
    behind: Floats,
    step_behind: Floats,
    place: Ints,
    blink: float,
    chance: npt.NDArray[np.uint64],
) -> tuple[int, float]:
    """Return the cluster after which inserting cluster c costs least, and its cost.

    The places tried are next to one of its near clusters, and at both ends of the stretch between
    the clusters that must precede and follow it; without precedences the stretch begins and ends at
    the base. Because precedences are closed transitively, there is such a stretch, whatever remains
    to be inserted. Places other than its ends are skipped with probability `blink`. `place` is a
    work array for the places of clusters.
    """
    low, high = 0, prior[0]
    if len(before) > 0:
        x, k = after[0], 1
        place[0], open_end = 0, True
        while x != 0:
            place[x] = k
            if before[x, c]:
                low = x
            if before[c, x] and open_end:
                high, open_end = prior[x], False
            x, k = after[x], k + 1
    at = low
    best = between(c, low, np.inf, after, start, costs, nearest, ahead, behind, step_behind)
    if high != low:
        d = between(c, high, best, after, start, costs, nearest, ahead, behind, step_behind)
        if d < best:
            best, at = d, high
    for k in range(2 * first[c], 2 * first[c + 1]):
        p = neighbours[k // 2]
        if after[p] < 0:
            continue
        if k % 2 == 1:
            p = prior[p]
            if near[c, p]:
                continue  # tried as the place after that one
        if p in (low, high):
            continue
        if len(before) > 0 and not place[low] <= place[p] <= place[high]:
            continue
        if blink > 0.0 and uniform(chance) < blink:
            continue
        d = between(c, p, best, after, start, costs, nearest, ahead, behind, step_behind)
        if d < best:
            best, at = d, p
    return at, best

"""Moves of one cluster and reversals, as long as they shorten the tour."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.dynamic_array import write_ints
from netsp.base.compiled.kernel import kernel
from netsp.gtsp.search.layers import best_classes
from netsp.gtsp.search.links import Links, Tables, best_place, link, put, take_out, write_order


@kernel
def descend(
    order: Ints, tables: Tables, links: Links, chance: npt.NDArray[np.uint64], stop: Ints
) -> float:
    """Move each cluster to where it costs least until no move shortens the tour.

    ``links`` belong to `order`, both on entry and on return. The tables of the links carry the
    rounding of the largest numbers that went through them, so a gain within that rounding counts
    only if the tour is shorter when measured afresh. The length measured afresh depends on the
    order alone and falls from pass to pass, so the descent ends whatever the costs are.

    Returns
    -------
    float
        Length of the tour.
    """
    start, costs, nearest, near, first, neighbours, _, before, min_gain, rounding = tables
    after, prior, ahead, behind, step_ahead, step_behind = links
    n = len(order)
    row, place = np.empty(ahead.shape[1]), np.empty(n, dtype=np.int64)
    work = order.copy()
    length = link(order, links, start, costs, row)
    improved = True
    while improved and stop[0] == 0:
        improved = False
        for c in range(1, n):
            if stop[0] != 0:
                break
            old_place = prior[c]
            d = take_out(c, after, prior, start, costs, ahead, behind, step_ahead, step_behind, row)
            p, increase = best_place(
                c,
                after,
                prior,
                start,
                costs,
                nearest,
                near,
                first,
                neighbours,
                before,
                ahead,
                behind,
                step_behind,
                place,
                0.0,
                chance,
            )
            gain = -(d + increase)
            if p != old_place and gain > min_gain * length:
                if gain > rounding or _is_shorter(
                    c, p, old_place, min_gain, after, prior, start, costs, work
                ):
                    improved = True
                else:
                    p = old_place
            else:
                p = old_place
            put(c, p, after, prior, start, costs, ahead, behind, step_ahead, step_behind, row)
        if improved:
            write_order(after, work)
            measured = link(work, links, start, costs, row)
            if measured < length:
                length = measured
                write_ints(order, work, len(order))
            else:
                link(order, links, start, costs, row)
                improved = False
    return float(length)


@kernel
def _is_shorter(
    c: int,
    p: int,
    old_place: int,
    min_gain: float,
    after: Ints,
    prior: Ints,
    start: Ints,
    costs: Floats,
    work: Ints,
) -> bool:
    """Return whether the tour, measured afresh, is shorter with cluster c moved after p.

    Cluster c is out of the tour, and was after `old_place`; `work` is a work array for an order.
    """
    _write_order_with(c, old_place, after, work)
    length, _ = best_classes(work[1:], start, costs)
    _write_order_with(c, p, after, work)
    measured, _ = best_classes(work[1:], start, costs)
    return bool(measured < length * (1.0 - min_gain))


@kernel
def _write_order_with(c: int, p: int, after: Ints, order: Ints) -> None:
    """Write the clusters into `order`, base first, with cluster c after p."""
    x, k = 0, 0
    while k < len(order):
        order[k] = x
        k += 1
        if x == p:
            order[k] = c
            k += 1
        x = after[x]


@kernel
def two_opt(order: Ints, tables: Tables, stop: Ints) -> float:
    """Reverse stretches of the order as long as that shortens the tour, and return its length.

    Stretches are tried whose two new legs could be shorter than the two old ones. Lengths are
    measured afresh, so they fall from move to move, and the descent ends whatever the costs are.
    """
    start, costs, nearest, before = tables.start, tables.costs, tables.nearest, tables.before
    n = len(order)
    work = order.copy()
    length, tour = best_classes(order[1:], start, costs)
    improved = True
    while improved:
        improved = False
        for i in range(1, n - 1):
            for j in range(i + 1, n):
                if stop[0] != 0:
                    return float(length)
                if len(before) > 0 and _precedes_any(order, i, j, before):
                    break
                after = (j + 1) % n
                old = costs[tour[i - 1], tour[i]] + costs[tour[j], tour[after]]
                if nearest[order[i - 1], order[j]] + nearest[order[i], order[after]] >= old:
                    continue
                for k in range(i, j + 1):
                    work[k] = order[i + j - k]
                d, instead = best_classes(work[1:], start, costs)
                if d < length * (1.0 - tables.min_gain):
                    length, tour, improved = d, instead, True
                    write_ints(order[i:], work[i:], j + 1 - i)
                else:
                    write_ints(work[i:], order[i:], j + 1 - i)
    return float(length)


@kernel
def _precedes_any(order: Ints, i: int, j: int, before: Bools) -> bool:
    """Return whether a cluster from position i on must come before the one at position j."""
    return bool(before[order[i:j], order[j]].any())

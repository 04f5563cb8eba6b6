"""Moves of one cluster and reversals, as long as they shorten the tour."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from netsp.arrays import Bools, Ints
from netsp.compiled.kernel import kernel
from netsp.lns.layers import best_classes
from netsp.lns.links import Links, Tables, best_place, put, take_out, tour_length, write_order

SHORTER = 1e-9
"""By that part a tour must become shorter for a move to count."""


@kernel
def descend(
    order: Ints, tables: Tables, links: Links, chance: npt.NDArray[np.uint64], stop: Ints
) -> float:
    """Take every cluster out and put it back where it costs least, until nothing improves; returns
    the length. ``links`` are those of the order, before and after."""
    start, costs, nearest, near, first, beside, _, before = tables
    after, prior, ahead, behind, grown, rest = links
    n = len(order)
    row, place = np.empty(ahead.shape[1]), np.empty(n, dtype=np.int64)
    length = tour_length(after, grown)
    improved = True
    while improved and stop[0] == 0:
        improved = False
        for c in range(1, n):
            if stop[0] != 0:
                break
            was = prior[c]
            d = take_out(c, after, prior, start, costs, ahead, behind, grown, rest, row)
            p, more = best_place(
                c, after, prior, start, costs, nearest, near, first, beside, before, ahead, behind,
                rest, place, 0.0, chance,
            )  # fmt: skip
            if d + more < -SHORTER * length:
                improved = True
            else:
                p = was
            put(c, p, after, prior, start, costs, ahead, behind, grown, rest, row)
        length = tour_length(after, grown)
    write_order(after, order)
    return length


@kernel
def two_opt(order: Ints, tables: Tables, stop: Ints) -> float:
    """Reverse stretches of the order as long as that shortens the tour; candidates are those whose
    two new legs could be shorter than the two old ones; returns the length."""
    start, costs, nearest, before = tables.start, tables.costs, tables.nearest, tables.before
    n = len(order)
    work = order.copy()
    length, tour = best_classes(order[1:], start, costs)
    improved = True
    while improved:
        improved = False
        for i in range(1, n - 1):
            if stop[0] != 0:
                return float(length)
            for j in range(i + 1, n):
                if len(before) > 0 and _bound_to_any(order, i, j, before):
                    break
                after = (j + 1) % n
                old = costs[tour[i - 1], tour[i]] + costs[tour[j], tour[after]]
                if nearest[order[i - 1], order[j]] + nearest[order[i], order[after]] >= old:
                    continue
                work[i : j + 1] = order[i : j + 1][::-1]
                d, instead = best_classes(work[1:], start, costs)
                if d < length * (1.0 - SHORTER):
                    length, tour, improved = d, instead, True
                    order[i : j + 1] = work[i : j + 1]
                else:
                    work[i : j + 1] = order[i : j + 1]
    return float(length)


@kernel
def _bound_to_any(order: Ints, i: int, j: int, before: Bools) -> bool:
    """Whether a cluster from position i on must come before the one at position j."""
    return bool(before[order[i:j], order[j]].any())

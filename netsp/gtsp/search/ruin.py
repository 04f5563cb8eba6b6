"""Ruin and recreate on orders of clusters, with the vertices of each order chosen exactly.

Slack induction by string removals (Christiaens & Vanden Berghe 2020, "Slack induction by string
removals for vehicle routing problems"), adapted to the generalised TSP: strings of the tour near a
random cluster are removed, their clusters are inserted one by one where they cost least
(`netsp.gtsp.search.links`), and simulated annealing accepts the new tour or not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.dynamic_array import write_floats, write_ints, write_rows
from netsp.base.compiled.kernel import kernel
from netsp.base.compiled.rng import below, uniform
from netsp.gtsp.search.layers import best_classes
from netsp.gtsp.search.links import (
    Links,
    Tables,
    best_place,
    propagate,
    put,
    tour_length,
    write_order,
)


class StringPolicy(NamedTuple):
    """Removal and insertion, for kernels (`netsp.gtsp.gtsp_policy.LocalSearchPolicy`)."""

    max_string_length: int
    mean_removed: int
    blink_rate: float


@kernel
def ruin_and_recreate(
    order: Ints,
    best: Ints,
    length: float,
    best_length: float,
    count: int,
    theta: float,
    tables: Tables,
    links: Links,
    policy: StringPolicy,
    chance: npt.NDArray[np.uint64],
) -> tuple[float, float]:
    """Make `count` rounds at temperature `theta`, in place.

    ``links`` belong to the present order, both on entry and on return. They are never filled afresh
    between rounds, so that the result does not depend on how rounds are grouped into calls. A round
    that is not accepted is undone by a copy of the links.

    Returns
    -------
    tuple of float
        Lengths of the present order and of the best, which is in `best`.
    """
    start, costs, nearest, near, first, neighbours, rank, before, _, rounding = tables
    n = len(order)
    after, prior = links.after.copy(), links.prior.copy()
    ahead, behind = links.ahead.copy(), links.behind.copy()
    step_ahead, step_behind = links.step_ahead.copy(), links.step_behind.copy()
    out = np.zeros(n, dtype=np.bool_)
    gone, place = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    work = np.empty(n, dtype=np.int64)
    key, row = np.empty(n), np.empty(ahead.shape[1])
    for _ in range(count):
        # strings around clusters near a seed, as in the paper, section 3.1
        longest = min(policy.max_string_length, n - 1)
        strings = int(uniform(chance) * (4.0 * policy.mean_removed / (1.0 + longest))) + 1
        seed = 1 + below(n - 1, chance)
        removed = 0
        for r in range(-1, rank.shape[1]):
            if strings == 0:
                break
            c = seed if r < 0 else rank[seed, r]
            if c == 0 or out[c]:
                continue
            strings -= 1
            size = 1 + below(longest, chance)
            steps_back = below(size, chance)
            while steps_back > 0 and prior[c] != 0:
                c = prior[c]
                steps_back -= 1
            for _ in range(size - steps_back):
                if c == 0:
                    break
                if not out[c]:
                    out[c] = True
                    gone[removed] = c
                    removed += 1
                c = after[c]
        d = length
        for r in range(removed):
            c = gone[r]
            out[c] = False
            p, q = prior[c], after[c]
            after[p], prior[q], after[c] = q, p, -1
            d -= step_ahead[c]
            step_ahead[c] = 0.0
        for r in range(removed):
            p, q = links.prior[gone[r]], links.after[gone[r]]
            if after[q] >= 0:
                d += propagate(q, 0, after, prior, start, costs, ahead, step_ahead, row)
            if after[p] >= 0:
                propagate(p, 0, prior, after, start, costs, behind, step_behind, row)
        # inserted in random order, or farthest from the base first, or nearest first
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
            k = r - 1
            while k >= 0 and key[k] > x:
                gone[k + 1], key[k + 1] = gone[k], key[k]
                k -= 1
            gone[k + 1], key[k + 1] = c, x
        for r in range(removed):
            p, _ = best_place(
                gone[r],
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
                policy.blink_rate,
                chance,
            )
            d += put(
                gone[r], p, after, prior, start, costs, ahead, behind, step_ahead, step_behind, row
            )
        if d < length - theta * math.log(max(uniform(chance), 1e-300)):
            _write(links, Links(after, prior, ahead, behind, step_ahead, step_behind))
            length = tour_length(after, step_ahead)
            if length < best_length * (1.0 - 1e-12) and (
                best_length - length > rounding or _is_shorter(after, best, start, costs, work)
            ):
                best_length = length
                write_order(after, best)
        else:
            _write(Links(after, prior, ahead, behind, step_ahead, step_behind), links)
    write_order(links.after, order)
    return length, best_length


@kernel
def _write(to: Links, links: Links) -> None:
    """Copy `links` into `to`."""
    write_ints(to.after, links.after, len(links.after))
    write_ints(to.prior, links.prior, len(links.prior))
    write_rows(to.ahead, links.ahead, len(links.ahead))
    write_rows(to.behind, links.behind, len(links.behind))
    write_floats(to.step_ahead, links.step_ahead, len(links.step_ahead))
    write_floats(to.step_behind, links.step_behind, len(links.step_behind))


@kernel
def _is_shorter(after: Ints, best: Ints, start: Ints, costs: Floats, work: Ints) -> bool:
    """Measure the tour and the best one afresh, and return whether the tour is shorter.

    The tables of the links carry the rounding of the largest numbers that went through them.
    """
    write_order(after, work)
    measured, _ = best_classes(work[1:], start, costs)
    length, _ = best_classes(best[1:], start, costs)
    return bool(measured < length)

"""Iterated local search: Or-opt and 2-opt on the order of goals, classes chosen exactly.

Every candidate order is priced by the layered shortest path, after a bound from the least legs
between clusters has failed to reject it. Perturbation is the double bridge of Martin, Otto and
Felten (1991).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from netsp.lns.layers import Instance, best_classes, layered_length
from netsp.result import Clock


def local_search(
    instance: Instance,
    rng: np.random.Generator,
    *,
    rounds: int,
    clock: Clock,
    start_tour: npt.ArrayLike | None = None,
) -> tuple[float, npt.NDArray[np.int64]]:
    """Best (length, tour in the instance's vertex order) after `rounds` perturbations or when the
    clock runs out. Deterministic by `rng` as long as the clock does not."""
    goals = len(instance.start) - 2
    largest = int(np.diff(instance.start).max())
    work = np.empty((2, largest))
    args = (instance.start, instance.costs, instance.cluster_costs, work)
    if start_tour is None:
        order = _insertion(instance.cluster_costs)
    else:
        of_vertex = np.repeat(np.arange(goals + 1), np.diff(instance.start))
        order = of_vertex[np.asarray(start_tour, dtype=np.int64)[1:]]
    best = order.copy()
    best_length = _descend(best, *args)
    for _ in range(rounds):
        if clock.up or goals < 5:
            break
        trial = best.copy()
        cuts = np.sort(rng.choice(np.arange(1, goals), size=3, replace=False))
        a, b, c = (int(k) for k in cuts)
        trial = np.concatenate([trial[:a], trial[b:c], trial[a:b], trial[c:]])
        length = _descend(trial, *args)
        if length < best_length - 1e-12 * best_length:
            best, best_length = trial, length
    length, tour = best_classes(best, instance.start, instance.costs)
    return float(length), tour


def _insertion(d: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Order of clusters by farthest insertion on the least legs between clusters."""
    left = list(range(1, len(d)))
    tour = [0]
    while left:
        k = max(left, key=lambda c: min(d[c, t] for t in tour)) if len(tour) > 1 else left[0]
        gains = [
            d[tour[i], k] + d[k, tour[(i + 1) % len(tour)]]
            - (d[tour[i], tour[(i + 1) % len(tour)]] if len(tour) > 1 else 0.0)
            for i in range(len(tour))
        ]  # fmt: skip
        tour.insert(int(np.argmin(gains)) + 1, k)
        left.remove(k)
    return np.array(tour[1:], dtype=np.int64)


@njit(cache=True)
def _cluster_length(order, d):
    total = d[0, order[0]] + d[order[-1], 0]
    for k in range(len(order) - 1):
        total += d[order[k], order[k + 1]]
    return total


@njit(cache=True)
def _descend(order, start, costs, cluster_costs, work):
    """First-improvement descent by segment moves (length up to 3, either way round) and reversals,
    in place; returns the length of the best tour in that order."""
    n = len(order)
    best = layered_length(order, start, costs, work)
    if n < 2:
        return best
    trial = np.empty_like(order)
    improved = True
    while improved:
        improved = False
        for i in range(n):
            for size in range(1, min(3, n - i) + 1):
                for at in range(n - size + 1):
                    if at == i:
                        continue
                    for flip in range(2 if size > 1 else 1):
                        _move(order, trial, i, size, at, flip)
                        if _cluster_length(trial, cluster_costs) >= best:
                            continue
                        length = layered_length(trial, start, costs, work)
                        if length < best * (1.0 - 1e-12):
                            best = length
                            _copy(trial, order)
                            improved = True
            for j in range(i + 2, n + 1):
                _copy(order, trial)
                for k in range(j - i):
                    trial[i + k] = order[j - 1 - k]
                if _cluster_length(trial, cluster_costs) >= best:
                    continue
                length = layered_length(trial, start, costs, work)
                if length < best * (1.0 - 1e-12):
                    best = length
                    _copy(trial, order)
                    improved = True
    return best


@njit(cache=True)
def _move(order, trial, i, size, at, flip):
    """Write to `trial` the order with order[i:i+size] taken out and put back at position `at`."""
    n = len(order)
    k = 0
    rest = 0
    while k < n:
        if k == at:
            for s in range(size):
                trial[k + s] = order[i + size - 1 - s] if flip else order[i + s]
            k += size
            continue
        if rest == i:
            rest += size
        trial[k] = order[rest]
        rest += 1
        k += 1


@njit(cache=True)
def _copy(a, b):
    for k in range(len(a)):
        b[k] = a[k]

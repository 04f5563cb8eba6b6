"""Rounds of the search for a covering tour, as kernels.

A round removes viewpoints from a tour, covers the needed area again, drops viewpoints that are not
needed and shortens the tour (`netsp.plan.cover.covering_tour`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.base.compiled.rng import below, uniform
from netsp.plan.cover.tour_improvement import shorten_in_place


class CoverArrays(NamedTuple):
    """Covering tour problem for kernels.

    Attributes
    ----------
    patch_starts, patches
        Patches that place k sees: ``patches[patch_starts[k]:patch_starts[k + 1]]``.
    place_starts, places
        Places that see patch p, likewise.
    areas
        Areas (m,) of the patches.
    needed
        Area that must be seen.
    distances
        Symmetric lengths (n, n) of legs.
    prices
        Prices (n,) of visits, in the unit of the lengths.
    """

    patch_starts: Ints
    patches: Ints
    place_starts: Ints
    places: Ints
    areas: Floats
    needed: float
    distances: Floats
    prices: Floats


class RoundSettings(NamedTuple):
    """Fields of `netsp.plan.cover.cover_policy.TourSearchPolicy` that rounds use."""

    max_rounds: int
    min_gain: float
    max_removed: int
    run_share: float
    random_share: float
    local_share: float
    min_gain_exponent: float
    max_gain_exponent: float
    noise: float
    removed_bias: float
    min_price: float
    max_segment: int
    min_move_gain: float
    rounding: float
    max_detour: float
    warmth: float


class _Work(NamedTuple):
    """Work arrays of a round.

    Attributes
    ----------
    views
        Number (m,) of visits of the tour that see each patch.
    gains, n_unseen
        Area and number (n,) of the unseen patches that each place sees.
    candidates
        Numbers of the places that see an unseen patch; only the first ones of (n,) are used.
    insertion, after
        Least length (n,) that inserting a candidate adds, and the position after which it does.
    bias
        Random factor (n,) of each candidate.
    legs
        Lengths (n,) of the legs to the visits of the tour; only the first ones are used.
    is_removed, is_tried, is_useful
        Masks (n,) of removed viewpoints, of places at which moves are tried, and of places that
        may be added.
    """

    views: Ints
    gains: Floats
    n_unseen: Ints
    candidates: Ints
    insertion: Floats
    after: Ints
    bias: Floats
    legs: Floats
    is_removed: Bools
    is_tried: Bools
    is_useful: Bools


@kernel
def search_rounds(
    cover: CoverArrays,
    settings: RoundSettings,
    current: Ints,
    best: Ints,
    rounds: tuple[int, int],
    state: npt.NDArray[np.uint64],
) -> tuple[Ints, Ints, int]:
    """Go through some rounds of the search.

    Parameters
    ----------
    current, best : ndarray of int
        Present tour, and the cheapest one so far.
    rounds : (int, int)
        Number of the first round, and of the one after the last.
    state : ndarray of uint64, shape (1,)
        State of the random generator (`netsp.base.compiled.rng`).

    Returns
    -------
    current, best : ndarray of int
        Tours after these rounds.
    idle : int
        Number of rounds since the last gain; that of all rounds if there was none.
    """
    work = _work(cover)
    current_cost, best_cost = tour_cost(cover, current), tour_cost(cover, best)
    idle = 0
    for number in range(rounds[0], rounds[1]):
        idle += 1
        max_cost = current_cost * (1.0 + settings.max_detour / len(current))
        tour = _changed(cover, settings, current, max_cost, work, state)
        if not len(tour):
            continue
        cost = tour_cost(cover, tour)
        share = settings.warmth * (1.0 - number / settings.max_rounds) / len(current)
        if cost - current_cost < -share * current_cost * math.log(1.0 - uniform(state)):
            current, current_cost = tour, cost
        if cost < best_cost * (1.0 - settings.min_gain):
            idle = 0
        if cost < best_cost:
            best, best_cost = tour, cost
    return current, best, idle


@kernel
def insertion_tour(
    cover: CoverArrays, settings: RoundSettings, state: npt.NDArray[np.uint64]
) -> Ints:
    """Return a short tour that sees the needed area, built from the start alone by the insertions
    of a round; an empty one if no tour sees as much.

    Parameters
    ----------
    state : ndarray of uint64, shape (1,)
        State of the random generator (`netsp.base.compiled.rng`).
    """
    work = _work(cover)
    tour = np.zeros(len(cover.prices), dtype=np.int64)
    covered = _cover_again(cover, settings, tour, 1, math.inf, work, state)
    if covered == 0:
        return tour[:0]
    kept = _drop_spare(cover, settings, tour, covered, work)
    out = tour[:kept].copy()
    min_gain = settings.min_move_gain * max(tour_cost(cover, out), 1.0)
    work.is_tried[:] = True
    shorten_in_place(cover.distances, out, work.is_tried, settings.max_segment, min_gain)
    return out


@kernel
def _work(cover: CoverArrays) -> _Work:
    """Return work arrays."""
    n, m = len(cover.prices), len(cover.areas)
    return _Work(
        np.zeros(m, dtype=np.int64),
        np.zeros(n),
        np.zeros(n, dtype=np.int64),
        np.zeros(n, dtype=np.int64),
        np.zeros(n),
        np.zeros(n, dtype=np.int64),
        np.ones(n),
        np.zeros(n),
        np.zeros(n, dtype=np.bool_),
        np.zeros(n, dtype=np.bool_),
        np.zeros(n, dtype=np.bool_),
    )


@kernel
def tour_cost(cover: CoverArrays, tour: Ints) -> float:
    """Return the length of a tour and the prices of its visits."""
    cost = 0.0
    for k in range(len(tour)):
        cost += cover.distances[tour[k - 1], tour[k]] + cover.prices[tour[k]]
    return cost


@kernel
def _changed(
    cover: CoverArrays,
    settings: RoundSettings,
    current: Ints,
    max_cost: float,
    work: _Work,
    state: npt.NDArray[np.uint64],
) -> Ints:
    """Return a tour after one round; an empty one if it got too expensive on the way."""
    n, count = len(cover.prices), len(current)
    work.is_removed[:] = False
    work.is_tried[:] = False
    _remove(cover, settings, current, work, state)
    tour = np.empty(n, dtype=np.int64)
    left = 0
    for k in range(count):
        if work.is_removed[current[k]]:
            work.is_tried[current[k - 1]] = True
            work.is_tried[current[(k + 1) % count]] = True
        else:
            tour[left] = current[k]
            left += 1
    work.views[:] = 0
    for k in range(left):
        _add_views(cover, tour[k], 1, work.views)
    covered = _cover_again(cover, settings, tour, left, max_cost, work, state)
    if covered == 0:
        return tour[:0]
    kept = _drop_spare(cover, settings, tour, covered, work)
    out = tour[:kept].copy()
    cost = tour_cost(cover, out)
    if cost > max_cost:
        return out[:0]
    min_gain = settings.min_move_gain * max(cost, 1.0)
    shorten_in_place(cover.distances, out, work.is_tried, settings.max_segment, min_gain)
    return out


@kernel
def _remove(
    cover: CoverArrays,
    settings: RoundSettings,
    tour: Ints,
    work: _Work,
    state: npt.NDArray[np.uint64],
) -> None:
    """Mark viewpoints as removed: a run of the tour, those nearest to one, or random ones."""
    count = len(tour) - 1
    size = 1 + below(min(settings.max_removed, count), state)
    kind, middle = uniform(state), 1 + below(count, state)
    if kind < settings.run_share:
        first = max(1, min(middle, count - size + 1))
        for k in range(first, first + size):
            work.is_removed[tour[k]] = True
    elif kind < 1.0 - settings.random_share:
        for _ in range(size):
            nearest, at = math.inf, middle
            for k in range(1, count + 1):
                far = cover.distances[tour[middle], tour[k]]
                if far < nearest and not work.is_removed[tour[k]]:
                    nearest, at = far, k
            work.is_removed[tour[at]] = True
    else:
        for _ in range(size):
            work.is_removed[tour[1 + below(count, state)]] = True


@kernel
def _add_views(cover: CoverArrays, place: int, change: int, views: Ints) -> None:
    """Add a number to the views of all patches that a place sees."""
    for j in range(cover.patch_starts[place], cover.patch_starts[place + 1]):
        views[cover.patches[j]] += change


@kernel
def _cover_again(
    cover: CoverArrays,
    settings: RoundSettings,
    tour: Ints,
    count: int,
    max_cost: float,
    work: _Work,
    state: npt.NDArray[np.uint64],
) -> int:
    """Insert viewpoints into a tour until the needed area is seen.

    Returns
    -------
    int
        Length of the tour, which is in the array; 0 if it got too expensive.
    """
    missing = cover.needed
    for patch in range(len(cover.areas)):
        if work.views[patch] > 0:
            missing -= cover.areas[patch]
    max_missing = settings.rounding * cover.needed
    if missing <= max_missing:
        return count
    is_local = bool(work.is_removed.any()) and uniform(state) < settings.local_share
    n_candidates = _find_candidates(cover, is_local, work)
    cost = 0.0
    for k in range(count):
        work.legs[k] = cover.distances[tour[k - 1] if k else tour[count - 1], tour[k]]
        cost += work.legs[k] + cover.prices[tour[k]]
    favours_others = uniform(state) < 0.5
    spread = settings.max_gain_exponent - settings.min_gain_exponent
    exponent = settings.min_gain_exponent + spread * uniform(state)
    for c in range(n_candidates):
        place = work.candidates[c]
        work.bias[c] = math.exp(settings.noise * (2.0 * uniform(state) - 1.0))
        if favours_others and work.is_removed[place]:
            work.bias[c] *= settings.removed_bias
    _find_insertions(cover, tour, count, n_candidates, work)
    while missing > max_missing:
        chosen, max_value = -1, 0.0
        for c in range(n_candidates):
            place = work.candidates[c]
            if work.n_unseen[place] > 0:
                price = work.insertion[c] + cover.prices[place] + settings.min_price
                useful = min(work.gains[place], missing)
                if useful > 0.0:
                    value = work.bias[c] * useful**exponent / price
                    if value > max_value:
                        chosen, max_value = c, value
        if chosen < 0 or cost > max_cost:
            return 0
        new, at = work.candidates[chosen], work.after[chosen]
        cost += work.insertion[chosen] + cover.prices[new]
        missing -= _see(cover, new, work)
        for k in range(count, at + 1, -1):
            tour[k], work.legs[k] = tour[k - 1], work.legs[k - 1]
        tour[at + 1] = new
        count += 1
        work.legs[at + 1] = cover.distances[tour[at], new]
        end = at + 2 if at + 2 < count else 0
        work.legs[end] = cover.distances[new, tour[end]]
        work.is_tried[new] = True
        for c in range(n_candidates):
            if work.n_unseen[work.candidates[c]] > 0:
                _update_insertion(cover, tour, count, at, c, work)
    return count


@kernel
def _find_candidates(cover: CoverArrays, is_local: bool, work: _Work) -> int:
    """Find the places that see an unseen patch, and what they see of these; return their number.

    Parameters
    ----------
    is_local : bool
        Whether only the places that see a patch which a removed viewpoint saw count.
    """
    work.gains[:] = 0.0
    work.n_unseen[:] = 0
    for patch in range(len(cover.areas)):
        if work.views[patch] == 0:
            for j in range(cover.place_starts[patch], cover.place_starts[patch + 1]):
                work.gains[cover.places[j]] += cover.areas[patch]
                work.n_unseen[cover.places[j]] += 1
    if is_local:
        _find_local(cover, work)
    count = 0
    for place in range(len(cover.prices)):
        if work.n_unseen[place] > 0 and (work.is_useful[place] or not is_local):
            work.candidates[count] = place
            count += 1
    return count


@kernel
def _find_local(cover: CoverArrays, work: _Work) -> None:
    """Mark the places that see a patch which only removed viewpoints saw."""
    work.is_useful[:] = False
    for place in range(len(cover.prices)):
        if work.is_removed[place]:
            for i in range(cover.patch_starts[place], cover.patch_starts[place + 1]):
                patch = cover.patches[i]
                if work.views[patch] == 0:
                    for j in range(cover.place_starts[patch], cover.place_starts[patch + 1]):
                        work.is_useful[cover.places[j]] = True


@kernel
def _see(cover: CoverArrays, new: int, work: _Work) -> float:
    """Count the views of a place that is added; return the area that it adds."""
    area = 0.0
    for i in range(cover.patch_starts[new], cover.patch_starts[new + 1]):
        patch = cover.patches[i]
        if work.views[patch] == 0:
            area += cover.areas[patch]
            for j in range(cover.place_starts[patch], cover.place_starts[patch + 1]):
                work.gains[cover.places[j]] -= cover.areas[patch]
                work.n_unseen[cover.places[j]] -= 1
        work.views[patch] += 1
    return area


@kernel
def _find_insertions(
    cover: CoverArrays, tour: Ints, count: int, n_candidates: int, work: _Work
) -> None:
    """Find for each candidate the position in a tour at which inserting it adds least."""
    work.insertion[:n_candidates] = math.inf
    # rows of visits, one after another, because rows of all candidates do not fit into the cache
    before = cover.distances[tour[count - 1]]
    for k in range(count):
        to_visit, after = cover.distances[tour[k]], k - 1 if k else count - 1
        leg = work.legs[k]
        for c in range(n_candidates):
            place = work.candidates[c]
            added = before[place] + to_visit[place] - leg
            if added < work.insertion[c]:
                work.insertion[c], work.after[c] = added, after
        before = to_visit


@kernel
def _find_insertion(cover: CoverArrays, tour: Ints, count: int, c: int, work: _Work) -> None:
    """Find the position in a tour at which inserting a candidate adds least."""
    distances = cover.distances[work.candidates[c]]
    min_added, at = math.inf, count - 1
    before = distances[tour[count - 1]]
    for k in range(count):
        to_visit = distances[tour[k]]
        added = before + to_visit - work.legs[k]
        if added < min_added:
            min_added, at = added, k - 1
        before = to_visit
    work.insertion[c], work.after[c] = min_added, at if at >= 0 else count - 1


@kernel
def _update_insertion(
    cover: CoverArrays, tour: Ints, count: int, at: int, c: int, work: _Work
) -> None:
    """Update the best position of a candidate after an insertion behind position `at`."""
    if work.after[c] == at:
        _find_insertion(cover, tour, count, c, work)
        return
    if work.after[c] > at:
        work.after[c] += 1
    place = work.candidates[c]
    for k in range(at, at + 2):
        end = k + 1 if k + 1 < count else 0
        added = cover.distances[tour[k], place] + cover.distances[tour[end], place]
        added -= work.legs[end]
        if added < work.insertion[c]:
            work.insertion[c], work.after[c] = added, k


@kernel
def _drop_spare(
    cover: CoverArrays, settings: RoundSettings, tour: Ints, count: int, work: _Work
) -> int:
    """Drop viewpoints that are not needed, the one that saves most first; return the length of the
    tour."""
    spare = settings.rounding * cover.needed - cover.needed
    for patch in range(len(cover.areas)):
        if work.views[patch] > 0:
            spare += cover.areas[patch]
    while count > 1:
        dropped, max_saved, lost = -1, 0.0, 0.0
        for k in range(1, count):
            a, place, b = tour[k - 1], tour[k], tour[k + 1] if k + 1 < count else tour[0]
            distances = cover.distances
            saved = distances[a, place] + distances[place, b] - distances[a, b]
            saved += cover.prices[place]
            if saved < max_saved or (saved == max_saved and dropped >= 0):
                continue
            sole = 0.0
            for j in range(cover.patch_starts[place], cover.patch_starts[place + 1]):
                if work.views[cover.patches[j]] == 1:
                    sole += cover.areas[cover.patches[j]]
                    if sole > spare:
                        break
            if sole <= spare:
                dropped, max_saved, lost = k, saved, sole
        if dropped < 0:
            return count
        spare -= lost
        _add_views(cover, tour[dropped], -1, work.views)
        work.is_tried[tour[dropped - 1]] = True
        for k in range(dropped, count - 1):
            tour[k] = tour[k + 1]
        count -= 1
        work.is_tried[tour[dropped] if dropped < count else tour[0]] = True
    return count

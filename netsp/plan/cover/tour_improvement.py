"""Shorten closed tours by 2-opt and Or-opt moves, for symmetric distances.

A 2-opt move reverses a stretch of the tour (Croes 1958); an Or-opt move puts a segment of a few
visits elsewhere, in either direction (Or 1976). The best move at each place is made, until none
shortens the tour.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.kernel import kernel
from netsp.plan.cover.cover_policy import TourSearchPolicy


def tour_length(distances: Floats, tour: Ints) -> float:
    """Return the length of a closed tour.

    Parameters
    ----------
    distances : ndarray, shape (n, n)
        Symmetric distances.
    tour : ndarray of int, shape (k,)
        Places in their order.
    """
    return float(distances[tour, np.roll(tour, -1)].sum())


def nearest_neighbour_tour(distances: Floats, places: Ints) -> Ints:
    """Return a closed tour from place 0 that always goes on to the nearest place left."""
    tour, left = [0], np.unique(places)
    while len(left):
        k = int(distances[tour[-1], left].argmin())
        tour.append(int(left[k]))
        left = np.delete(left, k)
    return np.array(tour, dtype=np.int64)


def shorten(
    distances: Floats,
    tour: Ints,
    policy: TourSearchPolicy | None = None,
    around: Ints | None = None,
) -> Ints:
    """Return a tour that 2-opt and Or-opt moves do not shorten; its first place stays the first.

    Parameters
    ----------
    distances : ndarray, shape (n, n)
        Symmetric distances.
    tour : ndarray of int, shape (k,)
        Places in their order.
    policy : TourSearchPolicy, optional
        Longest segment that is moved, and smallest gain.
    around : ndarray of int, optional
        Places where the tour was changed: moves are tried at these and at the ends of moves that
        were made. By default moves are tried everywhere, so that none is left that shortens the
        tour.
    """
    policy, tour = policy or TourSearchPolicy(), np.array(tour, dtype=np.int64)
    min_gain = policy.min_move_gain * max(tour_length(distances, tour), 1.0)
    is_tried = np.full(len(distances), around is None)
    if around is not None:
        is_tried[around] = True
    while shorten_in_place(distances, tour, is_tried, policy.max_segment, min_gain):
        # moves that end at a place which has not been tried since may be left
        is_tried[:] = around is None
    return tour


@kernel
def shorten_in_place(
    distances: Floats, tour: Ints, is_tried: Bools, max_segment: int, min_gain: float
) -> int:
    """Make moves at the places that are tried, and at the ends of these moves; return their
    number.

    Parameters
    ----------
    distances : ndarray, shape (n, n)
        Symmetric distances.
    tour : ndarray of int, shape (k,)
        Places in their order; changed in place. The first stays the first.
    is_tried : ndarray of bool, shape (n,)
        Whether moves are tried at each place; false everywhere afterwards.
    max_segment : int
        Maximum number of visits that an Or-opt move puts elsewhere.
    min_gain : float
        Gain above which a move is made.
    """
    count, n_moves, is_changed = len(tour), 0, len(tour) > 3
    moved = np.empty(count, dtype=np.int64)
    while is_changed:
        is_changed = False
        for i in range(count):
            while is_tried[tour[i]]:
                gain, a, b = _best_reversal(distances, tour, i)
                moved_gain, begin, size, place, is_reversed = _best_segment_move(
                    distances, tour, i, max_segment
                )
                if max(gain, moved_gain) <= min_gain:
                    is_tried[tour[i]] = False
                    break
                if gain >= moved_gain:
                    for end in (a, b):
                        is_tried[tour[end]] = True
                        is_tried[tour[(end + 1) % count]] = True
                    tour[a + 1 : b + 1] = tour[a + 1 : b + 1][::-1].copy()
                else:
                    for end in (begin - 1, begin, begin + size - 1, begin + size, place, place + 1):
                        is_tried[tour[end % count]] = True
                    _move(tour, moved, begin, size, place, is_reversed)
                n_moves += 1
                is_changed = True
    return n_moves


@kernel
def _best_reversal(distances: Floats, tour: Ints, i: int) -> tuple[float, int, int]:
    """Return the saving of the best 2-opt move of the two legs at a position, and the positions
    a < b after which its legs begin."""
    count = len(tour)
    best, low, high = 0.0, 0, 0
    for a in (i, i - 1 if i else count - 1):
        p, q = tour[a], tour[a + 1] if a + 1 < count else tour[0]
        leg = distances[p, q]
        for b in range(count):
            r, s = tour[b], tour[b + 1] if b + 1 < count else tour[0]
            gain = leg + distances[r, s] - distances[p, r] - distances[q, s]
            if b != a and gain > best:
                best, low, high = gain, min(a, b), max(a, b)
    return best, low, high


@kernel
def _best_segment_move(
    distances: Floats, tour: Ints, i: int, max_segment: int
) -> tuple[float, int, int, int, bool]:
    """Return the saving of the best Or-opt move of a segment that begins or ends at a position,
    with the segment's first position and size, the position after which it is put, and whether it
    is reversed."""
    count = len(tour)
    best, best_begin, best_size, best_place, best_reversed = 0.0, 0, 0, 0, False
    for size in range(1, min(max_segment, count - 3) + 1):
        for end in range(min(size, 2)):
            begin = i - end * (size - 1)
            if begin < 1 or begin + size > count:
                continue
            a, first, last = tour[begin - 1], tour[begin], tour[begin + size - 1]
            b = tour[begin + size] if begin + size < count else tour[0]
            saved = distances[a, first] + distances[last, b] - distances[a, b]
            for place in range(count):
                if begin - 1 <= place < begin + size:
                    continue
                c, d = tour[place], tour[place + 1] if place + 1 < count else tour[0]
                left = saved + distances[c, d]
                gain = left - distances[first, c] - distances[last, d]
                if gain > best:
                    best, best_begin, best_size = gain, begin, size
                    best_place, best_reversed = place, False
                gain = left - distances[last, c] - distances[first, d]
                if gain > best:
                    best, best_begin, best_size = gain, begin, size
                    best_place, best_reversed = place, True
    return best, best_begin, best_size, best_place, best_reversed


@kernel
def _move(tour: Ints, moved: Ints, begin: int, size: int, place: int, is_reversed: bool) -> None:
    """Put a segment of a tour after another position; `moved` is a work array."""
    k = 0
    for j in range(len(tour)):
        if j < begin or j >= begin + size:
            moved[k] = tour[j]
            k += 1
        if j == place:
            for offset in range(size):
                moved[k] = tour[begin + (size - 1 - offset if is_reversed else offset)]
                k += 1
    tour[:] = moved

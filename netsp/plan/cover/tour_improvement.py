"""Shorten closed tours by 2-opt and Or-opt moves, for symmetric distances.

A 2-opt move reverses a stretch of the tour (Croes 1958); an Or-opt move puts a segment of a few
visits elsewhere, in either direction (Or 1976). All moves are priced at once, and the best is
made, until none shortens the tour.
"""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats, Ints
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
    if len(tour) < 4:
        return tour
    policy = policy or TourSearchPolicy()
    min_gain = policy.min_move_gain * max(tour_length(distances, tour), 1.0)
    is_tried = np.full(len(distances), around is None)
    if around is not None:
        is_tried[around] = True
    while True:
        rows = np.flatnonzero(is_tried[tour])
        gain, shortened, ends = _best_reversal(distances, tour, rows)
        moved_gain, moved, moved_ends = _best_segment_move(
            distances, tour, rows, policy.max_segment
        )
        if max(gain, moved_gain) <= min_gain:
            return tour
        tour, ends = (shortened, ends) if gain >= moved_gain else (moved, moved_ends)
        is_tried[ends] = True


def _best_reversal(distances: Floats, tour: Ints, rows: Ints) -> tuple[float, Ints, Ints]:
    """Return the saving of the best 2-opt move, the tour with it, and the ends of its legs.

    Of the two legs that a move replaces, one begins or ends at one of the given positions.
    """
    count, after = len(tour), np.roll(tour, -1)
    legs = distances[tour, after]
    rows = np.union1d(rows, (rows - 1) % count)
    if not len(rows):
        return -np.inf, tour, tour[:0]
    changes = distances[np.ix_(tour[rows], tour)] + distances[np.ix_(after[rows], after)]
    changes -= legs[rows, None]
    changes -= legs[None]
    changes[np.arange(len(rows)), rows] = np.inf
    row, column = divmod(int(changes.argmin()), count)
    i, j = sorted((int(rows[row]), column))
    reversed_tour = tour.copy()
    reversed_tour[i + 1 : j + 1] = tour[i + 1 : j + 1][::-1]
    ends = np.array([tour[i], after[i], tour[j], after[j]])
    return -float(changes[row, column]), reversed_tour, ends


def _best_segment_move(
    distances: Floats, tour: Ints, rows: Ints, max_segment: int
) -> tuple[float, Ints, Ints]:
    """Return the saving of the best Or-opt move, the tour with it, and the ends of its legs.

    The segment begins at one of the given positions, or ends there.
    """
    count, after = len(tour), np.roll(tour, -1)
    legs, at = distances[tour, after], np.arange(len(tour))[None]
    best_gain, best, ends = -np.inf, tour, tour[:0]
    for size in range(1, min(max_segment, count - 3) + 1):
        begin = np.union1d(rows, rows - size + 1)
        begin = begin[(begin >= 1) & (begin <= count - size)]
        if not len(begin):
            continue
        before, first, last = tour[begin - 1], tour[begin], tour[begin + size - 1]
        next_ = tour[(begin + size) % count]
        saved = distances[before, first] + distances[last, next_] - distances[before, next_]
        is_inside = (at >= begin[:, None] - 1) & (at < begin[:, None] + size)
        for is_reversed in (False, True)[: 1 if size == 1 else 2]:
            head, tail = (last, first) if is_reversed else (first, last)
            gains = saved[:, None] + legs[None]
            gains -= distances[np.ix_(head, tour)]
            gains -= distances[np.ix_(tail, after)]
            gains[is_inside] = -np.inf
            k, place = divmod(int(gains.argmax()), count)
            if gains[k, place] > best_gain:
                best_gain = float(gains[k, place])
                best = _moved(tour, int(begin[k]), size, place, is_reversed)
                ends = np.array([before[k], first[k], last[k], next_[k], tour[place], after[place]])
    return best_gain, best, ends


def _moved(tour: Ints, begin: int, size: int, place: int, is_reversed: bool) -> Ints:
    """Return a tour with a segment moved to after another position."""
    segment = tour[begin : begin + size]
    rest = np.delete(tour, np.arange(begin, begin + size))
    at = place + 1 if place < begin else place + 1 - size
    return np.insert(rest, at, segment[::-1] if is_reversed else segment)

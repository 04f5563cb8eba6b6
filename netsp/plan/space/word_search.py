"""Search for the shortest paths of several classes at once, over cells and words.

Every cell keeps the few words with the shortest paths. A path that continues a word for which a
cell has no slot left would be no better at any later cell, so the kept words are exactly those with
the shortest paths on the grid. Compare the h-augmented graphs of Bhattacharya, Likhachev & Kumar
(2012): words take the place of h-signatures, and the k best labels the place of all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Ints
from netsp.base.compiled.dynamic_array import more_int_rows
from netsp.base.compiled.kernel import kernel
from netsp.hsignature.wordtable import Rules, Table, times, times_inverse
from netsp.plan.space.cells import FREE_CELL
from netsp.plan.space.triangle_labels import (
    BUCKETS,
    LENGTHS,
    STEPS,
    UNKNOWN,
    Flags,
    Labels,
    lower_end,
    nth_axis,
    staircase_order,
    step_axes,
)
from netsp.world.paths.tree import ONWARD

NO_WORD = -1
"""Sentinel word of an empty slot."""


class WordSearch(NamedTuple):
    """Result of a search, slot by slot of the cells of its box.

    Attributes
    ----------
    first
        (3,) cell of the box with the lowest indices.
    word
        (nx, ny, nz, k) number of the word, `NO_WORD` in empty slots.
    far
        (nx, ny, nz, k) length of the path, hundredths of a cell.
    step
        (nx, ny, nz, k) last step of the path, 26 where the search began.
    slot
        (nx, ny, nz, k) slot of the cell before.
    """

    first: Ints
    word: npt.NDArray[np.int32]
    far: npt.NDArray[np.int32]
    step: npt.NDArray[np.int8]
    slot: npt.NDArray[np.int8]


@kernel
def shortest_words(
    flags: Flags,
    passable: Bools,
    open_cells: Bools,
    labels: Labels,
    table: Table,
    rules: Rules,
    root: Ints,
    first: Ints,
    last: Ints,
    max_words: int,
    targets: Ints,
    limits: Ints,
    stop: Ints,
) -> tuple[WordSearch, Table]:
    """Return the words with the shortest paths to the cells of a box that lead to some targets.

    All neighbours of an open cell are free and of one class, so only the steps that lead further on
    are taken from it (`netsp.world.paths.tree`): the other neighbours are reached as soon around
    it.

    Parameters
    ----------
    flags, labels
        Flags and labels of the whole complex.
    passable
        (nx, ny, nz) mask of the cells that paths may pass.
    open_cells
        (nx, ny, nz) mask of the cells whose 26 neighbours are free, passable and of one class.
    root
        (3,) cell where paths begin.
    first, last
        (3,) corners of the box, inclusive.
    max_words
        Maximum number of words of a cell.
    targets
        (t, 3) target cells; if there are none, all cells are targets.
    limits
        (t,) length of the longest paths to each target, hundredths of a cell; (1,) without targets.
    stop
        Flag of a clock. Once it is set, cells that have a word get no others; each cell that can be
        reached still gets its first one.
    """
    _, ny, nz = flags.shape
    sx, sy, sz = last[0] - first[0] + 1, last[1] - first[1] + 1, last[2] - first[2] + 1
    word = np.full((sx, sy, sz, max_words), NO_WORD, dtype=np.int32)
    far = np.full((sx, sy, sz, max_words), np.iinfo(np.int32).max, dtype=np.int32)
    step = np.full((sx, sy, sz, max_words), -1, dtype=np.int8)
    slot = np.zeros((sx, sy, sz, max_words), dtype=np.int8)
    done = np.zeros((sx, sy, sz, max_words), dtype=np.bool_)
    # (slot of the box, length, next entry of its bucket)
    waiting, entries, spare = np.empty((4096, 3), dtype=np.int64), 1, -1
    bucket = np.full(BUCKETS, -1)
    i, j, k = root[0] - first[0], root[1] - first[1], root[2] - first[2]
    word[i, j, k, 0], far[i, j, k, 0], step[i, j, k, 0] = 0, 0, 26
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = ((i * sy + j) * sz + k) * max_words, 0, -1
    bucket[0], empty, now = 0, 0, 0
    longest = limits.max()
    while empty < BUCKETS and now <= longest:
        entry = bucket[now % BUCKETS]
        if entry < 0:
            empty += 1
            now += 1
            continue
        empty = 0
        bucket[now % BUCKETS] = waiting[entry, 2]
        at = waiting[entry, 0]
        waiting[entry, 2] = spare
        spare = entry
        n, cell = at % max_words, at // max_words
        i, j, k = cell // (sy * sz), cell // sz % sy, cell % sz
        if done[i, j, k, n] or far[i, j, k, n] != now:
            continue
        if stop[0] != 0 and done[i, j, k].any():
            continue
        done[i, j, k, n] = True
        current_word = word[i, j, k, n]
        x, y, z = i + first[0], j + first[1], k + first[2]
        is_useful = len(targets) == 0
        for t in range(len(targets)):
            square = (targets[t, 0] - x) ** 2 + (targets[t, 1] - y) ** 2 + (targets[t, 2] - z) ** 2
            left = limits[t] - now
            if left >= 0 and 10_000 * square <= left * left:
                is_useful = True
                break
        if not is_useful:
            continue
        is_open = open_cells[x, y, z]
        arrival_step = step[i, j, k, n]
        inside = 0 < i < sx - 1 and 0 < j < sy - 1 and 0 < k < sz - 1
        can_prune = is_open and inside and arrival_step != 26
        for nth in range(ONWARD[arrival_step, 0] if can_prune else 26):
            s = ONWARD[arrival_step, nth + 1] if can_prune else nth
            new_distance = now + LENGTHS[s]
            if new_distance > longest:
                continue
            p, q, r = i + STEPS[s, 0], j + STEPS[s, 1], k + STEPS[s, 2]
            if p < 0 or q < 0 or r < 0 or p >= sx or q >= sy or r >= sz:
                continue
            u, v, w = p + first[0], q + first[1], r + first[2]
            if not flags[u, v, w] & FREE_CELL or not passable[u, v, w]:
                continue
            if far[p, q, r, max_words - 1] <= new_distance and done[p, q, r, max_words - 1]:
                continue
            order = 0 if is_open else staircase_order(flags, x, y, z, s)
            if order < 0:
                continue
            new, table = word_after_step(
                labels, table, rules, current_word, x, y, z, ny, nz, s, order
            )
            if new < 0:
                continue
            # the slot of this word, else an empty one, else the farthest that is not done
            to, worst = -1, new_distance
            for m in range(max_words):
                if word[p, q, r, m] == new:
                    to = m if far[p, q, r, m] > new_distance else -2
                    break
                if far[p, q, r, m] > worst:
                    worst, to = far[p, q, r, m], m
            if to < 0 or done[p, q, r, to]:
                continue
            word[p, q, r, to], far[p, q, r, to] = new, new_distance
            step[p, q, r, to], slot[p, q, r, to] = s, n
            if spare >= 0:
                e = spare
                spare = waiting[e, 2]
            else:
                if entries == len(waiting):
                    waiting = more_int_rows(waiting)
                e = entries
                entries += 1
            waiting[e, 0] = ((p * sy + q) * sz + r) * max_words + to
            waiting[e, 1], waiting[e, 2] = new_distance, bucket[new_distance % BUCKETS]
            bucket[new_distance % BUCKETS] = e
    for a in range(sx):
        for b in range(sy):
            for c in range(sz):
                for m in range(max_words):
                    if not done[a, b, c, m]:
                        word[a, b, c, m] = NO_WORD
    return WordSearch(first, word, far, step, slot), table


@kernel
def word_after_step(
    labels: Labels,
    table: Table,
    rules: Rules,
    word: int,
    i: int,
    j: int,
    k: int,
    ny: int,
    nz: int,
    step: int,
    order: int,
) -> tuple[int, Table]:
    """Return the word after one step along edges in an order of `staircase_order`; -1 if the word
    of an edge is not known."""
    n, a, b, c = step_axes(step)
    cell = (i * ny + j) * nz + k
    for m in range(n):
        axis = nth_axis(n, a, b, c, order, m)
        sign = STEPS[step, axis]
        label = labels[3 * lower_end(cell, axis, sign, ny, nz) + axis]
        if label == UNKNOWN:
            return -1, table
        if label != 0:
            if sign > 0:
                word, table = times(table, rules, word, label)
            else:
                word, table = times_inverse(table, rules, word, label)
        cell += sign * (ny * nz if axis == 0 else nz if axis == 1 else 1)
    return word, table


@kernel
def path_to_slot(found: WordSearch, cell: Ints, slot: int) -> Ints:
    """Return the cells (m, 3) of the path from the beginning of a search to one of its slots."""
    out, count = np.empty((64, 3), dtype=np.int64), 0
    i, j, k = cell[0] - found.first[0], cell[1] - found.first[1], cell[2] - found.first[2]
    n = slot
    while True:
        if count == len(out):
            out = more_int_rows(out)
        out[count, 0] = i + found.first[0]
        out[count, 1] = j + found.first[1]
        out[count, 2] = k + found.first[2]
        count += 1
        s = found.step[i, j, k, n]
        if s == 26:
            return out[:count][::-1].copy()
        n = found.slot[i, j, k, n]
        i, j, k = i - STEPS[s, 0], j - STEPS[s, 1], k - STEPS[s, 2]

"""The shortest paths of several classes at once: a search over cells and words.

Every cell keeps the few words that reach it soonest. Paths that go on from a word that a cell has
no room for would be no better at any later cell: the few kept are exactly the shortest on the grid
(as in the h-augmented graphs of Bhattacharya, Likhachev & Kumar 2012, with words in place of
h-signatures, and the k best labels in place of all).
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
    """What a search has found, slot by slot of the cells of its box.

    Attributes
    ----------
    first
        (3,) the cell of the box with the lowest numbers.
    word
        (nx, ny, nz, k) number of the word, NO_WORD where there is none.
    far
        (nx, ny, nz, k) hundredths of a cell.
    step
        (nx, ny, nz, k) the step that leads there, 26 where the search began.
    slot
        (nx, ny, nz, k) the slot of the cell before.
    """

    first: Ints
    word: npt.NDArray[np.int32]
    far: npt.NDArray[np.int32]
    step: npt.NDArray[np.int8]
    slot: npt.NDArray[np.int8]


@kernel
def shortest_words(
    flags: Flags,
    room: Bools,
    open_: Bools,
    labels: Labels,
    table: Table,
    rules: Rules,
    root: Ints,
    first: Ints,
    last: Ints,
    most: int,
    targets: Ints,
    limits: Ints,
    stop: Ints,
) -> tuple[WordSearch, Table]:
    """Return the `most` soonest words of the cells of a box that are on the way to some targets.

    About an open cell everything is free and of one class, so only those steps are taken that lead
    further on (`netsp.world.paths.tree`): the other cells beside it are reached as soon around it.

    Parameters
    ----------
    flags, labels
        Of the whole complex.
    room
        (nx, ny, nz) cells that may be passed.
    open_
        (nx, ny, nz) cells about which all 26 are free, may be passed, and are of one class.
    root
        (3,) the cell to begin at.
    first, last
        (3,) corners of the box, both within it.
    most
        Words of a cell.
    targets
        (t, 3) cells; with none, all cells are sought.
    limits
        (t,) or, with no targets, (1,): hundredths of a cell; paths to each are no longer.
    stop
        Flag of a clock. From when it is set on, cells that have a word get no others: each cell
        that can be reached has its soonest one all the same.
    """
    _, ny, nz = flags.shape
    sx, sy, sz = last[0] - first[0] + 1, last[1] - first[1] + 1, last[2] - first[2] + 1
    word = np.full((sx, sy, sz, most), NO_WORD, dtype=np.int32)
    far = np.full((sx, sy, sz, most), np.iinfo(np.int32).max, dtype=np.int32)
    step = np.full((sx, sy, sz, most), -1, dtype=np.int8)
    slot = np.zeros((sx, sy, sz, most), dtype=np.int8)
    done = np.zeros((sx, sy, sz, most), dtype=np.bool_)
    # (slot of the box, length, next entry of its bucket)
    waiting, entries, spare = np.empty((4096, 3), dtype=np.int64), 1, -1
    bucket = np.full(BUCKETS, -1)
    i, j, k = root[0] - first[0], root[1] - first[1], root[2] - first[2]
    word[i, j, k, 0], far[i, j, k, 0], step[i, j, k, 0] = 0, 0, 26
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = ((i * sy + j) * sz + k) * most, 0, -1
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
        n, cell = at % most, at // most
        i, j, k = cell // (sy * sz), cell // sz % sy, cell % sz
        if done[i, j, k, n] or far[i, j, k, n] != now:
            continue
        if stop[0] != 0 and done[i, j, k].any():
            continue
        done[i, j, k, n] = True
        here = word[i, j, k, n]
        x, y, z = i + first[0], j + first[1], k + first[2]
        on_the_way = len(targets) == 0
        for t in range(len(targets)):
            far2 = (targets[t, 0] - x) ** 2 + (targets[t, 1] - y) ** 2 + (targets[t, 2] - z) ** 2
            left = limits[t] - now
            if left >= 0 and 10_000 * far2 <= left * left:
                on_the_way = True
                break
        if not on_the_way:
            continue
        open_here = open_[x, y, z]
        came = step[i, j, k, n]
        inside = 0 < i < sx - 1 and 0 < j < sy - 1 and 0 < k < sz - 1
        few = open_here and inside and came != 26
        for nth in range(ONWARD[came, 0] if few else 26):
            s = ONWARD[came, nth + 1] if few else nth
            there = now + LENGTHS[s]
            if there > longest:
                continue
            p, q, r = i + STEPS[s, 0], j + STEPS[s, 1], k + STEPS[s, 2]
            if p < 0 or q < 0 or r < 0 or p >= sx or q >= sy or r >= sz:
                continue
            u, v, w = p + first[0], q + first[1], r + first[2]
            if not flags[u, v, w] & FREE_CELL or not room[u, v, w]:
                continue
            if far[p, q, r, most - 1] <= there and done[p, q, r, most - 1]:
                continue
            order = 0 if open_here else staircase_order(flags, x, y, z, s)
            if order < 0:
                continue
            new, table = word_after_step(labels, table, rules, here, x, y, z, ny, nz, s, order)
            if new < 0:
                continue
            # the slot of this word, else an empty one, else the farthest that is not done
            to, worst = -1, there
            for m in range(most):
                if word[p, q, r, m] == new:
                    to = m if far[p, q, r, m] > there else -2
                    break
                if far[p, q, r, m] > worst:
                    worst, to = far[p, q, r, m], m
            if to < 0 or done[p, q, r, to]:
                continue
            word[p, q, r, to], far[p, q, r, to] = new, there
            step[p, q, r, to], slot[p, q, r, to] = s, n
            if spare >= 0:
                e = spare
                spare = waiting[e, 2]
            else:
                if entries == len(waiting):
                    waiting = more_int_rows(waiting)
                e = entries
                entries += 1
            waiting[e, 0] = ((p * sy + q) * sz + r) * most + to
            waiting[e, 1], waiting[e, 2] = there, bucket[there % BUCKETS]
            bucket[there % BUCKETS] = e
    for a in range(sx):
        for b in range(sy):
            for c in range(sz):
                for m in range(most):
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
    """Return the word after one step along edges in an order of
    `staircase_order`; -1 if the     word of an edge is not known."""
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
    """Cells (m, 3) from where a search began to one of its slots."""
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

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
from netsp.base.time_flags import Flag
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


class SearchSpace(NamedTuple):
    """Cells that a search may pass, and the labels of their edges.

    Attributes
    ----------
    flags, labels
        Flags and labels of the whole complex.
    passable
        (nx, ny, nz) mask of the cells that paths may pass.
    open_cells
        (nx, ny, nz) mask of the cells whose 26 neighbours are free, passable and of one class.
    """

    flags: Flags
    labels: Labels
    passable: Bools
    open_cells: Bools


class SearchBox(NamedTuple):
    """Box of cells of a search.

    Attributes
    ----------
    root
        (3,) cell where paths begin.
    first, last
        (3,) corners of the box, inclusive.
    """

    root: Ints
    first: Ints
    last: Ints


class Targets(NamedTuple):
    """Targets of a search.

    Attributes
    ----------
    cells
        (t, 3) target cells; if there are none, all cells are targets.
    limits
        (t,) length of the longest paths to each target, hundredths of a cell; (1,) without targets.
    """

    cells: Ints
    limits: Ints


@kernel
def shortest_words(
    space: SearchSpace,
    table: Table,
    rules: Rules,
    box: SearchBox,
    targets: Targets,
    max_words: int,
    stop: Flag,
) -> tuple[WordSearch, Table]:
    """Return the words with the shortest paths to the cells of a box that lead to some targets.

    All neighbours of an open cell are free and of one class, so only the steps that lead further on
    are taken from it (`netsp.world.paths.tree`): the other neighbours are reached as soon around
    it. A target with as many words as it may have is no target any more.

    Parameters
    ----------
    max_words
        Maximum number of words of a cell.
    stop
        Flag of a clock. Once it is set, cells that have a word get no others; each cell that can be
        reached still gets its first one.
    """
    flags, first, last = space.flags, box.first, box.last
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
    i, j, k = box.root[0] - first[0], box.root[1] - first[1], box.root[2] - first[2]
    word[i, j, k, 0], far[i, j, k, 0], step[i, j, k, 0] = 0, 0, 26
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = ((i * sy + j) * sz + k) * max_words, 0, -1
    bucket[0], empty, now = 0, 0, 0
    limits = targets.limits.copy()
    targets = Targets(targets.cells, limits)
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
        if done[i, j, k].all():
            for t in range(len(targets.cells)):
                if (targets.cells[t] == np.array([x, y, z])).all():
                    limits[t] = -1
                    longest = limits.max()
        if not leads_to_targets(targets, x, y, z, now):
            continue
        is_open = space.open_cells[x, y, z]
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
            if not flags[u, v, w] & FREE_CELL or not space.passable[u, v, w]:
                continue
            if far[p, q, r, max_words - 1] <= new_distance and done[p, q, r, max_words - 1]:
                continue
            order = 0 if is_open else staircase_order(flags, x, y, z, s)
            if order < 0:
                continue
            number = (x * ny + y) * nz + z
            new, table = word_after_step(space, table, rules, current_word, number, s, order)
            if new < 0:
                continue
            to = slot_for(word[p, q, r], far[p, q, r], new, new_distance)
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
    empty_slots(word, done)
    return WordSearch(first, word, far, step, slot), table


@kernel
def leads_to_targets(targets: Targets, x: int, y: int, z: int, length: int) -> bool:
    """Return whether a path of some length to a cell may lead on to a target within its limit."""
    cells = targets.cells
    for t in range(len(cells)):
        square = (cells[t, 0] - x) ** 2 + (cells[t, 1] - y) ** 2 + (cells[t, 2] - z) ** 2
        left = targets.limits[t] - length
        if left >= 0 and 10_000 * square <= left * left:
            return True
    return len(cells) == 0


@kernel
def slot_for(
    words: npt.NDArray[np.int32], far: npt.NDArray[np.int32], word: int, length: int
) -> int:
    """Return the slot of a cell for a word and the length of its path; negative if there is none.

    It is the slot of this word if that has a longer path, else the one with the longest path, which
    is empty if any is.
    """
    to, worst = -1, length
    for m in range(len(words)):
        if words[m] == word:
            return m if far[m] > length else -2
        if far[m] > worst:
            worst, to = far[m], m
    return to


@kernel
def empty_slots(word: npt.NDArray[np.int32], done: Bools) -> None:
    """Empty the slots that the search has not finished."""
    nx, ny, nz, n = word.shape
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                for m in range(n):
                    if not done[i, j, k, m]:
                        word[i, j, k, m] = NO_WORD


@kernel
def word_after_step(
    space: SearchSpace, table: Table, rules: Rules, word: int, cell: int, step: int, order: int
) -> tuple[int, Table]:
    """Return the word after one step from a cell along edges in an order of `staircase_order`; -1
    if the word of an edge is not known."""
    _nx, ny, nz = space.flags.shape
    n, a, b, c = step_axes(step)
    for m in range(n):
        axis = nth_axis(n, a, b, c, order, m)
        sign = STEPS[step, axis]
        label = space.labels[3 * lower_end(cell, axis, sign, ny, nz) + axis]
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

"""Labels of a complex: the letters that a path writes, edge by edge.

Every edge gets a word such that the product around every square is the empty word. Edges of a
shortest-path tree of the root get the empty word. A square with one unknown edge gives its word. If
there is none, the next unknown edge in the order of distance becomes a generator, so generators lie
where shortest paths on either side of a solid meet. The remaining squares are relations (compare
Brendel, Dłotko, Ellis, Juda & Mrozek, "Computing fundamental groups from point clouds", arXiv
1507.03396). Two loops at the root are homotopic in the complex if and only if their words are equal
in the group.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Ints
from netsp.base.compiled.dynamic_array import more_int_rows, write_ints
from netsp.base.compiled.kernel import kernel
from netsp.base.time_flags import Flag
from netsp.hsignature.wordtable import Rules, Table, times, times_inverse, times_letter
from netsp.plan.space.cells import EDGE_BIT, FREE_CELL, OPEN_CELL, SQUARE_BIT

Flags = npt.NDArray[np.uint8]
Labels = npt.NDArray[np.int32]

UNKNOWN = -1
"""Sentinel label of an edge whose word is not known."""

FAR = np.iinfo(np.int32).max
"""Sentinel distance of a cell that no path reaches."""

STEPS = np.array([s for s in np.ndindex(3, 3, 3) if s != (1, 1, 1)], dtype=np.int64) - 1
LENGTHS = np.round(100.0 * np.sqrt((STEPS**2).sum(1))).astype(np.int64)
"""Lengths of the 26 steps in hundredths of a cell. Integers make buckets of equal lengths."""

BUCKETS = int(LENGTHS.max()) + 1
"""Number of buckets of a queue by distance, one more than the longest step."""


@kernel
def edge_flag(flags: Flags, i: int, j: int, k: int, axis: int, sign: int) -> bool:
    """Return whether the edge from a cell along an axis counts; cells outside of the box have
    none."""
    if sign < 0:
        i, j, k = i - (axis == 0), j - (axis == 1), k - (axis == 2)
        if i < 0 or j < 0 or k < 0:
            return False
    return bool(flags[i, j, k] & (EDGE_BIT << axis))


@kernel
def step_axes(step: int) -> tuple[int, int, int, int]:
    """Return the number of axes that a step goes along, and the axes."""
    n, axes = 0, np.zeros(3, dtype=np.int64)
    for axis in range(3):
        if STEPS[step, axis] != 0:
            axes[n] = axis
            n += 1
    return n, axes[0], axes[1], axes[2]


@kernel
def staircase_order(flags: Flags, i: int, j: int, k: int, step: int) -> int:
    """Return the order of axes, 0 … 5, in which a step runs along edges that count; -1 if there is
    none.

    Order o takes the axes of the step from the o // 2-th on, upwards or (o odd) downwards.
    """
    n, a, b, c = step_axes(step)
    for order in range(1 if n == 1 else 2 if n == 2 else 6):
        p, q, r = i, j, k
        free = True
        for m in range(n):
            axis = nth_axis(n, a, b, c, order, m)
            sign = STEPS[step, axis]
            if not edge_flag(flags, p, q, r, axis, sign):
                free = False
                break
            p, q, r = p + sign * (axis == 0), q + sign * (axis == 1), r + sign * (axis == 2)
        if free:
            return order
    return -1


@kernel
def nth_axis(n: int, a: int, b: int, c: int, order: int, m: int) -> int:
    """Return the m-th axis of a step along n axes a, b, c, taken in one of their orders."""
    if n == 1:
        return a
    if n == 2:
        return a if (order + m) % 2 == 0 else b
    at = (order // 2 + m) % 3 if order % 2 == 0 else (order // 2 - m) % 3
    return a if at == 0 else b if at == 1 else c


@kernel
def cell_distances(
    flags: Flags, root: Ints, stop: Flag
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return the distances of all cells from the root over 26 steps, and the cells by distance.

    A diagonal step counts if edges lead along it one after the other. Then the cell before its last
    edge is nearer to the root than its end, so every cell has an edge to a nearer one. Ends early
    once `stop` is set.

    Returns
    -------
    far
        (n,) hundredths of a cell, `FAR` for cells that no path reaches.
    order
        (m,) cells reached, nearest first.
    """
    nx, ny, nz = flags.shape
    size = nx * ny * nz
    far, done = np.full(size, FAR, dtype=np.int32), np.zeros(size, dtype=np.bool_)
    order, count = np.empty(size, dtype=np.int32), 0
    waiting, entries = np.empty((4096, 2), dtype=np.int64), 1
    spare = -1
    first = np.full(BUCKETS, -1)
    begin = (root[0] * ny + root[1]) * nz + root[2]
    far[begin], waiting[0, 0], waiting[0, 1] = 0, begin, -1
    first[0], empty, now = 0, 0, 0
    while empty < BUCKETS and stop[0] == 0:
        entry = first[now % BUCKETS]
        if entry < 0:
            empty += 1
            now += 1
            continue
        empty = 0
        first[now % BUCKETS] = waiting[entry, 1]
        cell = waiting[entry, 0]
        waiting[entry, 1] = spare
        spare = entry
        if done[cell]:
            continue
        done[cell] = True
        order[count] = cell
        count += 1
        i, j, k = cell // (ny * nz), cell // nz % ny, cell % nz
        is_open = flags[i, j, k] & OPEN_CELL != 0
        for s in range(26):
            p, q, r = i + STEPS[s, 0], j + STEPS[s, 1], k + STEPS[s, 2]
            if p < 0 or q < 0 or r < 0 or p >= nx or q >= ny or r >= nz:
                continue
            neighbour = (p * ny + q) * nz + r
            new_distance = now + LENGTHS[s]
            if new_distance >= far[neighbour]:
                continue
            if not flags[p, q, r] & FREE_CELL or not (
                is_open or staircase_order(flags, i, j, k, s) >= 0
            ):
                continue
            far[neighbour] = new_distance
            if spare >= 0:
                new = spare
                spare = waiting[new, 1]
            else:
                if entries == len(waiting):
                    waiting = more_int_rows(waiting)
                new = entries
                entries += 1
            waiting[new, 0], waiting[new, 1] = neighbour, first[new_distance % BUCKETS]
            first[new_distance % BUCKETS] = new
    return far, order[:count].copy()


@kernel
def label_edges(
    flags: Flags,
    far: npt.NDArray[np.int32],
    order: npt.NDArray[np.int32],
    table: Table,
    rules: Rules,
    max_generators: int,
    stop: Flag,
) -> tuple[Labels, Table, int]:
    """Return a label for every edge between cells that are reached, and the number of generators.

    Ends early once `stop` is set.

    Returns
    -------
    labels
        (3 n,) number of the word of edge 3 cell + axis, from its lower end; `UNKNOWN` elsewhere.
    table
        Table with the words.
    generators
        Number of generators; above `max_generators` the labels are incomplete.
    """
    nx, ny, nz = flags.shape
    labels = np.full(3 * nx * ny * nz, UNKNOWN, dtype=np.int32)
    pending, left, generators = np.empty(4096, dtype=np.int64), 0, 0
    for cell in order:
        if far[cell] == 0:
            continue
        i, j, k = cell // (ny * nz), cell // nz % ny, cell % nz
        min_distance, best = far[cell], -1
        for side in range(6):
            axis, sign = side // 2, 2 * (side % 2) - 1
            if not edge_flag(flags, i, j, k, axis, sign):
                continue
            lower = lower_end(cell, axis, sign, ny, nz)
            other = lower if sign < 0 else upper_end(cell, axis, ny, nz)
            if far[other] < min_distance:
                min_distance, best = far[other], 3 * lower + axis
        labels[best] = 0
        if left == len(pending):
            pending = doubled(pending)
        pending[left] = best
        left += 1
    for cell in order:
        if stop[0] != 0:
            break
        i, j, k = cell // (ny * nz), cell // nz % ny, cell % nz
        for side in range(7):
            while left > 0 and stop[0] == 0:
                left -= 1
                edge = pending[left]
                for n in range(4):
                    found, word, table = close_square(flags, labels, table, rules, edge, n)
                    if found >= 0:
                        labels[found] = word
                        if left + 1 >= len(pending):
                            pending = doubled(pending)
                        pending[left] = found
                        left += 1
            if side == 6:
                break
            axis, sign = side // 2, 2 * (side % 2) - 1
            if not edge_flag(flags, i, j, k, axis, sign):
                continue
            lower = lower_end(cell, axis, sign, ny, nz)
            edge = 3 * lower + axis
            # the edge becomes a generator at the farther of its ends, in the order of distance
            other = lower if sign < 0 else upper_end(cell, axis, ny, nz)
            if labels[edge] != UNKNOWN or far[other] > far[cell]:
                continue
            generators += 1
            if generators > max_generators:
                return labels, table, generators
            word, table = times_letter(table, rules, 0, generators)
            labels[edge] = word
            pending[left] = edge
            left += 1
    return labels, table, generators


@kernel
def lower_end(cell: int, axis: int, sign: int, ny: int, nz: int) -> int:
    """Return the cell that the edge on one side of a cell belongs to."""
    if sign > 0:
        return cell
    return cell - (ny * nz if axis == 0 else nz if axis == 1 else 1)


@kernel
def upper_end(cell: int, axis: int, ny: int, nz: int) -> int:
    """Return the next cell along an axis."""
    return cell + (ny * nz if axis == 0 else nz if axis == 1 else 1)


@kernel
def doubled(a: Ints) -> Ints:
    """Return an array with room for twice as many entries."""
    b = np.empty(2 * len(a), dtype=np.int64)
    write_ints(b, a, len(a))
    return b


@kernel
def square_of_edge(flags: Flags, edge: int, n: int) -> tuple[int, int, int, int, int]:
    """Return the n-th of the four squares at an edge: whether it counts, and its four edges.

    The edges are in the order of a walk along a, then b: a below, b on the right, a above, b on the
    left.
    """
    _nx, ny, nz = flags.shape
    cell, axis = edge // 3, edge % 3
    other = (axis + 1 + n % 2) % 3
    normal = 3 - axis - other
    i, j, k = cell // (ny * nz), cell // nz % ny, cell % nz
    if n >= 2:
        i, j, k = i - (other == 0), j - (other == 1), k - (other == 2)
        if i < 0 or j < 0 or k < 0:
            return 0, 0, 0, 0, 0
    if not flags[i, j, k] & (SQUARE_BIT << normal):
        return 0, 0, 0, 0, 0
    at = (i * ny + j) * nz + k
    a, b = (normal + 1) % 3, (normal + 2) % 3
    return (
        1,
        3 * at + a,
        3 * upper_end(at, a, ny, nz) + b,
        3 * upper_end(at, b, ny, nz) + a,
        3 * at + b,
    )


@kernel
def close_square(
    flags: Flags, labels: Labels, table: Table, rules: Rules, edge: int, n: int
) -> tuple[int, int, Table]:
    """Return the one unknown edge of the n-th square at a known edge, its word and the table; -1 if
    the square does not count or has another number of unknown edges."""
    counts, low, right, top, left = square_of_edge(flags, edge, n)
    if counts == 0:
        return -1, 0, table
    unknown = (
        int(labels[low] == UNKNOWN)
        + int(labels[right] == UNKNOWN)
        + int(labels[top] == UNKNOWN)
        + int(labels[left] == UNKNOWN)
    )
    if unknown != 1:
        return -1, 0, table
    # low right = left top
    a, b, c, d = labels[low], labels[right], labels[top], labels[left]
    if a == UNKNOWN:
        word, table = times(table, rules, d, c)
        word, table = times_inverse(table, rules, word, b)
        return low, word, table
    if d == UNKNOWN:
        word, table = times(table, rules, a, b)
        word, table = times_inverse(table, rules, word, c)
        return left, word, table
    if b == UNKNOWN:
        word, table = times_inverse(table, rules, 0, a)
        word, table = times(table, rules, word, d)
        word, table = times(table, rules, word, c)
        return right, word, table
    word, table = times_inverse(table, rules, 0, d)
    word, table = times(table, rules, word, a)
    word, table = times(table, rules, word, b)
    return top, word, table


@kernel
def square_relations(
    flags: Flags,
    labels: Labels,
    order: npt.NDArray[np.int32],
    table: Table,
    rules: Rules,
    stop: Flag,
) -> tuple[Ints, Table]:
    """Return the numbers of the words around squares other than the empty word, each once.

    Ends early once `stop` is set.
    """
    _nx, ny, nz = flags.shape
    seen: Bools = np.zeros(1024, dtype=np.bool_)
    out, count = np.empty(1024, dtype=np.int64), 0
    for cell in order:
        if stop[0] != 0:
            break
        i, j, k = cell // (ny * nz), cell // nz % ny, cell % nz
        for normal in range(3):
            if not flags[i, j, k] & (SQUARE_BIT << normal):
                continue
            a, b = (normal + 1) % 3, (normal + 2) % 3
            low, right = labels[3 * cell + a], labels[3 * upper_end(cell, a, ny, nz) + b]
            top, left = labels[3 * upper_end(cell, b, ny, nz) + a], labels[3 * cell + b]
            if (low == left and right == top) or (low == 0 and top == 0 and left == right):
                continue
            word, table = times(table, rules, low, right)
            word, table = times_inverse(table, rules, word, top)
            word, table = times_inverse(table, rules, word, left)
            if word == 0:
                continue
            if word >= len(seen):
                longer = np.zeros(2 * word, dtype=np.bool_)
                for k in range(len(seen)):
                    longer[k] = seen[k]
                seen = longer
            if not seen[word]:
                seen[word] = True
                if count == len(out):
                    out = doubled(out)
                out[count] = word
                count += 1
    return out[:count].copy(), table

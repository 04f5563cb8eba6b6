"""Words of paths from the edges of the complex that run beside them.

A point holds on to a cell that it sees. Whenever the point moves or takes hold of another cell, the
triangles in between are checked. If they hold no solid, nothing lies between the path and the edges
that the hold runs along, so the labels of the edges write the word of the path.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.dynamic_array import order_of
from netsp.base.compiled.kernel import kernel
from netsp.hsignature.wordtable import Rules, Table, times, times_inverse
from netsp.plan.space.cells import FREE_CELL
from netsp.plan.space.triangle_labels import UNKNOWN, Flags, Labels, edge_flag, lower_end
from netsp.world.scene.sampling import Field, distance


class LabelledComplex(NamedTuple):
    """A labelled complex, and how closely paths are followed through it.

    Attributes
    ----------
    field
        The scene.
    low
        (3,) corner of the box, metres.
    cell
        Size of a cell, metres.
    flags
        (nx, ny, nz) flags of `netsp.plan.space.cells`.
    labels
        (3 n,) labels of the edges.
    known
        (nx, ny, nz) nonzero for cells that points may hold on to.
    tolerance
        Depth to which paths may enter solids, and size of the triangles that are not divided any
        further, metres.
    max_hold, far_hold
        `max_hold_cells` and `far_hold_cells` of `netsp.plan.space.mission_policy.WordPolicy`.
    """

    field: Field
    low: Floats
    cell: float
    flags: Flags
    labels: Labels
    known: Flags
    tolerance: float
    max_hold: int
    far_hold: float


@kernel
def is_triangle_free(field: Field, p: Floats, q: Floats, r: Floats, tolerance: float) -> bool:
    """Return whether no solid is in a triangle.

    Balls without solids cover the triangle, except parts smaller than the tolerance, whose middle
    may be that deep in a solid. No bar of a radius of twice the tolerance can pass through.
    """
    parts, left = np.empty((64, 9)), 1
    for c in range(3):
        parts[0, c], parts[0, 3 + c], parts[0, 6 + c] = p[c], q[c], r[c]
    while left > 0:
        left -= 1
        a0, a1, a2 = parts[left, 0], parts[left, 1], parts[left, 2]
        b0, b1, b2 = parts[left, 3], parts[left, 4], parts[left, 5]
        c0, c1, c2 = parts[left, 6], parts[left, 7], parts[left, 8]
        x, y, z = (a0 + b0 + c0) / 3.0, (a1 + b1 + c1) / 3.0, (a2 + b2 + c2) / 3.0
        radius = math.sqrt(
            max(
                (a0 - x) ** 2 + (a1 - y) ** 2 + (a2 - z) ** 2,
                (b0 - x) ** 2 + (b1 - y) ** 2 + (b2 - z) ** 2,
                (c0 - x) ** 2 + (c1 - y) ** 2 + (c2 - z) ** 2,
            )
        )
        d = distance(field, x, y, z)
        if d >= radius:
            continue
        if d < -tolerance:
            return False
        if radius <= tolerance:
            continue
        # halve the longest side, so that parts get no thinner
        ab = (a0 - b0) ** 2 + (a1 - b1) ** 2 + (a2 - b2) ** 2
        bc = (b0 - c0) ** 2 + (b1 - c1) ** 2 + (b2 - c2) ** 2
        ca = (c0 - a0) ** 2 + (c1 - a1) ** 2 + (c2 - a2) ** 2
        if bc >= ab and bc >= ca:
            a0, a1, a2, b0, b1, b2, c0, c1, c2 = b0, b1, b2, c0, c1, c2, a0, a1, a2
        elif ca >= ab:
            a0, a1, a2, b0, b1, b2, c0, c1, c2 = c0, c1, c2, a0, a1, a2, b0, b1, b2
        m0, m1, m2 = 0.5 * (a0 + b0), 0.5 * (a1 + b1), 0.5 * (a2 + b2)
        if left + 2 > len(parts):
            return False
        for k in range(2):
            parts[left, 0], parts[left, 1], parts[left, 2] = m0, m1, m2
            parts[left, 3], parts[left, 4], parts[left, 5] = c0, c1, c2
            if k == 0:
                parts[left, 6], parts[left, 7], parts[left, 8] = a0, a1, a2
            else:
                parts[left, 6], parts[left, 7], parts[left, 8] = b0, b1, b2
            left += 1
    return True


@kernel
def cell_centre(complex_: LabelledComplex, i: int, j: int, k: int) -> Floats:
    """Return the centre (3,) of a cell, metres."""
    low, cell, out = complex_.low, complex_.cell, np.empty(3)
    out[0] = low[0] + (i + 0.5) * cell
    out[1] = low[1] + (j + 0.5) * cell
    out[2] = low[2] + (k + 0.5) * cell
    return out


@kernel
def visible_cell(complex_: LabelledComplex, p: Floats) -> int:
    """Return the nearest known cell that a point sees, -1 if there is none; the cell depends on the
    point alone."""
    low, cell, flags, reach = complex_.low, complex_.cell, complex_.flags, complex_.max_hold
    nx, ny, nz = flags.shape
    at = np.empty(3, dtype=np.int64)
    for axis in range(3):
        at[axis] = min(max(math.floor((p[axis] - low[axis]) / cell), 0), flags.shape[axis] - 1)
    number = (2 * reach + 1) ** 3
    squares, cells, count = np.empty(number), np.empty(number, dtype=np.int64), 0
    for i in range(max(at[0] - reach, 0), min(at[0] + reach + 1, nx)):
        for j in range(max(at[1] - reach, 0), min(at[1] + reach + 1, ny)):
            for k in range(max(at[2] - reach, 0), min(at[2] + reach + 1, nz)):
                if flags[i, j, k] & FREE_CELL and complex_.known[i, j, k]:
                    c = cell_centre(complex_, i, j, k)
                    squares[count] = (p[0] - c[0]) ** 2 + (p[1] - c[1]) ** 2 + (p[2] - c[2]) ** 2
                    cells[count] = (i * ny + j) * nz + k
                    count += 1
    for n in order_of(squares[:count]):
        i, j, k = cells[n] // (ny * nz), cells[n] // nz % ny, cells[n] % nz
        c = cell_centre(complex_, i, j, k)
        if is_triangle_free(complex_.field, p, p, c, complex_.tolerance):
            return int(cells[n])
    return -1


@kernel
def moved_hold(
    complex_: LabelledComplex, p: Floats, begin: int, end: int, ahead: Floats
) -> tuple[int, Ints]:
    """Move the hold of a point from one cell to another, along edges that the point sees.

    Parameters
    ----------
    begin, end
        Cells; with an end of -1, the first cell found from which the point can go on to `ahead`.

    Returns
    -------
    cell
        Cell at the end; -1 if no edges lead there.
    edges
        (m,) 1 + number of each edge, negative where the hold runs along it backwards.
    """
    low, cell, flags, labels = complex_.low, complex_.cell, complex_.flags, complex_.labels
    field, tolerance, reach = complex_.field, complex_.tolerance, complex_.max_hold
    _nx, ny, nz = flags.shape
    middle = np.empty(3, dtype=np.int64)
    for axis in range(3):
        middle[axis] = min(max(math.floor((p[axis] - low[axis]) / cell), 0), flags.shape[axis] - 1)
    number = (2 * reach + 1) ** 3
    came_from = np.zeros(number, dtype=np.int64)  # 1 + index before; 0 if not reached yet
    edge_to = np.zeros(number, dtype=np.int64)
    queue, head, tail = np.empty(number, dtype=np.int64), 0, 1
    start = index_in_block(begin, middle, reach, ny, nz)
    if start < 0:
        return -1, np.empty(0, dtype=np.int64)
    queue[0], came_from[start] = begin, -1
    found = -1
    while head < tail:
        current = queue[head]
        head += 1
        i, j, k = current // (ny * nz), current // nz % ny, current % nz
        c = cell_centre(complex_, i, j, k)
        if current == end or (end < 0 and is_triangle_free(field, p, ahead, c, tolerance)):
            found = current
            break
        for side in range(6):
            axis, sign = side // 2, 2 * (side % 2) - 1
            if not edge_flag(flags, i, j, k, axis, sign):
                continue
            next_cell = current + sign * (ny * nz if axis == 0 else nz if axis == 1 else 1)
            edge = 3 * lower_end(current, axis, sign, ny, nz) + axis
            if labels[edge] == UNKNOWN:
                continue
            index = index_in_block(next_cell, middle, reach, ny, nz)
            if index < 0 or came_from[index] != 0:
                continue
            d = cell_centre(complex_, next_cell // (ny * nz), next_cell // nz % ny, next_cell % nz)
            if not is_triangle_free(field, p, c, d, tolerance):
                continue
            came_from[index] = 1 + index_in_block(current, middle, reach, ny, nz)
            edge_to[index] = sign * (1 + edge)
            queue[tail] = next_cell
            tail += 1
    if found < 0:
        return -1, np.empty(0, dtype=np.int64)
    edges, count = np.empty(number, dtype=np.int64), 0
    index = index_in_block(found, middle, reach, ny, nz)
    while came_from[index] > 0:
        edges[count] = edge_to[index]
        count += 1
        index = came_from[index] - 1
    return found, edges[:count][::-1].copy()


@kernel
def index_in_block(cell: int, middle: Ints, reach: int, ny: int, nz: int) -> int:
    """Return the index of a cell in the block of cells around another; -1 outside of it."""
    side = 2 * reach + 1
    i = cell // (ny * nz) - middle[0] + reach
    j = cell // nz % ny - middle[1] + reach
    k = cell % nz - middle[2] + reach
    if i < 0 or j < 0 or k < 0 or i >= side or j >= side or k >= side:
        return -1
    return int((i * side + j) * side + k)


@kernel
def path_word(
    complex_: LabelledComplex, table: Table, rules: Rules, path: Floats
) -> tuple[int, Table, Floats]:
    """Return the number of the word of a path (k, 3), the table, and the last point reached.

    The number is -1 if the path runs through a solid, out of the box or through a closed gap.
    """
    cell, tolerance = complex_.cell, complex_.tolerance
    p = path[0].copy()
    hold = visible_cell(complex_, p)
    word = 0
    if hold < 0:
        return -1, table, p
    for n in range(1, len(path)):
        share = 0.0
        begin, end = path[n - 1], path[n]
        long = math.sqrt(((end - begin) ** 2).sum())
        step = min(1.0, cell / max(long, 1e-12))
        while share < 1.0:
            step = min(step, 1.0 - share)
            q = begin + (share + step) * (end - begin)
            c = centre_of_number(complex_, hold)
            if not is_triangle_free(complex_.field, p, q, c, tolerance):
                next_cell, edges = moved_hold(complex_, p, hold, -1, q)
                if next_cell < 0:
                    if step * long < 0.25 * tolerance:
                        return -1, table, p
                    step *= 0.5
                    continue
                word, table = with_edges(complex_.labels, table, rules, word, edges)
                hold = next_cell
            share += step
            p = q
            hold, word, table = nearest_hold(complex_, table, rules, p, hold, word)
            step = min(2.0 * step, cell / max(long, 1e-12))
    last = visible_cell(complex_, p)
    if last < 0:
        return -1, table, p
    next_cell, edges = moved_hold(complex_, p, hold, last, p)
    if next_cell < 0:
        return -1, table, p
    word, table = with_edges(complex_.labels, table, rules, word, edges)
    return word, table, p


@kernel
def nearest_hold(
    complex_: LabelledComplex, table: Table, rules: Rules, p: Floats, hold: int, word: int
) -> tuple[int, int, Table]:
    """Return the hold of a point, moved to nearer cells, and the word and table after that."""
    # go to nearer neighbours while the point sees them: this keeps the hold short
    while True:
        nearer, edge = nearer_neighbour(complex_, p, hold)
        if nearer < 0:
            break
        one = np.empty(1, dtype=np.int64)
        one[0] = edge
        word, table = with_edges(complex_.labels, table, rules, word, one)
        hold = nearer
    # a solid may stand between the hold and nearer cells: go around it before the hold is too far
    c = centre_of_number(complex_, hold)
    squares = complex_.far_hold * complex_.cell
    if max(abs(p[0] - c[0]), abs(p[1] - c[1]), abs(p[2] - c[2])) > squares:
        near = visible_cell(complex_, p)
        if near >= 0:
            next_cell, edges = moved_hold(complex_, p, hold, near, p)
            if next_cell >= 0:
                word, table = with_edges(complex_.labels, table, rules, word, edges)
                hold = next_cell
    return hold, word, table


@kernel
def centre_of_number(complex_: LabelledComplex, number: int) -> Floats:
    """Return the centre (3,) of a cell by its number, metres."""
    _nx, ny, nz = complex_.flags.shape
    return cell_centre(complex_, number // (ny * nz), number // nz % ny, number % nz)


@kernel
def nearer_neighbour(complex_: LabelledComplex, p: Floats, hold: int) -> tuple[int, int]:
    """Return the neighbour of a cell that is nearest to a point, and the edge to it as in
    `moved_hold`; -1 if no visible neighbour is nearer than the cell."""
    flags, labels = complex_.flags, complex_.labels
    _nx, ny, nz = flags.shape
    i, j, k = hold // (ny * nz), hold // nz % ny, hold % nz
    c = cell_centre(complex_, i, j, k)
    min_square = (p[0] - c[0]) ** 2 + (p[1] - c[1]) ** 2 + (p[2] - c[2]) ** 2 - 1e-9
    nearest, edge_to_nearest = -1, 0
    for side in range(6):
        axis, sign = side // 2, 2 * (side % 2) - 1
        if (p[axis] - c[axis]) * sign <= 0.0 or not edge_flag(flags, i, j, k, axis, sign):
            continue
        next_cell = hold + sign * (ny * nz if axis == 0 else nz if axis == 1 else 1)
        edge = 3 * lower_end(hold, axis, sign, ny, nz) + axis
        if labels[edge] == UNKNOWN:
            continue
        d = cell_centre(complex_, next_cell // (ny * nz), next_cell // nz % ny, next_cell % nz)
        squares = (p[0] - d[0]) ** 2 + (p[1] - d[1]) ** 2 + (p[2] - d[2]) ** 2
        if squares < min_square and is_triangle_free(complex_.field, p, c, d, complex_.tolerance):
            min_square, nearest, edge_to_nearest = squares, next_cell, sign * (1 + edge)
    return nearest, edge_to_nearest


@kernel
def with_edges(
    labels: Labels, table: Table, rules: Rules, word: int, edges: Ints
) -> tuple[int, Table]:
    """Return a word followed by the words of edges as in `moved_hold`, and the table."""
    for e in edges:
        label = labels[abs(e) - 1]
        if label == 0:
            continue
        if e > 0:
            word, table = times(table, rules, word, label)
        else:
            word, table = times_inverse(table, rules, word, label)
    return word, table

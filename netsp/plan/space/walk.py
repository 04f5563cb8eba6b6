"""From a path to cells that lie beside it: which edges of the complex it runs along.

A point holds on to a cell that it sees. While the point moves and when it takes hold of another
cell, the triangles in between are looked at: if no solid is in them, nothing can lie between the
path and the edges, and what the edges' labels say is true of the path.
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.dynamic_array import order_of
from netsp.base.compiled.kernel import kernel
from netsp.hsignature.wordtable import Rules, Table, times, times_inverse
from netsp.plan.space.cells import FREE
from netsp.plan.space.triangle_labels import UNKNOWN, Flags, Labels, edge_flag, lower_end
from netsp.world.scene.sampling import Field, distance

REACH = 3
"""A point holds on to a cell no farther than so many cells along an axis."""

SIDE = 2 * REACH + 1

NEAR = 1.5
"""From so many cells on, a nearer one is sought."""


@kernel
def triangle_free(field: Field, p: Floats, q: Floats, r: Floats, fine: float, into: float) -> bool:
    """Whether no solid is in a triangle: balls without solids cover it, but for parts smaller than
    `fine` whose middle may be as deep as `into` in a surface. A bar of a radius greater than both
    together cannot pass through."""
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
        if d < -into:
            return False
        if radius <= fine:
            continue
        # the longest side is halved, so that parts get no thinner
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
def centre_of(low: Floats, cell: float, i: int, j: int, k: int) -> Floats:
    """Of a cell, metres."""
    out = np.empty(3)
    out[0] = low[0] + (i + 0.5) * cell
    out[1] = low[1] + (j + 0.5) * cell
    out[2] = low[2] + (k + 0.5) * cell
    return out


@kernel
def held(
    field: Field,
    low: Floats,
    cell: float,
    flags: Flags,
    known: Flags,
    p: Floats,
    fine: float,
    into: float,
) -> int:
    """The nearest cell that a point sees, of those that are known; -1 if there is none. It depends
    on the point alone."""
    nx, ny, nz = flags.shape
    at = np.empty(3, dtype=np.int64)
    for axis in range(3):
        at[axis] = min(max(math.floor((p[axis] - low[axis]) / cell), 0), flags.shape[axis] - 1)
    number = SIDE**3
    far, cells, count = np.empty(number), np.empty(number, dtype=np.int64), 0
    for i in range(max(at[0] - REACH, 0), min(at[0] + REACH + 1, nx)):
        for j in range(max(at[1] - REACH, 0), min(at[1] + REACH + 1, ny)):
            for k in range(max(at[2] - REACH, 0), min(at[2] + REACH + 1, nz)):
                if flags[i, j, k] & FREE and known[i, j, k]:
                    c = centre_of(low, cell, i, j, k)
                    far[count] = (p[0] - c[0]) ** 2 + (p[1] - c[1]) ** 2 + (p[2] - c[2]) ** 2
                    cells[count] = (i * ny + j) * nz + k
                    count += 1
    for n in order_of(far[:count]):
        i, j, k = cells[n] // (ny * nz), cells[n] // nz % ny, cells[n] % nz
        c = centre_of(low, cell, i, j, k)
        if triangle_free(field, p, p, c, fine, into):
            return int(cells[n])
    return -1


@kernel
def moved(
    field: Field,
    low: Floats,
    cell: float,
    flags: Flags,
    labels: Labels,
    p: Floats,
    begin: int,
    end: int,
    ahead: Floats,
    fine: float,
    into: float,
) -> tuple[int, Ints]:
    """From one cell to another that a point takes hold of, along edges that it sees.

    Parameters
    ----------
    begin, end
        Cells; end -1: the first from which the point sees what it needs to, to go on to `ahead`.

    Returns
    -------
    cell
        Where it ends; -1 if there is no such way.
    edges
        (m,) 1 + edge, negative where it is run along backwards.
    """
    _nx, ny, nz = flags.shape
    middle = np.empty(3, dtype=np.int64)
    for axis in range(3):
        middle[axis] = min(max(math.floor((p[axis] - low[axis]) / cell), 0), flags.shape[axis] - 1)
    number = SIDE**3
    came = np.zeros(number, dtype=np.int64)  # 1 + place before; 0 where it was not yet
    along = np.zeros(number, dtype=np.int64)
    queue, head, tail = np.empty(number, dtype=np.int64), 0, 1
    start = place_of(begin, middle, ny, nz)
    if start < 0:
        return -1, np.empty(0, dtype=np.int64)
    queue[0], came[start] = begin, -1
    found = -1
    while head < tail:
        here = queue[head]
        head += 1
        i, j, k = here // (ny * nz), here // nz % ny, here % nz
        c = centre_of(low, cell, i, j, k)
        if here == end or (end < 0 and triangle_free(field, p, ahead, c, fine, into)):
            found = here
            break
        for side in range(6):
            axis, sign = side // 2, 2 * (side % 2) - 1
            if not edge_flag(flags, i, j, k, axis, sign):
                continue
            there = here + sign * (ny * nz if axis == 0 else nz if axis == 1 else 1)
            edge = 3 * lower_end(here, axis, sign, ny, nz) + axis
            if labels[edge] == UNKNOWN:
                continue
            place = place_of(there, middle, ny, nz)
            if place < 0 or came[place] != 0:
                continue
            d = centre_of(low, cell, there // (ny * nz), there // nz % ny, there % nz)
            if not triangle_free(field, p, c, d, fine, into):
                continue
            came[place] = 1 + place_of(here, middle, ny, nz)
            along[place] = sign * (1 + edge)
            queue[tail] = there
            tail += 1
    if found < 0:
        return -1, np.empty(0, dtype=np.int64)
    edges, count = np.empty(number, dtype=np.int64), 0
    place = place_of(found, middle, ny, nz)
    while came[place] > 0:
        edges[count] = along[place]
        count += 1
        place = came[place] - 1
    return found, edges[:count][::-1].copy()


@kernel
def place_of(cell: int, middle: Ints, ny: int, nz: int) -> int:
    """Of a cell in the box around another; -1 outside of it."""
    i = cell // (ny * nz) - middle[0] + REACH
    j = cell // nz % ny - middle[1] + REACH
    k = cell % nz - middle[2] + REACH
    if i < 0 or j < 0 or k < 0 or i >= SIDE or j >= SIDE or k >= SIDE:
        return -1
    return int((i * SIDE + j) * SIDE + k)


@kernel
def walked(
    field: Field,
    low: Floats,
    cell: float,
    flags: Flags,
    labels: Labels,
    known: Flags,
    table: Table,
    rules: Rules,
    path: Floats,
    fine: float,
    into: float,
) -> tuple[int, Table, Floats]:
    """The word of a path (k, 3): its number, the table, and where it could not be told any further
    (a number of -1) or the path's end."""
    _nx, ny, nz = flags.shape
    p = path[0].copy()
    hold = held(field, low, cell, flags, known, p, fine, into)
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
            c = centre_of(low, cell, hold // (ny * nz), hold // nz % ny, hold % nz)
            if not triangle_free(field, p, q, c, fine, into):
                there, edges = moved(field, low, cell, flags, labels, p, hold, -1, q, fine, into)
                if there < 0:
                    if step * long < 0.25 * fine:
                        return -1, table, p
                    step *= 0.5
                    continue
                word, table = along_edges(labels, table, rules, word, edges)
                hold = there
            share += step
            p = q
            # the nearest beside, as long as that is seen: the hold stays short
            while True:
                nearer, edge = closer(field, low, cell, flags, labels, p, hold, fine, into)
                if nearer < 0:
                    break
                one = np.empty(1, dtype=np.int64)
                one[0] = edge
                word, table = along_edges(labels, table, rules, word, one)
                hold = nearer
            # something may stand between the hold and nearer cells: around it before it is too far
            c = centre_of(low, cell, hold // (ny * nz), hold // nz % ny, hold % nz)
            if max(abs(p[0] - c[0]), abs(p[1] - c[1]), abs(p[2] - c[2])) > NEAR * cell:
                near = held(field, low, cell, flags, known, p, fine, into)
                if near >= 0:
                    there, edges = moved(
                        field, low, cell, flags, labels, p, hold, near, p, fine, into
                    )
                    if there >= 0:
                        word, table = along_edges(labels, table, rules, word, edges)
                        hold = there
            step = min(2.0 * step, cell / max(long, 1e-12))
    last = held(field, low, cell, flags, known, p, fine, into)
    if last < 0:
        return -1, table, p
    there, edges = moved(field, low, cell, flags, labels, p, hold, last, p, fine, into)
    if there < 0:
        return -1, table, p
    word, table = along_edges(labels, table, rules, word, edges)
    return word, table, p


@kernel
def closer(
    field: Field,
    low: Floats,
    cell: float,
    flags: Flags,
    labels: Labels,
    p: Floats,
    hold: int,
    fine: float,
    into: float,
) -> tuple[int, int]:
    """The neighbour of a cell that is nearest to a point, if that is nearer and can be taken hold
    of, and the edge to it (as of `moved`); -1 if there is none."""
    _nx, ny, nz = flags.shape
    i, j, k = hold // (ny * nz), hold // nz % ny, hold % nz
    c = centre_of(low, cell, i, j, k)
    least = (p[0] - c[0]) ** 2 + (p[1] - c[1]) ** 2 + (p[2] - c[2]) ** 2 - 1e-9
    nearest, by = -1, 0
    for side in range(6):
        axis, sign = side // 2, 2 * (side % 2) - 1
        if (p[axis] - c[axis]) * sign <= 0.0 or not edge_flag(flags, i, j, k, axis, sign):
            continue
        there = hold + sign * (ny * nz if axis == 0 else nz if axis == 1 else 1)
        edge = 3 * lower_end(hold, axis, sign, ny, nz) + axis
        if labels[edge] == UNKNOWN:
            continue
        d = centre_of(low, cell, there // (ny * nz), there // nz % ny, there % nz)
        far = (p[0] - d[0]) ** 2 + (p[1] - d[1]) ** 2 + (p[2] - d[2]) ** 2
        if far < least and triangle_free(field, p, c, d, fine, into):
            least, nearest, by = far, there, sign * (1 + edge)
    return nearest, by


@kernel
def along_edges(
    labels: Labels, table: Table, rules: Rules, word: int, edges: Ints
) -> tuple[int, Table]:
    """A word and then those of edges, as of `moved`."""
    for e in edges:
        label = labels[abs(e) - 1]
        if label == 0:
            continue
        if e > 0:
            word, table = times(table, rules, word, label)
        else:
            word, table = times_inverse(table, rules, word, label)
    return word, table

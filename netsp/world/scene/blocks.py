"""Grid points in blocks near surfaces: distances, windings, floods. Compiled.

The box of a scene is divided into cells of `SIDE` voxels along each side. Cells near a surface are
*blocks*, all of whose grid points are stored; of other cells, only the corners are. These are the
two upper levels of OpenVDB's trees (Museth 2013), with all blocks in one array and without hashing.
`table` (nx, ny, nz) holds the block of each cell, or -1.

All results at the points of blocks are those of `netsp.world.scene.closest` in a full grid: the
passes are the same, in an order in which each point comes after the neighbours that it needs.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints, Singles
from netsp.base.compiled.kernel import kernel
from netsp.base.time_flags import Flag
from netsp.world.scene.closest import Owners, yz_crossing
from netsp.world.scene.grid import SIDE
from netsp.world.scene.sites import extent, site_distance

Blocks = npt.NDArray[np.int32]
Table = npt.NDArray[np.int32]
States = npt.NDArray[np.uint8]
Place = tuple[Floats, float, int]
"""Origin of the grid, size of a voxel, and index of the first block of a slab."""

Cell = tuple[int, int, int, int]
"""Indices of a cell along the axes, and index of its block, negative for none."""

WATER = 1
"""Code of water in a flood; 0 is solid."""

REACHED = 2
"""Code of water that the flood has reached."""

SPREAD = 3
"""Code of reached water whose neighbours in its block are reached, too."""


@kernel
def nearest_in_blocks(
    sites: Floats,
    which: Ints,
    place: Place,
    blocks: Blocks,
    table: Table,
    distances: Singles,
    owner: Owners,
    stop: Flag,
) -> None:
    """Measure sites from the points around them that lie in blocks of a slab, until `stop` is set.

    Distances and owners are (n, 512).
    """
    origin, size, begin = place
    low, high = np.zeros(3, dtype=np.int64), np.zeros(3, dtype=np.int64)
    reach = (0.5 * math.sqrt(3.0) * SIDE + 4.0) * size
    half = 0.5 * (SIDE - 1) * size
    for s in which:
        if stop[0] != 0:
            return
        for a in range(3):
            lowest, highest = extent(sites, s, a)
            low[a] = max(0, math.floor((lowest - origin[a]) / size) - 2)
            high[a] = min(SIDE * table.shape[a] - 1, math.ceil((highest - origin[a]) / size) + 2)
        low[0] = max(low[0], SIDE * blocks[0, 0])
        high[0] = min(high[0], SIDE * blocks[-1, 0] + SIDE - 1)
        for bi in range(low[0] // SIDE, high[0] // SIDE + 1):
            for bj in range(low[1] // SIDE, high[1] // SIDE + 1):
                for bk in range(low[2] // SIDE, high[2] // SIDE + 1):
                    b = table[bi, bj, bk] - begin
                    if b < 0 or b >= len(blocks):
                        continue
                    x, y, z = (
                        origin[0] + size * SIDE * bi,
                        origin[1] + size * SIDE * bj,
                        origin[2] + size * SIDE * bk,
                    )
                    if site_distance(sites, s, x + half, y + half, z + half) > reach:
                        continue
                    for i in range(max(low[0] - SIDE * bi, 0), min(high[0] - SIDE * bi + 1, SIDE)):
                        for j in range(
                            max(low[1] - SIDE * bj, 0), min(high[1] - SIDE * bj + 1, SIDE)
                        ):
                            for k in range(
                                max(low[2] - SIDE * bk, 0), min(high[2] - SIDE * bk + 1, SIDE)
                            ):
                                d = site_distance(
                                    sites, s, x + size * i, y + size * j, z + size * k
                                )
                                at = (i * SIDE + j) * SIDE + k
                                if d < distances[b, at]:
                                    distances[b, at] = d
                                    owner[b, at] = s


@kernel
def nearest_to_corners(
    sites: Floats, place: Place, blocks: Blocks, corners: Owners, distances: Singles, owner: Owners
) -> None:
    """Measure the sites nearest to a cell's corners at the outermost points of each block.

    So every block has a site to pass on to its neighbours. `corners` is (nx + 1, ny + 1, nz + 1).
    """
    origin, size, _ = place
    for b in range(len(blocks)):
        bi, bj, bk = blocks[b, 0], blocks[b, 1], blocks[b, 2]
        for n in range(8):
            p, q, r = n // 4, n // 2 % 2, n % 2
            i, j, k = p * (SIDE - 1), q * (SIDE - 1), r * (SIDE - 1)
            s = corners[bi + p, bj + q, bk + r]
            x = origin[0] + size * (SIDE * bi + i)
            y = origin[1] + size * (SIDE * bj + j)
            z = origin[2] + size * (SIDE * bk + k)
            d = site_distance(sites, s, x, y, z)
            at = (i * SIDE + j) * SIDE + k
            if d < distances[b, at]:
                distances[b, at], owner[b, at] = d, s


@kernel
def sweep_blocks(
    sites: Floats,
    place: Place,
    blocks: Blocks,
    table: Table,
    order: Ints,
    distances: Singles,
    owner: Owners,
    turn: int,
    changed: Ints,
    last_checked: Ints,
    stop: Flag,
) -> None:
    """Sweep a slab's points in one of the eight diagonal directions, until `stop` is set.

    `order` lists the blocks so that each comes after the three neighbours that its points need.

    Parameters
    ----------
    turn : int
        Index of the direction, from 0 to 7.
    changed : ndarray of int, shape (n,)
        Last turn, counted from 1, in which anything changed in each block.
    last_checked : ndarray of int, shape (n, 6)
        Last turn in which each block was compared with its neighbour in each direction. A block is
        skipped if nothing has changed since.
    """
    origin, size, begin = place
    di = 1 if turn % 2 == 0 else -1
    dj = 1 if turn // 2 % 2 == 0 else -1
    dk = 1 if turn // 4 % 2 == 0 else -1
    nx, ny, nz = table.shape
    for b in order:
        if stop[0] != 0:
            return
        bi, bj, bk = blocks[b, 0], blocks[b, 1], blocks[b, 2]
        before_i = table[bi - di, bj, bk] - begin if 0 <= bi - di < nx else -1
        before_j = table[bi, bj - dj, bk] - begin if 0 <= bj - dj < ny else -1
        before_k = table[bi, bj, bk - dk] - begin if 0 <= bk - dk < nz else -1
        if before_i >= len(blocks):
            before_i = -1
        has_news = False
        for before, side in (
            (before_i, (di + 1) // 2),
            (before_j, 2 + (dj + 1) // 2),
            (before_k, 4 + (dk + 1) // 2),
        ):
            has_news = has_news or last_checked[b, side] < changed[b]
            has_news = has_news or (before >= 0 and last_checked[b, side] < changed[before])
            last_checked[b, side] = turn + 1
        if not has_news:
            continue
        for p in range(SIDE):
            i = p if di > 0 else SIDE - 1 - p
            x = origin[0] + size * (SIDE * bi + i)
            from_i, back_i = b, -di * SIDE * SIDE
            if p == 0:
                from_i, back_i = before_i, di * SIDE * SIDE * (SIDE - 1)
            for q in range(SIDE):
                j = q if dj > 0 else SIDE - 1 - q
                y = origin[1] + size * (SIDE * bj + j)
                from_j, back_j = b, -dj * SIDE
                if q == 0:
                    from_j, back_j = before_j, dj * SIDE * (SIDE - 1)
                for r in range(SIDE):
                    k = r if dk > 0 else SIDE - 1 - r
                    from_k, back_k = b, -dk
                    if r == 0:
                        from_k, back_k = before_k, dk * (SIDE - 1)
                    at = (i * SIDE + j) * SIDE + k
                    mine = int(owner[b, at])
                    u = owner[from_i, at + back_i] if from_i >= 0 else -1
                    v = owner[from_j, at + back_j] if from_j >= 0 else -1
                    w = owner[from_k, at + back_k] if from_k >= 0 else -1
                    if (u < 0 or u == mine) and (v < 0 or v == mine) and (w < 0 or w == mine):
                        continue
                    z = origin[2] + size * (SIDE * bk + k)
                    best = distances[b, at]
                    # a neighbour that is farther by a whole step has no nearer site
                    if u >= 0 and u != mine and distances[from_i, at + back_i] - size < best:
                        d = site_distance(sites, u, x, y, z)
                        if d < best:
                            best, mine = d, u
                    if (
                        v >= 0
                        and v not in (mine, u)
                        and distances[from_j, at + back_j] - size < best
                    ):
                        d = site_distance(sites, v, x, y, z)
                        if d < best:
                            best, mine = d, v
                    if (
                        w >= 0
                        and w not in (mine, u, v)
                        and distances[from_k, at + back_k] - size < best
                    ):
                        d = site_distance(sites, w, x, y, z)
                        if d < best:
                            best, mine = d, w
                    if best < distances[b, at]:
                        distances[b, at], owner[b, at] = best, mine
                        changed[b] = turn + 1


@kernel
def turn_inside(
    values: Singles, triangles: Floats, place: Place, blocks: Blocks, table: Table
) -> int:
    """Negate the values (n, 512) of points that a mesh winds around; return the maximum winding
    number."""
    ny, nz = SIDE * table.shape[1], SIDE * table.shape[2]
    first = np.zeros(ny * nz + 1, dtype=np.int64)
    nothing = first[:0]
    for s in range(len(triangles)):
        _cross(triangles, s, place, ny, nz, first[1:], nothing)
    first = np.cumsum(first)
    crossings = np.empty(first[-1], dtype=np.int64)
    free = first.copy()
    for s in range(len(triangles)):
        _cross(triangles, s, place, ny, nz, free, crossings)
    for line in range(ny * nz):
        if first[line + 1] - first[line] > 1:
            crossings[first[line] : first[line + 1]].sort()
    highest = 0
    for b in range(len(blocks)):
        for j in range(SIDE):
            for k in range(SIDE):
                line = (SIDE * blocks[b, 1] + j) * nz + SIDE * blocks[b, 2] + k
                turns, c = 0, first[line]
                for i in range(SIDE):
                    while c < first[line + 1] and crossings[c] >> 1 <= SIDE * blocks[b, 0] + i:
                        turns += 1 if crossings[c] & 1 else -1
                        c += 1
                    highest = max(highest, abs(turns))
                    if turns != 0:
                        at = (i * SIDE + j) * SIDE + k
                        values[b, at] = -values[b, at]
    return highest


@kernel
def _cross(t: Floats, s: int, place: Place, ny: int, nz: int, free: Ints, crossings: Ints) -> None:
    """Count a triangle's crossings with the grid's lines along x, or write them where `free` has
    room.

    They are written if `crossings` is not empty: the next point along the line, and the direction.
    """
    origin, size, _ = place
    y0, y1 = min(t[s, 0, 1], t[s, 1, 1], t[s, 2, 1]), max(t[s, 0, 1], t[s, 1, 1], t[s, 2, 1])
    z0, z1 = min(t[s, 0, 2], t[s, 1, 2], t[s, 2, 2]), max(t[s, 0, 2], t[s, 1, 2], t[s, 2, 2])
    for j in range(
        max(0, math.ceil((y0 - origin[1]) / size)), min(ny, math.floor((y1 - origin[1]) / size) + 1)
    ):
        for k in range(
            max(0, math.ceil((z0 - origin[2]) / size)),
            min(nz, math.floor((z1 - origin[2]) / size) + 1),
        ):
            x, sign = yz_crossing(t, s, origin[1] + size * j, origin[2] + size * k)
            if sign == 0:
                continue
            line = j * nz + k
            if len(crossings) > 0:
                i = max(0, math.ceil((x - origin[0]) / size))
                crossings[free[line]] = 2 * i + (1 if sign > 0 else 0)
            free[line] += 1


@kernel
def flood(states: States, cells: States, table: Table) -> None:
    """Mark the water that is reached from the border of the box.

    `states` (n, 8, 8, 8) of points in blocks and `cells` (nx, ny, nz) of other cells hold water (1)
    and solid (0), and at the end water that was reached (above 1).
    """
    nx, ny, nz = table.shape
    queue = np.empty(nx * ny * nz, dtype=np.int64)
    waiting = np.zeros(nx * ny * nz, dtype=np.uint8)
    stack = np.empty(SIDE**3, dtype=np.int64)
    head, length = 0, 0
    for cell in range(nx * ny * nz):
        i, j, k = cell // (ny * nz), cell // nz % ny, cell % nz
        if not (i in (0, nx - 1) or j in (0, ny - 1) or k in (0, nz - 1)):
            continue
        b = table[i, j, k]
        if b < 0 and cells[i, j, k] == WATER:
            cells[i, j, k] = REACHED
        elif b >= 0:
            for p in range(SIDE):
                for q in range(SIDE):
                    for r in range(SIDE):
                        is_first = (i == 0 and p == 0) or (j == 0 and q == 0) or (k == 0 and r == 0)
                        is_last = (
                            (i == nx - 1 and p == SIDE - 1)
                            or (j == ny - 1 and q == SIDE - 1)
                            or (k == nz - 1 and r == SIDE - 1)
                        )
                        if (is_first or is_last) and states[b, p, q, r] == WATER:
                            states[b, p, q, r] = REACHED
        queue[length], waiting[cell] = cell, 1
        length += 1
    while length > 0:
        cell = queue[head]
        head, length = (head + 1) % len(queue), length - 1
        waiting[cell] = 0
        i, j, k = cell // (ny * nz), cell // nz % ny, cell % nz
        b = table[i, j, k]
        if b >= 0:
            _spread(states[b], stack)
        for n in range(6):
            axis, side = n // 2, 2 * (n % 2) - 1
            u, v, w = i, j, k
            if axis == 0:
                u += side
            elif axis == 1:
                v += side
            else:
                w += side
            if not (0 <= u < nx and 0 <= v < ny and 0 <= w < nz):
                continue
            if _over_face(states, cells, (i, j, k, b), (u, v, w, table[u, v, w]), axis, side):
                other = (u * ny + v) * nz + w
                if not waiting[other]:
                    queue[(head + length) % len(queue)], waiting[other] = other, 1
                    length += 1


@kernel
def _spread(points: States, stack: Ints) -> None:
    """Mark all water of a block that is connected to reached water."""
    top = 0
    for i in range(SIDE):
        for j in range(SIDE):
            for k in range(SIDE):
                if points[i, j, k] == REACHED:
                    stack[top] = (i * SIDE + j) * SIDE + k
                    points[i, j, k] = SPREAD
                    top += 1
    while top > 0:
        top -= 1
        i, j, k = stack[top] // SIDE**2, stack[top] // SIDE % SIDE, stack[top] % SIDE
        for n in range(6):
            u = i + (1 if n == 0 else -1 if n == 1 else 0)
            v = j + (1 if n == 2 else -1 if n == 3 else 0)
            w = k + (1 if n == 4 else -1 if n == 5 else 0)
            if 0 <= u < SIDE and 0 <= v < SIDE and 0 <= w < SIDE and points[u, v, w] == WATER:
                points[u, v, w] = SPREAD
                stack[top] = (u * SIDE + v) * SIDE + w
                top += 1


@kernel
def _over_face(
    states: States, cells: States, source: Cell, target: Cell, axis: int, side: int
) -> bool:
    """Mark water as reached over the face between two cells; return whether any of it is new."""
    i, j, k, b = source
    u, v, w, c = target
    if b < 0 and cells[i, j, k] < REACHED:
        return False
    if c < 0 and cells[u, v, w] != WATER:
        return False
    if b < 0 and c < 0:
        cells[u, v, w] = REACHED
        return True
    is_new = False
    mine, other = (SIDE - 1, 0) if side > 0 else (0, SIDE - 1)
    for p in range(SIDE):
        for q in range(SIDE):
            if b >= 0:
                if axis == 0:
                    state = states[b, mine, p, q]
                elif axis == 1:
                    state = states[b, p, mine, q]
                else:
                    state = states[b, p, q, mine]
                if state < REACHED:
                    continue
            if c < 0:
                cells[u, v, w] = REACHED
                return True
            if axis == 0:
                x, y, z = other, p, q
            elif axis == 1:
                x, y, z = p, other, q
            else:
                x, y, z = p, q, other
            if states[c, x, y, z] == WATER:
                states[c, x, y, z] = REACHED
                is_new = True
    return is_new


@kernel
def meet_corners(corners: Singles, values: Singles, blocks: Blocks, table: Table) -> None:
    """Set points (n, 512) on faces to cells without blocks to the values between the cells'
    corners.

    So distances have no jump there.
    """
    for b in range(len(blocks)):
        bi, bj, bk = blocks[b, 0], blocks[b, 1], blocks[b, 2]
        for i in range(SIDE):
            for j in range(SIDE):
                for k in range(SIDE):
                    if i > 0 and j > 0 and k > 0:
                        continue
                    coarse = False
                    # a point on a face, edge or corner belongs to two, four or eight cells
                    for p in range(max(bi - (i == 0), 0), bi + 1):
                        for q in range(max(bj - (j == 0), 0), bj + 1):
                            for r in range(max(bk - (k == 0), 0), bk + 1):
                                coarse = coarse or table[p, q, r] < 0
                    if coarse:
                        at = (i * SIDE + j) * SIDE + k
                        values[b, at] = _between(corners, bi, bj, bk, i, j, k)


@kernel
def _between(corners: Singles, bi: int, bj: int, bk: int, i: int, j: int, k: int) -> float:
    u, v, w = i / SIDE, j / SIDE, k / SIDE
    value = 0.0
    for p in range(2):
        for q in range(2):
            for r in range(2):
                share = (u if p else 1.0 - u) * (v if q else 1.0 - v) * (w if r else 1.0 - w)
                if share > 0.0:
                    value += share * corners[bi + p, bj + q, bk + r]
    return value


@kernel
def minimum_in_blocks(
    corners: Singles, values: Singles, table: Table, points: Ints, reach: int
) -> Singles:
    """Return the minimum (m,) at grid points within `reach` voxels of m points (m, 3)."""
    nx, ny, nz = table.shape
    out = np.empty(len(points), dtype=np.float32)
    for c in range(len(points)):
        best = np.float32(np.inf)
        for i in range(points[c, 0] - reach, points[c, 0] + reach + 1):
            for j in range(points[c, 1] - reach, points[c, 1] + reach + 1):
                for k in range(points[c, 2] - reach, points[c, 2] + reach + 1):
                    p, q, r = i // SIDE, j // SIDE, k // SIDE
                    if not (0 <= p < nx and 0 <= q < ny and 0 <= r < nz):
                        continue
                    b = table[p, q, r]
                    if b < 0:
                        best = min(best, corners[p, q, r])
                    else:
                        at = (i % SIDE * SIDE + j % SIDE) * SIDE + k % SIDE
                        best = min(best, values[b, at])
        out[c] = best
    return out


@kernel
def understate(values: Singles, side: float, corners_only: float) -> None:
    """Subtract the largest error of interpolation between the corners of cells, far from surfaces.

    A distance d to a point curves by 1 / d in two directions, and linear interpolation between
    values `side` apart exceeds it by up to side² / (4 d). Otherwise a ray that advances by the
    distance could pass through something thin. The subtraction begins at 0.8 sides, and is complete
    where only corners are stored, at `corners_only` sides.
    """
    for at in range(len(values)):
        d = values[at]
        if d > 0.8 * side:
            ramp = min((d / side - 0.8) / (corners_only - 0.8), 1.0)
            values[at] = d - ramp * 0.3 * side * side / d


@kernel
def along_x(sites: Floats) -> tuple[Floats, Floats]:
    """Return the minimum and maximum x (m,) of each site."""
    low, high = np.empty(len(sites)), np.empty(len(sites))
    for s in range(len(sites)):
        low[s], high[s] = extent(sites, s, 0)
    return low, high

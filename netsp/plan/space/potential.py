"""Certified lower bounds on the length of the robot's paths between two points.

A *potential* is a function on the water that rises along no path by more than the path's length, so
no path between two points is shorter than the difference of the potential at them. The potential
here is trilinear in each cell of a grid, and covers all cells that are not certain to be blocked: a
passage that may be open is never closed. Fast marching (Sethian 1996) makes it, and overshoots a
little; then its values are lowered until its steepest slope is one. The slope of a trilinear
function is steepest in a corner of a cell. The proof is Proposition 30 of docs/theory.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Singles
from netsp.base.clock import Clock
from netsp.base.compiled.dynamic_array import more_int_rows
from netsp.base.compiled.kernel import kernel
from netsp.base.time_flags import Flag
from netsp.plan.space.mission_policy import PotentialPolicy
from netsp.world.scene.field import DistanceField
from netsp.world.scene.sampling import Field, distance

BOUND_ROUNDING = 1e-9
"""Tolerance for the rounding of lengths: relative reduction of each bound."""

SLOPE_TOLERANCE = 1e-3
"""Tolerance of the potential: largest excess of its steepest slope over one. The bound is divided
by the steepest slope, so the excess weakens the bound by the same share and leaves it correct."""


class Region(NamedTuple):
    """Region that holds all paths a bound is for.

    Attributes
    ----------
    room
        Least distance of the paths from solids, metres.
    bounds
        (2, 3) corners of the box around the paths, metres; infinite if there is none.
    anchor
        (3,) anchor of the tether, metres.
    reach
        Greatest distance of the paths from the anchor, metres; infinite without a tether.
    """

    room: float
    bounds: Floats
    anchor: Floats
    reach: float


class GridBox(NamedTuple):
    """Grid of a potential.

    Attributes
    ----------
    low, high
        (3,) corners of the box, metres; the last cells end at `high`.
    cell
        Size of a cell, metres.
    shape
        Numbers of cells along x, y and z.
    """

    low: Floats
    high: Floats
    cell: float
    shape: tuple[int, int, int]


class Ends(NamedTuple):
    """Ends of the paths that a bound is for.

    Attributes
    ----------
    a, b
        (3,) the two ends, metres.
    longest
        Length of the longest paths, metres.
    """

    a: Floats
    b: Floats
    longest: float


def path_bound(
    field: DistanceField,
    ends: Ends,
    region: Region,
    cells: int,
    policy: PotentialPolicy | None = None,
    clock: Clock | None = None,
) -> float:
    """Return a lower bound on the length of paths between two points, metres; at least their
    distance.

    Parameters
    ----------
    ends : Ends
        The two points, and the upper limit of the bound: the grid covers the ellipsoid about the
        points that holds all paths up to this length.
    region : Region
        Region of the paths; both points are in it.
    cells : int
        Approximate number of cells of the grid.
    clock : Clock, optional
        Clock of the run; when it is up, the bound proven so far is returned.
    """
    policy, clock = policy or PotentialPolicy(), clock or Clock()
    a, b, longest = ends
    straight = float(np.linalg.norm(b - a))
    if not straight < longest < math.inf:
        return straight
    low, high = _box_of_ellipsoid(a, b, longest)
    low, high = np.maximum(low, region.bounds[0]), np.minimum(high, region.bounds[1])
    size = np.maximum(high - low, 1e-9)
    cell = float(np.prod(size) / cells) ** (1.0 / 3.0)
    cell = max(cell, float(size.max()) / 4096.0)
    nx, ny, nz = (max(1, math.ceil(s / cell - 1e-9)) for s in size)
    high = low + size
    flag, steep = clock.flag, steepness(field)
    box = GridBox(low, high, cell, (nx, ny, nz))
    possible = clock.interruptible(
        lambda: possibly_free(field.arrays, box, region, ends, steep, policy.halvings, flag)
    )
    for end in (a, b):
        at = np.clip(((end - low) / cell).astype(np.int64), 0, np.array(possible.shape) - 1)
        possible[tuple(at)] = True
    if clock.is_up:
        return straight
    return max(
        straight,
        clock.interruptible(lambda: _bound_of_potential(possible, box, ends, policy, flag)),
    )


def steepness(field: DistanceField) -> float:
    """Return the largest change of a field over a metre.

    It is 1 for exact solids. Between the points of voxels the field is linear along each axis, so
    the change is at most the root of three times the largest one between two neighbours.
    """
    return 1.0 if field.voxel is None else math.sqrt(3.0) * _steepest_voxels(field)


def _steepest_voxels(field: DistanceField) -> float:
    """Return the steepest slope between neighbours of a voxel grid. It may exceed one a little,
    because the sweeps that fill the grid stop early."""
    grid = field.voxels
    assert grid is not None
    n = int(np.prod(grid.counts))
    parts = [(grid.values[:n].reshape(grid.counts), grid.size)]
    if grid.table is not None:
        from netsp.world.scene.grid import SIDE

        parts.append((grid.values[n:].reshape(-1, SIDE, SIDE, SIDE), grid.voxel))
    maximum = 1.0
    for values, size in parts:
        for axis in range(values.ndim - 3, values.ndim):
            if values.shape[axis] > 1 and values.size:
                maximum = max(maximum, float(np.abs(np.diff(values, axis=axis)).max()) / size)
    return maximum


def _box_of_ellipsoid(a: Floats, b: Floats, longest: float) -> tuple[Floats, Floats]:
    """Return the corners of the box about all points whose distances from both ends sum up to no
    more than `longest`."""
    straight = float(np.linalg.norm(b - a))
    along = (b - a) / max(straight, 1e-300)
    long, wide = 0.5 * longest, 0.5 * math.sqrt(max(longest**2 - straight**2, 0.0))
    half = np.sqrt((long * along) ** 2 + wide**2 * np.maximum(0.0, 1.0 - along**2))
    return 0.5 * (a + b) - half, 0.5 * (a + b) + half


def _bound_of_potential(
    possible: Bools, box: GridBox, ends: Ends, policy: PotentialPolicy, stop: Flag
) -> float:
    """Return the bound of the potential about one end over possibly free cells; 0 if the flag was
    set before one was proven."""
    (a, b, longest), low, cell = ends, box.low, box.cell
    straight = float(np.linalg.norm(b - a))
    from_a, from_b = (distances_of_cells(possible.shape, low, cell, end) for end in (a, b))
    # start from the largest balls around the ends that hold no blocked cell: distances in them are
    # straight
    around = [float(far[~possible].min(initial=straight)) for far in (from_a, from_b)]
    share = min(1.0, max(0.0, straight - 2.0 * cell) / max(sum(around), 1e-300))
    ball_a, ball_b = share * around[0], share * around[1]
    start = _corners(from_a <= ball_a)
    # near `a` the potential is a cone; in a cell at distance d its steepest corner exceeds a slope
    # of one by about half a cell over d, so the cell is slowed by that share from the start
    far = distances_of_corners(possible.shape, low, cell, a)
    begin = (1.0 / (1.0 + 0.5 * cell / np.maximum(far, max(ball_a, cell)))).astype(np.float32)
    maximum = longest - ball_a
    edges = corner_edges(possible)
    slowness, slow_cells = begin.copy(), np.ones(possible.shape, dtype=np.float32)
    u = fast_march(edges, start, cell, slowness, maximum, policy.bucket_cells, stop)
    before_b = _corners((from_b <= ball_b) & possible)
    best = 0.0
    for k in range(2 * policy.rounds):
        if k < policy.rounds:
            for turn in range(16 if k == 0 else 8):
                if stop[0]:
                    return best
                sweep(u, edges, cell, slowness, turn)
            slope = slow_steep_cells(u, possible, cell, slow_cells, begin, slowness)
        else:
            for turn in range(8):
                if stop[0]:
                    return best
                lower_values(u, possible, cell, turn, SLOPE_TOLERANCE)
            slope = steepest(u, possible, cell)
        # after each round, u divided by its steepest slope is a potential
        slope = max(1.0, slope)
        at_b = max(_value(u, low, cell, b) / slope, ball_b + float(u[before_b].min()) / slope)
        best = max(best, ball_a + at_b)
        if slope <= 1.0 + SLOPE_TOLERANCE:
            break
    return min(longest, best) * (1.0 - BOUND_ROUNDING)


def _corners(cells: Bools) -> Bools:
    """Return the mask of the corners of some cells."""
    out = np.zeros(tuple(n + 1 for n in cells.shape), dtype=np.bool_)
    for i, j, k in np.ndindex(2, 2, 2):
        nx, ny, nz = cells.shape
        out[i : i + nx, j : j + ny, k : k + nz] |= cells
    return out


def _value(u: Floats, low: Floats, cell: float, point: Floats) -> float:
    """Return the trilinear value at a point."""
    at = np.clip(((point - low) / cell).astype(np.int64), 0, np.array(u.shape) - 2)
    share = np.clip((point - low) / cell - at, 0.0, 1.0)
    corners = u[at[0] : at[0] + 2, at[1] : at[1] + 2, at[2] : at[2] + 2]
    x, y, z = (np.array([1.0 - s, s]) for s in share)
    return float(np.einsum("i,j,k,ijk", x, y, z, corners))


def distances_of_cells(shape: tuple[int, ...], low: Floats, cell: float, point: Floats) -> Floats:
    """Return the distances (nx, ny, nz) of cells from a point, metres; 0 for the cell that holds
    it."""
    gaps = []
    for axis in range(3):
        begin = low[axis] + cell * np.arange(shape[axis])
        gaps.append(np.maximum(0.0, np.maximum(begin - point[axis], point[axis] - begin - cell)))
    return _hypot3(gaps)


def distances_of_corners(shape: tuple[int, ...], low: Floats, cell: float, point: Floats) -> Floats:
    """Return the distances (nx + 1, ny + 1, nz + 1) of the corners of cells from a point,
    metres."""
    return _hypot3([low[k] + cell * np.arange(shape[k] + 1) - point[k] for k in range(3)])


def _hypot3(parts: list[Floats]) -> Floats:
    x, y, z = parts
    return np.asarray(
        np.sqrt((x**2)[:, None, None] + (y**2)[None, :, None] + (z**2)[None, None, :])
    )


@kernel
def may_have_room(
    field: Field, centre: Floats, halves: Floats, room: float, steep: float, halvings: int
) -> bool:
    """Return whether some point of a box may be as far from solids as `room`; false only if it is
    certain that no point is.

    Parameters
    ----------
    centre
        (3,) centre of the box, metres.
    halves
        (3,) half lengths of its sides, metres.
    steep
        Largest change of the field over a metre.
    halvings
        Largest number of times that the box is divided.
    """
    parts, left = np.empty((7 * halvings + 8, 5)), 1
    for axis in range(3):
        parts[0, axis] = centre[axis]
    parts[0, 3], parts[0, 4] = 1.0, halvings
    reach = 1.00001 * steep * math.sqrt(halves[0] ** 2 + halves[1] ** 2 + halves[2] ** 2)
    while left > 0:
        left -= 1
        x, y, z, share, left_halvings = parts[left]
        d = distance(field, x, y, z)
        if d >= room:
            return True
        if d + share * reach < room:
            continue
        if left_halvings == 0.0:
            return True
        share *= 0.5
        for k in range(8):
            parts[left, 0] = x + share * (halves[0] if k & 1 else -halves[0])
            parts[left, 1] = y + share * (halves[1] if k & 2 else -halves[1])
            parts[left, 2] = z + share * (halves[2] if k & 4 else -halves[2])
            parts[left, 3], parts[left, 4] = share, left_halvings - 1.0
            left += 1
    return False


@kernel
def possibly_free(
    field: Field, box: GridBox, region: Region, ends: Ends, steep: float, halvings: int, stop: Flag
) -> Bools:
    """Return the mask of the cells that paths between two ends may pass.

    A cell is left out if it is certain that none of its points has enough room and lies within the
    box, the ellipsoid about both ends and the reach of the tether. Once the flag `stop` is set, the
    remaining cells count as possibly free.
    """
    low, high, cell = box.low, box.high, box.cell
    a, b, anchor, room = ends.a, ends.b, region.anchor, region.room
    nx, ny, nz = box.shape
    out = np.zeros((nx, ny, nz), dtype=np.bool_)
    centre, halves, at = np.empty(3), np.empty(3), np.empty(3, dtype=np.int64)
    for i in range(nx):
        for j in range(ny):
            if stop[0]:
                out[i, j:] = True
                out[i + 1 :] = True
                return out
            for k in range(nz):
                at[0], at[1], at[2] = i, j, k
                from_a, from_b, from_anchor, diagonal = 0.0, 0.0, 0.0, 0.0
                for axis in range(3):
                    begin = low[axis] + at[axis] * cell
                    halves[axis] = 0.5 * min(cell, high[axis] - begin)
                    centre[axis] = begin + halves[axis]
                    from_a += (centre[axis] - a[axis]) ** 2
                    from_b += (centre[axis] - b[axis]) ** 2
                    from_anchor += (centre[axis] - anchor[axis]) ** 2
                    diagonal += halves[axis] ** 2
                diagonal = 1.00001 * math.sqrt(diagonal)
                if math.sqrt(from_a) + math.sqrt(from_b) > ends.longest + 2.0 * diagonal:
                    continue
                if math.sqrt(from_anchor) > region.reach + diagonal:
                    continue
                out[i, j, k] = may_have_room(field, centre, halves, room, steep, halvings)
    return out


@kernel
def corner_edges(possible: Bools) -> npt.NDArray[np.uint8]:
    """Return three bits for each corner: whether its edge in positive direction along x, y, z
    belongs to a cell that is possibly free."""
    nx, ny, nz = possible.shape
    out = np.zeros((nx + 1, ny + 1, nz + 1), dtype=np.uint8)
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if possible[i, j, k]:
                    for m in range(2):
                        for n in range(2):
                            out[i, j + m, k + n] |= 1
                            out[i + m, j, k + n] |= 2
                            out[i + m, j + n, k] |= 4
    return out


@kernel
def upwind_value(
    u: Floats, edges: npt.NDArray[np.uint8], p: int, q: int, r: int, step: float
) -> float:
    """Return the value of a corner from its neighbours' values, upwind (Godunov's scheme)."""
    x, y, z = math.inf, math.inf, math.inf
    bits = edges[p, q, r]
    if bits & 1:
        x = u[p + 1, q, r]
    if p > 0 and edges[p - 1, q, r] & 1:
        x = min(x, u[p - 1, q, r])
    if bits & 2:
        y = u[p, q + 1, r]
    if q > 0 and edges[p, q - 1, r] & 2:
        y = min(y, u[p, q - 1, r])
    if bits & 4:
        z = u[p, q, r + 1]
    if r > 0 and edges[p, q, r - 1] & 4:
        z = min(z, u[p, q, r - 1])
    if x > y:
        x, y = y, x
    if y > z:
        y, z = z, y
    if x > y:
        x, y = y, x
    value = x + step
    if value > y:
        value = 0.5 * (x + y + math.sqrt(2.0 * step * step - (x - y) ** 2))
        if value > z:
            whole = x + y + z
            root = whole * whole - 3.0 * (x * x + y * y + z * z - step * step)
            value = (whole + math.sqrt(max(root, 0.0))) / 3.0
    return value


@kernel
def fast_march(
    edges: npt.NDArray[np.uint8],
    start: Bools,
    cell: float,
    slowness: Singles,
    maximum: float,
    bucket_cells: float,
    stop: Flag,
) -> Floats:
    """Return the distances of corners from `start` by fast marching, with a queue of buckets.

    Distances are cut off at `maximum`. Once the flag `stop` is set, they are incomplete.
    """
    nx, ny, nz = edges.shape
    u, done = np.full((nx, ny, nz), np.inf), np.zeros((nx, ny, nz), dtype=np.bool_)
    width = bucket_cells * cell
    buckets = int(maximum / width) + 3
    first = np.full(buckets, -1)
    entries, count = np.empty((4096, 2), dtype=np.int64), 0
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if start[i, j, k]:
                    u[i, j, k] = 0.0
                    if count == len(entries):
                        entries = more_int_rows(entries)
                    entries[count, 0], entries[count, 1] = (i * ny + j) * nz + k, first[0]
                    first[0] = count
                    count += 1
    now = 0
    while now < buckets and not stop[0]:
        entry = first[now]
        if entry < 0:
            now += 1
            continue
        first[now] = entries[entry, 1]
        at = entries[entry, 0]
        i, j, k = at // (ny * nz), at // nz % ny, at % nz
        if done[i, j, k]:
            continue
        done[i, j, k] = True
        for side in range(6):
            axis, sign = side // 2, 2 * (side % 2) - 1
            p, q, r = i + sign * (axis == 0), j + sign * (axis == 1), k + sign * (axis == 2)
            if p < 0 or q < 0 or r < 0 or p >= nx or q >= ny or r >= nz or done[p, q, r]:
                continue
            joined = edges[i, j, k] if sign > 0 else edges[p, q, r]
            if not joined & (1 << axis):
                continue
            value = upwind_value(u, edges, p, q, r, cell * slowness[p, q, r])
            if value < u[p, q, r]:
                u[p, q, r] = value
                bucket = max(now, int(value / width))
                if bucket < buckets:
                    if count == len(entries):
                        entries = more_int_rows(entries)
                    entries[count, 0], entries[count, 1] = (p * ny + q) * nz + r, first[bucket]
                    first[bucket] = count
                    count += 1
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                u[i, j, k] = min(u[i, j, k], maximum)
    return u


@kernel
def sweep(
    u: Floats, edges: npt.NDArray[np.uint8], cell: float, slowness: Singles, turn: int
) -> None:
    """Lower each value to the one that its neighbours give, in one of eight diagonal orders (fast
    sweeping, Zhao 2004)."""
    nx, ny, nz = u.shape
    for a in range(nx):
        i = a if turn & 1 == 0 else nx - 1 - a
        for b in range(ny):
            j = b if turn & 2 == 0 else ny - 1 - b
            for c in range(nz):
                k = c if turn & 4 == 0 else nz - 1 - c
                if u[i, j, k] > 0.0:
                    value = upwind_value(u, edges, i, j, k, cell * slowness[i, j, k])
                    u[i, j, k] = min(u[i, j, k], value)


@kernel
def steepest_slope(u: Floats, i: int, j: int, k: int, cell: float) -> float:
    """Return the steepest slope of the trilinear function of a cell. The square of its gradient is
    convex along each axis, so it is largest in a corner, where three edges give the gradient."""
    maximum = 0.0
    for n in range(8):
        p, q, r = n & 1, n >> 1 & 1, n >> 2
        corner_value = u[i + p, j + q, k + r]
        square = (
            (u[i + 1 - p, j + q, k + r] - corner_value) ** 2
            + (u[i + p, j + 1 - q, k + r] - corner_value) ** 2
            + (u[i + p, j + q, k + 1 - r] - corner_value) ** 2
        )
        maximum = max(maximum, square)
    return math.sqrt(maximum) / cell


@kernel
def steepest(u: Floats, possible: Bools, cell: float) -> float:
    """Return the steepest slope in any cell that is possibly free."""
    nx, ny, nz = possible.shape
    maximum = 0.0
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if possible[i, j, k]:
                    maximum = max(maximum, steepest_slope(u, i, j, k, cell))
    return maximum


@kernel
def slow_steep_cells(
    u: Floats, possible: Bools, cell: float, slow_cells: Singles, begin: Singles, slowness: Singles
) -> float:
    """Slow the corners of cells with too steep a slope, and return the steepest slope."""
    nx, ny, nz = possible.shape
    maximum = 0.0
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if not possible[i, j, k]:
                    continue
                slope = steepest_slope(u, i, j, k, cell)
                maximum = max(maximum, slope)
                if slope > 1.0:
                    # slow a little more than needed, because exact steps would take many rounds
                    slow_cells[i, j, k] /= slope * (1.0 + 3.0 * SLOPE_TOLERANCE)
                factor = slow_cells[i, j, k]
                if factor < 1.0:
                    for n in range(8):
                        p, q, r = i + (n & 1), j + (n >> 1 & 1), k + (n >> 2)
                        slowness[p, q, r] = min(slowness[p, q, r], factor * begin[p, q, r])
    return maximum


@kernel
def lower_values(u: Floats, possible: Bools, cell: float, turn: int, tolerance: float) -> None:
    """Lower values in one sweep over all cells, in one of eight orders, so that no corner of a cell
    has too steep a slope."""
    nx, ny, nz = possible.shape
    limit = cell * cell
    for a in range(nx):
        i = a if turn & 1 == 0 else nx - 1 - a
        for b in range(ny):
            j = b if turn & 2 == 0 else ny - 1 - b
            for c in range(nz):
                k = c if turn & 4 == 0 else nz - 1 - c
                if possible[i, j, k]:
                    for n in range(8):
                        lower_corner(u, i, j, k, n, limit, tolerance)


@kernel
def lower_corner(u: Floats, i: int, j: int, k: int, n: int, limit: float, tolerance: float) -> None:
    """Lower a corner of a cell or its three neighbours in the cell, so that the slope there is at
    most one."""
    p, q, r = n & 1, n >> 1 & 1, n >> 2
    places = np.empty((3, 3), dtype=np.int64)
    for axis in range(3):
        places[axis, 0], places[axis, 1], places[axis, 2] = i + p, j + q, k + r
    places[0, 0], places[1, 1], places[2, 2] = i + 1 - p, j + 1 - q, k + 1 - r
    corner_value = u[i + p, j + q, k + r]
    up, down, below, sum_below, squares_below = 0.0, 0.0, 0, 0.0, 0.0
    for m in range(3):
        value = u[places[m, 0], places[m, 1], places[m, 2]]
        if value < corner_value:
            down += (corner_value - value) ** 2
            below, sum_below = below + 1, sum_below + value
            squares_below += value * value
        else:
            up += (value - corner_value) ** 2
    if up + down <= limit * (1.0 + tolerance):
        return
    share = 0.0
    if down >= limit:
        root = sum_below * sum_below - below * (squares_below - limit)
        corner_value = min(corner_value, (sum_below + math.sqrt(max(root, 0.0))) / below)
        u[i + p, j + q, k + r] = corner_value
    else:
        share = math.sqrt((limit - down) / up)
    for m in range(3):
        x, y, z = places[m, 0], places[m, 1], places[m, 2]
        if u[x, y, z] > corner_value:
            u[x, y, z] = corner_value + share * (u[x, y, z] - corner_value)


def cells_at_level(level: int, policy: PotentialPolicy) -> int:
    """Return the number of cells of the grid of a level, from 1 on; at most `max_cells`."""
    return min(policy.max_cells, policy.min_cells * int(policy.growth ** (level - 1)))

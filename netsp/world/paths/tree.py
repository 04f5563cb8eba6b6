"""Shortest paths to one place from all others: a tree on a grid, and its paths pulled taut.

One tree serves all pivots of a recovery. A path along the grid, which has 26 directions, is up to
8 % too long; pulled taut like a tether, it is the shortest of its class at the clearance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from typing import Protocol

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.bounded_work import abandoned, end_if_abandoned
from netsp.base.compiled.compile_policy import current_policy
from netsp.base.compiled.dynamic_array import more_int_rows
from netsp.base.compiled.interpretation import interprets
from netsp.base.compiled.kernel import kernel
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.base.time_flags import Flag
from netsp.world.paths.path_policy import PathPolicy
from netsp.world.scene.field import DistanceField
from netsp.world.scene.point_batches import distances
from netsp.world.scene.sampling import Field, distance, lowest_along, lowest_along_each
from netsp.world.tether.geodesic import GeodesicTether


class Grid:
    """Grid of the free cells of a box in a scene.

    Parameters
    ----------
    low, high
        Corners (3,) of the box, metres.
    cell
        Cell size, metres.
    clearance
        Minimum distance of the centre of a free cell from solids, metres.

    Raises
    ------
    InputError
        The box has no size, or more cells than the policy allows.
    """

    def __init__(
        self,
        field: DistanceField,
        low: npt.ArrayLike,
        high: npt.ArrayLike,
        cell: float,
        clearance: float,
        policy: PathPolicy = PathPolicy(),
    ) -> None:
        self.field, self.cell, self.clearance, self.policy = field, cell, clearance, policy
        self.low = np.asarray(low, dtype=float)
        size = np.asarray(high, dtype=float) - self.low
        if not (size > 0.0).all():
            raise InputError(f"bounds: expected a box, got sides {size.tolist()}")
        shape = np.maximum(1, np.round(size / cell)).astype(int)
        if float(np.prod(shape.astype(float))) > policy.max_cells:
            better = cell * (float(np.prod(shape.astype(float))) / policy.max_cells) ** (1.0 / 3.0)
            raise InputError(
                f"cell: {cell:g} makes {' x '.join(map(str, shape))} cells; expected {better:.2g} "
                "or more"
            )
        counts = (int(shape[0]), int(shape[1]), int(shape[2]))
        self.free = free_cells(field.arrays, self.low, cell, counts, clearance, abandoned())
        end_if_abandoned()
        self._states: npt.NDArray[np.uint8] | None = None
        self._kept: dict[tuple[int, ...], npt.NDArray[np.int8]] = {}

    def prepare(self, targets: Sequence[Floats]) -> int:
        """Cache shortest-path trees to targets (3,), and return how many fit in the policy's
        memory.

        Shortest paths depend on the map only, so they can be found before the robot needs one.
        """
        for target in targets:
            root = self.nearest_free_cell(target)
            if root is None or tuple(root) in self._kept:
                continue
            if (len(self._kept) + 1) * self.free.size > self.policy.max_tree_bytes:
                break
            nowhere = np.full((1, 3), -1)
            self._kept[tuple(root)] = grow(self.states, root, nowhere)
        return len(self._kept)

    def tree_to(self, root: Ints, wanted: Ints) -> npt.NDArray[np.int8]:
        """Return the step towards the root from the wanted cells (n, 3), and from all cells on the
        way there; see `grow`."""
        kept = self._kept.get(tuple(root))
        if kept is not None:
            if all(
                kept[tuple(cell)] < 0 or self.free[tuple(tree_path(kept, cell).T)].all()
                for cell in wanted
            ):
                return kept
            del self._kept[tuple(root)]  # a new solid blocks the target
        return grow(self.states, root, wanted)

    def with_changed_box(self, field: DistanceField, box: Floats) -> Grid:
        """Return the same cells in a scene that differs within a box (2, 3)."""
        room = self.clearance + self.cell
        first, last = self.index(box[0] - room), self.index(box[1] + room) + 1
        nx, ny, nz = (int(s) for s in last - first)
        new = copy(self)
        new.field, new.free, new._states = field, self.free.copy(), None
        low, part = self.low + self.cell * first, (nx, ny, nz)
        new.free[tuple(slice(a, b) for a, b in zip(first, last, strict=True))] = free_cells(
            field.arrays, low, self.cell, part, self.clearance, abandoned()
        )
        end_if_abandoned()
        if (new.free & ~self.free).any():
            # paths may get shorter; without new free cells, paths that stay free stay shortest
            new._kept = {}
        else:
            new._kept = dict(self._kept)
        return new

    @property
    def states(self) -> npt.NDArray[np.uint8]:
        """States of the cells, see `states_of`."""
        if self._states is None:
            self._states = states_of(self.free)
        return self._states

    def index(self, points: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """Return the cells (..., 3) of points (..., 3), the nearest ones within the box."""
        cells = np.floor((np.asarray(points, dtype=float) - self.low) / self.cell).astype(np.int64)
        return np.asarray(np.clip(cells, 0, np.array(self.free.shape) - 1))

    def centre(self, cells: npt.ArrayLike) -> Floats:
        """Return the centres (..., 3) of cells (..., 3)."""
        return np.asarray(self.low + (np.asarray(cells) + 0.5) * self.cell)

    def nearest_free_cell(self, point: npt.ArrayLike) -> npt.NDArray[np.int64] | None:
        """Return the nearest free cell within three cells that a point sees; None if there is
        none."""
        p = np.asarray(point, dtype=float)
        at = self.index(p)
        if self.free[tuple(at)]:
            return at
        reach = np.arange(-3, 4)
        around = at + np.stack(np.meshgrid(reach, reach, reach, indexing="ij"), -1).reshape(-1, 3)
        around = around[((around >= 0) & (around < self.free.shape)).all(1)]
        around = around[self.free[tuple(around.T)]]
        far = np.linalg.norm(self.centre(around) - p, axis=1)
        for k in np.argsort(far):
            if self.field.line_of_sight(p, self.centre(around[k]), depth=1e-3 * self.cell):
                return np.asarray(around[k])
        return None


class Paths(Protocol):
    """Protocol of short paths to one target from given points."""

    def path(self, n: int) -> Floats | None:
        """Return the path (k, 3) from point n to the target; None if there is none."""


class ShortestTree:
    """Shortest-path tree that leads from points (n, 3) to a target (3,).

    It grows until it contains all points, unless `Grid.prepare` has cached it.
    """

    def __init__(self, grid: Grid, target: npt.ArrayLike, points: npt.ArrayLike) -> None:
        self.grid, self.target = grid, np.asarray(target, dtype=float)
        self.points = np.asarray(points, dtype=float).reshape(-1, 3)
        root = grid.nearest_free_cell(self.target)
        self._cells = [None if root is None else grid.nearest_free_cell(p) for p in self.points]
        if root is not None:
            wanted = np.array([c for c in self._cells if c is not None], dtype=np.int64)
            self._toward = grid.tree_to(root, wanted.reshape(-1, 3))

    def path(self, n: int) -> Floats | None:
        """Return the path (k, 3) from point n to the target along the grid; None if there is
        none."""
        cell = self._cells[n]
        if cell is None or self._toward[tuple(cell)] < 0:
            return None
        cells = tree_path(self._toward, cell)
        return np.vstack([self.points[n], self.grid.centre(cells), self.target])


STEPS = np.array([s for s in np.ndindex(3, 3, 3) if s != (1, 1, 1)], dtype=np.int64) - 1
_LONG = np.sqrt((STEPS**2).sum(1).astype(float))


def _onward() -> Ints:
    """Return for each step the number of steps that may follow it in open water, and these (26, 8).

    They go on along some of its axes. All other neighbours are reached on paths of the same length
    through other cells: this is the canonical order of jump point search (Harabor & Grastien 2011),
    in space.
    """
    out = np.zeros((26, 8), dtype=np.int64)
    for s, step in enumerate(STEPS):
        on = [t for t, next_ in enumerate(STEPS) if all(next_[next_ != 0] == step[next_ != 0])]
        out[s, 0], out[s, 1 : 1 + len(on)] = len(on), on
    return out


ONWARD = _onward()

BLOCKED, FREE, OPEN = range(3)
"""Codes of a cell: its centre is blocked, is free, or is free like all its 26 neighbours."""


@kernel
def free_cells(
    field: Field,
    low: Floats,
    cell: float,
    shape: tuple[int, int, int],
    clearance: float,
    stop: Flag,
) -> Bools:
    """Return the mask of the cells of a grid whose centres keep the clearance from all solids.

    The mask is incomplete if `stop` is set meanwhile.
    """
    out = np.zeros(shape, dtype=np.bool_)
    for i in range(shape[0]):
        if stop[0] != 0:
            break
        for j in range(shape[1]):
            for k in range(shape[2]):
                out[i, j, k] = (
                    distance(
                        field,
                        low[0] + (i + 0.5) * cell,
                        low[1] + (j + 0.5) * cell,
                        low[2] + (k + 0.5) * cell,
                    )
                    >= clearance
                )
    return out


@interprets(free_cells)
def _free_cells_in_numpy(
    field: Field,
    low: Floats,
    cell: float,
    shape: tuple[int, int, int],
    clearance: float,
    stop: Flag,
) -> Bools:
    """Vectorise `free_cells` over blocks of layers of cells."""
    out = np.zeros(shape, dtype=np.bool_)
    x, y, z = (low[axis] + (np.arange(shape[axis]) + 0.5) * cell for axis in range(3))
    layers = max(1, current_policy().numpy_chunk_items // max(1, shape[1] * shape[2]))
    for i in range(0, shape[0], layers):
        if stop[0] != 0:
            break
        centres = (v.ravel() for v in np.meshgrid(x[i : i + layers], y, z, indexing="ij"))
        far = distances(field.data, field.offset, *centres)
        out[i : i + layers] = (far >= clearance).reshape(-1, *shape[1:])
    return out


@kernel
def states_of(free: Bools) -> npt.NDArray[np.uint8]:
    """Return the codes (nx + 2, ny + 2, nz + 2) of cells, with a blocked border.

    With the border, each cell has all 26 neighbours, at constant offsets in memory.
    """
    nx, ny, nz = free.shape
    out = np.zeros((nx + 2, ny + 2, nz + 2), dtype=np.uint8)
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if free[i, j, k]:
                    out[i + 1, j + 1, k + 1] = FREE
    for i in range(1, nx + 1):
        for j in range(1, ny + 1):
            for k in range(1, nz + 1):
                about = out[i, j, k]
                for s in range(26):
                    if out[i + STEPS[s, 0], j + STEPS[s, 1], k + STEPS[s, 2]] == BLOCKED:
                        about = BLOCKED
                        break
                if about != BLOCKED:
                    out[i, j, k] = OPEN
    return out


@interprets(states_of)
def _states_of_in_numpy(free: Bools) -> npt.NDArray[np.uint8]:
    """Vectorise `states_of` over all cells."""
    bordered = np.pad(free, 1)
    is_open = bordered
    for axis in range(3):
        ends = [np.take(is_open, range(k, is_open.shape[axis] - 2 + k), axis) for k in range(3)]
        is_open = ends[0] & ends[1] & ends[2]
    out = np.where(bordered, np.uint8(FREE), np.uint8(BLOCKED))
    out[1:-1, 1:-1, 1:-1][is_open] = OPEN
    return out


@kernel
def grow(states: npt.NDArray[np.uint8], root: Ints, wanted: Ints) -> npt.NDArray[np.int8]:
    """Return shortest paths to the root from cells around it, until all wanted cells are settled.

    Cells wait in buckets by the integer part of their distance. No step is shorter than 1, so the
    cells of the first bucket can be settled in any order (Dial 1969; Denardo & Fox 1979); each step
    is shorter than 2, so three buckets suffice. In open water only the steps of `_onward` are
    tried.

    Parameters
    ----------
    states
        Codes of `states_of`.
    root, wanted
        Cells (3,) and (n, 3); (-1, -1, -1) is never settled.

    Returns
    -------
    toward
        Step (nx, ny, nz) towards the root, 26 at the root, and -1 where unknown or without a path.
    """
    row = states.shape[2]
    plane = states.shape[1] * row
    offset = np.empty(26, dtype=np.int64)
    for s in range(26):
        offset[s] = STEPS[s, 0] * plane + STEPS[s, 1] * row + STEPS[s, 2]
    state = states.copy().reshape(states.size)
    lengths, toward = np.full(states.size, np.inf), np.full(states.size, -1, dtype=np.int8)
    is_wanted, left = np.zeros(states.size, dtype=np.bool_), 0
    cells = np.empty(len(wanted), dtype=np.int64)
    for w in range(len(wanted)):
        cells[w] = (wanted[w, 0] + 1) * plane + (wanted[w, 1] + 1) * row + wanted[w, 2] + 1
        left += 0 if is_wanted[cells[w]] else 1
        is_wanted[cells[w]] = True
    # (cell, the next entry of its bucket)
    waiting, count = np.empty((4096, 2), dtype=np.int64), 1
    first = np.full(3, -1)
    begin = (root[0] + 1) * plane + (root[1] + 1) * row + root[2] + 1
    lengths[begin], toward[begin] = 0.0, 26
    waiting[0, 0], waiting[0, 1] = begin, -1
    first[0], floor = 0, 0
    while left > 0 and (first[0] >= 0 or first[1] >= 0 or first[2] >= 0):
        entry = first[floor % 3]
        first[floor % 3] = -1
        while entry >= 0:
            cell = waiting[entry, 0]
            entry = waiting[entry, 1]
            if state[cell] == BLOCKED:
                continue  # settled
            reverse = 25 - toward[cell]
            all_of_them = reverse < 0 or state[cell] != OPEN
            state[cell] = BLOCKED
            if is_wanted[cell]:
                left -= 1
            length = lengths[cell]
            for n in range(26 if all_of_them else ONWARD[reverse, 0]):
                s = n if all_of_them else ONWARD[reverse, n + 1]
                neighbour = cell + offset[s]
                if state[neighbour] == BLOCKED:
                    continue
                onward = length + _LONG[s]
                if onward < lengths[neighbour]:
                    lengths[neighbour] = onward
                    toward[neighbour] = 25 - s  # the opposite step
                    if count == len(waiting):
                        waiting = more_int_rows(waiting)
                    bucket = int(onward) % 3
                    waiting[count, 0], waiting[count, 1] = neighbour, first[bucket]
                    first[bucket] = count
                    count += 1
        floor += 1
    return toward.reshape(states.shape)[1:-1, 1:-1, 1:-1]


@interprets(grow)
def _grow_in_numpy(states: npt.NDArray[np.uint8], root: Ints, wanted: Ints) -> npt.NDArray[np.int8]:
    """Vectorise `grow` over the cells of a bucket.

    Cells of one bucket do not affect each other, so their order matters only if two paths to a cell
    have the same length: the first one wins. `grow` reads a bucket backwards, so the last entry of
    a cell counts.
    """
    shape = np.array(states.shape)
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    offset, size = STEPS @ strides, states.size
    state = states.flatten()
    lengths, toward = np.full(size, np.inf), np.full(size, -1, dtype=np.int8)
    is_wanted, place = np.zeros(size, dtype=np.bool_), np.empty(size, dtype=np.int64)

    def first_of_each(cells: Ints) -> Bools:
        numbers = np.arange(len(cells))
        place[cells[::-1]] = numbers[::-1]
        return np.asarray(place[cells] == numbers)

    is_wanted[(wanted + 1) @ strides] = True
    left = np.count_nonzero(is_wanted)
    begin = (root + 1) @ strides
    lengths[begin], toward[begin] = 0.0, 26
    waiting: list[list[Ints]] = [[np.array([begin])], [], []]
    floor = 0
    while left > 0 and any(waiting):
        entries, waiting[floor % 3] = waiting[floor % 3], []
        floor += 1
        if not entries:
            continue
        cells = np.concatenate(entries)[::-1]
        cells = cells[state[cells] != BLOCKED]
        cells = cells[first_of_each(cells)]
        reverse = 25 - toward[cells].astype(np.int64)
        steps = np.where((reverse < 0) | (state[cells] != OPEN), 26, reverse)
        state[cells] = BLOCKED
        left -= np.count_nonzero(is_wanted[cells])
        counts = _NEXT_COUNTS[steps]
        nth = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        step = _NEXT_STEPS[np.repeat(steps, counts), nth]
        neighbours = np.repeat(cells, counts) + offset[step]
        onward = np.repeat(lengths[cells], counts) + _LONG[step]
        is_shorter = (state[neighbours] != BLOCKED) & (onward < lengths[neighbours])
        neighbours, onward, step = neighbours[is_shorter], onward[is_shorter], step[is_shorter]
        np.minimum.at(lengths, neighbours, onward)
        is_shortest = onward == lengths[neighbours]
        neighbours, onward, step = neighbours[is_shortest], onward[is_shortest], step[is_shortest]
        is_first = first_of_each(neighbours)
        neighbours, onward, step = neighbours[is_first], onward[is_first], step[is_first]
        toward[neighbours] = 25 - step
        bucket = onward.astype(np.int64) % 3
        for k in range(3):
            if len(entering := neighbours[bucket == k]):
                waiting[k].append(entering)
    return toward.reshape(states.shape)[1:-1, 1:-1, 1:-1]


_NEXT_COUNTS = np.append(ONWARD[:, 0], 26)
"""Number of next steps that `grow` tries after each step; the last entry is for trying all."""

_NEXT_STEPS = np.zeros((27, 26), dtype=np.int64)
"""Next steps that `grow` tries after each step, a row for each step; the last row has all steps."""
_NEXT_STEPS[:26, : ONWARD.shape[1] - 1], _NEXT_STEPS[26] = ONWARD[:, 1:], np.arange(26)


@kernel
def tree_path(toward: npt.NDArray[np.int8], start: Ints) -> Ints:
    """Return the cells (k, 3) from a cell of the tree to the root, including both."""
    out, count = np.empty((64, 3), dtype=np.int64), 1
    # axis by axis, because assigning a row would compile NumPy's error messages
    for axis in range(3):
        out[0, axis] = start[axis]
    while True:
        step = toward[out[count - 1, 0], out[count - 1, 1], out[count - 1, 2]]
        if step >= 26:
            return out[:count].copy()
        if count == len(out):
            out = more_int_rows(out)
        for axis in range(3):
            out[count, axis] = out[count - 1, axis] + STEPS[step, axis]
        count += 1


@interprets(tree_path)
def _tree_path_in_python(toward: npt.NDArray[np.int8], start: Ints) -> Ints:
    """Compute `tree_path` with Python's integers, which the interpreter handles faster."""
    i, j, k = start.tolist()
    out, steps = [(i, j, k)], STEPS.tolist()
    while (step := toward.item(i, j, k)) < 26:
        di, dj, dk = steps[step]
        i, j, k = i + di, j + dj, k + dk
        out.append((i, j, k))
    return np.array(out, dtype=np.int64)


def pull_taut(
    field: DistanceField,
    path: Floats,
    clearance: float,
    delta: float,
    policy: PathPolicy = PathPolicy(),
) -> Floats:
    """Return a path (k, 3) pulled taut in its class.

    It keeps the clearance from solids, or as much as its ends have. Its points are so dense that
    straight lines between them keep it, too.
    """
    grown, room = _grown(field, path, clearance, delta)
    line = _shortcut(grown, path, max(room, delta))
    # grown solids are at least twice as thick as the growth, so a coarser delta misses none
    for share in (1.0, 0.5):
        line = _relaxed(grown, line, max(delta, share * room), policy.pull_rounds)
    return line[np.r_[True, np.linalg.norm(np.diff(line, axis=0), axis=1) > 1e-9]]


def pull_roughly_taut(
    field: DistanceField,
    path: Floats,
    clearance: float,
    delta: float,
    policy: PathPolicy = PathPolicy(),
) -> Floats:
    """Return a path pulled nearly taut, in a tenth of the time of `pull_taut`."""
    grown, room = _grown(field, path, clearance, delta)
    step = max(room, delta)
    return _relaxed(grown, _shortcut(grown, path, step), step, policy.rough_pull_rounds)


def pull_in_stages(
    field: DistanceField,
    path: Floats,
    clearance: float,
    delta: float,
    policy: PathPolicy = PathPolicy(),
) -> Iterator[Floats]:
    """Yield a path, then ever tauter paths of its class."""
    yield path
    grown, room = _grown(field, path, clearance, delta)
    step = max(room, delta)
    path = _shortcut(grown, path, step)
    for _ in range(policy.pull_stages):
        yield path
        path = _relaxed(grown, path, step, policy.rough_pull_rounds)


def _grown(
    field: DistanceField, path: Floats, clearance: float, delta: float
) -> tuple[DistanceField, float]:
    """Return the field grown by the clearance, or by less if the ends of a path have less, and the
    growth in metres."""
    ends = field.distance(path[[0, -1]])
    room = max(0.0, min(clearance, float(ends.min()) - 1e-3 * delta))
    return field.grown(room), room


def _shortcut(grown: DistanceField, line: Floats, step: float) -> Floats:
    for _ in range(2):
        k = 2 + int(polylines.length(line) / step)
        line = shortcut(grown.arrays, _shares(line, k), 0.1 * step)[::-1]
    return line


def _relaxed(grown: DistanceField, line: Floats, delta: float, rounds: int) -> Floats:
    return GeodesicTether(grown, delta).pulled(line, rounds)


@kernel
def shortcut(field: Field, path: Floats, tolerance: float) -> Floats:
    """Return a path with fewer points: each leads straight to the last of the points that it sees
    in a row.

    The triangles that the path sweeps are as wide as its points are apart, so it passes over
    nothing wider.
    """
    out = np.empty_like(path)
    for axis in range(3):  # see `tree_path`
        out[0, axis] = path[0, axis]
    count, i = 1, 0
    while i < len(path) - 1:
        j = i + 1
        while j + 1 < len(path):
            low, _ = lowest_along(
                field,
                path[i, 0],
                path[i, 1],
                path[i, 2],
                path[j + 1, 0],
                path[j + 1, 1],
                path[j + 1, 2],
                tolerance,
            )
            if low < -tolerance:
                break
            j += 1
        for axis in range(3):
            out[count, axis] = path[j, axis]
        count += 1
        i = j
    return out[:count].copy()


def are_homotopic(field: DistanceField, a: Floats, b: Floats, step: float) -> bool:
    """Return whether two paths between the same ends certainly belong to one class.

    Pairs of points at the same share of both paths, in steps of at most `step`, must see each
    other. Then nothing wider than `step` can stand between the paths.
    """
    k = 2 + int(max(polylines.length(a), polylines.length(b)) / step)
    return bool(are_all_in_sight(field.arrays, _shares(a, k), _shares(b, k), 0.1 * step))


def _shares(path: Floats, k: int) -> Floats:
    s = polylines.along(path)
    u = np.linspace(0.0, s[-1], k)
    return np.column_stack([np.interp(u, s, path[:, axis]) for axis in range(3)])


@kernel
def are_all_in_sight(field: Field, a: Floats, b: Floats, step: float) -> bool:
    """Return whether all pairs a[k], b[k] of points (n, 3) see each other, in steps of `step`."""
    for k in range(len(a)):
        low, _ = lowest_along(field, a[k, 0], a[k, 1], a[k, 2], b[k, 0], b[k, 1], b[k, 2], step)
        if low < 0.0:
            return False
    return True


@interprets(are_all_in_sight)
def _all_see_in_numpy(field: Field, a: Floats, b: Floats, step: float) -> bool:
    """Vectorise `are_all_in_sight` over all segments."""
    return not (lowest_along_each(field, a, b, step) < 0.0).any()

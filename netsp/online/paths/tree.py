"""Shortest paths to one place from everywhere: a tree on a grid, and its paths pulled taut.

The tree serves every pivot of a recovery at once. A path along the grid is up to 8 % longer than it
need be (26 directions); pulled taut as a tether it is the shortest of its class, at the clearance.
"""

from __future__ import annotations

import heapq
from typing import Protocol

import numpy as np
import numpy.typing as npt

from netsp.arrays import Bools, Floats, Ints
from netsp.compiled.kernel import kernel
from netsp.errors import InputError
from netsp.geometry import polylines
from netsp.online.scene.field import DistanceField
from netsp.online.scene.sampling import Field, distance, lowest_along
from netsp.online.tether.geodesic import GeodesicTether

MOST_CELLS = 20_000_000
"""So many cells take about 0.3 GiB."""


ROUNDS = 60
"""A path need not be taut to the last millimetre."""


class Grid:
    """Free cells of a box in a scene.

    Parameters
    ----------
    field
        The scene.
    low, high
        (3,) corners of the box.
    cell
        Metres.
    clearance
        A cell is free when its centre is at least this far from every solid, metres.

    Raises
    ------
    InputError
        A box without size, or more than 20 million cells.
    """

    def __init__(
        self, field: DistanceField, low: npt.ArrayLike, high: npt.ArrayLike, cell: float,
        clearance: float,
    ) -> None:  # fmt: skip
        self.field, self.cell, self.clearance = field, cell, clearance
        self.low = np.asarray(low, dtype=float)
        size = np.asarray(high, dtype=float) - self.low
        if not (size > 0.0).all():
            raise InputError(f"bounds: expected a box, got sides {size.tolist()}")
        shape = np.maximum(1, np.round(size / cell)).astype(int)
        if float(np.prod(shape.astype(float))) > MOST_CELLS:
            better = cell * (float(np.prod(shape.astype(float))) / MOST_CELLS) ** (1.0 / 3.0)
            raise InputError(
                f"cell: {cell:g} makes {' x '.join(map(str, shape))} cells; expected {better:.2g} "
                "or more"
            )
        self.free = free_cells(
            field.arrays, self.low, cell, (int(shape[0]), int(shape[1]), int(shape[2])), clearance
        )

    def index(self, points: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """Cells (..., 3) of points (..., 3), the nearest within the box."""
        cells = np.floor((np.asarray(points, dtype=float) - self.low) / self.cell).astype(np.int64)
        return np.asarray(np.clip(cells, 0, np.array(self.free.shape) - 1))

    def centre(self, cells: npt.ArrayLike) -> Floats:
        """Centres (..., 3) of cells (..., 3)."""
        return np.asarray(self.low + (np.asarray(cells) + 0.5) * self.cell)

    def free_near(self, point: npt.ArrayLike) -> npt.NDArray[np.int64] | None:
        """The free cell nearest to a point that sees it, within three cells; None if there is
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
    """Short paths to one target from some points, however they are found."""

    def path(self, n: int) -> Floats | None:
        """(k, 3) from point n to the target; None if there is none."""


class ShortestTree:
    """Paths to a target from the points asked about.

    Parameters
    ----------
    grid
        Where they run.
    target
        (3,) where they end.
    points
        (n, 3) where they start; the tree grows until it has them all.

    Attributes
    ----------
    lengths
        (n,) lengths of the paths along the grid, inf where there is none.
    """

    def __init__(self, grid: Grid, target: npt.ArrayLike, points: npt.ArrayLike) -> None:
        self.grid, self.target = grid, np.asarray(target, dtype=float)
        self.points = np.asarray(points, dtype=float).reshape(-1, 3)
        root = grid.free_near(self.target)
        cells = [grid.free_near(p) for p in self.points]
        self._cells = cells
        shape = grid.free.shape
        self._next = np.full(shape, -1, dtype=np.int8)
        self.lengths = np.full(len(self.points), np.inf)
        if root is None:
            return
        wanted = np.array([c for c in cells if c is not None], dtype=np.int64).reshape(-1, 3)
        lengths = grow(grid.free, root, wanted, self._next)
        k = 0
        for n, c in enumerate(cells):
            if c is not None:
                ends = np.linalg.norm(grid.centre(c) - self.points[n]) + np.linalg.norm(
                    grid.centre(root) - self.target
                )
                self.lengths[n] = lengths[k] * grid.cell + ends
                k += 1

    def path(self, n: int) -> Floats | None:
        """(k, 3) from point n to the target along the grid; None if there is none."""
        cell = self._cells[n]
        if cell is None or not np.isfinite(self.lengths[n]):
            return None
        at, cells = np.array(cell), [np.array(cell)]
        while (step := int(self._next[tuple(at)])) < 26:
            at = at + STEPS[step]
            cells.append(at)
        return np.vstack([self.points[n], self.grid.centre(np.array(cells)), self.target])


STEPS = np.array([s for s in np.ndindex(3, 3, 3) if s != (1, 1, 1)], dtype=np.int64) - 1
_LONG = np.sqrt((STEPS**2).sum(1).astype(float))


@kernel
def free_cells(
    field: Field, low: Floats, cell: float, shape: tuple[int, int, int], clearance: float
) -> Bools:
    """Which cells of a grid have their centre at least the clearance from all solids."""
    out = np.zeros(shape, dtype=np.bool_)
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                out[i, j, k] = (
                    distance(
                        field, low[0] + (i + 0.5) * cell, low[1] + (j + 0.5) * cell,
                        low[2] + (k + 0.5) * cell,
                    )
                    >= clearance
                )  # fmt: skip
    return out


@kernel
def grow(free: Bools, root: Ints, wanted: Ints, toward: npt.NDArray[np.int8]) -> Floats:
    """Dijkstra from the root until all wanted cells are settled. `toward` gets, for every settled
    cell, the step that leads on to the root (26 at the root). Returns lengths in cells."""
    nx, ny, nz = free.shape
    lengths = np.full(free.shape, np.inf)
    found = np.full(len(wanted), np.inf)
    left = len(wanted)
    lengths[root[0], root[1], root[2]] = 0.0
    toward[root[0], root[1], root[2]] = 26
    queue = [(0.0, root[0], root[1], root[2])]
    while len(queue) > 0 and left > 0:
        length, i, j, k = heapq.heappop(queue)
        if length > lengths[i, j, k]:
            continue
        for w in range(len(wanted)):
            if wanted[w, 0] == i and wanted[w, 1] == j and wanted[w, 2] == k:
                found[w] = length
                left -= 1
        for s in range(26):
            u, v, w = i + STEPS[s, 0], j + STEPS[s, 1], k + STEPS[s, 2]
            if u < 0 or v < 0 or w < 0 or u >= nx or v >= ny or w >= nz or not free[u, v, w]:
                continue
            onward = length + _LONG[s]
            if onward < lengths[u, v, w]:
                lengths[u, v, w] = onward
                toward[u, v, w] = 25 - s  # the opposite step
                heapq.heappush(queue, (onward, u, v, w))
    return found


def taut(field: DistanceField, path: Floats, clearance: float, delta: float) -> Floats:
    """A path (k, 3) pulled taut in its class, no nearer to solids than the clearance, or than it is
    at its ends; densely enough for straight lines between its points to keep to it."""
    ends = field.distance(path[[0, -1]])
    room = max(0.0, min(clearance, float(ends.min()) - 1e-3 * delta))
    grown = field.grown(room)
    # the grown solids are no thinner than twice the room: nothing is lost with a coarser delta
    coarse, fine = (GeodesicTether(grown, max(delta, share * room)) for share in (1.0, 0.5))
    step = max(room, delta)
    line = path
    for _ in range(2):
        k = 2 + int(polylines.length(line) / step)
        line = shortcut(grown.arrays, _shares(line, k), 0.1 * step)[::-1]
    nodes = fine.relaxed(coarse.relaxed(line, ROUNDS).nodes, ROUNDS).nodes
    return nodes[np.r_[True, np.linalg.norm(np.diff(nodes, axis=0), axis=1) > 1e-9]]


@kernel
def shortcut(field: Field, path: Floats, tolerance: float) -> Floats:
    """A path without the points that can be left out: from each point straight to the last of those
    that it sees without a break. The triangles that are swept are as wide as the path's points are
    apart, so nothing wider is passed over."""
    out = np.empty_like(path)
    out[0] = path[0]
    count, i = 1, 0
    while i < len(path) - 1:
        j = i + 1
        while j + 1 < len(path):
            low, _ = lowest_along(
                field, path[i, 0], path[i, 1], path[i, 2],
                path[j + 1, 0], path[j + 1, 1], path[j + 1, 2], tolerance,
            )  # fmt: skip
            if low < -tolerance:
                break
            j += 1
        out[count] = path[j]
        count += 1
        i = j
    return out[:count].copy()


def homotopic(field: DistanceField, a: Floats, b: Floats, step: float) -> bool:
    """Whether two paths between the same ends certainly are of one class: points at most `step`
    apart, at the same share of both paths, all see one another. Nothing wider than `step` can then
    stand between the paths."""
    k = 2 + int(max(polylines.length(a), polylines.length(b)) / step)
    return bool(all_see(field.arrays, _shares(a, k), _shares(b, k), 0.1 * step))


def _shares(path: Floats, k: int) -> Floats:
    s = polylines.along(path)
    u = np.linspace(0.0, s[-1], k)
    return np.column_stack([np.interp(u, s, path[:, axis]) for axis in range(3)])


@kernel
def all_see(field: Field, a: Floats, b: Floats, step: float) -> bool:
    """Whether the points a[k] and b[k] (n, 3) see one another, all of them, in steps of `step`."""
    for k in range(len(a)):
        low, _ = lowest_along(
            field, a[k, 0], a[k, 1], a[k, 2], b[k, 0], b[k, 1], b[k, 2], step
        )  # fmt: skip
        if low < 0.0:
            return False
    return True

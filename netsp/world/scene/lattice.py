"""Lattices: the points of a distance grid, which are dense in a box or only near surfaces.

Both kinds number their points in one row, so `netsp.world.scene.voxels` treats them alike.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints, Singles
from netsp.base.bounded_work import abandoned, end_if_abandoned
from netsp.base.time_flags import Flag
from netsp.world.scene import blocks as compiled
from netsp.world.scene.blocks import REACHED, WATER
from netsp.world.scene.closest import Owners, nearest_sites, sweep, windings
from netsp.world.scene.face_tree import FaceTree
from netsp.world.scene.grid import SIDE, VoxelGrid
from netsp.world.scene.scene_policy import GridPolicy

OnStage = Callable[[str, float], None] | None


@dataclass
class Dense:
    """Lattice of all points of a box.

    Parameters
    ----------
    origin : ndarray, shape (3,)
        First point, metres.
    size : float
        Distance between points, metres.
    counts : (int, int, int)
        Number of points along x, y and z.
    """

    origin: Floats
    size: float
    counts: tuple[int, int, int]

    def closest(
        self,
        sites: Floats,
        on_progress: OnStage = None,
        *,
        with_owners: bool = True,
        below: Singles | None = None,
    ) -> tuple[Singles, Owners]:
        """Return the distance from each point to the nearest site, and optionally the site's
        index.

        `below` (n,) has a limit for each point; a distance that is not less may be infinite.
        The limits of two points may not differ by more than the distance of the points.
        """
        where = self.origin, self.size, self.counts
        if below is None:
            distances, owner = _closest(sites, *where, on_progress)
        else:
            # sweeps pass sites from point to point, also by points a little beyond the limit
            wider = below.reshape(self.counts) + np.float32(2.0 * self.size)
            distances, owner = _closest(sites, *where, on_progress, wider)
            distances[owner < 0] = np.inf
        return distances.ravel(), owner.ravel()

    def turn_inside(self, values: Singles, triangles: Floats) -> int:
        """Negate the values where a mesh (m, 3, 3) winds around; return the maximum winding
        number."""
        around = windings(triangles, self.origin, self.size, self.counts).ravel()
        np.negative(values, out=values, where=around != 0)
        return int(np.abs(around).max(initial=0))

    def turn_wound(self, values: Singles, tree: FaceTree) -> None:
        """Negate the values where the generalised winding number of faces is 0.5 or more.

        It is taken at each point near the faces. Other points have the sign of the nearest of
        every fourth point along each axis; no face lies between the two.
        """
        step = SIDE // 2
        axes = [
            self.origin[k] + self.size * np.arange(0, n, step) for k, n in enumerate(self.counts)
        ]
        coarse = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        wound = np.abs(tree.windings(coarse.reshape(-1, 3))).reshape(coarse.shape[:3]) >= 0.5
        near = []
        for n in self.counts:
            nearest = (np.arange(n) + step // 2) // step
            near.append(np.minimum(nearest, (n - 1) // step))
        inside = wound[np.ix_(*near)].ravel()
        _turn_near(self, values, inside, tree, step * self.size)

    def unreached(self, values: Singles) -> Bools:
        """Return the points outside the solid that water from the border does not reach."""
        from scipy.ndimage import label

        parts, count = label(values.reshape(self.counts) > 0.0)
        if count <= 1:
            return np.zeros(values.shape, dtype=bool)
        border = np.zeros(count + 1, dtype=bool)
        for axis in range(3):
            for end in (0, -1):
                border[np.unique(parts.take(end, axis))] = True
        border[0] = True
        return np.asarray(~border[parts]).ravel()

    def positions(self, chosen: Bools) -> tuple[Floats, Ints]:
        """Return the distinct positions (m, 3) of chosen points, and their indices."""
        at = np.argwhere(chosen.reshape(self.counts))
        return self.origin + self.size * at, np.flatnonzero(chosen)

    def minimum_nearby(self, values: Singles, points: Floats, reach: int) -> Singles:
        """Return the minimum (m,) of the values within `reach` voxels of each place (m, 3)."""
        from scipy.ndimage import minimum_filter

        cell = np.rint((points - self.origin) / self.size).astype(int)
        cell = np.clip(cell, 0, np.array(self.counts) - 1)
        lowest = minimum_filter(values.reshape(self.counts), size=2 * reach + 1)
        return np.asarray(lowest[tuple(cell.T)])

    def grid(self, values: Singles, solid: Floats, notes: tuple[str, ...]) -> VoxelGrid:
        """Return the grid with the given values."""
        return VoxelGrid(values, self.counts, self.origin, self.size, solid, notes)


class Sparse:
    """Lattice of the corners of cells of 8³ voxels, and of all points of the cells near surfaces.

    Its methods are those of `Dense`.

    Parameters
    ----------
    origin : ndarray, shape (3,)
        First corner, metres.
    size : float
        Distance between points of a block, metres.
    near : ndarray of bool, shape (nx, ny, nz)
        Cells that are blocks.
    known : (ndarray, ndarray, ndarray)
        Sites, the distances of the corners to them, and the nearest site of each corner.
    policy : GridPolicy
        Reach of the blocks, and sizes of the slabs.
    """

    def __init__(
        self,
        origin: Floats,
        size: float,
        near: Bools,
        known: tuple[Floats, Singles, Owners],
        policy: GridPolicy,
    ) -> None:
        self.policy = policy
        self.origin, self.size, self.known = origin, size, known
        self.counts = (near.shape[0] + 1, near.shape[1] + 1, near.shape[2] + 1)
        self.first = int(np.prod(self.counts))
        self.blocks = np.argwhere(near).astype(np.int32)
        self.table = np.full(near.shape, -1, dtype=np.int32)
        self.table[tuple(self.blocks.T)] = np.arange(len(self.blocks))

    def _parts(self, row: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Split a row of values into those of the corners (nx + 1, …) and those of the blocks (n,
        512)."""
        shape = (len(self.blocks), SIDE**3)
        return row[: self.first].reshape(self.counts), row[self.first :].reshape(shape)

    def closest(
        self,
        sites: Floats,
        on_progress: OnStage = None,
        *,
        with_owners: bool = True,
        below: Singles | None = None,
    ) -> tuple[Singles, Owners]:
        """Return distances and sites as `Dense` does, slab by slab to save memory; `below` is
        ignored."""
        total = self.first + len(self.blocks) * SIDE**3
        distances = np.empty(total, dtype=np.float32)
        owner = np.empty(total if with_owners else 0, dtype=np.int32)
        known, far, nearest = self.known
        if sites is not known:
            side = SIDE * self.size
            far, nearest = _closest(sites, self.origin, side, self.counts, None)
        distances[: self.first] = far.ravel()
        owner[: self.first] = nearest.ravel()[: len(owner)]
        reach = compiled.along_x(sites)
        stop = abandoned()  # threads of the pool have no context

        def fill(slab: tuple[int, int]) -> int:
            d, s, inner = self._slab(slab, sites, reach, nearest, stop)
            rows = slice(*np.searchsorted(self.blocks[:, 0], slab))
            self._parts(distances)[1][rows] = d[inner]
            if with_owners:
                self._parts(owner)[1][rows] = s[inner]
            return len(d[inner])

        done, pool = 0, ThreadPoolExecutor(self.policy.workers)
        try:
            for count in pool.map(fill, self._slabs()):
                end_if_abandoned()
                done += count
                report_stage(on_progress, "distances", done / (len(self.blocks) + 1))
        finally:
            pool.shutdown(cancel_futures=True)
        end_if_abandoned()
        return distances, owner

    def _slabs(self) -> list[tuple[int, int]]:
        """Return ranges of cells along x that each hold few enough blocks."""
        many = np.cumsum(np.bincount(self.blocks[:, 0], minlength=len(self.table)))
        slab = many // self.policy.slab_size
        cuts: list[Any] = [0, *(np.flatnonzero(np.diff(slab)) + 1), len(slab)]
        return [(int(a), int(b)) for a, b in itertools.pairwise(cuts) if a < b]

    def _slab(
        self,
        slab: tuple[int, int],
        sites: Floats,
        reach: tuple[Floats, Floats],
        corners: Owners,
        stop: Flag,
    ) -> tuple[Singles, Owners, slice]:
        """Return distances and sites of the blocks in and around a slab, and which blocks are in
        it."""
        low, high = slab
        halo = self.policy.halo_cells
        cuts = np.array([low - halo, low, high, high + halo])
        begin, first, last, end = np.searchsorted(self.blocks[:, 0], cuts).tolist()
        blocks = self.blocks[begin:end]
        distances = np.full((len(blocks), SIDE**3), np.float32(np.inf))
        owner = np.full(distances.shape, -1, dtype=np.int32)
        if not len(blocks):
            return distances, owner, slice(0, 0)
        side = SIDE * self.size
        ends = self.origin[0] + side * np.array([low - halo - 1, high + halo + 1])
        which = np.flatnonzero((reach[1] >= ends[0]) & (reach[0] <= ends[1]))
        place = (self.origin, self.size, begin)
        compiled.nearest_to_corners(sites, place, blocks, corners, distances, owner)
        compiled.nearest_in_blocks(sites, which, place, blocks, self.table, distances, owner, stop)
        changed = np.zeros(len(blocks), dtype=np.int64)
        last_checked = np.full((len(blocks), 6), -1)
        for turn in range(8):
            signs = [1 if turn // s % 2 == 0 else -1 for s in (1, 2, 4)]
            i, j, k = (sign * row for sign, row in zip(signs, blocks.T, strict=True))
            order = np.lexsort((k, j, i)).astype(np.int64)
            state = (distances, owner, turn, changed, last_checked, stop)
            compiled.sweep_blocks(sites, place, blocks, self.table, order, *state)
        return distances, owner, slice(first - begin, last - begin)

    def turn_inside(self, values: Singles, triangles: Floats) -> int:
        """Negate values as `Dense` does."""
        corners, fine = self._parts(values)
        around = windings(triangles, self.origin, SIDE * self.size, self.counts)
        np.negative(corners, out=corners, where=around != 0)
        place = (self.origin, self.size, 0)
        return int(compiled.turn_inside(fine, triangles, place, self.blocks, self.table))

    def turn_wound(self, values: Singles, tree: FaceTree) -> None:
        """Negate values as `Dense` does; the corners of cells are the points farther away."""
        side = SIDE * self.size
        places = self.origin + side * np.indices(self.counts).reshape(3, -1).T
        wound = (np.abs(tree.windings(places)) >= 0.5).reshape(self.counts)
        inside = np.zeros(len(values), dtype=bool)
        corners, fine = self._parts(inside)
        corners[:] = wound
        shape = fine.reshape(-1, SIDE, SIDE, SIDE)
        for offset in np.ndindex(2, 2, 2):
            nearest = tuple(slice(SIDE // 2, None) if o else slice(None, SIDE // 2) for o in offset)
            shape[(slice(None), *nearest)] = wound[tuple((self.blocks + offset).T)][
                :, None, None, None
            ]
        _turn_near(self, values, inside, tree, side)

    def unreached(self, values: Singles) -> Bools:
        """Return unreached points as `Dense` does."""
        water = values > 0.0
        corners, fine = self._parts(water.view(np.uint8))
        cells = corners[:-1, :-1, :-1].copy()
        compiled.flood(fine.reshape(-1, SIDE, SIDE, SIDE), cells, self.table)
        cells[tuple(self.blocks.T)] = fine[:, 0]
        reached = np.full(self.counts, REACHED, dtype=np.uint8)
        reached[:-1, :-1, :-1] = cells
        water[: self.first].view(np.uint8)[:] = reached.ravel()
        return np.equal(water.view(np.uint8), WATER, out=water)

    def positions(self, chosen: Bools) -> tuple[Floats, Ints]:
        """Return positions as `Dense` does, without the corners of cells that are no blocks."""
        fine = self._parts(chosen)[1].reshape(-1, SIDE, SIDE, SIDE)
        at = np.argwhere(fine)
        places = self.origin + self.size * (SIDE * self.blocks[at[:, 0]] + at[:, 1:])
        return places, np.flatnonzero(fine) + self.first

    def minimum_nearby(self, values: Singles, points: Floats, reach: int) -> Singles:
        """Return minima as `Dense` does."""
        cell = np.rint((points - self.origin) / self.size).astype(np.int64)
        corners, fine = self._parts(values)
        return np.asarray(compiled.minimum_in_blocks(corners, fine, self.table, cell, reach))

    def grid(self, values: Singles, solid: Floats, notes: tuple[str, ...]) -> VoxelGrid:
        """Return the grid as `Dense` does."""
        side = SIDE * self.size
        compiled.understate(values, side, self.policy.block_reach)
        compiled.meet_corners(*self._parts(values), self.blocks, self.table)
        return VoxelGrid(values, self.counts, self.origin, side, solid, notes, self.table)


def sparse_near(
    origin: Floats,
    size: float,
    cells: tuple[int, int, int],
    sites: Floats,
    policy: GridPolicy,
    *,
    shell: float,
    triangles: Floats | None,
    region: Floats | None,
) -> Sparse:
    """Return the lattice that has blocks near surfaces.

    Parameters
    ----------
    origin : ndarray, shape (3,)
        First corner, metres.
    size : float
        Distance between points of a block, metres.
    cells : (int, int, int)
        Number of cells along x, y and z.
    sites : ndarray
        Sites (`netsp.world.scene.sites`).
    policy : GridPolicy
        Reach of the blocks, and sizes of the slabs.
    shell : float
        Distance by which sites are thickened on either side, metres.
    triangles : ndarray, shape (m, 3, 3), or None
        Triangles of a closed mesh, whose inside needs fewer blocks.
    region : ndarray, shape (2, 3), or None
        Box outside of which no blocks are needed, metres.
    """
    corners = (cells[0] + 1, cells[1] + 1, cells[2] + 1)
    side = SIDE * size
    distances, owner = _closest(sites, origin, side, corners, None)
    near = distances <= shell + policy.block_reach * side
    if triangles is not None:
        inside = windings(triangles, origin, side, corners) != 0
        near &= ~inside | (distances <= policy.inside_block_reach * side)
    cell = np.zeros(cells, dtype=bool)
    for p in range(2):
        for q in range(2):
            for r in range(2):
                cell |= near[p : p + cells[0], q : q + cells[1], r : r + cells[2]]
    if region is not None:
        for axis in range(3):
            at = origin[axis] + side * np.arange(cells[axis])
            wanted = (at + side >= region[0][axis]) & (at <= region[1][axis])
            cell &= wanted.reshape([-1 if a == axis else 1 for a in range(3)])
    return Sparse(origin, size, cell, (sites, distances, owner), policy)


Lattice = Dense | Sparse
"""Points at which a grid is built, in one row."""


def _turn_near(
    lattice: Lattice, values: Singles, inside: Bools, tree: FaceTree, step: float
) -> None:
    """Negate values inside; near faces, within half a diagonal of `step`, by the tree itself."""
    places, which = lattice.positions(np.abs(values) <= 0.5 * math.sqrt(3.0) * step)
    inside[which] = np.abs(tree.windings(places)) >= 0.5
    values[inside] = -np.abs(values[inside])


def report_stage(on_progress: OnStage, stage: str, fraction: float) -> None:
    """Report the progress of a stage, from 0 to 1, if there is a listener."""
    if on_progress is not None:
        on_progress(stage, fraction)


def _closest(
    sites: Floats,
    origin: Floats,
    size: float,
    counts: tuple[int, ...],
    on_progress: OnStage,
    below: Singles | None = None,
) -> tuple[Singles, Owners]:
    """Return the distances of all points of a grid to the nearest site, and the index of that site.
    Where no site is nearer than `below`, return `below` and index -1."""
    report_stage(on_progress, "distances", 0.0)
    distances = np.full(counts, np.float32(np.inf)) if below is None else below.copy()
    owner = np.full(counts, -1, dtype=np.int32)
    stop = abandoned()
    nearest_sites(sites, origin, size, distances, owner, stop)
    for turn in range(8):
        end_if_abandoned()
        sweep(sites, origin, size, distances, owner, turn, stop)
        report_stage(on_progress, "distances", (turn + 1) / 9)
    end_if_abandoned()
    return distances, owner

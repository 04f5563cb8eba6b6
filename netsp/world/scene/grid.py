"""Distance grids, which `netsp.world.scene.voxels` builds and `netsp.world.scene.packing` packs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Singles

SIDE = 8
"""Format of a block: number of voxels along its sides."""


@dataclass(frozen=True)
class VoxelGrid:
    """Distances at the points of a regular grid, and at finer points near surfaces.

    Distances are linear between points.

    Attributes
    ----------
    values
        Distances, metres, negative inside, in one row: those of the (nx, ny, nz) points of the
        grid, then those of the (8, 8, 8) points of each block.
    counts
        Counts (nx, ny, nz) of the points.
    origin
        First point (3,).
    size
        Distance between points of the grid, metres.
    solid
        Bounding box (2, 3) of the solid, which lies well within the grid.
    notes
        Assumptions of the build, one line each.
    table
        Block of each cell (nx - 1, ny - 1, nz - 1), -1 for none; None without blocks.
    """

    values: Singles
    counts: tuple[int, ...]
    origin: Floats
    size: float
    solid: Floats
    notes: tuple[str, ...] = ()
    table: npt.NDArray[np.int32] | None = None

    @property
    def voxel(self) -> float:
        """Distance between the finest points, metres."""
        return self.size if self.table is None else self.size / SIDE

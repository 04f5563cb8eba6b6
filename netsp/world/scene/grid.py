"""Distances at grid points, as they are built (`netsp.world.scene.voxels`) and packed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Singles

SIDE = 8
"""Format of a block: number of voxels along its sides."""


@dataclass(frozen=True)
class VoxelGrid:
    """Distances at the points of a regular grid, linear in between; near surfaces finer ones.

    Attributes
    ----------
    values
        Metres, negative inside: of the (nx, ny, nz) points of the grid, then of the (8, 8, 8)
        points of each block, all in one row.
    counts
        (nx, ny, nz).
    origin
        (3,) of the first point.
    size
        Metres between points of the grid.
    solid
        (2, 3) bounding box of what is solid, well within the grid.
    notes
        What was assumed when it was built.
    table
        (nx - 1, ny - 1, nz - 1) which block a cell has, -1 where it has none; None without blocks.
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
        """Metres between the finest points."""
        return self.size if self.table is None else self.size / SIDE

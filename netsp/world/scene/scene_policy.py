"""Policies of scenes: building of grids, sampling of fields, and filling of seams."""

from __future__ import annotations

import os
from dataclasses import dataclass, field

from netsp.base.number_ranges import check_not_negative, check_positive


@dataclass(frozen=True)
class GridPolicy:
    """Policy of distance grids from meshes and clouds. No number is negative.

    A cell has `netsp.world.scene.grid.SIDE` voxels along each side.

    Attributes
    ----------
    default_voxels
        Default number of voxels along the longest side.
    max_dense_points
        Maximum number of points of a grid that holds all points; larger grids hold only those near
        surfaces.
    border_voxels
        Distance between the solid and the border of a dense grid, voxels.
    border_cells
        Distance between the solid and the border of a sparse grid, cells.
    sheet_voxels
        Half thickness of surfaces without an inside, voxels. With one voxel, interpolation would
        round both sides into one, and lengths of tethers would depend on their resolution.
    max_hidden_share
        Share of the surface, as sides of sheets within the thickness of others, from which on a
        note says so.
    block_reach
        Distance of a corner from a surface, in sides of a cell, up to which the cell is a block.
    inside_block_reach
        Same distance inside a closed mesh. It must exceed half the diagonal of a cell, sqrt(3) / 2,
        so that no surface passes through a cell whose corners are all deeper.
    halo_cells
        Number of cells on either side of a slab that take part in its distances. With fewer, blocks
        at the rim of a slab miss their nearest surface.
    slab_blocks
        Number of blocks for which all workers together compute distances at a time. With more, a
        build needs more memory.
    max_workers
        Maximum number of threads, which share the memory for slabs.
    bytes_per_voxel
        Memory for each point of a dense grid while it is built.
    bytes_per_cell
        Memory for each cell of a sparse grid, without its points.
    bytes_per_mesh_block
        Memory for each block of a sparse grid while it is built from a mesh.
    bytes_per_cloud_block
        Memory for each block of a sparse grid while it is built from a cloud, with its points and
        the tree that finds their neighbours. The four sizes only decide which grids are refused.
    """

    default_voxels: int = 200
    max_dense_points: int = 40_000_000
    border_voxels: int = 8
    border_cells: int = 4
    sheet_voxels: float = 2.0
    max_hidden_share: float = 0.01
    block_reach: float = 1.25
    inside_block_reach: float = 0.9
    halo_cells: int = 2
    slab_blocks: int = 80_000
    max_workers: int = 4
    bytes_per_voxel: int = 28
    bytes_per_cell: int = 48
    bytes_per_mesh_block: int = 2700
    bytes_per_cloud_block: int = 30_000

    def __post_init__(self) -> None:
        check_not_negative(self)

    @property
    def workers(self) -> int:
        """Number of threads on this machine."""
        return max(1, min(self.max_workers, os.cpu_count() or 1))

    @property
    def slab_size(self) -> int:
        """Number of blocks for which one thread computes distances at a time."""
        return max(1, self.slab_blocks // self.workers)


@dataclass(frozen=True)
class MeshPolicy:
    """Policy of open and doubtful meshes. All numbers are positive; shares are of the diagonal.

    Attributes
    ----------
    weld_share
        Distance between vertices that count as one.
    side_share
        Distance from a face at which its sides are looked at.
    samples
        Number of faces of a part at which its winding number is taken; larger ones first.
    rays
        Number of rays from each side of such a face that decide which side is outside.
    min_closedness
        Smallest mean winding number just behind the faces of an open part that is a solid with
        holes. At 0.95 about a tenth of a ball may be missing; a box without a lid is a sheet.
    min_solid_faces
        Smallest number of faces of an open part that may be a solid.
    min_loose_winding
        Smallest winding number just behind a face whose edges do not meet those of others, for it
        to be a candidate for the surface of a solid. It is about 1 where such faces enclose one,
        and 0.5 behind a face on its own.
    min_extent_m, max_extent_m
        Sizes of a mesh, metres, outside of which a note doubts its unit. Their ratio is 1000, so a
        mesh in millimetres that is read in metres is outside if its true size is not.
    min_allowed_extent_m, max_allowed_extent_m
        Sizes of a mesh, metres, outside of which a scene is refused.
    """

    weld_share: float = 1e-6
    side_share: float = 1e-5
    samples: int = 1_000
    rays: int = 32
    min_closedness: float = 0.95
    min_solid_faces: int = 4
    min_loose_winding: float = 0.75
    min_extent_m: float = 0.2
    max_extent_m: float = 200.0
    min_allowed_extent_m: float = 0.01
    max_allowed_extent_m: float = 5_000.0

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class FieldPolicy:
    """Policy of distance fields. All numbers are positive.

    Attributes
    ----------
    max_solids_without_lookup
        Maximum number of solids that are all measured at every point. With more, a coarse grid
        holds which solids may be nearest in each of its cells.
    lookup_cells
        Number of cells of that grid along its longest side.
    chunk_points
        Number of points measured between two checks whether the work is abandoned; about half a
        second.
    max_thin_samples
        Maximum number of solid voxels whose surroundings are measured to find how much of a sparse
        grid is thin.
    """

    max_solids_without_lookup: int = 6
    lookup_cells: int = 40
    chunk_points: int = 1_000_000
    max_thin_samples: int = 2_000

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class SeamPolicy:
    """Policy of the boxes that fill seams between solids. All numbers are positive.

    Attributes
    ----------
    max_gap
        Maximum distance between two faces that count as touching, metres.
    max_overlap
        Maximum depth of one solid in the other for which a seam is filled, metres. A deeper overlap
        leaves no slit.
    max_angle
        Maximum angle between two faces that count as parallel, radians.
    max_depth
        Maximum depth of a box in either solid, metres.
    min_width
        Minimum width of a seam that is filled, metres.
    min_height
        Height of the lowest box on a side of a seam with few sides, metres. With
        `height_growth`, a point at a distance r from its nearest side and all others is in a box of
        a height between r and 2 r, so everything 0.15 m from the rim is as deep as edges dip.
    height_growth
        Ratio of the heights of successive boxes.
    max_few_sides
        Maximum number of sides of a seam that is filled side by side; others are cut into strips.
    strip_width
        Width of the strips into which a seam with many sides is cut, metres.
    min_strips, max_strips
        Limits of the number of strips.
    circle_corners
        Number of corners of the polygon that stands for a circular face. They lie on the circle, so
        that no box sticks out.
    endless_size
        Distance at which faces without end are cut off, metres.
    """

    max_gap: float = 1e-3
    max_overlap: float = 0.1
    max_angle: float = 1e-3
    max_depth: float = 0.5
    min_width: float = 1e-3
    min_height: float = 0.17
    height_growth: float = 1.7
    max_few_sides: int = 10
    strip_width: float = 0.15
    min_strips: int = 18
    max_strips: int = 120
    circle_corners: int = 32
    endless_size: float = 1e4

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class FloorPolicy:
    """Policy of sea floors from bathymetry grids. All numbers are positive.

    Attributes
    ----------
    max_cells
        Maximum number of cells of a grid; each becomes two triangles.
    base_share
        Thickness of the floor below its deepest point, as a share of its longer side.
    """

    max_cells: int = 4_000_000
    base_share: float = 0.05

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class ScenePolicy:
    """Policy of a scene: its grid, its meshes, its field, its seams and its sea floor."""

    grid: GridPolicy = field(default_factory=GridPolicy)
    mesh: MeshPolicy = field(default_factory=MeshPolicy)
    distances: FieldPolicy = field(default_factory=FieldPolicy)
    seams: SeamPolicy = field(default_factory=SeamPolicy)
    floor: FloorPolicy = field(default_factory=FloorPolicy)

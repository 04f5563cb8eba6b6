"""Policies of the simulated environment: gusts, range sensor, and coverage by a camera."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class GustPolicy:
    """Policy of the gusts on top of a current. All numbers are positive.

    Attributes
    ----------
    memory_s
        Correlation time of a gust, s.
    interval_s
        Time between two values of the random process, s.
    """

    memory_s: float = 5.0
    interval_s: float = 0.1

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class RangingPolicy:
    """Policy of a simulated range sensor. All numbers are positive.

    Attributes
    ----------
    ray_count
        Number of rays of one look. Each look turns the fan of rays, so that later rays find solids
        between earlier ones.
    """

    ray_count: int = 240

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class CoveragePolicy:
    """Policy of the patches by which coverage is counted. All numbers are positive.

    Attributes
    ----------
    max_patches
        Maximum number of large triangles of a surface; a finer surface is refused.
    mesh_patch_ratio
        Edge of the cubes in which patches of a mesh are merged, as a multiple of the camera's
        patch. A flight counts these patches; `netsp cover` chooses by coarser ones.
    sample_seed
        Seed of the points of a mesh's faces by which its patches are seen or not.
    max_water_cells
        Maximum number of cells along the longest side of a mesh in the search for the water that
        the robot gets to.
    sight_rays
        Number of oblique rays from each patch of a mesh that look for such water.
    sight_steps, sight_growth
        Number of places along each ray, and ratio of their distances. The first is the clearance.
    max_sight_deg
        Maximum angle between a ray and the normal, degrees.
    """

    max_patches: int = 200_000
    mesh_patch_ratio: float = 0.5
    sample_seed: int = 1
    max_water_cells: int = 80
    sight_rays: int = 16
    sight_steps: int = 8
    sight_growth: float = 1.5
    max_sight_deg: float = 75.0

    def __post_init__(self) -> None:
        check_positive(self)

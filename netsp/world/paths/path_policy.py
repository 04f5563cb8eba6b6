"""Policies of path search: grids, pulling taut, sampling planners, and paths beside a tether."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class StandoffPolicy:
    """Policy of moving a path off the surfaces that a tether touches. All numbers are positive.

    Attributes
    ----------
    step_share
        Longest step of a point, as a share of the clearance. Longer steps are rejected more often.
    stencil_share
        Arm of the stencil for the gradient, as a share of the clearance. It must be so wide that
        points between two solids climb along the middle.
    max_sweeps
        Maximum number of steps of a point.
    min_scale
        Smallest clearance from which both shares are computed, metres.
    min_gain
        Smallest gain of distance for which a step is accepted, as a share of the step.
    """

    step_share: float = 1 / 6
    stencil_share: float = 1 / 3
    max_sweeps: int = 80
    min_scale: float = 0.05
    min_gain: float = 0.02

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class PathPolicy:
    """Policy of the search for short paths in a scene. All numbers are positive.

    Attributes
    ----------
    cell
        Default cell size of the grid, metres.
    max_default_cells
        Number of cells above which the default cell size grows, so that a plan takes about a
        second.
    max_cells
        Maximum number of cells of a grid; the default takes about 0.3 GiB.
    max_tree_bytes
        Memory for cached shortest-path trees, bytes. A tree has one target and takes a byte for
        each cell.
    pull_rounds
        Number of rounds in which a path is pulled taut. More rounds gain less than a millimetre.
    rough_pull_rounds
        Number of rounds in which a path is pulled to compare the lengths of classes.
    pull_stages
        Number of paths that are yielded between the original and the taut one.
    rrtstar_iterations, bitstar_iterations
        Number of iterations of these planners. Counts, unlike times, make the path depend on the
        seed only.
    prmstar_milestones
        Number of milestones of PRM*.
    prmstar_neighbours
        Number of nearest milestones to which each end of a path is joined.
    standoff
        Policy of paths beside a tether.
    """

    cell: float = 0.2
    max_default_cells: int = 2_000_000
    max_cells: int = 20_000_000
    max_tree_bytes: int = 200_000_000
    pull_rounds: int = 60
    rough_pull_rounds: int = 12
    pull_stages: int = 15
    rrtstar_iterations: int = 1000
    bitstar_iterations: int = 3000
    prmstar_milestones: int = 300
    prmstar_neighbours: int = 20
    standoff: StandoffPolicy = StandoffPolicy()

    def __post_init__(self) -> None:
        check_positive(self)

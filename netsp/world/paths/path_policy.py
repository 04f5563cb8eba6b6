"""Policies of path search: grid, pulling taut, sampling planners, and distance from a tether."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class StandoffPolicy:
    """Policy by which a path moves off the surfaces that a tether rests on. All are positive.

    Attributes
    ----------
    step_share
        Longest step of a point, as a share of the clearance. Longer steps are undone more often.
    stencil_share
        Arm of the stencil for the gradient, as a share of the clearance: wide enough that points
        between two solids climb along the middle.
    max_sweeps
        Maximum number of steps of each point.
    min_scale
        Length that replaces a smaller clearance in both shares, metres.
    min_gain
        Smallest gain of distance for which a step is taken, as a share of the step.
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
        Cell size of the grid where a mission states none, metres.
    max_default_cells
        Number of cells above which such a grid gets larger cells, so that a plan takes about a
        second.
    max_cells
        Number of cells that a grid may have at all; the default takes about 0.3 GiB.
    max_tree_bytes
        Memory for shortest-path trees that are kept, bytes; one per target, a byte per cell.
    pull_rounds
        Rounds in which a path is pulled taut. More rounds gain less than a millimetre.
    rough_pull_rounds
        Rounds in which a path is pulled to estimate which of several classes is the shortest.
    pull_stages
        Number of paths offered between an untouched and a taut one.
    rrtstar_iterations, bitstar_iterations
        Iterations of these planners; counts instead of times: a seed determines the path.
    prmstar_milestones
        Milestones of PRM*.
    prmstar_neighbours
        Nearest milestones that each end of a path is joined to.
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

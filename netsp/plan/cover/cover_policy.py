"""Policy of the choice of viewpoints that cover a structure."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class CoverPolicy:
    """Policy of cover planning. All numbers are positive; shares are at most 1.

    Attributes
    ----------
    search_time_share
        Share of the remaining time for the search for viewpoints; the rest is for choosing.
    tether_ratio, tether_spare
        Length of a tether that is not given: a multiple of the longest of the shortest tethers to
        the waypoints, and metres on top.
    max_tether_share
        Largest share of the tether that may be needed at a viewpoint, as planners allow.
    patch_spacing
        Distance between patches that the robot first looks at straight on, as a share of the width
        that the camera sees at the stand-off. A smaller share gives more candidates.
    views_per_hidden_patch
        Number of other places that are tried for a patch that is not seen yet.
    patches_per_round
        Number of patches not seen yet for which places are searched for together.
    min_standoff_ratio
        Smallest distance from the surface at such a place, as a multiple of the stand-off.
    max_matrix_entries
        Maximum number of entries of the matrix that the integer program is given. For more there is
        only a simple bound.
    max_alternatives
        Maximum number of alternatives of a viewpoint.
    max_places
        Maximum number of viewpoints with their alternatives, all of which the tour chooses among.
    """

    search_time_share: float = 0.6
    tether_ratio: float = 1.1
    tether_spare: float = 0.2
    max_tether_share: float = 0.99
    patch_spacing: float = 0.25
    views_per_hidden_patch: int = 24
    patches_per_round: int = 100
    min_standoff_ratio: float = 0.4
    max_matrix_entries: int = 4_000_000
    max_alternatives: int = 2
    max_places: int = 150

    def __post_init__(self) -> None:
        check_positive(self)
        for name in ("search_time_share", "max_tether_share"):
            if getattr(self, name) > 1.0:
                raise InputError(f"{name}: expected a share up to 1, got {getattr(self, name)!r}")

"""Limits of the searches in a world of obstacles, in the plane or in space."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class WorldPolicy:
    """Limits of the searches for tethers and paths. All numbers are positive.

    Attributes
    ----------
    max_length_factor
        Longest tether of a class that is looked for, as a multiple of the tether's length.
    relax_rounds
        Maximum number of rounds in which a tether is pulled taut.
    max_paths
        Maximum number of paths between two places; the shortest are kept.
    max_searches
        Maximum number of searches for such paths in the plane, each up to a larger length.
    length_growth
        Factor from one such length to the next. More than 1.
    max_detour
        Largest detour to another class at a place nearby in space, m: that around a pile.
    max_nearby_paths
        Maximum number of such detours that are tried; more would take seconds.
    retry_distance
        Distance that the robot moves before a class without a tether is tried again in space, m.
    min_vertical_share
        Vertical share of a direction from which on it is called above or below.
    contact_share
        Distance from a solid within which a tether in space rests on it, as a share of the tether
        model's resolution.
    """

    max_length_factor: float = 2.0
    relax_rounds: int = 300
    max_paths: int = 12
    max_searches: int = 16
    length_growth: float = 1.25
    max_detour: float = 2.5
    max_nearby_paths: int = 6
    retry_distance: float = 1.0
    min_vertical_share: float = 0.7
    contact_share: float = 0.1

    def __post_init__(self) -> None:
        check_positive(self)
        if not self.length_growth > 1.0:
            raise InputError(f"length_growth: expected more than 1, got {self.length_growth!r}")

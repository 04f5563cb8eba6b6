"""Policy of the choice of viewpoints that cover a structure."""

from __future__ import annotations

import math
from dataclasses import dataclass

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_positive, check_shares


@dataclass(frozen=True)
class TourSearchPolicy:
    """Policy of the search for a covering tour. All numbers are positive; shares are at most 1.

    Attributes
    ----------
    max_rounds
        Maximum number of rounds.
    rounds_per_visit
        Number of rounds for each visit of the first tour, if these are more than the maximum.
    insertion_tours
        Number of tours that insertions build from the start alone, of which the cheapest is the
        first tour if it is cheaper than that of a greedy cover.
    idle_rounds_per_visit
        Number of rounds without a gain after which the search ends, for each place of the tour
        (its visits and the start).
    min_gain
        Smallest decrease of the cost, as a share of it, that counts as a gain.
    max_removed
        Maximum number of viewpoints that a round removes.
    run_share, random_share
        Shares of rounds that remove a run of the tour, and random viewpoints. The other rounds
        remove the viewpoints nearest to one of them.
    local_share
        Share of rounds that add only viewpoints which see something that removed ones saw. The
        other rounds also look for area elsewhere, which takes several times as long.
    min_gain_exponent, max_gain_exponent
        Range of the exponent of the area that a viewpoint adds, which is weighed against its price.
    noise
        Largest logarithm of the random factor of each viewpoint in a round.
    removed_bias
        Factor of viewpoints just removed, in every other round, so that others take their place.
    min_price
        Price that is added to those of all insertions, metres, so that none is free.
    max_segment
        Maximum number of visits that a move puts elsewhere in the tour.
    min_move_gain
        Smallest saving of a move that is made, as a share of the tour; smaller ones are rounding.
    rounding
        Share of the needed area that may be missing because of rounding.
    max_detour
        Cost above that of the current tour up to which a round goes on, in mean costs of a visit.
    rounds_per_report
        Number of rounds between two lines about the progress.
    rounds_per_check
        Number of rounds between two looks at the clock, and the number of rounds in a kernel.
    warmth
        Increase of the cost that is accepted with a probability of 1/e in the first round, in mean
        costs of a visit. It falls to 0 in the last round.
    """

    max_rounds: int = 5_000
    rounds_per_visit: int = 60
    insertion_tours: int = 3
    idle_rounds_per_visit: int = 50
    min_gain: float = 1e-4
    max_removed: int = 12
    run_share: float = 0.4
    random_share: float = 0.1
    local_share: float = 0.8
    min_gain_exponent: float = 0.7
    max_gain_exponent: float = 1.3
    noise: float = 0.22
    removed_bias: float = 0.6
    min_price: float = 0.02
    max_segment: int = 3
    min_move_gain: float = 1e-9
    rounding: float = 1e-12
    max_detour: float = 1.5
    rounds_per_report: int = 500
    rounds_per_check: int = 20
    warmth: float = 0.1

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "run_share", "random_share", "local_share", "removed_bias")


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
    standoff_ratios
        Distances from the surface of the viewpoints that a tour of least time chooses among, as
        multiples of the stand-off. None is farther than the camera sees.
    heading_offsets_deg
        Angles between their headings and the straight look at a patch, degrees.
    free_headings
        Number of headings with which a patch must be seen from a viewpoint without a heading. It is
        odd, because a view straight down repeats after a quarter turn.
    passing_distance
        Distance at which the robot may pass a viewpoint without a heading, metres: the reach of a
        mission, and its path between two looks of the camera.
    max_candidates
        Maximum number of viewpoints that such a tour chooses among.
    counted_ratios
        Sizes of the patches on which the area is counted for such a tour, as multiples of those of
        the camera, the finest first; 0 for the patches that a flight counts.
    max_views
        Maximum number of such patches times that of viewpoints; coarser patches are taken then.
    dense_objectives
        Objectives for which the choice is among these viewpoints: `time`, `viewpoints` or both.
    max_sight_lines
        Maximum number of straight legs between viewpoints that are checked for solids.
    samples_per_clearance
        Number of points per clearance at which the distance of such a leg from solids is tested.
    sparse_neighbours
        Number of neighbours of a viewpoint in the graph of detours round solids.
    turning_ratios
        Distances from the surface of the points where such detours may turn, as multiples of the
        clearance. A line between points at 2 clears a square edge.
    turning_patch_ratio
        Size of the patches before which these points are placed, as a share of the stand-off.
    blocked_ratio
        Length of a leg round a solid, as a multiple of the straight one, if that graph has no path.
    free_turn_deg
        Turn at a viewpoint straight above or below the surface, where the heading on arrival is not
        known, degrees.
    approach_times
        Times before the arrival at a viewpoint at which the robot's heading is estimated, s. They
        reach back as far as the longest turn, of half a circle, takes.
    visit_steps
        Time of a visit without a turn, in steps of the flight: the rest of the step in which the
        robot arrives, half a step on average, and the step in which it looks.
    more_time_share
        Share of the remaining time for the search for more viewpoints for such a tour.
    max_recounts
        Number of searches for such a tour, each with more area than the one before as long as less
        than the share is seen of the fine patches that a flight counts.
    recount_rounds
        Maximum number of rounds of each of these searches after the first.
    tours
        Policy of the search for a covering tour.
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
    standoff_ratios: tuple[float, ...] = (0.7, 1.0, 1.4, 1.8)
    heading_offsets_deg: tuple[float, ...] = (0.0,)
    free_headings: int = 7
    passing_distance: float = 0.14
    max_candidates: int = 4000
    counted_ratios: tuple[float, ...] = (0.0, 0.5)
    max_views: int = 400_000_000
    dense_objectives: tuple[str, ...] = ("time",)
    max_sight_lines: int = 150_000
    samples_per_clearance: float = 2.0
    sparse_neighbours: int = 16
    turning_ratios: tuple[float, ...] = (1.05, 2.0)
    turning_patch_ratio: float = 0.2
    blocked_ratio: float = 1.5
    free_turn_deg: float = 60.0
    approach_times: tuple[float, ...] = (0.4, 0.8, 1.6, 2.4)
    visit_steps: float = 1.5
    max_recounts: int = 4
    recount_rounds: int = 500
    more_time_share: float = 0.3
    tours: TourSearchPolicy = TourSearchPolicy()

    def __post_init__(self) -> None:
        check_positive(self)
        for name in ("search_time_share", "max_tether_share", "more_time_share"):
            if getattr(self, name) > 1.0:
                raise InputError(f"{name}: expected a share up to 1, got {getattr(self, name)!r}")
        for name in ("standoff_ratios", "heading_offsets_deg", "turning_ratios", "approach_times"):
            values = getattr(self, name)
            if not values or not all(math.isfinite(v) for v in values):
                raise InputError(f"{name}: expected one number or more, got {values!r}")
            if name != "heading_offsets_deg" and min(values) <= 0.0:
                raise InputError(f"{name}: expected numbers above 0, got {values!r}")

"""Policies of the online planners."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive, check_shares
from netsp.world.paths.path_policy import PathPolicy


@dataclass(frozen=True)
class PreviewPolicy:
    """Policy of the simulation of a tether along a path ahead. All numbers are positive.

    Attributes
    ----------
    limit_margin
        Share of the tether's limit that plans leave unused, below 1. The simulated and the flown
        tether differ by less.
    floor_share
        Share of the limit, below 1, up to which lengths need not be exact, because no step from
        there reaches the limit. A larger share measures fewer lengths exactly.
    min_step_s
        Shortest time between two places of the simulation while the anchor moves, s.
    max_cut
        Depth to which a path may cut into solids if any other path does not, as a multiple of the
        mission's `delta`.
    """

    limit_margin: float = 0.004
    floor_share: float = 0.95
    min_step_s: float = 0.1
    max_cut: float = 0.01

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "limit_margin", "floor_share")


@dataclass(frozen=True)
class PredictivePolicy:
    """Policy of `predictive`, which simulates the tether ahead. All numbers are positive.

    Attributes
    ----------
    max_pivots
        Maximum number of places along the tether at which a path may turn off.
    tour_tolerance
        Distance from a planned tour, and difference from its tether, up to which the robot follows
        it, as a multiple of the mission's `reach` (and `reach` plus `delta`).
    min_saving
        Smallest saving for which another path is simulated, as a share of the path.
    min_pull_ratio
        Ratio of the length of a taut path to that of the roughly pulled one. Paths whose rough
        length times this ratio is no better than the best are skipped; a larger one skips more.
    release_rounds
        Number of rounds of relaxation in which a tether at home must come free.
    anchor_check_s
        Time between two checks that the tether lasts while the anchor moves, s.
    anchor_lag_s
        Time by which a robot may be late while the anchor moves, s. The distance that the anchor
        moves in that time is kept in reserve as tether.
    rest_check_s
        Time between two checks that the tether still fits on the rest of a path, s.
    rest_warning_s
        Shortest time in which the limit can be reached, at cruise speed, for which such a check is
        left out, s.
    unmapped_reserve
        Tether kept in reserve while a range sensor may find solids, metres.
    snag_tolerance
        Largest excess of the measured payout over what the map explains for which the plan is kept,
        metres.
    home_check_steps
        Number of steps between two checks that the tether still comes free on the path home.
    min_home_room
        Share of the clearance, or of the room at its ends if that is less, that a path home keeps.
        If it comes nearer to solids, the robot goes home along its own path so far, pulled taut,
        where that keeps more room.
    max_home_attempts
        Maximum number of times that the robot goes back along a tether which is not free at home.
    pull_rounds
        Number of rounds of relaxation in one pull that estimates a taut length.
    max_pulls
        Maximum number of such pulls.
    pull_allowance
        Factor on the decrease that a geometric series of pulls predicts, for the tethers whose
        length decreases less regularly.
    max_overrun
        Length of a tether after all pulls, as a multiple of the limit, above which it is not pulled
        any further.
    """

    max_pivots: int = 24
    tour_tolerance: float = 1.5
    min_saving: float = 0.03
    min_pull_ratio: float = 0.9
    release_rounds: int = 60
    anchor_check_s: float = 2.0
    anchor_lag_s: float = 3.0
    rest_check_s: float = 0.5
    rest_warning_s: float = 2.0
    unmapped_reserve: float = 0.2
    snag_tolerance: float = 0.1
    home_check_steps: int = 20
    min_home_room: float = 0.5
    max_home_attempts: int = 3
    pull_rounds: int = 10
    max_pulls: int = 10
    pull_allowance: float = 2.0
    max_overrun: float = 1.1

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class PlannerPolicy:
    """Policy of all online planners. All numbers are positive.

    Attributes
    ----------
    free_tolerance
        Length by which a tether at home may exceed its first length and still be free, as a
        multiple of the mission's `delta`.
    min_clearance_share
        Share of the clearance that a path must keep when the map changes, at most 1; otherwise it
        is planned again.
    max_holds
        Number of steps with failed planning after which a waypoint is left out.
    max_turn_s
        Longest time for a turn to the heading of a waypoint, s.
    min_pivot_spacing
        Default distance between pivots along a tether, metres; one cell if a cell is larger.
    preview
        Policy of the simulation ahead.
    predictive
        Policy of `predictive`.
    paths
        Policy of the search for paths.
    """

    free_tolerance: float = 0.1
    min_clearance_share: float = 0.7
    max_holds: int = 20
    max_turn_s: float = 30.0
    min_pivot_spacing: float = 0.25
    preview: PreviewPolicy = PreviewPolicy()
    predictive: PredictivePolicy = PredictivePolicy()
    paths: PathPolicy = PathPolicy()

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "min_clearance_share")

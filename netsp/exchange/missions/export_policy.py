"""Policy of exports: depths, holds and speeds that are written, and how paths become waypoints."""

from __future__ import annotations

import math
from dataclasses import dataclass

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class ExportPolicy:
    """Policy of an export. All numbers are positive.

    Attributes
    ----------
    min_depth
        Minimum depth that is written, m. ArduSub takes an altitude of 0 for "keep the present one".
    default_hold_s
        Hold at goals for which neither the settings nor the waypoint state one, s.
    max_hold_s
        Maximum hold that settings may state, s.
    max_speed
        Maximum speed that settings may state, m/s; no underwater vehicle reaches the default.
    min_slack
        Tether left at every goal below which an export warns, in the problem's units. A vehicle
        took up to 0.16 m more tether than planned in simulated missions.
    min_clearance
        Distance from obstacles below which an export warns, in the problem's units. A vehicle lost
        0.13 m of clearance in simulated missions.
    circle_corners
        Number of corners of the polygon, on the circle, that replaces a round obstacle in KML.
    map_pixels
        Width of Cockpit's map that shows all waypoints when the mission is opened, pixels.
    max_arc_turn
        Maximum turn of consecutive bends that are joined into one bend, radians. The default moves
        a corner outwards by 3.5 % of the radius of an arc.
    bend_shifts
        Distances by which a bend is moved outwards if the vehicle could cut through an obstacle
        there, in acceptance radii; the first that helps is used.
    corner_shares
        Shares of the acceptance radius at which corners may be cut, from 0 to 1. The path is
        checked for each, the exact path (0) first.
    """

    min_depth: float = 0.1
    default_hold_s: int = 5
    max_hold_s: int = 3600
    max_speed: float = 20.0
    min_slack: float = 0.3
    min_clearance: float = 0.2
    circle_corners: int = 64
    map_pixels: float = 600.0
    max_arc_turn: float = math.radians(30.0)
    bend_shifts: tuple[float, ...] = (1.0, 2.0, 4.0)
    corner_shares: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75, 1.0)

    def __post_init__(self) -> None:
        check_positive(self)
        if not all(0.0 <= share <= 1.0 for share in self.corner_shares):
            raise InputError(
                f"corner_shares: expected shares from 0 to 1, got {self.corner_shares!r}"
            )


DEFAULT_EXPORT = ExportPolicy()
"""Policy of exports to which none is given."""

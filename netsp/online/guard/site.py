"""Protocol of a site: a world, in the plane or in space, whose tether is watched."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from netsp.base.arrays import ComparesArrays, Floats
from netsp.hsignature import Word
from netsp.online.guard.guard_policy import SitePolicy
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.world_protocol import World


@dataclass(frozen=True, eq=False)
class Loop(ComparesArrays):
    """Loop of a tether.

    Attributes
    ----------
    around
        Indices of the obstacles in the loop.
    line
        Closed polyline from where the loop closes around to there again, shape (k, 2) or (k,
        3), m.
    """

    around: tuple[int, ...]
    line: Floats


class Site(World, Protocol):
    """World of a guarded tether: what a guard needs beyond other users."""

    lookahead_model: GeodesicTether
    """Model that is coarse enough for looks ahead."""
    centres: Floats
    """Centres of obstacles that robots circle, in the plan, shape (n, 2), m."""
    steps_per_update: int
    """Maximum number of steps of looks ahead in one update."""

    @property
    def policy(self) -> SitePolicy:
        """Resolutions and limits."""

    def loops_in(self, nodes: Floats) -> list[Loop]:
        """Return the loops of a taut tether, the last to be closed first."""

    def loop_closed_by(self, nodes: Floats, place: Floats) -> Loop | None:
        """Return the loop that a robot closes by moving straight to a place; None if none."""

    def safe_prefix(self, tether: Tether, places: Floats) -> int:
        """Return over how many of the next places (k, 3) the robot can surely move without closing
        a loop or running out of tether.
        """

    def as_planned(self, robot: Floats, word: Word, off: float) -> bool | None:
        """Return whether the tether is in the class that the tour plans at this visit.

        None if there is no tour, or the robot is at none of its visits, to within `off`, m.
        """

    def map_data(self) -> dict[str, Any]:
        """Return base, obstacles and goals for a map, as JSON."""

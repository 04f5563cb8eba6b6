"""`predictive`: simulates the tether along the coming way before the robot moves.

So the limit is never exceeded on the way that was planned. A waypoint is given up only when no way
to it is found on which the tether fits; since going all the way back along the tether and then the
shortest way is among those that are tried, that does not happen to a waypoint whose own shortest
tether fits (but for the clearance that the robot keeps, and the margin).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from netsp.online.mission import pushed_out
from netsp.online.planner.base import (
    NORMAL,
    RECOVERY,
    Floats,
    Planner,
    dense,
    points_along,
)
from netsp.online.tether import Tether
from netsp.online.tree import ShortestTree, length_of, taut

MARGIN = 0.005
"""Share of the tether that is kept in reserve for what the simulation does not know."""

PIVOTS = 24
"""At most so many places along the tether to turn at."""


@dataclass
class PredictivePlanner(Planner):
    """`Planner` with look-ahead."""

    _planned: int = field(default=-1)

    name = "predictive"

    def plan(self, robot: Floats, tether: Tether) -> bool:
        """One way per waypoint, planned when the robot sets out for it."""
        if self._planned == self.index and len(self.way):
            return False
        self._planned = self.index
        limit = self.mission.tether_length * (1.0 - MARGIN)
        target = self.target
        straight = np.array([robot, target])
        if self.is_free(straight) and self._fits(tether, straight, limit):
            self.way, self.mode = straight[1:], NORMAL
            return True
        way = self._shortest_feasible(robot, tether, limit)
        if way is None:
            own = self._own_tether(target)
            self.give_up(
                "no free way to it" if own is None else
                f"no way on which the tether fits: its shortest tether is {own:.3g} of "
                f"{self.mission.tether_length:g}"
            )  # fmt: skip
            return True
        self.way, self.mode = way[1:], RECOVERY
        return True

    def _fits(self, tether: Tether, way: Floats, limit: float) -> bool:
        """Whether the tether stays within the limit all along a way."""
        fine = max(min(0.5 * self.tethers.delta, 0.5 * self.mission.cell), 0.02)
        most = max(limit, tether.length + 1e-6)
        # what is too long at a few places is too long
        for step in (10.0 * fine, fine):
            _, lengths = self.tethers.drive(tether, dense(way, step))
            if lengths.max() > most:
                return False
        return True

    def _shortest_feasible(self, robot: Floats, tether: Tether, limit: float) -> Floats | None:
        """The shortest way on which the tether fits: on from the robot, or back along the tether to
        a pivot and on from there. One tree serves all pivots; the cheapest are tried first."""
        back = pushed_out(self.scene, tether.nodes[::-1], self.mission.clearance)
        back[0] = robot
        spacing = max(self.mission.cell, length_of(back) / PIVOTS if len(back) > 1 else 0.0)
        pivots = points_along(back, spacing) if len(back) > 1 else back
        pivots[1:] = pushed_out(self.scene, pivots[1:], self.mission.clearance)
        tree = ShortestTree(self.grid, self.target, pivots)
        walked = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(pivots, axis=0), axis=1))]
        for n in np.argsort(walked + tree.lengths, kind="stable"):
            onward = tree.way(int(n))
            if onward is None:
                continue
            onward = taut(self.scene, onward, self.mission.clearance, self.tethers.delta)
            way = np.vstack([pivots[: n + 1], onward[1:]])
            if self._fits(tether, way, limit):
                return way
        return None

    def _own_tether(self, target: Floats) -> float | None:
        """Length of the shortest tether from the anchor to a place."""
        tree = ShortestTree(self.grid, target, np.array([self.mission.anchor]))
        way = tree.way(0)
        return None if way is None else length_of(taut(self.scene, way, 0.0, self.tethers.delta))

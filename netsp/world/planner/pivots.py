"""Pivots: points of a tether at which a recovery path may turn off towards the waypoint."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.world.planner.planner import Planner
from netsp.world.scene.field import pushed_out
from netsp.world.tether import Tether


class Pivots:
    """Points along a tether, each with its shortest path to the waypoint and the tether after it.

    Paths and tethers are computed on demand and cached, so a search that stops at an early pivot
    computes no later one.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        The pivots, metres; the first is the robot, the last the anchor.
    """

    def __init__(self, planner: Planner, tether: Tether) -> None:
        self._planner = planner
        self.points = polylines.points_along(tether.nodes[::-1], planner.pivot_spacing)
        self._paths = planner.paths(pushed_out(planner.scene, self.points, 1e-3))
        self._lengths: dict[int, float] = {}

    def __len__(self) -> int:
        return len(self.points)

    def onward(self, n: int) -> Floats | None:
        """Return the shortest path (k, 3) from a pivot to the waypoint; None if there is none."""
        return self._paths.path(n)

    def path_back(self, n: int) -> Floats:
        """Return the path (n + 1, 3) from the robot back along the tether to a pivot, pushed off
        the surfaces that the tether touches to the mission's clearance."""
        planner = self._planner
        return pushed_out(planner.scene, self.points[: n + 1], planner.mission.clearance)

    def length(self, n: int) -> float:
        """Return the length, metres, of the tether once the robot has gone from a pivot to the
        waypoint; inf if there is no path."""
        if n not in self._lengths:
            self._lengths[n] = self._simulated(n)
        return self._lengths[n]

    def _simulated(self, n: int) -> float:
        onward, planner = self.onward(n), self._planner
        if onward is None:
            return np.inf
        kept = self.points[:n:-1]
        path = np.vstack([kept, onward]) if len(kept) else onward
        start = planner.tethers.start(path[0], path[0])
        dense = polylines.dense(path, 0.5 * planner.grid.cell)
        return planner.payout(planner.tethers.drive(start, dense)[0])

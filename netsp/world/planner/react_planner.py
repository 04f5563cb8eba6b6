"""`react`: Algorithms 2 and 3 of Amer et al. 2025, "REACT".

The paper has an error or leaves a choice at these points:

- Algorithm 2 sets mode, k and the recovery path again at each call; here they are kept.
- It ends recovery at the end of P_safe but follows P_recovery. Here, the refined path is followed,
  and recovery ends at its end.
- Its trigger is L > L_max, so the limit is exceeded before the planner reacts. This is kept.
- Algorithm 3 tests the tether's length at the end of a recovery path, not the longest on the path,
  and accepts the first feasible pivot, not the cheapest. This is kept.
- Its pivots are the nodes of a tether of resolution δ. Here they are `PlannerOptions.pivot_spacing`
  apart, because this tether has nodes only at its bends.
- After a recovery path that was the fallback (the limit as a soft one) the tether is still over the
  limit, and the trigger would fire at every step; it fires again for the next waypoint.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from netsp.base.arrays import Floats
from netsp.world.planner.pivots import Pivots
from netsp.world.planner.planner import HOME, NORMAL, RECOVERY, Planner
from netsp.world.tether import Tether


@dataclass
class ReactPlanner(Planner):
    """Planner of the paper, which turns back once the tether is over the limit."""

    _soft: int = field(default=-1)

    name = "react"
    refine = "paper"

    def plan(self, robot: Floats, tether: Tether) -> bool:
        """Follow the waypoints, or a recovery path while there is one (Algorithm 2)."""
        if self.mode == RECOVERY and len(self.path):
            at_end = len(self.path) == 1 and np.linalg.norm(self.path[0] - robot) <= 1e-6
            if not at_end:
                return False
        if self.mode == RECOVERY:
            self.path, self.mode = self.path[:0], NORMAL
        if self.payout(tether) > self.mission.tether_length and self._soft != self.index:
            self.path = self.recovery(Pivots(self, tether))
            self.mode = RECOVERY
            return True
        return False if len(self.path) else self.plan_direct(robot)

    def plan_home(self, robot: Floats, tether: Tether) -> bool:
        """Go back along the whole tether (the paper's tether recovery)."""
        del robot
        if len(self.path):
            return False
        self.path, self.mode = self.back_along(tether)[1:], HOME
        return True

    def warm_up(self, robot: Floats, tether: Tether) -> None:
        """See `Planner`."""
        del robot
        self.recovery(Pivots(self, tether))
        self._soft = -1

    def recovery(self, pivots: Pivots) -> Floats:
        """Return the refined recovery path (k, 3) without the robot's position, from the first
        feasible pivot backwards along the tether (Algorithm 3).

        If no pivot is feasible, it is the shortest path to the waypoint, whatever the tether.
        """
        limit = self.mission.tether_length
        n = next((n for n in range(len(pivots)) if pivots.length(n) <= limit), None)
        if n is None:
            return self.fallback(pivots)
        onward = pivots.onward(n)
        assert onward is not None
        return self.refined(np.vstack([pivots.path_back(n), self.pull_taut(onward)[1:]]))[1:]

    def fallback(self, pivots: Pivots) -> Floats:
        """Return the shortest path to the waypoint, the limit being a soft one."""
        self._soft = self.index
        onward = pivots.onward(0)
        if onward is None:
            return self.waypoint[None]
        return self.refined(self.pull_taut(onward))[1:]

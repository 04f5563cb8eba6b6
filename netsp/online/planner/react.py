"""`react`: Algorithms 2 and 3 of Amer et al. 2025; `react-draft`: the draft's acceptance rule.

Where the paper would not run as it stands:

- Algorithm 2 sets mode, k and the recovery path anew at every call; they are kept here.
- It ends recovery at the end of P_safe but follows P_recovery; one path, the refined one, is both
  followed and ended at.
- Its trigger is L > L_max, so the limit is exceeded before anything happens. Kept: this is the
  paper's planner.
- Algorithm 3 looks at the tether at the end of a recovery path, not at its longest on the path, and
  takes the first pivot that will do, not the cheapest. Kept.
- After a recovery path that was the fallback (the limit as a soft one) the tether is still too
  long, and the trigger would fire at every step; it fires again for the next waypoint.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from netsp.arrays import Floats
from netsp.geometry import polylines
from netsp.online.paths.tree import Paths
from netsp.online.planner.base import HOME, NORMAL, RECOVERY, Planner
from netsp.online.scene.field import pushed_out
from netsp.online.tether import Tether

DRAFT_SHARE, DRAFT_GAIN = 0.7, 0.65
"""The draft accepts a pivot whose tether is below 0.7 L_max and below 0.65 of that of the pivot
three nodes before."""


@dataclass
class ReactPlanner(Planner):
    """The paper's planner."""

    draft: bool = False
    _soft: int = field(default=-1)

    refine = "paper"

    @property
    def name(self) -> str:  # type: ignore[override]
        """As it is chosen."""
        return "react-draft" if self.draft else "react"

    def plan(self, robot: Floats, tether: Tether) -> bool:
        """Algorithm 2."""
        if self.mode == RECOVERY and len(self.path):
            at_end = len(self.path) == 1 and np.linalg.norm(self.path[0] - robot) <= 1e-6
            if not at_end:
                return False
        if self.mode == RECOVERY:
            self.path, self.mode = self.path[:0], NORMAL
        if self.payout(tether) > self.mission.tether_length and self._soft != self.index:
            self.path = self._search(tether)
            self.mode = RECOVERY
            return True
        return False if len(self.path) else self.go_on(robot)

    def plan_home(self, robot: Floats, tether: Tether) -> bool:
        """Tether recovery as the paper means it: back along the whole tether."""
        del robot
        if len(self.path):
            return False
        self.path, self.mode = self.back_along(tether)[1:], HOME
        return True

    def warm_up(self, robot: Floats, tether: Tether) -> None:
        """See `Planner`."""
        del robot
        self._search(tether)
        self._soft = -1

    def _search(self, tether: Tether) -> Floats:
        """Algorithm 3: pivots backwards along the tether, the first that will do."""
        limit = self.mission.tether_length
        back = polylines.points_along(tether.nodes[::-1], max(self.grid.cell, 0.25))
        tree = self.paths(pushed_out(self.scene, back, 1e-3))
        lengths = [self._augmented(back, tree, n) for n in range(len(back))]
        for n, length in enumerate(lengths):
            if self.draft:
                before = lengths[n + 3] if n + 3 < len(lengths) else np.inf
                good = length < DRAFT_SHARE * limit and length < DRAFT_GAIN * before
            else:
                good = length <= limit
            if not good:
                continue
            retraced = pushed_out(self.scene, back[: n + 1], self.mission.clearance)
            onward = tree.path(n)
            assert onward is not None
            if self.draft:
                # back to two nodes before the pivot; the rest is left to normal mode
                return retraced[1 : max(2, n - 1)]
            onward = self.pulled(onward)
            return self.refined(np.vstack([retraced, onward[1:]]))[1:]
        self._soft = self.index
        onward = tree.path(0)
        if onward is None:
            return self.waypoint[None]
        return self.refined(self.pulled(onward))[1:]

    def _augmented(self, back: Floats, tree: Paths, n: int) -> float:
        """Length of the tether after its part from the anchor to pivot n and the path on from
        there."""
        onward = tree.path(n)
        if onward is None:
            return np.inf
        path = np.vstack([back[:n:-1], onward]) if n + 1 < len(back) else onward
        start = self.tethers.start(path[0], path[0])
        driven = self.tethers.drive(start, polylines.dense(path, 0.5 * self.grid.cell))[0]
        return self.payout(driven)

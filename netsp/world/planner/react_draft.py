"""`react-draft`: the planner of the draft of Amer et al. 2025, as its three algorithms list it;
`react-thresholds`: `react` with the acceptance rule of that draft.

Where text or common sense contradict the listing of the draft, the planner follows the listing:

- Algorithm 2 compares a pivot i with the candidate of the pivot i - 3 that the round *before* has
  computed. That round was of i + 1, so the neighbour is two nodes nearer to the anchor than i,
  where the text says three. The first pivot has no neighbour.
- Pivots run from i = |P| - 3 down to 3, so neither the robot's last two nodes nor the anchor's
  first three are tried.
- An accepted pivot i gives a path back to i + 2 only. For the first pivot that is the position of
  the robot: there is no path to follow, and the robot goes on to the waypoint for one step.
- The robot then goes on to the waypoint in normal mode, which may lead along the old path over the
  limit again. Nothing in the listing ends such a cycle; a mission leaves the waypoint out after
  `SimulationPolicy.max_waypoint_s`.
- Each recovery path is refined once, the fallback, too. If it is then not free, the robot does not
  follow it, but goes on to the waypoint, and the search starts again at the next step.

These points are open in the listing, and are read as follows:

- Random moves. The text seeks "nearby collision-free states", so the refinement keeps any free
  move (`RefineParams.keeps`).
- Length of a candidate. The text speaks of the "candidate alternative tether configuration", so
  it is the length that the tether model gives, as in the paper. The sum of the nodes up to the
  pivot and the new path would do as well; it is never shorter.
- Nodes P. In the draft they are the nodes of a tether of resolution δ; here they are
  `PlannerOptions.pivot_spacing` apart.
- End of recovery. A recovery path to the waypoint ends in normal mode with the tether over the
  limit, and the waypoint would never count as reached. By the text normal operation goes on with
  the next waypoint "that has not yet been reached", so it counts.
- Path home. The draft has none; it is that of `react`, back along the tether.

`benchmarks/draft_readings.py` flies the other readings, too (docs/notebook/reproduction.md).

Nodes of a taut tether lie on surfaces. The path back is pushed off them, because the robot needs
room.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.world.paths.refine import clear
from netsp.world.planner.pivots import Pivots
from netsp.world.planner.planner import NORMAL, RECOVERY
from netsp.world.planner.react_planner import ReactPlanner
from netsp.world.tether import Tether


@dataclass(frozen=True)
class DraftRule:
    """Rule by which the draft accepts a pivot.

    Parameters
    ----------
    max_share : float
        Largest tether after the candidate, as a share of the limit; more than 0, at most 1.
    max_gain : float
        Largest tether after the candidate, as a share of the tether after the neighbour's
        candidate; more than 0, at most 1.
    neighbour : int
        Number of nodes from a pivot towards the anchor to its neighbour; at least 1.
    """

    max_share: float = 0.7
    max_gain: float = 0.65
    neighbour: int = 3

    def __post_init__(self) -> None:
        for name in ("max_share", "max_gain"):
            value = getattr(self, name)
            if not 0.0 < value <= 1.0:
                raise InputError(f"{name}: expected more than 0 and at most 1, got {value!r}")
        if self.neighbour < 1:
            raise InputError(f"neighbour: expected 1 or more, got {self.neighbour!r}")

    def accepts(self, length: float, neighbour: float, limit: float) -> bool:
        """Return whether a pivot is accepted.

        Parameters
        ----------
        length, neighbour : float
            Length of the tether after the candidates of the pivot and of its neighbour, metres; inf
            without a neighbour.
        limit : float
            Limit of the tether, metres.
        """
        return length < self.max_share * limit and length < self.max_gain * neighbour


@dataclass
class ReactDraftPlanner(ReactPlanner):
    """Planner of the draft, by its listing."""

    rule: DraftRule = field(default_factory=DraftRule)
    _searches: int = field(default=0)

    name = "react-draft"

    def plan(self, robot: Floats, tether: Tether) -> bool:
        """Follow a recovery path while there is one, else go on to the waypoint (Algorithm 1)."""
        searched = False
        if self.payout(tether) > self.mission.tether_length and self.mode != RECOVERY:
            self.path, self.mode, searched = self.recovery(Pivots(self, tether)), RECOVERY, True
        if self.mode == RECOVERY:
            ended = len(self.path) == 1 and np.linalg.norm(self.path[0] - robot) <= 1e-6
            if len(self.path) and not ended:
                return searched
            self.path, self.mode = self.path[:0], NORMAL
        return False if len(self.path) else self.plan_direct(robot) or searched

    def recovery(self, pivots: Pivots) -> Floats:
        """Return the refined recovery path (k, 3) without the robot's position (Algorithms 2 and
        3).

        It has no points if the refined path is not free, or the path back ends at the robot.
        """
        self._searches += 1
        path = self.found(pivots)
        if len(path) < 2:
            return path[1:]
        safe = self.refined_once(path, self._searches)
        return safe[1:] if clear(self.scene, safe, 0.0) else safe[:0]

    def found(self, pivots: Pivots) -> Floats:
        """Search for a recovery path (k, 3) (Algorithm 2).

        It leads from the robot back to two nodes before the accepted pivot; if no pivot is
        accepted, it is the shortest path to the waypoint.

        Parameters
        ----------
        pivots : Pivots
            Pivots along the present tether; number n is node i = |P| - 1 - n of the listing.
        """
        limit, neighbour = self.mission.tether_length, np.inf
        for n in range(2, len(pivots) - 3):
            if self.rule.accepts(pivots.length(n), neighbour, limit):
                return pivots.path_back(n - 2)
            neighbour = pivots.length(n + self.rule.neighbour)
        onward = pivots.onward(0)
        if onward is None:
            return np.vstack([pivots.points[0], self.waypoint])
        return self.pull_taut(onward)


@dataclass
class ReactThresholdsPlanner(ReactPlanner):
    """Planner `react` with the acceptance rule of the draft.

    Pivots run to the anchor, and each is compared with the pivot three nodes nearer to the anchor.
    The path back ends two nodes before the accepted pivot, and is not refined.
    """

    rule: DraftRule = field(default_factory=DraftRule)

    name = "react-thresholds"

    def recovery(self, pivots: Pivots) -> Floats:
        """Search pivots backwards along the tether for a path (k, 3); see `ReactPlanner`."""
        limit, count = self.mission.tether_length, len(pivots)
        for n in range(count):
            if pivots.length(n) >= self.rule.max_share * limit:
                continue
            further = n + self.rule.neighbour
            neighbour = pivots.length(further) if further < count else np.inf
            if self.rule.accepts(pivots.length(n), neighbour, limit):
                return pivots.path_back(n)[1 : max(2, n - 1)]
        return self.fallback(pivots)

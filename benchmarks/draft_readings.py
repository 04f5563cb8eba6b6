"""Readings of the draft's listing (`netsp.world.planner.react_draft`), flown in the basin.

    python benchmarks/draft_readings.py [MISSION] [--keep]

Each row changes one point that the listing leaves open. Nothing is random.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from table import ROOT, head, row

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.world.mission.mission import Mission
from netsp.world.paths.refine import RefineParams
from netsp.world.planner import PlannerOptions
from netsp.world.planner.pivots import Pivots
from netsp.world.planner.planner import Planner
from netsp.world.planner.react_draft import ReactDraftPlanner
from netsp.world.simulator.mission_run import simulate
from netsp.world.tether import Tether


@dataclass
class DraftReading(ReactDraftPlanner):
    """Planner of the draft with one point of its listing read otherwise.

    Parameters
    ----------
    length : {"model", "sum", "trajectory"}
        Length of a candidate: of the tether that the model gives, of the nodes up to the pivot and
        the new path, or of the way back to the pivot and the new path.
    compared : {"round before", "same round"}
        Whose pivot i - 3 a pivot is compared with.
    first : int
        Number of the first pivot, counted from the robot, which is 0.
    last : int
        Number of nodes at the anchor that are no pivots.
    is_pulled : bool
        Pull the fallback taut before it is refined.
    goes_straight_home : bool
        Take the shortest way home instead of the way back along the tether.
    """

    length: str = "model"
    compared: str = "round before"
    first: int = 2
    last: int = 3
    is_pulled: bool = True
    goes_straight_home: bool = False
    n_found: int = 0

    def found(self, pivots: Pivots) -> Floats:
        """Search for a recovery path (Algorithm 2)."""
        limit, neighbour = self.mission.tether_length, np.inf
        for n in range(self.first, len(pivots) - self.last):
            if self.compared == "same round":
                neighbour = self.candidate(pivots, n + 3)
            if self.rule.accepts(self.candidate(pivots, n), neighbour, limit):
                self.n_found += 1
                return pivots.path_back(max(0, n - 2))
            if self.compared == "round before":
                neighbour = self.candidate(pivots, n + 3)
        onward = pivots.onward(0)
        if onward is None:
            return np.vstack([pivots.points[0], self.waypoint])
        return self.pull_taut(onward) if self.is_pulled else onward

    def candidate(self, pivots: Pivots, n: int) -> float:
        """Return the length of the candidate of pivot n, metres; inf beyond the anchor."""
        if n >= len(pivots):
            return np.inf
        if self.length == "model":
            return pivots.length(n)
        onward = pivots.onward(n)
        if onward is None:
            return np.inf
        kept = pivots.points[n:] if self.length == "sum" else pivots.points[: n + 1]
        return polylines.length(kept) + polylines.length(onward)

    def plan_home(self, robot: Floats, tether: Tether) -> bool:
        """Plan the way home; see `Planner`."""
        plan = Planner.plan_home if self.goes_straight_home else ReactDraftPlanner.plan_home
        return plan(self, robot, tether)


FARTHER = RefineParams(keeps="farther")

READINGS: tuple[tuple[str, dict[str, Any], dict[str, Any]], ...] = (
    ("`react-draft`", {}, {}),
    ("refinement keeps only moves away from solids", {}, {"refine_params": FARTHER}),
    ("no refinement", {}, {"refine": "none"}),
    ("fallback not pulled taut", {"is_pulled": False}, {}),
    ("length: nodes up to the pivot, and the new path", {"length": "sum"}, {}),
    ("length: way back to the pivot, and the new path", {"length": "trajectory"}, {}),
    ("compared with pivot i - 3 (the text)", {"compared": "same round"}, {}),
    ("nodes counted from 1", {"first": 3, "last": 2}, {}),
    ("pivots to the anchor", {"last": 0}, {}),
    ("nodes 0.1 m apart", {"length": "sum"}, {"pivot_spacing": 0.1}),
    ("nodes 1 m apart", {}, {"pivot_spacing": 1.0}),
    ("straight home", {"goes_straight_home": True}, {}),
)
"""Name, what the planner does otherwise, and its options. Nodes 0.1 m apart are tried with sums
only, because the tether model takes minutes for them."""


def fly(mission: Mission, scene: Any, field: Any, how: dict[str, Any], options: dict[str, Any]):
    """Return the run of a reading, and its planner."""
    planners: list[DraftReading] = []

    def made(*args: Any, **named: Any) -> DraftReading:
        planners.append(DraftReading(*args, **named, **how))
        return planners[-1]

    run = simulate(
        mission, made, options=PlannerOptions(**options), scene=scene, field=field, snap=True
    )
    return run, planners[0]


def table(mission: Mission) -> None:
    """Print a row for each reading."""
    scene = mission.load_scene()
    field = scene.field()
    for name, how, options in READINGS:
        run, planner = fly(mission, scene, field, how, options)
        s = run.summary
        row(
            name, planner.n_found, planner._searches - planner.n_found, f"{s['inspection_s']:.1f}",
            f"{s['home']['seconds']:.1f}", f"{s['longest_tether']:.2f}", f"{s['exceedance_s']:.1f}",
            f"{s['visited']} of {s['waypoints']}",
        )  # fmt: skip


def main() -> None:
    """Fly every reading."""
    name = sys.argv[1] if len(sys.argv) > 1 else "basin"
    head(
        "reading", "searches that find a pivot", "that fall back", "inspection s", "home s",
        "longest tether m", "over the limit s", "visited", name="react-draft-readings",
    )  # fmt: skip
    table(Mission.load(ROOT / "missions" / f"{name}.json"))


if __name__ == "__main__":
    main()

"""Site of a problem in the plane."""

from __future__ import annotations

from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.hsignature import Word
from netsp.model.problem import Problem
from netsp.online.guard.guard_policy import SitePolicy
from netsp.online.guard.loops import loop_closed_by, loops_in
from netsp.online.guard.site import Loop
from netsp.online.guard.skip_free_water import safe_prefix
from netsp.roadmap.plane_world import PlaneWorld
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.tether.resolution import coarsest_delta


class PlaneSite(PlaneWorld):
    """Problem as the site of a guard; its base, obstacles and tether count.

    Parameters
    ----------
    problem : Problem
        The problem.
    policy : SitePolicy
        Resolutions and limits.
    """

    policy: SitePolicy

    def __init__(self, problem: Problem, policy: SitePolicy = SitePolicy()) -> None:
        super().__init__(problem, policy=policy)
        self.steps_per_update = policy.plane_steps_per_update
        self.centres = self.rays
        coarse = policy.lookahead_coarseness * self.model.delta
        self.lookahead_model = GeodesicTether(
            self.field, min(coarse, coarsest_delta(problem) / 1.1)
        )
        _ = self.exact_tethers  # a position must not wait for their tangents

    def loops_in(self, nodes: Floats) -> list[Loop]:
        """Return the loops of a taut tether in the plan, the last to be closed first."""
        return loops_in(self.problem, nodes[:, :2])

    def loop_closed_by(self, nodes: Floats, place: Floats) -> Loop | None:
        """Return the loop that a robot closes by moving straight to a place; None if none."""
        return loop_closed_by(self.problem, nodes[:, :2], np.array([nodes[-1, :2], place[:2]]))

    def safe_prefix(self, tether: Tether, places: Floats) -> int:
        """Return over how many places the robot can surely move without closing a loop."""
        return safe_prefix(self.field, tether, places, self.tether_length)

    def as_planned(self, robot: Floats, word: Word, off: float) -> bool | None:
        """Return None: a problem has no tour."""
        return None

    def map_data(self) -> dict[str, Any]:
        """Return base, goals, and rims of obstacles without and with the clearance."""
        problem, obstacles = self.problem, []
        for i, o in enumerate(problem.obstacles):
            rim = np.asarray(o.shape(0.0).exterior.coords)[:, :2]
            grown = np.asarray(o.shape(problem.clearance).exterior.coords)[:, :2]
            obstacles.append(
                {
                    "name": problem.obstacle_name(i),
                    "middle": [float(v) for v in self.rays[i]],
                    "rim": rim.round(3).tolist(),
                    "grown": grown.round(3).tolist(),
                }
            )
        return {
            "base": list(problem.base),
            "obstacles": obstacles,
            "goals": [{"name": g.name, "position": list(g.position)} for g in problem.goals],
        }

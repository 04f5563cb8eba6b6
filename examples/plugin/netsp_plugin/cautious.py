"""`cautious`: straight to every waypoint that lies within a share of the tether of the anchor; the
others are left out."""

from __future__ import annotations

import numpy as np

from netsp.world.planner import Planner

SHARE = 0.8


class CautiousPlanner(Planner):
    """Leaves out what is far."""

    name = "cautious"

    def plan(self, robot, tether):
        """Decide about the waypoint that is next; whether anything had to be thought about."""
        away = np.linalg.norm(self.waypoint - np.array(self.mission.anchor))
        if away > SHARE * self.mission.tether_length:
            self.leave_out("too far from the anchor for a cautious planner")
            return True
        return super().plan(robot, tether)

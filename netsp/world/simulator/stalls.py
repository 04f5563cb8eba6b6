"""Detection of stalls: a robot that makes no progress, for example in a strong current."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from netsp.base.geometry import polylines
from netsp.world.planner import Command, Planner
from netsp.world.planner.planner import HOLD, WAIT
from netsp.world.simulator.simulation import Simulation


@dataclass
class Stalls:
    """Stalls of a robot: times in which it made no progress along its path.

    Parameters
    ----------
    found : list of dict
        Time (s), waypoint and place of each stall.
    reason : str
        Reason of the last stall, in one line.
    """

    found: list[dict[str, Any]] = field(default_factory=list)
    reason: str = ""
    _index: int = -1
    _min_left: float = math.inf
    _since: float = 0.0

    def check(self, world: Simulation, planner: Planner, command: Command) -> bool:
        """Return whether the robot has stalled, and record the stall.

        It has if the rest of the path has not become shorter for `stall_s`. A new path restarts the
        time.
        """
        position = world.vehicle.position
        left = polylines.length(np.vstack([position, command.path]))
        # home may move away as fast as the robot follows
        chasing = command.mode == WAIT or (planner.is_homeward and planner.is_anchor_moving)
        planned = planner.index != self._index or command.replan_s > 0.0
        if chasing or planned or left < self._min_left - world.policy.stall_progress:
            self._index, self._min_left, self._since = planner.index, left, world.now
            return False
        stall_s = world.policy.stall_s
        if world.now - self._since < stall_s or command.mode == HOLD:
            return False
        water = float(np.linalg.norm(world.water(world.now)))
        self.reason = f"stalled: no progress in {stall_s:g} s, in water of {water:.2f} m/s"
        self.found.append(
            {"time": world.now, "waypoint": planner.index, "position": position.tolist()}
        )
        self._index = -1
        return True

"""`straight`: a tether that knows of no obstacle. What a planner that believes it gets wrong is in
the log, which is always of the taut tether."""

from __future__ import annotations

import numpy as np

from netsp.world.tether import GeodesicTether, Tether


class StraightTether:
    """Made of a distance field and a resolution, as every tether model is."""

    name = "straight"

    def __init__(self, field, delta):
        self.model = GeodesicTether(field, delta)

    def start(self, anchor, robot):
        """The tether along the line of sight."""
        return self.model.start(anchor, robot)

    def update(self, tether, robot):
        """Straight from the anchor to the robot, whatever stands between."""
        ends = tether.strand[[0, -1]].copy()
        ends[1, :3] = robot
        return Tether(ends, float(np.linalg.norm(ends[1, :3] - ends[0, :3])))

    def drive(self, tether, path):
        """Along a path (k, 3); and the length (k,) at each of its points."""
        lengths = []
        for point in np.asarray(path, dtype=float):
            tether = self.update(tether, point)
            lengths.append(tether.length)
        return tether, np.array(lengths)

    def lay(self, path):
        """From the first point of a path (k, 3), the anchor, to its last."""
        start = self.model.start(path[0], path[1])
        return self.update(start, path[-1])

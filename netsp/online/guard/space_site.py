"""Site of a mission in space."""

from __future__ import annotations

from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.hsignature import Word
from netsp.online.guard.guard_policy import SitePolicy
from netsp.online.guard.silhouettes import silhouette
from netsp.online.guard.site import Loop
from netsp.online.guard.winding import space_loop_closed_by, space_loops_in
from netsp.plan.space.space_world import SpaceWorld
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene
from netsp.world.tether import Tether


class SpaceSite(SpaceWorld):
    """Mission as the site of a guard; its state and its tour count, if it has them.

    Parameters
    ----------
    mission : Mission
        The mission.
    scene : Scene, optional
        Scene of the mission; loaded if it is not given.
    policy : SitePolicy
        Resolutions and limits.

    Raises
    ------
    InputError
        The anchor moves or is out of the water, or the scene has no words
        (`netsp.plan.space.space_signature.SpaceSignature`).
    """

    policy: SitePolicy

    def __init__(
        self, mission: Mission, scene: Scene | None = None, policy: SitePolicy = SitePolicy()
    ) -> None:
        if mission.track:
            raise InputError("track: a moving anchor cannot be watched; expected one that stays")
        super().__init__(mission, scene, policy)
        _ = self.context, self.start  # a position must not wait for them
        self.steps_per_update = policy.space_steps_per_update
        self.lookahead_model = self.model
        self.centres = np.zeros((0, 2))

    def loops_in(self, nodes: Floats) -> list[Loop]:
        """Return the loops of a taut tether, the last to be closed first."""
        return space_loops_in(self.field, self.model, nodes, self.policy)

    def loop_closed_by(self, nodes: Floats, place: Floats) -> Loop | None:
        """Return the loop that a robot closes by moving straight to a place; None if none."""
        return space_loop_closed_by(self.field, self.model, nodes, place, self.policy)

    def safe_prefix(self, tether: Tether, places: Floats) -> int:
        """Return 0: the ends of a tether in space do not tell when it comes off its contacts."""
        return 0

    def as_planned(self, robot: Floats, word: Word, off: float) -> bool | None:
        """Return whether the word is that of a visit within reach; None if no visit is."""
        tour = self.mission.tour
        if tour is None:
            return None
        ends = np.array([visit.path[-1] for visit in tour.stops]).reshape(-1, 3)
        far = np.linalg.norm(ends - robot, axis=1)
        at = np.flatnonzero(far <= max(self.mission.reach, self.model.delta) + off)
        if not len(at):
            return None
        # visits may be near one another
        planned = []
        for k in at:
            (letters,) = self.letters.words_of_steps(ends[k][None], robot[None])
            signature = tour.stops[k].signature
            if letters is not None and signature is not None:
                planned.append(self.letters.join(tuple(signature), letters))
        return word in planned if planned else None

    def map_data(self) -> dict[str, Any]:
        """Return the anchor, the waypoints, and the solids from above."""
        obstacles = []
        for k, solid in enumerate(self.scene.solids):
            for rim in silhouette(solid.shape, self.policy.arc_segments):
                middle = rim.mean(0)
                obstacles.append(
                    {
                        "name": self.name_of(k),
                        "middle": middle.round(3).tolist(),
                        "rim": rim.round(3).tolist(),
                        "grown": rim.round(3).tolist(),
                    }
                )
        return {
            "base": self.anchor[:2].tolist(),
            "obstacles": obstacles,
            "goals": [
                {"name": f"waypoint {n}", "position": list(w.position)}
                for n, w in enumerate(self.mission.waypoints, 1)
            ],
        }

"""Places that a tour may visit: waypoints, their alternatives, and the present place of the
robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.errors import InputError
from netsp.plan.space.planning_context import DIP_RATIO
from netsp.world.mission.mission import Mission
from netsp.world.scene.field import DistanceField


@dataclass(frozen=True)
class Places:
    """Places where states are searched for.

    Attributes
    ----------
    points
        (n, 3) metres: the waypoints in their order, each followed by its alternatives, then the
        present place.
    waypoint
        (n,) number of the waypoint of each place; for the present place, the number of waypoints.
    choice
        (n,) number of the alternative, from 1 on; 0 for the position of the waypoint itself.
    present
        Number of the place where the mission begins; None if that is the start.
    """

    points: Floats
    waypoint: Ints
    choice: Ints
    present: int | None

    @classmethod
    def for_mission(cls, mission: Mission, field: DistanceField) -> Places:
        """Return the places of a mission.

        Raises
        ------
        InputError
            A place that lies inside a solid, or touches one.
        """
        points, waypoint, choice = [], [], []
        for k, w in enumerate(mission.waypoints):
            for c, position in enumerate([w.position, *(v.position for v in w.alternatives)]):
                points.append(position)
                waypoint.append(k)
                choice.append(c)
        present = None
        if mission.state is not None:
            present = len(points)
            points.append(mission.state.position)
            waypoint.append(len(mission.waypoints))
            choice.append(0)
        places = cls(np.array(points), np.array(waypoint), np.array(choice), present)
        room = field.distance(places.points)
        tight = np.flatnonzero((room < DIP_RATIO * mission.delta) & places.is_waypoint)
        if len(tight):
            n = tight[0]
            choice = places.choice[n]
            name = f"waypoints[{places.waypoint[n]}]" + (
                f".alternatives[{choice - 1}]" if choice else ""
            )
            raise InputError(
                f"{name}: is {'inside a solid' if room[n] < 0.0 else f'{room[n]:.3g} m from one'}; "
                f"expected {DIP_RATIO * mission.delta:.3g} m of water or more"
            )
        return places

    def __len__(self) -> int:
        return len(self.points)

    @property
    def distances(self) -> Floats:
        """Return the straight distances (n, n), metres; infinite between places of one waypoint."""
        distances = np.linalg.norm(self.points[:, None] - self.points[None], axis=2)
        distances[self.waypoint[:, None] == self.waypoint[None]] = np.inf
        return np.asarray(distances)

    @property
    def is_waypoint(self) -> Bools:
        """Return the mask (n,) of all places but the present one."""
        return np.asarray(np.arange(len(self)) != (-1 if self.present is None else self.present))

"""Where a tour may stop: the waypoints, their alternatives, and where the robot is by now."""

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
    """The points that states are sought at.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Metres; waypoints in their order, each followed by its alternatives, then the state.
    waypoint : ndarray of int, shape (n,)
        Which waypoint each is a place of; of the state, the number of waypoints.
    choice : ndarray of int, shape (n,)
        Which of its waypoint's alternatives it is, from 1 on; 0 for the waypoint's own position.
    present : int or None
        Number of the point of the mission's state; None where the robot is at the start.
    """

    points: Floats
    waypoint: Ints
    choice: Ints
    present: int | None

    @classmethod
    def for_mission(cls, mission: Mission, field: DistanceField) -> Places:
        """The places of a mission.

        Parameters
        ----------
        mission : Mission
            Its waypoints and its state count.
        field : DistanceField
            Its scene.

        Returns
        -------
        Places
            The places.

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
        out = cls(np.array(points), np.array(waypoint), np.array(choice), present)
        room = field.distance(out.points)
        tight = np.flatnonzero((room < DIP_RATIO * mission.delta) & out.is_waypoint)
        if len(tight):
            n = tight[0]
            choice = out.choice[n]
            name = f"waypoints[{out.waypoint[n]}]" + (
                f".alternatives[{choice - 1}]" if choice else ""
            )
            raise InputError(
                f"{name}: is {'inside a solid' if room[n] < 0.0 else f'{room[n]:.3g} m from one'}; "
                f"expected {DIP_RATIO * mission.delta:.3g} m of water or more"
            )
        return out

    def __len__(self) -> int:
        return len(self.points)

    @property
    def distances(self) -> Floats:
        """(n, n) straight distances, metres; infinite between places of one waypoint."""
        distances = np.linalg.norm(self.points[:, None] - self.points[None], axis=2)
        distances[self.waypoint[:, None] == self.waypoint[None]] = np.inf
        return np.asarray(distances)

    @property
    def is_waypoint(self) -> Bools:
        """(n,) all but the state."""
        return np.asarray(np.arange(len(self)) != (-1 if self.present is None else self.present))

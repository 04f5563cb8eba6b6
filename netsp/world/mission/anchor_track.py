"""Position of a moving anchor: on a ship, or on a second vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from netsp.base.arrays import ComparesArrays, Floats
from netsp.base.errors import InputError
from netsp.base.geometry import polylines

if TYPE_CHECKING:
    from netsp.world.mission.mission import Mission
    from netsp.world.scene.field import DistanceField


@dataclass(frozen=True, eq=False)
class AnchorTrack(ComparesArrays):
    """Positions of an anchor over time; between them it moves straight at a constant speed.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Times since the mission began, s, ascending from 0; the anchor stays at the last position.
    places : ndarray, shape (n, 3)
        Positions, metres.
    """

    times: Floats
    places: Floats

    @classmethod
    def for_mission(cls, mission: Mission) -> AnchorTrack | None:
        """Return the track of a mission's anchor; None if the anchor stays."""
        if not mission.track:
            return None
        rows = np.array([(0.0, *mission.anchor), *mission.track])
        return cls(rows[:, 0], rows[:, 1:])

    def __call__(self, now: float) -> Floats:
        """Return the position (3,), metres, at a time, s."""
        return np.array([np.interp(now, self.times, self.places[:, k]) for k in range(3)])

    def between(self, since: float, until: float) -> Floats:
        """Return the polyline (k, 3) that the anchor travels between two times in seconds, with
        both ends."""
        corners = self.places[(self.times > since) & (self.times < until)]
        return np.vstack([self(since), corners, self(until)])

    def distance_between(self, since: float, until: float) -> float:
        """Return the distance that the anchor travels between two times in seconds, metres."""
        return polylines.length(self.between(since, until))

    @property
    def end(self) -> float:
        """Time at which the anchor stops, s."""
        return float(self.times[-1])

    @cached_property
    def speeds(self) -> Floats:
        """Speeds (n - 1,) from each position to the next, m/s."""
        legs = np.linalg.norm(np.diff(self.places, axis=0), axis=1)
        return np.asarray(legs / np.diff(self.times))

    @cached_property
    def speed(self) -> float:
        """Maximum speed, m/s."""
        return float(self.speeds.max())

    def check(self, field: DistanceField, delta: float) -> None:
        """Raise InputError if the track leads through a solid.

        Parameters
        ----------
        delta : float
            Resolution of the tether, metres.
        """
        for k in range(1, len(self.places)):
            place = field.free_point(self.places[k], f"track[{k - 1}]")
            if not field.line_of_sight(self.places[k - 1], place, depth=0.125 * delta):
                raise InputError(
                    f"track[{k - 1}]: from {self.times[k - 1]:g} s to {self.times[k]:g} s the "
                    "anchor would go through a solid"
                )

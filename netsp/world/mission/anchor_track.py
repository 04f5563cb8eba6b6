"""Where a moving anchor is: on a ship, or on a second vehicle."""

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
class Track(ComparesArrays):
    """Positions over time, straight and steady in between; at the last one the anchor stays.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Seconds since the mission began, ascending, the first one 0.
    places : ndarray, shape (n, 3)
        Metres.
    """

    times: Floats
    places: Floats

    @classmethod
    def of(cls, mission: Mission) -> Track | None:
        """The track of a mission's anchor.

        Parameters
        ----------
        mission : Mission
            The mission.

        Returns
        -------
        Track or None
            None where the anchor stays.
        """
        if not mission.track:
            return None
        rows = np.array([(0.0, *mission.anchor), *mission.track])
        return cls(rows[:, 0], rows[:, 1:])

    def __call__(self, now: float) -> Floats:
        """(3,) where the anchor is at a time in seconds."""
        return np.array([np.interp(now, self.times, self.places[:, k]) for k in range(3)])

    def between(self, since: float, until: float) -> Floats:
        """Where the anchor goes.

        Parameters
        ----------
        since, until : float
            Seconds.

        Returns
        -------
        ndarray, shape (k, 3)
            Its position at both times, and the corners of its track that lie between; metres.
        """
        corners = self.places[(self.times > since) & (self.times < until)]
        return np.vstack([self(since), corners, self(until)])

    def travelled(self, since: float, until: float) -> float:
        """How far the anchor goes.

        Parameters
        ----------
        since, until : float
            Seconds.

        Returns
        -------
        float
            Metres.
        """
        return polylines.length(self.between(since, until))

    @property
    def end(self) -> float:
        """When it stops, seconds."""
        return float(self.times[-1])

    @cached_property
    def speeds(self) -> Floats:
        """(n - 1,) from each position to the next, m/s."""
        legs = np.linalg.norm(np.diff(self.places, axis=0), axis=1)
        return np.asarray(legs / np.diff(self.times))

    @cached_property
    def speed(self) -> float:
        """The fastest, m/s."""
        return float(self.speeds.max())

    def check(self, field: DistanceField, delta: float) -> None:
        """Refuse a track through solids.

        Parameters
        ----------
        field : DistanceField
            The scene.
        delta : float
            Resolution of the tether, metres.

        Raises
        ------
        InputError
            A position, or the way to it, is not in the water.
        """
        for k in range(1, len(self.places)):
            place = field.free_point(self.places[k], f"track[{k - 1}]")
            if not field.line_of_sight(self.places[k - 1], place, depth=0.125 * delta):
                raise InputError(
                    f"track[{k - 1}]: from {self.times[k - 1]:g} s to {self.times[k]:g} s the "
                    "anchor would go through a solid"
                )

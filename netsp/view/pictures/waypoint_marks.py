"""Marks of the waypoints of a mission in pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats


@dataclass(frozen=True)
class WaypointMarks:
    """Waypoints of a mission, and how they are marked.

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Waypoints, metres.
    left_out : tuple of int
        Indices of the waypoints that are not visited.
    anchor : (x, y, z) or None
        Anchor of the tether, which is drawn if there is no tether.
    visited : bool
        Whether the waypoints that are not left out have been visited; otherwise they are planned.
    """

    places: Floats
    left_out: tuple[int, ...] = ()
    anchor: tuple[float, float, float] | None = None
    visited: bool = False

    @property
    def name(self) -> str:
        """Legend of the waypoints that are not left out."""
        return "waypoint visited" if self.visited else "waypoint"

    @property
    def every_place(self) -> Floats:
        """Positions (m, 3) of all marks, metres."""
        return self.places if self.anchor is None else np.vstack([self.places, self.anchor])

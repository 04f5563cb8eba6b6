"""Taut tethers in a distance field: `GeodesicTether` (ours) and `ReactTether` (the paper's)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.registry import Registry, later, make_part
from netsp.world.scene.field import DistanceField
from netsp.world.tether.geodesic import GeodesicTether
from netsp.world.tether.react_tether import ReactTether
from netsp.world.tether.taut_tether import Contact, Tether


class TetherModel(Protocol):
    """Model of a tether that planners use. States are immutable."""

    name: str

    def start(self, anchor: npt.ArrayLike, robot: npt.ArrayLike) -> Tether:
        """Return the tether along the line of sight.

        Parameters
        ----------
        anchor : array_like, shape (3,)
            Position of the anchor, metres.
        robot : array_like, shape (3,)
            Position of the robot, metres.
        """

    def update(self, tether: Tether, robot: npt.ArrayLike) -> Tether:
        """Return the tether after the robot has gone straight to a place.

        Parameters
        ----------
        tether : Tether
            Tether before the motion; it must not be changed.
        robot : array_like, shape (3,)
            New position of the robot, metres.
        """

    def drive(self, tether: Tether, path: npt.ArrayLike) -> tuple[Tether, Floats]:
        """Return the tether after the robot has passed points, and its length at each.

        Parameters
        ----------
        tether : Tether
            Tether before the motion; it must not be changed.
        path : array_like, shape (k, 3)
            Points, metres.

        Returns
        -------
        tether : Tether
            Tether at the last point.
        lengths : ndarray, shape (k,)
            Length at each point, metres.
        """

    def lay(self, path: npt.ArrayLike) -> Tether:
        """Return the tether after a robot has travelled a path from its anchor on.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            Path from the anchor to the robot, metres.
        """


TETHERS: Registry[Callable[[DistanceField, float], Any]] = Registry(
    "tether", "netsp.tethers", {"geodesic": GeodesicTether, "react": ReactTether}, later
)
"""Factories of tether models by name; each takes a distance field and a resolution in metres."""


def make_tether(
    model: str | Callable[[DistanceField, float], Any], field: DistanceField, delta: float
) -> Any:
    """Return a tether model by name, or the one that a callable makes.

    Parameters
    ----------
    model : str or callable
        One of `TETHERS`, or ``f(field, delta) -> TetherModel``.
    field : DistanceField
        Distance field of the scene.
    delta : float
        Resolution, metres.

    Raises
    ------
    InputError
        No model has that name; a callable takes other arguments, or what it makes is no model.
    """
    factory = model if callable(model) else TETHERS.named(model)
    arguments = {"field": field, "delta": delta}
    return make_part("tether", factory, arguments, ("start", "update", "drive", "lay"))


__all__ = [
    "TETHERS",
    "Contact",
    "GeodesicTether",
    "ReactTether",
    "Tether",
    "TetherModel",
    "make_tether",
]

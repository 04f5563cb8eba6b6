"""Taut tethers in a distance field: `GeodesicTether` (ours) and `ReactTether` (the paper's)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.registry import Registry, later
from netsp.world.scene.field import DistanceField
from netsp.world.tether.geodesic import GeodesicTether
from netsp.world.tether.react_tether import ReactTether
from netsp.world.tether.taut_tether import Contact, Tether


class TetherModel(Protocol):
    """How a tether behaves: what a planner believes. States are immutable."""

    name: str

    def start(self, anchor: npt.ArrayLike, robot: npt.ArrayLike) -> Tether:
        """The tether along the line of sight.

        Parameters
        ----------
        anchor : array_like, shape (3,)
            Where it is fixed, metres.
        robot : array_like, shape (3,)
            Where it ends, metres.

        Returns
        -------
        Tether
            The tether.
        """

    def update(self, tether: Tether, robot: npt.ArrayLike) -> Tether:
        """The tether after the robot has gone straight to a place.

        Parameters
        ----------
        tether : Tether
            Before; it must not be changed.
        robot : array_like, shape (3,)
            New position of the robot, metres.

        Returns
        -------
        Tether
            After.
        """

    def drive(self, tether: Tether, path: npt.ArrayLike) -> tuple[Tether, Floats]:
        """The tether after the robot has passed some points.

        Parameters
        ----------
        tether : Tether
            Before; it must not be changed.
        path : array_like, shape (k, 3)
            The points, metres.

        Returns
        -------
        tether : Tether
            At the last point.
        lengths : ndarray, shape (k,)
            Length at each point, metres.
        """

    def lay(self, path: npt.ArrayLike) -> Tether:
        """The tether after a robot has travelled a path from its anchor on.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            From the anchor to the robot, metres.

        Returns
        -------
        Tether
            The tether.
        """


TETHERS: Registry[Callable[[DistanceField, float], Any]] = Registry(
    "tether", "netsp.tethers", {"geodesic": GeodesicTether, "react": ReactTether}, later
)
"""Name → what makes a tether model of a distance field and a resolution (m)."""


def make_tether(
    model: str | Callable[[DistanceField, float], Any], field: DistanceField, delta: float
) -> Any:
    """A tether model by name, or made by a callable.

    Parameters
    ----------
    model : str or callable
        One of `TETHERS`, or `f(field, delta) -> TetherModel`.
    field : DistanceField
        The scene.
    delta : float
        Resolution, metres.

    Returns
    -------
    TetherModel
        The model.

    Raises
    ------
    InputError
        No model has that name.
    """
    return (model if callable(model) else TETHERS.named(model))(field, delta)


__all__ = [
    "TETHERS",
    "Contact",
    "GeodesicTether",
    "ReactTether",
    "Tether",
    "TetherModel",
    "make_tether",
]

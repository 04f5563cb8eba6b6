"""Taut tethers in a distance field: `GeodesicTether` (ours) and `ReactTether` (the paper's)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy.typing as npt

from netsp.arrays import Floats
from netsp.online.scene.field import DistanceField
from netsp.online.tether.geodesic import GeodesicTether
from netsp.online.tether.react import ReactTether
from netsp.online.tether.tether import Contact, Tether
from netsp.registry import Registry, later


class TetherModel(Protocol):
    """How a tether behaves: what a planner believes. States are immutable."""

    name: str

    def start(self, anchor: npt.ArrayLike, robot: npt.ArrayLike) -> Tether:
        """The tether along the line of sight from the anchor (3,) to the robot (3,)."""

    def update(self, tether: Tether, robot: npt.ArrayLike) -> Tether:
        """The tether after the robot has gone straight to a place (3,)."""

    def drive(self, tether: Tether, path: npt.ArrayLike) -> tuple[Tether, Floats]:
        """The tether after the robot has passed the points (k, 3), and its length (k,) at each."""

    def lay(self, path: npt.ArrayLike) -> Tether:
        """The tether after a robot has travelled a path (k, 3) from its anchor on."""


TETHERS: Registry[Callable[[DistanceField, float], Any]] = Registry(
    "tether", "netsp.tethers", {"geodesic": GeodesicTether, "react": ReactTether}, later
)
"""Name → what makes a tether model of a distance field and a resolution (m)."""


def make_tether(
    model: str | Callable[[DistanceField, float], Any], field: DistanceField, delta: float
) -> Any:
    """A `TetherModel` by name, or made by a callable. InputError for a name that is none."""
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

"""World of a robot in space: scenes, tethers, vehicles, missions, planners and the simulator."""

from __future__ import annotations

from typing import TYPE_CHECKING

from netsp.base.lazy_names import lazy_names

if TYPE_CHECKING:
    from netsp.world.scene.field import DistanceField
    from netsp.world.scene.scene import Scene
    from netsp.world.tether import Contact, GeodesicTether, ReactTether, Tether

__all__ = ["Contact", "DistanceField", "GeodesicTether", "ReactTether", "Scene", "Tether"]

__getattr__, __dir__ = lazy_names(
    globals(),
    {
        "Contact": "netsp.world.tether",
        "DistanceField": "netsp.world.scene.field",
        "GeodesicTether": "netsp.world.tether",
        "ReactTether": "netsp.world.tether",
        "Scene": "netsp.world.scene.scene",
        "Tether": "netsp.world.tether",
    },
)

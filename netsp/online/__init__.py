"""The online layer: scenes as distance fields, and tethers that stay taut in them."""

from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene
from netsp.world.tether import Contact, GeodesicTether, ReactTether, Tether

__all__ = ["Contact", "DistanceField", "GeodesicTether", "ReactTether", "Scene", "Tether"]

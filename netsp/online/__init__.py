"""The online layer: scenes as distance fields, and tethers that stay taut in them."""

from netsp.online.scene.field import DistanceField
from netsp.online.scene.scene import Scene
from netsp.online.tether import Contact, GeodesicTether, ReactTether, Tether

__all__ = ["Contact", "DistanceField", "GeodesicTether", "ReactTether", "Scene", "Tether"]

"""Export of tours to ground stations of vehicles and to maps."""

from netsp.exchange.maps.projection import Projection
from netsp.exchange.missions.mission_files import FORMATS, export
from netsp.exchange.missions.waypoints import Waypoint, waypoints_of

__all__ = ["FORMATS", "Projection", "Waypoint", "export", "waypoints_of"]

"""Hands a tour to a vehicle's ground station or a map, and takes sites from maps."""

from netsp.export.projection import Projection
from netsp.export.waypoints import Waypoint, waypoints_of
from netsp.export.write import FORMATS, export

__all__ = ["FORMATS", "Projection", "Waypoint", "export", "waypoints_of"]

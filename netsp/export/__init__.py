"""Hands a tour to a vehicle's ground station or a map."""

from netsp.export.waypoints import Waypoint, waypoints_of
from netsp.export.write import FORMATS, export
from netsp.site.projection import Projection

__all__ = ["FORMATS", "Projection", "Waypoint", "export", "waypoints_of"]

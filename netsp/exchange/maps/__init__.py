"""Real places: maps become problems, and what is planned is told in latitude and longitude."""

from netsp.exchange.maps.projection import Projection
from netsp.exchange.maps.read_map import read_site

__all__ = ["Projection", "read_site"]

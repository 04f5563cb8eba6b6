"""Import of maps as problems, and the projection between a problem's plane and the earth."""

from netsp.exchange.maps.projection import Projection
from netsp.exchange.maps.site_import import read_site

__all__ = ["Projection", "read_site"]

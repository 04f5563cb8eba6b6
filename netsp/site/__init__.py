"""Real places: maps become problems, and what is planned is told in latitude and longitude."""

from netsp.site.projection import Projection
from netsp.site.read import read_site

__all__ = ["Projection", "read_site"]

"""Taut tethers in a distance field: `GeodesicTether` (ours) and `ReactTether` (the paper's)."""

from netsp.online.tether.geodesic import GeodesicTether
from netsp.online.tether.react import ReactTether
from netsp.online.tether.tether import Contact, Tether

__all__ = ["Contact", "GeodesicTether", "ReactTether", "Tether"]

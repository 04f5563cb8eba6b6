"""Waypoints from the structure: few viewpoints that see what can be seen."""

from netsp.cover.plan import Cover, cover

__all__ = ["Cover", "cover"]

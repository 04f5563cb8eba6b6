"""Waypoints from the structure: few viewpoints that see what can be seen."""

from netsp.plan.cover.cover_plan import Cover, cover

__all__ = ["Cover", "cover"]

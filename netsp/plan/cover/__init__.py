"""Waypoints from the structure: few viewpoints that see all that can be seen of it."""

from netsp.plan.cover.cover_plan import Cover, cover

__all__ = ["Cover", "cover"]

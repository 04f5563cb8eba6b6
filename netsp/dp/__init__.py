"""Bounds from walks: dynamic programming over goals that are partly remembered."""

from netsp.dp.solve import solve

__all__ = ["solve"]

"""Bounds from walks: dynamic programming over goals that are partly remembered."""

from netsp.gtsp.dp.dp_solver import solve

__all__ = ["solve"]

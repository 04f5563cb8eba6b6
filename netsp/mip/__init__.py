"""Solver of the paper's mixed-integer program: cutting planes, branch and cut, lazy rounds."""

from netsp.mip.mip_solver import solve

__all__ = ["solve"]

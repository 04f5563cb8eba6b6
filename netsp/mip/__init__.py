"""The paper's mixed-integer program, solved by cutting planes, branching and lazy rounds."""

from netsp.mip.mip_solver import solve

__all__ = ["solve"]

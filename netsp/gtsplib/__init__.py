"""Generalised TSPs in the format of TSPLIB and GTSPLIB."""

from netsp.gtsplib.read import Instance, load

__all__ = ["Instance", "load"]

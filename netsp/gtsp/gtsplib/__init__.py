"""Generalised TSPs in the format of TSPLIB and GTSPLIB."""

from netsp.gtsp.gtsplib.gtsp_file import Instance, load

__all__ = ["Instance", "load"]

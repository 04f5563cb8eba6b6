"""Generalised TSPs in the format of TSPLIB and GTSPLIB."""

from netsp.base.deprecated import deprecated_names
from netsp.gtsp.gtsplib.gtsp_file import GtsplibInstance, load

__getattr__ = deprecated_names(globals(), Instance="GtsplibInstance")

__all__ = ["GtsplibInstance", "load"]

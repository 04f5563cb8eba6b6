"""Measure how slow this machine is at the moment, for limits in seconds.

    python benchmarks/machine_speed.py

A machine that others share may take twice the CPU seconds for the same work an hour later. A
published limit in seconds therefore refers to the *reference machine*, which spends
`REFERENCE_CPU_S` on a fixed piece of work. `make accept` measures this work before what it limits,
for first uses also after it, and on a slower machine extends the limit in proportion.
"""

from __future__ import annotations

import resource
import subprocess
import sys

REFERENCE_CPU_S = 1.0
"""Unit of the published limits: CPU seconds of `WORK` on the reference machine."""

WORK = """
import numba, scipy.sparse.csgraph, shapely
total = 0
for i in range(5_000_000):
    total += i
"""
"""Program in place of a command whose functions are not compiled: it imports large packages, and
then interprets a loop."""


def slowness() -> float:
    """Return the CPU seconds of `WORK` over `REFERENCE_CPU_S`, at least 1."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", WORK], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return max(1.0, spent / REFERENCE_CPU_S)


if __name__ == "__main__":
    print(f"limits are multiplied by {slowness():.2f} on this machine")

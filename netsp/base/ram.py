"""How much memory there is, asked before a large array is made rather than after."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path

from netsp.base.errors import MemoryLimitError

SHARE = 0.8
"""Of the memory that is free, the part that one array may take."""

SMALL = 64 * 2**20
"""Bytes below which nobody asks."""


def available() -> float:
    """Bytes that this process may still take: what the machine has free, its control group and its
    own limit leave; inf where none of them can be read."""
    free = [float("inf")]
    with contextlib.suppress(OSError, ValueError, IndexError):
        rows = dict(r.split(":", 1) for r in Path("/proc/meminfo").read_text().splitlines())
        free.append(1024.0 * float(rows["MemAvailable"].split()[0]))
    for most, used in (
        ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
        (
            "/sys/fs/cgroup/memory/memory.limit_in_bytes",
            "/sys/fs/cgroup/memory/memory.usage_in_bytes",
        ),
    ):
        with contextlib.suppress(OSError, ValueError):
            free.append(float(Path(most).read_text()) - float(Path(used).read_text()))
    if sys.platform != "win32":
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            with contextlib.suppress(OSError, ValueError, IndexError):
                pages = int(Path("/proc/self/statm").read_text().split()[0])
                free.append(float(limit) - pages * resource.getpagesize())
    return min(free)


def ask(size: float, what: str, advice: str) -> None:
    """MemoryLimitError, in one line, if `size` bytes are more than are available.

    Parameters
    ----------
    what
        That is to be made, for the message.
    advice
        What to lower.
    """
    if size < SMALL:
        return
    there = SHARE * available()
    if size > there:
        raise MemoryLimitError(
            f"{what} would take {size / 2**30:.3g} GiB of memory, and {there / 2**30:.3g} GiB are "
            f"available; {advice}"
        )

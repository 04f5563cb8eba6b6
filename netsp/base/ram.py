"""Available memory, checked before a large array is made."""

from __future__ import annotations

import contextlib
import sys
from dataclasses import dataclass
from pathlib import Path

from netsp.base.errors import MemoryLimitError
from netsp.base.number_ranges import check_not_negative


@dataclass(frozen=True)
class MemoryPolicy:
    """Policy of when a large array is refused. No number is negative.

    Attributes
    ----------
    max_share
        Maximum size of one array, as a share of the available memory.
    min_bytes
        Size below which arrays are not checked.
    """

    max_share: float = 0.8
    min_bytes: int = 64 * 2**20

    def __post_init__(self) -> None:
        check_not_negative(self)


def available_memory() -> float:
    """Return the bytes that this process may still use; infinite where no limit can be read.

    It is the least of three: the machine's free memory, what the control group leaves, and what the
    address space limit of the process leaves.
    """
    free = [float("inf")]
    with contextlib.suppress(OSError, ValueError, IndexError):
        rows = dict(r.split(":", 1) for r in Path("/proc/meminfo").read_text().splitlines())
        free.append(1024.0 * float(rows["MemAvailable"].split()[0]))
    for limit_file, used_file in (
        ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
        (
            "/sys/fs/cgroup/memory/memory.limit_in_bytes",
            "/sys/fs/cgroup/memory/memory.usage_in_bytes",
        ),
    ):
        with contextlib.suppress(OSError, ValueError):
            free.append(float(Path(limit_file).read_text()) - float(Path(used_file).read_text()))
    if sys.platform != "win32":
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            with contextlib.suppress(OSError, ValueError, IndexError):
                pages = int(Path("/proc/self/statm").read_text().split()[0])
                free.append(float(limit) - pages * resource.getpagesize())
    return min(free)


def check_available(
    size: float, name: str, advice: str, policy: MemoryPolicy = MemoryPolicy()
) -> None:
    """Raise MemoryLimitError if `size` bytes are more than the policy's share of available memory.

    Parameters
    ----------
    name : str
        Noun phrase for the array, for the message.
    advice : str
        Clause that says what to lower, for the message.
    """
    if size < policy.min_bytes:
        return
    limit = policy.max_share * available_memory()
    if size > limit:
        raise MemoryLimitError(
            f"{name} would take {size / 2**30:.3g} GiB of memory, and {limit / 2**30:.3g} GiB are "
            f"available; {advice}"
        )

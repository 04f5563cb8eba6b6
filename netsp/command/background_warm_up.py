"""Background process that compiles, after a command, what the next one is likely to need."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

SWITCH_VARIABLE = "NETSP_BACKGROUND"
"""Environment variable that turns the background process off where it is 0."""

LOWEST_PRIORITY = 19
"""Niceness of the process: every other process gets the processor first."""


def begin(command: str) -> None:
    """Start the process if a command had to compile something; the command need not wait for it.

    Small problems compile nothing, so they start no process. Neither does a command where compiled
    code cannot be kept on disk.

    Parameters
    ----------
    command : str
        Name of the command, which tells what is likely needed next.
    """
    tiered = sys.modules.get("netsp.compiled.tiered")
    is_wanted = os.environ.get(SWITCH_VARIABLE, "1") != "0" and os.name == "posix"
    if tiered is None or not is_wanted:
        return
    kernels = tiered.TieredDispatcher
    if not kernels.has_compiled or kernels.is_disk_full:
        return
    import subprocess

    with contextlib.suppress(OSError):
        process = subprocess.Popen(
            [sys.executable, "-m", "netsp", "warm-up", "--quiet", "--after", command],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            cwd=Path(__file__).resolve().parents[2], start_new_session=True,
            env={**os.environ, SWITCH_VARIABLE: "0"},
        )  # fmt: skip
        process.returncode = 0  # keeps Popen from warning that the process still runs


@contextlib.contextmanager
def alone() -> Iterator[bool]:
    """Run the body at the lowest priority; yield whether no other such process is running
    and compiled code is kept on disk."""
    from netsp.compiled import growing
    from netsp.compiled.compile_lock import locked
    from netsp.compiled.disk_cache import lock_file

    os.nice(LOWEST_PRIORITY)
    file = lock_file(growing.longer)
    if file is None:  # nothing that it compiles would be kept
        yield False
        return
    with locked(file.with_name("background.lock"), max_wait_s=0.0) as is_alone:
        yield is_alone

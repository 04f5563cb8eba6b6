"""Background process that compiles, after a command, what the next command is likely to need."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

SWITCH_VARIABLE = "NETSP_BACKGROUND"
"""Environment variable whose value 0 turns the background process off."""

LOWEST_PRIORITY = 19
"""Code of Linux for the lowest priority: other processes get the processor first."""


def begin(command: str) -> None:
    """Start the process if a command compiled something; the command does not wait for it.

    No process starts after small problems, which compile nothing, or where compiled code cannot be
    kept on disk.

    Parameters
    ----------
    command : str
        Name of the command, which decides what is compiled first.
    """
    tiered = sys.modules.get("netsp.base.compiled.tiered")
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
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=Path(__file__).resolve().parents[2],
            start_new_session=True,
            env={**os.environ, SWITCH_VARIABLE: "0"},
        )
        process.returncode = 0  # keeps Popen from warning that the process still runs


@contextlib.contextmanager
def alone() -> Iterator[bool]:
    """Give this process the lowest priority; yield whether it should compile.

    It should not while another background process runs, nor where compiled code cannot be kept on
    disk.
    """
    from netsp.base.compiled import dynamic_array
    from netsp.base.compiled.compile_lock import locked
    from netsp.base.compiled.disk_cache import lock_file

    os.nice(LOWEST_PRIORITY)
    file = lock_file(dynamic_array.longer)
    if file is None:  # no folder is writable
        yield False
        return
    with locked(file.with_name("background.lock"), max_wait_s=0.0) as is_alone:
        yield is_alone

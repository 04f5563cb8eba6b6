"""Locks that keep two processes from compiling the same kernel."""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Iterator
from pathlib import Path

from netsp.base.compiled.compile_policy import current_policy

try:
    import fcntl
except ImportError:  # on Windows two processes may compile one kernel, with the same result
    fcntl = None  # type: ignore[assignment]


@contextlib.contextmanager
def locked(file: Path | None, max_wait_s: float = math.inf) -> Iterator[bool]:
    """Lock a file while the body runs; yield True if this process has the lock.

    The system releases the lock when the process ends, even if it is killed. Where the folder is
    not writable there is no lock, and the body runs as if the process had it.

    Parameters
    ----------
    file : Path or None
        Lock file, which is removed afterwards; None for no lock.
    max_wait_s : float
        Longest wall-clock time to wait for another process, s; that process may be suspended.
    """
    descriptor, is_held = (None, True) if file is None else _taken(file, max_wait_s)
    try:
        yield is_held
    finally:
        if file is not None and descriptor is not None:
            if is_held:
                with contextlib.suppress(OSError):
                    file.unlink()  # a waiting process checks that the file it locked still exists
            os.close(descriptor)


def _taken(file: Path, max_wait_s: float) -> tuple[int | None, bool]:
    """Return the descriptor of the lock file, if any, and whether this process has the lock."""
    if fcntl is None:
        return None, True
    end = time.monotonic() + max_wait_s
    while True:
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError:
            return None, True
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= end:
                return descriptor, False
            os.close(descriptor)
            time.sleep(current_policy().lock_interval_s)
            continue
        except OSError:  # a file system without locks
            return descriptor, True
        with contextlib.suppress(OSError):
            if os.fstat(descriptor).st_ino == file.stat().st_ino:
                return descriptor, True
        os.close(descriptor)  # its last owner has removed the file: try again


def is_locked(file: Path | None) -> bool:
    """Return whether another process or thread has locked a file; False without a file."""
    if fcntl is None or file is None or not file.exists():
        return False
    with locked(file, max_wait_s=0.0) as is_held:
        return not is_held

"""Calls that wait until Numba is loaded for a kernel; without loading anything themselves."""

from __future__ import annotations

import sys
from collections.abc import Callable

_waiting: list[Callable[[], None]] = []


def when_numba_is_loaded(call: Callable[[], None]) -> None:
    """Call a function once Numba is loaded for a kernel: now, if it is.

    Parameters
    ----------
    call : callable
        Function without arguments.
    """
    if "numba" in sys.modules:
        call()
    else:
        _waiting.append(call)


def tell() -> None:
    """Call the functions that wait; for the module that loads Numba."""
    while _waiting:
        _waiting.pop(0)()

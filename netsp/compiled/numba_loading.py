"""Callbacks that run once Numba is loaded for a kernel; this module loads nothing itself."""

from __future__ import annotations

import sys
from collections.abc import Callable

_waiting: list[Callable[[], None]] = []


def when_numba_is_loaded(call: Callable[[], None]) -> None:
    """Call a function once Numba is loaded for a kernel, or now if it is loaded already.

    Parameters
    ----------
    call : callable
        Function without arguments.
    """
    if "numba" in sys.modules:
        call()
    else:
        _waiting.append(call)


def on_numba_loaded() -> None:
    """Call the functions that wait; the module that loads Numba calls this."""
    while _waiting:
        _waiting.pop(0)()

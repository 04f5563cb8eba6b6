"""Callbacks that run once a kernel has loaded Numba; this module does not load it."""

from __future__ import annotations

import sys
from collections.abc import Callable

_waiting: list[Callable[[], None]] = []


def when_numba_is_loaded(call: Callable[[], None]) -> None:
    """Call a function once a kernel has loaded Numba, or at once if Numba is loaded already."""
    if "numba" in sys.modules:
        call()
    else:
        _waiting.append(call)


def on_numba_loaded() -> None:
    """Run the waiting callbacks; `netsp.base.compiled.kernel` calls this after loading Numba."""
    while _waiting:
        _waiting.pop(0)()

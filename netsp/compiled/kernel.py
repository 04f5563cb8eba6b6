"""The decorator of compiled functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

from netsp.compiled import disk_cache, tiered
from netsp.compiled.compile_policy import compiles

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Return a function that is interpreted until compiling it pays, and is kept on disk then.

    Its annotations are for the callers and the type checker; Numba infers types of its own. Other
    threads run while its compiled form does. A parameter through which another thread ends it is
    named `stop`.

    Parameters
    ----------
    function : callable
        The function; its arguments are arrays, numbers and tuples of these.
    """
    compiled = njit(cache=True, nogil=True)(function)
    if compiles() and disk_cache.is_supported():
        disk_cache.keep_on_disk(compiled, function)
        if tiered.is_supported():
            compiled.__class__ = tiered.TieredDispatcher
    return compiled  # type: ignore[no-any-return]

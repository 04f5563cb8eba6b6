"""The decorator of compiled functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """A function that is compiled when first called, and kept on disk.

    Its annotations are for the callers and the type checker; Numba infers types of its own. Other
    threads run meanwhile.
    """
    return njit(cache=True, nogil=True)(function)  # type: ignore[no-any-return]

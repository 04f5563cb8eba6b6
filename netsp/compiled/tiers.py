"""Small work is done by the interpreter, and only what is more is compiled.

A kernel takes up to seconds to compile, and a tenth of a second to load once it is; the outline and
the tangents of a few obstacles take the interpreter less. Both give the same to the last bit
(tests/test_tiers.py), so that it never matters which of them ran.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from functools import cache
from types import FunctionType, SimpleNamespace
from typing import Any, TypeVar

import numpy as np
from numba import config

F = TypeVar("F", bound=Callable[..., Any])

ALLOWANCE = 100_000
"""Steps of the innermost loop, about a tenth of a second, that a kernel may do interpreted."""

_left: dict[Any, int] = {}
"""Steps that are left of it, by kernel."""


def choose(kernel: F, steps: int) -> F:
    """The kernel, or the interpreted one if the work is small and the kernel not loaded.

    Parameters
    ----------
    steps
        Most steps of its innermost loop.
    """
    left = _left.get(kernel, ALLOWANCE)
    if steps > left or not _is_compiled(kernel) or getattr(kernel, "signatures", False):
        return kernel
    _left[kernel] = left - steps
    return interpreted(kernel)  # type: ignore[return-value]


@contextlib.contextmanager
def everything_compiled() -> Iterator[None]:
    """Nothing is interpreted meanwhile."""
    global ALLOWANCE
    before, ALLOWANCE = ALLOWANCE, -1
    kept = dict(_left)
    _left.clear()
    try:
        yield
    finally:
        ALLOWANCE = before
        _left.update(kept)


@cache
def interpreted(kernel: Any) -> Callable[..., Any]:
    """A kernel as plain Python, and all that it calls."""
    own = kernel.py_func
    names = {
        name: own.__globals__[name] for name in own.__code__.co_names if name in own.__globals__
    }
    used = {n: interpreted(v) if _is_compiled(v) else v for n, v in names.items()}
    if used.get("math") is math:
        used["math"] = _c_math()
    return FunctionType(own.__code__, {**own.__globals__, **used}, own.__name__, own.__defaults__)


def compiles() -> bool:
    """Whether anything is compiled at all; with NUMBA_DISABLE_JIT nothing is."""
    return not config.DISABLE_JIT


def _is_compiled(value: object) -> bool:
    return hasattr(value, "py_func")


@cache
def _c_math() -> SimpleNamespace:
    """`math` as compiled code sees it: Python rounds hypotenuses better than the C library."""
    return SimpleNamespace(**{**vars(math), "hypot": np.hypot})

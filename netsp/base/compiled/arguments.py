"""Arguments and results of kernels that run interpreted."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from netsp.base.compiled.interpretation import interpreted
from netsp.base.compiled.overtime import Overtime, within

STOP_PARAMETERS = frozenset({"stop"})
"""Names of parameters through which other threads stop a kernel; their arrays are not restored."""

NARROW_DTYPES = frozenset("ef")
"""Characters of the dtypes float16 and float32. Their product with a Python float is as narrow in
NumPy but a float64 in Numba, so calls with such arrays are never interpreted."""


def arrays_in(value: Any) -> list[np.ndarray[Any, Any]]:
    """Return all arrays in an argument, including those in tuples."""
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, tuple | list):
        return [a for part in value for a in arrays_in(part)]
    return []


def can_be_interpreted(args: tuple[Any, ...], max_copied_bytes: int) -> bool:
    """Return whether a call with these arguments may run interpreted.

    `max_copied_bytes` is the maximum size of all arrays together (`CompilePolicy`).
    """
    arrays = arrays_in(args)
    is_narrow = any(a.size and a.dtype.char in NARROW_DTYPES for a in arrays)
    return not is_narrow and sum(a.nbytes for a in arrays) <= max_copied_bytes


def is_in_pool() -> bool:
    """Return whether this thread belongs to a pool; other threads may then write to its arrays."""
    return threading.current_thread().name.startswith("ThreadPoolExecutor")


def call_interpreted(kernel: Any, args: tuple[Any, ...]) -> Any:
    """Return the result of a kernel that runs interpreted, with the types of compiled code."""
    with np.errstate(all="ignore"):  # compiled code does not warn either
        return _plain(interpreted(kernel)(*args))


def call_within(budget_s: float, kernel: Any, args: tuple[Any, ...]) -> Any:
    """Run a kernel interpreted for at most `budget_s` CPU seconds, and return its result.

    In a thread of a pool there is no limit, because arrays that other threads write to cannot be
    restored.

    Raises
    ------
    Overtime
        The budget is used up; the arrays have their old values again.
    """
    if is_in_pool():
        return call_interpreted(kernel, args)
    function = interpreted(kernel)
    names = kernel.py_func.__code__.co_varnames
    named_arguments = [
        a for name, a in zip(names, args, strict=False) if name not in STOP_PARAMETERS
    ]
    before = [(a, a.copy()) for a in arrays_in(named_arguments) if a.flags.writeable]
    try:
        # outside `within`, so that `Overtime` is never raised while this `with` exits
        with np.errstate(all="ignore"):
            out = within(budget_s, function, args)
        return _plain(out)
    except Overtime:
        for array, copy in before:
            array[...] = copy
        raise


def _plain(value: Any) -> Any:
    """Return a result with Python's numbers instead of NumPy's, as compiled code does."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, tuple):
        parts = [_plain(part) for part in value]
        return value._make(parts) if hasattr(value, "_make") else tuple(parts)
    return value

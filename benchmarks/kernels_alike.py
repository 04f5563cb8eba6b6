"""Compare interpreted and compiled kernels, call by call, while the steps of `netsp warm-up` run.

    python benchmarks/kernels_alike.py [WORDS …]

Only steps whose names contain one of the words are run. The script prints each kernel whose result,
or an array that it writes to, differs in any bit, and the numbers of kernels and calls that were
compared. It does not compare calls that take too long interpreted or that always run compiled.
"""

from __future__ import annotations

import struct
import sys
from collections import Counter
from typing import Any

import numpy as np
from numba.core.registry import CPUDispatcher

from netsp.base.compiled.arguments import NARROW_DTYPES, arrays_in, is_in_pool
from netsp.base.compiled.compile_policy import everything_compiled
from netsp.base.compiled.interpretation import interpreted
from netsp.base.compiled.overtime import Overtime, within
from netsp.base.compiled.tiered import TieredDispatcher
from netsp.command.warm_up import steps

MAX_CALL_S = 0.3  # CPU seconds of one interpreted call; longer calls are not compared
MAX_KERNEL_S = 3.0  # CPU seconds of all interpreted calls of a kernel; then no more are compared


class Comparison:
    """Comparison of calls that are made interpreted and compiled."""

    def __init__(self) -> None:
        self.spent: Counter[str] = Counter()
        self.compared: Counter[str] = Counter()
        self.unlike: dict[str, str] = {}

    def call(self, kernel: Any, *args: Any) -> Any:
        """Call a kernel compiled, and on copies of its arguments interpreted."""
        name = f"{kernel.py_func.__module__}.{kernel.py_func.__name__}"
        if is_in_pool() or self.spent[name] > MAX_KERNEL_S or name in self.unlike:
            return CPUDispatcher.__call__(kernel, *args)
        if any(a.size and a.dtype.char in NARROW_DTYPES for a in arrays_in(args)):
            return CPUDispatcher.__call__(kernel, *args)
        copies = _copied(args)
        try:
            with np.errstate(all="ignore"):
                other = within(MAX_CALL_S, interpreted(kernel), copies)
        except Overtime:
            self.spent[name] += MAX_CALL_S
            return CPUDispatcher.__call__(kernel, *args)
        except Exception as error:
            other = error
        out = CPUDispatcher.__call__(kernel, *args)
        self.spent[name] += 0.001
        self.compared[name] += 1
        for part, a, b in (("result", out, other), ("arguments", args, copies)):
            if (how := _difference(a, b)) is not None:
                self.unlike[name] = f"{part}{how}"
        return out


def _copied(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.copy(order="K")
    if isinstance(value, tuple):
        parts = [_copied(part) for part in value]
        return value._make(parts) if hasattr(value, "_make") else tuple(parts)
    return value


def _difference(a: Any, b: Any) -> str | None:
    """Return where a compiled and an interpreted value differ, None if they are the same bits."""
    if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
        parts = ((k, _difference(x, y)) for k, (x, y) in enumerate(zip(a, b, strict=True)))
        return next((f"[{k}]{how}" for k, how in parts if how is not None), None)
    if not isinstance(a, np.ndarray) or not isinstance(b, np.ndarray):
        same = type(a) is type(b) if isinstance(a, np.ndarray | tuple) else _bits(a) == _bits(b)
        return None if same else f": {a!r:.80} compiled, {b!r:.80} interpreted"
    if a.dtype != b.dtype or a.shape != b.shape:
        return f": {a.dtype}{a.shape} compiled, {b.dtype}{b.shape} interpreted"
    unlike = ~((a == b) & (np.signbit(a) == np.signbit(b)) | (a != a) & (b != b))
    if not unlike.any():
        return None
    at = tuple(int(k[0]) for k in np.nonzero(unlike))
    return f": {unlike.sum()} of {a.shape}, at {at} {a[at]!r} compiled, {b[at]!r} interpreted"


def _bits(value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    return struct.pack("d", value) if isinstance(value, int | float) else repr(value)


def main(words: list[str]) -> int:
    """Run the steps and print the differences."""
    comparison = Comparison()
    TieredDispatcher.__call__ = lambda self, *args: comparison.call(self, *args)
    with everything_compiled():
        for name, step in steps():
            if not words or any(word in name for word in words):
                print(name, file=sys.stderr, flush=True)
                step()
    for name, how in sorted(comparison.unlike.items()):
        print(f"{name}: {how}")
    print(
        f"{len(comparison.compared)} kernels, {sum(comparison.compared.values())} calls, "
        f"{len(comparison.unlike)} kernels differ"
    )
    return 1 if comparison.unlike else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Says what is being compiled.

numba compiles a kernel the first time that it is called on a machine, and keeps the result beside
the source or in `NUMBA_CACHE_DIR`. Without a word that looks like a program that hangs.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

EVERY = 2.0
"""Seconds between two lines."""


@contextmanager
def compile_messages(stream: TextIO) -> Iterator[None]:
    """While the body runs, lines on a stream that name what is being compiled."""
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        def __init__(self) -> None:
            self.last = -EVERY

        def on_start(self, record: Any) -> None:
            now = time.monotonic()
            if now - self.last < EVERY:
                return
            kernel = record.data["dispatcher"].py_func
            if kernel.__module__.startswith("netsp."):
                once = " (once per machine; `netsp warm-up` does it ahead of time)"
                name = kernel.__module__.removeprefix("netsp.")
                print(
                    f"compiling {name}.{kernel.__name__} …{once if self.last < 0.0 else ''}",
                    file=stream, flush=True,
                )  # fmt: skip
                self.last = now

        def on_end(self, record: Any) -> None:
            pass

    listener = Listener()
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)

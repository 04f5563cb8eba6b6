"""Tells the user that netsp is being prepared, while kernels are compiled.

A kernel is compiled once per installation and kept on disk; without a word that looks like a
program that hangs.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

SUBJECTS = {
    "online": "the simulation", "space": "planning in space", "cover": "the choice of viewpoints",
}  # fmt: skip
"""Names of netsp's parts for users, by package; the others are the solver."""

BAR_WIDTH = 20
"""Width of the bar on a terminal, characters."""


@contextmanager
def compile_messages(stream: TextIO) -> Iterator[None]:
    """While the body runs, tell on a stream what is being prepared, and about how long it takes.

    A terminal shows one line with a bar. Elsewhere a line is written, and another one only where
    the work takes longer than the one before has said.

    Parameters
    ----------
    stream : file
        Stream of messages, as stderr.
    """
    from netsp.compiled.kernel import when_numba_is_loaded

    preparation = Preparation(stream)
    listeners: list[Any] = []
    is_over = False

    def listen() -> None:
        if not is_over:
            listeners.append(_listener(preparation))

    when_numba_is_loaded(listen)
    try:
        yield
    finally:
        is_over = True
        for listener in listeners:
            from numba.core import event

            event.unregister("numba:compile", listener)
        preparation.close()


def _listener(preparation: Preparation) -> Any:
    """Return a listener that is told of all that is compiled."""
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, record: Any) -> None:
            preparation.begin(record.data["dispatcher"])

        def on_end(self, record: Any) -> None:
            preparation.end(record.data["dispatcher"])

    listener = Listener()
    event.register("numba:compile", listener)
    return listener


class CompileTimes:
    """CPU seconds that each kernel took to compile, the kernels that it calls not counted.

    Attributes
    ----------
    seconds : dict
        By module and name; the types of a kernel add up.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._within: list[tuple[float, float]] = []

    @contextmanager
    def measured(self) -> Iterator[None]:
        """Measure while the body runs."""
        from numba.core import event

        times = self

        class Listener(event.Listener):  # type: ignore[misc]
            def on_start(self, record: Any) -> None:
                times._within.append((time.thread_time(), 0.0))

            def on_end(self, record: Any) -> None:
                begin, called_s = times._within.pop()
                whole_s = time.thread_time() - begin
                name = kernel_name(record.data["dispatcher"])
                times.seconds[name] = times.seconds.get(name, 0.0) + whole_s - called_s
                if times._within:
                    outer, so_far_s = times._within[-1]
                    times._within[-1] = outer, so_far_s + whole_s

        listener = Listener()
        event.register("numba:compile", listener)
        try:
            yield
        finally:
            event.unregister("numba:compile", listener)


def kernel_name(kernel: Any) -> str:
    """Return module and name of a kernel.

    Parameters
    ----------
    kernel : dispatcher
        The kernel.
    """
    return f"{kernel.py_func.__module__.removeprefix('netsp.')}.{kernel.py_func.__name__}"


class Preparation:
    """Progress of compiling, as it is shown.

    Parameters
    ----------
    stream : file
        Stream of messages.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._depth, self._total_s, self._done_s = 0, 0.0, 0.0
        self._spent_s, self._said_s, self._since = 0.0, 0.0, 0.0
        self._subject: str | None = None

    def begin(self, kernel: Any) -> None:
        """Count a kernel in; the kernels that it calls are compiled within it."""
        if not kernel.py_func.__module__.startswith("netsp."):
            return
        if not self._depth:
            part = kernel.py_func.__module__.split(".")[1]
            self._subject = self._subject or SUBJECTS.get(part, "the solver")
            self._total_s = max(self._total_s, self._done_s) + price_s(kernel, with_called=True)
            self._since = time.monotonic()
        self._depth += 1
        self._show()

    def end(self, kernel: Any) -> None:
        """Count a kernel as done."""
        if not kernel.py_func.__module__.startswith("netsp.") or not self._depth:
            return
        self._depth -= 1
        self._done_s += price_s(kernel)
        if not self._depth:
            self._spent_s += time.monotonic() - self._since
        self._show()

    def close(self) -> None:
        """End the line of the bar."""
        if self._subject is not None and self._stream.isatty():
            print(file=self._stream, flush=True)

    def _show(self) -> None:
        if self._stream.isatty():
            share = min(self._done_s / self._total_s, 1.0) if self._total_s else 0.0
            full = int(share * BAR_WIDTH)
            print(
                f"\r{self._line(self._total_s)} [{'#' * full}{' ' * (BAR_WIDTH - full)}]\x1b[K",
                end="", file=self._stream, flush=True,
            )  # fmt: skip
            return
        running = time.monotonic() - self._since if self._depth else 0.0
        if not self._said_s or self._spent_s + running > self._said_s:
            self._said_s = max(self._total_s, 2.0 * self._said_s, 1.0)
            print(self._line(self._said_s), file=self._stream, flush=True)

    def _line(self, seconds: float) -> str:
        return f"preparing {self._subject}, about {max(seconds, 1.0):.0f} s, once per installation"


def price_s(kernel: Any, with_called: bool = False) -> float:
    """Return about how many seconds it takes to compile a kernel.

    Parameters
    ----------
    kernel : dispatcher
        The kernel.
    with_called : bool
        Whether to count the kernels that it calls, too, as far as they are not compiled.
    """
    from netsp.compiled.compile_policy import current_policy

    own = len(kernel.py_func.__code__.co_code)
    whole = getattr(kernel, "bytecode", None) if with_called else None
    return current_policy().price_s(whole() if whole is not None else own)

"""Ctrl-C and SIGTERM: end the time of a clock, wait for the end of a block, or be remembered."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from netsp.base.clock import Clock, TimeLimit


@contextmanager
def until_interrupt(limit: TimeLimit) -> Iterator[Clock]:
    """Yield a clock whose time is up at Ctrl-C, too, so that successive stages end with what they
    have.

    A second Ctrl-C interrupts as usual. SIGTERM does the same where it interrupts
    (`netsp.command.interrupts`). In other threads, and where another handler is set, nothing
    changes.
    """
    if not _interrupts() or (isinstance(limit, Clock) and limit.can_stop):
        yield Clock.from_limit(limit)
        return
    pressed = threading.Event()
    within, seconds = (limit, None) if isinstance(limit, Clock) else (None, limit)
    clock = Clock(seconds, within=within, should_stop=pressed.is_set)

    def press() -> None:
        pressed.set()
        clock.stop()  # also where the work ends before the thread asks again

    with _on_interrupt(press, once=True):
        try:
            yield clock
        finally:
            clock.close()


@contextmanager
def deferred_interrupts() -> Iterator[None]:
    """Defer Ctrl-C to the end of a block that must not be interrupted.

    Compiled code that returns tuples calls Python to make them, and an interrupt at that moment
    would crash it.
    """
    pressed = threading.Event()
    with _on_interrupt(pressed.set):
        yield
    if pressed.is_set():
        raise KeyboardInterrupt


@contextmanager
def remembered_interrupts() -> Iterator[Callable[[], None]]:
    """Remember Ctrl-C during work that is useless in part.

    Ctrl-C interrupts as usual, and again at the next check where a callee took it as a request to
    return what it has, as solvers and flights do.

    Yields
    ------
    callable
        Raises KeyboardInterrupt if Ctrl-C was pressed; so does the end of the work.
    """
    pressed = threading.Event()

    def press() -> None:
        pressed.set()
        raise KeyboardInterrupt

    def check() -> None:
        if pressed.is_set():
            raise KeyboardInterrupt

    with _on_interrupt(press, callable):
        yield check
    check()


INTERRUPTS = (signal.SIGINT, signal.SIGTERM)
"""Signals that end a command.

Python raises KeyboardInterrupt at SIGINT, and `netsp.command.interrupts` makes it do so at SIGTERM.
"""


def _is_default(handler: object) -> bool:
    """Return whether a handler raises KeyboardInterrupt and does nothing else."""
    return handler is signal.default_int_handler


def _interrupts(hears: Callable[[object], bool] = _is_default) -> dict[signal.Signals, Any]:
    """Return the handlers of `INTERRUPTS` that `hears` accepts.

    There are none in other threads, where no handler can be set.
    """
    if threading.current_thread() is not threading.main_thread():
        return {}
    handlers = {number: signal.getsignal(number) for number in INTERRUPTS}
    return {number: handler for number, handler in handlers.items() if hears(handler)}


@contextmanager
def _on_interrupt(
    press: Callable[[], None], hears: Callable[[object], bool] = _is_default, *, once: bool = False
) -> Iterator[None]:
    """Call a function at Ctrl-C and SIGTERM instead of their handlers.

    Parameters
    ----------
    press : callable
        Function called at the signal.
    hears : callable
        Returns whether a handler is to be replaced.
    once : bool
        Whether the old handlers are restored at the first signal, for the second.
    """
    before = _interrupts(hears)

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def handle(*_: Any) -> None:
        if once:
            restore()
        press()

    for number in before:
        signal.signal(number, handle)
    try:
        yield
    finally:
        restore()

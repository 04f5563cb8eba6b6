"""Interrupts: Ctrl-C ends a command wherever it comes, and SIGTERM does the same.

Python only reports an exception that is raised where nobody can catch it: in finalizers, callbacks
of weak references and hooks of a fork. An interrupt there would be lost, and the work would go on.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from netsp.base.errors import is_interrupt

T = TypeVar("T")


@contextmanager
def resending_lost_interrupts(delay_s: float = 0.05) -> Iterator[None]:
    """Make SIGTERM raise KeyboardInterrupt, as Ctrl-C does, and repeat an interrupt `delay_s`
    seconds later if it was raised where nobody can catch it."""
    previous_hook = sys.unraisablehook
    hears_sigterm = (
        threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    )
    if hears_sigterm:
        signal.signal(signal.SIGTERM, signal.default_int_handler)

    def hook(unraisable: Any) -> None:
        if unraisable.exc_value is None or not is_interrupt(unraisable.exc_value):
            previous_hook(unraisable)
            return
        timer = threading.Timer(delay_s, _interrupt)
        timer.daemon = True
        timer.start()

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = previous_hook
        if hears_sigterm:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def until_interrupted(doing: str, call: Callable[[], T]) -> T:
    """Return the result of a call, which Ctrl-C and SIGTERM break off wherever it is.

    Parameters
    ----------
    doing : str
        Name of the work in messages.
    call : callable
        The work (`netsp.base.clock.Clock.bounded`).

    Raises
    ------
    KeyboardInterrupt
        The call was broken off.
    """
    from netsp.base.errors import LimitReachedError
    from netsp.base.interrupt_signals import until_interrupt

    with until_interrupt(None) as clock:
        try:
            return clock.bounded(doing, call)
        except LimitReachedError:
            if clock.is_stopped:
                raise KeyboardInterrupt from None
            raise


def _interrupt() -> None:
    """Interrupt the main thread, by a signal where possible, because that also wakes it up. A
    process that a shell starts in the background ignores SIGINT, so it gets SIGTERM."""
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        is_ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        signal.pthread_kill(main, signal.SIGTERM if is_ignored else signal.SIGINT)
    else:
        _thread.interrupt_main()

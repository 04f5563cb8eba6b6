"""Ctrl-C is heard wherever it comes.

What is raised where nobody can catch it (finalizers, callbacks of weak references, hooks of a fork)
Python reports and forgets, KeyboardInterrupt too: the work would go on as if nobody had asked.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from netsp.errors import interrupted

AGAIN = 0.05
"""Seconds until an interrupt that was lost is sent again."""


@contextmanager
def interrupts_are_heard() -> Iterator[None]:
    """An interrupt that was raised where nobody can catch it comes again a moment later."""
    before = sys.unraisablehook

    def hook(unraisable: Any) -> None:
        if unraisable.exc_value is None or not interrupted(unraisable.exc_value):
            before(unraisable)
            return
        again = threading.Timer(AGAIN, _interrupt)
        again.daemon = True
        again.start()

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before


def _interrupt() -> None:
    """Ctrl-C for the main thread, which also wakes it up where there are real signals."""
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, signal.SIGINT)
    else:
        _thread.interrupt_main()

"""Calls in threads of their own, which can be abandoned."""

from __future__ import annotations

import atexit
import contextvars
import threading
import time
from collections.abc import Callable
from contextvars import ContextVar
from typing import Generic, TypeVar

import numpy as np

from netsp.base.errors import LimitReachedError
from netsp.base.time_flags import NEVER, Flag

T = TypeVar("T")

BOUNDED = "netsp-bounded"
"""Name of the threads of `AbandonableCall`."""

_ABANDONED: list[threading.Thread] = []

_abandoned: ContextVar[Flag] = ContextVar("abandoned", default=NEVER)


class ThreadedCall(Generic[T]):
    """Call that runs in a thread of its own, so that the caller can do something else meanwhile."""

    def __init__(self, call: Callable[[], T], name: str | None = None) -> None:
        self._outcome: list[T] = []
        self._failure: list[BaseException] = []
        self._thread = threading.Thread(target=self._run, args=(call,), daemon=True, name=name)
        self._thread.start()

    def _run(self, call: Callable[[], T]) -> None:
        try:
            self._outcome.append(call())
        except BaseException as error:
            self._failure.append(error)

    def ends_within(self, seconds: float | None = None) -> bool:
        """Return whether the call has ended, after waiting for it at most some seconds."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def result(self) -> T:
        """Return what the call has returned, or raise what it has raised."""
        if self._failure:
            raise self._failure[0]
        return self._outcome[0]


class AbandonableCall(ThreadedCall[T]):
    """Call in a copy of the caller's context that ends at `end_if_abandoned` once abandoned."""

    def __init__(self, call: Callable[[], T]) -> None:
        self._flag: Flag = np.zeros(1, dtype=np.int64)
        context = contextvars.copy_context()
        context.run(_abandoned.set, self._flag)
        super().__init__(lambda: context.run(call), BOUNDED)

    def abandon(self, exit_grace_s: float = 0.0) -> None:
        """Leave the call to end by itself, at the next `end_if_abandoned` or with the process.

        Parameters
        ----------
        exit_grace_s : float
            Maximum time for which Python waits for the call when the process exits, s.
        """
        self._flag[0] = 1
        _ABANDONED.append(self._thread)
        # the limit of the last call is the one that counts
        atexit.unregister(is_abandoned_work_running)
        atexit.register(is_abandoned_work_running, exit_grace_s)


def is_abandoned_work_running(wait: float = 0.0) -> bool:
    """Return whether an abandoned call still runs, after waiting `wait` seconds."""
    until = time.monotonic() + wait
    while _ABANDONED:
        _ABANDONED[0].join(max(0.0, until - time.monotonic()))
        if _ABANDONED[0].is_alive():
            return True
        del _ABANDONED[0]
    return False


def abandoned() -> Flag:
    """Return the flag of the enclosing call, for compiled loops and other threads.

    It is 1 once the call is abandoned, and stays 0 outside of `AbandonableCall`.
    """
    return _abandoned.get()


def end_if_abandoned() -> None:
    """Raise LimitReachedError if the enclosing call has been abandoned."""
    if _abandoned.get()[0]:
        raise LimitReachedError("abandoned")

"""Calls that are broken off when they take too long.

Python cannot end a function from outside, but it can raise an exception in the thread that runs it.
One thread watches all calls that have a budget, and raises `Overtime` where it is used up.
"""

from __future__ import annotations

import contextlib
import ctypes
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")

LOOK_S = 0.005
"""Seconds between two looks at the calls under way."""

IDLE_LOOKS = 20
"""Looks without a call under way after which the watching thread sleeps until the next one."""


class Overtime(BaseException):
    """The call has used up its budget."""


class _Call:
    """A call under way: the thread that makes it, and when its budget is used up."""

    def __init__(self, budget_s: float) -> None:
        self.thread = threading.get_ident()
        # CPU time of the thread: other processes do not use up the budget
        self._clock: int | None = None
        if hasattr(time, "pthread_getcpuclockid"):
            self._clock = time.pthread_getcpuclockid(self.thread)
        self.deadline = self.now() + budget_s
        self.was_ended = False

    def now(self) -> float:
        """Return the CPU seconds of the thread; where these are not to be had, the time."""
        return time.perf_counter() if self._clock is None else time.clock_gettime(self._clock)


class _Watch:
    """The thread that watches calls."""

    def __init__(self) -> None:
        self._wake = threading.Condition()
        self._under_way: set[_Call] = set()
        self._is_asleep = False
        self._thread: threading.Thread | None = None

    def begin(self, budget_s: float) -> _Call:
        call = _Call(budget_s)
        with self._wake:
            self._under_way.add(call)
            if self._thread is None or not self._thread.is_alive():  # not alive after a fork
                self._thread = threading.Thread(
                    target=self._run, daemon=True, name="netsp-overtime"
                )
                self._thread.start()
            elif self._is_asleep:
                self._wake.notify()
        return call

    def end(self, call: _Call) -> None:
        """Return once no exception can come any more; raise Overtime if one was on its way."""
        with self._wake:
            self._under_way.discard(call)
            is_coming = call.was_ended
        while is_coming:
            time.sleep(0.0)

    def _run(self) -> None:
        idle = 0
        while True:
            with self._wake:
                idle = 0 if self._under_way else idle + 1
                if idle > IDLE_LOOKS:
                    self._is_asleep = True
                    self._wake.wait()
                    self._is_asleep, idle = False, 0
                for call in [c for c in self._under_way if c.now() > c.deadline]:
                    self._under_way.discard(call)
                    call.was_ended = True
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(
                        ctypes.c_ulong(call.thread), ctypes.py_object(Overtime)
                    )
            time.sleep(LOOK_S)


_watch = _Watch()


def within(budget_s: float, function: Callable[..., T], args: tuple[Any, ...]) -> T:
    """Call a function, and break it off where it takes too long.

    Parameters
    ----------
    budget_s : float
        CPU seconds that it may take.
    function : callable
        Function in Python; what it calls in other languages is not broken off.
    args : tuple
        Its arguments.

    Raises
    ------
    Overtime
        The budget is used up. The function may have done a part of its work.
    """
    call = _watch.begin(budget_s)
    try:
        out = function(*args)
    except Overtime:
        raise
    except BaseException:
        with contextlib.suppress(Overtime):  # the function has failed before
            _watch.end(call)
        raise
    _watch.end(call)
    return out

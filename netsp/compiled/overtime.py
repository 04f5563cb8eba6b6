"""Calls that are broken off when they take too long.

Python cannot end a function from outside, but it can raise an exception in the thread that runs it.
One thread watches all calls that have a budget, and raises `Overtime` where a budget is used up.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import queue
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")

LOOK_S = 0.005
"""Seconds between two looks at the calls under way."""

IDLE_LOOKS = 20
"""Looks without a call under way after which the watching thread sleeps until the next one."""

MAX_STEPS_TO_EXCEPTION = 1000
"""Steps of a loop after which an exception has surely come: Python looks for it at each step."""


class Overtime(BaseException):
    """Exception that ends a call whose budget is used up."""


class _Call:
    """Call under way, with the thread that makes it and the deadline of its budget."""

    def __init__(self, budget_s: float) -> None:
        self.thread = threading.get_ident()
        # CPU time of the thread: other processes do not use up the budget
        self._clock: int | None = None
        if hasattr(time, "pthread_getcpuclockid"):
            self._clock = time.pthread_getcpuclockid(self.thread)
        self.deadline = self.now() + budget_s
        self.was_ended = False

    def now(self) -> float:
        """Return the CPU seconds of the thread; on systems without them, the time."""
        return time.perf_counter() if self._clock is None else time.clock_gettime(self._clock)


class _Watch:
    """Thread that watches calls.

    `Overtime` may come between any two steps of the thread that makes a call. So that thread uses
    only locks and queues written in C: those written in Python (`threading.Condition`) stay locked
    if an exception comes while they are entered.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._wakes: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._under_way: set[_Call] = set()
        self._is_asleep = False
        self._thread: threading.Thread | None = None

    def begin(self, call: _Call) -> None:
        """Watch a call; where no thread can be started, the call is not broken off."""
        with self._lock:
            self._under_way.add(call)
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(
                    target=self._run, daemon=True, name="netsp-overtime"
                )
                with contextlib.suppress(RuntimeError):
                    self._thread.start()
            elif self._is_asleep:
                self._wakes.put(None)

    def end(self, call: _Call) -> None:
        """Stop watching a call of this thread, and catch an exception that is on its way."""
        with self._lock:
            self._under_way.discard(call)
            was_ended = call.was_ended
        if was_ended:
            _catch_pending(call.thread)

    def _run(self) -> None:
        idle = 0
        while True:
            with self._lock:
                idle = 0 if self._under_way else idle + 1
                self._is_asleep = idle > IDLE_LOOKS
                for call in [c for c in self._under_way if c.now() > c.deadline]:
                    self._under_way.discard(call)
                    call.was_ended = True
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(
                        ctypes.c_ulong(call.thread), ctypes.py_object(Overtime)
                    )
            if self._is_asleep:
                self._wakes.get()
                idle = 0
            else:
                time.sleep(LOOK_S)


def _catch_pending(thread: int) -> None:
    """Catch an exception that is on its way to this thread; one that came already does no harm.

    CPython 3.11 never forgets that an exception was on its way if that is cancelled: each call of
    a function is slower from then on, and hangs under a profiler. So one more is sent and caught.
    """
    try:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(
            ctypes.c_ulong(thread), ctypes.py_object(Overtime)
        )
        for _ in range(MAX_STEPS_TO_EXCEPTION):
            pass
    except Overtime:
        return  # in a function of Python, suppress() would begin outside of `try`


_watch = _Watch()


def _watch_anew() -> None:
    """Replace the watch in a forked process, which has no watching thread; its lock may be held."""
    global _watch
    _watch = _Watch()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_watch_anew)


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
    BaseException
        The function, or the handler of a signal meanwhile, has raised it; it is raised even where
        the budget is used up at the same time.
    """
    handled = sys.exception()
    call = _Call(budget_s)
    try:
        _watch.begin(call)
        out = function(*args)
        _watch.end(call)
    except BaseException as error:
        # Python raises `Overtime` where a function begins; none begins outside of `try` here
        try:
            _watch.end(call)
        except Overtime:
            _watch.end(call)
        except BaseException:
            _watch.end(call)
            raise
        failed = error.__context__ if isinstance(error, Overtime) else None
        # `Overtime` came while an interrupt passed through a `with` of the function
        if failed is not handled and isinstance(failed, KeyboardInterrupt | SystemExit):
            raise failed from None
        if isinstance(error, Overtime):
            _repeat_cut_off_signals(error)
        raise
    return out


def _repeat_cut_off_signals(error: Overtime) -> None:
    """Raise again the signals whose handlers were running when `Overtime` came."""
    if threading.current_thread() is not threading.main_thread():
        return
    codes = {frame.f_code for frame, _ in traceback.walk_tb(error.__traceback__)}
    for number in signal.valid_signals():
        if getattr(signal.getsignal(number), "__code__", None) in codes:
            signal.raise_signal(number)

"""Function calls with a budget of CPU seconds.

Python cannot end a function from outside, but it can raise an exception in the thread that runs it.
A watching thread raises `Overtime` in each call whose budget is used up.
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

from netsp.base.compiled.compile_policy import current_policy

T = TypeVar("T")


class Overtime(BaseException):
    """Exception that ends a call whose budget is used up."""


class _Call:
    """Running call, with its thread and its deadline."""

    def __init__(self, budget_s: float) -> None:
        self.thread = threading.get_ident()
        # CPU time of the thread, so that other processes do not use up the budget
        self._clock: int | None = None
        if hasattr(time, "pthread_getcpuclockid"):
            self._clock = time.pthread_getcpuclockid(self.thread)
        self.deadline = self.now() + budget_s
        self.was_ended = False

    def now(self) -> float:
        """Return the thread's CPU time, s, or the wall-clock time if the system does not measure
        it."""
        return time.perf_counter() if self._clock is None else time.clock_gettime(self._clock)


class _Watch:
    """Thread that ends calls at their deadlines.

    `Overtime` may be raised between any two steps of a calling thread. Calling threads therefore
    only use locks and queues that are written in C: those written in Python
    (`threading.Condition`) stay locked if an exception is raised while they are entered.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._wakes: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._running: set[_Call] = set()
        self._is_asleep = False
        self._thread: threading.Thread | None = None

    def begin(self, call: _Call) -> None:
        """Watch a call. Where no thread can be started, the call has no deadline."""
        with self._lock:
            self._running.add(call)
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(
                    target=self._run, daemon=True, name="netsp-overtime"
                )
                with contextlib.suppress(RuntimeError):
                    self._thread.start()
            elif self._is_asleep:
                self._wakes.put(None)

    def end(self, call: _Call) -> None:
        """Stop watching a call of this thread, and catch `Overtime` if it is pending."""
        with self._lock:
            self._running.discard(call)
            was_ended = call.was_ended
        if was_ended:
            _catch_pending(call.thread)

    def _run(self) -> None:
        idle = 0
        while True:
            policy = current_policy()
            with self._lock:
                idle = 0 if self._running else idle + 1
                self._is_asleep = idle > policy.max_idle_checks
                for call in [c for c in self._running if c.now() > c.deadline]:
                    self._running.discard(call)
                    call.was_ended = True
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(
                        ctypes.c_ulong(call.thread), ctypes.py_object(Overtime)
                    )
            if self._is_asleep:
                self._wakes.get()
                idle = 0
            else:
                time.sleep(policy.check_interval_s)


def _catch_pending(thread: int, max_steps: int = 1000) -> None:
    """Catch `Overtime` if it is pending in this thread; do nothing if it was raised already.

    CPython 3.11 can cancel a pending exception, but afterwards it still checks for one: every call
    becomes slower, and hangs under a profiler. So this function sends `Overtime` again and catches
    it: Python raises it within a few steps of a loop, at most `max_steps`.
    """
    try:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(
            ctypes.c_ulong(thread), ctypes.py_object(Overtime)
        )
        for _ in range(max_steps):
            pass
    except Overtime:
        return  # `suppress` is a Python function, which could be interrupted before its `try`


_watch = _Watch()


def _reset_watch() -> None:
    """Replace the watch in a forked process: its thread is gone, and its lock may be locked."""
    global _watch
    _watch = _Watch()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_reset_watch)


def within(budget_s: float, function: Callable[..., T], args: tuple[Any, ...]) -> T:
    """Call a function and end the call when its budget of CPU seconds is used up.

    Calls of C code are not interrupted; they run to their end.

    Raises
    ------
    Overtime
        The budget is used up. The function may have done part of its work.
    BaseException
        The function, or the handler of a signal, raised it. It takes precedence over `Overtime`.
    """
    handled = sys.exception()
    call = _Call(budget_s)
    try:
        _watch.begin(call)
        out = function(*args)
        _watch.end(call)
    except BaseException as error:
        # Python raises `Overtime` as a function is entered, so call functions only within a `try`
        try:
            _watch.end(call)
        except Overtime:
            _watch.end(call)
        except BaseException:
            _watch.end(call)
            raise
        failed = error.__context__ if isinstance(error, Overtime) else None
        # `Overtime` was raised while an interrupt unwound the function
        if failed is not handled and isinstance(failed, KeyboardInterrupt | SystemExit):
            raise failed from None
        if isinstance(error, Overtime):
            _repeat_cut_off_signals(error)
        raise
    return out


def _repeat_cut_off_signals(error: Overtime) -> None:
    """Raise again the signals whose handlers `Overtime` cut off."""
    if threading.current_thread() is not threading.main_thread():
        return
    codes = {frame.f_code for frame, _ in traceback.walk_tb(error.__traceback__)}
    for number in signal.valid_signals():
        if getattr(signal.getsignal(number), "__code__", None) in codes:
            signal.raise_signal(number)

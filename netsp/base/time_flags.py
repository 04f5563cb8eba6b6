"""Flags of one number that threads set for compiled loops, once the time is up."""

from __future__ import annotations

import heapq
import itertools
import threading
import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Flag = npt.NDArray[np.int64]

NEVER: Flag = np.zeros(1, dtype=np.int64)
"""Flag of a clock without a limit."""


class StopThread:
    """Thread that calls `should_stop`, and sets flags once it returns True."""

    def __init__(self, should_stop: Callable[[], bool], interval_s: float) -> None:
        self.now = False
        self._should_stop, self._interval_s = should_stop, interval_s
        self._flags: list[Flag] = []
        self._error: Exception | None = None
        self._closed = threading.Event()
        self._lock = threading.Lock()
        threading.Thread(target=self._run, daemon=True, name="netsp-stop").start()

    def add(self, flag: Flag) -> None:
        """Set a flag once `should_stop` returns True."""
        with self._lock:
            self._flags.append(flag)
            if self.now:
                flag[0] = 1

    def close(self) -> None:
        """End the calls; raise what `should_stop` raised."""
        self._closed.set()
        if self._error is not None:
            raise self._error

    def _run(self) -> None:
        while not self._closed.is_set():
            try:
                stop = self._should_stop()
            except Exception as error:  # raised again by `close`, because this thread has no caller
                self._error, stop = error, True
            if stop:
                with self._lock:
                    self.now = True
                    for flag in self._flags:
                        flag[0] = 1
                return
            self._closed.wait(self._interval_s)


class DeadlineThread:
    """Thread that sets flags when their time comes."""

    def __init__(self) -> None:
        self._queue: list[tuple[float, int, Flag]] = []
        self._count = itertools.count()
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def add(self, deadline: float, flag: Flag) -> None:
        """Set a flag at a time of `time.monotonic`."""
        with self._changed:
            heapq.heappush(self._queue, (deadline, next(self._count), flag))
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(target=self._run, daemon=True, name="netsp-clock")
                self._thread.start()
            self._changed.notify()

    def _run(self) -> None:
        with self._changed:
            while True:
                while self._queue and self._queue[0][0] <= time.monotonic():
                    heapq.heappop(self._queue)[2][0] = 1
                # a day at most, which every platform's wait can hold
                wait = self._queue[0][0] - time.monotonic() if self._queue else 86400.0
                self._changed.wait(min(max(wait, 0.0), 86400.0))


DEADLINES = DeadlineThread()
"""Thread of the deadlines of all clocks."""

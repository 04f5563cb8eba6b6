"""Clock of a whole run, which compiled loops can check.

A compiled loop cannot read the time, and Python cannot interrupt it. So every clock has a `flag`,
an array of one number that a watching thread sets to 1 when the time is up. Loops that may last
check the flag now and then, and end with what they have.
"""

from __future__ import annotations

import contextvars
import heapq
import itertools
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from netsp.base.deprecated import deprecated_method
from netsp.base.errors import LimitReachedError
from netsp.base.number_ranges import check_not_negative

Flag = npt.NDArray[np.int64]
T = TypeVar("T")

NEVER: Flag = np.zeros(1, dtype=np.int64)
"""Flag of a clock without a limit."""


@dataclass(frozen=True)
class TimingPolicy:
    """Policy of when a clock may end work. No number is negative.

    Parameters
    ----------
    untimed_steps : int
        Maximum number of steps of a compiled innermost loop that run to the end even if the time is
        up. The default takes about a tenth of a second. With a smaller number, more problems are
        left without any tour when the limit is short; with a larger one, runs end later.
    grace_s : float
        CPU seconds for which a run may go on after its time is up, so that work that checks the
        clock returns what it has. Then the work is abandoned (`Clock.bounded`). With less, more
        missions are left without any tour when the limit is short; with more, runs end later.
    stop_grace_s : float
        Additional CPU seconds for work that returns what it has after the clock was stopped, such
        as by Ctrl-C. With less, more of what was found is lost; with more, the user waits longer.
    stop_interval_s : float
        Seconds between two calls of `should_stop`. A shorter interval takes more CPU.
    """

    untimed_steps: int = 100_000_000
    grace_s: float = 0.5
    stop_grace_s: float = 5.0
    stop_interval_s: float = 0.02

    def __post_init__(self) -> None:
        check_not_negative(self)


class Clock:
    """Time since the start, and time left until a limit.

    Parameters
    ----------
    limit : float, optional
        Seconds from now; None for no limit.
    within : Clock, optional
        Clock that this one may not outlast.
    should_stop : callable, optional
        Function called at intervals in a thread of its own. Once it returns True, the time is up
        for this clock and all within it. `close` ends the calls.
    begun : (float, float), optional
        Time (`time.monotonic`) from which the limit counts, and CPU seconds of the process at that
        time; default: now.
    """

    policy = TimingPolicy()

    def __init__(
        self,
        limit: float | None = None,
        *,
        within: Clock | None = None,
        should_stop: Callable[[], bool] | None = None,
        begun: tuple[float, float] | None = None,
    ) -> None:
        begun = begun or (time.monotonic(), time.process_time())
        self.start = begun[0]
        self.deadline = math.inf if limit is None else self.start + limit
        self._stop: _Stop | None = None
        if should_stop is not None:
            self._stop = _Stop(should_stop, self.policy.stop_interval_s)
        self._family: _Family = _Family(begun) if within is None else within._family
        if within is not None:
            self.deadline = min(self.deadline, within.deadline)
            self._stop = self._stop or within._stop
        self._flag: Flag | None = None

    def __reduce__(self) -> tuple[type[Clock], tuple[()]]:
        """Pickle as a clock without a limit, because a time limit belongs to one process."""
        return Clock, ()

    @classmethod
    def from_limit(cls, limit: TimeLimit) -> Clock:
        """Return a clock that starts now, from seconds, a clock that it may not outlast, or no
        limit."""
        return cls(within=limit) if isinstance(limit, Clock) else cls(limit)

    of = deprecated_method("of", "from_limit")
    up = deprecated_method("up", "is_up")
    stopped = deprecated_method("stopped", "is_stopped")
    stoppable = deprecated_method("stoppable", "can_stop")

    def part(self, share: float) -> Clock:
        """Return a clock for a share of the time that is left."""
        return Clock(None if self.limit is None else share * self.left, within=self)

    @property
    def limit(self) -> float | None:
        """Seconds from the start to the deadline; None without a limit."""
        return None if self.deadline == math.inf else self.deadline - self.start

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self.start

    @property
    def left(self) -> float:
        """Seconds left; infinite without a limit."""
        if self.is_stopped:
            return 0.0
        return self.deadline - time.monotonic()

    @property
    def is_stopped(self) -> bool:
        """State of being stopped, by `should_stop` or `end`."""
        return self._family.ended or (self._stop is not None and self._stop.now)

    @property
    def can_stop(self) -> bool:
        """Possibility that the time is up before the deadline."""
        return self._stop is not None

    def end(self) -> None:
        """End the time of this clock and of all clocks that share a clock with it.

        A user who interrupts a part of some work does not want the next part.
        """
        self._family.ended = True
        if self._flag is not None:
            self._flag[0] = 1

    def close(self) -> None:
        """End the calls of `should_stop`; raise what it raised."""
        if self._stop is not None:
            self._stop.close()

    @property
    def is_up(self) -> bool:
        """State of having reached the limit."""
        return self.left <= 0.0

    @property
    def flag(self) -> Flag:
        """Flag (1,) for compiled loops: 0 until the time is up, then 1."""
        if self._flag is None:
            self._flag = np.zeros(1, dtype=np.int64)
            if self.is_up:
                self._flag[0] = 1
            elif self.deadline < math.inf:
                _WATCH.add(self.deadline, self._flag)
            if self._stop is not None:
                self._stop.add(self._flag)
        return self._flag

    def check(self, doing: str) -> None:
        """Raise LimitReachedError, which names the work, if the time is up."""
        if self.is_up:
            raise self._broken_off(doing)

    def _broken_off(self, doing: str) -> LimitReachedError:
        """Return the error that names the work that the clock has ended."""
        return LimitReachedError(
            f"{'stopped' if self.is_stopped else 'time limit reached'} while {doing}"
        )

    def finish(self, doing: str, steps: float, call: Callable[[Flag], T]) -> T:
        """Return the result of a call that stops at a flag, as `interruptible` does.

        Small work runs to the end whatever the time (`TimingPolicy`).

        Parameters
        ----------
        doing : str
            Name of the work in messages.
        steps : float
            Maximum number of steps of the innermost loop.
        call : callable
            Work; it takes the flag, and may return an incomplete result once the flag is set.

        Raises
        ------
        LimitReachedError
            The time was up before the work was complete.
        """
        family = self._family
        if steps <= self.policy.untimed_steps:
            family.doing = doing
            out = call(abandoned())
            end_if_abandoned()
            family.doing = None
            return out
        self.check(doing)
        flag, family.doing = self.flag, doing
        out = self.interruptible(lambda: call(flag))
        self.check(doing)
        family.doing = None
        return out

    @property
    def is_overdue(self) -> bool:
        """State of having used up the grace of `TimingPolicy`, too, after the time was up, in CPU
        seconds."""
        return self._overdue()

    def _overdue(self, more: float = 0.0) -> bool:
        """Return whether the time is up, and the grace and some more CPU seconds are used up.

        Compiling does not count. Nor does time in which the process got no CPU: on a busy machine a
        run ends later rather than without a result.
        """
        self._family.count_compiling()
        if not self.is_up:
            return False
        family, now = self._family, time.process_time()
        if not self.is_stopped and _is_compiling():
            family.up_at = (
                None  # otherwise the compiled code would be lost, and compiled again next time
            )
            return False
        if family.up_at is None:
            family.up_at = now
        grace = self.policy.grace_s + more
        due = max(self.deadline - family.begin, family.min_cpu_s) + grace
        if not self.is_stopped and now - family.begin_cpu - family.compiling_s <= due:
            return False
        return now - family.up_at > grace

    @contextmanager
    def with_min_cpu(self, cpu_s: float) -> Iterator[None]:
        """Abandon no work of a block before it has had some CPU time, however short the limit is.

        Compiling does not count. Ctrl-C abandons work all the same.

        Parameters
        ----------
        cpu_s : float
            CPU seconds since the start of the clock.
        """
        family = self._family
        before, family.min_cpu_s = family.min_cpu_s, cpu_s
        try:
            yield
        finally:
            family.min_cpu_s = before

    def bounded(self, doing: str, call: Callable[[], T], *, winds_down: bool = False) -> T:
        """Return the result of a call, or abandon the call if the clock is overdue.

        The call runs in a thread of its own. An abandoned thread ends at the next
        `end_if_abandoned`, or with the process; so the caller may use nothing that it changes.

        Parameters
        ----------
        doing : str
            Name of the work in messages.
        call : callable
            Work.
        winds_down : bool
            Whether the work returns what it has when the clock is stopped, as by Ctrl-C; then it
            gets more time for it (`TimingPolicy`).

        Raises
        ------
        LimitReachedError
            The work was abandoned.
        """
        if self.deadline == math.inf and self._stop is None:
            return call()
        if self.is_overdue:
            raise self._broken_off(doing)
        outcome: list[T] = []
        failure: list[BaseException] = []
        abandoned: Flag = np.zeros(1, dtype=np.int64)
        done = threading.Event()

        def body() -> None:
            _abandoned.set(abandoned)
            try:
                outcome.append(call())
            except BaseException as error:
                failure.append(error)
            done.set()

        context = contextvars.copy_context()
        thread = threading.Thread(target=context.run, args=(body,), daemon=True, name=BOUNDED)
        thread.start()
        try:
            while not done.wait(min(0.2, max(self.policy.stop_interval_s, self.left))):
                more = self.policy.stop_grace_s if winds_down and self.is_stopped else 0.0
                if self._overdue(more) or _abandoned.get()[0]:
                    raise self._broken_off(self._family.doing or doing)
        except (KeyboardInterrupt, LimitReachedError):
            abandoned[0] = 1
            _ABANDONED.append(thread)
            raise
        if failure:
            raise failure[0]
        return outcome[0]

    def interruptible(self, call: Callable[[], T]) -> T:
        """Return the result of a call that checks the flag, made in a thread, so that Ctrl-C ends
        it at once."""
        outcome: list[T] = []
        failure: list[BaseException] = []

        def body() -> None:
            try:
                outcome.append(call())
            except BaseException as error:
                failure.append(error)

        thread = threading.Thread(target=body, daemon=True)
        flag = self.flag
        thread.start()
        try:
            while thread.is_alive():
                thread.join(0.2)
        except KeyboardInterrupt:
            flag[0] = 1
            thread.join()
            raise
        if failure:
            raise failure[0]
        return outcome[0]


def is_abandoned_work_running(wait: float = 0.0) -> bool:
    """Return whether a thread that `Clock.bounded` has abandoned still runs, after waiting `wait`
    seconds."""
    until = time.monotonic() + wait
    while _ABANDONED:
        _ABANDONED[0].join(max(0.0, until - time.monotonic()))
        if _ABANDONED[0].is_alive():
            return True
        del _ABANDONED[0]
    return False


_ABANDONED: list[threading.Thread] = []


def _is_compiling() -> bool:
    """Return whether Numba compiles a kernel just now."""
    lock = sys.modules.get("numba.core.compiler_lock")
    return lock is not None and bool(lock.global_compiler_lock.is_locked())


BOUNDED = "netsp-bounded"
"""Name of the threads of `Clock.bounded`."""

_abandoned: ContextVar[Flag] = ContextVar("abandoned", default=NEVER)


def abandoned() -> Flag:
    """Return the flag of the enclosing `Clock.bounded`, for compiled loops and other threads.

    It is 1 once the work is abandoned, and stays 0 outside of `Clock.bounded`.
    """
    return _abandoned.get()


def end_if_abandoned() -> None:
    """Raise LimitReachedError if the enclosing `Clock.bounded` has abandoned this work."""
    if _abandoned.get()[0]:
        raise LimitReachedError("abandoned")


class _Family:
    """State that clocks within one another share.

    Attributes
    ----------
    ended : bool
        Whether `Clock.end` was called.
    begin, begin_cpu : float
        Time, and CPU seconds of the process, when the first of the clocks was made.
    up_at : float or None
        CPU seconds of the process when the time was first seen to be up.
    doing : str or None
        Name of the long compiled work under way, for messages.
    min_cpu_s : float
        CPU seconds before which no work is abandoned (`Clock.with_min_cpu`).
    compiling_s : float
        CPU seconds spent compiling, as far as it was seen.
    """

    min_cpu_s: float = 0.0
    compiling_s: float = 0.0
    _looked_at: float

    def count_compiling(self) -> None:
        """Count the CPU time since the last call as compiling if something is compiled now."""
        now = time.process_time()
        if _is_compiling():
            self.compiling_s += now - self._looked_at
        self._looked_at = now

    def __init__(self, begun: tuple[float, float]) -> None:
        self._looked_at = time.process_time()
        self.ended = False
        self.begin, self.begin_cpu = begun
        self.up_at: float | None = None
        self.doing: str | None = None


TimeLimit = float | Clock | None
"""Seconds, or the clock of the run that the work belongs to, or no limit."""


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
        if clock._stop is not None:
            clock._stop.now = True  # also where the work ends before the thread asks again

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


class _Stop:
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
        with self._lock:
            self._flags.append(flag)
            if self.now:
                flag[0] = 1

    def close(self) -> None:
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


class _Watch:
    """Thread that sets flags when their time comes."""

    def __init__(self) -> None:
        self._queue: list[tuple[float, int, Flag]] = []
        self._count = itertools.count()
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def add(self, deadline: float, flag: Flag) -> None:
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


_WATCH = _Watch()

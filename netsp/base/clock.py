"""Clock of a whole run, which compiled loops can check.

A compiled loop cannot read the time, and Python cannot interrupt it. So every clock has a `flag`,
an array of one number that a watching thread sets to 1 when the time is up. Loops that may last
check the flag now and then, and end with what they have.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from netsp.base.bounded_work import AbandonableCall, ThreadedCall, abandoned, end_if_abandoned
from netsp.base.deprecated import deprecated_method, deprecated_names
from netsp.base.errors import LimitReachedError
from netsp.base.number_ranges import check_not_negative
from netsp.base.time_flags import DEADLINES, Flag, StopThread

T = TypeVar("T")


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
    exit_grace_s : float
        Seconds for which Python waits at exit for work that was abandoned. Python ends the threads
        of work that goes on for longer, which aborts the process in the middle of some C++ code.
    """

    untimed_steps: int = 100_000_000
    grace_s: float = 0.5
    stop_grace_s: float = 5.0
    stop_interval_s: float = 0.02
    exit_grace_s: float = 10.0

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
        self._pace: _Pace | None = None if within is None else within._pace
        self._planned_end = self.deadline
        self._stop: StopThread | None = None
        if should_stop is not None:
            self._stop = StopThread(should_stop, self.policy.stop_interval_s)
        self._family: _Family = _Family(begun) if within is None else within._family
        if within is not None:
            self.deadline = min(self.deadline, within.deadline)
            self._planned_end = min(self._planned_end, within._planned_end)
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
        """Return a clock for a share of the time that is left; of a paced clock, for a share of the
        time that it plans with."""
        left = self.planned_left
        return Clock(None if left == math.inf else share * left, within=self)

    def paced(self, planned_s: float) -> Clock:
        """Return a clock that plans with some seconds from now on, however much time is left.

        Its shares do not depend on the time limit. So work that divides its time by shares takes
        the same steps whatever the limit is, and a longer limit only adds steps.

        Parameters
        ----------
        planned_s : float
            Seconds after which the clock is up, if its time does not end before.

        Examples
        --------
        >>> run = Clock(10.0)
        >>> round_ = run.paced(100.0)
        >>> 49.0 < round_.part(0.5).planned_left <= 50.0, round_.part(0.5).left <= 10.0
        (True, True)
        """
        paced = Clock(planned_s, within=self)
        paced._pace, paced._planned_end = _Pace(), paced.start + planned_s
        return paced

    @property
    def planned_left(self) -> float:
        """Seconds that a paced clock still plans with; for any other clock, the seconds left."""
        if self._pace is None or self.is_stopped:
            return self.left
        return self._planned_end - time.monotonic()

    @property
    def has_run_out(self) -> bool:
        """Flag that a paced clock or one of its parts was found to be up, so that its work may have
        been cut short."""
        pace = self._pace
        return pace is not None and (pace.has_run_out or any(f[0] != 0 for f in pace.flags))

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

    def stop(self) -> None:
        """End the time of this clock, and of all within it, if it was made with `should_stop`."""
        if self._stop is not None:
            self._stop.now = True

    def close(self) -> None:
        """End the calls of `should_stop`; raise what it raised."""
        if self._stop is not None:
            self._stop.close()

    @property
    def is_up(self) -> bool:
        """State of having reached the limit."""
        is_up = self.left <= 0.0
        if is_up and self._pace is not None:
            self._pace.has_run_out = True
        return is_up

    @property
    def flag(self) -> Flag:
        """Flag (1,) for compiled loops: 0 until the time is up, then 1."""
        if self._flag is None:
            self._flag = np.zeros(1, dtype=np.int64)
            if self.is_up:
                self._flag[0] = 1
            elif self.deadline < math.inf:
                DEADLINES.add(self.deadline, self._flag)
            if self._stop is not None:
                self._stop.add(self._flag)
            if self._pace is not None:
                self._pace.flags.append(self._flag)
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

        Compiling does not count. Ctrl-C abandons work anyway.

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
        work = AbandonableCall(call)
        try:
            while not work.ends_within(min(0.2, max(self.policy.stop_interval_s, self.left))):
                more = self.policy.stop_grace_s if winds_down and self.is_stopped else 0.0
                if self._overdue(more) or abandoned()[0]:
                    raise self._broken_off(self._family.doing or doing)
        except (KeyboardInterrupt, LimitReachedError):
            work.abandon(self.policy.exit_grace_s)
            raise
        return work.result()

    def interruptible(self, call: Callable[[], T]) -> T:
        """Return the result of a call that checks the flag, made in a thread, so that Ctrl-C ends
        it at once."""
        flag, work = self.flag, ThreadedCall(call)
        try:
            while not work.ends_within(0.2):
                pass
        except KeyboardInterrupt:
            flag[0] = 1
            work.ends_within()
            raise
        return work.result()


def _is_compiling() -> bool:
    """Return whether Numba compiles a kernel just now."""
    lock = sys.modules.get("numba.core.compiler_lock")
    return lock is not None and bool(lock.global_compiler_lock.is_locked())


@dataclass
class _Pace:
    """State that a paced clock shares with its parts.

    Attributes
    ----------
    has_run_out
        Whether the clock or one of its parts was found to be up.
    flags
        Flags by which these clocks are stopped.
    """

    has_run_out: bool = False
    flags: list[Flag] = field(default_factory=list)


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


__getattr__ = deprecated_names(
    globals(),
    NEVER="netsp.base.time_flags:NEVER",
    is_abandoned_work_running="netsp.base.bounded_work:is_abandoned_work_running",
    until_interrupt="netsp.base.interrupt_signals:until_interrupt",
    deferred_interrupts="netsp.base.interrupt_signals:deferred_interrupts",
    remembered_interrupts="netsp.base.interrupt_signals:remembered_interrupts",
)

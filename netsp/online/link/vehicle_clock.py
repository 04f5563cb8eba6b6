"""Clock of a vehicle: late messages, clocks that were set, and restarts.

A boot clock counts from zero when the vehicle starts; a clock of the day is set now and then. A
time that is behind the last one is therefore one of three things: a message that came late, a clock
that was set back, or a vehicle that restarted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from netsp.online.link.link_policy import ClockPolicy

ClockEvent = Literal["late", "set", "restart"]


@dataclass(frozen=True)
class ClockReading:
    """Reading of a vehicle's clock.

    Attributes
    ----------
    time
        Time by a clock that is never set, s: the vehicle's own, plus the time by which it was
        set
        back since its last start.
    event
        "late" for a message to leave out, "set" or "restart" at the first message after that;
        None
        for the others.
    step
        Time by which the vehicle's clock went back at "set" and "restart", s.
    """

    time: float
    event: ClockEvent | None = None
    step: float = 0.0


class VehicleClock:
    """Clock of a vehicle that is never set.

    Parameters
    ----------
    policy : ClockPolicy, optional
        Rule for times that go back.

    Attributes
    ----------
    offset : float
        Seconds to add to the vehicle's times since its last start.

    Examples
    --------
    >>> clock = VehicleClock(ClockPolicy(min_behind_s=0.0, n_behind=1))
    >>> [clock.read(t).time for t in (100.0, 100.1, 98.2)]
    [100.0, 100.1, 100.1]
    >>> clock.read(0.5).event
    'restart'
    """

    def __init__(self, policy: ClockPolicy = ClockPolicy()) -> None:
        self.policy = policy
        self.offset = 0.0
        self._last: float | None = None
        self._behind: list[float] = []

    def read(self, time: float) -> ClockReading:
        """Read the time of one more message, s by the vehicle's clock."""
        p, last = self.policy, self._last
        if last is None or time >= last - p.max_late_s:
            self._behind = []
            self._last = time if last is None else max(last, time)
            return ClockReading(time + self.offset)
        if self._behind and time < self._behind[-1] - p.max_late_s:
            self._behind = []
        self._behind.append(time)
        is_brief = time - self._behind[0] < p.min_behind_s - 1e-6  # rounding of decimal fractions
        if is_brief or len(self._behind) < p.n_behind:
            return ClockReading(time + self.offset, "late")
        begin = self._behind[0]
        period = (time - begin) / max(len(self._behind) - 1, 1)
        step = last + period - begin
        self._behind, self._last = [], time
        if step > p.min_restart_step_s and begin <= min(p.max_boot_s, 0.5 * last):
            self.offset = 0.0
            return ClockReading(time, "restart", step)
        self.offset += step
        return ClockReading(time + self.offset, "set", step)

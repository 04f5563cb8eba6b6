"""Clock of a vehicle: late messages, clocks that were set, and restarts told apart.

A boot clock counts from zero when the vehicle starts; a clock of the day is set now and then. A
time that is behind the last one is therefore one of three things: a message that came late, a clock
that was set back, or a vehicle that started anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from netsp.base.errors import InputError

ClockEvent = Literal["late", "set", "restart"]


@dataclass(frozen=True)
class ClockPolicy:
    """Policy that tells a restart of the vehicle, a clock that was set, and a late message apart.

    A vehicle has restarted where its clock begins anew near zero: it goes back by more than
    `min_restart_step_s`, to within `max_boot_s` of zero, and to at most half of what it said. Any
    other clock that stays behind has been set. A single message that is behind came late.

    Attributes
    ----------
    max_late_s
        Largest step back that is taken for nothing, s: messages of several kinds are sent in no
        order. Positive.
    min_restart_step_s
        Smallest step back of a restart, s: no vehicle is under way sooner. At least `max_late_s`.
    max_boot_s
        Largest first reading of a clock after a restart, s: the link takes that long to come back.
        Positive.
    min_behind_s
        Time for which messages are behind before the clock is taken to have changed, s; 0 or more.
    n_behind
        Messages in a row that are behind before the clock is taken to have changed, at least 1.
    """

    max_late_s: float = 0.95
    min_restart_step_s: float = 5.0
    max_boot_s: float = 60.0
    min_behind_s: float = 0.3
    n_behind: int = 2

    def __post_init__(self) -> None:
        if not 0.0 < self.max_late_s <= self.min_restart_step_s:
            raise InputError(
                f"max_late_s: expected more than 0 and at most {self.min_restart_step_s:g} s, got "
                f"{self.max_late_s!r}"
            )
        if not self.max_boot_s > 0.0:
            raise InputError(f"max_boot_s: expected a positive time, got {self.max_boot_s!r}")
        if not self.min_behind_s >= 0.0:
            raise InputError(f"min_behind_s: expected 0 or more, got {self.min_behind_s!r}")
        if self.n_behind < 1:
            raise InputError(f"n_behind: expected 1 or more, got {self.n_behind!r}")


@dataclass(frozen=True)
class ClockReading:
    """Reading of a vehicle's clock.

    Attributes
    ----------
    time
        Seconds by a clock that is never set: the vehicle's own, plus what it was set back by since
        its last start.
    event
        "late" for a message to leave out, "set" or "restart" at the first message after that; None
        for the others.
    step
        Seconds by which the vehicle's clock went back at "set" and "restart".
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
    >>> [clock.take(t).time for t in (100.0, 100.1, 98.2)]
    [100.0, 100.1, 100.1]
    >>> clock.take(0.5).event
    'restart'
    """

    def __init__(self, policy: ClockPolicy | None = None) -> None:
        self.policy = policy or ClockPolicy()
        self.offset = 0.0
        self._last: float | None = None
        self._behind: list[float] = []

    def take(self, time: float) -> ClockReading:
        """Read the time of one more message.

        Parameters
        ----------
        time : float
            As the vehicle says it, s.

        Returns
        -------
        ClockReading
            The time by a clock that is never set.
        """
        p, last = self.policy, self._last
        if last is None or time >= last - p.max_late_s:
            self._behind = []
            self._last = time if last is None else max(last, time)
            return ClockReading(time + self.offset)
        if self._behind and time < self._behind[-1] - p.max_late_s:
            self._behind = []
        self._behind.append(time)
        is_brief = time - self._behind[0] < p.min_behind_s - 1e-6  # of decimal fractions
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

"""Policies of a link to a vehicle: its clock, what corrects its position, and what is sent."""

from __future__ import annotations

from dataclasses import dataclass, field

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_not_negative, check_positive


@dataclass(frozen=True)
class ClockPolicy:
    """Policy that tells a restart of the vehicle, a clock that was set, and a late message apart.

    The vehicle has restarted if its clock goes back by more than `min_restart_step_s`, to at most
    `max_boot_s`, and to at most half of the time before. Any other clock that stays behind was set.
    A single message that is behind came late.

    Attributes
    ----------
    max_late_s
        Largest step back that is ignored, s: messages of several kinds are sent in no order.
        Positive.
    min_restart_step_s
        Smallest step back of a restart, s: no vehicle is under way sooner. At least `max_late_s`.
    max_boot_s
        Largest first reading of a clock after a restart, s: the link takes that long to come back.
        Positive.
    min_behind_s
        Time for which messages must be behind before the clock counts as changed, s. Not negative.
    n_behind
        Number of messages in a row that must be behind before the clock counts as changed, at least
        1.
    """

    max_late_s: float = 0.95
    min_restart_step_s: float = 5.0
    max_boot_s: float = 60.0
    min_behind_s: float = 0.3
    n_behind: int = 2

    def __post_init__(self) -> None:
        check_not_negative(self)
        if not 0.0 < self.max_late_s <= self.min_restart_step_s:
            raise InputError(
                f"max_late_s: expected more than 0 and at most {self.min_restart_step_s:g} s, got "
                f"{self.max_late_s!r}"
            )
        if not self.max_boot_s > 0.0:
            raise InputError(f"max_boot_s: expected a positive time, got {self.max_boot_s!r}")
        if self.n_behind < 1:
            raise InputError(f"n_behind: expected 1 or more, got {self.n_behind!r}")


@dataclass(frozen=True)
class AidingPolicy:
    """Policy that tells an aided position from one without aiding. All numbers are positive.

    Attributes
    ----------
    max_age_s
        Longest time for which GPS_RAW_INT may repeat the time of its fix, or stay away while other
        messages come, s. `max_intervals` of its usual intervals if those are longer.
    max_innovation
        Ratio of an innovation to what the filter accepts from which on it rejects a measurement;
        ArduPilot rejects them from 1 on.
    n_intervals
        Number of intervals between GPS messages whose median is the usual interval.
    max_intervals
        Number of usual intervals without a GPS message after which the GPS is silent: two messages
        may get lost.
    """

    max_age_s: float = 1.5
    max_innovation: float = 1.0
    n_intervals: int = 9
    max_intervals: float = 3.0

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class LinkPolicy:
    """Policy of a link to a vehicle. All numbers are positive.

    Attributes
    ----------
    heartbeat_s
        Time between two heartbeats of ours, s. ArduSub disarms after 5 s without one; at half a
        second, several may get lost.
    max_clock_step_s
        Largest time by which the vehicle's clock may go back because messages overtake one another,
        s; more is a restart.
    position_interval_s
        Time between two positions that are requested, s; twice as long between the filter's and
        the GPS's messages, five times as long between those of other sensors.
    echo_interval_s
        Time between two echoes of the target that are requested, s.
    max_distance
        Largest plausible distance from the base, m; a position beyond is ignored.
    max_speed
        Largest plausible speed, m/s; a velocity beyond is ignored.
    max_text_bytes
        Longest text sent to ground stations, bytes; longer ones are cut.
    clock
        Policy of the vehicle's clock.
    aiding
        Policy of what corrects the vehicle's position.
    """

    heartbeat_s: float = 0.5
    max_clock_step_s: float = 2.0
    position_interval_s: float = 0.1
    echo_interval_s: float = 0.5
    max_distance: float = 1e7
    max_speed: float = 1e3
    max_text_bytes: int = 250
    clock: ClockPolicy = field(default_factory=ClockPolicy)
    aiding: AidingPolicy = field(default_factory=AidingPolicy)

    def __post_init__(self) -> None:
        check_positive(self)

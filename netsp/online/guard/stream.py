"""A guard at its pace: fixes as they come, reports ten times a second."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, replace

from netsp.online.guard.guard_report import Report
from netsp.online.guard.position_track import GAP
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard
from netsp.online.link.vehicle_clock import ClockPolicy, ClockReading, VehicleClock

PERIOD_S = 0.095
"""Between two updates: vehicles tell where they are 10, 25 or 50 times a second."""

SILENT_S = 0.5
"""Seconds without a position after which silence is reported, and period of these reports."""


class Stream:
    """Gathers fixes until an update is due.

    Parameters
    ----------
    guard : Guard
        That is told.
    policy : ClockPolicy, optional
        Rule that tells a clock that was set from a vehicle that restarted.
    on_note : callable, optional
        Called with a line of text when the vehicle's clock goes back.
    """

    def __init__(
        self, guard: Guard, policy: ClockPolicy | None = None,
        on_note: Callable[[str], None] | None = None,
    ) -> None:  # fmt: skip
        self.guard, self.on_note = guard, on_note
        self.clock = VehicleClock(policy)
        self._gathered: Fix | None = None
        self._due = float("-inf")

    def take(self, fix: Fix) -> Report | None:
        """One more fix.

        Parameters
        ----------
        fix : Fix
            What the vehicle says.

        Returns
        -------
        Report or None
            None while no update is due.
        """
        reading = self.clock.take(fix.time)
        if reading.event == "late":
            return None
        if reading.event is not None:
            self._note_clock(fix.time, reading)
        fix = replace(fix, time=reading.time)
        before = self._gathered
        if before is not None:
            kept = {
                f.name: getattr(before, f.name)
                for f in fields(Fix) if getattr(fix, f.name) is None
            }  # fmt: skip
            fix = replace(fix, **kept)
        self._gathered = fix
        restarted = reading.event == "restart"
        urgent = fix.estimate is False
        due = self._due if fix.position is not None else self._due + SILENT_S
        if not urgent and not restarted and (fix.time < due or self._is_first(fix)):
            return None
        self._gathered, self._due = None, fix.time + PERIOD_S
        return self._by_vehicle_clock(
            self.guard.restarted(fix) if restarted else self.guard.take(fix)
        )

    def _is_first(self, fix: Fix) -> bool:
        """Return whether a fix without a position is the first of all, and begin the silence."""
        if fix.position is not None or self._due > float("-inf"):
            return False
        self._due = fix.time
        return True

    def wait(self, now: float) -> Report:
        """Nothing has come for a while.

        Parameters
        ----------
        now : float
            Seconds, of the vehicle's clock.

        Returns
        -------
        Report
            As it is now.
        """
        return self._by_vehicle_clock(self.guard.wait(now + self.clock.offset))

    def _by_vehicle_clock(self, report: Report) -> Report:
        """Return a report with the time of the vehicle's own clock."""
        offset = self.clock.offset
        return replace(report, time=report.time - offset) if offset else report

    def _note_clock(self, time: float, reading: ClockReading) -> None:
        if self.on_note is not None:
            what = "the vehicle restarted" if reading.event == "restart" else "the clock was set"
            self.on_note(f"{what}: its time went back by {reading.step:.4g} s to {time:.10g} s")


def replayed(
    guard: Guard, fixes: Iterable[Fix], on_note: Callable[[str], None] | None = None
) -> Iterator[Report]:  # fmt: skip
    """What a guard would have said.

    Parameters
    ----------
    guard : Guard
        A new one.
    fixes : iterable of Fix
        Of a recording.
    on_note : callable, optional
        Called with a line of text when the vehicle's clock goes back.

    Yields
    ------
    Report
        Ten a second, at most.
    """
    stream = Stream(guard, on_note=on_note)
    last: float | None = None
    for fix in fixes:
        if last is not None and fix.time - last > GAP:  # a live guard reports silence, too
            waits = int(min(fix.time - last, GAP + 4.0 * SILENT_S) / SILENT_S)
            for k in range(1, waits + 1):
                if last + k * SILENT_S < fix.time:
                    yield stream.wait(last + k * SILENT_S)
        last = fix.time
        report = stream.take(fix)
        if report is not None:
            yield report

"""Stream of fixes that updates a guard at its own interval, ten times a second."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from netsp.online.guard.guard_report import Report
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard
from netsp.online.link.vehicle_clock import ClockReading, VehicleClock


class Stream:
    """Stream of fixes that updates a guard at its pace.

    Parameters
    ----------
    guard : Guard
        Guard, whose policy has the interval of updates and the rules for clocks that were set.
    on_note : callable, optional
        Called with a line of text when the vehicle's clock goes back.
    """

    def __init__(self, guard: Guard, on_note: Callable[[str], None] | None = None) -> None:
        self.guard, self.on_note = guard, on_note
        self.pace = guard.policy.pace
        self.clock = VehicleClock(guard.policy.link.clock)
        self._gathered: Fix | None = None
        self._due = float("-inf")

    def add(self, fix: Fix) -> Report | None:
        """Add a fix, and return the report of the guard; None while no update is due."""
        reading = self.clock.read(fix.time)
        if reading.event == "late":
            return None
        if reading.event is not None:
            self._note_clock(fix.time, reading)
        fix = replace(fix, time=reading.time)
        before = self._gathered
        if before is not None:
            fix = fix.completed_by(before)
        self._gathered = fix
        has_restarted = reading.event == "restart"
        is_urgent = fix.estimate is False
        due = self._due if fix.position is not None else self._due + self.pace.silence_s
        if not is_urgent and not has_restarted and (fix.time < due or self._is_first(fix)):
            return None
        self._gathered, self._due = None, fix.time + self.pace.update_s
        update = self.guard.restart_vehicle if has_restarted else self.guard.update
        return self._by_vehicle_clock(update(fix))

    def _is_first(self, fix: Fix) -> bool:
        """Return whether a fix without a position is the first of all, and begin the silence."""
        if fix.position is not None or self._due > float("-inf"):
            return False
        self._due = fix.time
        return True

    def advance_to(self, now: float) -> Report:
        """Advance the guard to a time of the vehicle's clock, though nothing came; return its
        report."""
        return self._by_vehicle_clock(self.guard.advance_to(now + self.clock.offset))

    def _by_vehicle_clock(self, report: Report) -> Report:
        """Return a report with the time of the vehicle's own clock."""
        offset = self.clock.offset
        return replace(report, time=report.time - offset) if offset else report

    def _note_clock(self, time: float, reading: ClockReading) -> None:
        if self.on_note is not None:
            what = "the vehicle restarted" if reading.event == "restart" else "the clock was set"
            self.on_note(f"{what}: its time went back by {reading.step:.4g} s to {time:.10g} s")


def replay_fixes(
    guard: Guard, fixes: Iterable[Fix], on_note: Callable[[str], None] | None = None
) -> Iterator[Report]:
    """Yield the reports of a new guard about the fixes of a recording, at most ten a second.

    `on_note` is called with a line of text when the vehicle's clock goes back.
    """
    silence_s, dropout_s = guard.policy.pace.silence_s, guard.policy.track.dropout_s
    stream = Stream(guard, on_note=on_note)
    last: float | None = None
    for fix in fixes:
        if last is not None and fix.time - last > dropout_s:  # a live guard reports silence, too
            count = int(min(fix.time - last, dropout_s + 4.0 * silence_s) / silence_s)
            for k in range(1, count + 1):
                if last + k * silence_s < fix.time:
                    yield stream.advance_to(last + k * silence_s)
        last = fix.time
        report = stream.add(fix)
        if report is not None:
            yield report

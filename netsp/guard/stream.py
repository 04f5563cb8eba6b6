"""A guard at its pace: fixes as they come, reports ten times a second."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields, replace

from netsp.guard.fix import Fix
from netsp.guard.guard import Guard
from netsp.guard.report import Report

PERIOD_S = 0.095
"""Between two updates: vehicles tell where they are 10, 25 or 50 times a second."""


class Stream:
    """Gathers fixes until an update is due.

    Parameters
    ----------
    guard : Guard
        That is told.
    """

    def __init__(self, guard: Guard) -> None:
        self.guard = guard
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
        before = self._gathered
        if before is not None:
            kept = {
                f.name: getattr(before, f.name)
                for f in fields(Fix) if getattr(fix, f.name) is None
            }  # fmt: skip
            fix = replace(fix, **kept)
        self._gathered = fix
        # a vehicle that started anew counts its time from 0 again
        restarted = fix.time < self._due - 10.0 * PERIOD_S
        urgent = fix.estimate is False
        if not urgent and not restarted and (fix.position is None or fix.time < self._due):
            return None
        self._gathered, self._due = None, fix.time + PERIOD_S
        return self.guard.restarted(fix) if restarted else self.guard.take(fix)

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
        return self.guard.wait(now)


def replayed(guard: Guard, fixes: Iterable[Fix]) -> Iterator[Report]:
    """What a guard would have said.

    Parameters
    ----------
    guard : Guard
        A new one.
    fixes : iterable of Fix
        Of a recording.

    Yields
    ------
    Report
        Ten a second, at most.
    """
    stream = Stream(guard)
    for fix in fixes:
        report = stream.take(fix)
        if report is not None:
            yield report

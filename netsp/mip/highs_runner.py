"""HiGHS in this process: without output, with one thread, to be stopped at any time."""

from __future__ import annotations

from typing import Any

import highspy
import numpy as np

from netsp.base.clock import Clock

NONE = (0, np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0))
"""No entries of rows."""


class Quiet(highspy.Highs):  # type: ignore[misc]
    """HiGHS that prints nothing: 1.16 prints its banner to standard output, where solutions go, as
    soon as callbacks are enabled, which its constructor does."""

    def enableCallbacks(self) -> None:
        """With nothing printed."""
        self.setOptionValue("output_flag", False)
        super().enableCallbacks()


def silent_solver() -> highspy.Highs:
    """An empty program, and tolerances as small as HiGHS takes them."""
    h = Quiet()
    h.setOptionValue("output_flag", False)
    h.setOptionValue("threads", 1)
    h.setOptionValue("primal_feasibility_tolerance", 1e-9)
    h.setOptionValue("dual_feasibility_tolerance", 1e-9)
    return h


def run(h: highspy.Highs, time_left: float) -> None:
    """Solve, for so many seconds."""
    # HiGHS counts its limit from the first run of the object
    limit = h.getRunTime() + max(time_left, 0.05) if time_left < 1e9 else 1e30
    h.setOptionValue("time_limit", limit)
    h.run()


class Interruption:
    """Ends a run of HiGHS when a clock is up, also before its deadline."""

    def __init__(self, *events: Any) -> None:
        self.clock = Clock()
        self._events, self._on = events, False

    def hear(self, clock: Clock, *, always: bool) -> None:
        """Of this clock from now on. Being asked at every step of the simplex method costs time, so
        that it is done only where it is needed."""
        self.clock = clock
        if (always or clock.can_stop) and not self._on:
            self._on = True
            for event in self._events:
                event.subscribe(self._interrupt)

    def _interrupt(self, event: Any) -> None:
        if self.clock.is_up:
            event.interrupt()

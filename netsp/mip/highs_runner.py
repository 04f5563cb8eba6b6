"""HiGHS in this process: silent, with one thread, and interruptible."""

from __future__ import annotations

from typing import Any

import highspy
import numpy as np

from netsp.base.clock import Clock

NO_ENTRIES = (0, np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0))
"""Arguments of rows without entries."""


class SilentHighs(highspy.Highs):  # type: ignore[misc]
    """HiGHS that prints nothing.

    HiGHS 1.16 prints its banner to standard output, where solutions go, when its constructor
    enables callbacks.
    """

    def enableCallbacks(self) -> None:
        """Turn output off, then enable callbacks."""
        self.setOptionValue("output_flag", False)
        super().enableCallbacks()


def silent_solver() -> highspy.Highs:
    """Return an empty program with the smallest tolerances that HiGHS accepts."""
    h = SilentHighs()
    h.setOptionValue("output_flag", False)
    h.setOptionValue("threads", 1)
    h.setOptionValue("primal_feasibility_tolerance", 1e-9)
    h.setOptionValue("dual_feasibility_tolerance", 1e-9)
    return h


def run(h: highspy.Highs, time_left: float) -> None:
    """Solve for at most `time_left` seconds."""
    # HiGHS counts its limit from the first run of the object
    limit = h.getRunTime() + max(time_left, 0.05) if time_left < 1e9 else 1e30
    h.setOptionValue("time_limit", limit)
    h.run()


class Interruption:
    """Callback that ends a run of HiGHS when a clock is up, also before its deadline."""

    def __init__(self, *events: Any) -> None:
        self.clock = Clock()
        self._events, self._is_subscribed = events, False

    def follow(self, clock: Clock, *, always: bool) -> None:
        """Interrupt by another clock from now on.

        A callback at every simplex step takes time, so it is subscribed only for a clock that may
        be stopped, or `always`.
        """
        self.clock = clock
        if (always or clock.can_stop) and not self._is_subscribed:
            self._is_subscribed = True
            for event in self._events:
                event.subscribe(self._interrupt)

    def _interrupt(self, event: Any) -> None:
        if self.clock.is_up:
            event.interrupt()

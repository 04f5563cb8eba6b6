"""Clock of a command, whose time limit counts from the start of the command."""

from __future__ import annotations

import time
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from netsp.base.clock import Clock

_start: ContextVar[tuple[float, float] | None] = ContextVar("start", default=None)
"""Monotonic time and CPU seconds of the process at the start of the command, s."""


def begin_command() -> None:
    """Record that a command starts now."""
    _start.set((time.monotonic(), time.process_time()))


def command_clock(limit: float | None) -> Clock:
    """Return a clock that counts from the start of the command, so that loading netsp's modules and
    reading files count too.

    Parameters
    ----------
    limit : float or None
        Seconds; None for no limit.
    """
    from netsp.base.clock import Clock

    return Clock(limit, begun=_start.get())

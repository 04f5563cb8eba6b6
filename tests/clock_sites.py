"""Clock that records the call sites which ask it, and whose time can be up at a chosen site.

A run that asks its clock in every loop ends soon, wherever its time is up. If a run takes long to
end after its time was up at some call site, a later loop does not ask the clock.
"""

from __future__ import annotations

import sys
import time
import weakref
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import netsp.base.clock
from netsp.base.clock import Clock
from netsp.base.time_flags import Flag

OWN = {netsp.base.clock.__file__, __file__}

Site = tuple[str, int]
"""File, relative to the package, and line."""


class Sites:
    """Call sites where clocks are asked, and one of them where the time is up.

    Parameters
    ----------
    at : Site, optional
        Where; None records only.
    times : int
        At which time that the clock is asked there.

    Attributes
    ----------
    asked : Counter of Site
        How often each site asked.
    fired : float or None
        CPU seconds of the process when the time was up; None before.
    """

    def __init__(self, at: Site | None = None, times: int = 1) -> None:
        self.at, self.times = at, times
        self.asked: Counter[Site] = Counter()
        self.fired: float | None = None
        self._clocks: weakref.WeakSet[Clock] = weakref.WeakSet()

    def ask(self, clock: Clock) -> None:
        """Record a question to a clock; end all clocks if it was asked where it is to end."""
        self._clocks.add(clock)
        frame = sys._getframe(2)
        while frame.f_back is not None and frame.f_code.co_filename in OWN:
            frame = frame.f_back
        package = Path(netsp.base.clock.__file__).parent
        file = Path(frame.f_code.co_filename)
        name = str(file.relative_to(package)) if file.is_relative_to(package) else file.name
        site = (name, frame.f_lineno)
        self.asked[site] += 1
        if site == self.at and self.asked[site] == self.times:
            self.fired = time.process_time()
            for each in list(self._clocks):
                if each._family is clock._family:
                    each.end()

    @property
    def overtime(self) -> float:
        """CPU seconds since the time was up."""
        assert self.fired is not None
        return time.process_time() - self.fired


@contextmanager
def watched(at: Site | None = None, times: int = 1) -> Iterator[Sites]:
    """Have every clock say where it is asked, and its time be up at one site.

    Parameters
    ----------
    at : Site, optional
        The site.
    times : int
        At which time that it asks.
    """
    sites = Sites(at, times)
    left, flag = Clock.left, Clock.flag

    def asked_left(clock: Clock) -> float:
        sites.ask(clock)
        return left.fget(clock)

    def asked_flag(clock: Clock) -> Flag:
        sites.ask(clock)
        return flag.fget(clock)

    Clock.left, Clock.flag = property(asked_left), property(asked_flag)
    try:
        yield sites
    finally:
        Clock.left, Clock.flag = left, flag

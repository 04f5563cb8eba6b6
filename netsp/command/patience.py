"""Lines that name a long step and its duration if nothing else is printed for some seconds."""

from __future__ import annotations

import threading
import time
from contextlib import ExitStack
from typing import TextIO

from netsp.base.progress import reported_to
from netsp.command.command_policy import CommandPolicy


class Patience:
    """Context manager that prints lines about the progress of its body.

    A line states the steps done and the estimated time left if the body counts its steps
    (`netsp.base.progress`), else the time so far.

    Parameters
    ----------
    stream : file
        Stream for the lines.
    doing : str
        Name of the work in the lines.
    policy : CommandPolicy
        Times until the first line and between further lines.
    """

    def __init__(self, stream: TextIO, doing: str, policy: CommandPolicy = CommandPolicy()) -> None:
        self._stream, self._doing, self._policy = stream, doing, policy
        self._done, self._total = 0, 0
        self._begin = self._since = time.monotonic()
        self._over = threading.Event()
        self._open = ExitStack()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Patience:
        self._open.enter_context(reported_to(self._step))
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()  # no line comes after the work is done
        self._open.close()

    def _step(self, done: int, total: int) -> None:
        if done < self._done or total != self._total:
            self._since = time.monotonic()  # another series of steps has begun
        self._done, self._total = done, total

    def _watch(self) -> None:
        wait = self._policy.silence_s
        while not self._over.wait(wait):
            wait = self._policy.line_interval_s
            print(self.line, file=self._stream, flush=True)

    @property
    def line(self) -> str:
        """State of the work in one line."""
        now, done, total = time.monotonic(), self._done, self._total
        if not 0 < done < total:
            return f"{self._doing}: {span(now - self._begin)} so far"
        left_s = (now - self._since) / done * (total - done)
        return f"{self._doing}: {done} of {total}, about {span(left_s)} left"


def span(seconds: float) -> str:
    """Return a duration as minutes and seconds, with hours if there are any."""
    minutes, rest_s = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest_s:02d}" if hours else f"{minutes}:{rest_s:02d}"

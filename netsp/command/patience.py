"""Lines that name a long step and its duration if nothing else is printed for some seconds."""

from __future__ import annotations

import threading
import time
from contextlib import ExitStack
from typing import TextIO

from netsp.base.progress import reported_to
from netsp.command.command_policy import CommandPolicy


class Patience:
    """While the body of a `with` runs, a line now and then of how far it is: by its steps, where
    these are counted (`netsp.base.progress`), with about the time that is left.

    Parameters
    ----------
    stream : file
        Where to.
    doing : str
        What is being done.
    policy : CommandPolicy
        Times of the first line and of those after it.
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
            self._since = time.monotonic()  # other steps than before
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
        left = (now - self._since) / done * (total - done)
        return f"{self._doing}: {done} of {total}, about {span(left)} left"


def span(seconds: float) -> str:
    """Minutes and seconds, or hours as well."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"

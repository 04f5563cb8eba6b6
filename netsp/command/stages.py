"""Progress of work that goes through stages."""

from __future__ import annotations

import time
from typing import TextIO

from netsp.command.command_policy import CommandPolicy
from netsp.command.patience import span


class Stages:
    """Shows what is being done: in one line that is written again where somebody watches, else in a
    line for each stage, and for a long one now and then. With a limit, the seconds left of it."""

    def __init__(
        self, stream: TextIO, limit: float | None = None, policy: CommandPolicy = CommandPolicy()
    ) -> None:
        self._stream, self._begin, self._limit = stream, time.monotonic(), limit
        self._watched = stream.isatty()
        self._interval_s = policy.redraw_interval_s if self._watched else policy.line_interval_s
        self._stage, self._shown = "", -self._interval_s

    def __call__(self, text: str) -> None:
        """Show it, if it is a new stage or some time has passed."""
        now = time.monotonic()
        stage = text.split(",")[0].split(" from ")[0]
        if stage == self._stage and now - self._shown < self._interval_s:
            return
        if stage != self._stage and not self._watched:
            text = stage  # how far it is will be told of those that take long
        seconds = now - self._begin
        left = "" if self._limit is None else f", {span(max(self._limit - seconds, 0.0))} left"
        line = f"{seconds:7.1f}s  {text} …{left}"
        if self._watched:
            end = "\n" if stage != self._stage and self._stage else ""
            print(f"{end}\r{line:<78}", end="", file=self._stream, flush=True)
        else:
            print(line, file=self._stream, flush=True)
        self._stage, self._shown = stage, now

    def __enter__(self) -> Stages:
        return self

    def __exit__(self, *_: object) -> None:
        if self._watched and self._stage:
            print(file=self._stream)

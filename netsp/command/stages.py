"""Progress of work that goes through stages."""

from __future__ import annotations

import time
from typing import TextIO

from netsp.command.command_policy import CommandPolicy
from netsp.command.patience import span


class Stages:
    """Display of the stage that is running.

    On a terminal one line is redrawn. Elsewhere each stage gets a line, and a long stage more lines
    at intervals. With a time limit, each line states the time left.
    """

    def __init__(
        self, stream: TextIO, limit: float | None = None, policy: CommandPolicy = CommandPolicy()
    ) -> None:
        self._stream, self._begin, self._limit = stream, time.monotonic(), limit
        self._is_terminal = stream.isatty()
        self._interval_s = policy.redraw_interval_s if self._is_terminal else policy.line_interval_s
        self._stage, self._shown = "", -self._interval_s

    def __call__(self, text: str) -> None:
        """Show a line if it begins a new stage, or one is due."""
        now = time.monotonic()
        stage = text.split(",")[0].split(" from ")[0]
        if stage == self._stage and now - self._shown < self._interval_s:
            return
        if stage != self._stage and not self._is_terminal:
            text = stage  # later lines of a long stage state its progress
        seconds = now - self._begin
        time_left = "" if self._limit is None else f", {span(max(self._limit - seconds, 0.0))} left"
        line = f"{seconds:7.1f}s  {text} …{time_left}"
        if self._is_terminal:
            end = "\n" if stage != self._stage and self._stage else ""
            print(f"{end}\r{line:<78}", end="", file=self._stream, flush=True)
        else:
            print(line, file=self._stream, flush=True)
        self._stage, self._shown = stage, now

    def __enter__(self) -> Stages:
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_terminal and self._stage:
            print(file=self._stream)

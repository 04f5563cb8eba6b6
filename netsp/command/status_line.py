"""Line at the bottom of a terminal, kept apart from other output."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO


class StatusLine:
    """Line that is redrawn while work goes on, and removed before other output is written.

    When the status line is removed, an unfinished line of other output is drawn again.

    Parameters
    ----------
    stream : file
        Stream of a terminal.
    default_columns : int
        Width of a terminal that does not report it, characters.
    """

    def __init__(self, stream: TextIO, default_columns: int = 80) -> None:
        self._stream, self._default_columns = stream, default_columns
        self._lock = threading.RLock()
        self._is_shown = False
        self._unfinished = ""

    def show(self, text: str) -> None:
        """Draw the line, cut to the width of the terminal."""
        with self._lock:
            self._stream.write(f"\r{text[: self.columns - 1]}\x1b[K")
            self._stream.flush()
            self._is_shown = True

    def clear(self) -> None:
        """Remove the line."""
        with self._lock:
            if self._is_shown:
                self._is_shown = False
                self._stream.write(f"\r\x1b[K{self._unfinished}")
                self._stream.flush()

    def write(self, stream: TextIO, text: str) -> int:
        """Write other output to a stream on the same terminal."""
        with self._lock:
            self.clear()
            count = stream.write(text)
            if text:
                self._unfinished = (self._unfinished + text).rpartition("\n")[2]
                self._unfinished = self._unfinished.rpartition("\r")[2]
        return count

    @property
    def columns(self) -> int:
        """Width of the terminal, characters."""
        try:
            columns = os.get_terminal_size(self._stream.fileno()).columns
        except (OSError, ValueError):
            columns = 0
        return columns or self._default_columns


class _StreamAboveLine:
    """Stream that removes a status line before it writes.

    Parameters
    ----------
    stream : file
        The stream.
    line : StatusLine
        The line on the same terminal.
    """

    def __init__(self, stream: TextIO, line: StatusLine) -> None:
        self._stream, self._line = stream, line

    def write(self, text: str) -> int:
        return self._line.write(self._stream, text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def status_line() -> Iterator[StatusLine | None]:
    """Provide a status line, apart from standard output and standard error, while the body runs.

    Yields
    ------
    StatusLine or None
        The line, on standard error; None where standard error is not a terminal.
    """
    if not sys.stderr.isatty():
        yield None
        return
    line, before = StatusLine(sys.stderr), (sys.stdout, sys.stderr)
    sys.stderr = _StreamAboveLine(sys.stderr, line)  # type: ignore[assignment]
    if sys.stdout.isatty():
        sys.stdout = _StreamAboveLine(sys.stdout, line)  # type: ignore[assignment]
    try:
        yield line
    finally:
        sys.stdout, sys.stderr = before
        line.clear()

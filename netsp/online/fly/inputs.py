"""Events that come while a tour is flown: one JSON object a line, as in a surprise file."""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Callable, Iterator
from typing import BinaryIO, TextIO

from pydantic import ValidationError

from netsp.base.errors import InputError
from netsp.base.validated import explain, parse_json_object
from netsp.online.execute.events import Event

MAX_LINE = 100_000
"""Longest line of events, characters or bytes; a longer one is taken in pieces and refused."""

MAX_READ = 65_536
"""Most bytes taken from a stream at once."""


def events_of(
    stream: TextIO | BinaryIO, complain: Callable[[str], None]
) -> Callable[[], list[Event]]:
    """Read events from a stream in a thread of its own.

    A stream with a file descriptor is read past Python's buffers: a thread that waits for a line
    holds the lock of the buffer, and Python aborts at its exit if it cannot have that lock.

    Parameters
    ----------
    stream : TextIO or BinaryIO
        Lines such as ``{"cancel_goal": "A3"}`` or ``{"appear": {"center": [3, 2], "radius": 1}}``;
        a time is not needed, for they come about at once.
    complain : callable
        Called, from that thread, with what is wrong with a line.

    Returns
    -------
    callable
        Returns the events since it was last called.
    """
    waiting: queue.Queue[Event] = queue.Queue()

    def read() -> None:
        for line in _lines_of(stream):
            if not line.strip():
                continue
            try:
                text = line if isinstance(line, str) else line.decode()
                waiting.put(event_of(text))
            except (InputError, UnicodeError) as error:
                complain(f"not understood: {error}")

    threading.Thread(target=read, daemon=True, name="netsp-events").start()

    def since() -> list[Event]:
        found = []
        while not waiting.empty():
            found.append(waiting.get_nowait())
        return found

    return since


def _lines_of(stream: TextIO | BinaryIO) -> Iterator[str | bytes]:
    """Yield the lines of a stream as they come, until it ends."""
    try:
        number = stream.fileno()
    except (OSError, AttributeError):  # held in memory: nobody waits for it
        while line := stream.readline(MAX_LINE):
            yield line
        return
    rest = b""
    while True:
        try:
            data = os.read(number, MAX_READ)
        except OSError:  # closed while it waited
            data = b""
        *lines, rest = (rest + data).split(b"\n")
        yield from lines
        if not data or len(rest) > MAX_LINE:
            yield rest
            rest = b""
        if not data:
            return


def event_of(line: str) -> Event:
    """Return the event in a line of JSON; InputError for what is none."""
    data = parse_json_object(line, "event")
    try:
        return Event.model_validate({"time": 0.0, **data})
    except ValidationError as error:
        raise InputError(f"event: {explain(error)}") from None

"""Events that arrive during a flight: one JSON object on each line, as in a surprise file."""

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
from netsp.online.fly.flight_policy import FlightPolicy


def read_events(
    stream: TextIO | BinaryIO,
    on_error: Callable[[str], None],
    policy: FlightPolicy = FlightPolicy(),
) -> Callable[[], list[Event]]:
    """Read events from a stream in a separate thread.

    A stream with a file descriptor is read past Python's buffers: a thread that waits for a
    line
    holds the lock of the buffer, and Python aborts at its exit if it cannot have that lock.

    Parameters
    ----------
    stream : TextIO or BinaryIO
        Lines such as ``{"cancel_goal": "A3"}`` or ``{"appear": {"center": [3, 2], "radius":
        1}}``;
        no time is needed, because events happen at once.
    on_error : callable
        Called, from that thread, with what is wrong with a line.
    policy : FlightPolicy
        Longest line.

    Returns
    -------
    callable
        Returns the events since it was last called.
    """
    waiting: queue.Queue[Event] = queue.Queue()

    def read() -> None:
        for line in _lines(stream, policy):
            if not line.strip():
                continue
            try:
                text = line if isinstance(line, str) else line.decode()
                waiting.put(parse_event(text))
            except (InputError, UnicodeError) as error:
                on_error(f"not understood: {error}")

    threading.Thread(target=read, daemon=True, name="netsp-events").start()

    def new_events() -> list[Event]:
        events = []
        while not waiting.empty():
            events.append(waiting.get_nowait())
        return events

    return new_events


def _lines(stream: TextIO | BinaryIO, policy: FlightPolicy) -> Iterator[str | bytes]:
    """Yield the lines of a stream as they come, until it ends."""
    try:
        number = stream.fileno()
    except (OSError, AttributeError):  # held in memory: never waits
        while line := stream.readline(policy.max_line):
            yield line
        return
    rest = b""
    while True:
        try:
            data = os.read(number, policy.max_read_bytes)
        except OSError:  # closed while it waited
            data = b""
        *lines, rest = (rest + data).split(b"\n")
        yield from lines
        if not data or len(rest) > policy.max_line:
            yield rest
            rest = b""
        if not data:
            return


def parse_event(line: str) -> Event:
    """Return the event in a line of JSON; raise InputError if the line is no event."""
    data = parse_json_object(line, "event")
    try:
        return Event.model_validate({"time": 0.0, **data})
    except ValidationError as error:
        raise InputError(f"event: {explain(error)}") from None

"""Events that come while a tour is flown: one JSON object a line, as in a surprise file."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import BinaryIO, TextIO

from pydantic import ValidationError

from netsp.errors import InputError
from netsp.execute.events import Event
from netsp.models import explain, parse_json_object

MOST_LINE = 100_000
"""Characters of a line."""


def events_of(
    stream: TextIO | BinaryIO, complain: Callable[[str], None]
) -> Callable[[], list[Event]]:
    """Events from a stream, which a thread of its own reads.

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
        while line := stream.readline(MOST_LINE):
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


def event_of(line: str) -> Event:
    """An event from a line of JSON; InputError for what is none."""
    data = parse_json_object(line, "event")
    try:
        return Event.model_validate({"time": 0.0, **data})
    except ValidationError as error:
        raise InputError(f"event: {explain(error)}") from None

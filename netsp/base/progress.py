"""Progress reporting through a context variable, without a parameter in every function."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

Listener = Callable[[int, int], None]
"""Callback that gets the number of steps done and the number of all steps."""

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)

Item = TypeVar("Item")


@contextmanager
def reported_to(listener: Listener) -> Iterator[None]:
    """Report progress to a listener while the body runs."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def track(items: Sequence[Item]) -> Iterator[Item]:
    """Yield the items of a sequence; report an item as done when the caller asks for the next."""
    for done, item in enumerate(items, 1):
        yield item
        report(done, len(items))


def report(done: int, total: int) -> None:
    """Report how many steps of a total are done, if anyone listens."""
    listener = _listener.get()
    if listener is not None:
        listener(done, total)

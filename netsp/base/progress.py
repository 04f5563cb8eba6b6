"""How far a piece of work is, told to who listens, without every function in between passing it
on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

Listener = Callable[[int, int], None]
"""Called with steps done and steps in all."""

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)

Item = TypeVar("Item")


@contextmanager
def heard_by(listener: Listener) -> Iterator[None]:
    """While the body runs, its steps are told to a listener.

    Parameters
    ----------
    listener : callable
        Called with steps done and steps in all.
    """
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def each(items: Sequence[Item]) -> Iterator[Item]:
    """The items of a sequence; each is told as done when the next is asked for.

    Parameters
    ----------
    items : sequence
        Any.

    Yields
    ------
    object
        Each of them.
    """
    for done, item in enumerate(items, 1):
        yield item
        tell(done, len(items))


def tell(done: int, total: int) -> None:
    """Tell how far it is.

    Parameters
    ----------
    done : int
        Steps done.
    total : int
        In all.
    """
    listener = _listener.get()
    if listener is not None:
        listener(done, total)

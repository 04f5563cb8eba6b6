"""Work that can be paused: a generator that yields wherever something else may run first.

Proofs and searches of this package are written as such generators. A solver that does one thing
after another runs them to the end (`run_to_end`); a scheduler gives each a slice of the time
(`netsp.gtsp.scheduler`).
"""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeVar

T = TypeVar("T")

Steps = Generator[None, None, T]
"""Generator that pauses after each step of some work and returns the result of the work. State that
the work shares, such as the incumbent, may have changed whenever the generator is resumed."""


def run_to_end(steps: Steps[T]) -> T:
    """Return the result of some work after all its steps.

    Examples
    --------
    >>> def count_to(n):
    ...     for _ in range(n):
    ...         yield
    ...     return n
    >>> run_to_end(count_to(3))
    3
    """
    while True:
        try:
            next(steps)
        except StopIteration as end:
            result: T = end.value
            return result

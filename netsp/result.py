"""What a solver returns, and how it reports on the way."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from netsp.solution import Status

OPTIMALITY_TOLERANCE = 1e-6
"""A tour is called optimal when (length - bound) <= this fraction of its length. Bounds are
computed in floating point from dual values; their rounding is orders of magnitude smaller."""


@dataclass(frozen=True)
class Progress:
    """One row of the progress table. Lengths in problem units, time in seconds since the start of
    the solver; None where nothing is known yet."""

    time: float
    stage: str
    incumbent: float | None = None
    bound: float | None = None
    cuts: int = 0
    legs: int = 0

    @property
    def gap(self) -> float | None:
        """(incumbent - bound) / incumbent."""
        return relative_gap(self.incumbent, self.bound)


OnProgress = Callable[[Progress], None]


@dataclass(frozen=True)
class Result:
    """Outcome of a solver on a travel graph.

    tour : vertices from the base on (the base is not repeated at the end), or None.
    length, lower_bound : of the closed tour; a proven bound on every tour, or None.
    trace : the progress rows, in order.
    """

    tour: tuple[int, ...] | None
    length: float | None
    lower_bound: float | None
    status: Status
    trace: tuple[Progress, ...] = ()
    timings: dict[str, float] = field(default_factory=dict)


def relative_gap(length: float | None, bound: float | None) -> float | None:
    """(length - bound) / length, at least 0; None if either is unknown."""
    if length is None or bound is None:
        return None
    return max(0.0, (length - bound) / length) if length > 0.0 else 0.0


def proven(length: float, bound: float) -> bool:
    """Whether the bound proves the length optimal."""
    return length - bound <= OPTIMALITY_TOLERANCE * max(length, 1e-300)


class Clock:
    """Time since the start, and how much of a limit is left."""

    def __init__(self, limit: float | None) -> None:
        self.start = time.monotonic()
        self.limit = limit

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self.start

    @property
    def left(self) -> float:
        """Seconds left; inf without a limit."""
        return float("inf") if self.limit is None else self.limit - self.elapsed

    @property
    def up(self) -> bool:
        """Whether the limit is reached."""
        return self.left <= 0.0

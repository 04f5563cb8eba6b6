"""What a solver returns, and how it reports on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from netsp.arrays import Floats
from netsp.hsignature import Word
from netsp.solution import Status

OPTIMALITY_TOLERANCE = 1e-6
"""A tour is called optimal when (length - bound) <= this fraction of its length. Bounds are
computed in floating point from dual values; their rounding is orders of magnitude smaller."""


@dataclass(frozen=True)
class Progress:
    """One row of the progress table. Lengths in problem units, time in seconds since the start of
    the solver; None where nothing is known yet.

    cuts, legs, vertices : in the program, and left after elimination. iteration : of the solver;
    each says what one is. current, entangled : of solvers that walk from
    state to state, the length of the present one and how many obstacles it entangles.
    """

    time: float
    stage: str
    incumbent: float | None = None
    bound: float | None = None
    cuts: int = 0
    legs: int = 0
    vertices: int = 0
    iteration: int = 0
    current: float | None = None
    entangled: int | None = None

    @property
    def gap(self) -> float | None:
        """(incumbent - bound) / incumbent."""
        return relative_gap(self.incumbent, self.bound)


OnProgress = Callable[[Progress], None]


@dataclass(frozen=True)
class Trajectory:
    """What a baseline blind to the tether walked: a closed path, whatever it entangles.

    order : goals (clusters) in the order visited. words : at each of them, the word of the way
    from the base. word : of the whole. path : (n, 3) closed polyline, circumscribed to arcs, and
    length : of the arcs themselves.
    """

    order: tuple[int, ...]
    words: tuple[Word, ...]
    word: Word
    path: Floats
    length: float


@dataclass(frozen=True)
class Result:
    """Outcome of a solver on a travel graph.

    tour : vertices from the base on (the base is not repeated at the end), or None.
    length, lower_bound : of the closed tour; a proven bound on every tour, or None.
    trace : the progress rows, in order.
    walk : vertices as they are walked, base to base, where that is longer than the tour because
        the solver retraces its steps; `length` is then that of the walk.
    trajectory : of a blind baseline with status `invalid`; `tour` is then None.
    """

    tour: tuple[int, ...] | None
    length: float | None
    lower_bound: float | None
    status: Status
    trace: tuple[Progress, ...] = ()
    walk: tuple[int, ...] | None = None
    trajectory: Trajectory | None = None


def relative_gap(length: float | None, bound: float | None) -> float | None:
    """(length - bound) / length, at least 0; None if either is unknown."""
    if length is None or bound is None:
        return None
    return max(0.0, (length - bound) / length) if length > 0.0 else 0.0


def proven(length: float, bound: float) -> bool:
    """Whether the bound proves the length optimal."""
    return length - bound <= OPTIMALITY_TOLERANCE * max(length, 1e-300)

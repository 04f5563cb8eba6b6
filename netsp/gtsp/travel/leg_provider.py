"""What a roadmap gives a travel graph: the lengths of legs, bounds on them, and their paths."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock


class Legs(Protocol):
    """What a roadmap gives: lengths of legs between vertices, and their paths."""

    def lengths(
        self, vertices: Ints, asked: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        """(k, k) symmetric leg lengths among the given vertices; inf within a cluster. Where
        `asked` (k, k, symmetric) is given and false, anything. LimitReachedError when the clock is
        up before many are measured."""

    def to_base(self) -> Floats:
        """(V,) lengths of the legs from the base."""

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        """(k, k) lower bounds on the leg lengths, much cheaper than the lengths; with `rows`, only
        those from so many of the vertices (positions among them)."""

    def path(self, u: int, v: int) -> Floats:
        """(n, 3) polyline of the leg from vertex u to vertex v."""


class LegsAtOnce(Legs, Protocol):
    """Legs that are quickly found all together; `at_once` says so."""

    at_once: bool

    def rounded(self, vertices: Ints, clock: Clock | None = None) -> Floats:
        """As `lengths`, in single precision and no larger."""


class LegsInBlocks(LegsAtOnce, Protocol):
    """Legs that are found some vertices at a time about as quickly as all together."""

    def blocks(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Iterator[tuple[Ints, Floats]]:
        """As `rounded`, row by row: some of the vertices (r,), as positions among them, and (r, k)
        their legs, to be used before the next are asked for. If rows are given, of these only."""

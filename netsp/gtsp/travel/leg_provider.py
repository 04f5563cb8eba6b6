"""Protocols of the legs of a travel graph: their lengths, bounds and paths."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock


class Legs(Protocol):
    """Legs between vertices."""

    def lengths(
        self, vertices: Ints, asked: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return symmetric lengths (k, k) among vertices; inf within a cluster, and anything where
        `asked` (k, k, symmetric) is false.

        Raises LimitReachedError if the clock is up before many are measured.
        """

    def to_base(self) -> Floats:
        """Return the lengths (V,) of the legs from the base."""

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return lower bounds (k, k), much cheaper than lengths; with `rows`, only those from some
        vertices (positions among them)."""

    def path(self, u: int, v: int) -> Floats:
        """Return the leg from vertex u to vertex v as a polyline (n, 3)."""


class LegsAtOnce(Legs, Protocol):
    """Legs that are found quickly all together, if `at_once`."""

    at_once: bool

    def rounded(self, vertices: Ints, clock: Clock | None = None) -> Floats:
        """Return `lengths` in single precision, rounded down."""


class LegsInBlocks(LegsAtOnce, Protocol):
    """Legs that are found block by block about as quickly as all together."""

    def blocks(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Iterator[tuple[Ints, Floats]]:
        """Yield blocks of `rounded`: positions (r,) of some vertices, and their legs (r, k).

        A block is valid until the next. With `rows`, only those rows are yielded.
        """

"""Legs of a travel graph: their costs, and their paths in space."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection
from typing import Protocol

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.base.validated import shown
from netsp.gtsp.cost_oracle import CostOracle, Estimate


class Legs(CostOracle):
    """Legs between augmented goals: costs of a travel graph that are lengths of paths.

    Attributes
    ----------
    left_out
        Legs (u, v), u < v, whose taut path was not found. Their cost is the length of the path back
        to the base and out again.
    """

    left_out: Collection[tuple[int, int]] = ()

    @abstractmethod
    def path(self, u: int, v: int) -> Floats:
        """Return the leg from vertex u to vertex v as a polyline (n, 3)."""

    def bounds_of_left_out(self) -> Floats:
        """Return lower bounds (k, 3) for each leg left out: on the tether at one end, the leg, and
        the tether at the other end."""
        return np.zeros((0, 3))


class LegProvider(Protocol):
    """Minimum that a roadmap of another package gives for the legs of its travel graph.

    It may have more of the methods of `Legs`, such as `estimate`.
    """

    def lengths(
        self, vertices: Ints, wanted: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return what `CostOracle.lengths` does."""

    def to_base(self) -> Floats:
        """Return what `CostOracle.to_base` does."""

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return what `CostOracle.lower_bounds` does."""

    def path(self, u: int, v: int) -> Floats:
        """Return what `Legs.path` does."""


class AdaptedLegs(Legs):
    """Legs of a provider that does not derive from `Legs`. What it answers is checked."""

    def __init__(self, provider: LegProvider) -> None:
        needed = ("lengths", "to_base", "lower_bounds", "path")
        missing = [m for m in needed if not callable(getattr(provider, m, None))]
        if missing:
            raise InputError(
                f"legs: {shown(provider)} has no method {missing[0]!r}; expected "
                f"{', '.join(needed)}"
            )
        self.provider = provider
        for name in ("estimate", "rounded", "blocks", "left_out", "bounds_of_left_out"):
            if hasattr(provider, name):
                setattr(self, name, getattr(provider, name))

    def estimate(self, k: int) -> Estimate:
        """Return an estimate by the flags `at_once` and `quick` that providers had before."""
        policy = self.cost_policy
        leg_s = policy.s_per_single_leg
        if getattr(self.provider, "at_once", False):
            leg_s = policy.max_s_per_leg
        elif not getattr(self.provider, "quick", True):
            leg_s = 2.0 * policy.max_single_leg_s
        return Estimate(leg_s * k * (k - 1) / 2, 8.0 * k * k)

    def lengths(
        self, vertices: Ints, wanted: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return the lengths of the provider."""
        lengths, k = self.provider.lengths(vertices, wanted, clock), len(vertices)
        if (shape := np.shape(lengths)) != (k, k):
            raise InputError(f"legs: lengths of {k} vertices: expected shape {k, k}, got {shape}")
        wrong = ~(np.asarray(lengths) >= 0.0)
        if wanted is not None:
            wrong &= wanted
        if wrong.any():
            i, j = np.argwhere(wrong)[0]
            raise InputError(
                f"legs: length from vertex {vertices[i]} to {vertices[j]} is {lengths[i, j]}; "
                "expected no negative number, inf where there is no leg"
            )
        differ = ~np.isclose(lengths, np.transpose(lengths))
        if wanted is not None:
            differ &= wanted
        if differ.any():
            i, j = np.argwhere(differ)[0]
            raise InputError(
                f"legs: length from vertex {vertices[i]} to {vertices[j]} is {lengths[i, j]:g}, "
                f"and back {lengths[j, i]:g}; expected a symmetric matrix"
            )
        return lengths

    def pairs(self, us: Ints, vs: Ints, clock: Clock | None = None) -> Floats:
        """Return the lengths of single legs."""
        pairs = getattr(self.provider, "pairs", None)
        return super().pairs(us, vs, clock) if pairs is None else np.asarray(pairs(us, vs))

    def to_base(self) -> Floats:
        """Return the lengths of the legs from the base."""
        return self.provider.to_base()

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return the bounds of the provider."""
        return self.provider.lower_bounds(vertices, rows, clock)

    def path(self, u: int, v: int) -> Floats:
        """Return the path of the provider."""
        return self.provider.path(u, v)


def as_oracle(legs: CostOracle | LegProvider) -> CostOracle:
    """Return legs as a cost oracle."""
    return legs if isinstance(legs, CostOracle) else AdaptedLegs(legs)

"""Cost oracles: providers of the costs of legs, with an estimate of what measuring them takes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.gtsp.gtsp_policy import CostPolicy
from netsp.gtsp.travel.costs import rounded_down


class Estimate(NamedTuple):
    """Estimated time and memory of a computation.

    Attributes
    ----------
    seconds
        CPU time, s.
    bytes
        Memory, bytes.
    """

    seconds: float
    bytes: float


class CostOracle(ABC):
    """Costs of the legs between vertices, measured when they are asked for.

    A subclass gives `lengths`, `to_base` and `lower_bounds`. It may replace the other methods by
    quicker ones.

    Attributes
    ----------
    cost_policy
        How costs are measured, and how long that takes.

    Examples
    --------
    >>> class OnALine(CostOracle):
    ...     places = np.array([0.0, 2.0, 5.0])
    ...     def lengths(self, vertices, wanted=None, clock=None):
    ...         costs = np.abs(np.subtract.outer(self.places[vertices], self.places[vertices]))
    ...         np.fill_diagonal(costs, np.inf)
    ...         return costs
    ...     def to_base(self):
    ...         return self.lengths(np.arange(3))[0]
    ...     def lower_bounds(self, vertices, rows=None, clock=None):
    ...         costs = self.lengths(vertices)
    ...         return costs if rows is None else costs[rows]
    >>> from netsp import solve_graph
    >>> from netsp.gtsp.instance import Instance
    >>> solve_graph(Instance([0, 1, 2], OnALine())).length
    10.0
    """

    cost_policy = CostPolicy()

    @abstractmethod
    def lengths(
        self, vertices: Ints, wanted: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return symmetric costs (k, k) among vertices; inf within a cluster, and anything where
        `wanted` (k, k, symmetric) is false.

        Raises LimitReachedError if the clock is up before many are measured.
        """

    @abstractmethod
    def to_base(self) -> Floats:
        """Return the costs (V,) of the legs from the base."""

    @abstractmethod
    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return lower bounds (k, k) on the costs, which take far less time than the costs; with
        `rows`, only bounds from some vertices (positions among them)."""

    def estimate(self, k: int) -> Estimate:
        """Return the estimate for measuring all legs among k vertices: here, one by one."""
        return Estimate(self.cost_policy.s_per_single_leg * k * (k - 1) / 2, 8.0 * k * k)

    def pairs(self, us: Ints, vs: Ints, clock: Clock | None = None) -> Floats:
        """Return the costs (k,) of single legs between vertices of different clusters."""
        chosen, at = np.unique(np.concatenate([us, vs]), return_inverse=True)
        i, j = at[: len(us)], at[len(us) :]
        wanted = np.zeros((len(chosen), len(chosen)), dtype=bool)
        wanted[i, j] = wanted[j, i] = True
        return np.asarray(self.lengths(chosen, wanted, clock)[i, j])

    def rounded(self, vertices: Ints, clock: Clock | None = None) -> Floats:
        """Return the costs (k, k) among vertices in single precision, rounded down."""
        return rounded_down(self.lengths(vertices, None, clock))

    def blocks(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Iterator[tuple[Ints, Floats]]:
        """Yield blocks of `rounded`: positions (r,) of some vertices, and their legs (r, k).

        A block is valid until the next. With `rows`, only those rows are yielded.
        """
        costs = self.rounded(vertices, clock)
        positions = np.arange(len(vertices)) if rows is None else rows
        yield positions, costs[positions]


class MatrixCosts(CostOracle):
    """Costs given as a matrix."""

    def __init__(self, costs: Floats, cluster: Ints, policy: CostPolicy = CostPolicy()) -> None:
        self.costs, self.cluster, self.cost_policy = costs, cluster, policy

    def estimate(self, k: int) -> Estimate:
        """Return the estimate for copying the costs among k vertices."""
        return Estimate(self.cost_policy.s_per_copied_leg * k * k, 8.0 * k * k)

    def lengths(
        self, vertices: Ints, wanted: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return the costs (k, k) among vertices."""
        return self.costs[np.ix_(vertices, vertices)]

    def rounded(self, vertices: Ints, clock: Clock | None = None) -> Floats:
        """Return the costs (k, k) among vertices in single precision, rounded down."""
        out = np.empty((len(vertices), len(vertices)), dtype=np.float32)
        block = self.cost_policy.block_rows
        for k in range(0, len(vertices), block):
            rows = slice(k, k + block)
            out[rows] = rounded_down(self.costs[np.ix_(vertices[rows], vertices)])
        return out  # type: ignore[return-value]

    def to_base(self) -> Floats:
        """Return the costs (V,) of the legs from the base."""
        return np.asarray(self.costs[0])

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return the costs, which are known, as bounds on themselves."""
        return self.lengths(vertices) if rows is None else self.lengths(vertices)[rows]

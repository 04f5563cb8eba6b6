"""Mixed-integer program of the paper, in the form that all backends share.

For a travel graph with clusters C_0 = {base}, C_1 … C_m, binaries x_v (vertex v is visited) and
y_uv (leg u-v is travelled; legs are undirected, so one variable serves both directions):

    (2)  sum of x_v over a cluster            = 1          for every cluster
    (3)  sum of y over the legs at v - 2 x_v  = 0          for every vertex
    (4)  y(E(S)) - x(S \\ C)                  <= 0         for cuts (S, C), base not in S

McCammon & Hollinger 2017 write (3) as a product y·x summed over a goal; the linear form per vertex
says the same and also ties the class of the incoming leg to that of the outgoing one. Their (4) is
a misprinted subtour cut (its left side lacks the restriction to S); ours is the generalised subtour
elimination constraint y(δ(S)) >= 2 x(S ∩ C), rewritten with (3): if the vertex that serves C lies
in S, the tour must enter and leave S. (Fischetti, Salazar & Toth 1995, here aggregated over S ∩ C.)
It is strongest where S holds all of C: then x(S \\ C) is the same, and no y(E(S)) is smaller.

The relaxation does without x: by (3) x_v is half the legs at v, so (2) reads y over the legs at a
cluster = 2, and (4), times -2, y(δ(S)) - y(δ(S ∩ C)) >= 0 with legs counted at the vertices of
S ∩ C. That leaves one row per cluster where there was one per vertex.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import TimeLimit
from netsp.mip.cutpool import CutPool
from netsp.mip.cuts import Cut


def scale_of(costs: Floats) -> float:
    """Return a power of two that scales the largest cost to between 512 and 1024.

    The absolute tolerances of solvers suit such costs, and scaling by it is exact.
    """
    largest = float(np.max(np.abs(costs), initial=0.0))
    return 2.0 ** (10 - math.frexp(largest)[1]) if largest > 0.0 else 1.0


@dataclass(frozen=True)
class Duals:
    """Dual values.

    Attributes
    ----------
    cluster
        (m + 1,) λ of (2).
    degree
        (V,) π of (3).
    cut
        (cuts,) μ <= 0 of (4).
    constant
        Σ μ_k rhs_k.
    """

    cluster: Floats
    degree: Floats
    cut: Floats
    constant: float = 0.0


def restricted(
    cluster: Ints, legs: Ints, cuts: Sequence[Cut], keep: Bools
) -> tuple[Ints, Ints, list[Cut]]:
    """Return clusters, legs and cuts renumbered for the vertices of a mask."""
    number = np.cumsum(keep) - 1
    return cluster[keep], number[legs], [replace(c, inside=c.inside[keep]) for c in cuts]


def duals_of_relaxation(
    by_cluster: Floats, by_cut: Floats, cuts: Sequence[Cut], cluster: Ints
) -> Duals:
    """Return duals of (2)-(4) from those of the relaxation without x.

    They are λ = 2 by_cluster, μ = -2 by_cut, and π_v = by_cluster + by_cut for v in S \\ C, so that
    the reduced cost of every vertex is 0.
    """
    prices = np.maximum(by_cut, 0.0)
    degree = by_cluster[cluster].copy()
    for cut, price in zip(cuts, prices, strict=True):
        if price > 0.0:
            degree[cut.inside & (cluster != cut.cluster)] += price
    mu = -2.0 * prices
    constant = sum(m * c.rhs for m, c in zip(mu.tolist(), cuts, strict=True) if c.teeth)
    return Duals(2.0 * by_cluster, degree, mu, constant)


@dataclass(frozen=True)
class Point:
    """Solution of an LP or an integer program.

    Attributes
    ----------
    x
        (V,) value of each vertex.
    legs, y
        (k, 2) legs of the program, and (k,) their values.
    objective
        Value of the objective, in the units of costs.
    duals, slack
        Dual values, and the slack of each cut, of an LP; None of an integer program.
    """

    x: Floats
    legs: Ints
    y: Floats
    objective: float
    duals: Duals | None
    slack: Floats | None = None


@dataclass(frozen=True)
class IntegerOutcome:
    """Outcome of a run of an integer program.

    Attributes
    ----------
    point
        Best integer solution, which may have subtours; None if none was found.
    bound
        Lower bound on all solutions of the program, or None.
    finished
        Whether the program was solved to the end.
    infeasible
        Whether it has no solution.
    """

    point: Point | None
    bound: float | None
    finished: bool
    infeasible: bool = False


class Relaxation(Protocol):
    """Linear relaxation over a changing set of legs and cuts.

    Attributes
    ----------
    legs
        (k, 2) legs u < v in the program.
    pool
        Cuts in the program.
    infeasible
        Whether the last solve found that there is no solution.
    """

    legs: Ints
    pool: CutPool
    infeasible: bool

    @property
    def cuts(self) -> list[Cut]:
        """Cuts in the program."""

    def add_legs(self, legs: Ints, costs: Floats) -> None:
        """Add legs (k, 2) to the program."""

    def keep_legs(self, keep: Bools) -> None:
        """Remove all legs but those marked."""

    def restrict(self, keep: Bools) -> None:
        """Renumber legs and cuts for the vertices of a mask, which hold the ends of all legs."""

    def set_costs(self, costs: Floats) -> None:
        """Set the costs of all legs in the program."""

    def add_cuts(self, cuts: list[Cut], *, permanent: bool = False) -> None:
        """Add cuts to the program; cuts added for good never count as idle."""

    def keep_cuts(self, keep: Bools) -> None:
        """Remove the cuts that are neither marked nor needed by the basis."""

    def solve(self, limit: TimeLimit) -> Point | None:
        """Return the optimum with duals; None if there is none or the time is up."""


class WarmRelaxation(Relaxation, Protocol):
    """Relaxation that re-solves from its last basis, as branch and cut needs it."""

    def set_alive(self, alive: Bools) -> None:
        """Fix all legs at 0 but those marked."""

    def rays(self) -> list[Duals]:
        """Return dual rays that may prove that the last solve had no solution."""

    def probe(self, costs: Floats, alive: Bools, steps: int) -> float:
        """Return the objective after some simplex steps with other costs and legs."""


class IntegerProgram(Protocol):
    """Integer program over fixed legs and a growing set of cuts."""

    legs: Ints
    cuts: list[Cut]

    def add_cuts(self, cuts: list[Cut]) -> None:
        """Add cuts to the program."""

    def solve(self, limit: TimeLimit) -> IntegerOutcome:
        """Return the best integer solution found in time."""

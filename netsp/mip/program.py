"""The mixed-integer program of the paper, as its backends share it.

For a travel graph with clusters C_0 = {base}, C_1 … C_m, binaries x_v (vertex v is visited) and
y_uv (leg u-v is travelled; legs are undirected, so one variable serves both directions):

    (2)  sum of x_v over a cluster            = 1          for every cluster
    (3)  sum of y over the legs at v - 2 x_v  = 0          for every vertex
    (4)  y(E(S)) - x(S \\ C)                  <= 0         for cuts (S, C), base not in S

McCammon & Hollinger 2017 write (3) as a product y·x summed over a goal; the linear form per vertex
says the same and also ties the class of the incoming leg to that of the outgoing one. Their (4) is
a printer's subtour cut (its left side lacks the restriction to S); ours is the generalised subtour
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
    """A power of two that brings costs to some hundreds, where solvers' absolute tolerances mean
    what they should; multiplying by it is exact."""
    largest = float(np.max(np.abs(costs), initial=0.0))
    return 2.0 ** (10 - math.frexp(largest)[1]) if largest > 0.0 else 1.0


@dataclass(frozen=True)
class Duals:
    """Dual values: λ of (2) by cluster, π of (3) by vertex, μ <= 0 of (4) by cut; constant : what
    the rooms of cuts with teeth come to, Σ μ_k room_k."""

    cluster: Floats
    degree: Floats
    cut: Floats
    constant: float = 0.0


def restricted(
    cluster: Ints, legs: Ints, cuts: Sequence[Cut], keep: Bools
) -> tuple[Ints, Ints, list[Cut]]:
    """Cluster, legs and cuts renumbered for the vertices marked."""
    number = np.cumsum(keep) - 1
    return cluster[keep], number[legs], [replace(c, inside=c.inside[keep]) for c in cuts]


def duals_of_relaxation(
    by_cluster: Floats, by_cut: Floats, cuts: Sequence[Cut], cluster: Ints
) -> Duals:
    """Duals of (2)-(4) from those of the relaxation without x, so that no vertex has a reduced
    cost of its own: λ = 2 by_cluster, μ = -2 by_cut, π_v = by_cluster + by_cut where v is in
    S \\ C."""
    prices = np.maximum(by_cut, 0.0)
    degree = by_cluster[cluster].copy()
    for cut, price in zip(cuts, prices, strict=True):
        if price > 0.0:
            degree[cut.inside & (cluster != cut.cluster)] += price
    mu = -2.0 * prices
    rooms = sum(m * c.room for m, c in zip(mu.tolist(), cuts, strict=True) if c.teeth)
    return Duals(2.0 * by_cluster, degree, mu, rooms)


@dataclass(frozen=True)
class Point:
    """An LP or integer solution: x by vertex, y by leg (k, 2); duals and slacks by cut of an LP."""

    x: Floats
    legs: Ints
    y: Floats
    objective: float
    duals: Duals | None
    slack: Floats | None = None


@dataclass(frozen=True)
class IntegerOutcome:
    """What an integer run gave.

    Attributes
    ----------
    point
        The best integer solution of the program, or None (it may hold subtours).
    bound
        A bound on every solution of the program, or None.
    finished
        Whether the program was solved to the end.
    infeasible
        It has no solution.
    """

    point: Point | None
    bound: float | None
    finished: bool
    infeasible: bool = False


class Relaxation(Protocol):
    """The linear relaxation over a changing set of legs and cuts.

    Attributes
    ----------
    legs
        (k, 2) legs u < v in the program.
    pool
        Its cuts.
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
        """Bring legs (k, 2) into the program."""

    def keep_legs(self, keep: Bools) -> None:
        """Take all legs out of the program but those marked."""

    def restrict(self, keep: Bools) -> None:
        """Renumber legs and cuts for the vertices marked; no other has a leg in the program."""

    def set_costs(self, costs: Floats) -> None:
        """Set the costs of all legs in the program."""

    def add_cuts(self, cuts: list[Cut], *, for_good: bool = False) -> None:
        """Bring cuts into the program; those that are there for good are never idle."""

    def keep_cuts(self, keep: Bools) -> None:
        """Take the cuts out of the program but those marked, and those that its basis rests on."""

    def solve(self, limit: TimeLimit) -> Point | None:
        """The optimum with duals; None if there is none or the time ran out."""


class WarmRelaxation(Relaxation, Protocol):
    """A relaxation that starts from its last basis, so that a tree can be searched with it."""

    def set_alive(self, alive: Bools) -> None:
        """Let only the legs marked be used."""

    def rays(self) -> list[Duals]:
        """Dual values that say why the last solve found no solution; all that there may be."""

    def probe(self, costs: Floats, alive: Bools, steps: int) -> float:
        """The objective after so many simplex steps with other costs and legs."""


class IntegerProgram(Protocol):
    """The integer program over fixed legs and a growing set of cuts."""

    legs: Ints
    cuts: list[Cut]

    def add_cuts(self, cuts: list[Cut]) -> None:
        """Bring cuts into the program."""

    def solve(self, limit: TimeLimit) -> IntegerOutcome:
        """The best integer solution, as far as the time goes."""

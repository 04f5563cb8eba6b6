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
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Cut:
    """The cut y(E(S)) <= x(S \\ C): `inside` marks S, `cluster` is C."""

    inside: Bools
    cluster: int


@dataclass(frozen=True)
class Duals:
    """Dual values: λ of (2) by cluster, π of (3) by vertex, μ <= 0 of (4) by cut."""

    cluster: Floats
    degree: Floats
    cut: Floats


@dataclass(frozen=True)
class Point:
    """An LP or integer solution: x by vertex, y by leg (k, 2); duals of an LP."""

    x: Floats
    legs: Ints
    y: Floats
    objective: float
    duals: Duals | None


@dataclass(frozen=True)
class IntegerOutcome:
    """What an integer run gave.

    point : the best integer solution of the program, or None (it may hold subtours).
    bound : a bound on every solution of the program, or None.
    finished : whether the program was solved to the end. infeasible : it has no solution.
    """

    point: Point | None
    bound: float | None
    finished: bool
    infeasible: bool = False


class Program(Protocol):
    """A backend: the program over a growing set of legs and cuts.

    legs : (k, 2) legs u < v in the program. cuts : cuts in the program. infeasible : whether the
    last relaxation was found to have no solution.
    """

    legs: Ints
    cuts: list[Cut]
    infeasible: bool

    def add_legs(self, legs: Ints) -> None:
        """Bring legs (k, 2) into the program, with their coefficients in every row."""

    def add_cuts(self, cuts: list[Cut]) -> None:
        """Bring cuts into the program."""

    def keep_cuts(self, keep: Bools) -> None:
        """Take all cuts out of the program but those marked."""

    def solve_relaxation(self, time_left: float) -> Point | None:
        """The LP relaxation's optimum with duals; None if the time ran out."""

    def solve_integer(self, time_left: float) -> IntegerOutcome:
        """The best integer solution, as far as the time goes."""

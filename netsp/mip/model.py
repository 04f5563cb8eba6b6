"""The paper's model in PuLP, grown by rows and columns as it is solved.

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

import numpy as np
import numpy.typing as npt
import pulp

from netsp.mip.cbc import CbcOutcome, run_cbc

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


class Model:
    """The program over a growing set of legs and cuts.

    legs : (k, 2) active legs u < v. cuts : active cuts.
    """

    def __init__(self, cluster: Ints, costs: Floats, legs: Ints, vertices: Ints) -> None:
        self.cluster, self.costs = cluster, costs
        self.clusters = int(cluster.max()) + 1
        self.vertices = vertices
        self.legs: Ints = np.zeros((0, 2), dtype=np.int64)
        self.cuts: list[Cut] = []
        self.problem = pulp.LpProblem("netsp", pulp.LpMinimize)
        self.problem.setObjective(pulp.LpAffineExpression())
        self._x = {int(v): pulp.LpVariable(f"x_{v}", 0, 1, pulp.LpInteger) for v in vertices}
        self._y: list[pulp.LpVariable] = []
        for c in range(self.clusters):
            members = [(self._x[int(v)], 1.0) for v in vertices[cluster[vertices] == c]]
            self._row(members, pulp.LpConstraintEQ, 1.0, f"serve_{c}")
        self._degree = {
            v: self._row([(x, -2.0)], pulp.LpConstraintEQ, 0.0, f"degree_{v}")
            for v, x in self._x.items()
        }
        self._cut_rows: list[pulp.LpConstraint] = []
        self.add_legs(legs)

    def _row(
        self, terms: list[tuple[pulp.LpVariable, float]], sense: int, rhs: float, name: str
    ) -> pulp.LpConstraint:
        row = pulp.LpConstraint(pulp.LpAffineExpression(terms), sense=sense, name=name, rhs=rhs)
        self.problem.addConstraint(row)
        return row

    def add_legs(self, legs: Ints) -> None:
        """Bring legs (k, 2) into the program, with their coefficients in every row."""
        if len(legs) == 0:
            return
        inside = np.array([c.inside for c in self.cuts], dtype=bool).reshape(
            len(self.cuts), len(self.cluster)
        )
        both = inside[:, legs[:, 0]] & inside[:, legs[:, 1]]
        for k, (u, v) in enumerate(legs.tolist()):
            y = pulp.LpVariable(f"y_{u}_{v}", 0, 1, pulp.LpInteger)
            self._y.append(y)
            self.problem.objective[y] = float(self.costs[u, v])
            self.problem.addVariable(y)
            self._degree[u].addInPlace(y)
            self._degree[v].addInPlace(y)
            for row in np.flatnonzero(both[:, k]):
                self._cut_rows[row].addInPlace(y)
        self.legs = np.vstack([self.legs, legs])

    def add_cuts(self, cuts: list[Cut]) -> None:
        """Bring cuts into the program."""
        for cut in cuts:
            terms = [
                (x, -1.0)
                for v, x in self._x.items()
                if cut.inside[v] and self.cluster[v] != cut.cluster
            ]
            within = cut.inside[self.legs[:, 0]] & cut.inside[self.legs[:, 1]]
            terms += [(self._y[k], 1.0) for k in np.flatnonzero(within)]
            name = f"cut_{len(self.cuts)}"
            self._cut_rows.append(self._row(terms, pulp.LpConstraintLE, 0.0, name))
            self.cuts.append(cut)

    def solve_relaxation(self, time_left: float) -> Point | None:
        """The LP relaxation's optimum with duals; None if the time ran out."""
        outcome = run_cbc(self.problem, integer=False, time_left=time_left)
        if outcome.status != "optimal":
            return None
        return self._point(outcome, duals=True)

    def solve_integer(self, time_left: float) -> tuple[Point | None, CbcOutcome]:
        """CBC's best integer solution, if any, and what it says of bound and status."""
        outcome = run_cbc(self.problem, integer=True, time_left=time_left)
        return (self._point(outcome, duals=False) if outcome.values else None), outcome

    def _point(self, outcome: CbcOutcome, *, duals: bool) -> Point:
        x = np.zeros(len(self.cluster))
        for v in self._x:
            x[v] = outcome.values.get(f"x_{v}", 0.0)
        y = np.array([outcome.values.get(f"y_{u}_{v}", 0.0) for u, v in self.legs.tolist()])
        prices = None
        if duals:
            get = outcome.duals.get
            degree = np.zeros(len(self.cluster))
            for v in self._x:
                degree[v] = get(f"degree_{v}", 0.0)
            prices = Duals(
                np.array([get(f"serve_{c}", 0.0) for c in range(self.clusters)]),
                degree,
                np.minimum([get(f"cut_{k}", 0.0) for k in range(len(self.cuts))], 0.0),
            )
        return Point(x, self.legs, y, float(outcome.objective or 0.0), prices)

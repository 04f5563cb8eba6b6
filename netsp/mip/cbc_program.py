"""The program as a PuLP model solved by CBC: the paper's shape, complete on its own."""

from __future__ import annotations

import numpy as np
import pulp

from netsp.mip.cbc import CbcOutcome, run_cbc
from netsp.mip.program import Bools, Cut, Duals, Floats, IntegerOutcome, Ints, Point


class CbcProgram:
    """`netsp.mip.program.Program` by PuLP and CBC, one process a solve."""

    def __init__(self, cluster: Ints, costs: Floats, legs: Ints, vertices: Ints) -> None:
        self.cluster, self.costs = cluster, costs
        self.clusters = int(cluster.max()) + 1
        self.vertices = vertices
        self.legs: Ints = np.zeros((0, 2), dtype=np.int64)
        self.cuts: list[Cut] = []
        self.infeasible = False
        self._cuts_made = 0
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
            name = f"cut_{self._cuts_made}"
            self._cuts_made += 1
            self._cut_rows.append(self._row(terms, pulp.LpConstraintLE, 0.0, name))
            self.cuts.append(cut)

    def keep_cuts(self, keep: Bools) -> None:
        """Take all cuts out of the program but those marked."""
        for row, kept in zip(self._cut_rows, keep, strict=True):
            if not kept:
                del self.problem.constraints[row.name]
        self._cut_rows = [r for r, k in zip(self._cut_rows, keep, strict=True) if k]
        self.cuts = [c for c, k in zip(self.cuts, keep, strict=True) if k]

    def solve_relaxation(self, time_left: float) -> Point | None:
        """The LP relaxation's optimum with duals; None if the time ran out."""
        outcome = run_cbc(self.problem, integer=False, time_left=time_left)
        self.infeasible = outcome.status == "infeasible"
        if outcome.status != "optimal":
            return None
        return self._point(outcome, duals=True)

    def solve_integer(self, time_left: float) -> IntegerOutcome:
        """The best integer solution, as far as the time goes."""
        outcome = run_cbc(self.problem, integer=True, time_left=time_left)
        point = self._point(outcome, duals=False) if outcome.values else None
        finished = outcome.status == "optimal"
        return IntegerOutcome(
            point,
            outcome.objective if finished else outcome.bound,
            finished,
            infeasible=outcome.status == "infeasible",
        )

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
                np.minimum([get(row.name, 0.0) for row in self._cut_rows], 0.0),
            )
        return Point(x, self.legs, y, float(outcome.objective or 0.0), prices)

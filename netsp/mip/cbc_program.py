"""Relaxation and integer program as PuLP models that CBC solves, as in the paper."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pulp

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import TimeLimit
from netsp.mip.cbc import run_cbc
from netsp.mip.cutpool import CutPool
from netsp.mip.cuts import Cut, cut_coefficients
from netsp.mip.mip_policy import LpPolicy, MipPolicy
from netsp.mip.program import IntegerOutcome, Point, duals_of_relaxation, restricted, scale_of


def _row(
    problem: pulp.LpProblem,
    terms: list[tuple[pulp.LpVariable, float]],
    sense: int,
    rhs: float,
    name: str,
) -> pulp.LpConstraint:
    row = pulp.LpConstraint(pulp.LpAffineExpression(terms), sense=sense, name=name, rhs=rhs)
    problem.addConstraint(row)
    return row


class CbcRelaxation:
    """`netsp.mip.program.Relaxation` by CBC, with one process for each solve.

    The model is written from scratch each time, which takes little beside starting the process.
    """

    def __init__(
        self, cluster: Ints, legs: Ints, costs: Floats, policy: MipPolicy = MipPolicy()
    ) -> None:
        self.policy = policy.lp
        self.cluster = cluster
        self.clusters = int(cluster.max()) + 1
        self.legs: Ints = np.zeros((0, 2), dtype=np.int64)
        self.costs: Floats = np.zeros(0)
        self.pool = CutPool(policy.cuts)
        self.infeasible = False
        self.add_legs(legs, costs)

    @property
    def cuts(self) -> list[Cut]:
        """Cuts in the order of their rows."""
        return self.pool.cuts

    def add_legs(self, legs: Ints, costs: Floats) -> None:
        """Add legs (k, 2) to the program."""
        self.legs = np.vstack([self.legs, legs])
        self.costs = np.concatenate([self.costs, costs])

    def keep_legs(self, keep: Bools) -> None:
        """Remove all legs but those marked."""
        self.legs, self.costs = self.legs[keep], self.costs[keep]

    def restrict(self, keep: Bools) -> None:
        """Renumber legs and cuts for the vertices of a mask, which hold the ends of all legs."""
        self.cluster, self.legs, cuts = restricted(self.cluster, self.legs, self.cuts, keep)
        self.pool.replace(cuts)

    def set_costs(self, costs: Floats) -> None:
        """Set the costs of all legs in the program."""
        self.costs = np.array(costs)

    def add_cuts(self, cuts: list[Cut], *, permanent: bool = False) -> None:
        """Add cuts to the program."""
        self.pool.add(cuts, permanent=permanent)

    def keep_cuts(self, keep: Bools) -> None:
        """Remove all cuts but those marked."""
        self.pool.keep(keep)

    def solve(self, limit: TimeLimit) -> Point | None:
        """Return the optimum with duals; None if there is none or the time is up."""
        problem = pulp.LpProblem("netsp", pulp.LpMinimize)
        y = [pulp.LpVariable(f"y_{u}_{v}", 0, 1) for u, v in self.legs.tolist()]
        scale = scale_of(self.costs)
        scaled = (self.costs * scale).tolist()
        problem.setObjective(pulp.LpAffineExpression(list(zip(y, scaled, strict=True))))
        at: list[list[tuple[pulp.LpVariable, float]]] = [[] for _ in range(self.clusters)]
        for var, (u, v) in zip(y, self.legs.tolist(), strict=True):
            at[self.cluster[u]].append((var, 1.0))
            at[self.cluster[v]].append((var, 1.0))
        for c, terms in enumerate(at):
            _row(problem, terms, pulp.LpConstraintEQ, 2.0, f"serve_{c}")
        block = cut_coefficients(self.cuts, self.cluster, self.legs)
        for k, values in enumerate(block):
            terms = [(y[e], float(values[e])) for e in np.flatnonzero(values)]
            _row(problem, terms, pulp.LpConstraintGE, -2.0 * self.cuts[k].rhs, f"cut_{k}")
        outcome = run_cbc(problem, integer=False, limit=limit, policy=self.policy)
        self.infeasible = outcome.status == "infeasible"
        if outcome.status != "optimal":
            return None
        value = np.array([outcome.values.get(var.name, 0.0) for var in y])
        x = np.zeros(len(self.cluster))
        np.add.at(x, self.legs.ravel(), np.repeat(value / 2.0, 2))
        get = outcome.duals.get
        duals = duals_of_relaxation(
            np.array([get(f"serve_{c}", 0.0) for c in range(self.clusters)]) / scale,
            np.array([get(f"cut_{k}", 0.0) for k in range(len(self.cuts))]) / scale,
            self.cuts,
            self.cluster,
        )
        slack = block @ value + np.array([2.0 * c.rhs for c in self.cuts])
        return Point(x, self.legs, value, (outcome.objective or 0.0) / scale, duals, slack)


class CbcInteger:
    """`netsp.mip.program.IntegerProgram` by PuLP and CBC."""

    def __init__(
        self,
        cluster: Ints,
        vertices: Ints,
        legs: Ints,
        costs: Floats,
        cuts: Sequence[Cut],
        policy: LpPolicy = LpPolicy(),
    ) -> None:
        self.policy = policy
        self.cluster, self.legs = cluster, legs
        self.cuts: list[Cut] = []
        self._forbidden = 0
        self.problem = pulp.LpProblem("netsp", pulp.LpMinimize)
        self._x = {int(v): pulp.LpVariable(f"x_{v}", 0, 1, pulp.LpInteger) for v in vertices}
        self._y = [pulp.LpVariable(f"y_{u}_{v}", 0, 1, pulp.LpInteger) for u, v in legs.tolist()]
        self._scale = scale_of(costs)
        scaled = (costs * self._scale).tolist()
        self.problem.setObjective(pulp.LpAffineExpression(list(zip(self._y, scaled, strict=True))))
        for c in range(int(cluster.max()) + 1):
            members = [(self._x[int(v)], 1.0) for v in vertices[cluster[vertices] == c]]
            _row(self.problem, members, pulp.LpConstraintEQ, 1.0, f"serve_{c}")
        at: dict[int, list[tuple[pulp.LpVariable, float]]] = {
            v: [(x, -2.0)] for v, x in self._x.items()
        }
        for var, (u, v) in zip(self._y, legs.tolist(), strict=True):
            at[u].append((var, 1.0))
            at[v].append((var, 1.0))
        for v, terms in at.items():
            _row(self.problem, terms, pulp.LpConstraintEQ, 0.0, f"degree_{v}")
        self.add_cuts(list(cuts))

    def add_cuts(self, cuts: list[Cut]) -> None:
        """Add cuts to the program."""
        for cut in cuts:
            terms = [
                (x, -1.0)
                for v, x in self._x.items()
                if cut.inside[v] and self.cluster[v] != cut.cluster
            ]
            columns, coefficients = cut.left_side(self.cluster, self.legs)
            terms += [(self._y[k], float(c)) for k, c in zip(columns, coefficients, strict=True)]
            if terms:
                name = f"cut_{len(self.cuts)}"
                _row(self.problem, terms, pulp.LpConstraintLE, cut.rhs, name)
            self.cuts.append(cut)

    def forbid_subtour(self, members: Ints, visits: int) -> None:
        """Allow one leg fewer than visits within a set of vertices."""
        inside = np.zeros(len(self.cluster), dtype=bool)
        inside[members] = True
        within = np.flatnonzero(inside[self.legs].all(axis=1))
        terms = [(self._y[k], 1.0) for k in within]
        name = f"subtour_{self._forbidden}"
        _row(self.problem, terms, pulp.LpConstraintLE, visits - 1.0, name)
        self._forbidden += 1

    def solve(self, limit: TimeLimit) -> IntegerOutcome:
        """Return the best integer solution found in time."""
        outcome = run_cbc(self.problem, integer=True, limit=limit, policy=self.policy)
        point = None
        if outcome.values:
            x = np.zeros(len(self.cluster))
            for v in self._x:
                x[v] = outcome.values.get(f"x_{v}", 0.0)
            y = np.array([outcome.values.get(var.name, 0.0) for var in self._y])
            point = Point(x, self.legs, y, (outcome.objective or 0.0) / self._scale, None)
        finished = outcome.status == "optimal"
        bound = outcome.objective if finished else outcome.bound
        return IntegerOutcome(
            point,
            None if bound is None else bound / self._scale,
            finished,
            infeasible=outcome.status == "infeasible",
        )

"""`mip-2017`: the program of McCammon & Hollinger 2017, section IV-B, as published, for comparison.

The solver states equations (2) to (4) over all vertices and all legs as an integer program. CBC
solves it; the paper used Gurobi. There is no warm start, no cut at fractional points and no
elimination of legs: subtours are separated at integer points only. CBC accepts no cuts during a
run, so each integer program is solved to its end, cut at its subtours, and solved again.

Two constraints of the paper are read as follows:

- (3) multiplies y by x and sums over a goal. Its text asks for degree 2 at a vertex that is visited
  and 0 at any other, with one class for the legs in and out: Σ y over the legs at v = 2 x_v.
- (4) bounds a sum over all legs by |S ∩ T_Aug|, without restricting it to S, and a subtour has as
  many legs as vertices, so nothing would be cut. The constraint is to "disallow" the solution
  found, so T_Aug is that solution, the legs are those within S, and the right side is one less. Its
  sums run over all classes of two goals, so S holds all classes of the goals of a subtour:
  Σ y within S <= (goals of S) - 1 (`Params.cuts` "goals"). If S holds only the vertices of the
  subtour, the constraint disallows that one subtour and not the same in neighbouring classes:
  Σ y within S <= |S| - 1 ("vertices"), which takes more rounds.

Limits of the method: only the last round gives a tour, so a run that is stopped earlier has a bound
and no tour; with Gurobi, a callback could return one earlier. The bound is the optimum, or CBC's
bound, of a program that allows some subtours. It relies on CBC's floating-point arithmetic.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.errors import InputError
from netsp.base.ram import check_available
from netsp.gtsp.instance import Instance
from netsp.gtsp.limits import Limits
from netsp.gtsp.solver_run import RunStopped, SolverRun
from netsp.gtsp.travel.result import Result
from netsp.mip.cbc_program import CbcInteger
from netsp.mip.subtours import cycles_of

CUTS = ("goals", "vertices")
"""Kinds of constraints that forbid a subtour."""


@dataclass(frozen=True)
class Params:
    """Options of the solver.

    Attributes
    ----------
    cuts
        Constraint that forbids a subtour: ``goals``, over all classes of its goals, or
        ``vertices``, over the vertices of the subtour.
    max_legs
        Largest number of legs in the program, at least 1.
    bytes_per_leg
        Estimated memory of a leg in the program, bytes, at least 1: PuLP's variable, its terms in
        the objective and in two degree rows, and its share of the file for CBC.
    """

    cuts: str = "goals"
    max_legs: int = 50_000
    bytes_per_leg: int = 4000

    def __post_init__(self) -> None:
        if self.cuts not in CUTS:
            raise ValueError(f"option 'cuts': expected {' or '.join(CUTS)}, got {self.cuts!r}")
        if self.max_legs < 1:
            raise ValueError(f"option 'max_legs': expected 1 or more, got {self.max_legs}")
        if self.bytes_per_leg < 1:
            raise ValueError(
                f"option 'bytes_per_leg': expected 1 or more, got {self.bytes_per_leg}"
            )


def solve(graph: Instance, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Solve the published program, cut its subtours, and solve it again (`mip-2017`).

    A warm start is ignored, so that the baseline shows what the method does alone. An iteration is
    one solved integer program. Source: McCammon & Hollinger 2017, section IV-B.

    Returns
    -------
    Result
        The optimal tour; only a bound if a limit is reached first.

    Raises
    ------
    InputError
        The program would have more legs than `Params.max_legs`.
    """
    chosen, limits = params or Params(), limits or Limits()
    run = SolverRun(graph, limits)
    # blind: do not substitute a heuristic tour if the run stops before its first tour
    with run.until_stopped(blind=True):
        if not run.solve_if_trivial():
            legs, costs = _all_legs(graph, chosen)
            run.check()
            _lazy_rounds(run, legs, costs, chosen)
    return run.finish("proven" if run.is_done else "open")


def _all_legs(graph: Instance, params: Params) -> tuple[Ints, Floats]:
    """Return all legs (k, 2) between vertices of different goals, and their costs."""
    sizes = np.bincount(graph.cluster).astype(float)
    count = (sizes.sum() ** 2 - (sizes**2).sum()) / 2.0
    if count > params.max_legs:
        raise InputError(
            f"solver 'mip-2017': the program has {count:.0f} legs; expected at most "
            f"{params.max_legs} (option max_legs): choose fewer goals, a shorter tether or solver "
            "mip"
        )
    check_available(
        params.bytes_per_leg * count, f"a program of {count:.0f} legs", "choose solver mip"
    )
    finite = np.triu(np.isfinite(graph.costs), 1)
    legs = np.argwhere(finite & (graph.cluster[:, None] != graph.cluster[None, :]))
    return legs.astype(np.int64), graph.costs[legs[:, 0], legs[:, 1]]


def _lazy_rounds(run: SolverRun, legs: Ints, costs: Floats, params: Params) -> None:
    """Solve and cut until the integer optimum is one tour."""
    graph = run.graph
    model = CbcInteger(graph.cluster, np.arange(len(graph)), legs, costs, [])
    size = {"legs": len(legs), "vertices": len(graph)}
    cut_count = 0
    while True:
        run.check()
        outcome = model.solve(run.clock)
        run.iterations += 1
        if outcome.infeasible:
            run.is_infeasible = True
            return
        if outcome.bound is not None:
            run.raise_bound(outcome.bound)
        point = outcome.point
        if point is None or not outcome.finished:
            run.report("integer", cuts=cut_count, **size)
            raise RunStopped
        x, y = np.rint(point.x), np.rint(point.y)
        cycles = cycles_of(x, legs, y)
        if len(cycles) == 1:
            run.update_incumbent(cycles[0])
            run.report("integer", cuts=cut_count, **size)
            return
        run.report("integer", cuts=cut_count, **size)
        for cycle in cycles:
            members = np.array(cycle)
            if params.cuts == "goals":
                members = np.flatnonzero(np.isin(graph.cluster, graph.cluster[members]))
            model.forbid_subtour(members, len(cycle))
        cut_count += len(cycles)

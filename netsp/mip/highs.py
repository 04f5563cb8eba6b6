"""LP relaxation in HiGHS, in process: rows and columns are added to a warm basis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import highspy
import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock, TimeLimit
from netsp.mip.cutpool import CutPool
from netsp.mip.cuts import Cut, cut_coefficients
from netsp.mip.highs_runner import NO_ENTRIES, Interruption, run, silent_solver
from netsp.mip.mip_policy import MipPolicy
from netsp.mip.program import Duals, Point, duals_of_relaxation, restricted, scale_of

_SETTLED = (
    highspy.HighsModelStatus.kOptimal,
    highspy.HighsModelStatus.kInfeasible,
    highspy.HighsModelStatus.kTimeLimit,
    highspy.HighsModelStatus.kInterrupt,
)


def _compressed(dense: Floats) -> tuple[int, Ints, Ints, Floats]:
    """Return the number of entries, row starts, columns and values of a dense block of rows."""
    row, col = np.nonzero(dense)
    start = np.searchsorted(row, np.arange(len(dense)))
    return len(row), start.astype(np.int32), col.astype(np.int32), dense[row, col]


def _basic(status: Sequence[Any]) -> Bools:
    """Return the mask of basic rows or columns."""
    basic = highspy.HighsBasisStatus.kBasic
    return np.fromiter((s == basic for s in status), dtype=bool, count=len(status))


class HighsRelaxation:
    """`netsp.mip.program.WarmRelaxation` by HiGHS.

    Rows are clusters, then cuts. Columns are y of the legs, and of removed legs that are still
    basic, fixed at 0: if a basic column or a nonbasic row is deleted, HiGHS loses its basis and
    takes as many steps as for a new program.
    """

    def __init__(
        self, cluster: Ints, legs: Ints, costs: Floats, policy: MipPolicy = MipPolicy()
    ) -> None:
        self.policy = policy.lp
        self.cluster = cluster
        self.clusters = int(cluster.max()) + 1
        self.legs: Ints = np.zeros((0, 2), dtype=np.int64)
        self._column: Ints = np.zeros(0, dtype=np.int32)
        self.pool = CutPool(policy.cuts)
        self.infeasible = False
        self._scale = scale_of(costs)
        self._highs = silent_solver()
        self._interruption = Interruption(self._highs.cbSimplexInterrupt)
        twos = np.full(self.clusters, 2.0)
        self._highs.addRows(self.clusters, twos, twos, *NO_ENTRIES)
        self.add_legs(legs, costs)

    @property
    def cuts(self) -> list[Cut]:
        """Cuts in the order of their rows."""
        return self.pool.cuts

    def add_legs(self, legs: Ints, costs: Floats) -> None:
        """Add legs (k, 2) with their coefficients in every row."""
        # few coefficients of a leg are not 0, so the dense block is built in parts
        step = max(self.policy.max_block_entries // max(len(self.cuts), 1), 1)
        for first in range(0, len(legs), step):
            part = slice(first, first + step)
            self._add_columns(legs[part], costs[part])

    def _add_columns(self, legs: Ints, costs: Floats) -> None:
        n = len(legs)
        cut, leg = np.nonzero(block := cut_coefficients(self.cuts, self.cluster, legs))
        rows = np.concatenate([self.cluster[legs].ravel(), self.clusters + cut])
        cols = np.concatenate([np.repeat(np.arange(n), 2), leg])
        values = np.concatenate([np.ones(2 * n), block[cut, leg]])
        order = np.argsort(cols, kind="stable")
        start = np.searchsorted(cols[order], np.arange(n))
        columns = self._highs.getNumCol() + np.arange(n, dtype=np.int32)
        self._highs.addCols(
            n,
            costs * self._scale,
            np.zeros(n),
            np.ones(n),
            len(rows),
            start.astype(np.int32),
            rows[order].astype(np.int32),
            values[order],
        )
        self.legs = np.vstack([self.legs, legs])
        self._column = np.concatenate([self._column, columns])

    def keep_legs(self, keep: Bools) -> None:
        """Remove all legs but those marked."""
        h, gone = self._highs, self._column[~keep]
        h.changeColsBounds(len(gone), gone, np.zeros(len(gone)), np.zeros(len(gone)))
        self.legs, self._column = self.legs[keep], self._column[keep]
        is_deleted = np.ones(h.getNumCol(), dtype=bool)
        is_deleted[self._column] = False
        basis = h.getBasis()
        if basis.valid:
            is_deleted &= ~_basic(basis.col_status)
        deleted = np.flatnonzero(is_deleted).astype(np.int32)
        h.deleteCols(len(deleted), deleted)
        self._column -= np.searchsorted(deleted, self._column).astype(np.int32)

    def restrict(self, keep: Bools) -> None:
        """Renumber legs and cuts for the vertices of a mask, which hold the ends of all legs."""
        self.cluster, self.legs, cuts = restricted(self.cluster, self.legs, self.cuts, keep)
        self.pool.replace(cuts)

    def set_costs(self, costs: Floats) -> None:
        """Set the costs of all legs in the program."""
        self._highs.changeColsCost(len(costs), self._column, costs * self._scale)

    def set_alive(self, alive: Bools) -> None:
        """Fix all legs at 0 but those marked."""
        n = len(alive)
        self._highs.changeColsBounds(n, self._column, np.zeros(n), alive.astype(np.float64))

    def rays(self) -> list[Duals]:
        """Return the dual ray of the last solve, in either sign, if HiGHS has one."""
        _, known, ray = self._highs.getDualRay()
        if not known:
            return []
        values = np.asarray(ray, dtype=np.float64)
        m = self.clusters
        return [
            duals_of_relaxation(v[:m], v[m:], self.cuts, self.cluster) for v in (values, -values)
        ]

    def probe(self, costs: Floats, alive: Bools, steps: int) -> float:
        """Return the objective after some simplex steps with other costs and legs.

        It is inf if they show that there is no solution. The basis is restored; costs and legs are
        not.
        """
        h = self._highs
        basis = h.getBasis()
        self.set_costs(costs)
        self.set_alive(alive)
        h.setOptionValue("simplex_iteration_limit", steps)
        h.run()
        h.setOptionValue("simplex_iteration_limit", highspy.kHighsIInf)
        infeasible = h.getModelStatus() == highspy.HighsModelStatus.kInfeasible
        value = math.inf if infeasible else float(h.getInfo().objective_function_value)
        h.setBasis(basis)
        return value / self._scale

    def add_cuts(self, cuts: list[Cut], *, permanent: bool = False) -> None:
        """Add cuts to the program."""
        step = max(self.policy.max_block_entries // max(len(self.legs), 1), 1)
        for first in range(0, len(cuts), step):
            self._add_rows(cuts[first : first + step])
        self.pool.add(cuts, permanent=permanent)

    def _add_rows(self, cuts: list[Cut]) -> None:
        n = len(cuts)
        block = cut_coefficients(cuts, self.cluster, self.legs)
        no_limit = np.full(n, highspy.kHighsInf)
        min_rows = np.array([-2.0 * c.rhs for c in cuts])
        entries, start, leg, values = _compressed(block)
        self._highs.addRows(n, min_rows, no_limit, entries, start, self._column[leg], values)

    def keep_cuts(self, keep: Bools) -> None:
        """Remove the cuts that are neither marked nor needed by the basis."""
        h = self._highs
        basis = h.getBasis()
        if basis.valid:
            keep = keep | ~_basic(basis.row_status)[self.clusters :]
        gone = self.clusters + np.flatnonzero(~keep)
        h.deleteRows(len(gone), gone.astype(np.int32))
        self.pool.keep(keep)

    def solve(self, limit: TimeLimit) -> Point | None:
        """Return the optimum with duals; None if there is none or the time is up."""
        h = self._highs
        clock = Clock.from_limit(limit)
        self._interruption.follow(clock, always=False)
        status = self._solve_robustly(clock)
        self.infeasible = status == highspy.HighsModelStatus.kInfeasible
        if status != highspy.HighsModelStatus.kOptimal:
            return None
        solution = h.getSolution()
        y = np.array(solution.col_value)[self._column]
        price = np.array(solution.row_dual) / self._scale
        x = np.zeros(len(self.cluster))
        np.add.at(x, self.legs.ravel(), np.repeat(y / 2.0, 2))
        duals = duals_of_relaxation(
            price[: self.clusters], price[self.clusters :], self.cuts, self.cluster
        )
        slack = np.array(solution.row_value)[self.clusters :]
        slack += np.array([2.0 * c.rhs for c in self.cuts])
        objective = float(h.getInfo().objective_function_value) / self._scale
        return Point(x, self.legs, y, objective, duals, slack)

    def _solve_robustly(self, clock: Clock) -> Any:
        """Solve from the basis, then from scratch, then with looser tolerances.

        From a basis the simplex method can end in numerical trouble, or not at all. No bound rests
        on the tolerances.
        """
        h = self._highs
        steps = self.policy.simplex_steps_per_row * (h.getNumRow() + h.getNumCol())
        fresh_steps = self.policy.fresh_step_factor * steps
        for tolerance, is_fresh, max_steps in (
            (1e-9, False, steps),
            (1e-9, True, fresh_steps),
            (1e-7, True, highspy.kHighsIInf),
        ):
            if is_fresh:
                h.clearSolver()
            h.setOptionValue("simplex_iteration_limit", max_steps)
            h.setOptionValue("primal_feasibility_tolerance", tolerance)
            h.setOptionValue("dual_feasibility_tolerance", tolerance)
            run(h, clock.left)
            status = h.getModelStatus()
            if status in _SETTLED:
                break
        h.setOptionValue("simplex_iteration_limit", highspy.kHighsIInf)
        return status

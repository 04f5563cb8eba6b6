"""The programs in HiGHS, in process: rows and columns are added to a warm basis."""

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
from netsp.mip.highs_runner import NONE, Interruption, run, silent_solver
from netsp.mip.program import Duals, Point, duals_of_relaxation, restricted, scale_of

_SETTLED = (
    highspy.HighsModelStatus.kOptimal,
    highspy.HighsModelStatus.kInfeasible,
    highspy.HighsModelStatus.kTimeLimit,
    highspy.HighsModelStatus.kInterrupt,
)

BLOCK = 4_000_000
"""Coefficients of legs in rows that are held at once, before the program has those that are not 0;
thousands of each would take a gigabyte."""

STEPS = 2
"""Of the simplex method for each row and column, at most, from a basis; four times as many from the
start."""


def _compressed(dense: Floats) -> tuple[int, Ints, Ints, Floats]:
    """Entries, row starts, columns and values of a dense block of rows."""
    row, col = np.nonzero(dense)
    start = np.searchsorted(row, np.arange(len(dense)))
    return len(row), start.astype(np.int32), col.astype(np.int32), dense[row, col]


def _basic(status: Sequence[Any]) -> Bools:
    """Which rows or columns of a basis are basic."""
    basic = highspy.HighsBasisStatus.kBasic
    return np.fromiter((s == basic for s in status), dtype=bool, count=len(status))


class HighsRelaxation:
    """`netsp.mip.program.Relaxation`. Rows: clusters, cuts. Columns: y of the legs, and of legs
    taken out that were basic, fixed at 0.

    Without a basic column, or a row that is not basic, HiGHS has no basis left to start from, and
    takes as many steps as for a new program. So such columns wait until they are no longer basic,
    and such rows stay.
    """

    def __init__(self, cluster: Ints, legs: Ints, costs: Floats) -> None:
        self.cluster = cluster
        self.clusters = int(cluster.max()) + 1
        self.legs: Ints = np.zeros((0, 2), dtype=np.int64)
        self._column: Ints = np.zeros(0, dtype=np.int32)
        self.pool = CutPool()
        self.infeasible = False
        self._scale = scale_of(costs)
        self._highs = silent_solver()
        self._interruption = Interruption(self._highs.cbSimplexInterrupt)
        twos = np.full(self.clusters, 2.0)
        self._highs.addRows(self.clusters, twos, twos, *NONE)
        self.add_legs(legs, costs)

    @property
    def cuts(self) -> list[Cut]:
        """Cuts in the program, in the order of their rows."""
        return self.pool.cuts

    def add_legs(self, legs: Ints, costs: Floats) -> None:
        """Bring legs (k, 2) into the program, with their coefficients in every row."""
        # a leg has a coefficient in few of the rows: not all of them are held at once
        at_once = max(BLOCK // max(len(self.cuts), 1), 1)
        for first in range(0, len(legs), at_once):
            some = slice(first, first + at_once)
            self._add_columns(legs[some], costs[some])

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
            n, costs * self._scale, np.zeros(n), np.ones(n), len(rows), start.astype(np.int32),
            rows[order].astype(np.int32), values[order],
        )  # fmt: skip
        self.legs = np.vstack([self.legs, legs])
        self._column = np.concatenate([self._column, columns])

    def keep_legs(self, keep: Bools) -> None:
        """Take all legs out of the program but those marked."""
        h, gone = self._highs, self._column[~keep]
        h.changeColsBounds(len(gone), gone, np.zeros(len(gone)), np.zeros(len(gone)))
        self.legs, self._column = self.legs[keep], self._column[keep]
        out = np.ones(h.getNumCol(), dtype=bool)
        out[self._column] = False
        basis = h.getBasis()
        if basis.valid:
            out &= ~_basic(basis.col_status)
        at = np.flatnonzero(out).astype(np.int32)
        h.deleteCols(len(at), at)
        self._column -= np.searchsorted(at, self._column).astype(np.int32)

    def restrict(self, keep: Bools) -> None:
        """Renumber legs and cuts for the vertices marked; no other has a leg in the program."""
        self.cluster, self.legs, cuts = restricted(self.cluster, self.legs, self.cuts, keep)
        self.pool.replace(cuts)

    def set_costs(self, costs: Floats) -> None:
        """Set the costs of all legs in the program."""
        self._highs.changeColsCost(len(costs), self._column, costs * self._scale)

    def set_alive(self, alive: Bools) -> None:
        """Let only the legs marked be used."""
        n = len(alive)
        self._highs.changeColsBounds(n, self._column, np.zeros(n), alive.astype(np.float64))

    def rays(self) -> list[Duals]:
        """Dual values that say why the last solve found no solution, in either sign; none where
        HiGHS has none."""
        _, known, ray = self._highs.getDualRay()
        if not known:
            return []
        values = np.asarray(ray, dtype=np.float64)
        return [
            duals_of_relaxation(
                v[: self.clusters], v[self.clusters :], self.cuts, self.cluster
            ) for v in (values, -values)
        ]  # fmt: skip

    def probe(self, costs: Floats, alive: Bools, steps: int) -> float:
        """The objective after so many simplex steps with other costs and legs; inf where these
        show that there is no solution. The basis is put back; costs and legs are not."""
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

    def add_cuts(self, cuts: list[Cut], *, for_good: bool = False) -> None:
        """Bring cuts into the program."""
        at_once = max(BLOCK // max(len(self.legs), 1), 1)
        for first in range(0, len(cuts), at_once):
            self._add_rows(cuts[first : first + at_once])
        self.pool.add(cuts, for_good=for_good)

    def _add_rows(self, cuts: list[Cut]) -> None:
        n = len(cuts)
        block = cut_coefficients(cuts, self.cluster, self.legs)
        no_limit = np.full(n, highspy.kHighsInf)
        least = np.array([-2.0 * c.room for c in cuts])
        entries, start, leg, values = _compressed(block)
        self._highs.addRows(n, least, no_limit, entries, start, self._column[leg], values)

    def keep_cuts(self, keep: Bools) -> None:
        """Take the cuts out of the program but those marked, and those that its basis rests on."""
        h = self._highs
        basis = h.getBasis()
        if basis.valid:
            keep = keep | ~_basic(basis.row_status)[self.clusters :]
        gone = self.clusters + np.flatnonzero(~keep)
        h.deleteRows(len(gone), gone.astype(np.int32))
        self.pool.keep(keep)

    def solve(self, limit: TimeLimit) -> Point | None:
        """The optimum with duals; None if there is none or the time ran out."""
        h = self._highs
        clock = Clock.from_limit(limit)
        self._interruption.hear(clock, always=False)
        # from a basis the simplex method can end in numerical trouble, or not at all (100 goals at
        # tether 500, the eighth world: 29,000 steps and no end, where 11,000 from the start are
        # enough): then afresh, then with looser tolerances (the bound does not rest on them)
        size = h.getNumRow() + h.getNumCol()
        for tolerance, fresh, steps in (
            (1e-9, False, STEPS * size), (1e-9, True, 4 * STEPS * size),
            (1e-7, True, highspy.kHighsIInf),
        ):  # fmt: skip
            if fresh:
                h.clearSolver()
            h.setOptionValue("simplex_iteration_limit", steps)
            h.setOptionValue("primal_feasibility_tolerance", tolerance)
            h.setOptionValue("dual_feasibility_tolerance", tolerance)
            run(h, clock.left)
            status = h.getModelStatus()
            if status in _SETTLED:
                break
        h.setOptionValue("simplex_iteration_limit", highspy.kHighsIInf)
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
        slack += np.array([2.0 * c.room for c in self.cuts])
        objective = float(h.getInfo().objective_function_value) / self._scale
        return Point(x, self.legs, y, objective, duals, slack)

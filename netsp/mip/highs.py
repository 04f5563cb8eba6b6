"""The programs in HiGHS, in process: rows and columns are added to a warm basis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import highspy
import numpy as np

from netsp.arrays import Bools, Floats, Ints
from netsp.clock import Clock, TimeLimit
from netsp.mip.cutpool import CutPool
from netsp.mip.cuts import Cut, cut_coefficients
from netsp.mip.program import (
    Duals,
    IntegerOutcome,
    Point,
    duals_of_relaxation,
    restricted,
    scale_of,
)

_SETTLED = (
    highspy.HighsModelStatus.kOptimal,
    highspy.HighsModelStatus.kInfeasible,
    highspy.HighsModelStatus.kTimeLimit,
    highspy.HighsModelStatus.kInterrupt,
)

_NONE = (0, np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0))


class _Quiet(highspy.Highs):  # type: ignore[misc]
    """HiGHS that prints nothing: 1.16 prints its banner to standard output, where solutions go, as
    soon as callbacks are enabled, which its constructor does."""

    def enableCallbacks(self) -> None:
        self.setOptionValue("output_flag", False)
        super().enableCallbacks()


def _solver() -> highspy.Highs:
    h = _Quiet()
    h.setOptionValue("output_flag", False)
    h.setOptionValue("threads", 1)
    h.setOptionValue("primal_feasibility_tolerance", 1e-9)
    h.setOptionValue("dual_feasibility_tolerance", 1e-9)
    return h


def _run(h: highspy.Highs, time_left: float) -> None:
    # HiGHS counts its limit from the first run of the object
    limit = h.getRunTime() + max(time_left, 0.05) if time_left < 1e9 else 1e30
    h.setOptionValue("time_limit", limit)
    h.run()


class _Interruption:
    """Ends a run of HiGHS when a clock is up, also before its deadline."""

    def __init__(self, *events: Any) -> None:
        self.clock = Clock()
        self._events, self._on = events, False

    def hear(self, clock: Clock, *, always: bool) -> None:
        """Of this clock from now on. Being asked at every step of the simplex method costs time, so
        that it is done only where it is needed."""
        self.clock = clock
        if (always or clock.stoppable) and not self._on:
            self._on = True
            for event in self._events:
                event.subscribe(self._interrupt)

    def _interrupt(self, event: Any) -> None:
        if self.clock.up:
            event.interrupt()


def _compressed(dense: Floats) -> tuple[int, Ints, Ints, Floats]:
    """Entries, row starts, columns and values of a dense block of rows."""
    row, col = np.nonzero(dense)
    start = np.searchsorted(row, np.arange(len(dense)))
    return len(row), start.astype(np.int32), col.astype(np.int32), dense[row, col]


class HighsRelaxation:
    """`netsp.mip.program.Relaxation`. Columns: y in the order of `legs`. Rows: clusters, cuts."""

    def __init__(self, cluster: Ints, legs: Ints, costs: Floats) -> None:
        self.cluster = cluster
        self.clusters = int(cluster.max()) + 1
        self.legs: Ints = np.zeros((0, 2), dtype=np.int64)
        self.pool = CutPool()
        self.infeasible = False
        self._scale = scale_of(costs)
        self._highs = _solver()
        self._interruption = _Interruption(self._highs.cbSimplexInterrupt)
        twos = np.full(self.clusters, 2.0)
        self._highs.addRows(self.clusters, twos, twos, *_NONE)
        self.add_legs(legs, costs)

    @property
    def cuts(self) -> list[Cut]:
        """Cuts in the program, in the order of their rows."""
        return self.pool.cuts

    def add_legs(self, legs: Ints, costs: Floats) -> None:
        """Bring legs (k, 2) into the program, with their coefficients in every row."""
        n = len(legs)
        if n == 0:
            return
        cut, leg = np.nonzero(block := cut_coefficients(self.cuts, self.cluster, legs))
        rows = np.concatenate([self.cluster[legs].ravel(), self.clusters + cut])
        cols = np.concatenate([np.repeat(np.arange(n), 2), leg])
        values = np.concatenate([np.ones(2 * n), block[cut, leg]])
        order = np.argsort(cols, kind="stable")
        start = np.searchsorted(cols[order], np.arange(n))
        self._highs.addCols(
            n, costs * self._scale, np.zeros(n), np.ones(n), len(rows), start.astype(np.int32),
            rows[order].astype(np.int32), values[order],
        )  # fmt: skip
        self.legs = np.vstack([self.legs, legs])

    def keep_legs(self, keep: Bools) -> None:
        """Take all legs out of the program but those marked."""
        gone = np.flatnonzero(~keep).astype(np.int32)
        self._highs.deleteCols(len(gone), gone)
        self.legs = self.legs[keep]

    def restrict(self, keep: Bools) -> None:
        """Renumber legs and cuts for the vertices marked; no other has a leg in the program."""
        self.cluster, self.legs, cuts = restricted(self.cluster, self.legs, self.cuts, keep)
        self.pool.replace(cuts)

    def set_costs(self, costs: Floats) -> None:
        """Set the costs of all legs in the program."""
        n = len(costs)
        self._highs.changeColsCost(n, np.arange(n, dtype=np.int32), costs * self._scale)

    def set_alive(self, alive: Bools) -> None:
        """Let only the legs marked be used."""
        n = len(alive)
        self._highs.changeColsBounds(
            n, np.arange(n, dtype=np.int32), np.zeros(n), alive.astype(np.float64)
        )

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
        if not cuts:
            return
        n = len(cuts)
        block = cut_coefficients(cuts, self.cluster, self.legs)
        no_limit = np.full(n, highspy.kHighsInf)
        least = np.array([-2.0 * c.room for c in cuts])
        self._highs.addRows(n, least, no_limit, *_compressed(block))
        self.pool.add(cuts, for_good=for_good)

    def keep_cuts(self, keep: Bools) -> None:
        """Take all cuts out of the program but those marked."""
        gone = self.clusters + np.flatnonzero(~keep)
        self._highs.deleteRows(len(gone), gone.astype(np.int32))
        self.pool.keep(keep)

    def solve(self, limit: TimeLimit) -> Point | None:
        """The optimum with duals; None if there is none or the time ran out."""
        h = self._highs
        clock = Clock.of(limit)
        self._interruption.hear(clock, always=False)
        # a warm basis can end in numerical trouble: then afresh, then with looser tolerances (the
        # bound does not rest on them)
        for tolerance, fresh in ((1e-9, False), (1e-9, True), (1e-7, True)):
            if fresh:
                h.clearSolver()
            h.setOptionValue("primal_feasibility_tolerance", tolerance)
            h.setOptionValue("dual_feasibility_tolerance", tolerance)
            _run(h, clock.left)
            status = h.getModelStatus()
            if status in _SETTLED:
                break
        self.infeasible = status == highspy.HighsModelStatus.kInfeasible
        if status != highspy.HighsModelStatus.kOptimal:
            return None
        solution = h.getSolution()
        y, price = np.array(solution.col_value), np.array(solution.row_dual) / self._scale
        x = np.zeros(len(self.cluster))
        np.add.at(x, self.legs.ravel(), np.repeat(y / 2.0, 2))
        duals = duals_of_relaxation(
            price[: self.clusters], price[self.clusters :], self.cuts, self.cluster
        )
        slack = np.array(solution.row_value)[self.clusters :]
        slack += np.array([2.0 * c.room for c in self.cuts])
        objective = float(h.getInfo().objective_function_value) / self._scale
        return Point(x, self.legs, y, objective, duals, slack)


class HighsInteger:
    """`netsp.mip.program.IntegerProgram`. Columns: x by position in `vertices`, then y in the order
    of `legs`. Rows: clusters, then vertices, then cuts."""

    def __init__(
        self, cluster: Ints, vertices: Ints, legs: Ints, costs: Floats, cuts: Sequence[Cut]
    ) -> None:
        self.cluster, self.vertices, self.legs = cluster, vertices, legs
        self.clusters = int(cluster.max()) + 1
        self.cuts: list[Cut] = []
        self._scale = scale_of(costs)
        self._position = np.full(len(cluster), -1, dtype=np.int64)
        self._position[vertices] = np.arange(len(vertices))
        h = self._highs = _solver()
        k, n = len(vertices), len(legs)
        ones = np.ones(self.clusters)
        h.addRows(self.clusters, ones, ones, *_NONE)
        h.addRows(k, np.zeros(k), np.zeros(k), *_NONE)
        index = np.column_stack([cluster[vertices], self.clusters + np.arange(k)])
        h.addCols(
            k, np.zeros(k), np.zeros(k), np.ones(k), 2 * k,
            (2 * np.arange(k)).astype(np.int32), index.ravel().astype(np.int32),
            np.tile([1.0, -2.0], k),
        )  # fmt: skip
        h.addCols(
            n, costs * self._scale, np.zeros(n), np.ones(n), 2 * n,
            (2 * np.arange(n)).astype(np.int32),
            (self.clusters + self._position[legs]).ravel().astype(np.int32), np.ones(2 * n),
        )  # fmt: skip
        self.add_cuts(list(cuts))
        h.changeColsIntegrality(
            k + n, np.arange(k + n, dtype=np.int32), np.full(k + n, highspy.HighsVarType.kInteger)
        )
        h.setOptionValue("mip_rel_gap", 1e-9)
        h.setOptionValue("mip_abs_gap", 1e-9)
        self._interruption = _Interruption(h.cbMipInterrupt, h.cbSimplexInterrupt)

    def add_cuts(self, cuts: list[Cut]) -> None:
        """Bring cuts into the program."""
        if not cuts:
            return
        starts, index, value = [], [], []
        count = 0
        for cut in cuts:
            at = self.vertices
            outside_c = at[cut.inside[at] & (self.cluster[at] != cut.cluster)]
            within, times = cut.within(self.cluster, self.legs)
            starts.append(count)
            index += [self._position[outside_c], len(self.vertices) + within]
            value += [np.full(len(outside_c), -1.0), times]
            count += len(outside_c) + len(within)
        n = len(cuts)
        self._highs.addRows(
            n, np.full(n, -highspy.kHighsInf), np.array([c.room for c in cuts]), count,
            np.array(starts, dtype=np.int32), np.concatenate(index).astype(np.int32),
            np.concatenate(value),
        )  # fmt: skip
        self.cuts = [*self.cuts, *cuts]

    def solve(self, limit: TimeLimit) -> IntegerOutcome:
        """The best integer solution, as far as the time goes."""
        h = self._highs
        clock = Clock.of(limit)
        # HiGHS can overrun its own limit in presolve and at the root of its tree
        self._interruption.hear(clock, always=True)
        _run(h, clock.left)
        status = h.getModelStatus()
        if status == highspy.HighsModelStatus.kInfeasible:
            return IntegerOutcome(None, None, finished=True, infeasible=True)
        info = h.getInfo()
        point = None
        if info.primal_solution_status == 2:  # feasible
            columns = np.array(h.getSolution().col_value)
            x = np.zeros(len(self.cluster))
            x[self.vertices] = columns[: len(self.vertices)]
            y = columns[len(self.vertices) :]
            point = Point(x, self.legs, y, info.objective_function_value / self._scale, None)
        dual = info.mip_dual_bound
        bound = dual / self._scale if math.isfinite(dual) else None
        return IntegerOutcome(point, bound, status == highspy.HighsModelStatus.kOptimal)

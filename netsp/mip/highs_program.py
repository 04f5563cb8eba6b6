"""The program in HiGHS, in process: rows and columns are added to a warm basis."""

from __future__ import annotations

import math

import highspy
import numpy as np

from netsp.mip.program import Bools, Cut, Duals, Floats, IntegerOutcome, Ints, Point


class HighsProgram:
    """`netsp.mip.program.Program` by HiGHS.

    Columns: x by position in `vertices`, then y in the order of `legs`. Rows: clusters, then
    vertices, then cuts.
    """

    def __init__(self, cluster: Ints, costs: Floats, legs: Ints, vertices: Ints) -> None:
        self.cluster, self.costs, self.vertices = cluster, costs, vertices
        self.clusters = int(cluster.max()) + 1
        self.legs: Ints = np.zeros((0, 2), dtype=np.int64)
        self.cuts: list[Cut] = []
        self.infeasible = False
        self._position = np.full(len(cluster), -1, dtype=np.int64)
        self._position[vertices] = np.arange(len(vertices))
        self._inside = np.zeros((0, len(cluster)), dtype=bool)
        h = self._highs = highspy.Highs()
        h.setOptionValue("output_flag", False)
        h.setOptionValue("threads", 1)
        h.setOptionValue("primal_feasibility_tolerance", 1e-9)
        h.setOptionValue("dual_feasibility_tolerance", 1e-9)
        k = len(vertices)
        ones = np.ones(self.clusters)
        empty = (0, np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0))
        h.addRows(self.clusters, ones, ones, *empty)
        h.addRows(k, np.zeros(k), np.zeros(k), *empty)
        index = np.column_stack([cluster[vertices], self.clusters + np.arange(k)])
        value = np.tile([1.0, -2.0], (k, 1))
        h.addCols(
            k, np.zeros(k), np.zeros(k), np.ones(k), 2 * k,
            (2 * np.arange(k)).astype(np.int32), index.ravel().astype(np.int32), value.ravel(),
        )  # fmt: skip
        self.add_legs(legs)

    def add_legs(self, legs: Ints) -> None:
        """Bring legs (k, 2) into the program, with their coefficients in every row."""
        n = len(legs)
        if n == 0:
            return
        both = self._inside[:, legs[:, 0]] & self._inside[:, legs[:, 1]]
        leg, cut = np.nonzero(both.T)
        rows = np.concatenate([(self.clusters + self._position[legs]).ravel(),
                               self.clusters + len(self.vertices) + cut])  # fmt: skip
        cols = np.concatenate([np.repeat(np.arange(n), 2), leg])
        order = np.argsort(cols, kind="stable")
        start = np.searchsorted(cols[order], np.arange(n))
        self._highs.addCols(
            n, self.costs[legs[:, 0], legs[:, 1]], np.zeros(n), np.ones(n), len(rows),
            start.astype(np.int32), rows[order].astype(np.int32), np.ones(len(rows)),
        )  # fmt: skip
        self.legs = np.vstack([self.legs, legs])

    def add_cuts(self, cuts: list[Cut]) -> None:
        """Bring cuts into the program."""
        if not cuts:
            return
        starts, index, value = [], [], []
        count = 0
        for cut in cuts:
            outside_c = self.vertices[
                cut.inside[self.vertices] & (self.cluster[self.vertices] != cut.cluster)
            ]
            within = np.flatnonzero(cut.inside[self.legs[:, 0]] & cut.inside[self.legs[:, 1]])
            starts.append(count)
            index += [self._position[outside_c], len(self.vertices) + within]
            value += [np.full(len(outside_c), -1.0), np.ones(len(within))]
            count += len(outside_c) + len(within)
        n = len(cuts)
        self._highs.addRows(
            n, np.full(n, -highspy.kHighsInf), np.zeros(n), count,
            np.array(starts, dtype=np.int32), np.concatenate(index).astype(np.int32),
            np.concatenate(value),
        )  # fmt: skip
        self.cuts = [*self.cuts, *cuts]
        self._inside = np.vstack([self._inside, [c.inside for c in cuts]])

    def keep_cuts(self, keep: Bools) -> None:
        """Take all cuts out of the program but those marked."""
        gone = self.clusters + len(self.vertices) + np.flatnonzero(~keep)
        self._highs.deleteRows(len(gone), gone.astype(np.int32))
        self.cuts = [c for c, k in zip(self.cuts, keep, strict=True) if k]
        self._inside = self._inside[keep]

    def solve_relaxation(self, time_left: float) -> Point | None:
        """The LP relaxation's optimum with duals; None if the time ran out."""
        self._run(time_left)
        status = self._highs.getModelStatus()
        self.infeasible = status == highspy.HighsModelStatus.kInfeasible
        if status != highspy.HighsModelStatus.kOptimal:
            return None
        solution = self._highs.getSolution()
        duals = np.array(solution.row_dual)
        degree = np.zeros(len(self.cluster))
        first_cut = self.clusters + len(self.vertices)
        degree[self.vertices] = duals[self.clusters : first_cut]
        prices = Duals(duals[: self.clusters], degree, np.minimum(duals[first_cut:], 0.0))
        return self._point(np.array(solution.col_value), prices)

    def solve_integer(self, time_left: float) -> IntegerOutcome:
        """The best integer solution, as far as the time goes."""
        h = self._highs
        n = len(self.vertices) + len(self.legs)
        h.changeColsIntegrality(
            n, np.arange(n, dtype=np.int32), np.full(n, highspy.HighsVarType.kInteger)
        )
        h.setOptionValue("mip_rel_gap", 1e-9)
        h.setOptionValue("mip_abs_gap", 1e-9)
        self._run(time_left)
        status = h.getModelStatus()
        if status == highspy.HighsModelStatus.kInfeasible:
            return IntegerOutcome(None, None, finished=True, infeasible=True)
        info = h.getInfo()
        found = info.primal_solution_status == 2  # feasible
        bound = info.mip_dual_bound if math.isfinite(info.mip_dual_bound) else None
        point = self._point(np.array(h.getSolution().col_value), None) if found else None
        finished = status == highspy.HighsModelStatus.kOptimal
        return IntegerOutcome(point, bound, finished)

    def _run(self, time_left: float) -> None:
        # HiGHS counts its limit from the first run of the object
        limit = self._highs.getRunTime() + max(time_left, 0.05) if time_left < 1e9 else 1e30
        self._highs.setOptionValue("time_limit", limit)
        self._highs.run()

    def _point(self, columns: Floats, duals: Duals | None) -> Point:
        x = np.zeros(len(self.cluster))
        x[self.vertices] = columns[: len(self.vertices)]
        objective = float(self._highs.getInfo().objective_function_value)
        return Point(x, self.legs, columns[len(self.vertices) :], objective, duals)

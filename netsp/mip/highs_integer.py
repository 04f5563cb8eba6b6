"""Integer program in HiGHS."""

from __future__ import annotations

import math
from collections.abc import Sequence

import highspy
import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock, TimeLimit
from netsp.mip.cuts import Cut
from netsp.mip.highs_runner import NO_ENTRIES, Interruption, run, silent_solver
from netsp.mip.program import IntegerOutcome, Point, scale_of


class HighsInteger:
    """`netsp.mip.program.IntegerProgram` by HiGHS.

    Columns are x by position in `vertices`, then y in the order of `legs`. Rows are clusters, then
    vertices, then cuts.
    """

    def __init__(
        self, cluster: Ints, vertices: Ints, legs: Ints, costs: Floats, cuts: Sequence[Cut]
    ) -> None:
        self.cluster, self.vertices, self.legs = cluster, vertices, legs
        self.clusters = int(cluster.max()) + 1
        self.cuts: list[Cut] = []
        self._scale = scale_of(costs)
        self._position = np.full(len(cluster), -1, dtype=np.int64)
        self._position[vertices] = np.arange(len(vertices))
        h = self._highs = silent_solver()
        k, n = len(vertices), len(legs)
        ones = np.ones(self.clusters)
        h.addRows(self.clusters, ones, ones, *NO_ENTRIES)
        h.addRows(k, np.zeros(k), np.zeros(k), *NO_ENTRIES)
        index = np.column_stack([cluster[vertices], self.clusters + np.arange(k)])
        h.addCols(
            k,
            np.zeros(k),
            np.zeros(k),
            np.ones(k),
            2 * k,
            (2 * np.arange(k)).astype(np.int32),
            index.ravel().astype(np.int32),
            np.tile([1.0, -2.0], k),
        )
        h.addCols(
            n,
            costs * self._scale,
            np.zeros(n),
            np.ones(n),
            2 * n,
            (2 * np.arange(n)).astype(np.int32),
            (self.clusters + self._position[legs]).ravel().astype(np.int32),
            np.ones(2 * n),
        )
        self.add_cuts(list(cuts))
        h.changeColsIntegrality(
            k + n, np.arange(k + n, dtype=np.int32), np.full(k + n, highspy.HighsVarType.kInteger)
        )
        h.setOptionValue("mip_rel_gap", 1e-9)
        h.setOptionValue("mip_abs_gap", 1e-9)
        self._interruption = Interruption(h.cbMipInterrupt, h.cbSimplexInterrupt)

    def add_cuts(self, cuts: list[Cut]) -> None:
        """Add cuts to the program."""
        if not cuts:
            return
        starts, index, value = [], [], []
        count = 0
        for cut in cuts:
            at = self.vertices
            outside_c = at[cut.inside[at] & (self.cluster[at] != cut.cluster)]
            columns, coefficients = cut.left_side(self.cluster, self.legs)
            starts.append(count)
            index += [self._position[outside_c], len(self.vertices) + columns]
            value += [np.full(len(outside_c), -1.0), coefficients]
            count += len(outside_c) + len(columns)
        n = len(cuts)
        self._highs.addRows(
            n,
            np.full(n, -highspy.kHighsInf),
            np.array([c.rhs for c in cuts]),
            count,
            np.array(starts, dtype=np.int32),
            np.concatenate(index).astype(np.int32),
            np.concatenate(value),
        )
        self.cuts = [*self.cuts, *cuts]

    def solve(self, limit: TimeLimit) -> IntegerOutcome:
        """Return the best integer solution found in time."""
        h = self._highs
        clock = Clock.from_limit(limit)
        # HiGHS can overrun its own limit in presolve and at the root of its tree
        self._interruption.follow(clock, always=True)
        run(h, clock.left)
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

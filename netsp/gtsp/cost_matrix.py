"""Costs of legs during a proof, measured only if they matter.

Where all legs cannot be found at once, a lower bound takes a fraction of the time of a leg. With
bounds in place of costs everything that is proven still holds, so the relaxation is solved with
bounds first, and only the legs that it cannot rule out are measured.

With thousands of vertices the matrix limits a proof. Then only the legs that may be in a better
tour are held (`netsp.gtsp.sparse_costs`). Sparse costs, and matrices above
`CostPolicy.max_double_vertices`, are rounded down to single precision: bounds stay valid, and a
proof loses at most 3e-7 of the length, of the 5e-7 that it may.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.ram import check_available
from netsp.gtsp.gtsp_policy import CostPolicy
from netsp.gtsp.instance import Instance
from netsp.gtsp.nearest_index import NearestIndex
from netsp.gtsp.sparse_costs import SparseCosts
from netsp.gtsp.travel.costs import rounded_down

NO_VALUES: Floats = np.zeros((0, 0), dtype=np.float32)  # type: ignore[assignment]
"""Empty matrix of values, used while costs are sparse."""


class CostMatrix:
    """Costs among the remaining vertices of a travel graph.

    Rows and columns of the matrix are positions among these vertices.

    Attributes
    ----------
    vertices
        (k,) vertices of the graph.
    cluster
        (k,) their clusters.
    values
        (k, k) costs or lower bounds, inf within a cluster; empty while costs are sparse.
    rows
        Sparse costs if there are too many vertices for a matrix; else None.
    exact
        (k, k) whether a value is a cost; None if all are.
    """

    def __init__(
        self, graph: Instance, rows: SparseCosts | None = None, *, policy: CostPolicy = CostPolicy()
    ) -> None:
        self.graph, self.rows, self.policy = graph, rows, policy
        self._was_sparse = rows is not None  # then legs of the incumbent may be missing
        self._near = NearestIndex(graph)
        self.vertices: Ints = np.arange(len(graph))
        self.cluster: Ints = graph.cluster
        self.values: Floats
        self.exact: Bools | None = None
        if rows is not None:
            self.values = NO_VALUES
            return
        is_rounded = len(graph) > policy.max_double_vertices
        if len(graph) <= policy.max_measured_vertices or not graph.estimate(len(graph)).seconds:
            self.values = np.array(graph.costs)
            return
        check_available(
            (policy.bytes_per_rounded_leg if is_rounded else policy.bytes_per_leg)
            * len(graph) ** 2,
            f"bounding every tour over {len(graph)} homotopy classes",
            "lower tether_length or max_classes, or use solver 'lns'",
        )
        if policy.allows_all(graph.oracle.estimate(len(graph)).seconds, len(graph)):
            costs = graph.costs_rounded if is_rounded else graph.costs_among
            self.values = costs(self.vertices)
            return
        self.values = self._rounded_bounds() if is_rounded else graph.lower_bounds()
        self._mark_unmeasured()

    @property
    def measures_single_legs(self) -> bool:
        """True if legs are measured one by one as they are needed."""
        return self.policy.allows_single(self.graph.oracle.estimate(2).seconds)

    def _rounded_bounds(self) -> Floats:
        n, block_rows = len(self.vertices), self.policy.block_rows
        out = np.empty((n, n), dtype=np.float32)
        for first in range(0, n, block_rows):
            rows = np.arange(min(block_rows, n - first))
            block = rounded_down(self.graph.lower_bounds(self.vertices[first:], rows))
            out[first : first + len(rows), first:] = block
            out[first:, first : first + len(rows)] = block.T
        return out  # type: ignore[return-value]

    def _mark_unmeasured(self) -> None:
        """Mark all values as bounds, except those of the base, which are known."""
        self.exact = np.zeros(self.values.shape, dtype=bool)
        base = self.graph.costs_to_base[self.vertices]
        self.values[0] = self.values[:, 0] = self._as_held(base)
        self.exact[0] = self.exact[:, 0] = True

    @property
    def rounded(self) -> bool:
        """True if values are rounded down to single precision."""
        return self.rows is not None or self.values.dtype == np.float32

    def _as_held(self, costs: Floats) -> Floats:
        return rounded_down(costs) if self.rounded else costs

    def costs_of(self, legs: Ints) -> Floats:
        """Return the values (k,) of legs (k, 2)."""
        if not self._was_sparse:
            return self.values[legs[:, 0], legs[:, 1]].astype(np.float64)
        if self.rows is None:
            out = self.values[legs[:, 0], legs[:, 1]]
        else:
            out = self.rows.costs_of(*legs.T)
        gone = np.isinf(out)
        if gone.any():  # legs of an incumbent that is no better than the one that fixed them out
            u, v = self.vertices[legs[gone]].T
            out[gone] = self._as_held(self.graph.costs_of(u, v))
        return out

    def __len__(self) -> int:
        return len(self.vertices)

    @property
    def base_costs(self) -> Floats:
        """(k,) values of the legs of the base."""
        if self.rows is not None:
            return self._as_held(self.graph.costs_to_base[self.vertices])
        return np.asarray(self.values[0])

    def lower_bounds_from(self, rows: Ints) -> Floats:
        """Return lower bounds (r, k) on the values of some rows."""
        if self.rows is not None:
            return self.graph.lower_bounds(self.vertices, rows)
        return np.asarray(self.values[rows])

    def among(self, rows: Ints) -> Floats:
        """Measure the legs among some rows and return their costs (r, r) in double precision."""
        if self.rows is not None:
            return self.graph.costs_among(self.vertices[rows])
        self.measure(rows)
        return np.asarray(self.values[np.ix_(rows, rows)], dtype=np.float64)

    def nearest_among(self, rows: Ints) -> Ints:
        """Return which of some rows is nearest to each of the k rows, by legs fixed out, too."""
        if self.rows is None:
            return np.asarray(np.argmin(self.values[:, rows], axis=1))
        return self._near.nearest(self.vertices, rows)

    def nearest_legs(self, count: int) -> Ints:
        """Return the cheapest legs (j, 2) of each row, at most `count` of each."""
        if self.rows is not None:
            return self.rows.nearest_legs(count)
        count = min(count, len(self) - 1)
        block_rows = self.policy.block_rows
        # copied, because a view of some columns would keep all of them in memory
        blocks = [
            np.argpartition(self.values[k : k + block_rows], count - 1, axis=1)[:, :count].copy()
            for k in range(0, len(self), block_rows)
        ]
        us = np.repeat(np.arange(len(self)), count)
        return np.column_stack([us, np.concatenate(blocks).ravel()])

    def measure(self, rows: Ints) -> None:
        """Measure all legs among some rows."""
        if self.exact is None:
            return
        grid = np.ix_(rows, rows)
        known = self.exact[grid] | (self.cluster[rows][:, None] == self.cluster[rows][None, :])
        if known.all():
            return
        open_rows = rows[~known.all(axis=1)]
        grid = np.ix_(open_rows, open_rows)
        self.values[grid] = self._as_held(self.graph.costs_among(self.vertices[open_rows]))
        self.exact[grid] = True

    def measure_legs(self, legs: Ints) -> bool:
        """Measure legs (k, 2) and return whether any of them was only bounded."""
        if self.exact is None or not len(legs):
            return False
        u, v = legs[~self.exact[legs[:, 0], legs[:, 1]]].T
        if not len(u):
            return False
        self._measure_pairs(u, v)
        self.exact[u, v] = self.exact[v, u] = True
        return True

    def measure_all(self, wanted: Bools) -> None:
        """Measure all legs of a mask (k, k, symmetric), and drop those neither in it nor measured.

        Dropped legs cost inf from now on.
        """
        if self.exact is None:
            return
        if self.rounded:
            self._measure_in_place(wanted)
        else:
            wanted = wanted & ~self.exact
            new = self.graph.costs_among(self.vertices, wanted)
            self.values = np.where(wanted, new, np.where(self.exact, self.values, np.inf))
        self.exact = None

    def _measure_in_place(self, wanted: Bools) -> None:
        """Measure a mask as `measure_all`, without a second matrix."""
        assert self.exact is not None
        block_rows, block_legs = self.policy.block_rows, self.policy.block_legs
        for first in range(0, len(self), block_rows):
            rows = slice(first, first + block_rows)
            new = wanted[rows] & ~self.exact[rows]
            self.values[rows][~(new | self.exact[rows])] = np.inf
            u, v = np.nonzero(new)
            u += first
            u, v = u[u < v], v[u < v]
            for k in range(0, len(u), block_legs):
                self._measure_pairs(u[k : k + block_legs], v[k : k + block_legs])

    def _measure_pairs(self, us: Ints, vs: Ints) -> None:
        costs = self._as_held(self.graph.costs_of(self.vertices[us], self.vertices[vs]))
        self.values[us, vs] = self.values[vs, us] = costs

    def restrict(self, keep: Bools) -> None:
        """Remove all vertices except those marked."""
        self.vertices, self.cluster = self.vertices[keep], self.cluster[keep]
        fits_double = 2 * len(self) <= self.policy.max_double_vertices
        if self.rows is not None:
            self.rows.restrict(keep)
            self._near.restrict(keep)
            if fits_double:
                self._to_matrix(self.rows)
            return
        if not self.rounded:
            self.values = np.ascontiguousarray(self.values[np.ix_(keep, keep)])
        else:
            self.values = squeezed(self.values, keep)
        if self.exact is not None:
            self.exact = squeezed(self.exact, keep)
        if self.rounded and fits_double:
            self._to_double()

    def _to_matrix(self, rows: SparseCosts) -> None:
        """Replace sparse costs by a matrix in double precision; legs fixed out cost inf."""
        left, legs = np.zeros((len(self), len(self)), dtype=bool), rows.legs_left()
        left[legs[:, 0], legs[:, 1]] = left[legs[:, 1], legs[:, 0]] = True
        self.values = np.where(left, self.graph.costs_among(self.vertices, left), np.inf)
        self.rows, self._near = None, NearestIndex(self.graph)

    def _to_double(self) -> None:
        """Return to double precision; measured legs are measured again when they are needed."""
        finite = np.isfinite(self.values)
        self.values = self.values.astype(np.float64)
        if self.exact is None:
            costs = self.graph.costs_among(self.vertices, finite)
            self.values = np.where(finite, costs, np.inf)
        else:
            self._mark_unmeasured()


def squeezed(matrix: npt.NDArray[Any], keep: Bools) -> npt.NDArray[Any]:
    """Return the marked rows and columns of a square matrix.

    If most of them are left, the matrix itself is overwritten, because there may be no room for a
    second one.
    """
    chosen = np.flatnonzero(keep)
    n = len(chosen)
    if 2 * n * n < matrix.size:
        return np.ascontiguousarray(matrix[np.ix_(chosen, chosen)])
    flat = matrix.reshape(-1)
    for to, row in enumerate(chosen.tolist()):
        flat[to * n : (to + 1) * n] = matrix[row, chosen]
    return flat[: n * n].reshape(n, n)

"""Leg costs, measured only when they matter where they cannot be had all at once.

Over the taut roadmap they can (`netsp.roadmap.branches`). Elsewhere a bound costs a fraction of a
leg, and there are many. As long as a leg is only bounded from below, everything that is proven with
the bound holds: the relaxation is one of a cheaper world. So the relaxation runs on bounds first,
and what it cannot rule out is measured.

With thousands of classes the matrix is what limits a proof. Then only the legs that may be in a
better tour are held (`netsp.gtsp.sparse_costs`). They, or the matrix where that cannot be, are in
single precision, rounded down: bounds stay bounds, and a proof loses 3e-7 of the length at most, of
the 5e-7 that it may.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.ram import check_available
from netsp.gtsp.nearest_index import NearestIndex
from netsp.gtsp.sparse_costs import SparseCosts
from netsp.gtsp.travel.costs import rounded_down
from netsp.gtsp.travel.graph import TravelGraph

MEASURE_AT_ONCE = 400
"""So many vertices or fewer are measured altogether: that takes a second at most."""


ROUNDED_FROM = 5000
"""With more vertices than these, costs are rounded; with less than half of them, no longer."""

BYTES_PER_LEG, BYTES_ROUNDED = 24.0, 8.0
"""Of memory that a proof takes: the values, what is known of them, and what is in between."""

NO_VALUES: Floats = np.zeros((0, 0), dtype=np.float32)  # type: ignore[assignment]
"""Where legs are held in rows."""

ROWS, LEGS = 512, 200_000
"""Of a matrix that are worked on at a time, so that what is in between stays small."""


class CostMatrix:
    """Costs among some vertices of a travel graph.

    Parameters
    ----------
    vertices
        (k,) of the graph.
    cluster
        (k,).
    values
        (k, k) lengths or lower bounds, inf within a cluster; of single precision if `rounded`. None
        of them while there are `rows`.
    rows
        The legs left, and their lengths, where there are too many vertices for a matrix.
    exact
        (k, k) which are lengths; None when all are.
    """

    def __init__(self, graph: TravelGraph, rows: SparseCosts | None = None) -> None:
        self.graph, self.rows = graph, rows
        self._let_go = rows is not None  # legs of the incumbent, too
        self._near = NearestIndex(graph)
        self.vertices: Ints = np.arange(len(graph))
        self.cluster: Ints = graph.cluster
        self.values: Floats
        self.exact: Bools | None = None
        if rows is not None:
            self.values = NO_VALUES
            return
        many = len(graph) > ROUNDED_FROM
        if graph.measured or len(graph) <= MEASURE_AT_ONCE:
            self.values = np.array(graph.costs)
            return
        check_available(
            (BYTES_ROUNDED if many else BYTES_PER_LEG) * len(graph) ** 2,
            f"bounding every tour over {len(graph)} homotopy classes",
            "lower tether_length or max_classes, or use solver 'lns'",
        )
        if graph.legs_at_once:
            costs = graph.costs_rounded if many else graph.costs_among
            self.values = costs(self.vertices)
            return
        self.values = self._bounded() if many else graph.lower_bounds()
        self._none_measured()

    def _bounded(self) -> Floats:
        """The matrix of bounds, rounded."""
        n = len(self.vertices)
        out = np.empty((n, n), dtype=np.float32)
        for first in range(0, n, ROWS):
            rows = np.arange(min(ROWS, n - first))
            block = rounded_down(self.graph.lower_bounds(self.vertices[first:], rows))
            out[first : first + len(rows), first:] = block
            out[first:, first : first + len(rows)] = block.T
        return out  # type: ignore[return-value]

    def _none_measured(self) -> None:
        """But for the legs of the base, which are the tethers."""
        self.exact = np.zeros(self.values.shape, dtype=bool)
        base = self.graph.costs_to_base[self.vertices]
        self.values[0] = self.values[:, 0] = self._held(base)
        self.exact[0] = self.exact[:, 0] = True

    @property
    def rounded(self) -> bool:
        """Whether values are rounded down to single precision."""
        return self.rows is not None or self.values.dtype == np.float32

    def _held(self, lengths: Floats) -> Floats:
        """Lengths as they are held."""
        return rounded_down(lengths) if self.rounded else lengths

    def costs_of(self, legs: Ints) -> Floats:
        """(k,) values of legs (k, 2), rows."""
        if self._let_go:
            out = (
                self.values[legs[:, 0], legs[:, 1]]
                if self.rows is None
                else self.rows.costs_of(*legs.T)
            )
            gone = np.isinf(out)
            if gone.any():  # of a tour that is no better than the one they were let go for
                u, v = self.vertices[legs[gone]].T
                out[gone] = self._held(self.graph.costs_of(u, v))
            return out
        return self.values[legs[:, 0], legs[:, 1]].astype(np.float64)

    def __len__(self) -> int:
        return len(self.vertices)

    @property
    def base_costs(self) -> Floats:
        """(k,) values of the legs of the base."""
        if self.rows is not None:
            return self._held(self.graph.costs_to_base[self.vertices])
        return np.asarray(self.values[0])

    def lower_bounds_from(self, some: Ints) -> Floats:
        """(r, k) values of the legs of some rows, or less."""
        if self.rows is not None:
            return self.graph.lower_bounds(self.vertices, some)
        return np.asarray(self.values[some])

    def among(self, some: Ints) -> Floats:
        """(r, r) values of the legs among some rows, measured, in double precision."""
        if self.rows is not None:
            return self.graph.costs_among(self.vertices[some])
        self.measure(some)
        return np.asarray(self.values[np.ix_(some, some)], dtype=np.float64)

    def nearest_among(self, some: Ints) -> Ints:
        """(k,) which of some rows has the least value to each row, also along legs that are in no
        better tour."""
        if self.rows is None:
            return np.asarray(np.argmin(self.values[:, some], axis=1))
        return self._near.nearest(self.vertices, some)

    def nearest_legs(self, most: int) -> Ints:
        """(j, 2) for each row its legs of least value, so many."""
        if self.rows is not None:
            return self.rows.nearest_legs(most)
        most = min(most, len(self) - 1)
        # a view of some columns would keep all
        near = np.concatenate([
            np.argpartition(self.values[first : first + ROWS], most - 1, axis=1)[:, :most].copy()
            for first in range(0, len(self), ROWS)
        ])  # fmt: skip
        return np.column_stack([np.repeat(np.arange(len(self)), most), near.ravel()])

    def measure(self, chosen: Ints) -> None:
        """Measure all legs among chosen rows."""
        if self.exact is None:
            return
        grid = np.ix_(chosen, chosen)
        known = self.exact[grid] | (self.cluster[chosen][:, None] == self.cluster[chosen][None, :])
        if known.all():
            return
        open_rows = chosen[~known.all(axis=1)]
        grid = np.ix_(open_rows, open_rows)
        self.values[grid] = self._held(self.graph.costs_among(self.vertices[open_rows]))
        self.exact[grid] = True

    def measure_legs(self, legs: Ints) -> bool:
        """Measure legs (k, 2), rows; whether any of them was only bounded."""
        if self.exact is None or not len(legs):
            return False
        u, v = legs[~self.exact[legs[:, 0], legs[:, 1]]].T
        if not len(u):
            return False
        lengths = self._held(self.graph.costs_of(self.vertices[u], self.vertices[v]))
        self.values[u, v] = self.values[v, u] = lengths
        self.exact[u, v] = self.exact[v, u] = True
        return True

    def measure_all(self, asked: Bools) -> None:
        """Measure everything asked for (symmetric); what is neither measured nor asked for counts
        as no leg from now on."""
        if self.exact is None:
            return
        if self.rounded:
            self._measure_by_rows(asked)
        else:
            asked = asked & ~self.exact
            new = self.graph.costs_among(self.vertices, asked)
            self.values = np.where(asked, new, np.where(self.exact, self.values, np.inf))
        self.exact = None

    def _measure_by_rows(self, asked: Bools) -> None:
        """As `measure_all`, without another matrix."""
        assert self.exact is not None
        for first in range(0, len(self), ROWS):
            rows = slice(first, first + ROWS)
            new = asked[rows] & ~self.exact[rows]
            self.values[rows][~(new | self.exact[rows])] = np.inf
            u, v = np.nonzero(new)
            u += first
            u, v = u[u < v], v[u < v]
            for k in range(0, len(u), LEGS):
                a, b = u[k : k + LEGS], v[k : k + LEGS]
                lengths = self._held(self.graph.costs_of(self.vertices[a], self.vertices[b]))
                self.values[a, b] = self.values[b, a] = lengths

    def restrict(self, keep: Bools) -> None:
        """Forget all vertices but those marked."""
        self.vertices, self.cluster = self.vertices[keep], self.cluster[keep]
        if self.rows is not None:
            self.rows.restrict(keep)
            self._near.restrict(keep)
            if 2 * len(self) <= ROUNDED_FROM:
                self._spell_out(self.rows)
            return
        if not self.rounded:
            self.values = np.ascontiguousarray(self.values[np.ix_(keep, keep)])
        else:
            self.values = squeezed(self.values, keep)
        if self.exact is not None:
            self.exact = squeezed(self.exact, keep)
        if self.rounded and 2 * len(self) <= ROUNDED_FROM:
            self._unround()

    def _spell_out(self, rows: SparseCosts) -> None:
        """From rows back to a matrix, in double precision; legs that are gone count as none."""
        left, u = np.zeros((len(self), len(self)), dtype=bool), rows.legs_left()
        left[u[:, 0], u[:, 1]] = left[u[:, 1], u[:, 0]] = True
        self.values = np.where(left, self.graph.costs_among(self.vertices, left), np.inf)
        self.rows, self._near = None, NearestIndex(self.graph)

    def _unround(self) -> None:
        """Back to double precision; what was measured is measured again when it is asked for."""
        finite = np.isfinite(self.values)
        self.values = self.values.astype(np.float64)
        if self.exact is None:
            self.values = np.where(
                finite, self.graph.costs_among(self.vertices, finite), np.inf
            )  # fmt: skip
        else:
            self._none_measured()


def squeezed(matrix: npt.NDArray[Any], keep: Bools) -> npt.NDArray[Any]:
    """The marked rows and columns of a square matrix, which is written over where most are left:
    two of them may be more than there is room for."""
    chosen = np.flatnonzero(keep)
    n = len(chosen)
    if 2 * n * n < matrix.size:
        return np.ascontiguousarray(matrix[np.ix_(chosen, chosen)])
    flat = matrix.reshape(-1)
    for to, row in enumerate(chosen.tolist()):
        flat[to * n : (to + 1) * n] = matrix[row, chosen]
    return flat[: n * n].reshape(n, n)

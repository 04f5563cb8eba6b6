"""Lower bounds from a series of covers, each with more sheets than the last.

A barrier is a number in the labels of vertices (`netsp.mip.parity_cuts`). Over goals alone a tour
may cross barriers an odd number of times. Over all classes, of which there are very many, the
relaxation first falls to the bound over goals before it rises. Between the two are covers of
finitely many sheets: a *cell* is a goal and, for each of some barriers, the parity with which
labels hold it. With no barrier the cells are the goals; with all barriers there are still far fewer
cells than classes. A leg between two cells costs no more than any leg between their classes
(`netsp.mip.cover_costs`), so every tour over classes is one over cells, no longer, and bounds over
cells hold for it.

From one cover to the next, cells split by one more barrier or two. A cut holds for any set of
vertices, so it holds for the vertices above it; the legs above a leg that is in no better tour are
in none either. So the program continues from its last state, its bound does not fall, and most of
the larger matrix is fixed out before it is examined. The order of the barriers makes all the
difference (`netsp.mip.cover_refinement`).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError, is_interrupt
from netsp.gtsp.cost_matrix import CostMatrix
from netsp.gtsp.cost_oracle import MatrixCosts
from netsp.gtsp.instance import Instance, Label
from netsp.gtsp.limits import Limits
from netsp.gtsp.resumable import Steps, run_to_end
from netsp.gtsp.searching import SearchingRun
from netsp.gtsp.solver_run import RunStopped
from netsp.mip.cover_bounds import CellBound, Cells
from netsp.mip.cover_costs import Covers
from netsp.mip.cover_refinement import CoverRefinement
from netsp.mip.cuts import Cut
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.mip_policy import MipPolicy
from netsp.mip.root import Root, tour_legs
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE

ParityTour = Sequence[tuple[int, Bools]]
"""Tour as goals, each with the mask of barriers of which its label holds an odd number."""

OnCover = Callable[[float, Cells, Ints], tuple[ParityTour, float] | None]
"""Callback after each cover, with the bound, the cells, and the cells that the LP's point visits.
Returns a better tour and its length to go on with, or None."""

RefineCosts = Callable[[CellBound, float], Covers]
"""Callback that returns the same covers with higher costs, given a bound over the cells of one, and
the length of the best tour."""


def refine_covers(
    covers: Covers,
    tour: ParityTour,
    length: float,
    limits: Limits,
    on_cover: OnCover = lambda *_: None,
    refine_costs: RefineCosts | None = None,
    policy: MipPolicy = MipPolicy(),
) -> CellBound | None:
    """Return a bound over the last of a series of covers; None if there is none for the first.

    The series ends when the tour is proven, no cover is left, or the time is up.

    Parameters
    ----------
    covers
        Covers of the problem.
    tour, length
        Best tour known.
    refine_costs
        Called after `CoverPolicy.coarse_covers` covers.
    """
    return run_to_end(cover_steps(covers, tour, length, limits, on_cover, refine_costs, policy))


def cover_steps(
    covers: Covers,
    tour: ParityTour,
    length: float,
    limits: Limits,
    on_cover: OnCover = lambda *_: None,
    refine_costs: RefineCosts | None = None,
    policy: MipPolicy = MipPolicy(),
) -> Steps[CellBound | None]:
    """Do what `refine_covers` does, with a step for each LP."""
    clock = Clock.from_limit(limits.time)
    series = _Series(covers, Limits(clock, rng=limits.rng), on_cover, refine_costs, policy)
    try:
        yield from series.steps(tour, length, clock)
    except (RunStopped, LimitReachedError):
        pass
    except (KeyboardInterrupt, SystemError) as error:
        if not is_interrupt(error):
            raise
        clock.end()  # also ends the run that this is a part of
    return series.found


class _Series:
    """Series of covers, and the bound over the last one that was solved."""

    def __init__(
        self,
        covers: Covers,
        limits: Limits,
        on_cover: OnCover,
        refine_costs: RefineCosts | None,
        policy: MipPolicy,
    ) -> None:
        self.covers, self.limits, self.policy = covers, limits, policy
        self.on_cover, self.refine_costs = on_cover, refine_costs
        self.found: CellBound | None = None

    def steps(self, tour: ParityTour, length: float, clock: Clock) -> Steps[None]:
        """Solve cover after cover, until the tour is proven or no cover is left."""
        refinement = CoverRefinement(self.covers, self.policy.covers)
        barriers: list[int] = []
        level: _Level | None = None
        for count in itertools.count(1):
            cells = self.covers.cells(tuple(barriers))
            costs = self.covers.costs(cells)
            level = _Level(cells, costs, tour, length, self.limits, level, self.policy)
            proven = yield from level.steps()
            if proven is not None:
                self.found = proven
                better = self.on_cover(proven.bound, proven.cells, level.visited_cells())
                # a tour no better than the cutoff may have dead legs
                if better is not None and better[1] < level.run.cutoff:
                    tour, length = better
            gap = length - (level.run.bound or 0.0)
            if level.is_over or clock.is_up or gap <= OPTIMALITY_TOLERANCE * length:
                return
            is_due = count == self.policy.covers.coarse_covers
            if self.refine_costs is not None and self.found is not None and is_due:
                # over the same barriers first, because cells have changed
                self.covers = refinement.covers = self.refine_costs(self.found, length)
                continue
            used_legs = level.used_legs()
            added = refinement.next_barriers(level.cells, *used_legs, gap, level.run.check)
            if not added:
                return
            barriers += added


class _Level:
    """Program over one cover.

    Attributes
    ----------
    cells, costs
        Cells of the cover, and costs between them.
    is_over
        Whether the best tour known is proven, or no time is left.
    """

    def __init__(
        self,
        cells: Cells,
        costs: Floats,
        tour: ParityTour,
        length: float,
        limits: Limits,
        below: _Level | None,
        policy: MipPolicy,
    ) -> None:
        from netsp.mip.highs import HighsRelaxation  # loads HiGHS

        self.is_over = False
        self.cells, self.costs = cells, costs
        cell_below, cuts, legs = self._lifted(below, costs)
        self.cell_tour = self.cells.cells_of(
            np.array([g for g, _ in tour]), np.array([odd for _, odd in tour])
        )
        cluster = self.cells.cluster
        graph = Instance(cluster, MatrixCosts(costs, cluster), _labels(self.cells))
        # a tour over cells may be no tour over classes, so only the latter become incumbents
        run = self.run = SearchingRun(graph, limits, policy=policy.gtsp)
        run.tour, run.length = tuple(self.cell_tour.tolist()), length
        if below is not None:
            run.bound = below.run.bound
        matrix = CostMatrix(graph, policy=policy.gtsp.costs)
        self.root = Root(run, matrix, HighsRelaxation, lambda *_: None, policy=policy)
        self.root.cover_patience = policy.covers.patience
        if below is not None:
            all_legs = np.vstack([legs, tour_legs(self.cell_tour)])
            all_legs = np.unique(np.sort(all_legs, axis=1), axis=0)
            all_legs = all_legs[np.isfinite(costs[all_legs[:, 0], all_legs[:, 1]])]
            leg_costs = self.root.costs.costs_of(all_legs)
            self.root.lp = HighsRelaxation(cluster, all_legs, leg_costs, policy)
            self.root.lp.add_cuts([replace(c, inside=c.inside[cell_below]) for c in cuts])

    def steps(self) -> Steps[CellBound | None]:
        """Solve until there is nothing to add or progress stalls, and return the bound."""
        try:
            yield from self.root.steps()
        except RunStopped:
            self.is_over = True
        self.is_over |= self.run.is_done
        root, m = self.root, len(self.cells.cluster)
        if root.best is None:
            return None
        best, at = root.best, root.costs.vertices
        alive = np.zeros(m, dtype=bool)
        alive[at] = True
        alive[self.cell_tour] = True
        degree = np.zeros(m)
        degree[best.vertices] = best.duals.degree
        cuts = tuple(replace(c, inside=_spread(c.inside, best.vertices, m)) for c in best.cuts)
        duals = replace(best.duals, degree=degree)
        bound = float(self.run.bound or 0.0)
        return CellBound(bound, self.cells, self.costs, alive, self._dead(), cuts, duals)

    def used_legs(self) -> tuple[Ints, Floats]:
        """Return the legs (k, 2) that the point uses, and their values (k,)."""
        point = self.root.point or self.root._solve_lp()
        is_used = point.y > 1e-6
        return self.root.costs.vertices[point.legs[is_used]], point.y[is_used]

    def visited_cells(self) -> Ints:
        """Return the cells that the point visits; none if there is no point."""
        point = self.root.point
        if point is None:
            return np.zeros(0, dtype=np.int64)
        return self.root.costs.vertices[point.x > 1e-6]

    def _dead(self) -> Bools:
        """Return the mask (m, m) of legs in no better tour, without those of the incumbent."""
        m, at = len(self.cells.cluster), self.root.costs.vertices
        out = np.ones((m, m), dtype=bool)
        assert isinstance(self.root.dead, DeadLegs)
        out[np.ix_(at, at)] = self.root.dead.matrix()
        legs = tour_legs(self.cell_tour)
        out[legs[:, 0], legs[:, 1]] = out[legs[:, 1], legs[:, 0]] = False
        return out

    def _lifted(self, below: _Level | None, costs: Floats) -> tuple[Ints, list[Cut], Ints]:
        """Return the cell below each cell, and the cuts and legs that the cover below leads to.

        The legs are, from each cell, the cheapest above each leg of the program below. The costs of
        legs above dead ones are set to infinity.
        """
        m = len(self.cells.cluster)
        if below is None:
            return np.arange(m), [], np.zeros((0, 2), dtype=np.int64)
        cell_below = self.cells.cells_below(below.cells)
        costs[below._dead()[np.ix_(cell_below, cell_below)]] = np.inf
        root, size = below.root, len(below.cells.cluster)
        at = root.costs.vertices
        cuts = [replace(c, inside=_spread(c.inside, at, size)) for c in root.lp.cuts]
        above: list[list[int]] = [[] for _ in range(size)]
        for k, j in enumerate(cell_below.tolist()):
            above[j].append(k)
        legs = []
        for a, b in at[root.lp.legs].tolist():
            if not (above[a] and above[b]):
                continue  # no class there has a leg left
            block = costs[np.ix_(above[a], above[b])]
            legs += [(above[a][i], above[b][int(j)]) for i, j in enumerate(block.argmin(axis=1))]
            legs += [(above[a][int(i)], above[b][j]) for j, i in enumerate(block.argmin(axis=0))]
        return cell_below, cuts, np.array(legs, dtype=np.int64).reshape(-1, 2)


def _spread(flags: Bools, at: Ints, size: int) -> Bools:
    """Return a mask of a given size with flags at some places."""
    out = np.zeros(size, dtype=bool)
    out[at] = flags
    return out


def _labels(cells: Cells) -> list[Label]:
    """Return a label for each cell: the barriers on whose odd side it is."""
    return [
        tuple(i + 1 for j, i in enumerate(cells.barriers) if code >> j & 1)
        for code in cells.code.tolist()
    ]

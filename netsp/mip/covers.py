"""A bound up a tower of covers, each with twice the sheets of the one below, or more.

Over goals alone a tour may go around obstacles; over all classes there are too many of them, and
the relaxation falls to the bound over goals before it rises. In between are covers of finitely many
sheets: a *cell* is a goal, and of which of some obstacles the tether's word has an odd number of
letters. The cells of no obstacle are the goals; with all of them there are still far fewer cells
than classes. A leg between two cells costs no more than any between their classes
(`netsp.mip.cover_costs`), so that every tour over classes is one over cells, no longer: what bounds
these bounds those.

From one cover to the next a cell falls into those of another obstacle or two. A cut holds for any
set of vertices, so it holds for all that lies above one; a leg that is in no better tour has none
above it in one. So the program goes on where it stood, its bound does not fall, and most of the
larger matrix is dead before it is looked at. Which obstacles come first makes all the difference
(`netsp.mip.cover_refinement`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError, interrupted
from netsp.gtsp.cost_matrix import CostMatrix
from netsp.gtsp.limits import Limits
from netsp.gtsp.searching import SearchingRun
from netsp.gtsp.solver_run import RunStopped
from netsp.gtsp.travel.costs import CostTable
from netsp.gtsp.travel.graph import TravelGraph
from netsp.mip.cover_bounds import CellBound, Cells
from netsp.mip.cover_costs import Covers
from netsp.mip.cover_refinement import CoverRefinement
from netsp.mip.cuts import Cut
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.root import Root, tour_legs
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE

GROWTH = 1.3
"""A cover has at most so many times as many cells as the one below, unless an obstacle alone adds
more."""

COARSE = 3
"""After so many covers of ways those of classes follow."""

MOST_CELLS = 6000
"""Larger covers are not looked at."""

PATIENCE = 4
"""Looks at the prices that closed hardly anything of the gap, after which the next cover is
tried."""

ParityTour = Sequence[tuple[int, Bools]]
"""A tour: goals, and of which obstacles each word has an odd number of letters."""

OnBound = Callable[[float, Cells, Ints], tuple[ParityTour, float] | None]
"""Hears, after each cover, the bound, its cells, and which of them the program's point visits; may
give a better tour, with its length, to go on with."""


RefineCosts = Callable[[CellBound, float], Covers]
"""The same covers with dearer legs, given what is proven over the cells of one, and the length of
the best tour."""


def refine_covers(
    tower: Covers, tour: ParityTour, length: float, clock: Clock, limits: Limits,
    told: OnBound = lambda *_: None, finer: RefineCosts | None = None,
) -> CellBound | None:  # fmt: skip
    """Bound tours cover by cover, until they are proven, there are no more covers or time is up;
    None if there was none for the first.

    Parameters
    ----------
    tour
        The best one known.
    length
        Of that.
    told
        See `OnBound`.
    finer
        Gives another tower to go on with after `COARSE` covers.
    """
    found: CellBound | None = None
    obstacles: list[int] = []
    before: _Level | None = None
    covers = 0
    splits = CoverRefinement(tower, GROWTH, MOST_CELLS)
    try:
        while True:
            level = _Level(tower, tuple(obstacles), tour, length, clock, limits, before)
            proven = level.solve()
            if proven is not None:
                found = proven
                better = told(found.bound, found.cells, level.visited())
                # a tour no better than what the legs were ruled out by may have dead ones
                if better is not None and better[1] < level.run.cutoff:
                    tour, length = better
            gap = length - (level.run.bound or 0.0)
            if level.over or clock.is_up or gap <= OPTIMALITY_TOLERANCE * length:
                break
            before, covers = level, covers + 1
            if finer is not None and found is not None and covers == COARSE:
                # over the same obstacles first: what they tell apart has changed
                tower = splits.tower = finer(found, length)
                continue
            more = splits.after(level.cells, *level.used(), gap, level.run.check)
            if not more:
                break
            obstacles += more
    except (RunStopped, LimitReachedError):
        pass
    except (KeyboardInterrupt, SystemError) as error:
        if not interrupted(error):
            raise
        clock.end()  # for what this is a part of, too
    return found


class _Level:
    """The program over one cover.

    Attributes
    ----------
    cells
        Its vertices.
    costs
        Of the legs between them.
    over
        Whether the best tour known is proven, or no time is left.
    """

    def __init__(
        self, tower: Covers, obstacles: tuple[int, ...], tour: ParityTour,
        length: float, clock: Clock, limits: Limits, before: _Level | None,
    ) -> None:  # fmt: skip
        from netsp.mip.highs import HighsRelaxation  # loads HiGHS

        self.over = False
        self.cells = tower.cells(obstacles)
        costs = self.costs = tower.costs(self.cells)
        own, cuts, legs = self._from(before, costs)
        self.cell_tour = self.cells.of(
            np.array([g for g, _ in tour]), np.array([odd for _, odd in tour])
        )
        cluster = self.cells.cluster
        graph = TravelGraph(
            cluster, _words(self.cells), np.zeros(len(cluster)), CostTable(costs, cluster)
        )
        # its tours are none: the incumbent is one over classes
        run = self.run = SearchingRun(graph, Limits(clock, rng=limits.rng))
        run.tour, run.length = tuple(self.cell_tour.tolist()), length
        if before is not None:
            run.bound = before.run.bound
        self.root = Root(run, CostMatrix(graph), HighsRelaxation, lambda *_: None)
        self.root.patience = PATIENCE
        if before is not None:
            all_legs = np.vstack([legs, tour_legs(self.cell_tour)])
            all_legs = np.unique(np.sort(all_legs, axis=1), axis=0)
            all_legs = all_legs[np.isfinite(costs[all_legs[:, 0], all_legs[:, 1]])]
            self.root.lp = HighsRelaxation(cluster, all_legs, self.root.costs.costs_of(all_legs))
            self.root.lp.add_cuts([replace(c, inside=c.inside[own]) for c in cuts])

    def solve(self) -> CellBound | None:
        """Until there is nothing to add or progress stalls; what it has proven."""
        try:
            self.root.solve()
        except RunStopped:
            self.over = True
        self.over |= self.run.is_done
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
        return CellBound(
            float(self.run.bound or 0.0), self.cells, self.costs, alive, self._dead(),
            cuts, replace(best.duals, degree=degree),
        )  # fmt: skip

    def used(self) -> tuple[Ints, Floats]:
        """(k, 2) legs that the point uses, and (k,) how much."""
        point = self.root.point or self.root._solve_lp()
        on = point.y > 1e-6
        return self.root.costs.vertices[point.legs[on]], point.y[on]

    def visited(self) -> Ints:
        """The cells that the point visits; none if there is none."""
        point = self.root.point
        if point is None:
            return np.zeros(0, dtype=np.int64)
        return self.root.costs.vertices[point.x > 1e-6]

    def _dead(self) -> Bools:
        """(m, m) legs in no better tour; those of the best one known are left."""
        m, at = len(self.cells.cluster), self.root.costs.vertices
        out = np.ones((m, m), dtype=bool)
        assert isinstance(self.root.dead, DeadLegs)
        out[np.ix_(at, at)] = self.root.dead.matrix()
        legs = tour_legs(self.cell_tour)
        out[legs[:, 0], legs[:, 1]] = out[legs[:, 1], legs[:, 0]] = False
        return out

    def _from(self, before: _Level | None, costs: Floats) -> tuple[Ints, list[Cut], Ints]:
        """Of the cover below: the cell that each lies in, cuts, and the legs above those of its
        program, from each cell the cheapest. Costs of legs above dead ones become infinite."""
        m = len(self.cells.cluster)
        if before is None:
            return np.arange(m), [], np.zeros((0, 2), dtype=np.int64)
        own = self.cells.above(before.cells)
        costs[before._dead()[np.ix_(own, own)]] = np.inf
        root, size = before.root, len(before.cells.cluster)
        at = root.costs.vertices
        cuts = [replace(c, inside=_spread(c.inside, at, size)) for c in root.lp.cuts]
        above: list[list[int]] = [[] for _ in range(size)]
        for k, j in enumerate(own.tolist()):
            above[j].append(k)
        legs = []
        for a, b in at[root.lp.legs].tolist():
            if not (above[a] and above[b]):
                continue  # no leg of any class there is left
            block = costs[np.ix_(above[a], above[b])]
            legs += [(above[a][i], above[b][int(j)]) for i, j in enumerate(block.argmin(axis=1))]
            legs += [(above[a][int(i)], above[b][j]) for j, i in enumerate(block.argmin(axis=0))]
        return own, cuts, np.array(legs, dtype=np.int64).reshape(-1, 2)


def _spread(flags: Bools, at: Ints, size: int) -> Bools:
    out = np.zeros(size, dtype=bool)
    out[at] = flags
    return out


def _words(cells: Cells) -> list[tuple[int, ...]]:
    """A word for each cell: a letter of each obstacle that counts."""
    return [
        tuple(i + 1 for j, i in enumerate(cells.obstacles) if code >> j & 1)
        for code in cells.code.tolist()
    ]

"""The root: the relaxation, solved with cuts from a fractional point and legs from their prices.

Every round yields a bound that holds whatever the solver's tolerances
(`netsp.mip.lagrangian_bound`), and with an incumbent every bound rules out legs and vertices: those
that cost more than what is missing. What is ruled out is forgotten, so the rounds get cheaper as
the proof gets closer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.gtsp.cost_matrix import LEGS, CostMatrix
from netsp.gtsp.searching import SearchingRun
from netsp.gtsp.solver_run import RunStopped
from netsp.gtsp.sparse_costs import SparseCosts
from netsp.mip.blossoms import blossom_cuts, cluster_flows
from netsp.mip.combs import comb_cuts, tight_sets
from netsp.mip.cover_bounds import GoalBound
from netsp.mip.cuts import Cut
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.lp_warm_start import WarmStart
from netsp.mip.parity_cuts import odd_letters, parity_cuts
from netsp.mip.prices import Prices
from netsp.mip.pricing_schedule import WORTH, PricingSchedule
from netsp.mip.program import Duals, Point, Relaxation
from netsp.mip.subtours import cover_branches, fractional_cuts

NEAREST = 4
"""Legs per vertex in the first LP."""

PRICED_PER_VERTEX, MOST_PRICED = 3, 3000
"""Most legs per vertex, and in all, that one pricing round brings in."""

MIX = 0.6
"""Cuts are first sought between the LP's point and the incumbent: those found there go deeper
(in-out separation, Ben-Ameur & Neto 2007)."""

SHRINK = 0.85
"""Vertices are forgotten when no more than this share of them is left."""

LEAN = 0.3
"""Dead legs leave the LP when they are more than this share of it."""

MANY, LEAN_EVERY, DEAR = 2000, 4, 0.01
"""With more vertices than the first, every so many looks those legs leave the LP whose reduced cost
is more than the last share of the incumbent: there the first prices bring in far more than stays of
use, and LPs take all the time."""

SETTLE, SETTLED = 0.3, 0.1
"""Where the LP is so far above the bound, as a share of the gap, cuts wait until the prices of all
legs leave it no farther than the second share."""

PRICINGS = 4
"""Times that legs are sought whose measured length has a negative price, before cuts are."""

FAR = 1.5
"""What a look with a bound that is so many times farther from the incumbent than the best one would
rule out is not worth its time."""

MEASURED_AT = 1_000_000
"""So few legs are left to be measured that it takes a second or two: what bounds of them miss, the
bound of all tours misses."""

USED = 0.05
"""Legs that a point uses that much are measured."""

PATIENCE, MEASURED_PATIENCE = 15, 60
"""On bounds of legs, the root ends when so many looks at the prices closed hardly anything of
the gap; on measured legs it has more patience, for nothing but branching comes after it."""

HARDLY, RISEN = 0.002, 1e-6
"""A look that brings a smaller share of legs than the first is idle, unless it closes the gap; the
bound has risen if by more than the second share."""

TINY = 1e-9
"""Relative: reduced costs and visits smaller than this are rounding."""


@dataclass(frozen=True)
class Best:
    """What the best bound rests on: vertices that were left, cuts, and dual values."""

    vertices: Ints
    cuts: tuple[Cut, ...]
    duals: Duals


class Root:
    """The relaxation over what is left of a travel graph.

    Attributes
    ----------
    costs
        Of the legs among the vertices left.
    lp
        The relaxation.
    dead
        Legs in no better tour.
    patience
        As `PATIENCE`, where that is not to be used.
    best
        What the best bound rests on; None before there is one.
    """

    def __init__(
        self,
        run: SearchingRun,
        costs: CostMatrix,
        relaxation: Callable[[Ints, Ints, Floats], Relaxation],
        round_point: Callable[[Root, Point], None],
        warm: WarmStart | None = None,
        over_goals: GoalBound | None = None,
    ) -> None:
        self.run, self.costs, self.round_point = run, costs, round_point
        graph = costs.graph
        words = [graph.signatures[v] for v in costs.vertices]
        self.branch, self.odd = cover_branches(words), odd_letters(words)
        self.dead = self._left()
        self.patience: int | None = None
        self.best: Best | None = None
        goals_cuts = [] if over_goals is None else self._rule_out_over(over_goals)
        # without an incumbent, a program with some of the legs may be infeasible when a tour exists
        usable = run.tour is not None and warm and np.isin(warm.vertices, costs.vertices).all()
        warm = warm if usable else None
        legs = self._first_legs() if warm is None else self._warm_legs(warm)
        if graph.quick_legs:
            costs.measure_legs(legs)
        self.lp = relaxation(costs.cluster, legs, costs.costs_of(legs))
        if warm is not None:
            self.lp.add_cuts(warm.lifted_cuts(costs))
        # with these, and those of pairs that `goal_cuts` finds, the LP does not fall below the
        # goals' own, whatever the classes
        self.lp.add_cuts(goals_cuts, for_good=True)
        self.point: Point | None = None
        self._objective, self._reached = 0.0, 0.0

    # the incumbent among the vertices left

    def tour(self) -> Ints:
        """Rows of the incumbent; empty if there is none."""
        if self.run.tour is None:
            return np.zeros(0, dtype=np.int64)
        return np.searchsorted(self.costs.vertices, np.array(self.run.tour))

    # the loop

    def solve(self) -> None:
        """Rounds of LP, pricing, elimination and separation, until there is nothing to add or
        progress stalls."""
        run, pace, settling = self.run, PricingSchedule(), False
        while not run.is_done:
            point = self._solve_lp()
            if not (settling or pace.is_due):
                pace.rounds += 1
                cuts = self.separate(point)
                if cuts:
                    self.purge(point, risen=False)
                    self.lp.add_cuts(cuts)
                    continue
            priced, risen = self._look(point, pace, lean=not settling)
            if self.point is not None:
                self.round_point(self, point)
            run.report("root", **self.size())
            if run.is_done:
                return
            if self.point is None or self._missing_tour_legs():
                continue  # vertices were forgotten, or a new incumbent came with legs of its own
            settling = priced and self._pricing_dominates(point, SETTLED if settling else SETTLE)
            if settling:
                continue
            cuts = self.separate(point)
            patience = PATIENCE if self.costs.exact is not None else MEASURED_PATIENCE
            patience = patience if self.patience is None else self.patience
            # over what is new to it a cover has to come back to the bound of the one below first
            reached = (run.bound or 0.0) if self.patience is None else self._reached
            stalled = pace.stalled(run.length - reached, patience)
            if not priced and (stalled or not cuts):
                return
            self.purge(point, risen=risen)
            self.lp.add_cuts(cuts)

    def _solve_lp(self) -> Point:
        """The next point of the LP; Stop when there is none."""
        run = self.run
        run.check()
        point = self.lp.solve(run.clock)
        run.iterations += 1
        if point is None:
            # without an incumbent all legs are in the program from the start
            run.is_infeasible = self.lp.infeasible and run.tour is None
            raise RunStopped
        self.point = point
        return point

    def _pricing_dominates(self, point: Point, share: float) -> bool:
        """Whether prices alone would close that share of the gap: with thousands of classes it is
        long until no cut is found, and until then there would be no bound, nor anything to rule
        out."""
        bound = self.run.bound or 0.0
        much = point.objective - bound > share * (self.run.length - bound)
        return much and len(self.costs) > MANY

    def _look(self, point: Point, pace: PricingSchedule, *, lean: bool) -> tuple[bool, bool]:
        """Look at the prices of all legs; whether any came into the LP, and whether the bound has
        risen, or the LP's optimum since the last look."""
        run = self.run
        before, legs = run.bound or 0.0, len(self.lp.legs)
        priced = self._price(point, lean=lean and pace.looks % LEAN_EVERY == 0)
        risen = (run.bound or 0.0) - before
        self._objective, last = point.objective, self._objective
        # where vertices were forgotten the legs are counted anew
        brought = len(self.lp.legs) - legs if self.point is not None else legs
        pace.note_pass(idle=brought < HARDLY * legs and risen < WORTH * (run.length - before))
        climbs = point.objective > last * (1.0 + RISEN)
        return priced, climbs or risen > RISEN * abs(before)

    def measure(self) -> None:
        """Measure all legs that are not ruled out."""
        assert isinstance(self.dead, DeadLegs)  # what rows hold has been measured
        self.costs.measure_all(~self.dead.matrix())
        legs = self.lp.legs
        self.lp.set_costs(self.costs.costs_of(legs))

    def size(self) -> dict[str, int]:
        """For the report."""
        return {
            "cuts": len(self.lp.cuts),
            "legs": self.dead.left,
            "vertices": len(self.costs),
        }

    # parts

    def _rule_out_over(self, over: GoalBound) -> list[Cut]:
        """What a program over goals or cells has proven, taken over: most of what lies far from the
        base is in no better tour. Its cuts; of those of covers the ones that have a price, for with
        all of them linear programs take half as long again."""
        run, costs = self.run, self.costs
        found = over.cells
        if found is None:
            return [replace(c, inside=c.inside[costs.cluster]) for c in over.cuts]
        own = found.cells.of(costs.cluster, self.odd)
        if run.tour is not None:
            alive: Bools = (own >= 0) & found.alive[own]
            alive[self.tour()] = True
            if not alive.all():
                self._restrict(alive)
                own = own[alive]
            tour = tour_legs(self.tour())
            self.dead.add_above(own, found.dead)
            if isinstance(self.dead, DeadLegs):
                self.dead.revive(tour[np.isfinite(costs.values[tour[:, 0], tour[:, 1]])])
        cuts, duals = found.lifted_cuts(own), found.lifted_duals(own)
        if run.tour is not None:
            prices = Prices(costs.values, self.dead, costs.cluster, cuts, duals, run.check)
            run.raise_bound(min(prices.bound, run.cutoff))
            if not run.is_done:
                prices.rule_out(run.cutoff)
        return [c for c, price in zip(cuts, duals.cut.tolist(), strict=True) if price < 0.0]

    def _left(self) -> DeadLegs | SparseCosts:
        rows = self.costs.rows
        return DeadLegs.of(self.costs.values) if rows is None else rows

    def _with_costs(self, legs: Ints) -> Ints:
        """Of legs those that there are, and the incumbent's whatever has been let go of."""
        if isinstance(self.dead, SparseCosts):
            gone = self.dead[legs[:, 0], legs[:, 1]]
            return legs[~gone | np.isin(self._keys(legs), self._keys(tour_legs(self.tour())))]
        return np.asarray(legs[np.isfinite(self.costs.costs_of(legs))])

    def _first_legs(self) -> Ints:
        """The nearest legs of every vertex, all legs to the base, and the incumbent's; all legs if
        there is no incumbent, so that an infeasible program means that there is no tour."""
        if self.run.tour is None:
            return np.argwhere(np.triu(np.isfinite(self.costs.values), 1))
        others = np.arange(1, len(self.costs))
        pairs = np.vstack(
            [
                self.costs.nearest_legs(NEAREST),
                np.column_stack([np.zeros_like(others), others]),
                tour_legs(self.tour()),
            ]
        )
        legs = np.unique(np.sort(pairs, axis=1), axis=0)
        return self._with_costs(legs)

    def _warm_legs(self, warm: WarmStart) -> Ints:
        """The legs of a program over some of the vertices, and the incumbent's."""
        legs = np.vstack([np.sort(warm.legs_over(self.costs), axis=1), tour_legs(self.tour())])
        return self._with_costs(np.unique(legs, axis=0))

    def _missing_tour_legs(self) -> bool:
        """Bring the incumbent's legs into the LP; whether any was missing."""
        tour = tour_legs(self.tour())
        new = tour[~np.isin(self._keys(tour), self._keys(self.lp.legs))]
        if len(new):
            self.lp.add_legs(new, self.costs.costs_of(new))
        return len(new) > 0

    def _keys(self, legs: Ints) -> Ints:
        """One number for each leg."""
        return np.asarray(legs[:, 0] * len(self.costs) + legs[:, 1])

    def _price(self, point: Point, *, lean: bool) -> bool:
        """Raise the bound, eliminate, bring in legs of negative reduced cost; whether any came."""
        run, cluster = self.run, self.costs.cluster
        assert point.duals is not None
        prices = Prices(self.costs.values, self.dead, cluster, self.lp.cuts, point.duals, run.check)
        # a tour with a dead leg is no shorter than the cutoff
        if self.best is None or prices.bound > (run.bound or 0.0):
            self.best = Best(self.costs.vertices.copy(), tuple(self.lp.cuts), point.duals)
        self._reached = max(self._reached, prices.bound)
        run.raise_bound(min(prices.bound, run.cutoff))
        if run.is_done:
            return False
        missing = run.cutoff - (run.bound or 0.0)
        longer = False
        if run.cutoff - prices.bound < FAR * missing:
            prices.rule_out(run.cutoff)
            longer = self._measure_left()
        scale = run.length if run.tour is not None else float(self.costs.base_costs[1:].max())
        new, found_longer = self._columns_to_add(prices, TINY * scale)
        if len(new):
            self.lp.add_legs(new, self.costs.costs_of(new))
        longer |= found_longer | self._measure_used(point)
        if lean and len(self.costs) > MANY:
            self._drop_expensive_legs(prices.of(self.lp.legs), point)
        self._forget()
        return len(new) > 0 or longer

    def _measure_left(self) -> bool:
        """Measure all legs that are left, once they are few; whether there were any. Those in the
        LP have been measured before."""
        exact = self.costs.exact
        if exact is None or not self.costs.graph.quick_legs:
            return False
        assert isinstance(self.dead, DeadLegs)
        left = ~(self.dead.matrix() | exact)
        if np.count_nonzero(left) > 2 * MEASURED_AT:
            return False
        u, v = np.nonzero(left)
        legs = np.column_stack([u[u < v], v[u < v]])
        for first in range(0, len(legs), LEGS):
            self.run.check()
            self.costs.measure_legs(legs[first : first + LEGS])
        return len(legs) > 0

    def _measure_used(self, point: Point) -> bool:
        """Measure the legs that the point uses and that are only bounded; whether there were any.
        What is missing in these bounds is missing in the LP's."""
        if not self.costs.measure_legs(point.legs[point.y > USED]):
            return False
        legs = self.lp.legs
        self.lp.set_costs(self.costs.costs_of(legs))
        return True

    def _drop_expensive_legs(self, price: Floats, point: Point) -> None:
        """Take the legs out of the LP that are far from being used; pricing brings them back if
        need be."""
        dear = price > DEAR * self.run.length
        old = len(point.y)
        dear[old:] = False
        dear[:old] &= point.y <= TINY
        dear &= ~np.isin(self._keys(self.lp.legs), self._keys(tour_legs(self.tour())))
        if dear.sum() > LEAN * len(dear):
            self.lp.keep_legs(~dear)

    def _columns_to_add(self, prices: Prices, tolerance: float) -> tuple[Ints, bool]:
        """The legs to bring into the LP, those of most negative reduced cost first, a few of each
        vertex; and whether any leg was longer than its bound. Where legs are quickly measured,
        those that would come in are, first: else the LP fills with legs that are none."""
        longer = False
        for _ in range(PRICINGS):
            legs, price = prices.cheapest(tolerance)
            missing = ~np.isin(self._keys(legs), self._keys(self.lp.legs))
            legs, price = legs[missing], price[missing]
            if self.costs.graph.quick_legs and self.costs.measure_legs(legs):
                longer, price = True, prices.of(legs)
            negative = price < -tolerance
            new = self._few_per_vertex(legs[negative], price[negative])
            if len(new) or not len(legs):
                break
        return new, longer

    def _few_per_vertex(self, legs: Ints, price: Floats) -> Ints:
        """Of legs (k, 2) with their prices the cheapest, a few of each vertex."""
        taken = np.zeros(len(self.costs), dtype=np.int64)
        chosen = []
        for u, v in legs[np.argsort(price, kind="stable")].tolist():
            if taken[u] < PRICED_PER_VERTEX or taken[v] < PRICED_PER_VERTEX:
                chosen.append((u, v))
                taken[u] += 1
                taken[v] += 1
                if len(chosen) == MOST_PRICED:
                    break
        return np.array(chosen, dtype=np.int64).reshape(-1, 2)

    def _forget(self) -> None:
        """Drop dead legs from the LP, and dead vertices altogether once they are many."""
        tour, legs = self.tour(), self.lp.legs
        keep = ~self.dead[legs[:, 0], legs[:, 1]]
        keep |= np.isin(self._keys(legs), self._keys(tour_legs(tour)))
        if (~keep).sum() > LEAN * len(keep):
            self.lp.keep_legs(keep)
        alive = self._alive()
        if alive.sum() > SHRINK * len(alive):
            return
        self.lp.keep_legs(np.asarray(alive[self.lp.legs].all(axis=1)))
        self._restrict(alive)
        self.lp.restrict(alive)
        self.point = None

    def _alive(self) -> Bools:
        """(V,) vertices with legs left, and those of the incumbent."""
        alive = self.dead.with_legs()
        alive[0] = alive[self.tour()] = True
        return alive

    def _restrict(self, alive: Bools) -> None:
        """Forget all vertices but those marked, here and in the costs."""
        self.costs.restrict(alive)
        if isinstance(self.dead, DeadLegs):
            self.dead.restrict(alive)
        else:
            self.dead = self._left()
        self.branch, self.odd = self.branch[:, alive], self.odd[alive]
        self.branch = np.unique(self.branch[self.branch.sum(axis=1) > 1], axis=0)

    def separate(self, point: Point) -> list[Cut]:
        """Violated cuts, of the LP's point or of one between it and the incumbent."""
        cluster = self.costs.cluster
        tour = tour_legs(self.tour())
        # visited by the point or by the incumbent
        visited = np.union1d(np.flatnonzero(point.x > TINY), self.tour())
        near = visited[self.costs.nearest_among(visited)]
        near[visited] = visited
        if len(tour):
            y = (1.0 - MIX) * point.y
            y[np.isin(self._keys(point.legs), self._keys(tour))] += MIX
            x = (1.0 - MIX) * point.x
            x[self.tour()] += MIX
            cuts = fractional_cuts(x, point.legs, y, cluster, self.branch, near)
            if cuts:
                return cuts
        cuts = fractional_cuts(point.x, point.legs, point.y, cluster, self.branch, near)
        if cuts:
            return cuts
        cuts = parity_cuts(point.legs, point.y, cluster, self.odd, self.run.check)
        if cuts:
            return cuts
        between = cluster_flows(point.legs, point.y, cluster)
        tight = tight_sets(self.lp.cuts, point, between, cluster)
        return blossom_cuts(between, cluster) + comb_cuts(between, tight, cluster)

    def purge(self, point: Point, *, risen: bool) -> None:
        """Count how long cuts have done nothing, and take the idle ones out of the LP, but only
        when the bound has risen: on a plateau they would only come back."""
        assert point.slack is not None
        assert point.duals is not None
        self.lp.pool.count(point.duals.cut, point.slack)
        active = self.lp.pool.active() if risen else None
        if active is not None:
            self.lp.keep_cuts(active)


def tour_legs(tour: Sequence[int] | Ints) -> Ints:
    """(k, 2) legs u < v of a closed tour."""
    t = np.asarray(tour, dtype=np.int64)
    if len(t) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    return np.sort(np.column_stack([t, np.roll(t, -1)]), axis=1)

"""Root node: the relaxation, solved by cutting planes and column generation.

Every pricing pass yields a bound that holds whatever the solver's tolerances
(`netsp.mip.lagrangian_bound`). With an incumbent, every bound fixes out legs and vertices whose
reduced cost exceeds the gap. They are removed, so that rounds get cheaper as the gap closes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.gtsp.cost_matrix import CostMatrix
from netsp.gtsp.resumable import Steps
from netsp.gtsp.searching import SearchingRun
from netsp.gtsp.solver_run import RunStopped
from netsp.gtsp.sparse_costs import SparseCosts
from netsp.mip.blossoms import blossom_cuts, cluster_flows
from netsp.mip.combs import comb_cuts, tight_sets
from netsp.mip.cover_bounds import GoalBound
from netsp.mip.cuts import Cut
from netsp.mip.deadlegs import DeadLegs
from netsp.mip.lp_warm_start import WarmStart
from netsp.mip.mip_policy import MipPolicy
from netsp.mip.parity_cuts import odd_numbers, parity_cuts
from netsp.mip.prices import Prices
from netsp.mip.pricing_schedule import PricingSchedule
from netsp.mip.program import Duals, Point, Relaxation
from netsp.mip.subtours import fractional_cuts, label_families

ROUNDING_TOLERANCE = 1e-9
"""Tolerance, relative, below which reduced costs and visits count as zero."""


@dataclass(frozen=True)
class BoundProof:
    """Data that a bound follows from: the vertices left, cuts over them, and dual values."""

    vertices: Ints
    cuts: tuple[Cut, ...]
    duals: Duals


class Root:
    """Relaxation over the vertices and legs of a travel graph that are left.

    Attributes
    ----------
    costs
        Costs of the legs among the vertices left.
    lp
        The relaxation.
    dead
        Legs that are in no better tour.
    cover_patience
        Pricing passes without progress after which the root of a cover ends; None for the root over
        all classes, which has the patience of its policy.
    best
        Proof of the best bound; None before there is one.
    """

    def __init__(
        self,
        run: SearchingRun,
        costs: CostMatrix,
        relaxation: Callable[[Ints, Ints, Floats, MipPolicy], Relaxation],
        round_point: Callable[[Root, Point], None],
        warm: WarmStart | None = None,
        goal_bound: GoalBound | None = None,
        policy: MipPolicy = MipPolicy(),
    ) -> None:
        self.run, self.costs, self.round_point, self.policy = run, costs, round_point, policy
        graph = costs.graph
        labels = [graph.labels[v] for v in costs.vertices]
        self.branch, self.odd = label_families(labels), odd_numbers(labels)
        self.dead = self._dead_legs()
        self.cover_patience: int | None = None
        self.best: BoundProof | None = None
        goal_cuts = [] if goal_bound is None else self._adopt(goal_bound)
        # without an incumbent, a program with some of the legs may be infeasible when a tour exists
        is_usable = run.tour is not None and warm and np.isin(warm.vertices, costs.vertices).all()
        warm = warm if is_usable else None
        legs = self._first_legs() if warm is None else self._warm_legs(warm)
        if costs.measures_single_legs:
            costs.measure_legs(legs)
        self.lp = relaxation(costs.cluster, legs, costs.costs_of(legs), policy)
        if warm is not None:
            self.lp.add_cuts(warm.lifted_cuts(costs))
        # with the goals' cuts, and the cuts of pairs that `subtours.goal_cuts` finds, the LP's
        # optimum is no lower than the optimum over goals, whatever the classes
        self.lp.add_cuts(goal_cuts, permanent=True)
        self.point: Point | None = None
        self._objective, self._reached = 0.0, 0.0

    def tour(self) -> Ints:
        """Return the rows of the incumbent; none if there is none."""
        if self.run.tour is None:
            return np.zeros(0, dtype=np.int64)
        return np.searchsorted(self.costs.vertices, np.array(self.run.tour))

    def steps(self) -> Steps[None]:
        """Solve, price, fix out and separate until there is nothing to add or progress stalls.

        Each LP is a step.
        """
        run, policy, is_settling = self.run, self.policy.schedule, False
        schedule = PricingSchedule(policy)
        while not run.is_done:
            yield
            point = self._solve_lp()
            if not (is_settling or schedule.is_due):
                schedule.rounds += 1
                cuts = self.separate(point)
                if cuts:
                    self.purge(point, bound_has_risen=False)
                    self.lp.add_cuts(cuts)
                    continue
            priced, risen = self._price_all(point, schedule, drops=not is_settling)
            if self.point is not None:
                self.round_point(self, point)
            run.report("root", **self.size())
            if run.is_done:
                return
            if self.point is None or self._add_missing_tour_legs():
                continue  # vertices were removed, or a new incumbent brought legs into the LP
            share = policy.settled_share if is_settling else policy.settle_share
            is_settling = priced and self._pricing_dominates(point, share)
            if is_settling:
                continue
            cuts = self.separate(point)
            has_stalled = self._has_stalled(schedule)
            if not priced and (has_stalled or not cuts):
                return
            self.purge(point, bound_has_risen=risen)
            self.lp.add_cuts(cuts)

    def _has_stalled(self, schedule: PricingSchedule) -> bool:
        """Return whether the last pricing passes closed hardly anything of the gap."""
        if self.cover_patience is None:
            reached, policy = self.run.bound or 0.0, self.policy.schedule
            is_estimated = self.costs.exact is not None
            patience = policy.estimated_patience if is_estimated else policy.patience
        else:
            # a cover first has to come back to the bound of the cover below
            reached, patience = self._reached, self.cover_patience
        return schedule.has_stalled(self.run.length - reached, patience)

    def _solve_lp(self) -> Point:
        """Return the next point of the LP; raise RunStopped if there is none."""
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
        """Return whether pricing alone would close a share of the gap, in a large LP.

        Such an LP has cuts for many rounds. If they came first, there would be no bound meanwhile,
        and no leg would be fixed out.
        """
        bound = self.run.bound or 0.0
        is_high = point.objective - bound > share * (self.run.length - bound)
        return is_high and len(self.costs) > self.policy.lp.many_vertices

    def _price_all(
        self, point: Point, schedule: PricingSchedule, *, drops: bool
    ) -> tuple[bool, bool]:
        """Make a pricing pass; return whether legs were added, and whether the bound has risen.

        A rise of the LP's optimum since the last pass counts, too.
        """
        run, policy = self.run, self.policy.schedule
        before, legs = run.bound or 0.0, len(self.lp.legs)
        is_drop_due = schedule.passes % self.policy.lp.drop_interval == 0
        priced = self._price(point, drops=drops and is_drop_due)
        rise = (run.bound or 0.0) - before
        self._objective, last = point.objective, self._objective
        # if vertices were removed, all legs count as new
        new_legs = len(self.lp.legs) - legs if self.point is not None else legs
        brings_few = new_legs < policy.min_new_leg_share * legs
        schedule.note_pass(idle=brings_few and rise < policy.min_gap_closed * (run.length - before))
        has_climbed = point.objective > last * (1.0 + policy.min_bound_rise)
        return priced, has_climbed or rise > policy.min_bound_rise * abs(before)

    def measure(self) -> None:
        """Measure all legs that are not dead."""
        assert isinstance(self.dead, DeadLegs)  # sparse costs have been measured
        self.costs.measure_all(~self.dead.matrix())
        legs = self.lp.legs
        self.lp.set_costs(self.costs.costs_of(legs))

    def size(self) -> dict[str, int]:
        """Return the numbers of cuts, legs and vertices for the report."""
        return {"cuts": len(self.lp.cuts), "legs": self.dead.left, "vertices": len(self.costs)}

    def _adopt(self, goal_bound: GoalBound) -> list[Cut]:
        """Fix out what a program over goals or cells excludes, and return its cuts.

        Of cuts over cells, only cuts with a price are returned: with all of them, LPs would take
        half as long again.
        """
        run, costs = self.run, self.costs
        found = goal_bound.cells
        if found is None:
            return [replace(c, inside=c.inside[costs.cluster]) for c in goal_bound.cuts]
        cell = found.cells.cells_of(costs.cluster, self.odd)
        if run.tour is not None:
            alive: Bools = (cell >= 0) & found.alive[cell]
            alive[self.tour()] = True
            if not alive.all():
                self._restrict(alive)
                cell = cell[alive]
            tour = tour_legs(self.tour())
            self.dead.add_above(cell, found.dead)
            if isinstance(self.dead, DeadLegs):
                self.dead.revive(tour[np.isfinite(costs.values[tour[:, 0], tour[:, 1]])])
        cuts, duals = found.lifted_cuts(cell), found.lifted_duals(cell)
        if run.tour is not None:
            prices = self._prices(cuts, duals)
            run.raise_bound(min(prices.bound, run.cutoff))
            if not run.is_done:
                prices.fix_out(run.cutoff)
        return [c for c, price in zip(cuts, duals.cut.tolist(), strict=True) if price < 0.0]

    def _prices(self, cuts: Sequence[Cut], duals: Duals) -> Prices:
        costs, policy = self.costs, self.policy.pricing
        return Prices(costs.values, self.dead, costs.cluster, cuts, duals, self.run.check, policy)

    def _dead_legs(self) -> DeadLegs | SparseCosts:
        """Return the mask of missing legs, or the sparse costs, which lack them."""
        if self.costs.rows is not None:
            return self.costs.rows
        return DeadLegs.missing(self.costs.values, self.policy.pricing)

    def _with_costs(self, legs: Ints) -> Ints:
        """Return the legs that have a cost, and the incumbent's, also if they were removed."""
        if isinstance(self.dead, SparseCosts):
            gone = self.dead[legs[:, 0], legs[:, 1]]
            return legs[~gone | np.isin(self._keys(legs), self._keys(tour_legs(self.tour())))]
        return np.asarray(legs[np.isfinite(self.costs.costs_of(legs))])

    def _first_legs(self) -> Ints:
        """Return the nearest legs of every vertex, all legs to the base, and the incumbent's.

        Without an incumbent all legs are returned, so that an infeasible LP means that there is no
        tour.
        """
        if self.run.tour is None:
            return np.argwhere(np.triu(np.isfinite(self.costs.values), 1))
        others = np.arange(1, len(self.costs))
        pairs = np.vstack(
            [
                self.costs.nearest_legs(self.policy.pricing.nearest_legs),
                np.column_stack([np.zeros_like(others), others]),
                tour_legs(self.tour()),
            ]
        )
        legs = np.unique(np.sort(pairs, axis=1), axis=0)
        return self._with_costs(legs)

    def _warm_legs(self, warm: WarmStart) -> Ints:
        """Return the legs of a warm start, and the incumbent's."""
        legs = np.vstack([np.sort(warm.rows_of_legs(self.costs), axis=1), tour_legs(self.tour())])
        return self._with_costs(np.unique(legs, axis=0))

    def _add_missing_tour_legs(self) -> bool:
        """Add the incumbent's legs to the LP, and return whether any was missing."""
        tour = tour_legs(self.tour())
        new = tour[~np.isin(self._keys(tour), self._keys(self.lp.legs))]
        if len(new):
            self.lp.add_legs(new, self.costs.costs_of(new))
        return len(new) > 0

    def _keys(self, legs: Ints) -> Ints:
        """Return a distinct number for each leg."""
        return np.asarray(legs[:, 0] * len(self.costs) + legs[:, 1])

    def _price(self, point: Point, *, drops: bool) -> bool:
        """Raise the bound, fix out legs, and return whether legs came in or got longer.

        With `drops`, legs of large reduced cost leave a large LP.
        """
        run = self.run
        assert point.duals is not None
        prices = self._prices(self.lp.cuts, point.duals)
        # a tour with a dead leg is no shorter than the cutoff
        if self.best is None or prices.bound > (run.bound or 0.0):
            self.best = BoundProof(self.costs.vertices.copy(), tuple(self.lp.cuts), point.duals)
        self._reached = max(self._reached, prices.bound)
        run.raise_bound(min(prices.bound, run.cutoff))
        if run.is_done:
            return False
        gap = run.cutoff - (run.bound or 0.0)
        longer = False
        if run.cutoff - prices.bound < self.policy.pricing.max_gap_ratio * gap:
            prices.fix_out(run.cutoff)
            longer = self._measure_left()
        scale = run.length if run.tour is not None else float(self.costs.base_costs[1:].max())
        new, found_longer = self._columns_to_add(prices, ROUNDING_TOLERANCE * scale)
        if len(new):
            self.lp.add_legs(new, self.costs.costs_of(new))
        longer |= found_longer | self._measure_used(point)
        if drops and len(self.costs) > self.policy.lp.many_vertices:
            self._drop_expensive_legs(prices.reduced_costs(self.lp.legs), point)
        self._remove_dead()
        return len(new) > 0 or longer

    def _measure_left(self) -> bool:
        """Measure all legs that are left, once they are few; return whether there were any.

        The legs in the LP have been measured before.
        """
        exact = self.costs.exact
        if exact is None or not self.costs.measures_single_legs:
            return False
        assert isinstance(self.dead, DeadLegs)
        left = ~(self.dead.matrix() | exact)
        if np.count_nonzero(left) > 2 * self.policy.pricing.max_measured_legs:
            return False
        u, v = np.nonzero(left)
        legs = np.column_stack([u[u < v], v[u < v]])
        block_legs = self.costs.policy.block_legs
        for first in range(0, len(legs), block_legs):
            self.run.check()
            self.costs.measure_legs(legs[first : first + block_legs])
        return len(legs) > 0

    def _measure_used(self, point: Point) -> bool:
        """Measure the legs that the point uses and that are only estimated.

        Return whether there were any. The LP's bound is too low by what these estimates miss.
        """
        is_used = point.y > self.policy.pricing.min_measured_use
        if not self.costs.measure_legs(point.legs[is_used]):
            return False
        legs = self.lp.legs
        self.lp.set_costs(self.costs.costs_of(legs))
        return True

    def _drop_expensive_legs(self, price: Floats, point: Point) -> None:
        """Remove legs of large reduced cost from the LP; pricing brings them back if needed."""
        policy = self.policy.lp
        is_expensive = price > policy.max_reduced_cost * self.run.length
        old_count = len(point.y)
        is_expensive[old_count:] = False
        is_expensive[:old_count] &= point.y <= ROUNDING_TOLERANCE
        is_expensive &= ~np.isin(self._keys(self.lp.legs), self._keys(tour_legs(self.tour())))
        if is_expensive.sum() > policy.max_dead_share * len(is_expensive):
            self.lp.keep_legs(~is_expensive)

    def _columns_to_add(self, prices: Prices, tolerance: float) -> tuple[Ints, bool]:
        """Return the legs to add, a few of each vertex, and whether any was longer than estimated.

        Legs are measured before they come in, if that is quick: otherwise the LP fills with legs
        whose costs are too low.
        """
        longer = False
        legs, price = prices.most_negative(tolerance)
        missing = ~np.isin(self._keys(legs), self._keys(self.lp.legs))
        legs, price = legs[missing], price[missing]
        if self.costs.measures_single_legs and self.costs.measure_legs(legs):
            longer, price = True, prices.reduced_costs(legs)
        negative = price < -tolerance
        return self._cheapest_per_vertex(legs[negative], price[negative]), longer

    def _cheapest_per_vertex(self, legs: Ints, price: Floats) -> Ints:
        """Return the cheapest of legs (k, 2) by their prices (k,), a few of each vertex."""
        policy = self.policy.pricing
        limit = policy.max_new_legs_per_vertex
        count = np.zeros(len(self.costs), dtype=np.int64)
        chosen = []
        for u, v in legs[np.argsort(price, kind="stable")].tolist():
            if count[u] < limit or count[v] < limit:
                chosen.append((u, v))
                count[u] += 1
                count[v] += 1
                if len(chosen) == policy.max_new_legs:
                    break
        return np.array(chosen, dtype=np.int64).reshape(-1, 2)

    def _remove_dead(self) -> None:
        """Remove dead legs from the LP, and dead vertices altogether, once they are many."""
        policy = self.policy.lp
        tour, legs = self.tour(), self.lp.legs
        keep = ~self.dead[legs[:, 0], legs[:, 1]]
        keep |= np.isin(self._keys(legs), self._keys(tour_legs(tour)))
        if (~keep).sum() > policy.max_dead_share * len(keep):
            self.lp.keep_legs(keep)
        alive = self._alive()
        if alive.sum() > policy.max_vertex_share * len(alive):
            return
        self.lp.keep_legs(np.asarray(alive[self.lp.legs].all(axis=1)))
        self._restrict(alive)
        self.lp.restrict(alive)
        self.point = None

    def _alive(self) -> Bools:
        """Return the mask (V,) of vertices with legs left, and those of the incumbent."""
        alive = self.dead.with_legs()
        alive[0] = alive[self.tour()] = True
        return alive

    def _restrict(self, alive: Bools) -> None:
        """Remove all vertices but those marked, here and from the costs."""
        self.costs.restrict(alive)
        if isinstance(self.dead, DeadLegs):
            self.dead.restrict(alive)
        else:
            self.dead = self._dead_legs()
        self.branch, self.odd = self.branch[:, alive], self.odd[alive]
        self.branch = np.unique(self.branch[self.branch.sum(axis=1) > 1], axis=0)

    def separate(self, point: Point) -> list[Cut]:
        """Return cuts violated by a point between the LP's and the incumbent, or by the LP's."""
        cluster, policy = self.costs.cluster, self.policy.cuts
        tour = tour_legs(self.tour())
        # visited by the point or by the incumbent
        visited = np.union1d(np.flatnonzero(point.x > ROUNDING_TOLERANCE), self.tour())
        near = visited[self.costs.nearest_among(visited)]
        near[visited] = visited
        if len(tour):
            weight = policy.incumbent_weight
            y = (1.0 - weight) * point.y
            y[np.isin(self._keys(point.legs), self._keys(tour))] += weight
            x = (1.0 - weight) * point.x
            x[self.tour()] += weight
            cuts = fractional_cuts(x, point.legs, y, cluster, self.branch, near, policy)
            if cuts:
                return cuts
        cuts = fractional_cuts(point.x, point.legs, point.y, cluster, self.branch, near, policy)
        if cuts:
            return cuts
        if "parity" in policy.families:
            cuts = parity_cuts(point.legs, point.y, cluster, self.odd, self.run.check, policy)
        if cuts:
            return cuts
        flow = cluster_flows(point.legs, point.y, cluster)
        if "blossoms" in policy.families:
            cuts = blossom_cuts(flow, cluster, policy)
        if "combs" in policy.families:
            tight = tight_sets(self.lp.cuts, point, flow, cluster)
            cuts = cuts + comb_cuts(flow, tight, cluster, policy)
        return cuts

    def purge(self, point: Point, *, bound_has_risen: bool) -> None:
        """Count a round of all cuts, and remove idle ones if the bound has risen.

        While the bound does not rise, separation would only find them again.
        """
        assert point.slack is not None
        assert point.duals is not None
        self.lp.pool.count(point.duals.cut, point.slack)
        active = self.lp.pool.active() if bound_has_risen else None
        if active is not None:
            self.lp.keep_cuts(active)


def tour_legs(tour: Sequence[int] | Ints) -> Ints:
    """Return the legs (k, 2) of a closed tour, u < v."""
    t = np.asarray(tour, dtype=np.int64)
    if len(t) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    return np.sort(np.column_stack([t, np.roll(t, -1)]), axis=1)

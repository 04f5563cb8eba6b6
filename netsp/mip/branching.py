"""Branch and cut on the legs that the root has not fixed out.

A node of the tree states which legs may still be used and which pairs of clusters must be adjacent
in the tour. Cuts hold for every tour, so all nodes share them; each separates more, and fixes out
legs by its own bound. Candidates for branching are probed by a few simplex steps on either side
(strong branching; Applegate, Bixby, Chvátal & Cook 1995).

The legs of a pair that must be adjacent get a discount, so large that no tour without such a leg
can be the shortest, and the discount is added to the bound. With three clusters or more a tour has
at most one such leg, so tours that have it keep their length, and all others get longer. So a node
is a program like the root's with other costs, and its bound follows from the same formula
(`netsp.mip.lagrangian_bound`).
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, cast

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.gtsp.resumable import Steps, run_to_end
from netsp.gtsp.solver_run import RunStopped
from netsp.mip.blossoms import cluster_flows
from netsp.mip.cuts import Cut
from netsp.mip.legprices import LegPrices
from netsp.mip.program import Point, WarmRelaxation
from netsp.mip.root import Root, tour_legs

INTEGRALITY_TOLERANCE = 1e-6
"""Tolerance within which a value counts as a whole number."""


@dataclass(order=True)
class Node:
    """Node of the tree, ordered by bound, newest first among equal bounds.

    Attributes
    ----------
    bound
        Lower bound on the tours of the node.
    rank
        Number that falls with every new node.
    alive
        (k,) mask of the legs that may be used.
    adjacent
        Pairs of clusters that must be adjacent.
    """

    bound: float
    rank: int
    alive: Bools = field(compare=False)
    adjacent: tuple[tuple[int, int], ...] = field(compare=False)


class Choice(NamedTuple):
    """Two branches of a node: legs that may be used, and pairs that must be adjacent."""

    without: tuple[Bools, tuple[tuple[int, int], ...]]
    within: tuple[Bools, tuple[tuple[int, int], ...]]
    cuts: list[Cut]


class Tree:
    """Tree search that dives: of two new nodes, the more restricted one is processed next.

    When nothing is left below a node, the node of lowest bound follows. If the incumbent is the
    shortest tour, which is usual, the order makes no difference to the number of nodes.

    Parameters
    ----------
    root : Root
        Solved root over a `WarmRelaxation`. All legs that it has not fixed out must have been
        measured, and come into its program.
    """

    def __init__(self, root: Root) -> None:
        self.root, self.run = root, root.run
        self.policy = root.policy.branching
        self.lp = cast(WarmRelaxation, root.lp)
        self.cluster = root.costs.cluster
        legs = root.dead.legs_left()
        legs = np.unique(np.vstack([legs, tour_legs(root.tour())]), axis=0)
        size = len(self.cluster)
        wanted, held = legs @ (size, 1), self.lp.legs @ np.array((size, 1))
        self.lp.keep_legs(np.isin(held, wanted))
        new = legs[~np.isin(wanted, held)]
        self.lp.add_legs(new, root.costs.costs_of(new))
        self.legs: Ints = self.lp.legs
        self.costs: Floats = root.costs.costs_of(self.legs)
        ends = np.sort(self.cluster[self.legs], axis=1)
        self.clusters = int(self.cluster.max()) + 1
        self.pair: Ints = ends[:, 0] * self.clusters + ends[:, 1]
        self.charge = 2.0 * float(self.costs.max(initial=0.0))
        self._rank = itertools.count(0, -1)
        self._nodes = 0

    def solve(self) -> None:
        """Process nodes until none is left that could hold a shorter tour."""
        run_to_end(self.steps())

    def steps(self) -> Steps[None]:
        """Do what `solve` does, with a step for each node."""
        run = self.run
        whole = np.ones(len(self.legs), dtype=bool)
        node: Node | None = Node(run.bound or 0.0, next(self._rank), whole, ())
        open_nodes: list[Node] = []
        settled = np.inf
        while node is not None or open_nodes:
            if node is None:
                node = heapq.heappop(open_nodes)
            lowest = min(n.bound for n in (node, *open_nodes[:1]))
            run.raise_bound(min(lowest, settled, run.cutoff))
            if run.is_done:
                return
            if node.bound >= run.cutoff:
                settled, node = min(settled, node.bound), None
                continue
            yield
            bound, choice = self._process(node)
            processed, node = node, None
            if choice is None:
                settled = min(settled, bound)
            else:
                # dive: a child's LP re-solves in a few simplex steps, any other node's in thousands
                other, node = (
                    Node(bound, next(self._rank), alive, adjacent)
                    for alive, adjacent in (choice.without, choice.within)
                )
                heapq.heappush(open_nodes, other)
            self._nodes += 1
            run.report(
                "branches",
                cuts=len(self.lp.cuts),
                legs=int(processed.alive.sum()),
                vertices=len(np.unique(self.legs[processed.alive])),
            )
        run.is_infeasible = run.tour is None and settled == np.inf
        if not run.is_infeasible:
            run.raise_bound(min(settled, run.cutoff))

    def _process(self, node: Node) -> tuple[float, Choice | None]:
        """Return a node's bound and its two branches; None if no better tour is left in it."""
        run, lp, alive, policy = self.run, self.lp, node.alive, self.policy
        costs = self._costs(node.adjacent)
        lp.set_costs(costs)
        lp.set_alive(alive)
        bound = node.bound
        for k in itertools.count():
            run.check()
            point = lp.solve(run.clock)
            run.iterations += 1
            if point is None:
                if lp.infeasible and self._is_proven_empty(alive):
                    return np.inf, None
                run.check()
                return bound, self._halves(alive, node.adjacent)
            assert point.duals is not None
            before = bound
            prices = LegPrices(self.legs[alive], costs[alive], self.cluster, lp.cuts, point.duals)
            node_bound = prices.bound + self.charge * len(node.adjacent)
            bound = max(bound, node_bound)
            if bound >= run.cutoff:
                return bound, None
            alive = alive.copy()
            alive[np.flatnonzero(alive)[prices.exceeds(run.cutoff - node_bound)]] = False
            lp.set_alive(alive)
            # x as well: a point may enter a cluster at one vertex and leave it at another
            values = np.concatenate([point.x, point.y])
            is_whole = bool(np.abs(values - np.rint(values)).max() < INTEGRALITY_TOLERANCE)
            is_rounding_due = k == 0 and self._nodes % policy.rounding_interval == 0
            if is_whole or is_rounding_due:
                self.root.round_point(self.root, point)
            cuts = self.root.separate(point)
            gain = bound - before
            if not cuts and is_whole:
                return bound, None
            is_slow = k > 1 and gain < policy.min_gap_closed * (run.cutoff - bound)
            if not cuts or ((k >= policy.max_cut_rounds or is_slow) and not is_whole):
                return bound, self._choice(point, costs, alive, node.adjacent)
            self.root.purge(point, bound_has_risen=gain > 0.0)
            lp.add_cuts(cuts)
        raise AssertionError

    def _is_proven_empty(self, alive: Bools) -> bool:
        """Return whether a dual ray proves that there is no tour of these legs.

        By the formula of the bound, the ray must give a positive bound even if legs cost nothing.
        The solver's status alone would make the proof rest on its tolerances.
        """
        legs, free = self.legs[alive], np.zeros(int(alive.sum()))
        return any(
            LegPrices(legs, free, self.cluster, self.lp.cuts, ray).bound > 0.0
            for ray in self.lp.rays()
        )

    def _costs(self, adjacent: tuple[tuple[int, int], ...]) -> Floats:
        """Return the costs of all legs, with the discount of pairs that must be adjacent."""
        if not adjacent:
            return self.costs
        forced = np.isin(self.pair, [g * self.clusters + h for g, h in adjacent])
        return np.where(forced, self.costs - self.charge, self.costs)

    def _choice(
        self, point: Point, costs: Floats, alive: Bools, adjacent: tuple[tuple[int, int], ...]
    ) -> Choice:
        """Return the most fractional choice that raises the bound most on both sides."""
        best, best_gain = None, -np.inf
        for choice in self._choices(point, alive, adjacent):
            self.run.check()
            gains = []
            for legs, pairs in (choice.without, choice.within):
                value = self.lp.probe(self._costs(pairs), legs, self.policy.probe_steps)
                value += self.charge * len(pairs)
                current = point.objective + self.charge * len(adjacent)
                gains.append(max(min(value, self.run.cutoff) - current, 1e-6 * abs(current)))
            if gains[0] * gains[1] > best_gain:
                best, best_gain = choice, gains[0] * gains[1]
        self.lp.set_costs(costs)
        if best is None:
            return self._halves(alive, adjacent)
        self.lp.add_cuts(best.cuts)
        return best

    def _choices(
        self, point: Point, alive: Bools, adjacent: tuple[tuple[int, int], ...]
    ) -> Iterator[Choice]:
        """Yield choices: a pair of clusters is adjacent or not, a vertex is visited or not."""
        min_distance = self.policy.min_fractionality
        between = np.triu(cluster_flows(point.legs, point.y, self.cluster), 1)
        for g, h in adjacent:
            between[g, h] = 0.0  # a pair gets its discount once
        for g, h in _most_fractional(between, self.policy.pair_candidates, min_distance):
            legs = self.pair == g * self.clusters + h
            inside = np.isin(self.cluster, (g, h))
            cuts = [Cut(inside, g)] if g else []
            yield Choice((alive & ~legs, adjacent), (alive, (*adjacent, (g, h))), cuts)
        for (v,) in _most_fractional(point.x, self.policy.vertex_candidates, min_distance):
            others = self.cluster == self.cluster[v]
            others[v] = False
            at_v, elsewhere = (self.legs == v).any(axis=1), others[self.legs].any(axis=1)
            yield Choice((alive & ~at_v, adjacent), (alive & ~elsewhere, adjacent), [])

    def _halves(self, alive: Bools, adjacent: tuple[tuple[int, int], ...]) -> Choice:
        """Split the classes of the largest cluster in two, if there is no point to choose by."""
        used = np.unique(self.legs[alive])
        largest = int(np.argmax(np.bincount(self.cluster[used])))
        members = used[self.cluster[used] == largest]
        if len(members) < 2:
            raise RunStopped  # the LP has failed where there is nothing left to choose
        first, second = members[: len(members) // 2], members[len(members) // 2 :]
        without, within = (alive & ~np.isin(self.legs, m).any(axis=1) for m in (first, second))
        return Choice((without, adjacent), (within, adjacent), [])


def _most_fractional(values: Floats, count: int, min_distance: float) -> list[tuple[int, ...]]:
    """Return the indices of the values farthest from whole numbers, farther than `min_distance`."""
    distance = np.minimum(values, 1.0 - values)
    order = np.argsort(-distance, axis=None, kind="stable")[:count]
    return [
        tuple(int(i) for i in np.unravel_index(k, values.shape))
        for k in order
        if distance.ravel()[k] > min_distance
    ]

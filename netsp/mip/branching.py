"""Branch and cut on what the root has not ruled out.

A node of the tree says which legs may still be used and which pairs of clusters must follow each
other. Every node has the cuts of all others, for they hold for every tour, looks for more, and
rules legs out by its own bound. What to branch on is chosen by trial: the bounds that a few simplex
steps give on either side (strong branching, Applegate, Bixby, Chvátal & Cook 1995).

A pair that must follow each other pays less for its legs, by so much that no tour without one can
be the shortest, and that much is charged to all: with three clusters or more a tour has at most one
such leg, so tours that have it cost what they did, the others more. So a node is a program like
that of the root with other costs, and its bound rests on the same formula
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
from netsp.gtsp.solver_run import RunStopped
from netsp.mip.blossoms import cluster_flows
from netsp.mip.cuts import Cut
from netsp.mip.legprices import LegPrices
from netsp.mip.program import Point, WarmRelaxation
from netsp.mip.root import Root, tour_legs

FRACTIONAL = 0.02
"""Farther than this from whole numbers is worth branching on."""

WHOLE = 1e-6
"""Nearer than this to whole numbers is whole."""

PAIRS, CLASSES = 8, 6
"""So many pairs of clusters, and so many vertices, are tried for branching."""

STEPS = 60
"""Of the simplex method, in a trial."""

ROUNDS, WORTH = 12, 0.03
"""Most rounds of cuts at a node, unless its point is whole; they end before where one closes less
than this share of the gap."""

SETTLE_EVERY = 25
"""Nodes between two points that are rounded to a tour."""


@dataclass(order=True)
class Node:
    """What is left of the root's program; the least bound comes first, and of equal ones the
    newest.

    Attributes
    ----------
    bound
        No tour of this node is shorter.
    rank
        Falls with every node.
    alive
        (k,) legs that may be used.
    together
        Pairs of clusters that follow each other.
    """

    bound: float
    rank: int
    alive: Bools = field(compare=False)
    together: tuple[tuple[int, int], ...] = field(compare=False)


class Choice(NamedTuple):
    """Two ways that share the tours of a node among them: legs (k,), pairs of clusters."""

    without: tuple[Bools, tuple[tuple[int, int], ...]]
    within: tuple[Bools, tuple[tuple[int, int], ...]]
    cuts: list[Cut]


class Tree:
    """Of two new nodes the one where the pair follows each other, or the vertex is visited, comes
    next; only when nothing is left below it, the node of least bound. Where the incumbent is the
    shortest tour, as it mostly is, all have to be looked at in any order.

    Parameters
    ----------
    root : Root
        Solved, over a `WarmRelaxation`; all legs that it has not ruled out are measured, and come
        into its program.
    """

    def __init__(self, root: Root) -> None:
        self.root, self.run = root, root.run
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
        """Until no node is left that could hold a shorter tour."""
        run = self.run
        whole = np.ones(len(self.legs), dtype=bool)
        node: Node | None = Node(run.bound or 0.0, next(self._rank), whole, ())
        open_nodes: list[Node] = []
        settled = np.inf
        while node is not None or open_nodes:
            if node is None:
                node = heapq.heappop(open_nodes)
            least = min(n.bound for n in (node, *open_nodes[:1]))
            run.raise_bound(min(least, settled, run.cutoff))
            if run.is_done:
                return
            if node.bound >= run.cutoff:
                settled, node = min(settled, node.bound), None
                continue
            bound, choice = self._process(node)
            tried, node = node, None
            if choice is None:
                settled = min(settled, bound)
            else:
                # the next program differs little from this one; of others it takes thousands of
                # simplex steps more
                other, node = (
                    Node(bound, next(self._rank), alive, together)
                    for alive, together in (choice.without, choice.within)
                )
                heapq.heappush(open_nodes, other)
            self._nodes += 1
            run.report(
                "branches", cuts=len(self.lp.cuts), legs=int(tried.alive.sum()),
                vertices=len(np.unique(self.legs[tried.alive])),
            )  # fmt: skip
        run.is_infeasible = run.tour is None and settled == np.inf
        if not run.is_infeasible:
            run.raise_bound(min(settled, run.cutoff))

    # one node

    def _process(self, node: Node) -> tuple[float, Choice | None]:
        """The bound of a node, and how to go on; None where nothing is left of it but tours that
        are known, or no shorter."""
        run, lp, alive = self.run, self.lp, node.alive
        costs = self._costs(node.together)
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
                return bound, self._halves(alive, node.together)
            assert point.duals is not None
            before = bound
            prices = LegPrices(self.legs[alive], costs[alive], self.cluster, lp.cuts, point.duals)
            own = prices.bound + self.charge * len(node.together)
            bound = max(bound, own)
            if bound >= run.cutoff:
                return bound, None
            alive = alive.copy()
            alive[np.flatnonzero(alive)[prices.above(run.cutoff - own)]] = False
            lp.set_alive(alive)
            # x as well: a point may come to a cluster at one vertex and leave it at another
            values = np.concatenate([point.x, point.y])
            whole = bool(np.abs(values - np.rint(values)).max() < WHOLE)
            if whole or (k == 0 and self._nodes % SETTLE_EVERY == 0):
                self.root.round_point(self.root, point)
            cuts = self.root.separate(point)
            gain = bound - before
            if not cuts and whole:
                return bound, None
            tired = k >= ROUNDS or (k > 1 and gain < WORTH * (run.cutoff - bound))
            if not cuts or (tired and not whole):
                return bound, self._choice(point, costs, alive, node.together)
            self.root.purge(point, risen=gain > 0.0)
            lp.add_cuts(cuts)
        raise AssertionError

    def _is_proven_empty(self, alive: Bools) -> bool:
        """Whether the ray of an infeasible LP shows, by the formula of the bound, that a tour of
        these legs would be longer than nothing even if legs cost nothing. The solver's word alone
        would make a proof rest on its tolerances."""
        legs, free = self.legs[alive], np.zeros(int(alive.sum()))
        return any(
            LegPrices(legs, free, self.cluster, self.lp.cuts, ray).bound > 0.0
            for ray in self.lp.rays()
        )

    def _costs(self, together: tuple[tuple[int, int], ...]) -> Floats:
        """Of all legs, where such pairs follow each other."""
        if not together:
            return self.costs
        forced = np.isin(self.pair, [g * self.clusters + h for g, h in together])
        return np.where(forced, self.costs - self.charge, self.costs)

    # branching

    def _choice(
        self, point: Point, costs: Floats, alive: Bools, together: tuple[tuple[int, int], ...]
    ) -> Choice:
        """The choice that raises the bound most on both sides, of those that are most open."""
        best, most = None, -np.inf
        for choice in self._choices(point, alive, together):
            self.run.check()
            gains = []
            for legs, pairs in (choice.without, choice.within):
                there = self.lp.probe(self._costs(pairs), legs, STEPS)
                there += self.charge * len(pairs)
                now = point.objective + self.charge * len(together)
                gains.append(max(min(there, self.run.cutoff) - now, 1e-6 * abs(now)))
            if gains[0] * gains[1] > most:
                best, most = choice, gains[0] * gains[1]
        self.lp.set_costs(costs)
        if best is None:
            return self._halves(alive, together)
        self.lp.add_cuts(best.cuts)
        return best

    def _choices(
        self, point: Point, alive: Bools, together: tuple[tuple[int, int], ...]
    ) -> Iterator[Choice]:
        """Pairs of clusters that follow each other or do not, vertices that are visited or not."""
        between = np.triu(cluster_flows(point.legs, point.y, self.cluster), 1)
        for g, h in together:
            between[g, h] = 0.0  # a pair is charged once
        for g, h in _most_open(between, PAIRS):
            legs = self.pair == g * self.clusters + h
            inside = np.isin(self.cluster, (g, h))
            yield Choice(
                (alive & ~legs, together), (alive, (*together, (g, h))),
                [Cut(inside, g if g else h)] if g else [],
            )  # fmt: skip
        for (v,) in _most_open(point.x, CLASSES):
            others = self.cluster == self.cluster[v]
            others[v] = False
            at, elsewhere = (self.legs == v).any(axis=1), others[self.legs].any(axis=1)
            yield Choice((alive & ~at, together), (alive & ~elsewhere, together), [])

    def _halves(self, alive: Bools, together: tuple[tuple[int, int], ...]) -> Choice:
        """The classes of the largest cluster in two: a choice for want of a point."""
        used = np.unique(self.legs[alive])
        largest = int(np.argmax(np.bincount(self.cluster[used])))
        members = used[self.cluster[used] == largest]
        if len(members) < 2:
            raise RunStopped  # the LP has failed where there is nothing left to choose
        first, second = members[: len(members) // 2], members[len(members) // 2 :]
        without, within = (alive & ~np.isin(self.legs, m).any(axis=1) for m in (first, second))
        return Choice((without, together), (within, together), [])


def _most_open(values: Floats, count: int) -> list[tuple[int, ...]]:
    """Indices of the values farthest from whole numbers."""
    open_ = np.minimum(values, 1.0 - values)
    order = np.argsort(-open_, axis=None, kind="stable")[:count]
    return [
        tuple(int(i) for i in np.unravel_index(k, values.shape))
        for k in order if open_.ravel()[k] > FRACTIONAL
    ]  # fmt: skip

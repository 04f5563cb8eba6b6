"""Search for the duals and the branching tree of a proof, from the best tour known."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.base.errors import LimitReachedError
from netsp.mip.blossoms import blossom_cuts, cluster_flows
from netsp.mip.combs import comb_cuts, tight_sets
from netsp.mip.cuts import Cut
from netsp.mip.highs import HighsRelaxation
from netsp.mip.mip_policy import MipPolicy
from netsp.mip.parity_cuts import odd_numbers, parity_cuts
from netsp.mip.program import Duals, Point
from netsp.mip.root import tour_legs
from netsp.mip.subtours import fractional_cuts, label_families
from netsp.plan.proof.cover_instance import CoverInstance
from netsp.plan.proof.dual_stage import CutTable, DualStage, Pair, Struck, strike_out
from netsp_check.dual_bound import is_out_of_order

NEGATIVE_TOLERANCE = 1e-9
"""Tolerance, as a share of the target: pricing adds legs whose reduced costs are below zero by
more."""

REACH_ROOM = 1e-6
"""Tolerance, as a share of the target, by which the reach of a stage is larger than needed, because
some costs are estimates here."""


class ShorterTourError(Exception):
    """Error: a tour over the checker's bounds on legs is shorter than the target.

    Attributes
    ----------
    length
        Length of that tour, in grid units.
    """

    def __init__(self, length: float) -> None:
        super().__init__(f"{length:g}")
        self.length = length


@dataclass(frozen=True)
class DualSearchPolicy:
    """Policy of the search for a proof.

    Attributes
    ----------
    nearest_legs
        Legs of each vertex in the first LP.
    priced_per_vertex
        Most legs per vertex that a pricing pass adds.
    min_rise
        A round of cuts that raises the bound by less than this share of the gap is idle.
    max_idle_rounds
        Idle rounds in a row after which no more cuts are added.
    candidates
        Number of pairs, and of vertices, that are probed before branching.
    probe_steps
        Simplex steps of a probe.
    max_leaves
        Most leaves of the branching tree; the search gives up beyond.
    max_root_gap
        The search gives up if the root's bound is below the target by more than this share.
    min_left
        A node gets another stage while the last one left less than this share of its legs.
    """

    nearest_legs: int = 8
    priced_per_vertex: int = 4
    min_rise: float = 0.005
    max_idle_rounds: int = 10
    candidates: int = 6
    probe_steps: int = 200
    max_leaves: int = 200
    max_root_gap: float = 0.05
    min_left: float = 0.7


@dataclass
class ProofNode:
    """Node of the branching tree: its stages, and how it branches; a leaf is closed.

    Attributes
    ----------
    stages
        Stages with their reach.
    pair, vertex
        Pair of clusters, or row of a vertex, on which the node branches; None if it does not.
    children
        Branches: `apart` and `next` for a pair, `without` and `at` for a vertex.
    """

    stages: list[tuple[DualStage, int | None]] = field(default_factory=list)
    pair: Pair | None = None
    vertex: int | None = None
    children: list[ProofNode] = field(default_factory=list)

    def leaves(self) -> int:
        """Return the number of leaves."""
        return sum(c.leaves() for c in self.children) or 1

    def to_fields(self, instance: CoverInstance, cluster: list[int]) -> dict[str, Any]:
        """Return the tree and the table of its cuts as a proof holds them.

        Parameters
        ----------
        instance
            Instance that the rows of the stages belong to.
        cluster
            Cluster of each vertex of the cover.
        """
        table = CutTable(instance.vertices, np.array(cluster))
        return {"tree": self._to_json(table), "cuts": table.rows}

    def _to_json(self, table: CutTable) -> dict[str, Any]:
        out: dict[str, Any] = {"stages": [s.to_json(table, reach) for s, reach in self.stages]}
        if self.children:
            parts = [c._to_json(table) for c in self.children]
            if self.pair is not None:
                out |= {"pair": list(self.pair), "apart": parts[0], "next": parts[1]}
            else:
                vertex = int(table.vertices[self.vertex])
                out |= {"vertex": vertex, "without": parts[0], "at": parts[1]}
        return out


class DualSearch:
    """Search over an instance for a proof that no tour is shorter than a target.

    Attributes
    ----------
    on_round
        Called with the LP's bound, in grid units, after each round of the root.
    root_bound
        Bound of the root, in grid units; 0 before there is one.
    """

    def __init__(
        self,
        instance: CoverInstance,
        tour: list[int],
        target: int,
        clock: Clock,
        policy: DualSearchPolicy = DualSearchPolicy(),
        mip: MipPolicy = MipPolicy(),
        on_round: Callable[[float], None] = lambda bound: None,
    ) -> None:
        self.instance, self.tour, self.target, self.clock = instance, tour, target, clock
        self.policy, self.mip, self.on_round = policy, mip, on_round
        self.branch = label_families(instance.labels)
        self.odd = odd_numbers(instance.labels)
        self.leaves, self.root_bound = 0, 0.0

    def prove(self) -> ProofNode:
        """Return a branching tree whose leaves are all closed.

        Raises
        ------
        LimitReachedError
            Time is up, or the tree has too many leaves.
        """
        instance, root = self.instance, ProofNode()
        vertices = np.ones(len(instance.cluster), dtype=bool)
        legs = np.isfinite(instance.costs)
        lp = self._relaxation(self._first_legs())
        while True:
            point = self._price_and_cut(lp, legs)
            self.root_bound = point.objective
            if point.objective < self.target * (1.0 - self.policy.max_root_gap):
                raise LimitReachedError("the tour is far longer than the bound; allow more time")
            stage = _stage(point.duals, lp.cuts, {})
            if not self._settle(stage, vertices, legs):
                break
            lp.set_costs(instance.costs[lp.legs[:, 0], lp.legs[:, 1]])
        struck = self._add_stage(root, stage, vertices, legs, REACH_ROOM * self.target)
        left = np.argwhere(np.triu(struck.legs))
        if len(left):
            # with the legs of the tour the LP has a solution, whatever is struck out
            self.lp = self._relaxation(np.unique(np.vstack([left, tour_legs(self.tour)]), axis=0))
            self.lp.add_cuts(list(lp.cuts))
            u, v = self.lp.legs.T
            self._branch(root, struck.vertices, struck.legs[u, v], ())
        return root

    # the root over all legs

    def _first_legs(self) -> Ints:
        costs = self.instance.costs
        n = len(costs)
        count = min(self.policy.nearest_legs, n - 1)
        near = np.argpartition(costs, count - 1, axis=1)[:, :count]
        pairs = np.vstack(
            [
                np.column_stack([np.repeat(np.arange(n), count), near.ravel()]),
                np.column_stack([np.zeros(n - 1, dtype=np.int64), np.arange(1, n)]),
                tour_legs(self.tour),
            ]
        )
        legs = np.unique(np.sort(pairs, axis=1), axis=0)
        return np.asarray(legs[np.isfinite(costs[legs[:, 0], legs[:, 1]])])

    def _relaxation(self, legs: Ints) -> HighsRelaxation:
        costs = self.instance.costs[legs[:, 0], legs[:, 1]]
        return HighsRelaxation(self.instance.cluster, legs, costs, self.mip)

    def _price_and_cut(self, lp: HighsRelaxation, legs: Bools) -> Point:
        """Add legs and cuts until the LP over all legs has no violated cut, or stalls."""
        idle, best = 0, -np.inf
        while True:
            point = self._solve(lp)
            if self._price(lp, point, legs):
                continue
            self.on_round(point.objective)
            gap = self.target - point.objective
            rise = point.objective - best
            idle = 0 if rise > self.policy.min_rise * max(gap, 0.0) else idle + 1
            best = max(best, point.objective)
            cuts = self._separate(point, lp, deep=idle < 2)
            if gap <= 0.0 or not cuts or idle > self.policy.max_idle_rounds:
                return point
            self._purge(lp, point, has_risen=rise > 0.0)
            lp.add_cuts(cuts)

    def _price(self, lp: HighsRelaxation, point: Point, legs: Bools) -> bool:
        """Add the legs of most negative reduced cost, and return whether there were any."""
        instance = self.instance
        stage = _stage(point.duals, lp.cuts, {})
        reduced = np.where(legs, stage.reduced_costs(instance.costs, instance.cluster), np.inf)
        count = min(self.policy.priced_per_vertex, len(reduced) - 1)
        low = np.argpartition(reduced, count - 1, axis=1)[:, :count]
        u = np.repeat(np.arange(len(reduced)), count)
        is_negative = reduced[u, low.ravel()] < -NEGATIVE_TOLERANCE * self.target
        found = np.column_stack([u, low.ravel()])[is_negative]
        found = np.unique(np.sort(found, axis=1), axis=0)
        held = lp.legs[:, 0] * len(reduced) + lp.legs[:, 1]
        new = found[~np.isin(found[:, 0] * len(reduced) + found[:, 1], held)]
        if len(new):
            lp.add_legs(new, instance.costs[new[:, 0], new[:, 1]])
        return len(new) > 0

    # stages and branching over the legs left

    def _branch(
        self, node: ProofNode, vertices: Bools, alive: Bools, adjacent: tuple[Pair, ...]
    ) -> None:
        """Add stages to a node, and branches until every leaf is closed.

        Parameters
        ----------
        vertices, alive
            Masks of the vertices and of the legs of the LP that are left.
        adjacent
            Pairs of clusters that must be adjacent.
        """
        while True:
            if is_out_of_order(set(adjacent), self.instance.before):
                self._close_leaf()
                return
            point = self._cut(alive, adjacent)
            before = np.count_nonzero(alive)
            vertices, alive = self._strike_out(node, point, vertices, alive, adjacent)
            if not alive.any():
                self._close_leaf()
                return
            if np.count_nonzero(alive) > self.policy.min_left * before:
                break
        parts = self._choose(node, point, alive, adjacent)
        for legs, pairs in parts:
            node.children.append(ProofNode())
            self._branch(node.children[-1], vertices, legs, pairs)

    def _close_leaf(self) -> None:
        self.leaves += 1
        if self.leaves > self.policy.max_leaves:
            raise LimitReachedError(
                f"the branching tree has more than {self.policy.max_leaves} leaves"
            )

    def _cut(self, alive: Bools, adjacent: tuple[Pair, ...]) -> Point:
        """Return the LP's last point after rounds of cuts."""
        lp, idle, best = self.lp, 0, -np.inf
        lp.set_costs(self._costs(alive, adjacent))
        while True:
            point = self._solve(lp)
            bound = point.objective + self._discount * len(adjacent)
            gap, rise = self.target - bound, bound - best
            idle = 0 if rise > self.policy.min_rise * max(gap, 0.0) else idle + 1
            best = max(best, bound)
            is_whole = bool(np.minimum(point.y, 1.0 - point.y).max(initial=0.0) < 1e-6)
            if gap <= 0.0 or (idle > self.policy.max_idle_rounds and not is_whole):
                return point
            cuts = self._separate(point, lp, deep=idle < 2)
            if not cuts:
                return point
            self._purge(lp, point, has_risen=rise > 0.0)
            lp.add_cuts(cuts)

    def _strike_out(
        self,
        node: ProofNode,
        point: Point,
        vertices: Bools,
        alive: Bools,
        adjacent: tuple[Pair, ...],
    ) -> tuple[Bools, Bools]:
        """Add a stage to a node, and return what it leaves over."""
        legs = np.zeros_like(self.instance.costs, dtype=bool)
        u, v = self.lp.legs[alive].T
        legs[u, v] = legs[v, u] = True
        pairs = dict.fromkeys(adjacent, round(self._discount))
        struck = self._add_stage(node, _stage(point.duals, self.lp.cuts, pairs), vertices, legs)
        u, v = self.lp.legs.T
        left = alive & struck.legs[u, v]
        if left.any() and left.sum() == alive.sum():
            node.stages.pop()  # it strikes out nothing, which the checker refuses
        return struck.vertices, left

    def _settle(self, stage: DualStage, vertices: Bools, legs: Bools) -> bool:
        """Settle the costs of all legs within the reach of a stage, and return whether one fell
        by so much that the LP should be solved again."""
        instance = self.instance
        reduced = stage.reduced_costs(instance.costs, instance.cluster)
        short = stage.constant() - self.target
        room = REACH_ROOM * self.target
        struck = strike_out(reduced, instance.cluster, vertices, legs, short, room)
        assert struck.reach is not None
        near = np.argwhere(np.triu(legs & (reduced < struck.reach)))
        before = instance.costs[near[:, 0], near[:, 1]]
        instance.settle(near, self._check)
        after = instance.costs[near[:, 0], near[:, 1]]
        return bool(np.abs(before - after).sum() > room)

    def _add_stage(
        self,
        node: ProofNode,
        stage: DualStage,
        vertices: Bools,
        legs: Bools,
        room: float | None = None,
    ) -> Struck:
        instance = self.instance
        reduced = stage.reduced_costs(instance.costs, instance.cluster)
        short = stage.constant() - self.target
        struck = strike_out(reduced, instance.cluster, vertices, legs, short, room)
        node.stages.append((stage, struck.reach))
        return struck

    @property
    def _discount(self) -> float:
        """Amount by which the LP lowers the costs of legs between a pair that must be adjacent."""
        return float(round(0.5 * self.target))

    def _costs(self, alive: Bools, adjacent: tuple[Pair, ...]) -> Floats:
        """Return the costs of the LP's legs; legs that are struck out cost more than any tour."""
        u, v = self.lp.legs.T
        costs = np.where(alive, self.instance.costs[u, v], 10.0 * self.target)
        for g, h in adjacent:
            costs[self._is_between(g, h)] -= self._discount
        return np.asarray(costs)

    def _is_between(self, g: int, h: int) -> Bools:
        """Return the mask of the LP's legs between two clusters, g < h."""
        ends = np.sort(self.instance.cluster[self.lp.legs], axis=1)
        return np.asarray((ends[:, 0] == g) & (ends[:, 1] == h))

    def _choose(
        self, node: ProofNode, point: Point, alive: Bools, adjacent: tuple[Pair, ...]
    ) -> list[tuple[Bools, tuple[Pair, ...]]]:
        """Choose the pair or vertex that raises the bound most on both sides; return both parts."""
        best, best_gain = None, -np.inf
        for pair, vertex in self._candidates(point, adjacent):
            parts = self._parts(pair, vertex, alive, adjacent)
            gains = []
            for legs, pairs in parts:
                self._check()
                every = np.ones_like(legs)
                value = self.lp.probe(self._costs(legs, pairs), every, self.policy.probe_steps)
                value += self._discount * (len(pairs) - len(adjacent))
                gains.append(max(min(value, 2.0 * self.target) - point.objective, 1.0))
            if gains[0] * gains[1] > best_gain:
                best, best_gain = (pair, vertex, parts), gains[0] * gains[1]
        if best is None:
            raise ShorterTourError(point.objective + self._discount * len(adjacent))
        node.pair, node.vertex, parts = best
        if node.pair is not None and node.pair[0]:
            inside = np.isin(self.instance.cluster, node.pair)
            self.lp.add_cuts([Cut(inside, node.pair[0])])
        return parts

    def _candidates(
        self, point: Point, adjacent: tuple[Pair, ...]
    ) -> Iterator[tuple[Pair | None, int | None]]:
        """Yield the most fractional pairs of clusters, and the most fractional vertices."""
        between = np.triu(cluster_flows(point.legs, point.y, self.instance.cluster), 1)
        for pair in adjacent:
            between[pair] = 0.0
        for values in (between, point.x):
            distance = np.minimum(values, 1.0 - values)
            order = np.argsort(-distance, axis=None, kind="stable")[: self.policy.candidates]
            for k in order.tolist():
                if distance.ravel()[k] > 1e-6:
                    at = np.unravel_index(k, values.shape)
                    yield ((int(at[0]), int(at[1])), None) if len(at) == 2 else (None, int(at[0]))
        if self.instance.before:
            # a whole solution may still visit clusters in the wrong order
            for g, h in np.argwhere(between > 1.0 - 1e-6)[: self.policy.candidates].tolist():
                yield (g, h), None

    def _parts(
        self, pair: Pair | None, vertex: int | None, alive: Bools, adjacent: tuple[Pair, ...]
    ) -> list[tuple[Bools, tuple[Pair, ...]]]:
        """Return legs and adjacent pairs of both parts of a choice."""
        if pair is not None:
            return [(alive & ~self._is_between(*pair), adjacent), (alive, (*adjacent, pair))]
        cluster, legs = self.instance.cluster, self.lp.legs
        others = cluster == cluster[vertex]
        others[vertex] = False
        without, at = (legs != vertex).all(axis=1), ~others[legs].any(axis=1)
        return [(alive & without, adjacent), (alive & at, adjacent)]

    # LPs

    def _solve(self, lp: HighsRelaxation) -> Point:
        self._check()
        point = lp.solve(self.clock)
        self._check()
        if point is None:
            raise LimitReachedError("an LP failed")
        return point

    def _check(self) -> None:
        if self.clock.is_up:
            raise LimitReachedError("time is up")

    def _separate(self, point: Point, lp: HighsRelaxation, *, deep: bool) -> list[Cut]:
        """Return cuts violated by the LP's point, or if `deep`, by one between it and the tour."""
        cluster, policy = self.instance.cluster, self.mip.cuts
        visited = np.union1d(np.flatnonzero(point.x > 1e-9), self.tour)
        near = visited[np.argmin(self.instance.costs[:, visited], axis=1)]
        near[visited] = visited
        size, weight = len(cluster), policy.incumbent_weight
        tour = tour_legs(self.tour)
        is_toured = np.isin(point.legs @ [size, 1], tour @ [size, 1])
        x, y = (1.0 - weight) * point.x, (1.0 - weight) * point.y + weight * is_toured
        x[self.tour] += weight
        for some_x, some_y in ((x, y), (point.x, point.y)) if deep else ((point.x, point.y),):
            cuts = fractional_cuts(some_x, point.legs, some_y, cluster, self.branch, near, policy)
            if cuts:
                return cuts
        cuts = parity_cuts(point.legs, point.y, cluster, self.odd, self._check, policy)
        if cuts:
            return cuts
        flow = cluster_flows(point.legs, point.y, cluster)
        tight = tight_sets(lp.cuts, point, flow, cluster)
        return [*blossom_cuts(flow, cluster, policy), *comb_cuts(flow, tight, cluster, policy)]

    def _purge(self, lp: HighsRelaxation, point: Point, *, has_risen: bool) -> None:
        """Count a round of all cuts, and remove idle ones if the bound has risen."""
        assert point.slack is not None
        assert point.duals is not None
        lp.pool.count(point.duals.cut, point.slack)
        active = lp.pool.active() if has_risen else None
        if active is not None:
            lp.keep_cuts(active)


def _stage(duals: Duals | None, cuts: list[Cut], pairs: dict[Pair, int]) -> DualStage:
    """Return the stage of dual values of the LP."""
    assert duals is not None
    return DualStage.rounded(0.5 * duals.cluster, cuts, -0.5 * duals.cut, pairs)

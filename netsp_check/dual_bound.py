"""The bound: integer duals, cuts and a branching tree (Lemmas 9 to 14).

All numbers are whole grid units. A stage gives each leg a reduced cost and strikes out the legs and
vertices that no tour shorter than the target uses; what is left goes to the next stage.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from netsp_check.covering_tree import CoveringTree
from netsp_check.leg_bounds import LegBounds
from netsp_check.problem_file import Refused

Pair = tuple[int, int]

UNLIMITED = 1 << 100
"""Sentinel: more than any reduced cost."""

SLACK = 64
"""Tolerance: grid units that cover the rounding of the distances in `Bound._near_legs`."""


@dataclass
class Cut:
    """Cut, as sets of vertices (Lemmas 9 to 11).

    Attributes
    ----------
    inner, outer
        Masks of vertices: for a subtour cut S without C, and S; else both are the handle.
    pairs
        Pairs of clusters of the teeth.
    crossing
        Whether only legs across the handle count in teeth.
    constant
        Right-hand side.
    """

    inner: int
    outer: int
    pairs: frozenset[Pair] = frozenset()
    crossing: bool = False
    constant: int = 0


def read_cut(data: Any, cluster: Sequence[int]) -> Cut:
    """Return a cut of a proof after checking the conditions of its lemma."""
    kind, mask, more = data
    inside = int(mask, 16)
    if inside < 0 or inside >> len(cluster):
        raise Refused("cut: expected a set of vertices")
    if kind == "subtour":
        if inside & 1:
            raise Refused("subtour cut: expected a set without the base")
        own = sum(1 << v for v, c in enumerate(cluster) if c == more)
        return Cut(inside & ~own, inside)
    if kind == "parity":
        pairs = frozenset((min(g, h), max(g, h)) for g, h in more)
        if len(pairs) != len(more) or len(pairs) % 2 == 0 or any(g == h for g, h in pairs):
            raise Refused("parity cut: expected an odd number of distinct pairs")
        return Cut(inside, inside, pairs, True, 1 - len(pairs))
    if kind == "comb":
        return _read_comb(inside, [frozenset(t) for t in more], cluster)
    raise Refused(f"cut: unknown kind {kind!r}")


def _read_comb(inside: int, teeth: list[frozenset[int]], cluster: Sequence[int]) -> Cut:
    handle = {c for v, c in enumerate(cluster) if inside >> v & 1}
    if any(c in handle and not inside >> v & 1 for v, c in enumerate(cluster)):
        raise Refused("comb: expected a handle of whole clusters")
    if len(teeth) % 2 == 0 or len(teeth) < 3:
        raise Refused("comb: expected an odd number of teeth, at least three")
    if sum(len(t) for t in teeth) != len(frozenset().union(*teeth)):
        raise Refused("comb: expected disjoint teeth")
    if not all(t & handle and t - handle for t in teeth):
        raise Refused("comb: expected teeth that are partly in the handle")
    pairs = frozenset((g, h) for t in teeth for g in t for h in t if g < h)
    constant = len(teeth) + 1 - 2 * sum(len(t) - 1 for t in teeth)
    return Cut(inside, inside, pairs, False, constant)


class Stage:
    """Duals of a stage, and the reduced costs that they give legs.

    Attributes
    ----------
    reach
        Legs of at least this reduced cost need no exact one.
    constant
        Lower bound if no leg had a negative reduced cost.
    potential
        Sum of the duals of each vertex.
    """

    def __init__(
        self, data: dict[str, Any], cuts: list[Cut], cluster: Sequence[int], adjacent: set[Pair]
    ) -> None:
        prices, self.reach = data["a"], data.get("reach", UNLIMITED)
        used = [(cuts[k], b) for k, b in data["cuts"]]
        self._multipliers = [b for _, b in used]
        if not all(isinstance(b, int) and b >= 0 for b in self._multipliers):
            raise Refused("stage: expected multipliers of cuts of at least 0")
        self._pair_prices = {(min(g, h), max(g, h)): price for g, h, price in data.get("p", ())}
        whole = [*prices, self.reach, *self._pair_prices.values()]
        if len(prices) != max(cluster) + 1 or not all(isinstance(a, int) for a in whole):
            raise Refused("stage: expected a whole number for each cluster")
        if not self._pair_prices.keys() <= adjacent:
            raise Refused("stage: has the price of a pair that need not be adjacent")
        self.constant = 2 * sum(prices) + sum(self._pair_prices.values())
        self.constant += sum(b * cut.constant for cut, b in used)
        self.potential = [prices[c] for c in cluster]
        self._inner, self._outer = [0] * len(cluster), [0] * len(cluster)
        self._teeth: dict[Pair, list[int]] = {}
        for k, (cut, b) in enumerate(used):
            for v in bits(cut.inner):
                self.potential[v] += b
                self._inner[v] |= 1 << k
            for v in bits(cut.outer):
                self._outer[v] |= 1 << k
            for pair in cut.pairs:
                self._teeth.setdefault(pair, [0, 0])[cut.crossing] |= 1 << k

    def reduced(self, u: int, v: int, cost: int, pair: Pair) -> int:
        """Return the reduced cost of a leg, or if that is at least `reach`, a number from there
        to the reduced cost."""
        out = cost - self.potential[u] - self.potential[v] - self._pair_prices.get(pair, 0)
        if out >= self.reach:
            return out
        twice = self._inner[u] & self._outer[v] | self._outer[u] & self._inner[v]
        out += 2 * sum(self._multipliers[k] for k in bits(twice))
        if pair in self._teeth:
            whole, crossing = self._teeth[pair]
            counted = whole | crossing & (self._inner[u] ^ self._inner[v])
            out += 2 * sum(self._multipliers[k] for k in bits(counted))
        return out


class Bound:
    """Check that no tour over the vertices of a cover is shorter than a target.

    Attributes
    ----------
    leaves
        Number of leaves of the branching tree that were closed.
    """

    def __init__(self, tree: CoveringTree, legs: LegBounds, target: int | None) -> None:
        self.tree, self.legs, self.leaves = tree, legs, 0
        self.target = UNLIMITED if target is None else target
        self._cuts: list[Cut] = []
        of_place = tree.triangulation.problem.cluster
        self.cluster = [of_place[v.place] for v in tree.vertices]
        self.clusters = max(of_place) + 1
        self._nodes = [v.node for v in tree.vertices]

    def check(self, node: dict[str, Any], cuts: list[Any]) -> None:
        """Check a branching tree over a table of cuts; refuse it if a leaf is not closed."""
        self._cuts = [read_cut(cut, self.cluster) for cut in cuts]
        alive = self.reachable()
        if self.clusters == 2 and len(alive) > 1:
            raise Refused("there may be a shorter tour to the goal and back")
        self._check_node(node, alive, None, set())

    def reachable(self) -> set[int]:
        """Return the vertices within the tether that are on tours shorter than the target."""
        tether = math.floor(self.tree.triangulation.problem.tether)
        longest = min(2 * tether, self.target - 1)
        others = range(1, len(self.cluster))
        return {0, *(v for v in others if 2 * self.legs.bound(0, v, 2) <= longest)}

    def _check_node(
        self, node: dict[str, Any], alive: set[int], legs: set[Pair] | None, adjacent: set[Pair]
    ) -> None:
        for data in node.get("stages", ()):
            if not self._is_possible(alive):
                break
            stage = Stage(data, self._cuts, self.cluster, adjacent)
            alive, legs = self._strike_out(stage, alive, legs)
        if not self._is_possible(alive):
            self.leaves += 1
            return
        if legs is None:
            raise Refused("node: branches before a stage")
        if "pair" in node:
            g, h = sorted(node["pair"])
            apart = {leg for leg in legs if self._pair(*leg) != (g, h)}
            self._check_node(node["apart"], alive, apart, adjacent)
            self._check_node(node["next"], alive, legs, adjacent | {(g, h)})
        elif "vertex" in node:
            v = node["vertex"]
            others = {w for w in alive if w != v and self.cluster[w] == self.cluster[v]}
            for branch, removed in (("without", {v}), ("at", others)):
                left = {leg for leg in legs if not removed & set(leg)}
                self._check_node(node[branch], alive - removed, left, adjacent)
        else:
            raise Refused("node: a leaf is not closed")

    def _is_possible(self, alive: set[int]) -> bool:
        """Return whether every cluster has a vertex left."""
        return len({self.cluster[v] for v in alive}) == self.clusters

    def _pair(self, u: int, v: int) -> Pair:
        """Return the pair of clusters of a leg."""
        g, h = self.cluster[u], self.cluster[v]
        return (g, h) if g < h else (h, g)

    def _strike_out(
        self, stage: Stage, alive: set[int], legs: set[Pair] | None
    ) -> tuple[set[int], set[Pair]]:
        """Return the vertices and legs that a tour shorter than the target may use (Lemma 13)."""
        if legs is not None:
            stage.reach = UNLIMITED
        price = {}
        for u, v in self._near_legs(stage, alive) if legs is None else legs:
            r = self._price(stage, u, v)
            if r < stage.reach:
                price[u, v] = r
        lowest = {v: [stage.reach, stage.reach] for v in alive}
        for (u, v), r in price.items():
            for w in (u, v):
                if r < lowest[w][1]:
                    lowest[w] = sorted((lowest[w][0], r))
        cheapest = [stage.reach * 2] * self.clusters
        for v, (a, b) in lowest.items():
            cheapest[self.cluster[v]] = min(cheapest[self.cluster[v]], a + b)
        # twice the bound, less twice the target
        excess = 2 * (stage.constant - self.target) + sum(cheapest)
        above = {v: -cheapest[self.cluster[v]] for v in alive}
        left = {v for v in alive if excess + above[v] + sum(lowest[v]) < 0}
        if left and excess + 2 * (stage.reach + min(lowest[v][0] + above[v] for v in left)) < 0:
            raise Refused("stage: its reach is too small")
        kept = set()
        for (u, v), r in price.items():
            if u in left and v in left:
                other = sum(lowest[w][1 if r <= lowest[w][0] else 0] for w in (u, v))
                if excess + above[u] + above[v] + 2 * r + other < 0:
                    kept.add((u, v))
        return left, kept

    def _price(self, stage: Stage, u: int, v: int) -> int:
        """Return the reduced cost of a leg, from a bound of little effort if that is enough."""
        pair, out = self._pair(u, v), stage.reach
        for effort in (0, 1, 2):
            out = stage.reduced(u, v, self.legs.bound(u, v, effort), pair)
            if out >= stage.reach:
                break
        return out

    def _near_legs(self, stage: Stage, alive: set[int]) -> Iterator[Pair]:
        """Yield the legs (u, v), u < v, that may have a reduced cost below the stage's reach.

        A path between two vertices crosses the edges at which their branches part (Lemma 6).
        """
        nodes, end, vertices = self.tree.nodes, self.tree.end, self.tree.vertices
        own = [v.reach - p for v, p in zip(vertices, stage.potential, strict=True)]
        for u in sorted(alive):
            child, node, beyond = -1, vertices[u].node, 0.0
            while node >= 0:
                # first the vertices in the node itself, then those behind its other edges
                branches = [] if child >= 0 else [(node, node + 1, math.inf)]
                d = node + 1 if child < 0 else end[child]
                while d < end[node]:
                    branches.append((d, end[d], nodes[d].farthest))
                    d = end[d]
                for first, last, farthest in branches:
                    limit = stage.reach + stage.potential[u] - beyond + farthest + SLACK
                    low = max(bisect.bisect_left(self._nodes, first), u + 1)
                    for v in range(low, bisect.bisect_left(self._nodes, last)):
                        if own[v] < limit and v in alive and self.cluster[v] != self.cluster[u]:
                            yield u, v
                child, node = node, nodes[node].parent
                beyond = vertices[u].reach - nodes[child].farthest


def bits(mask: int) -> Iterator[int]:
    """Yield the places of the ones of a number."""
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low

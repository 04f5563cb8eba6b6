"""The bound: integer duals, cuts and a branching tree (Lemmas 9 to 15).

All numbers are whole grid units. A stage gives each leg a reduced cost, and strikes out the legs
and vertices that no tour shorter than the target uses; the rest goes to the next stage.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any, NamedTuple

from netsp_check.covering_tree import CoveringTree
from netsp_check.leg_bounds import LegBounds
from netsp_check.problem_file import Refused

Pair = tuple[int, int]
"""Pair of clusters or of vertices, the lower number first."""

UNLIMITED = 1 << 100
"""Sentinel: more than any cost."""

NEAR_LEG_ROUNDING = 64
"""Tolerance: grid units that cover the rounding of distances in `Bound._near_legs`."""


class Cut(NamedTuple):
    """Inequality over legs (Lemmas 9 to 11): Σ coefficients >= constant.

    `inner` and `outer` are masks of vertices: of a subtour cut, S without C, and S; else both are
    the handle. `pairs` are the pairs of clusters within teeth; if `crossing`, only legs across the
    handle count there.
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
        return Cut(inside & ~sum(1 << v for v, c in enumerate(cluster) if c == more), inside)
    teeth, known = [frozenset(t) for t in more], set(cluster)
    pairs = frozenset((g, h) for t in teeth for g, h in combinations(sorted(t), 2))
    if len(teeth) % 2 == 0 or not all(t <= known for t in teeth):
        raise Refused(f"{kind}: expected an odd number of teeth, sets of clusters")
    if kind == "parity":
        if not len(pairs) == len(teeth) == sum(len(t) == 2 for t in teeth):
            raise Refused("parity cut: expected distinct pairs")
        return Cut(inside, inside, pairs, True, 1 - len(pairs))
    handle = {c for v, c in enumerate(cluster) if inside >> v & 1}
    if kind != "comb" or any(c in handle and not inside >> v & 1 for v, c in enumerate(cluster)):
        raise Refused("comb: expected a handle of whole clusters")
    if len(teeth) < 3 or sum(map(len, teeth)) != len(frozenset().union(*teeth)):
        raise Refused("comb: expected three or more disjoint teeth")
    if not all(t & handle and t - handle for t in teeth):
        raise Refused("comb: expected teeth that are partly in the handle")
    return Cut(inside, inside, pairs, False, len(teeth) + 1 - 2 * sum(len(t) - 1 for t in teeth))


class Stage:
    """Duals of a stage, and the reduced costs that they give legs.

    Attributes
    ----------
    reach
        Reduced cost from which on legs count as this much; unlimited after the first stage.
    constant
        Lower bound if no leg had a negative reduced cost.
    potential
        Sum of the duals of each vertex.
    """

    def __init__(
        self, data: dict[str, Any], cuts: list[Cut], cluster: Sequence[int], adjacent: set[Pair]
    ) -> None:
        prices: list[int] = data["a"]
        self.reach: int = data.get("reach", UNLIMITED)
        used = [(cuts[k], b) for k, b in data["cuts"]]
        self._multipliers: list[int] = [b for _, b in used]
        self._pair_prices: dict[Pair, int] = {(g, h): price for g, h, price in data.get("p", ())}
        numbers = [*prices, self.reach, *self._multipliers, *self._pair_prices.values()]
        if len(prices) != max(cluster) + 1 or any(type(n) is not int for n in numbers):
            raise Refused("stage: expected whole numbers, one for each cluster and cut")
        if min(self._multipliers, default=0) < 0 or not self._pair_prices.keys() <= adjacent:
            raise Refused("stage: expected multipliers of at least 0, and prices of adjacent pairs")
        self.constant: int = 2 * sum(prices) + sum(self._pair_prices.values())
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
        """Return the reduced cost of a leg, or if that is at least `reach`, some number that is at
        least `reach` and at most the reduced cost."""
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
    target
        In grid units; None to check that there is no tour at all.
    allowed
        Pairs of clusters that precedences allow to be adjacent.
    leaves
        Number of leaves of the branching tree that were closed.
    """

    def __init__(self, tree: CoveringTree, legs: LegBounds, target: int | None) -> None:
        self.tree, self.legs, self.leaves = tree, legs, 0
        self.target = UNLIMITED if target is None else target
        problem = tree.triangulation.problem
        self.cluster = [problem.cluster[v.place] for v in tree.vertices]
        self.clusters = max(problem.cluster) + 1
        self._before, self.allowed = problem.before, _allowed(problem.before, self.clusters)
        self._cuts: list[Cut] = []

    def check(self, node: dict[str, Any], cuts: list[Any]) -> None:
        """Check a branching tree over a table of cuts; refuse it if a leaf is not closed."""
        self._cuts = [read_cut(cut, self.cluster) for cut in cuts]
        alive = self.reachable()
        if self.clusters < 3 and self._is_possible(alive):
            raise Refused("there may be a shorter tour, to one goal and back")
        self._check_node(node, alive, None, set())

    def reachable(self) -> set[int]:
        """Return the vertices within the tether that are on tours shorter than the target."""
        longest = min(2 * math.floor(self.tree.triangulation.problem.tether), self.target - 1)
        near = {0}
        for v in range(1, len(self.cluster)):
            # the greater effort raises bounds by a few percent
            effort = 1 if 2.1 * self.legs.bound(0, v, 1) <= longest else 2
            if 2 * self.legs.bound(0, v, effort) <= longest:
                near.add(v)
        return near

    def _check_node(
        self, node: dict[str, Any], alive: set[int], legs: set[Pair] | None, adjacent: set[Pair]
    ) -> None:
        for data in node.get("stages", ()):
            if self._is_possible(alive):
                stage = Stage(data, self._cuts, self.cluster, adjacent)
                alive, legs = self._strike_out(stage, alive, legs)
        if not self._is_possible(alive) or is_out_of_order(adjacent, self._before):
            self.leaves += 1
        elif legs is None:
            raise Refused("node: expected a stage before it branches")
        elif "pair" in node:
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
        absent = stage.reach if legs is None else UNLIMITED
        stage.reach = absent
        price = {}
        for u, v in self._near_legs(stage, alive) if legs is None else legs:
            r = self._price(stage, u, v)
            if r < absent:
                price[u, v] = r
        lowest = dict.fromkeys(alive, (absent, absent))
        for leg, r in price.items():
            for w in leg:
                a, b = lowest[w]
                if r < b:
                    lowest[w] = (min(a, r), max(a, r))
        cheapest = [2 * UNLIMITED] * self.clusters
        for v, (a, b) in lowest.items():
            cheapest[self.cluster[v]] = min(cheapest[self.cluster[v]], a + b)
        # lower bound on twice the excess of a tour over the target
        excess = 2 * (stage.constant - self.target) + sum(cheapest)
        above = {v: -cheapest[self.cluster[v]] for v in alive}
        left = {v for v in alive if excess + above[v] + sum(lowest[v]) < 0}
        if left and excess + 2 * (absent + min(lowest[v][0] + above[v] for v in left)) < 0:
            raise Refused("stage: its reach is too small")
        kept = set()
        for (u, v), r in price.items():
            if u in left and v in left:
                other = sum(lowest[w][1 if r <= lowest[w][0] else 0] for w in (u, v))
                if excess + above[u] + above[v] + 2 * r + other < 0:
                    kept.add((u, v))
        if kept == legs and left == alive:
            raise Refused("stage: strikes out nothing")
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
        at_node = [v.node for v in vertices]
        own = [math.floor(v.tether) - p for v, p in zip(vertices, stage.potential, strict=True)]
        for u in sorted(alive):
            child, node, beyond = -1, vertices[u].node, 0
            while node >= 0:
                # the node's own vertices, then those behind its other edges
                branches = [(node, node + 1, UNLIMITED)] if child < 0 else []
                d = node + 1 if child < 0 else end[child]
                while d < end[node]:
                    branches.append((d, end[d], math.ceil(nodes[d].farthest)))
                    d = end[d]
                for first, last, farthest in branches:
                    limit = stage.reach + stage.potential[u] - beyond + farthest + NEAR_LEG_ROUNDING
                    low = max(bisect.bisect_left(at_node, first), u + 1)
                    for v in range(low, bisect.bisect_left(at_node, last)):
                        if own[v] < limit and v in alive and self._pair(u, v) in self.allowed:
                            yield u, v
                child, node = node, nodes[node].parent
                beyond = math.floor(vertices[u].tether - nodes[child].farthest)


def _allowed(before: frozenset[Pair], clusters: int) -> set[Pair]:
    """Return the pairs of clusters that precedences allow to be adjacent (Lemma 15)."""
    apart = {(a, d) for a, b in before for c, d in before if b == c}
    apart |= {(d, a) for a, d in apart}
    inner = {a for a, _ in before} & {b for _, b in before}
    apart |= {(0, c) for c in inner}
    return {pair for pair in combinations(range(clusters), 2) if pair not in apart}


def is_out_of_order(adjacent: set[Pair], before: frozenset[Pair]) -> bool:
    """Return whether adjacent pairs form a path that precedences exclude (Lemma 15)."""
    near: dict[int, list[int]] = {}
    for g, h in adjacent:
        near.setdefault(g, []).append(h)
        near.setdefault(h, []).append(g)
    left = set(near)
    for start in sorted(near, key=lambda c: (c > 0, len(near[c]))):  # the base, then ends of paths
        rank = {start: 0}
        for sign, last in zip((1, -1), near[start], strict=False):
            c, previous, count = last, start, 0
            while c in left and c not in rank:
                # from the base: 1, 2, … from the front, -1, -2, … from the back
                count += 1
                rank[c] = sign * count
                onward = [d for d in near[c] if d != previous]
                c, previous = (onward[0] if onward else start), c
        if start in left and len(rank) > 1:
            left -= rank.keys()
            if all(_conflicts(rank, before, start == 0, sense) for sense in (1, -1)):
                return True
    return False


def _conflicts(rank: dict[int, int], before: frozenset[Pair], has_base: bool, sense: int) -> bool:
    """Return whether a path, run in one sense, has a pair of clusters in the wrong order."""
    for a, b in before:
        if has_base:
            # visits at the front, then those elsewhere, then those at the back
            p, q = (_visit_order(sense * rank.get(c, 0)) for c in (a, b))
        elif a in rank and b in rank:
            p, q = (float(sense * rank[c]) for c in (a, b))
        else:
            continue
        if p > q:
            return True
    return False


def _visit_order(rank: int) -> float:
    """Return a number that orders visits: 1, 2, … come first, -2, -1 last, 0 in between."""
    return -1.0 / rank if rank else 0.0


def bits(mask: int) -> Iterator[int]:
    """Yield the positions of the one bits of a number."""
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low

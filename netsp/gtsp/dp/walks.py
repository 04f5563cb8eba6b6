"""Relaxation: the cheapest closed walk of n visits, under prices and with limited memory.

Every tour is such a walk, whatever the memory. With a price p_g for each visit to goal g,

    length of a tour >= cost of the cheapest walk + Σ_g p_g,

because a tour visits every goal once and pays every price once. If the cheapest walk that has
vertex v at its k-th visit is no cheaper than an incumbent, no better tour has v there: the state
(k, v) is eliminated for good, whatever the prices later are.

Sums are rounded: `SUM_ROUNDING` times the size of their terms is subtracted from a bound.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.time_flags import NEVER, Flag
from netsp.gtsp.dp.label_kernels import Bounds, Graph, Labels, completions, extend, join, step_back
from netsp.gtsp.dp.ng_sets import Memory
from netsp.gtsp.gtsp_policy import WalkPolicy
from netsp.model.arrangement import UNORDERED

SUM_ROUNDING = 1e-12
"""Tolerance, relative, of the sums of a pass: some hundred additions with 1.1e-16 each."""


@dataclass(frozen=True)
class Walk:
    """The cheapest walk.

    Attributes
    ----------
    bound
        Lower bound on every tour shorter than the cutoff.
    rows
        Rows of the vertices visited, in order, without the base.
    labels
        Number of labels in the pass.
    """

    bound: float
    rows: Ints
    labels: int


class Walks:
    """The relaxation over some vertices.

    Parameters
    ----------
    cluster
        (V,) goal of each vertex.
    values
        (V, V) symmetric costs of legs, inf for missing legs.
    stop
        Flag of the clock; once it is set, `check` must raise.
    before
        Which goals come before which (`Instance.before`).
    policy
        Policy of walks.

    Attributes
    ----------
    alive
        (n + 1, V) whether a better tour may make its k-th visit at a vertex; vertices are in
        `order`, which groups them by goal.
    """

    def __init__(
        self,
        cluster: Ints,
        values: Floats,
        stop: Flag = NEVER,
        before: Bools = UNORDERED,
        policy: WalkPolicy = WalkPolicy(),
    ) -> None:
        self.policy = policy
        self.stop, self.ordered = stop, len(before) > 0
        self.n = int(cluster.max())
        self.alive: Bools = np.ones((self.n + 1, len(cluster)), dtype=bool)
        self.alive[0] = False
        self.alive[:, 0] = False
        self._group(cluster)
        self.set_values(values)
        self.memory = Memory(self._near(), policy.remembered_goals, before)
        if self.ordered:
            sooner = before.sum(axis=0)[self.goal]
            later = before.sum(axis=1)[self.goal]
            k = np.arange(self.n + 1)[:, None]
            self.alive &= (k > sooner) & (k <= self.n - later)

    def _group(self, cluster: Ints) -> None:
        """Order the vertices by goal, and find where each goal's vertices begin."""
        self.cluster = cluster
        self.order: Ints = np.argsort(cluster, kind="stable")
        self.goal: Ints = cluster[self.order]
        self.start: Ints = np.searchsorted(self.goal, np.arange(self.n + 2))

    def set_values(self, values: Floats) -> None:
        """Change the costs of legs.

        Once the flag is set they are incomplete, and `solve` raises before it uses them.
        """
        order = self.order if (np.diff(self.cluster) < 0).any() else None
        as_they_are = order is None and values.dtype == np.float64 and values.flags.c_contiguous
        self.values: Floats = values if as_they_are else np.empty(values.shape)
        self.longest = 0.0
        for rows in self._blocks():
            if not as_they_are:
                block = values[rows] if order is None else values[np.ix_(order[rows], order)]
                self.values[rows] = block
            block = self.values[rows]
            longest = np.abs(block).max(where=np.isfinite(block), initial=0.0)
            self.longest = max(self.longest, float(longest))

    def _blocks(self) -> Iterator[slice]:
        """Yield the rows of the matrix, some at a time, until the flag is set."""
        for first in range(0, len(self.goal), self.policy.block_rows):
            if self.stop[0]:
                return
            yield slice(first, first + self.policy.block_rows)

    def restrict(self, keep: Bools) -> None:
        """Remove the rows that are not marked; `set_values` must follow."""
        self.alive = np.ascontiguousarray(self.alive[:, keep[self.order]])
        self._group(self.cluster[keep])

    @property
    def left(self) -> Bools:
        """(V,) mask of the rows that a better tour may visit, the base among them."""
        out = np.zeros(len(self.goal), dtype=bool)
        out[self.order] = self.alive.any(axis=0)
        out[0] = True
        return out

    def solve(self, prices: Floats, cutoff: float, check: Callable[[], None]) -> Walk | None:
        """Return the cheapest walk below the cutoff, and eliminate states that no such walk visits.

        Parameters
        ----------
        prices
            (n + 1,) price of a visit to each goal.
        cutoff
            Length from which on tours are of no interest.
        check
            Called after every layer; may raise.

        Returns
        -------
        Walk or None
            None if there is no walk.
        """
        n, goal = self.n, self.goal
        cut = cutoff - float(prices[1:].sum()) + self.rounding(prices)
        layers = self._layers(prices, cut, check)
        pointer, cost, _ = layers[n]
        has_labels = pointer[1:] > pointer[:-1]
        ends = np.full(len(goal), np.inf)
        ends[has_labels] = cost[pointer[:-1][has_labels]] + self.values[0][has_labels]
        last = int(np.argmin(ends))
        if not (np.isfinite(ends[last]) and ends[last] <= cut):
            self.alive[:] = False
            return None
        rows = self._trace(last, layers, prices)
        if self.ordered:
            backward_layers = self._layers(prices, cut, check, backwards=True)
            for k in range(1, n + 1):
                self.alive[k] &= join(goal, prices, layers[k], backward_layers[n + 1 - k]) <= cut
        else:
            for k in range(1, (n + 1) // 2 + 1):
                through = join(goal, prices, layers[k], layers[n + 1 - k])
                self.alive[k] &= through <= cut
                self.alive[n + 1 - k] = self.alive[k]
        bound = float(ends[last]) + float(prices[1:].sum()) - self.rounding(prices)
        labels = sum(len(layer[1]) for layer in layers[1:])
        return Walk(bound, self.order[rows], labels)

    def rounding(self, prices: Floats) -> float:
        """Return the largest error of the sums of a pass."""
        return SUM_ROUNDING * (2.0 * float(np.abs(prices).sum()) + (self.n + 1) * self.longest)

    def _layers(
        self, prices: Floats, cut: float, check: Callable[[], None], *, backwards: bool = False
    ) -> list[Labels]:
        """Return the labels of walks from the base on, or from their end backwards."""
        n, goal = self.n, self.goal
        # a walk's k-th visit is the (n + 1 - k)-th from its end
        mirrored = np.concatenate([self.alive[:1], self.alive[:0:-1]])
        walk_alive, completion_alive = (
            (mirrored, self.alive) if backwards else (self.alive, mirrored)
        )
        lowest = np.empty((n + 1, len(goal)))
        onward = np.empty((n + 1, n + 1, len(goal)))
        completions(
            self._graph, prices, np.ascontiguousarray(completion_alive), lowest, onward, self.stop
        )
        check()
        bits, tables = self.memory.bits, self.memory.tables(backwards=backwards)
        none = np.zeros(0, dtype=np.int32)
        layers = [Labels(np.zeros(len(goal) + 1, dtype=np.int64), np.zeros(0), none)]
        with np.errstate(invalid="ignore"):  # inf - inf: no cut and no completion
            limits = np.where(walk_alive[1:], cut - lowest[:0:-1], -np.inf)
        first = self.values[0]
        kept = np.isfinite(first) & (first <= limits[0])
        layers.append(
            Labels(
                np.concatenate([[0], np.cumsum(kept)]),
                (first - prices[goal])[kept],
                np.ones(int(kept.sum()), dtype=np.int32),
            )
        )
        parts = self._parts()
        with ThreadPoolExecutor(self.policy.threads) as pool:
            for k in range(2, n + 1):
                check()

                def part(p: tuple[int, int], k: int = k) -> Labels:
                    bounds = Bounds(onward[n + 1 - k], limits[k - 1], cut)
                    labels = layers[k - 1]
                    return Labels(
                        *extend(self._graph, *p, bits, tables, labels, bounds, prices, self.stop)
                    )

                layers.append(_joined(list(pool.map(part, parts))))
        check()
        return layers

    @property
    def _graph(self) -> Graph:
        return Graph(self.values, self.goal, self.start)

    def _parts(self) -> list[tuple[int, int]]:
        """Return ranges of goals with about the same number of vertices, one for each thread."""
        shares = np.linspace(1, len(self.goal), self.policy.threads + 1)[1:-1].astype(int)
        ends = [1, *self.goal[np.minimum(shares, len(self.goal) - 1)].tolist(), self.n + 1]
        return [(a, b) for a, b in pairwise(ends) if a < b]

    def _trace(self, last: int, layers: list[Labels], prices: Floats) -> Ints:
        """Return the vertices (n,) of the cheapest walk, which ends at vertex `last`."""
        out = np.zeros(self.n, dtype=np.int64)
        out[-1] = last
        tables = self.memory.tables()
        label = int(layers[-1][0][last])
        for k in range(self.n - 1, 0, -1):
            _, cost, memory = layers[k + 1]
            out[k - 1], label = step_back(
                self._graph, prices, tables, out[k], cost[label], memory[label], layers[k]
            )
        return out

    def _near(self) -> Ints:
        """Return the goals (n + 1, n + 1) by their shortest leg from each goal, nearest first."""
        lowest = np.zeros((len(self.goal), self.n + 1))
        for rows in self._blocks():
            lowest[rows] = np.minimum.reduceat(self.values[rows], self.start[:-1], axis=1)
        goal_costs = np.minimum.reduceat(lowest, self.start[:-1], axis=0)
        return np.argsort(goal_costs, axis=1, kind="stable")


def _joined(parts: list[Labels]) -> Labels:
    """Join the labels of consecutive ranges of vertices; vertex 0 has none."""
    offset = 0
    pointers = [np.zeros(1, dtype=np.int64)]
    for pointer, cost, _ in parts:
        pointers.append(pointer[:-1] + offset)
        offset += len(cost)
    pointers.append(np.array([offset]))
    return Labels(
        np.concatenate(pointers),
        np.concatenate([cost for _, cost, _ in parts]),
        np.concatenate([memory for _, _, memory in parts]),
    )

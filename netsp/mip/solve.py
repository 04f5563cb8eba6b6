"""Cutting planes at fractional points, then lazy rounds at integer ones.

The root loop alternates the LP over few legs with two questions to the whole graph: which legs
price out negative, and which subtour cuts are violated. Every round yields a valid bound
(`netsp.mip.bound`). What cannot be in a better tour than the incumbent is then fixed by reduced
cost, and the small integer program that remains is solved, cut at its subtours, and solved again.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.errors import InputError
from netsp.lns import Instance, local_search
from netsp.mip.bound import dual_bound, fixing_costs, reduced_costs
from netsp.mip.program import Point, Program
from netsp.mip.subtours import component_cuts, fractional_cuts, tour_from
from netsp.result import Clock, OnProgress, Progress, Result, proven
from netsp.solution import Status
from netsp.travel import TravelGraph

Ints = npt.NDArray[np.int64]

BACKENDS = {
    "highs": "netsp.mip.highs_program:HighsProgram",
    "cbc": "netsp.mip.cbc_program:CbcProgram",
}
"""Who solves the program. `highs` re-solves the LP in process and is the faster; `cbc` is the
paper's shape."""

DEFAULT_BACKEND = "highs"

NEAREST = 6
"""Legs per vertex in the first LP."""

PRICED_PER_VERTEX = 4
"""Most legs per vertex that one pricing round brings in."""


class _Stop(Exception):
    """Time is up."""


def solve(
    graph: TravelGraph,
    *,
    time_limit: float | None = None,
    rng: np.random.Generator | None = None,
    params: Mapping[str, Any] | None = None,
    warm_start: Sequence[int] | None = None,
    on_progress: OnProgress | None = None,
) -> Result:
    """Solve the generalised TSP of a travel graph to proven optimality, or as far as time allows.

    params : ``backend`` (`BACKENDS`), ``search_rounds`` (perturbations of the first heuristic,
        default 30).
    warm_start : a tour to start from. Ctrl-C counts as the end of time.
    """
    run = _Run(graph, time_limit, rng or np.random.default_rng(0), params or {}, on_progress)
    try:
        run.start(warm_start)
        if graph.goal_count > 1:
            run.root()
            run.integer()
    except (_Stop, KeyboardInterrupt):
        run.report("stopped")
    return run.result()


class _Run:
    """State of one solve: incumbent, bound, model."""

    def __init__(
        self,
        graph: TravelGraph,
        time_limit: float | None,
        rng: np.random.Generator,
        params: Mapping[str, Any],
        on_progress: OnProgress | None,
    ) -> None:
        self.graph, self.rng, self.params = graph, rng, params
        self.clock = Clock(time_limit)
        self.on_progress = on_progress
        self.trace: list[Progress] = []
        self.tour: tuple[int, ...] | None = None
        self.length = math.inf
        self.bound = 0.0
        self.model: Program | None = None
        self.fixing: tuple[float, npt.NDArray[np.float64]] | None = None

    # incumbents and bounds

    def report(self, stage: str) -> None:
        row = Progress(
            self.clock.elapsed,
            stage,
            None if self.tour is None else self.length,
            self.bound,
            len(self.model.cuts) if self.model else 0,
            len(self.model.legs) if self.model else 0,
        )
        self.trace.append(row)
        if self.on_progress:
            self.on_progress(row)

    def offer(self, tour: Sequence[int]) -> None:
        """Take a tour as incumbent if it is one and is shorter."""
        if self.graph.is_tour(tour):
            length = self.graph.tour_length(tour)
            if length < self.length:
                self.tour, self.length = tuple(int(v) for v in tour), length

    def raise_bound(self, bound: float) -> None:
        self.bound = min(max(self.bound, bound), self.length)

    def check(self) -> None:
        if self.clock.up:
            raise _Stop

    @property
    def done(self) -> bool:
        return self.tour is not None and proven(self.length, self.bound)

    # stages

    def start(self, warm_start: Sequence[int] | None) -> None:
        graph = self.graph
        if warm_start is not None:
            self.offer(warm_start)
        if graph.goal_count == 0:
            self.offer([0])
            self.bound = self.length
            return
        if graph.goal_count == 1:
            v = int(np.argmin(graph.costs[0]))
            self.offer([0, v])
            self.bound = self.length
            self.report("one goal")
            return
        self.instance = Instance(graph)
        start_tour = None
        if self.tour is not None:
            position = np.empty(len(graph), dtype=np.int64)
            position[self.instance.order] = np.arange(len(graph))
            start_tour = position[np.array(self.tour)]
        rounds = int(self.params.get("search_rounds", 30))
        _, tour = local_search(
            self.instance, self.rng, rounds=rounds, clock=self.clock, start_tour=start_tour
        )
        self.offer(self.instance.original(tour))
        self.report("heuristic")

    def root(self) -> None:
        """The LP relaxation with all violated subtour cuts and all legs priced."""
        graph = self.graph
        self.model = self._program(self._first_legs(), np.arange(len(graph)))
        while not self.done:
            self.check()
            point = self.model.solve_relaxation(self.clock.left)
            if point is None:
                raise _Stop
            priced = self._price(point)
            cuts = fractional_cuts(point.x, point.legs, point.y, graph.cluster)
            self._round(point)
            self.report("root")
            if self.done or (priced == 0 and not cuts):
                return
            self.model.add_cuts(cuts)

    def integer(self) -> None:
        """The integer program on what reduced costs have not ruled out, with lazy cuts."""
        if self.done:
            return
        graph, root = self.graph, self.model
        assert root is not None
        assert self.fixing is not None
        bound, rise = self.fixing
        upper = np.triu(bound + rise <= self.length * (1.0 + 1e-9), 1)
        legs = np.argwhere(upper)
        tour_legs = _tour_legs(self.tour or ())
        legs = np.unique(np.vstack([legs, tour_legs]), axis=0)
        vertices = np.unique(np.concatenate([[0], legs.ravel()]))
        model = self._program(legs, vertices)
        model.add_cuts(root.cuts)
        self.model = model
        self.report("fixed")
        while not self.done:
            self.check()
            outcome = model.solve_integer(self.clock.left)
            point = outcome.point
            if outcome.infeasible:
                # nothing that survived the fixing beats the incumbent
                self.raise_bound(self.length)
                break
            if outcome.bound is not None:
                self.raise_bound(outcome.bound)
            if point is not None:
                self._round(point)
            self.report("integer")
            if self.done:
                break
            if point is None or not outcome.finished:
                raise _Stop
            cuts = component_cuts(np.rint(point.x), point.legs, np.rint(point.y), graph.cluster)
            if not cuts:
                # an optimal tour of the program: the bound stands at its own length
                break
            model.add_cuts(cuts)
        self.report("proven" if self.done else "integer")

    # parts

    def _program(self, legs: Ints, vertices: Ints) -> Program:
        name = self.params.get("backend", DEFAULT_BACKEND)
        if name not in BACKENDS:
            raise InputError(f"backend: unknown {name!r}; expected one of {', '.join(BACKENDS)}")
        module, attribute = BACKENDS[name].split(":")
        program: Program = getattr(importlib.import_module(module), attribute)(
            self.graph.cluster, self.graph.costs, legs, vertices
        )
        return program

    def _first_legs(self) -> Ints:
        """The nearest legs of every vertex, all legs to the base, and the incumbent's."""
        costs = self.graph.costs
        k = min(NEAREST, len(costs) - 1)
        near = np.argpartition(costs, k - 1, axis=1)[:, :k]
        u = np.repeat(np.arange(len(costs)), k)
        pairs = [np.column_stack([u, near.ravel()])]
        others = np.arange(1, len(costs))
        pairs.append(np.column_stack([np.zeros_like(others), others]))
        pairs.append(_tour_legs(self.tour or ()))
        legs = np.sort(np.vstack(pairs), axis=1)
        legs = legs[np.isfinite(costs[legs[:, 0], legs[:, 1]])]
        return np.unique(legs, axis=0)

    def _price(self, point: Point) -> int:
        """Update bound and reduced costs; bring in legs of negative reduced cost."""
        model, graph = self.model, self.graph
        assert model is not None
        assert point.duals is not None
        legs, vertices = reduced_costs(graph.costs, graph.cluster, model.cuts, point.duals)
        self.raise_bound(dual_bound(legs, vertices, graph.cluster, point.duals))
        fixing = fixing_costs(legs, vertices, graph.cluster, point.duals)
        if self.fixing is None or fixing[0] >= self.fixing[0]:
            self.fixing = fixing
        candidate = np.triu(legs, 1)
        candidate[model.legs[:, 0], model.legs[:, 1]] = 0.0
        tolerance = 1e-8 * self.length / (graph.goal_count + 1)
        rows, cols = np.nonzero(candidate < -tolerance)
        if len(rows) == 0:
            return 0
        order = np.argsort(candidate[rows, cols], kind="stable")
        taken = np.zeros(len(graph), dtype=np.int64)
        chosen = []
        for k in order:
            u, v = int(rows[k]), int(cols[k])
            if taken[u] < PRICED_PER_VERTEX or taken[v] < PRICED_PER_VERTEX:
                chosen.append((u, v))
                taken[u] += 1
                taken[v] += 1
        model.add_legs(np.array(chosen, dtype=np.int64))
        return len(chosen)

    def _round(self, point: Point) -> None:
        """Turn a point into a tour: join its cycles or follow its strongest legs, then improve."""
        graph = self.graph
        if np.abs(point.y - np.rint(point.y)).max(initial=0.0) < 1e-6:
            cycles = tour_from(point.x, point.legs, point.y)
            if len(cycles) == 1:
                self.offer(cycles[0])
            order = [int(graph.cluster[v]) for cycle in cycles for v in cycle if v != 0]
        else:
            order = _follow(point, graph.cluster)
        if sorted(order) != list(range(1, graph.goal_count + 1)):
            return
        first = self.instance.start[np.array([0, *order])]
        _, tour = local_search(
            self.instance, self.rng, rounds=0, clock=self.clock, start_tour=first
        )
        self.offer(self.instance.original(tour))

    def result(self) -> Result:
        if self.tour is None:
            return Result(
                None, None, self.bound or None, Status.NO_SOLUTION_FOUND, tuple(self.trace)
            )
        if self.done:
            status = Status.OPTIMAL
        else:
            status = Status.FEASIBLE
        return Result(self.tour, self.length, self.bound, status, tuple(self.trace))


def _tour_legs(tour: Sequence[int]) -> Ints:
    t = np.array(tour, dtype=np.int64)
    if len(t) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    return np.sort(np.column_stack([t, np.roll(t, -1)]), axis=1)


def _follow(point: Point, cluster: Ints) -> list[int]:
    """Order of goals by walking from the base along the heaviest leg to a goal not yet visited."""
    m = int(cluster.max())
    weight = np.zeros((m + 1, m + 1))
    np.add.at(weight, (cluster[point.legs[:, 0]], cluster[point.legs[:, 1]]), point.y)
    weight += weight.T
    left = np.ones(m + 1, dtype=bool)
    left[0] = False
    order, here = [], 0
    while left.any():
        here = int(np.argmax(np.where(left, weight[here] + 1e-9, -1.0)))
        left[here] = False
        order.append(here)
    return order

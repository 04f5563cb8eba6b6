"""Cutting planes at fractional points, then lazy rounds at integer ones.

The root loop alternates the LP over few legs with two questions to the whole graph: which legs
price out negative, and which subtour cuts are violated. Every round yields a valid bound
(`netsp.mip.bound`). What cannot be in a better tour than the incumbent is then fixed by reduced
cost, and the small integer program that remains is solved, cut at its subtours, and solved again.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.lns import Instance, local_search
from netsp.mip.bound import dual_bound, fixing_costs, reduced_costs
from netsp.mip.program import Point, Program
from netsp.mip.subtours import component_cuts, fractional_cuts, tour_from
from netsp.result import OnProgress, Result
from netsp.run import Run, Stop, read_params
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


PURGE_AFTER = 6
"""A cut that was slack for so many rounds in a row leaves the LP; separation finds it again."""


@dataclass(frozen=True)
class Params:
    """backend : one of `BACKENDS`. search_rounds : perturbations of the heuristic at the start."""

    backend: str = DEFAULT_BACKEND
    search_rounds: int = 500

    def __post_init__(self) -> None:
        if self.backend not in BACKENDS:
            raise ValueError(
                f"option 'backend': unknown {self.backend!r}; expected one of {', '.join(BACKENDS)}"
            )
        if self.search_rounds < 0:
            raise ValueError(
                f"option 'search_rounds': expected 0 or more, got {self.search_rounds}"
            )


def solve(
    graph: TravelGraph,
    *,
    time_limit: float | None = None,
    iteration_limit: int | None = None,
    rng: np.random.Generator | None = None,
    params: Mapping[str, Any] | None = None,
    warm_start: Sequence[int] | None = None,
    on_progress: OnProgress | None = None,
) -> Result:
    """Solve the generalised TSP of a travel graph to proven optimality, or as far as time allows.

    An iteration is one linear or integer program solved. params : see `Params`.
    """
    chosen = read_params(Params, "mip", params)
    run = MipRun(graph, time_limit, iteration_limit, on_progress)
    return run.solve(rng or np.random.default_rng(0), chosen, warm_start)


class MipRun(Run):
    """State of one solve: incumbent, bound, model."""

    def solve(
        self, rng: np.random.Generator, params: Params, warm_start: Sequence[int] | None
    ) -> Result:
        """Heuristic, root, integer rounds."""
        self.rng, self.params = rng, params
        self.model: Program | None = None
        self.fixing: tuple[float, npt.NDArray[np.float64]] | None = None
        self.slack_rounds: dict[int, int] = {}
        self.bound = 0.0
        try:
            self.offer(warm_start)
            if not self.trivial():
                self.start()
                self.root()
                self.integer()
        except (Stop, KeyboardInterrupt):
            self.report("stopped")
        return self.result()

    def report(self, stage: str, **more: Any) -> None:
        """As `Run.report`, with the size of the model."""
        size = {"cuts": len(self.model.cuts), "legs": len(self.model.legs)} if self.model else {}
        super().report(stage, **size, **more)

    # stages

    def start(self) -> None:
        """A first incumbent by local search, if the graph lets one be found."""
        graph = self.graph
        self.instance = Instance(graph)
        _, tour = local_search(
            self.instance,
            self.rng,
            rounds=self.params.search_rounds,
            clock=self.clock,
            start_order=None if self.tour is None else self.instance.order_of(self.tour),
        )
        self.offer(tour)
        self.report("heuristic")

    def root(self) -> None:
        """The LP relaxation with all violated subtour cuts and all legs priced."""
        graph = self.graph
        self.model = self._program(self._first_legs(), np.arange(len(graph)))
        while not self.done:
            self.check()
            point = self.model.solve_relaxation(self.clock.left)
            self.iterations += 1
            if point is None:
                # without an incumbent all legs are in the program from the start
                self.infeasible = self.model.infeasible and self.tour is None
                raise Stop
            before = self.bound
            priced = self._price(point)
            if self.bound is not None and before is not None and self.bound > before:
                self._purge(point)
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
        upper &= np.isfinite(graph.costs)
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
            self.iterations += 1
            point = outcome.point
            if outcome.infeasible:
                # nothing that survived the fixing beats the incumbent, if there is one
                self.infeasible = self.tour is None
                if self.tour is not None:
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
                raise Stop
            cuts = component_cuts(np.rint(point.x), point.legs, np.rint(point.y), graph.cluster)
            if not cuts:
                # an optimal tour of the program: the bound stands at its own length
                break
            model.add_cuts(cuts)
        self.report("proven" if self.done else "integer")

    # parts

    def _program(self, legs: Ints, vertices: Ints) -> Program:
        module, attribute = BACKENDS[self.params.backend].split(":")
        program: Program = getattr(importlib.import_module(module), attribute)(
            self.graph.cluster, self.graph.costs, legs, vertices
        )
        return program

    def _first_legs(self) -> Ints:
        """The nearest legs of every vertex, all legs to the base, and the incumbent's; all legs if
        there is no incumbent, so that an infeasible program means that there is no tour."""
        costs = self.graph.costs
        if self.tour is None:
            return np.argwhere(np.triu(np.isfinite(costs), 1))
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
        scale = self.length if self.tour is not None else float(graph.costs[0, 1:].max())
        tolerance = 1e-8 * scale / (graph.goal_count + 1)
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
        _, tour = local_search(
            self.instance, self.rng, rounds=0, clock=self.clock, start_order=[0, *order]
        )
        self.offer(tour)

    def _purge(self, point: Point) -> None:
        """Take cuts out of the LP that have been slack for some rounds."""
        model = self.model
        assert model is not None
        assert point.duals is not None
        rounds = self.slack_rounds
        for cut, price in zip(model.cuts, point.duals.cut, strict=True):
            rounds[id(cut)] = rounds.get(id(cut), 0) + 1 if price > -1e-9 else 0
        keep = np.array([rounds[id(cut)] < PURGE_AFTER for cut in model.cuts], dtype=bool)
        if not keep.all():
            for k in np.flatnonzero(~keep):
                del rounds[id(model.cuts[k])]
            model.keep_cuts(keep)


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

"""`mip`: heuristic, cutting planes at fractional points, then branching or lazy rounds.

The root (`netsp.mip.root`) bounds every tour and rules out most legs and vertices. What is left is
branched on (`netsp.mip.branching`), or, by the paper, an integer program that is solved, cut at its
subtours, and solved again.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.gtsp.cost_matrix import ROUNDED_FROM, CostMatrix
from netsp.gtsp.dp.dp_solver import bound_by_walks
from netsp.gtsp.dp.handover import Handover
from netsp.gtsp.limits import Limits
from netsp.gtsp.search import Search
from netsp.gtsp.searching import TURNS_SHARE, SearchingRun
from netsp.gtsp.solver_run import RunStopped
from netsp.gtsp.sparse_costs import SparseCosts
from netsp.gtsp.travel.graph import TravelGraph
from netsp.gtsp.travel.result import Result
from netsp.mip.branching import Tree
from netsp.mip.cost_fixing import surviving_legs
from netsp.mip.cover_bounds import GoalBound
from netsp.mip.cuts import Cut
from netsp.mip.goal_relaxation import MANY_CLASSES, bound_over_goals
from netsp.mip.lp_warm_start import WarmStart
from netsp.mip.merging import merge, search_and_merge, visited_classes
from netsp.mip.parity_cuts import odd_letters
from netsp.mip.program import IntegerProgram, Point
from netsp.mip.root import Root, tour_legs
from netsp.mip.subtours import component_cuts, cycles_of, heaviest_walk

BACKENDS = {
    "highs": "netsp.mip.highs:HighsRelaxation",
    "cbc": "netsp.mip.cbc_program:CbcRelaxation",
}
"""Who solves the programs. `highs` re-solves the LP in process, fast enough to branch on it; `cbc`
is the paper's shape, lazy rounds of an integer program."""

LAZY = {"cbc": "netsp.mip.cbc_program:CbcInteger"}
"""Who is not branched on."""

DEFAULT_BACKEND = "highs"

SECONDS_PER_LEG = 3e-4
"""With less time than this left for every leg the integer program is not begun: its presolve alone
would take that long, and cannot be stopped."""

MANY_GOALS = 100
"""With so many the bound of the goals comes first, and its cuts are those of the first LP."""

MERGED_FROM = 50
"""So many goals or more make it worth merging tours. In worlds of 60 and 100 goals at tether 500
searches ended in the shortest tour through their classes, and merging took 0.1 to 0.3 s; in worlds
of 200 and 500 they ended up to 0.1 % above it."""

GOALS_SHARE, CELLS_SHARE, CELLS_FOR = 0.1, 0.8, 17_000
"""Part of the time that is left which the bound from the goals alone may take. That of covers grows
with the square of the classes, as matrices do, up to the second for so many classes: the program
over 6000 classes closes in minutes what covers leave after half a minute, that over 14,000 takes
longer for a step than covers do."""

FIRST_PROGRAMS = 60
"""Of the bound from the goals alone, where the program over all classes follows. In a world of 200
goals at tether 300 the bound after 60 is 0.2 % below that after 300, which take 15 s more; the
program over classes makes up for it in a second or two."""

FIRST_S = 5.0
"""Where legs are held in rows nothing is known before a first cover is proven: it has so many
seconds, or half of the time."""

LEAST_SHARE, ROWS_FOR, CLOSES = 0.05, 20_000, 150
"""The same where legs are held in rows, with the cube of the classes, from the first up to four
fifths for so many: programs over rows are quick while few legs are left. Of 100 goals at tether
500 (limit 300 s), a world with 13,232 classes was proven after 61, 101 and 193 s with 8, 20 and
48 % of the time for covers, one with 20,476 after 284 and 146 s with 30 and 80 %. With more goals
than the last the program closes little: in a world of 200 with 12,632 classes 2.5 and 2.1 % were
left with 20 and 44 %."""

OUT_OF_REACH, LARGE = 0.02, 300
"""A larger gap than the first after covers, the program over all classes does not close where there
are more goals than the second: what time is left is worth more in a search. In two worlds of 500
goals, 40 s of the program closed 0.1 % and nothing, of a search nothing and 0.4 %. With 100 goals
it has closed such gaps."""

SEARCH_AGAIN = 0.5
"""Share of the last gap at which the classes that the LP visits are searched once more."""

HANDOVER = Handover(max_legs=600, max_legs_of_slow_walks=10_000, max_labels=25_000)
"""Sizes of the rest of a proof at which cuts take over from walks."""

CORE_FIRST = 3000
"""With more vertices a first bound, and a proof over a core of them, come before that over all,
also where goals are few."""

MOST_LEGS, TRIES = 30_000, 6
"""With more legs left neither branching nor an integer program would end; so many more searches may
find a tour that rules legs out, else the run ends."""


@dataclass(frozen=True)
class Params:
    """Options of the solver.

    Attributes
    ----------
    backend
        One of `BACKENDS`.
    search_rounds
        Rounds of ruin and recreate at the start, and again after the root.
    """

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


def solve(graph: TravelGraph, params: Params | None = None, limits: Limits | None = None) -> Result:
    """Solve the generalised TSP of a travel graph to proven optimality, or as far as time allows.

    An iteration is one linear or integer program solved. Source: McCammon & Hollinger 2017, section
    IV-B, for the program; the elimination by reduced costs is our own (docs/solvers.md).

    Parameters
    ----------
    graph : TravelGraph
        What to solve.
    params : Params, optional
        See `Params`.
    limits : Limits, optional
        Time, iterations, random generator, warm start, listener.

    Returns
    -------
    Result
        The best tour, and what is proven of it.
    """
    chosen, limits = params or Params(), limits or Limits()
    run = MipRun(graph, limits, search_rounds=chosen.search_rounds)
    return run.solve(chosen.backend, limits.warm_start)


class MipRun(SearchingRun):
    """State of one solve.

    Attributes
    ----------
    root
        While there is one: it knows the run, and matrices would wait for the collector of cycles.
    cuts
        That it had in the end.
    """

    root: Root | None = None
    cuts: Sequence[Cut] = ()
    _over_goals: GoalBound | None = None
    _costs: CostMatrix | None = None
    _merged: Ints = np.zeros(0, dtype=np.int64)

    def solve(
        self, backend: str, warm_start: Sequence[int] | None, *, walks: bool = False
    ) -> Result:
        """Heuristic, walks if wanted, root, branching."""
        with self.until_stopped():
            self.update_incumbent(warm_start)
            if not self.solve_if_trivial():
                self.find_first_tour()
                warm: WarmStart | None = None
                if not walks or len(self.graph) > CORE_FIRST:
                    with self.core() as core:
                        many = self.graph.roadmapped and self.graph.goal_count >= MANY_GOALS
                        if core is not None or many:
                            self.bound_by_goals(backend)
                            if self._root_is_hopeless:
                                search_and_merge(self, solve_merged)
                        if core is not None and not self.is_done:
                            # from here on: covers may take longer than its share
                            core.start_time_share()
                            # the tours found meanwhile are not all among its classes
                            core.known_length = min(core.known_length, self.length)
                            core.prove(backend, walks=walks)
                    warm = core.program() if core is not None else None
                if not (self.is_done and self._uses_sparse_costs):
                    self.prove(backend, walks=walks, warm=warm)
        if self.root is not None:
            self.cuts, self.root = self.root.lp.cuts, None
        return self.finish("proven" if self.is_done else "open")

    def prove(self, backend: str, *, walks: bool = False, warm: WarmStart | None = None) -> None:
        """Heuristic, walks if wanted, cutting planes, until it is proven.

        Parameters
        ----------
        warm
            What a proof over a core of the classes has left; it has searched already.
        """
        costs, self._costs = self._costs or self._left(), None
        if warm is None:
            self.search(costs)
            self.report("heuristic", vertices=len(costs))
        if walks and costs.rows is None:
            bound_by_walks(self, costs, handover=HANDOVER)
        if not (self.is_done or self.is_infeasible):
            self.cut(costs, backend, warm)

    def _left(self) -> CostMatrix:
        """The costs of legs, where covers have not come to them."""
        graph, over = self.graph, self._over_goals
        if not self._uses_sparse_costs or over is None or self.tour is None:
            return CostMatrix(graph)
        if over.cells is None:
            # no cover was proven in half of the time: what is left is worth more in a search
            search_and_merge(self, solve_merged)
            self.check()
            return CostMatrix(graph)
        odd = odd_letters(graph.signatures)
        with graph.on_clock(self.clock):
            return CostMatrix(graph, surviving_legs(graph, over.cells, self.length, self.tour, odd))

    def bound_by_goals(self, backend: str) -> None:
        """A first bound for who stops the run before the proof over all classes has one."""

        def prove(graph: TravelGraph, limits: Limits) -> tuple[Result, Sequence[Cut]]:
            run = MipRun(graph, limits)
            return run.solve(backend, None), run.cuts

        climbs = self._uses_covers
        part = (self._cover_time_share if climbs else GOALS_SHARE) * self.clock.left
        if self._uses_sparse_costs:
            part = max(part, min(FIRST_S, 0.5 * self.clock.left))
        share = Clock(part, within=self.clock) if self.clock.limit else self.clock
        # of classes left out the program over all classes says nothing
        follows = not climbs and self.graph.complete
        limits = Limits(share, iterations=FIRST_PROGRAMS if follows else None, rng=self.rng)

        graph = self.graph

        def costs() -> Floats:
            self._costs = CostMatrix(graph)
            return self._costs.values

        def keep(rows: SparseCosts) -> None:
            self._costs = CostMatrix(graph, rows)

        known = climbs and graph.legs_at_once and graph.complete
        in_rows = self._uses_sparse_costs
        try:
            self._over_goals = bound_over_goals(
                graph,
                prove,
                limits,
                self.tour if climbs else None,
                costs if known and not in_rows else None,
                self.on_cover_bound,
                keep if in_rows else None,
            )
        finally:
            self.raise_bound(graph.bound_in_any_class)
        self.raise_bound(self._over_goals.bound)
        self.report("goals", vertices=len(self.graph))

    @property
    def _uses_covers(self) -> bool:
        """Whether covers come first: with fewer goals the relaxation over classes is quicker than
        those below it."""
        many = len(self.graph) > MANY_CLASSES and self.graph.goal_count >= MANY_GOALS
        return many or self._uses_sparse_costs

    @property
    def _uses_sparse_costs(self) -> bool:
        """Whether there are so many classes that no matrix of legs is made."""
        graph = self.graph
        # with many goals all that covers prove is to hold for classes left out, too
        whole = graph.complete or graph.goal_count < MANY_GOALS
        known = whole and graph.legs_in_blocks and graph.knows_ways
        return known and len(graph) > ROUNDED_FROM

    @property
    def _cover_time_share(self) -> float:
        """Part of the time left that covers may take."""
        if self.graph.goal_count > LARGE:
            return CELLS_SHARE  # it is they that close the gap there
        if self._uses_sparse_costs and self.graph.goal_count <= CLOSES:
            least, share = LEAST_SHARE, CELLS_SHARE * (len(self.graph) / ROWS_FOR) ** 3
        else:
            least, share = GOALS_SHARE, CELLS_SHARE * (len(self.graph) / CELLS_FOR) ** 2
        return min(max(share, least), CELLS_SHARE)

    @property
    def _core_is_for_warm_start(self) -> bool:
        """Whether it is a core of which legs and cuts are wanted, not the tour, which the searches
        have found."""
        return self.outer is not None and self.graph.goal_count >= MANY_GOALS

    @property
    def _root_is_hopeless(self) -> bool:
        """Whether the program over all classes would not close what covers have left."""
        left = self.length - (self.bound or 0.0)
        return (
            self._uses_covers
            and self.graph.goal_count > LARGE
            and left > OUT_OF_REACH * self.length
        )

    def program(self) -> WarmStart | None:
        """The program of the root of a run over a core, by vertices of the outer run; also of one
        whose share of the time was over."""
        if self.root is None or self.outer is None:
            return None
        core = self.outer[1][self.root.costs.vertices]
        return WarmStart(core, core[self.root.lp.legs], list(self.root.lp.cuts), self.outer[1])

    def cut(self, costs: CostMatrix, backend: str, warm: WarmStart | None) -> None:
        """Root and branching over what is left of the vertices."""
        self._gap_searched = self.length
        if warm is not None:
            # a core is proven over lengths; over their bounds its cuts would prove less
            costs.measure(np.searchsorted(costs.vertices, warm.measured))
        self.root = root = Root(
            self, costs, _load(BACKENDS[backend]), self.round, warm, self._over_goals
        )
        root.solve()
        if not self.is_done and root.point is not None:
            before, used = self.length, np.flatnonzero(root.point.x > 1e-6)
            self.search(costs, used)
            self.report("heuristic", **root.size())
            if costs.exact is None and self.length < before:
                root.solve()
        if not self.is_done and costs.exact is not None:
            self.check()
            root.measure()
            self.search(costs)
            self.report("measured", **root.size())
            root.solve()
        for _ in range(TRIES):
            if self.is_done or root.size()["legs"] <= MOST_LEGS:
                break
            before = self.length
            self.search(costs)
            self.report("heuristic", **root.size())
            if self.length < before:
                root.solve()
        legs = root.size()["legs"]
        if self.is_done or legs > MOST_LEGS or self._core_is_for_warm_start:
            return
        if backend not in LAZY:
            Tree(root).solve()
        elif legs <= self.clock.left / SECONDS_PER_LEG:
            self.integer(root, _load(LAZY[backend]))

    # incumbents

    def search_near_incumbent(self) -> Ints:
        """Search near the incumbent, and merge the local optima found."""
        core = super().search_near_incumbent()
        self.merge_recent_local_optima()
        return core

    def on_cover_bound(self, bound: float, cells: int, classes: Ints) -> tuple[int, ...] | None:
        """As `SearchingRun.on_cover_bound`, and the shortest tour through the classes found."""
        super().on_cover_bound(bound, cells, classes)
        self.merge_recent_local_optima()
        return self.tour

    def search(self, costs: CostMatrix, more: Ints | None = None) -> None:
        """As `SearchingRun.search`, and the shortest tour through the classes found."""
        super().search(costs, more)
        self.merge_recent_local_optima()

    def merge_recent_local_optima(self) -> None:
        """Take the shortest tour through the classes in which the last searches ended, and the
        incumbent's, unless they have been merged before. Not where iterations are limited, as
        they would be those of another program."""
        few = self.graph.goal_count < MERGED_FROM or not self.graph.roadmapped
        idle = self.is_done or self.clock.is_up or self.iteration_limit < np.inf
        if few or idle or not self.local_optima or self.tour is None:
            return
        tours = list(dict.fromkeys([self.tour, *self.local_optima]))
        classes = visited_classes(tours)
        if not np.isin(classes, self._merged).all():
            self._merged = classes
            merge(self, tours, solve_merged, self.clock.part(TURNS_SHARE))

    def round(self, root: Root, point: Point) -> None:
        """Turn a point of the root into a tour, if all that is left is searched; else search the
        classes that it visits whenever the gap has shrunk to `SEARCH_AGAIN` of what it was."""
        whole = np.abs(point.y - np.rint(point.y)).max(initial=0.0) < 1e-6
        if self.searches_all_vertices(root.costs) or (whole and root.costs.exact is None):
            self.tour_at(root.costs, point, whole=whole)
            return
        gap = self.length - (self.bound or 0.0)
        if gap < SEARCH_AGAIN * self._gap_searched:
            self._gap_searched = gap
            self.search(root.costs, np.flatnonzero(point.x > 1e-6))

    def tour_at(self, costs: CostMatrix, point: Point, *, whole: bool) -> None:
        """Join the cycles of a point, or follow its strongest legs, and improve that."""
        cluster = costs.cluster
        if whole:
            cycles = cycles_of(point.x, point.legs, point.y)
            if len(cycles) == 1:
                self.update_incumbent(costs.vertices[cycles[0]].tolist())
            order = [int(cluster[v]) for cycle in cycles for v in cycle]
        else:
            order = heaviest_walk(point.legs, point.y, cluster)
        if sorted(order) != list(range(self.graph.goal_count + 1)):
            return
        search = Search(
            self.instance(costs, np.flatnonzero(point.x > 1e-6)), self.rng, order, self.clock
        )
        search.settle()
        self.offer_incumbent_from(search, rounded=costs.rounded)

    # the end

    def integer(self, root: Root, program: Any) -> None:
        """The integer program on what the root has not ruled out, with lazy cuts."""
        costs = root.costs
        legs = root.dead.legs_left()
        legs = np.unique(np.vstack([legs, tour_legs(root.tour())]), axis=0)
        vertices = np.unique(np.concatenate([[0], legs.ravel()]))
        model: IntegerProgram = program(
            costs.cluster, vertices, legs, costs.costs_of(legs), root.lp.cuts
        )
        size = {"legs": len(legs), "vertices": len(vertices)}
        self.report("fixed", cuts=len(model.cuts), **size)
        while not self.is_done:
            self.check()
            outcome = model.solve(self.clock)
            self.iterations += 1
            point = outcome.point
            if outcome.infeasible:
                # nothing that was not ruled out beats the incumbent, if there is one
                self.is_infeasible = self.tour is None
                if self.tour is not None:
                    self.raise_bound(self.cutoff)
                break
            if outcome.bound is not None:
                self.raise_bound(min(outcome.bound, self.cutoff))
            if point is not None:
                self.tour_at(costs, point, whole=True)
            self.report("integer", cuts=len(model.cuts), **size)
            if self.is_done:
                break
            if point is None or not outcome.finished:
                raise RunStopped
            cuts = component_cuts(np.rint(point.x), point.legs, np.rint(point.y), costs.cluster)
            if not cuts:
                # an optimal tour of the program: the bound stands at its own length
                break
            model.add_cuts(cuts)


def solve_merged(graph: TravelGraph, limits: Limits) -> Result:
    """Solve one with few classes, from a tour that other searches have found."""
    return MipRun(graph, limits, search_rounds=0).solve(DEFAULT_BACKEND, limits.warm_start)


def _load(path: str) -> Any:
    module, attribute = path.split(":")
    return getattr(importlib.import_module(module), attribute)

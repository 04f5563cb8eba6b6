"""Travel graph of a problem whose tour starts from a state of the robot.

The state is one more augmented goal, with a single class: that of the tether now. The solution is a
path from the state through all goals to the base, but solvers find closed tours through the base.
So the leg between base and state costs 0, and a surcharge is added to each other leg at either of
them. A tour has two legs at the base and two at the state. With the free leg it pays the surcharge
twice, without it four times. Twice the surcharge is more than the cost of some path, so the
shortest tour has the free leg, and its length is that of the shortest path plus twice the
surcharge.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock, TimeLimit
from netsp.base.errors import InputError, NetspError
from netsp.gtsp.cost_oracle import Estimate
from netsp.gtsp.instance import ParityOracle
from netsp.gtsp.travel.costs import rounded_down
from netsp.gtsp.travel.parity_distances import BITS_PER_ENTRY, ParityDistances
from netsp.gtsp.travel.result import OnProgress, Progress, Result
from netsp.hsignature import reduce
from netsp.model.bound_scope import OPTIMALITY_TOLERANCE, LowerBound, Scope
from netsp.model.problem import Goal, Problem
from netsp.model.solution import Status
from netsp.roadmap.leg_provider import Legs
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.reach_bounds import find_parity_paths
from netsp.roadmap.roadmap_policy import RoadmapPolicy
from netsp.roadmap.taut import TautRoadmap
from netsp.roadmap.taut_legs import TautLegs
from netsp.roadmap.travel_graph import TravelGraph

PATH_GAP_TOLERANCE = 10.0 * OPTIMALITY_TOLERANCE
"""Tolerance of the gap of a path that is called optimal."""


class GraphFromState(TravelGraph):
    """Travel graph whose tours lead from the base to the state at no cost, then through the goals.

    Attributes
    ----------
    start
        Vertex of the state.
    surcharge
        Added cost of the other legs at base and state.
    within
        Travel graph without the surcharge.
    start_tether
        (n, 3) taut tether at the start.
    """

    def __init__(
        self,
        within: TravelGraph,
        start: int,
        surcharge: float,
        start_tether: npt.NDArray[np.float64],
    ) -> None:
        super().__init__(
            within.cluster,
            within.signatures,
            within.tethers,
            _SurchargedLegs(within, start, surcharge),
            within.roadmap,
            classes=within.classes,
            min_tether_left_out=within.min_tether_left_out,
        )
        self.within, self.start, self.surcharge = within, start, surcharge
        self.start_tether = start_tether
        self.goal, self.before = within.goal, within.before
        self.excluded_by_rule = within.excluded_by_rule
        self.declared_scope = within.declared_scope
        if within.parity_oracle is not None:
            self.parity_oracle = partial(self._surcharged_parity, within.parity_oracle)

    def as_tour(self, order: tuple[int, ...]) -> tuple[int, ...]:
        """Return a closed tour in the direction in which the state follows the base."""
        if len(order) > 1 and order[-1] == self.start and order[1] != self.start:
            return (0, *reversed(order[1:]))
        return order

    def distances_between_goals(self, is_up: Callable[[], bool] = lambda: False) -> Floats:
        """Return the bounds of `TravelGraph`, with the surcharge."""
        places = np.arange(self.goal_count + 1)
        ends = int(self.cluster[self.start or 0])
        return add_surcharge(
            self.within.distances_between_goals(is_up), places, places, ends, self.surcharge
        )

    def _surcharged_parity(
        self, find: ParityOracle, is_up: Callable[[], bool]
    ) -> ParityDistances | None:
        """Return the distances of a parity oracle, with the surcharge."""
        paths = find(is_up)
        if paths is None or self.start is None:
            return None
        goal = int(self.cluster[self.start])
        base, start = (paths.ends == 0).any(axis=1), (paths.ends == goal).any(axis=1)
        length = paths.length + self.surcharge * (base.astype(np.float64) + start)
        # the leg between base and state is free
        rest = ~(base & start)
        odd = np.zeros((1, paths.odd.shape[1]), dtype=np.uint64)
        for a in self.signatures[self.start]:
            odd[0, (abs(a) - 1) // BITS_PER_ENTRY] ^= np.uint64(1 << (abs(a) - 1) % BITS_PER_ENTRY)
        return dataclasses.replace(
            paths,
            ends=np.vstack([paths.ends[rest], [[0, goal]]]),
            odd=np.vstack([paths.odd[rest], odd]),
            length=np.append(length[rest], 0.0),
        )

    def for_problem(self, result: Result) -> Result:
        """Return a solver's result on this graph as a result for the path from the state."""
        kept_bound = self._path_bound(result.bound)
        low = self._path_bound(
            self.bound_for_problem(result.bound, anywhere=result.tour is not None)
        )
        result = dataclasses.replace(
            result,
            trace=tuple(self._path_progress(r, anywhere=False) for r in result.trace),
            lower_bound=None if low is None else low.length,
            lower_bound_of=self.scope if low is None else low.scope,
        )
        if result.tour is None:
            return result
        tour = self.as_tour(result.tour)
        walk = result.walk or (*tour, 0)
        if walk[1] != self.start:
            walk = tuple(reversed(walk))
        if walk[1] != self.start:
            raise NetspError("internal: a tour does not start at the state")
        legs = [(u, v) for u, v in pairwise(walk[1:]) if u != v]
        length = sum(self.within.walk_length([u, v]) for u, v in legs)
        status = result.status
        if status.is_optimal:
            # the solver proves a millionth of the length with surcharge, several lengths of the
            # path
            if kept_bound is not None and self.legs_left_out:
                kept_bound = dataclasses.replace(kept_bound, scope=Scope.PART)
            closed = [
                b
                for b in (low, kept_bound)
                if b is not None and b.gap(length) <= PATH_GAP_TOLERANCE
            ]
            status = Status.optimal_of(closed[0].scope) if closed else Status.FEASIBLE
        elif status is Status.FEASIBLE and low is not None and low.proves(length):
            status = Status.optimal_of(low.scope)
        return dataclasses.replace(
            result,
            tour=tour,
            length=length,
            status=status,
            walk=walk[1:],
            lower_bound=None if low is None else low.capped_at(length).length,
        )

    def _path_bound(self, bound: LowerBound | None) -> LowerBound | None:
        """Return a bound on paths from the state, given one on closed tours, which include the
        surcharge twice."""
        if bound is None:
            return None
        return dataclasses.replace(bound, length=max(0.0, bound.length - 2.0 * self.surcharge))

    def min_length_along_left_out(self) -> float:
        """Return a lower bound on paths along a leg left out: the leg and the path home, with the
        surcharge of every tour."""
        first, leg, second = self.bounds_of_left_out().T
        shortest = float((leg + np.minimum(first, second)).min(initial=math.inf))
        return shortest + 2.0 * self.surcharge

    def min_length_by_tether(self, tether: float) -> float:
        """Return a lower bound on paths through a class whose tether is at least `tether` long.

        It is the path home from there, with the surcharge of every tour.
        """
        return tether + 2.0 * self.surcharge

    def progress_listener(self, listener: OnProgress | None) -> OnProgress | None:
        """Return a listener that receives progress of the path instead of the tour."""
        if listener is None:
            return None
        return lambda row: listener(self._path_progress(row))

    def _path_progress(self, row: Progress, *, anywhere: bool = True) -> Progress:
        off = 2.0 * self.surcharge
        return dataclasses.replace(
            row,
            incumbent=None if row.incumbent is None else row.incumbent - off,
            bound=self._path_bound(self.bound_for_problem(row.bound, anywhere=anywhere)),
            current=None if row.current is None else row.current - off,
            tour=None if row.tour is None else self.as_tour(row.tour),
        )


def add_surcharge(table: Floats, rows: Ints, columns: Ints, start: int, surcharge: float) -> Floats:
    """Return lengths with the surcharge on all legs of the base and the start, and 0 between them.

    Parameters
    ----------
    table
        (k, l) lengths.
    rows, columns
        (k,), (l,) vertices or clusters.
    start
        Vertex or cluster of the start.
    """
    out, ends = np.array(table), (0, start)
    out += surcharge * np.isin(rows, ends)[:, None]
    out += surcharge * np.isin(columns, ends)[None, :]
    for one, other in (ends, ends[::-1]):
        out[np.ix_(rows == one, columns == other)] = 0.0
    return out


class _SurchargedLegs(Legs):
    """Legs with the surcharge."""

    def __init__(self, within: TravelGraph, start: int, surcharge: float) -> None:
        self.within, self.start, self.surcharge = within, start, surcharge

    @property
    def left_out(self) -> set[tuple[int, int]]:  # type: ignore[override]
        return set(self.within.legs_left_out)

    def bounds_of_left_out(self) -> Floats:
        return self.within.bounds_of_left_out()

    def _charged(self, table: Floats, rows: Ints, columns: Ints) -> Floats:
        return add_surcharge(table, rows, columns, self.start, self.surcharge)

    def lengths(
        self, vertices: Ints, wanted: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        with self.within.on_clock(clock or self.within.clock):
            return self._charged(self.within.costs_among(vertices, wanted), vertices, vertices)

    def estimate(self, k: int) -> Estimate:
        """Return the estimate without the surcharge."""
        return self.within.oracle.estimate(k)

    def rounded(self, vertices: Ints, clock: Clock | None = None) -> Floats:
        with self.within.on_clock(clock or self.within.clock):
            out = self.within.costs_rounded(vertices)
        for k in np.flatnonzero(np.isin(vertices, (0, self.start))).tolist():
            row = self._charged(out[k : k + 1].astype(np.float64), vertices[k : k + 1], vertices)
            out[k] = out[:, k] = rounded_down(row)[0]
        return out

    def blocks(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Iterator[tuple[Ints, Floats]]:
        ends = np.isin(vertices, (0, self.start))
        with self.within.on_clock(clock or self.within.clock):
            for block_rows, costs in self.within.costs_in_blocks(vertices, rows):
                # the rows of base and state, and the columns of both in the other rows
                for k, columns in (ends[block_rows], slice(None)), (~ends[block_rows], ends):
                    sources, targets = vertices[block_rows[k]], vertices[columns]
                    part = costs[k][:, columns].astype(np.float64)
                    costs[np.ix_(k, np.arange(len(vertices))[columns])] = rounded_down(
                        self._charged(part, sources, targets)
                    )
                yield block_rows, costs

    def to_base(self) -> Floats:
        out = self.within.costs_to_base + self.surcharge
        out[self.start] = 0.0
        return np.asarray(out)

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        sources = vertices if rows is None else vertices[rows]
        with self.within.on_clock(clock or self.within.clock):
            return self._charged(self.within.lower_bounds(vertices, rows), sources, vertices)

    def path(self, u: int, v: int) -> Floats:
        return self.within.path(u, v)


def graph_from_state(
    problem: Problem,
    policy: RoadmapPolicy | None = None,
    *,
    classes: str = "all",
    max_classes: int | None = None,
    time_limit: TimeLimit = None,
    limits_paths: bool = True,
) -> GraphFromState:
    """Return the travel graph of a problem with a state; options are those of `TautRoadmap`.

    Raises
    ------
    InfeasibleError
        A goal that no tether within the limit reaches.
    InputError
        No taut tether to the state has its word, or what `TautRoadmap` raises.
    LimitReachedError
        The time was up, as in `TautRoadmap`.
    """
    state = problem.state
    assert state is not None
    policy = policy or RoadmapPolicy()
    clock = Clock.from_limit(time_limit)
    last = len(problem.goals) + 1
    limit = problem.tether_length
    plain = problem.model_copy(update={"state": None})
    placed = plain.model_copy(update={"goals": (*plain.goals, Goal(position=state.position))})
    word = reduce(state.signature)
    # the tether may be far longer than a limit that was lowered after the robot went out
    around = max([np.hypot(*(np.array(state.position[:2]) - plain.base[:2])), plain.scale])
    within = clock if limits_paths else None
    far = TautPaths(placed, policy.max_state_ratio * max(limit, float(around)), within, policy)
    try:
        planar = far.planar_length(0, last, word)
    except NetspError:
        raise InputError(
            f"state.signature: no taut tether to the robot has the word {list(state.signature)}"
        ) from None
    start_tether = far.path(0, last, word)
    # the goals have the usual classes, but that of the state may be one that no tour would use
    roadmap = TautRoadmap(
        plain,
        policy,
        classes=classes,
        max_classes=max_classes,
        time_limit=clock,
        limits_paths=limits_paths,
    )
    cluster = np.append(roadmap.cluster, last)
    words = [*roadmap.signatures, word]
    lengths = np.append(roadmap.planar, planar)
    legs = TautLegs(
        TautPaths(placed, limit + max(limit, planar), within, policy), cluster, words, lengths
    )
    part = TravelGraph(
        cluster,
        words,
        legs.to_base(),
        legs,
        roadmap="taut",
        between=legs.paths.bounds_in_any_class,
        classes=roadmap.rule if roadmap.complete else "shortest",
        min_tether_left_out=roadmap.min_tether_left_out,
        by_parity=partial(find_parity_paths, legs.paths),
    )
    part.excluded_by_rule = roadmap.rule != "all"
    if len(problem.precedences):
        part.before = np.zeros((last + 1, last + 1), dtype=bool)
        part.before[:last, :last] = problem.precedences
        part.before[last, 1:last] = True
    return from_state(part, len(cluster) - 1, start_tether)


def from_state(
    graph: TravelGraph, start: int, start_tether: npt.NDArray[np.float64] | None = None
) -> GraphFromState:
    """Return a travel graph one of whose vertices is the robot's present state.

    Parameters
    ----------
    graph : TravelGraph
        Graph with the state as one of its vertices, alone in its cluster; paths from all vertices
        to the base are finite.
    start_tether : ndarray, shape (n, 3), optional
        Taut tether at the state.
    """
    home = graph.costs_to_base
    state_cluster = graph.cluster[start]
    nearest = [
        home[graph.members(c)].min() for c in range(1, graph.goal_count + 1) if c != state_cluster
    ]
    some_path = float(home[start] + 2.0 * sum(nearest))
    line = np.zeros((0, 3)) if start_tether is None else start_tether
    return GraphFromState(graph, start, 0.505 * some_path, line)

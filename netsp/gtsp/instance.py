"""Instances of the generalised TSP: clusters of vertices, costs of legs, precedences.

A tour takes one vertex of each cluster. It starts and ends at vertex 0, the base, which is alone in
cluster 0 (or there is no base: `BaselessInstance`). Costs are symmetric, and measured by an oracle
when they are asked for. Solvers see an instance and nothing beneath it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.base.deprecated import renamed_parameters
from netsp.base.errors import InputError, counted
from netsp.gtsp.cost_oracle import CostOracle, Estimate, MatrixCosts
from netsp.gtsp.travel.costs import checked_costs, grain_of, rounded_down
from netsp.gtsp.travel.kept import with_bound
from netsp.gtsp.travel.parity_distances import ParityDistances
from netsp.model.arrangement import UNORDERED, respects_precedences
from netsp.model.bound_scope import LowerBound, Scope, strongest

if TYPE_CHECKING:
    from netsp.gtsp.travel.result import OnProgress, Result

Label = tuple[int, ...]
"""Numbers of the barriers that a path to a vertex crosses, negative in the other direction.

Vertices whose labels begin alike lie together. A barrier that a label holds an odd number of times
separates its vertex from the base."""

DistanceOracle = Callable[[Callable[[], bool]], Floats]
"""Function that returns lower bounds (n + 1, n + 1) on the legs between clusters, which also hold
for vertices left out of the instance; 0 where nothing is known. It takes a function that returns
whether the time is up."""

ParityOracle = Callable[[Callable[[], bool]], ParityDistances | None]
"""Function that returns distances between clusters by parity, or None if there is no time for them.
It takes a function that returns whether the time is up."""


class Instance:
    """Symmetric generalised TSP.

    Parameters
    ----------
    cluster : array_like of int, shape (V,)
        Cluster of each vertex; 0 for the base, 1, 2, … for the goals.
    oracle : CostOracle
        Costs of the legs.
    labels : sequence of Label, optional
        Label of each vertex, from which solvers find cuts.

    Attributes
    ----------
    legs_s : float
        Seconds spent measuring legs so far.
    clock : Clock or None
        Clock that ends the measuring of legs.
    before : ndarray of bool, shape (c + 1, c + 1)
        Whether a cluster must be visited before another, transitively closed; shape (0, 0) for
        none. With precedences, a tour counts from its first vertex on, in its direction.
    grain : float
        Lengths of tours are multiples of it; 0 where they may be anything.
    bound_in_any_class : float
        Lower bound that also holds for tours through vertices left out of the instance; 0 while
        nothing is known.
    declared_scope : Scope or None
        Scope that the creator of the instance states for its tours; None if it states none.
    distance_oracle : DistanceOracle or None
        Lower bounds between clusters; None to find them from a matrix of costs.
    parity_oracle : ParityOracle or None
        Distances between clusters by parity; None if they are not known.
    can_retrace : bool
        Whether legs are paths, so that a vehicle can go back along them.

    Examples
    --------
    >>> from netsp import solve_graph
    >>> instance = Instance.from_costs([[0, 2, 3], [2, 0, 2], [3, 2, 0]], clusters=[0, 1, 2])
    >>> solve_graph(instance).length
    7.0
    """

    bound_in_any_class = 0.0
    declared_scope: Scope | None = None
    grain = 0.0
    distance_oracle: DistanceOracle | None = None
    parity_oracle: ParityOracle | None = None
    can_retrace = False

    def __init__(
        self, cluster: npt.ArrayLike, oracle: CostOracle, labels: Sequence[Label] | None = None
    ) -> None:
        self.cluster: Ints = np.asarray(cluster, dtype=np.int64)
        self.labels = ((),) * len(self.cluster) if labels is None else tuple(labels)
        self.oracle = oracle
        self.legs_s = 0.0
        self.before: Bools = UNORDERED
        self.clock: Clock | None = None
        self._costs: Floats | None = None

    @classmethod
    def from_costs(
        cls, costs: npt.ArrayLike, clusters: npt.ArrayLike, base: int | None = 0
    ) -> Instance:
        """Return a symmetric generalised TSP from a matrix of costs.

        Parameters
        ----------
        costs : array_like, shape (V, V)
            Symmetric, not negative; inf where there is no leg. Costs within a cluster are never
            used.
        clusters : array_like of int, shape (V,)
            Cluster of each vertex, numbered 0, 1, … without gaps.
        base : 0 or None
            0: vertex 0 is alone in cluster 0, and the tour starts and ends there. None: there is
            no base; the tour takes one vertex of each cluster, cluster 0 among them.

        Returns
        -------
        Instance
            The instance; without a base, one for `netsp.solve_graph` only.

        Raises
        ------
        InputError
            Wrong shapes, asymmetric, negative or NaN costs, a missing cluster, another base, or
            infinities that leave no vertex of some cluster joined to vertex 0.

        Examples
        --------
        >>> costs = [[0, 3, 4], [3, 0, 5], [4, 5, 0]]
        >>> Instance.from_costs(costs, clusters=[0, 1, 2]).tour_length([0, 1, 2])
        12.0
        """
        if base is not None and (isinstance(base, bool) or base != 0):
            raise InputError(f"base: expected 0 or None, got {base!r}")
        matrix = MatrixCosts(*checked_costs(costs, clusters, base=base is not None))
        out = cls._of_matrix(matrix, has_base=base is not None)
        out.grain = grain_of(matrix.costs)
        return out

    @classmethod
    def _of_matrix(cls, matrix: MatrixCosts, *, has_base: bool) -> Instance:
        return (Instance if has_base else BaselessInstance)(matrix.cluster, matrix)

    def __getstate__(self) -> dict[str, Any]:
        """Pickle everything but the clock of the solver that runs on it."""
        return {**self.__dict__, "clock": None}

    def __repr__(self) -> str:
        """Return one line with the size of the instance."""
        return f"<Instance: {counted(self.goal_count, 'goal')}, {len(self) - 1} vertices>"

    def __len__(self) -> int:
        return len(self.cluster)

    @property
    def goal_count(self) -> int:
        """Number of goals."""
        return int(self.cluster.max(initial=0))

    @property
    def has_cost_matrix(self) -> bool:
        """True if costs were given as a matrix, which need not have a leg between every two
        vertices."""
        return isinstance(self.oracle, MatrixCosts)

    @property
    def scope(self) -> Scope:
        """Scope of the tours in this instance, and of the bounds that a solver proves over it."""
        return self.declared_scope or Scope.TRAVEL_GRAPH

    @property
    def min_length_left_out(self) -> float:
        """Lower bound on tours through vertices that were left out to save time or memory; inf if
        none were."""
        return math.inf

    @property
    def is_complete(self) -> bool:
        """True if no vertex was left out to save time or memory."""
        return self.min_length_left_out == math.inf

    def min_length_through(self, vertices: Ints) -> float:
        """Return a lower bound on tours through any of some vertices; inf for no vertices."""
        return 0.0 if len(vertices) else math.inf

    @property
    def costs(self) -> Floats:
        """(V, V) leg costs, symmetric; inf on the diagonal and within a cluster. Computed once,
        when first asked for; read-only."""
        if self._costs is None:
            costs = self._measured(np.arange(len(self)))
            costs.setflags(write=False)
            self._costs = costs
        return self._costs

    @property
    def costs_to_base(self) -> Floats:
        """(V,) costs of the legs from the base, without measuring any other; inf at the base."""
        out = self.oracle.to_base().copy()
        out[0] = np.inf
        return out

    def estimate(self, k: int) -> Estimate:
        """Return the estimate for the costs of all legs among k vertices; zero once all legs have
        been measured."""
        return self.oracle.estimate(k) if self._costs is None else Estimate(0.0, 0.0)

    @renamed_parameters(asked="wanted")
    def costs_among(self, vertices: npt.ArrayLike, wanted: Bools | None = None) -> Floats:
        """Return the costs of legs among some vertices, for solvers that drop the others first.

        Parameters
        ----------
        vertices : array_like of int, shape (k,)
            The vertices.
        wanted : ndarray of bool, shape (k, k), optional
            Symmetric; where it is false, the cost may be anything.

        Returns
        -------
        ndarray, shape (k, k)
            Costs; inf within a cluster.

        Raises
        ------
        LimitReachedError
            The clock was up before they were measured.
        """
        chosen = np.asarray(vertices, dtype=np.int64)
        if self._costs is not None:
            return np.asarray(self._costs[np.ix_(chosen, chosen)])
        return self._measured(chosen, wanted)

    def costs_rounded(self, vertices: npt.ArrayLike) -> Floats:
        """Return the costs of legs among some vertices in single precision, rounded down.

        Parameters
        ----------
        vertices : array_like of int, shape (k,)
            The vertices.

        Returns
        -------
        ndarray of float32, shape (k, k)
            Costs, none above the cost of its leg; inf within a cluster.

        Raises
        ------
        LimitReachedError
            The clock was up before they were measured.
        """
        chosen = np.asarray(vertices, dtype=np.int64)
        if self._costs is not None:
            return rounded_down(self.costs_among(chosen))
        with self._timed():
            return np.asarray(self.oracle.rounded(chosen, self.clock))

    def costs_in_blocks(
        self, vertices: npt.ArrayLike | None = None, rows: Ints | None = None
    ) -> Iterator[tuple[Ints, Floats]]:
        """Yield costs of legs in single precision, the rows of some vertices at a time.

        Parameters
        ----------
        vertices : array_like of int, shape (k,), optional
            Vertices between which legs are measured; by default all.
        rows : ndarray of int, shape (m,), optional
            Distinct positions among the vertices whose rows are yielded; by default all.

        Yields
        ------
        positions : ndarray of int, shape (r,)
            Positions whose rows are in this block; each position comes once.
        costs : ndarray of float32, shape (r, k)
            Their rows, rounded down as in `costs_rounded`; valid until the next block.

        Raises
        ------
        LimitReachedError
            The clock was up before they were measured.
        """
        chosen = np.arange(len(self)) if vertices is None else np.asarray(vertices, dtype=np.int64)
        blocks = self.oracle.blocks(chosen, rows, self.clock)
        while True:
            with self._timed():
                block = next(blocks, None)
            if block is None:
                return
            yield block

    def costs_of(self, us: Ints, vs: Ints) -> Floats:
        """Return the costs (k,) of single legs between vertices (k,) of different clusters."""
        if self._costs is not None:
            return np.asarray(self._costs[us, vs])
        with self._timed():
            return self.oracle.pairs(us, vs, self.clock)

    def lower_bounds(
        self, vertices: npt.ArrayLike | None = None, rows: npt.ArrayLike | None = None
    ) -> Floats:
        """Return lower bounds on the costs of legs among some vertices, without measuring them.

        Parameters
        ----------
        vertices : array_like of int, shape (k,), optional
            The vertices, by default all.
        rows : array_like of int, shape (r,), optional
            Positions among the vertices; only legs from these are bounded.

        Returns
        -------
        ndarray, shape (k, k) or (r, k)
            Bounds; inf within a cluster.

        Raises
        ------
        LimitReachedError
            The clock was up before they were computed.
        """
        chosen = np.arange(len(self)) if vertices is None else np.asarray(vertices, dtype=np.int64)
        positions = None if rows is None else np.asarray(rows, dtype=np.int64)
        bounds = self.oracle.lower_bounds(chosen, positions, self.clock)
        cluster = self.cluster[chosen]
        row_cluster = cluster if positions is None else cluster[positions]
        bounds[row_cluster[:, None] == cluster[None, :]] = np.inf
        return bounds

    @contextmanager
    def on_clock(self, clock: Clock | None) -> Iterator[None]:
        """End the measuring of legs by a clock while the body runs; None for no limit.

        `LimitReachedError` may be raised in the body.
        """
        outer_clock, self.clock = self.clock, clock
        try:
            yield
        finally:
            self.clock = outer_clock

    def _measured(self, vertices: Ints, wanted: Bools | None = None) -> Floats:
        with self._timed():
            return self.oracle.lengths(vertices, wanted, self.clock)

    @contextmanager
    def _timed(self) -> Iterator[None]:
        """Add the time of the body to `legs_s`."""
        begin = time.monotonic()
        try:
            yield
        finally:
            self.legs_s += time.monotonic() - begin

    def distances_between_goals(self, is_up: Callable[[], bool] = lambda: False) -> Floats:
        """Return lower bounds on the legs between goals, also through vertices left out.

        Parameters
        ----------
        is_up : callable
            Returns whether the time is up.

        Returns
        -------
        ndarray, shape (n + 1, n + 1)
            At most the cost of any leg between two goals, or between base and goal; 0 where nothing
            is known.
        """
        if self.distance_oracle is not None:
            return self.distance_oracle(is_up)
        out = np.zeros((self.goal_count + 1, self.goal_count + 1))
        if not self.has_cost_matrix:
            return out
        order = np.argsort(self.cluster, kind="stable")
        start = np.searchsorted(self.cluster[order], np.arange(len(out)))
        for a in range(len(out)):
            nearest = self.costs[self.members(a)].min(axis=0)
            out[a] = np.minimum.reduceat(nearest[order], start)
            out[a, a] = 0.0
        return out

    def subgraph(self, vertices: npt.ArrayLike) -> Instance:
        """Return the instance on some of the vertices.

        Parameters
        ----------
        vertices : array_like of int, shape (k,)
            The vertices, the base first.

        Returns
        -------
        Instance
            Its vertex k is vertex ``vertices[k]`` of this one; bounds on its tours are of the scope
            `PART`.
        """
        chosen = np.asarray(vertices, dtype=np.int64)
        labels = [self.labels[v] for v in chosen]
        part = Instance(self.cluster[chosen], PartCosts(self, chosen), labels)
        part.before, part.grain, part.declared_scope = self.before, self.grain, Scope.PART
        return part

    def unordered(self) -> Instance:
        """Return the instance without its precedences; its bounds hold for this one."""
        free = self.subgraph(np.arange(len(self)))
        free.before, free.declared_scope = UNORDERED, self.scope
        free.distance_oracle = self.distances_between_goals
        free.parity_oracle = self.parity_oracle
        return free

    def members(self, cluster: int) -> Ints:
        """Return the vertices of a cluster, in order."""
        return np.flatnonzero(self.cluster == cluster)

    def tour_length(self, tour: Sequence[int]) -> float:
        """Return the length of the closed tour through vertices.

        Parameters
        ----------
        tour : sequence of int
            Vertices, the first not repeated at the end.

        Returns
        -------
        float
            Length; 0 for fewer than two vertices.
        """
        return self.walk_length([*tour, tour[0]]) if len(tour) > 1 else 0.0

    def walk_length(self, walk: Sequence[int]) -> float:
        """Return the length of the legs from each vertex to the next."""
        w = np.asarray(walk, dtype=np.int64)
        used, at = np.unique(w, return_inverse=True)
        wanted = np.zeros((len(used), len(used)), dtype=bool)
        wanted[at[:-1], at[1:]] = wanted[at[1:], at[:-1]] = True
        among = self.costs_among(used, wanted)
        return float(among[at[:-1], at[1:]].sum())

    def is_tour(self, tour: Sequence[int]) -> bool:
        """Return whether vertices are a tour: from the base, one of every cluster, in order.

        Parameters
        ----------
        tour : sequence of int
            Vertices, the base not repeated at the end.
        """
        return self.why_no_tour(tour) is None

    def why_no_tour(self, tour: Sequence[int]) -> str | None:
        """Return the first reason why vertices are no tour (`is_tour`); None for a tour."""
        t = [int(v) for v in tour]
        if not t or t[0] != 0:
            return "it does not begin at vertex 0"
        if wrong := [v for v in t if not 0 <= v < len(self)]:
            return f"{wrong[0]} is not a vertex (0 to {len(self) - 1})"
        if len(t) > 1 and t[-1] == 0:
            return "vertex 0 is repeated at its end"
        clusters = self.cluster[t].tolist()
        visits: dict[int, int] = {}
        for v, cluster in zip(t, clusters, strict=True):
            if cluster in visits:
                return f"cluster {cluster} is visited twice (vertices {visits[cluster]} and {v})"
            visits[cluster] = v
        if missing := set(range(self.goal_count + 1)) - visits.keys():
            return f"no vertex of cluster {min(missing)}"
        if not respects_precedences(clusters, self.before):
            return "it breaks a precedence"
        return None

    def takes_one_of_each(self, vertices: Sequence[int]) -> bool:
        """Return whether vertices are exactly one of every cluster, in any order."""
        v = np.asarray(vertices, dtype=np.int64)
        inside = bool(((v >= 0) & (v < len(self))).all())
        clusters = int(self.cluster.max(initial=0)) + 1
        return inside and sorted(self.cluster[v].tolist()) == list(range(clusters))

    def for_problem(self, result: Result) -> Result:
        """Return a solver's result with the bound that holds for the problem.

        Parameters
        ----------
        result : Result
            Result of the solver.

        Returns
        -------
        Result
            The same result, with a bound that also holds for vertices left out, unless a rule
            excluded them.
        """
        trace = tuple(
            replace(row, bound=self.bound_for_problem(row.bound, anywhere=False))
            for row in result.trace
        )
        result = replace(result, trace=trace)
        if result.bound is None and (result.tour is None or not self.bound_in_any_class):
            return result
        bound = self.bound_for_problem(result.bound, anywhere=result.tour is not None)
        result = replace(result, lower_bound_of=self._scope_of_proof(result.lower_bound_of))
        return result if bound is None else with_bound(result, bound)

    def bound_for_problem(
        self, bound: LowerBound | None, *, anywhere: bool = True
    ) -> LowerBound | None:
        """Return the bound on the tours of the problem that a bound on this instance's tours
        proves.

        Parameters
        ----------
        bound : LowerBound or None
            Bound on the tours of this instance, or on those in the order given.
        anywhere : bool
            Whether to use `bound_in_any_class` as well, if it is better.

        Returns
        -------
        LowerBound or None
            Bound that also holds for tours through vertices left out, if these can be bounded.
        """
        scope = self.scope if bound is None else bound.scope
        bound, whole = self._with_left_out(bound, scope)
        if not anywhere or not self.bound_in_any_class or scope is Scope.PART:
            return bound
        everywhere = Scope.TRAVEL_GRAPH if scope is Scope.TRAVEL_GRAPH else Scope.ALL_TOURS
        free = LowerBound(self.bound_in_any_class, everywhere)
        return strongest(bound, free.for_part(whole, "it holds in any class, in any order"))

    def _scope_of_proof(self, scope: Scope) -> Scope:
        """Return the scope that a proof over this instance has by itself."""
        return scope

    def _with_left_out(
        self, bound: LowerBound | None, scope: Scope
    ) -> tuple[LowerBound | None, Scope]:
        """Return a bound that includes what was left out, and its scope."""
        return bound, scope

    def progress_listener(self, listener: OnProgress | None) -> OnProgress | None:
        """Return a listener to a solver's progress that passes on the bounds that hold for the
        problem; None for none."""
        if listener is None:
            return None
        return lambda row: listener(replace(row, bound=self.bound_for_problem(row.bound)))


def cheapest_per_cluster(costs: Floats, cluster: Ints, count: int) -> Ints:
    """Return the vertices of lowest cost, at most `count` of each cluster, in order."""
    order = np.lexsort((costs, cluster))
    grouped = cluster[order]
    rank = np.arange(len(order)) - np.searchsorted(grouped, grouped)
    return np.asarray(np.sort(order[rank < count]), dtype=np.int64)


class PartCosts(CostOracle):
    """Costs of another instance, among some of its vertices."""

    def __init__(self, whole: Instance, chosen: Ints) -> None:
        self.whole, self.chosen = whole, chosen

    def estimate(self, k: int) -> Estimate:
        """Return the estimate of the whole instance, or that of single legs if it is shorter."""
        return min(self.whole.oracle.estimate(k), super().estimate(k))

    @contextmanager
    def _on_clock(self, clock: Clock | None) -> Iterator[Instance]:
        with self.whole.on_clock(clock or self.whole.clock):
            yield self.whole

    def lengths(
        self, vertices: Ints, wanted: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return the costs (k, k) among vertices."""
        with self._on_clock(clock) as whole:
            return whole.costs_among(self.chosen[vertices], wanted)

    def rounded(self, vertices: Ints, clock: Clock | None = None) -> Floats:
        """Return the costs (k, k) among vertices in single precision, rounded down."""
        with self._on_clock(clock) as whole:
            return whole.costs_rounded(self.chosen[vertices])

    def blocks(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Iterator[tuple[Ints, Floats]]:
        """Yield blocks of costs of the whole instance."""
        with self._on_clock(clock) as whole:
            yield from whole.costs_in_blocks(self.chosen[vertices], rows)

    def pairs(self, us: Ints, vs: Ints, clock: Clock | None = None) -> Floats:
        """Return the costs (k,) of single legs."""
        return self.whole.costs_of(self.chosen[us], self.chosen[vs])

    def to_base(self) -> Floats:
        """Return the costs (k,) of the legs from the base; inf at the base."""
        return np.asarray(self.whole.costs_to_base[self.chosen])

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        """Return the bounds that the whole instance gives."""
        with self._on_clock(clock) as whole:
            return whole.lower_bounds(self.chosen[vertices], rows)


class BaselessInstance(Instance):
    """Generalised TSP without a base, for `netsp.solve_graph`.

    Solvers want a base. Every tour takes a vertex of the smallest cluster, so the shortest tour is
    the shortest of those through each of its vertices (`rooted`). Clusters of GTSPLIB usually
    include one of a single vertex, and then there is one such problem.
    """

    def __repr__(self) -> str:
        """Return one line with the size of the instance."""
        return (
            f"<Instance: {counted(self.cluster_count, 'cluster')} of {len(self)} vertices, no base>"
        )

    @property
    def cluster_count(self) -> int:
        """Number of clusters."""
        return int(self.cluster.max()) + 1

    @property
    def roots(self) -> Ints:
        """Vertices of the smallest cluster; of clusters of equal size, the first one."""
        return self.members(int(np.argmin(np.bincount(self.cluster))))

    @property
    def costs_to_base(self) -> Floats:
        """There is no base: InputError."""
        raise InputError("graph: has no base; expected solve_graph to be called with it")

    def is_tour(self, tour: Sequence[int]) -> bool:
        """Return whether vertices are a tour: exactly one of every cluster.

        Parameters
        ----------
        tour : sequence of int
            Vertices, the first not repeated at the end.
        """
        return self.takes_one_of_each(tour)

    def rooted(self, root: int) -> tuple[Instance, Ints]:
        """Return the tours through a vertex as those of an instance with a base.

        Parameters
        ----------
        root : int
            The vertex.

        Returns
        -------
        instance : Instance
            Instance whose base is the root, without the other vertices of the root's cluster.
        vertices : ndarray of int
            Vertex of this graph for each vertex of the instance.
        """
        root_cluster = int(self.cluster[root])
        vertices = np.r_[root, np.flatnonzero(self.cluster != root_cluster)]
        cluster = self.cluster[vertices]
        cluster = np.where(cluster == root_cluster, 0, cluster + (cluster < root_cluster))
        costs = self.costs[np.ix_(vertices, vertices)]
        out = self._of_matrix(MatrixCosts(costs, cluster), has_base=True)
        out.grain, out.declared_scope = self.grain, Scope.PART
        return out, vertices

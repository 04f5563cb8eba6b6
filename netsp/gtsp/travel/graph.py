"""The travel graph: where geometry ends and optimisation begins.

A vertex is an *augmented goal* (goal, homotopy class of the tether there); the clusters are the
goals; a tour takes one vertex of each cluster, starting and ending at vertex 0, the base with the
empty word. Because a leg's cost belongs to one class, every such tour is non-entangling, and every
non-entangling tour is one of them: NE-TSP is a symmetric generalised TSP on this graph.

Solvers see this class and nothing beneath it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.base.deprecated import warn_renamed
from netsp.base.errors import InputError, counted
from netsp.base.reprs import Drawn
from netsp.gtsp.cost_oracle import CostOracle, Estimate, MatrixCosts
from netsp.gtsp.gtsp_policy import CostPolicy
from netsp.gtsp.travel.costs import checked_costs, grain_of, rounded_down
from netsp.gtsp.travel.kept import with_bound
from netsp.gtsp.travel.leg_provider import LegProvider, Legs, as_oracle
from netsp.gtsp.travel.parity_distances import WaysByParity
from netsp.gtsp.travel.tether_blind_legs import Detours
from netsp.hsignature import Word
from netsp.model.arrangement import UNORDERED, respects_precedences
from netsp.model.bound_scope import LowerBound, Scope, strongest
from netsp.model.solution import EXACT_ROADMAPS

if TYPE_CHECKING:
    import networkx

    from netsp.gtsp.travel.result import OnProgress, Result
    from netsp.model.solution import KeptClasses


class Carrier(Protocol):
    """Provider of the classes that a tether comes into when it is carried to a goal near by."""

    def ways(self, goal: int, most: int) -> list[tuple[int, Word]]:
        """Return the goals nearest to one (from 1; 0 is the base), and the words of the shortest
        paths there."""

    def carried(self, start: int, word: Word, goal: int) -> Word | None:
        """Return the word of a tether that is carried along the shortest path from a goal, or the
        base, to another goal; None if it is too short."""

    def with_classes(
        self, wanted: Iterable[tuple[int, Word]], up: Callable[[], bool]
    ) -> TravelGraph:
        """Return the travel graph with more classes, given by goal (from 1) and word, as far as the
        tether reaches them and time is not up."""


class TravelGraph(Drawn):
    """Augmented goals with the costs of the legs between them.

    Parameters
    ----------
    cluster : array_like of int, shape (V,)
        0 for the base, k + 1 for goal k.
    signatures : sequence of Word
        The word of the tether at each vertex.
    tethers : array_like, shape (V,)
        Lengths of the taut tethers, in 3D.
    legs : CostOracle or LegProvider
        Costs of the legs; a `Legs` or a `LegProvider` also has their paths.
    roadmap : str
        Name of the roadmap it came from.
    detours : callable, optional
        Makes detours in any class; None without geometry.
    between : callable, optional
        Makes the bounds of `between_goals`.
    classes : {"all", "non-looping", "shortest"}, optional
        Which homotopy classes the roadmap holds.
    least_left_out : float
        No class left out for want of time or room has a shorter tether; inf if none is left out.
    carrier : Carrier, optional
        Adds classes that were left out.
    by_parity : callable, optional
        Function that finds the paths of `ways_by_parity`.

    Attributes
    ----------
    oracle : CostOracle
        Costs of the legs.
    legs_s : float
        Seconds spent measuring legs so far.
    start : int or None
        Vertex of the state that tours start from (`netsp.roadmap.from_state`); None for the base.
    start_tether : ndarray, shape (n, 3)
        The tether that is out at the start.
    bound_in_any_class : float
        No tour is shorter, whichever classes it takes, kept or left out; 0 while nothing is known.
    excluded_by_rule : bool
        Whether a rule (`non-looping`) left classes out, of whose tethers nothing is known.
    declared_scope : Scope or None
        Tours that the graph holds, where its maker knows; None to tell by roadmap and classes.
    grain : float
        Lengths of tours are multiples of it; 0 where they may be anything.
    goal : ndarray of int, shape (V,)
        Number of each vertex's goal, from 1: the cluster, but for goals with alternatives.
    before : ndarray of bool, shape (c + 1, c + 1)
        Whether a cluster must be visited before another, transitively closed; shape (0, 0) for
        none. With any, a tour means what it says only from its first vertex on.
    """

    picture: ClassVar[str] = "netsp.view.pictures.graph_picture:draw_classes"

    start: int | None = None
    start_tether: Floats
    bound_in_any_class = 0.0
    excluded_by_rule = False
    declared_scope: Scope | None = None
    grain = 0.0

    def __init__(
        self,
        cluster: npt.ArrayLike,
        signatures: Sequence[Word],
        tethers: npt.ArrayLike,
        legs: CostOracle | LegProvider,
        roadmap: str = "custom",
        detours: Callable[[bool, Callable[[], None], Clock | None], Detours] | None = None,
        between: Callable[[Callable[[], bool]], Floats] | None = None,
        classes: KeptClasses | None = None,
        least_left_out: float = math.inf,
        carrier: Carrier | None = None,
        by_parity: Callable[[Callable[[], bool]], WaysByParity | None] | None = None,
    ) -> None:
        self.carrier = carrier
        self.cluster: Ints = np.asarray(cluster, dtype=np.int64)
        self.signatures = tuple(signatures)
        self.tethers: Floats = np.asarray(tethers, dtype=float)
        self.roadmap = roadmap
        self.classes = classes
        self.least_left_out = least_left_out
        self.legs_s = 0.0
        self.start_tether = np.zeros((0, 3))
        self.goal = self.cluster
        self.before: Bools = UNORDERED
        self.clock: Clock | None = None
        self.oracle = as_oracle(legs)
        self._costs: Floats | None = None
        self._make_detours, self._between, self._by_parity = detours, between, by_parity
        self._detours: dict[bool, Detours] = {}
        self._place: dict[tuple[int, Word], int] | None = None

    @classmethod
    def from_costs(
        cls, costs: npt.ArrayLike, clusters: npt.ArrayLike, base: int | None = 0
    ) -> TravelGraph:
        """Return a symmetric generalised TSP as a travel graph, for solvers that need no geometry.

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
        TravelGraph
            A graph without geometry beneath it; without a base, one for `netsp.solve_graph` only
            (`BaselessGraph`).

        Raises
        ------
        InputError
            Wrong shapes, asymmetric, negative or NaN costs, a missing cluster, another base, or
            infinities that leave no vertex of some cluster joined to vertex 0.

        Examples
        --------
        >>> costs = [[0, 3, 4], [3, 0, 5], [4, 5, 0]]
        >>> TravelGraph.from_costs(costs, clusters=[0, 1, 2]).tour_length([0, 1, 2])
        12.0
        """
        if base is not None and (isinstance(base, bool) or base != 0):
            raise InputError(f"base: expected 0 or None, got {base!r}")
        table = MatrixCosts(*checked_costs(costs, clusters, base=base is not None))
        cluster = table.cluster
        kind: type[TravelGraph] = BaselessGraph if base is None else cls
        graph = kind(cluster, [()] * len(cluster), np.zeros(len(cluster)), table)
        graph.grain = grain_of(table.costs)
        return graph

    def __getstate__(self) -> dict[str, Any]:
        """Pickle everything but the clock of the solver that runs on it."""
        return {**self.__dict__, "clock": None}

    def to_networkx(self) -> networkx.Graph:
        """Return the travel graph as a NetworkX graph.

        Returns
        -------
        networkx.Graph
            Node v is vertex v, with the attributes ``goal`` (from 0 as in the problem, None at the
            base), ``cluster``, ``signature`` and ``tether`` (problem's units). Every leg that a
            tour can take is an edge whose ``weight`` is its length. Attributes of the graph are
            ``roadmap`` and ``classes``.

        Raises
        ------
        InputError
            NetworkX is not installed.

        Examples
        --------
        >>> from netsp import TravelGraph
        >>> costs = [[0, 3, 4], [3, 0, 5], [4, 5, 0]]
        >>> TravelGraph.from_costs(costs, clusters=[0, 1, 2]).to_networkx().edges[0, 2]["weight"]
        4.0
        """
        try:
            import networkx
        except ImportError:
            raise InputError("to_networkx: NetworkX is missing: pip install networkx") from None
        out = networkx.Graph(roadmap=self.roadmap, classes=self.classes)
        for v, signature in enumerate(self.signatures):
            out.add_node(
                v, goal=int(self.goal[v]) - 1 if self.goal[v] else None,
                cluster=int(self.cluster[v]), signature=tuple(int(x) for x in signature),
                tether=float(self.tethers[v]),
            )  # fmt: skip
        us, vs = np.nonzero(np.triu(np.isfinite(self.costs), 1))
        weights = self.costs[us, vs]
        out.add_weighted_edges_from(zip(us.tolist(), vs.tolist(), weights.tolist(), strict=True))
        return out

    def __repr__(self) -> str:
        """Return one line with the size of the graph."""
        return (
            f"<TravelGraph: {counted(self.goal_count, 'goal')}, {len(self) - 1} classes, "
            f"roadmap {self.roadmap}>"
        )

    def __len__(self) -> int:
        return len(self.cluster)

    @property
    def goal_count(self) -> int:
        """Number of goals."""
        return int(self.cluster.max(initial=0))

    @property
    def costs(self) -> Floats:
        """(V, V) leg costs, symmetric; inf on the diagonal and within a cluster. Computed once,
        when first asked for; read-only."""
        if self._costs is None:
            costs = self._measured(np.arange(len(self)))
            costs.setflags(write=False)
            self._costs = costs
        return self._costs

    def estimate(self, k: int) -> Estimate:
        """Return the estimate for the costs of all legs among k vertices.

        Parameters
        ----------
        k : int
            Number of vertices.

        Returns
        -------
        Estimate
            Time and memory; none once all legs have been measured.
        """
        return self.oracle.estimate(k) if self._costs is None else Estimate(0.0, 0.0)

    def costs_among(self, vertices: npt.ArrayLike, asked: Bools | None = None) -> Floats:
        """Return the costs of legs among some vertices, for solvers that drop the others first.

        Parameters
        ----------
        vertices : array_like of int, shape (k,)
            The vertices.
        asked : ndarray of bool, shape (k, k), optional
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
        return self._measured(chosen, asked)

    def costs_rounded(self, vertices: npt.ArrayLike) -> Floats:
        """Return the costs of legs among some vertices in single precision, rounded down.

        Parameters
        ----------
        vertices : array_like of int, shape (k,)
            The vertices.

        Returns
        -------
        ndarray of float32, shape (k, k)
            No cost is larger than that of the leg; inf within a cluster.

        Raises
        ------
        LimitReachedError
            The clock was up before they were found.
        """
        chosen = np.asarray(vertices, dtype=np.int64)
        if self._costs is not None:
            return rounded_down(self.costs_among(chosen))
        with self._timed():
            return np.asarray(self.oracle.rounded(chosen, self.clock))

    def costs_in_blocks(
        self, vertices: npt.ArrayLike | None = None, rows: Ints | None = None
    ) -> Iterator[tuple[Ints, Floats]]:
        """Yield costs of legs in single precision, those of some vertices at a time.

        Parameters
        ----------
        vertices : array_like of int, shape (k,), optional
            The vertices among which; all of them by default.
        rows : ndarray of int, shape (m,), optional
            Of which of them, as positions among them, no two alike; of each by default.

        Yields
        ------
        some : ndarray of int, shape (r,)
            Some of these; every one comes once.
        costs : ndarray of float32, shape (r, k)
            Of their legs, as of `costs_rounded`; to be used before the next are asked for.

        Raises
        ------
        LimitReachedError
            The clock was up before they were found.
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
        """Return the costs of single legs.

        Parameters
        ----------
        us : ndarray of int, shape (k,)
            Vertices that the legs begin at.
        vs : ndarray of int, shape (k,)
            Those at other ends, of other clusters.

        Returns
        -------
        ndarray, shape (k,)
            Their costs.
        """
        if self._costs is not None:
            return np.asarray(self._costs[us, vs])
        with self._timed():
            return self.oracle.pairs(us, vs, self.clock)

    @contextmanager
    def on_clock(self, clock: Clock | None) -> Iterator[None]:
        """End the measuring of legs by a clock while the body runs.

        Parameters
        ----------
        clock : Clock, optional
            The clock; None for no limit.

        Yields
        ------
        None
            The context in which `LimitReachedError` may be raised.
        """
        before, self.clock = self.clock, clock
        try:
            yield
        finally:
            self.clock = before

    def _measured(self, vertices: Ints, asked: Bools | None = None) -> Floats:
        with self._timed():
            return self.oracle.lengths(vertices, asked, self.clock)

    @contextmanager
    def _timed(self) -> Iterator[None]:
        """Add the time of the body to `legs_s`."""
        begin = time.monotonic()
        try:
            yield
        finally:
            self.legs_s += time.monotonic() - begin

    @property
    def roadmapped(self) -> bool:
        """True if every vertex has a leg to each vertex of another goal, as over a roadmap.

        Costs given as a matrix promise nothing.
        """
        return not isinstance(self.oracle, MatrixCosts)

    @property
    def complete(self) -> bool:
        """True if the roadmap left no class out to save time or memory."""
        return self.least_left_out == math.inf

    @property
    def measured(self) -> bool:
        """Deprecated: True once `estimate` is nothing."""
        warn_renamed("TravelGraph.measured", "TravelGraph.estimate")
        return self._costs is not None

    @property
    def quick_legs(self) -> bool:
        """Deprecated: True if the estimate of a leg is short by `CostPolicy`."""
        warn_renamed("TravelGraph.quick_legs", "TravelGraph.oracle.estimate")
        return CostPolicy().allows_single(self.oracle.estimate(2).seconds)

    @property
    def legs_at_once(self) -> bool:
        """Deprecated: True if the estimate of all legs is short by `CostPolicy`."""
        warn_renamed("TravelGraph.legs_at_once", "TravelGraph.oracle.estimate")
        return CostPolicy().allows_all(self.oracle.estimate(len(self)).seconds, len(self))

    @property
    def legs_in_blocks(self) -> bool:
        """Deprecated: True, because `costs_in_blocks` is available everywhere."""
        warn_renamed("TravelGraph.legs_in_blocks", "TravelGraph.costs_in_blocks")
        return True

    @property
    def geometric(self) -> bool:
        """True if the graph has the geometry of a problem, so that legs can be drawn."""
        return self._make_detours is not None

    def detours(self, *, sub_goals: bool, check: Callable[[], None] = lambda: None) -> Detours:
        """Return the detours in any class, for solvers that ignore the tether.

        Parameters
        ----------
        sub_goals : bool
            Whether there are sub-goals beside the obstacles.
        check : callable
            Called now and then; may raise to stop.

        Returns
        -------
        Detours
            The detours, made once.

        Raises
        ------
        InputError
            There is no geometry beneath this graph.
        """
        if self._make_detours is None:
            raise InputError(
                "solver: needs the geometry of a problem, and this travel graph has none"
            )
        if sub_goals not in self._detours:
            self._detours[sub_goals] = self._make_detours(sub_goals, check, self.clock)
        return self._detours[sub_goals]

    def between_goals(self, up: Callable[[], bool] = lambda: False) -> Floats:
        """Return lower bounds on the legs between goals, in any class.

        Parameters
        ----------
        up : callable
            Whether the time is up.

        Returns
        -------
        ndarray, shape (n + 1, n + 1)
            No more than any leg between two goals, or base and goal; 0 where nothing is known.
        """
        if self._between is not None:
            return self._between(up)
        out = np.zeros((self.goal_count + 1, self.goal_count + 1))
        if self.roadmapped:
            return out
        order = np.argsort(self.cluster, kind="stable")
        start = np.searchsorted(self.cluster[order], np.arange(len(out)))
        for a in range(len(out)):
            least = self.costs[self.members(a)].min(axis=0)
            out[a] = np.minimum.reduceat(least[order], start)
            out[a, a] = 0.0
        return out

    @property
    def knows_ways(self) -> bool:
        """True if `ways_by_parity` is available."""
        return self._by_parity is not None

    def ways_by_parity(self, up: Callable[[], bool] = lambda: False) -> WaysByParity | None:
        """Return the shortest paths between goals, by the rays that they cross oddly.

        Parameters
        ----------
        up : callable
            Whether the time is up.

        Returns
        -------
        WaysByParity or None
            None where they are not known.
        """
        return None if self._by_parity is None else self._by_parity(up)

    def subgraph(self, vertices: npt.ArrayLike) -> TravelGraph:
        """Return the travel graph on some of the vertices.

        Parameters
        ----------
        vertices : array_like of int, shape (k,)
            The vertices, the base first.

        Returns
        -------
        TravelGraph
            Its vertex k is vertex ``vertices[k]`` of this one; bounds on its tours are of the scope
            `PART`.
        """
        chosen = np.asarray(vertices, dtype=np.int64)
        part = TravelGraph(
            self.cluster[chosen],
            [self.signatures[v] for v in chosen],
            self.tethers[chosen],
            _PartOfLegs(self, chosen),
            self.roadmap,
        )
        part.goal, part.before, part.grain = self.goal[chosen], self.before, self.grain
        part.declared_scope = Scope.PART
        return part

    def unordered(self) -> TravelGraph:
        """Return the travel graph without its precedences.

        Returns
        -------
        TravelGraph
            Graph whose bounds hold for this one.
        """
        free = self.subgraph(np.arange(len(self)))
        free.before, free.declared_scope = UNORDERED, self.scope
        free.least_left_out, free._between = self.least_left_out, self.between_goals
        free._by_parity = self.ways_by_parity if self.knows_ways else None
        return free

    @property
    def costs_to_base(self) -> Floats:
        """(V,) costs of the legs from the base, without measuring any other; inf at the base."""
        out = self.oracle.to_base().copy()
        out[0] = np.inf
        return out

    def vertices_of(self, order: Sequence[int], words: Sequence[Word]) -> list[int] | None:
        """Return the vertices of goals with given words.

        Parameters
        ----------
        order : sequence of int
            Goals, from 1.
        words : sequence of Word
            The word of the tether at each.

        Returns
        -------
        list of int or None
            The vertices; None if one of them is not in the graph.
        """
        if self._place is None:
            self._place = {
                (int(g), w): v
                for v, (g, w) in enumerate(zip(self.goal, self.signatures, strict=True))
            }
        found = [self._place.get((c, tuple(w)), -1) for c, w in zip(order, words, strict=True)]
        return None if -1 in found else found

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
        some = None if rows is None else np.asarray(rows, dtype=np.int64)
        bounds = self.oracle.lower_bounds(chosen, some, self.clock)
        cluster = self.cluster[chosen]
        own = cluster if some is None else cluster[some]
        bounds[own[:, None] == cluster[None, :]] = np.inf
        return bounds

    def members(self, cluster: int) -> Ints:
        """Return the vertices of a cluster.

        Parameters
        ----------
        cluster : int
            0 for the base, k + 1 for goal k.

        Returns
        -------
        ndarray of int
            The vertices, in order.
        """
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
            Length, in the problem's units; 0 for fewer than two vertices.
        """
        return self.walk_length([*tour, tour[0]]) if len(tour) > 1 else 0.0

    def walk_length(self, walk: Sequence[int]) -> float:
        """Return the length of the legs from each vertex to the next.

        Parameters
        ----------
        walk : sequence of int
            Vertices.

        Returns
        -------
        float
            Length, in the problem's units.
        """
        w = np.asarray(walk, dtype=np.int64)
        used, at = np.unique(w, return_inverse=True)
        asked = np.zeros((len(used), len(used)), dtype=bool)
        asked[at[:-1], at[1:]] = asked[at[1:], at[:-1]] = True
        among = self.costs_among(used, asked)
        return float(among[at[:-1], at[1:]].sum())

    def is_tour(self, tour: Sequence[int]) -> bool:
        """Return whether vertices are a tour: from the base, one of every cluster, in order.

        Parameters
        ----------
        tour : sequence of int
            Vertices, the base not repeated at the end.

        Returns
        -------
        bool
            True for a tour.
        """
        return self.why_no_tour(tour) is None

    def why_no_tour(self, tour: Sequence[int]) -> str | None:
        """Return why vertices are no tour.

        Parameters
        ----------
        tour : sequence of int
            As of `is_tour`.

        Returns
        -------
        str or None
            The first thing that is wrong; None for a tour.
        """
        t = [int(v) for v in tour]
        if not t or t[0] != 0:
            return "it does not begin at vertex 0"
        if wrong := [v for v in t if not 0 <= v < len(self)]:
            return f"{wrong[0]} is no vertex (0 to {len(self) - 1})"
        if len(t) > 1 and t[-1] == 0:
            return "vertex 0 is repeated at its end"
        own = self.cluster[t].tolist()
        of: dict[int, int] = {}
        for v, cluster in zip(t, own, strict=True):
            if cluster in of:
                return f"cluster {cluster} is visited twice (vertices {of[cluster]} and {v})"
            of[cluster] = v
        if missing := set(range(self.goal_count + 1)) - of.keys():
            return f"no vertex of cluster {min(missing)}"
        if not respects_precedences(own, self.before):
            return "it breaks a precedence"
        return None

    def takes_one_of_each(self, vertices: Sequence[int]) -> bool:
        """Return whether vertices are exactly one of every cluster, in any order.

        Parameters
        ----------
        vertices : sequence of int
            Vertices.

        Returns
        -------
        bool
            True if so.
        """
        v = np.asarray(vertices, dtype=np.int64)
        inside = bool(((v >= 0) & (v < len(self))).all())
        clusters = int(self.cluster.max(initial=0)) + 1
        return inside and sorted(self.cluster[v].tolist()) == list(range(clusters))

    def path(self, u: int, v: int) -> Floats:
        """Return the leg from one vertex to another.

        Parameters
        ----------
        u : int
            Vertex that it starts at.
        v : int
            Vertex that it ends at.

        Returns
        -------
        ndarray, shape (n, 3)
            Polyline.
        """
        if not isinstance(self.oracle, Legs):
            raise InputError(
                f"no path from vertex {u} to {v}: this travel graph was made from costs"
            )
        return self.oracle.path(u, v)

    @property
    def scope(self) -> Scope:
        """Scope of the tours in this graph, and of the bounds that a solver proves over it."""
        if self.declared_scope is not None:
            return self.declared_scope
        if self.roadmap == "custom":
            return Scope.TRAVEL_GRAPH
        if self.roadmap not in EXACT_ROADMAPS:
            return Scope.ROADMAP
        whole = self.complete and not self.excluded_by_rule
        return Scope.ALL_TOURS if whole else Scope.KEPT_CLASSES

    def as_asked(self, result: Result) -> Result:
        """Return a solver's result with the bound that holds for the problem.

        Parameters
        ----------
        result : Result
            Of the solver.

        Returns
        -------
        Result
            The same result, with a bound that also holds for classes left out, unless a rule
            excluded them.
        """
        trace = tuple(
            replace(row, bound=self.bound_as_asked(row.bound, anywhere=False))
            for row in result.trace
        )
        result = replace(result, trace=trace)
        if result.bound is None and (result.tour is None or not self.bound_in_any_class):
            return result
        bound = self.bound_as_asked(result.bound, anywhere=result.tour is not None)
        if self.legs_left_out:
            result = replace(result, lower_bound_of=Scope.PART)
        return result if bound is None else with_bound(result, bound)

    def bound_as_asked(
        self, bound: LowerBound | None, *, anywhere: bool = True
    ) -> LowerBound | None:
        """Return the bound on the tours of the problem that a bound on this graph's tours proves.

        Parameters
        ----------
        bound : LowerBound or None
            Bound on the tours of this graph, or on those in the order given.
        anywhere : bool
            Whether to use the bound on tours in any class as well, if it is better.

        Returns
        -------
        LowerBound or None
            Bound on all tours, if the classes left out are known to have long tethers.
        """
        own = self.scope if bound is None else bound.scope
        whole = self._with_classes_left_out(own)
        if bound is not None and self.legs_left_out:
            bound = bound.or_elsewhere(
                self.least_along_left_out(), own,
                "a tour along a leg left out comes from the base and goes home",
            )  # fmt: skip
        if bound is not None and whole is not own:
            bound = bound.or_elsewhere(
                self.least_by_way_of(self.least_left_out), whole,
                "a tour by way of a class left out goes along its tether and back",
            )  # fmt: skip
        if not anywhere or not self.bound_in_any_class or own is Scope.PART:
            return bound
        everywhere = Scope.TRAVEL_GRAPH if own is Scope.TRAVEL_GRAPH else Scope.ALL_TOURS
        free = LowerBound(self.bound_in_any_class, everywhere)
        return strongest(bound, free.for_part(whole, "it holds in any class, in any order"))

    def _with_classes_left_out(self, own: Scope) -> Scope:
        """Return the scope of a bound of this graph once it includes the classes left out."""
        if self.excluded_by_rule:
            return own
        larger = {Scope.KEPT_CLASSES: Scope.ALL_TOURS, Scope.KEPT_IN_ORDER: Scope.GIVEN_ORDER}
        return larger.get(own, own)

    @property
    def legs_left_out(self) -> list[tuple[int, int]]:
        """Legs whose taut path was not found, as pairs of vertices. Their cost is the length of the
        path back to the base and out again."""
        return sorted(self.oracle.left_out) if isinstance(self.oracle, Legs) else []

    def bounds_of_left_out(self) -> Floats:
        """Return lower bounds for the legs left out.

        Returns
        -------
        ndarray, shape (k, 3)
            Bounds on the tether at one end, the leg, and the tether at the other end.
        """
        if not isinstance(self.oracle, Legs):
            return np.zeros((0, 3))
        return self.oracle.bounds_of_left_out()

    def least_along_left_out(self) -> float:
        """Return a lower bound on tours along a leg left out, which come from the base and go home.

        Returns
        -------
        float
            The bound; inf if none is left out.
        """
        return float(self.bounds_of_left_out().sum(axis=1).min(initial=math.inf))

    def least_by_way_of(self, tether: float) -> float:
        """Return a lower bound on tours through a class: twice its tether.

        Parameters
        ----------
        tether : float
            Length of a taut tether.

        Returns
        -------
        float
            The bound.
        """
        return 2.0 * tether

    def progress_listener(self, listener: OnProgress | None) -> OnProgress | None:
        """Return a listener to a solver's progress, with the bounds that hold for the problem.

        Parameters
        ----------
        listener : callable, optional
            Takes a `Progress`.

        Returns
        -------
        callable or None
            Listener for the solver.
        """
        if listener is None:
            return None
        return lambda row: listener(replace(row, bound=self.bound_as_asked(row.bound)))


def least_tethers(tethers: Floats, cluster: Ints, classes: int) -> Ints:
    """Return the vertices of shortest tether, at most `classes` of each cluster, in order."""
    order = np.lexsort((tethers, cluster))
    grouped = cluster[order]
    rank = np.arange(len(order)) - np.searchsorted(grouped, grouped)
    return np.asarray(np.sort(order[rank < classes]), dtype=np.int64)


class _PartOfLegs(Legs):
    """The legs of another travel graph, among some of its vertices."""

    def __init__(self, graph: TravelGraph, chosen: Ints) -> None:
        self.graph, self.chosen = graph, chosen

    @property
    def left_out(self) -> set[tuple[int, int]]:  # type: ignore[override]
        place = {int(v): k for k, v in enumerate(self.chosen)}
        return {
            (place[u], place[v]) for u, v in self.graph.legs_left_out if u in place and v in place
        }

    def bounds_of_left_out(self) -> Floats:
        return self.graph.bounds_of_left_out()

    def lengths(
        self, vertices: Ints, asked: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        with self.graph.on_clock(clock or self.graph.clock):
            return self.graph.costs_among(self.chosen[vertices], asked)

    def estimate(self, k: int) -> Estimate:
        """Return the estimate of the whole graph, or that for legs one by one if it is shorter."""
        return min(self.graph.oracle.estimate(k), super().estimate(k))

    def rounded(self, vertices: Ints, clock: Clock | None = None) -> Floats:
        with self.graph.on_clock(clock or self.graph.clock):
            return self.graph.costs_rounded(self.chosen[vertices])

    def blocks(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Iterator[tuple[Ints, Floats]]:
        with self.graph.on_clock(clock or self.graph.clock):
            yield from self.graph.costs_in_blocks(self.chosen[vertices], rows)

    def pairs(self, us: Ints, vs: Ints, clock: Clock | None = None) -> Floats:
        return self.graph.costs_of(self.chosen[us], self.chosen[vs])

    def to_base(self) -> Floats:
        return np.asarray(self.graph.costs_to_base[self.chosen])

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        with self.graph.on_clock(clock or self.graph.clock):
            return self.graph.lower_bounds(self.chosen[vertices], rows)

    def path(self, u: int, v: int) -> Floats:
        return self.graph.path(int(self.chosen[u]), int(self.chosen[v]))


class BaselessGraph(TravelGraph):
    """Travel graph without a base, for `netsp.solve_graph`: a generalised TSP.

    Solvers want a base. Every tour takes a vertex of the smallest cluster, so the shortest tour is
    the shortest of those through each of its vertices (`rooted`). Clusters of GTSPLIB usually
    include one of a single vertex, and then there is one such problem.
    """

    def __repr__(self) -> str:
        """Return one line with the size of the graph."""
        return (
            f"<TravelGraph: {counted(self.cluster_count, 'cluster')} of {len(self)} vertices, "
            "no base>"
        )

    @property
    def cluster_count(self) -> int:
        """Number of clusters."""
        return int(self.cluster.max()) + 1

    @property
    def roots(self) -> Ints:
        """Vertices of the smallest cluster, the first of those."""
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

        Returns
        -------
        bool
            True for a tour.
        """
        return self.takes_one_of_each(tour)

    def rooted(self, root: int) -> tuple[TravelGraph, Ints]:
        """Return the tours through a vertex as those of a graph with a base.

        Parameters
        ----------
        root : int
            The vertex.

        Returns
        -------
        graph : TravelGraph
            The root is its base; the other vertices of that cluster are left out.
        vertices : ndarray of int
            What its vertices are here.
        """
        own = int(self.cluster[root])
        vertices = np.r_[root, np.flatnonzero(self.cluster != own)]
        cluster = self.cluster[vertices]
        cluster = np.where(cluster == own, 0, cluster + (cluster < own))
        costs = self.costs[np.ix_(vertices, vertices)]
        table = MatrixCosts(costs, cluster)
        graph = TravelGraph(cluster, [()] * len(cluster), np.zeros(len(cluster)), table)
        graph.grain, graph.declared_scope = self.grain, Scope.PART
        return graph, vertices

"""The travel graph: where geometry ends and optimisation begins.

A vertex is an *augmented goal* (goal, homotopy class of the tether there); the clusters are the
goals. Because a leg's cost belongs to one class, every tour of this instance is non-entangling, and
every non-entangling tour is one of them: NE-TSP is a symmetric generalised TSP on this graph.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import Clock
from netsp.base.deprecated import (
    deprecated_method,
    deprecated_names,
    renamed_parameters,
    warn_renamed,
)
from netsp.base.errors import InputError, counted
from netsp.base.reprs import Drawn
from netsp.gtsp.cost_oracle import CostOracle, MatrixCosts
from netsp.gtsp.gtsp_policy import CostPolicy
from netsp.gtsp.instance import BaselessInstance, DistanceOracle, Instance, ParityOracle, PartCosts
from netsp.gtsp.travel.parity_distances import ParityDistances
from netsp.hsignature import Word
from netsp.model.bound_scope import LowerBound, Scope
from netsp.model.solution import EXACT_ROADMAPS
from netsp.roadmap.leg_provider import LegProvider, Legs, as_oracle
from netsp.roadmap.tether_blind_legs import Detours

if TYPE_CHECKING:
    import networkx

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


class TravelGraph(Instance, Drawn):
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
    between : DistanceOracle, optional
        Makes the bounds of `distances_between_goals`.
    classes : {"all", "non-looping", "shortest"}, optional
        Which homotopy classes the roadmap holds.
    min_tether_left_out : float
        No class left out for want of time or room has a shorter tether; inf if none is left out.
    carrier : Carrier, optional
        Adds classes that were left out.
    by_parity : ParityOracle, optional
        Makes the distances of `parity_oracle`.

    Attributes
    ----------
    start : int or None
        Vertex of the state that tours start from (`netsp.roadmap.from_state`); None for the base.
    start_tether : ndarray, shape (n, 3)
        The tether that is out at the start.
    excluded_by_rule : bool
        Whether a rule (`non-looping`) left classes out, of whose tethers nothing is known.
    goal : ndarray of int, shape (V,)
        Number of each vertex's goal, from 1: the cluster, but for goals with alternatives.

    Examples
    --------
    >>> from netsp import Problem, travel_graph
    >>> graph = travel_graph(Problem.load("problems/pool.json"))
    >>> graph.signatures[1], round(float(graph.tethers[1]), 2)  # shortest tether to goal 0
    ((1,), 3.72)
    """

    picture: ClassVar[str] = "netsp.view.pictures.graph_picture:draw_classes"

    start: int | None = None
    start_tether: Floats
    excluded_by_rule = False

    @renamed_parameters(least_left_out="min_tether_left_out")
    def __init__(
        self,
        cluster: npt.ArrayLike,
        signatures: Sequence[Word],
        tethers: npt.ArrayLike,
        legs: CostOracle | LegProvider,
        roadmap: str = "custom",
        detours: Callable[[bool, Callable[[], None], Clock | None], Detours] | None = None,
        between: DistanceOracle | None = None,
        classes: KeptClasses | None = None,
        min_tether_left_out: float = math.inf,
        carrier: Carrier | None = None,
        by_parity: ParityOracle | None = None,
    ) -> None:
        super().__init__(cluster, as_oracle(legs), signatures)
        self.tethers: Floats = np.asarray(tethers, dtype=float)
        self._check_vertices()
        self.roadmap, self.classes, self.carrier = roadmap, classes, carrier
        self.min_tether_left_out = min_tether_left_out
        self.distance_oracle, self.parity_oracle = between, by_parity
        self.start_tether = np.zeros((0, 3))
        self.goal = self.cluster
        self._make_detours = detours
        self._detours: dict[bool, Detours] = {}
        self._place: dict[tuple[int, Word], int] | None = None

    def _check_vertices(self) -> None:
        """Raise InputError unless there is a word and a tether for every vertex."""
        n = len(self.cluster)
        if len(self.labels) != n or self.tethers.shape != (n,):
            raise InputError(
                f"graph: {len(self.labels)} signatures and {self.tethers.size} tethers; expected "
                f"one of each for every vertex, {n}"
            )
        wrong = np.flatnonzero(~(self.tethers >= 0.0))
        if len(wrong):
            raise InputError(
                f"graph: tethers[{wrong[0]}] is {self.tethers[wrong[0]]:g}; expected a length"
            )

    @classmethod
    def from_costs(
        cls, costs: npt.ArrayLike, clusters: npt.ArrayLike, base: int | None = 0
    ) -> TravelGraph:
        """Return a symmetric generalised TSP as a travel graph without geometry.

        Parameters and errors are those of `netsp.gtsp.instance.Instance.from_costs`.

        Examples
        --------
        >>> costs = [[0, 3, 4], [3, 0, 5], [4, 5, 0]]
        >>> TravelGraph.from_costs(costs, clusters=[0, 1, 2]).tour_length([0, 1, 2])
        12.0
        """
        out = super().from_costs(costs, clusters, base)
        assert isinstance(out, TravelGraph)
        return out

    @classmethod
    def _of_matrix(cls, matrix: MatrixCosts, *, has_base: bool) -> TravelGraph:
        kind, n = TravelGraph if has_base else BaselessGraph, len(matrix.cluster)
        return kind(matrix.cluster, [()] * n, np.zeros(n), matrix)

    @property
    def signatures(self) -> tuple[Word, ...]:
        """Words of the tether at the vertices: their labels."""
        return self.labels

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

    @property
    def geometric(self) -> bool:
        """True if the graph has the geometry of a problem, so that legs can be drawn."""
        return self._make_detours is not None

    @property
    def can_retrace(self) -> bool:  # type: ignore[override]
        """True if legs are paths, so that the robot can go back along them."""
        return self.geometric

    @property
    def min_length_left_out(self) -> float:
        """Lower bound on tours through classes left out to save time or memory; inf if none is."""
        return self.min_length_by_tether(self.min_tether_left_out)

    def min_length_through(self, vertices: Ints) -> float:
        """Return a lower bound on tours through any of some vertices; inf for no vertices."""
        return self.min_length_by_tether(float(self.tethers[vertices].min(initial=np.inf)))

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
        """Return the travel graph without its precedences; its bounds hold for this one."""
        free = super().unordered()
        assert isinstance(free, TravelGraph)
        free.min_tether_left_out = self.min_tether_left_out
        return free

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
        whole = self.is_complete and not self.excluded_by_rule
        return Scope.ALL_TOURS if whole else Scope.KEPT_CLASSES

    def _scope_of_proof(self, scope: Scope) -> Scope:
        return Scope.PART if self.legs_left_out else scope

    def _with_left_out(
        self, bound: LowerBound | None, scope: Scope
    ) -> tuple[LowerBound | None, Scope]:
        """Return a bound that includes legs and classes left out, and its scope."""
        larger = {Scope.KEPT_CLASSES: Scope.ALL_TOURS, Scope.KEPT_IN_ORDER: Scope.GIVEN_ORDER}
        whole = scope if self.excluded_by_rule else larger.get(scope, scope)
        if bound is not None and self.legs_left_out:
            bound = bound.or_elsewhere(
                self.min_length_along_left_out(), scope,
                "a tour along a leg left out comes from the base and goes home",
            )  # fmt: skip
        if bound is not None and whole is not scope:
            bound = bound.or_elsewhere(
                self.min_length_left_out, whole,
                "a tour through a class left out goes along its tether and back",
            )  # fmt: skip
        return bound, whole

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

    def min_length_along_left_out(self) -> float:
        """Return a lower bound on tours along a leg left out, which come from the base and go home;
        inf if none is left out."""
        return float(self.bounds_of_left_out().sum(axis=1).min(initial=math.inf))

    def min_length_by_tether(self, tether: float) -> float:
        """Return a lower bound on tours through a class whose taut tether has some length: twice
        that length."""
        return 2.0 * tether

    as_asked = deprecated_method("as_asked", "for_problem")
    between_goals = deprecated_method("between_goals", "distances_between_goals")
    bound_as_asked = deprecated_method("bound_as_asked", "bound_for_problem")
    complete = deprecated_method("complete", "is_complete")
    least_along_left_out = deprecated_method("least_along_left_out", "min_length_along_left_out")
    least_by_way_of = deprecated_method("least_by_way_of", "min_length_by_tether")
    least_left_out = deprecated_method("least_left_out", "min_tether_left_out")

    @property
    def roadmapped(self) -> bool:
        """Deprecated: True unless the costs are a matrix."""
        warn_renamed("TravelGraph.roadmapped", "not TravelGraph.has_cost_matrix")
        return not self.has_cost_matrix

    @property
    def knows_ways(self) -> bool:
        """Deprecated: True if there is a `parity_oracle`."""
        warn_renamed("TravelGraph.knows_ways", "TravelGraph.parity_oracle")
        return self.parity_oracle is not None

    def ways_by_parity(self, up: Callable[[], bool] = lambda: False) -> ParityDistances | None:
        """Return the distances of the `parity_oracle` (deprecated)."""
        warn_renamed("TravelGraph.ways_by_parity", "TravelGraph.parity_oracle")
        return None if self.parity_oracle is None else self.parity_oracle(up)

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


class _PartOfLegs(PartCosts, Legs):
    """Legs of another travel graph, among some of its vertices."""

    def __init__(self, graph: TravelGraph, chosen: Ints) -> None:
        super().__init__(graph, chosen)
        self.graph = graph

    @property
    def left_out(self) -> set[tuple[int, int]]:  # type: ignore[override]
        place = {int(v): k for k, v in enumerate(self.chosen)}
        return {
            (place[u], place[v]) for u, v in self.graph.legs_left_out if u in place and v in place
        }

    def bounds_of_left_out(self) -> Floats:
        return self.graph.bounds_of_left_out()

    def path(self, u: int, v: int) -> Floats:
        return self.graph.path(int(self.chosen[u]), int(self.chosen[v]))


class BaselessGraph(BaselessInstance, TravelGraph):
    """Travel graph without a base, for `netsp.solve_graph`: a generalised TSP."""

    def __repr__(self) -> str:
        """Return one line with the size of the graph."""
        return super().__repr__().replace("Instance", "TravelGraph")


__getattr__ = deprecated_names(globals(), least_tethers="netsp.gtsp.instance:cheapest_per_cluster")

"""Goals with alternatives: the vertices of all their places are one cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.gtsp.cost_oracle import Estimate
from netsp.gtsp.instance import ParityOracle
from netsp.gtsp.travel.parity_distances import ParityDistances
from netsp.roadmap.leg_provider import Legs
from netsp.roadmap.travel_graph import TravelGraph


def with_choices(graph: TravelGraph, clusters: Ints) -> TravelGraph:
    """Return a travel graph over places as one over goals that are choices among places.

    Parameters
    ----------
    graph : TravelGraph
        Graph whose clusters are places.
    clusters : ndarray of int, shape (places + 1,)
        Goal of each place, the base (0) first.

    Returns
    -------
    TravelGraph
        Graph with the same vertices and legs, without legs between alternatives.
    """
    cluster = clusters[graph.cluster]
    out = TravelGraph(
        cluster, graph.signatures, graph.tethers, _LegsOfChoices(graph, cluster), graph.roadmap,
        between=partial(_goal_bounds, graph, clusters), classes=graph.classes,
        min_tether_left_out=graph.min_tether_left_out,
        by_parity=_parity_oracle(graph, clusters),
    )  # fmt: skip
    out.goal, out.excluded_by_rule = graph.goal, graph.excluded_by_rule
    out.declared_scope = graph.declared_scope
    return out


class _LegsOfChoices(Legs):
    """Legs of another travel graph, without those between alternatives."""

    def __init__(self, graph: TravelGraph, cluster: Ints) -> None:
        self.graph, self.cluster = graph, cluster

    @property
    def left_out(self) -> set[tuple[int, int]]:  # type: ignore[override]
        """Property of the graph over places."""
        return set(self.graph.legs_left_out)

    def bounds_of_left_out(self) -> Floats:
        return self.graph.bounds_of_left_out()

    def estimate(self, k: int) -> Estimate:
        """Return the estimate of the graph over places."""
        return self.graph.oracle.estimate(k)

    def lengths(
        self, vertices: Ints, wanted: Bools | None = None, clock: Clock | None = None
    ) -> Floats:
        with self.graph.on_clock(clock or self.graph.clock):
            out = np.array(self.graph.costs_among(vertices, wanted))
        own = self.cluster[vertices]
        out[own[:, None] == own[None, :]] = np.inf
        return out

    def rounded(self, vertices: Ints, clock: Clock | None = None) -> Floats:
        with self.graph.on_clock(clock or self.graph.clock):
            out = self.graph.costs_rounded(vertices)
        own = self.cluster[vertices]
        for c in np.unique(own).tolist():
            alike = np.flatnonzero(own == c)
            out[np.ix_(alike, alike)] = np.inf
        return out

    def blocks(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Iterator[tuple[Ints, Floats]]:
        own = self.cluster[vertices]
        with self.graph.on_clock(clock or self.graph.clock):
            for some, costs in self.graph.costs_in_blocks(vertices, rows):
                for c in np.unique(own[some]).tolist():
                    costs[np.ix_(own[some] == c, own == c)] = np.inf
                yield some, costs

    def pairs(self, us: Ints, vs: Ints, clock: Clock | None = None) -> Floats:
        return self.graph.costs_of(us, vs)

    def to_base(self) -> Floats:
        out = self.graph.costs_to_base
        out[0] = 0.0
        return out

    def lower_bounds(
        self, vertices: Ints, rows: Ints | None = None, clock: Clock | None = None
    ) -> Floats:
        with self.graph.on_clock(clock or self.graph.clock):
            return self.graph.lower_bounds(vertices, rows)

    def path(self, u: int, v: int) -> Floats:
        return self.graph.path(u, v)


def _parity_oracle(graph: TravelGraph, clusters: Ints) -> ParityOracle | None:
    if graph.parity_oracle is None:
        return None
    return partial(_distances_by_parity, graph.parity_oracle, clusters)


def _distances_by_parity(
    find: ParityOracle, clusters: Ints, is_up: Callable[[], bool]
) -> ParityDistances | None:
    """Return the distances between goals: those between any of their places."""
    places = find(is_up)
    if places is None:
        return None
    ends = np.sort(clusters[places.ends], axis=1)
    apart = ends[:, 0] != ends[:, 1]
    return replace(places, ends=ends[apart], odd=places.odd[apart], length=places.length[apart])


def _goal_bounds(graph: TravelGraph, clusters: Ints, up: Callable[[], bool]) -> Floats:
    """Return the bounds between goals: the least between any of their places."""
    places = graph.distances_between_goals(up)
    out = np.full((int(clusters.max()) + 1,) * 2, np.inf)
    rows, columns = np.meshgrid(clusters, clusters, indexing="ij")
    np.minimum.at(out, (rows, columns), places)
    np.fill_diagonal(out, 0.0)
    return out

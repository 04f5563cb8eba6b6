"""The travel graph: where geometry ends and optimisation begins.

A vertex is an *augmented goal* (goal, homotopy class of the tether there); the clusters are the
goals; a tour takes one vertex of each cluster, starting and ending at vertex 0, the base with the
empty word. Because a leg's cost belongs to one class, every such tour is non-entangling, and every
non-entangling tour is one of them: NE-TSP is a symmetric generalised TSP on this graph.

Solvers see this class and nothing beneath it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from netsp.hsignature import Word

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


class Legs(Protocol):
    """What a roadmap offers: lengths of legs between vertices, and their paths."""

    def lengths(self, vertices: Ints) -> Floats:
        """(k, k) symmetric leg lengths among the given vertices; inf within a cluster."""

    def lower_bounds(self, vertices: Ints) -> Floats:
        """(k, k) lower bounds on the leg lengths, much cheaper than the lengths."""

    def path(self, u: int, v: int) -> Floats:
        """(n, 3) polyline of the leg from vertex u to vertex v."""


class TravelGraph:
    """Augmented goals with the costs of the legs between them.

    Attributes
    ----------
    cluster : (V,) 0 for the base, k + 1 for goal k.
    signatures : V words, that of the tether at each vertex.
    tethers : (V,) taut tether lengths in 3D.
    roadmap : name of the roadmap it came from.
    """

    def __init__(
        self,
        cluster: npt.ArrayLike,
        signatures: Sequence[Word],
        tethers: npt.ArrayLike,
        legs: Legs,
        roadmap: str = "custom",
    ) -> None:
        self.cluster: Ints = np.asarray(cluster, dtype=np.int64)
        self.signatures = tuple(signatures)
        self.tethers: Floats = np.asarray(tethers, dtype=float)
        self.roadmap = roadmap
        self._legs = legs
        self._costs: Floats | None = None

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
            costs = self._legs.lengths(np.arange(len(self)))
            costs.setflags(write=False)
            self._costs = costs
        return self._costs

    def costs_among(self, vertices: npt.ArrayLike) -> Floats:
        """(k, k) leg costs among some vertices only, for solvers that eliminate the others first;
        inf within a cluster."""
        chosen = np.asarray(vertices, dtype=np.int64)
        if self._costs is not None:
            return np.asarray(self._costs[np.ix_(chosen, chosen)])
        return self._legs.lengths(chosen)

    def lower_bounds(self, vertices: npt.ArrayLike | None = None) -> Floats:
        """(k, k) lower bounds on the leg costs among some vertices (default all), without computing
        the legs; inf within a cluster."""
        chosen = np.arange(len(self)) if vertices is None else np.asarray(vertices, dtype=np.int64)
        bounds = self._legs.lower_bounds(chosen)
        cluster = self.cluster[chosen]
        bounds[cluster[:, None] == cluster[None, :]] = np.inf
        return bounds

    def members(self, cluster: int) -> Ints:
        """Vertices of a cluster."""
        return np.flatnonzero(self.cluster == cluster)

    def tour_length(self, tour: Sequence[int]) -> float:
        """Length of the closed tour through the given vertices."""
        t = np.asarray(tour)
        return float(self.costs[t, np.roll(t, -1)].sum()) if len(t) > 1 else 0.0

    def is_tour(self, tour: Sequence[int]) -> bool:
        """Whether it starts at the base and takes exactly one vertex of every cluster."""
        t = [int(v) for v in tour]
        return (
            bool(t)
            and t[0] == 0
            and all(0 <= v < len(self) for v in t)
            and sorted(self.cluster[t].tolist()) == list(range(self.goal_count + 1))
        )

    def path(self, u: int, v: int) -> Floats:
        """(n, 3) polyline of the leg from vertex u to vertex v."""
        return self._legs.path(u, v)

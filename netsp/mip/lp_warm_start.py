"""Warm start of the program over all vertices from a program over some of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from netsp.base.arrays import Ints
from netsp.gtsp.cost_matrix import CostMatrix
from netsp.mip.cuts import Cut


@dataclass(frozen=True)
class WarmStart:
    """Program over some of the vertices.

    Attributes
    ----------
    vertices
        Numbers of the vertices in the graph.
    legs
        (k, 2) legs of the program, by the same numbers.
    cuts
        Cuts over the vertices in their order.
    measured
        Vertices all of whose legs to one another have been measured.
    """

    vertices: Ints
    legs: Ints
    cuts: list[Cut]
    measured: Ints

    def lifted_cuts(self, costs: CostMatrix) -> list[Cut]:
        """Return the cuts over all vertices left, each in up to two versions.

        A vertex that is not in the program joins a vertex of the program: in one version the
        nearest one, in the other the one of its cluster that is nearest to the base. If the set
        must be a union of clusters, the vertex joins its cluster. A cut of (4) holds for any set
        without the base, so a poor choice only makes the cut weaker. Either version alone leaves a
        far larger gap.
        """
        place = np.searchsorted(costs.vertices, self.vertices)
        cluster, held = costs.cluster, costs.cluster[place]
        near, base_costs = costs.nearest_among(place), costs.base_costs
        of_cluster = np.empty_like(near)
        for c in range(int(cluster.max()) + 1):
            members = np.flatnonzero(held == c)
            of_cluster[cluster == c] = members[np.argmin(base_costs[place[members]])]
        near[place] = of_cluster[place] = np.arange(len(place))
        out: dict[tuple[bytes, object], Cut] = {}
        for partner in (near, of_cluster):
            for cut in self.cuts:
                is_whole = cut.teeth and cut.is_union_of_clusters(held)
                inside = cut.inside[of_cluster if is_whole else partner] | (cluster == cut.cluster)
                out.setdefault((inside.tobytes(), cut.teeth), replace(cut, inside=inside))
        return list(out.values())

    def rows_of_legs(self, costs: CostMatrix) -> Ints:
        """Return the rows (k, 2) of the legs in a cost matrix."""
        return np.searchsorted(costs.vertices, self.legs)

"""Cuts of the program: their sets, and their coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints


@dataclass(frozen=True)
class Cut:
    """The cut y(E(S)) + Σ y(E(T)) <= x(S \\ C) + `rhs`.

    A subtour cut has no teeth. A comb (`netsp.mip.blossoms`, `netsp.mip.combs`) has no C and an odd
    number of teeth, each partly in S, which is a union of clusters; teeth of more than two clusters
    are disjoint. If S is no union of clusters (`netsp.mip.parity_cuts`), all teeth are pairs. Of a
    tooth that is a pair, only legs with one end in S count.

    Attributes
    ----------
    inside
        (V,) mask of S.
    cluster
        Cluster C, -1 for none.
    teeth
        Sets of clusters T.
    """

    inside: Bools
    cluster: int
    teeth: tuple[tuple[int, ...], ...] = ()

    @property
    def rhs(self) -> float:
        """Right-hand side: Σ (|T| - 1) - (k + 1) / 2 for k teeth, 0 for none."""
        k = len(self.teeth)
        return sum(len(t) - 1 for t in self.teeth) - 0.5 * (k + 1) if k else 0.0

    def tooth_pairs(self, clusters: int) -> Bools:
        """Return the mask (m + 1, m + 1) of pairs of clusters within a tooth."""
        out = np.zeros((clusters, clusters), dtype=bool)
        for tooth in self.teeth:
            out[np.ix_(tooth, tooth)] = True
        return out

    def in_tooth(self, cluster: Ints, legs: Ints) -> Bools:
        """Return the mask (k,) of legs (k, 2) that count in a tooth."""
        if not self.teeth:
            return np.zeros(len(legs), dtype=bool)
        ends = cluster[legs]
        out = self.tooth_pairs(int(cluster.max()) + 1)[ends[:, 0], ends[:, 1]]
        if all(len(t) == 2 for t in self.teeth):
            out &= self.inside[legs[:, 0]] ^ self.inside[legs[:, 1]]
        return np.asarray(out)

    def is_union_of_clusters(self, cluster: Ints) -> bool:
        """Return whether S holds all vertices of each cluster or none."""
        size = np.bincount(cluster)
        held = np.bincount(cluster[self.inside], minlength=len(size))
        return bool(((held == 0) | (held == size)).all())

    def splits_clusters(self, cluster: Ints) -> bool:
        """Return whether only some of the legs between the clusters of a tooth count in it.

        This is the case if all teeth are pairs, and S is no union of clusters, or holds both or
        neither cluster of a pair because vertices were removed.
        """
        if not self.teeth or any(len(t) > 2 for t in self.teeth):
            return False
        holds = set(cluster[self.inside].tolist())
        is_crossed = all((a in holds) != (b in holds) for a, b in self.teeth)
        return not (is_crossed and self.is_union_of_clusters(cluster))

    def tooth_sets(self, cluster: Ints) -> list[Bools]:
        """Return masks of vertex sets, up to two for each tooth, a pair of clusters.

        A leg between the clusters counts in the tooth if both ends are in one of the sets.
        """
        out = []
        for a, b in self.teeth:
            is_of_pair = (cluster == a) | (cluster == b)
            first = np.where(cluster == a, self.inside, ~self.inside) & is_of_pair
            second = is_of_pair & ~first
            out += [part for part in (first, second) if part.any()]
        return out

    def left_side(self, cluster: Ints, legs: Ints) -> tuple[Ints, Floats]:
        """Return the indices of legs on the left side and their coefficients.

        The coefficient is 2 for a leg within both the handle and a tooth.
        """
        both = self.inside[legs[:, 0]] & self.inside[legs[:, 1]]
        coefficients = both.astype(np.float64) + self.in_tooth(cluster, legs)
        rows = np.flatnonzero(coefficients)
        return rows, coefficients[rows]


def cut_coefficients(cuts: Sequence[Cut], cluster: Ints, legs: Ints) -> Floats:
    """Return the coefficients (cuts, legs) of cuts in the relaxation without x.

    They are those of y(δ(S)) - y at S ∩ C - 2 Σ y(E(T)) >= -2 rhs: 1 for a leg that leaves S \\ C,
    -1 for a leg between S ∩ C and S \\ C, else 0; and 2 less in a tooth.
    """
    out = np.zeros((len(cuts), len(legs)))
    for k, cut in enumerate(cuts):
        u, v = cut.inside[legs[:, 0]], cut.inside[legs[:, 1]]
        is_in_c = cluster == cut.cluster
        at_c = (u & is_in_c[legs[:, 0]]).astype(np.int8) + (v & is_in_c[legs[:, 1]])
        out[k] = (u ^ v).astype(np.int8) - at_c
        if cut.teeth:
            out[k] -= 2.0 * cut.in_tooth(cluster, legs)
    return out

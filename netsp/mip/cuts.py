"""Cuts: which sets, what they bound, their coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints


@dataclass(frozen=True)
class Cut:
    """The cut y(E(S)) + Σ y(E(T)) <= x(S \\ C) + `room`: `inside` marks S, `cluster` is C, `teeth`
    are the sets of clusters T.

    A subtour cut has no teeth. A comb (`netsp.mip.blossoms`, `netsp.mip.combs`) has an odd number
    of them, each partly in S, a union of clusters, and no C (-1). Teeth of more than two clusters
    share none. Where S is no union of clusters (`netsp.mip.parity_cuts`), all teeth are pairs. Of a
    pair only legs with one end in S count.
    """

    inside: Bools
    cluster: int
    teeth: tuple[tuple[int, ...], ...] = ()

    @property
    def room(self) -> float:
        """Σ (|T| - 1) - (k + 1) / 2 with k teeth, else 0; (k - 1) / 2 if each is a pair."""
        k = len(self.teeth)
        return sum(len(t) - 1 for t in self.teeth) - 0.5 * (k + 1) if k else 0.0

    def tooth_pairs(self, clusters: int) -> Bools:
        """(m + 1, m + 1) pairs of different clusters within a tooth."""
        out = np.zeros((clusters, clusters), dtype=bool)
        for tooth in self.teeth:
            out[np.ix_(tooth, tooth)] = True
        return out

    def in_tooth(self, cluster: Ints, legs: Ints) -> Bools:
        """(k,) legs (k, 2) that are in a tooth."""
        if not self.teeth:
            return np.zeros(len(legs), dtype=bool)
        ends = cluster[legs]
        out = self.tooth_pairs(int(cluster.max()) + 1)[ends[:, 0], ends[:, 1]]
        if all(len(t) == 2 for t in self.teeth):
            out &= self.inside[legs[:, 0]] ^ self.inside[legs[:, 1]]
        return np.asarray(out)

    def is_union(self, cluster: Ints) -> bool:
        """Whether S holds all vertices of a cluster or none."""
        size = np.bincount(cluster)
        held = np.bincount(cluster[self.inside], minlength=len(size))
        return bool(((held == 0) | (held == size)).all())

    def splits(self, cluster: Ints) -> bool:
        """Whether all teeth are pairs, and S is no union of clusters, or holds both or neither of
        a pair (where vertices were forgotten): then not all legs between the clusters of a tooth
        are in it."""
        if not self.teeth or any(len(t) > 2 for t in self.teeth):
            return False
        holds = set(cluster[self.inside].tolist())
        return any((a in holds) == (b in holds) for a, b in self.teeth) or not self.is_union(
            cluster
        )

    def tooth_sets(self, cluster: Ints) -> list[Bools]:
        """For teeth that are pairs of clusters the sets of vertices, two for each, whose legs to
        one another are in the tooth."""
        out = []
        for a, b in self.teeth:
            there = np.where(cluster == a, self.inside, ~self.inside) & (
                (cluster == a) | (cluster == b)
            )
            other = ((cluster == a) | (cluster == b)) & ~there
            out += [part for part in (there, other) if part.any()]
        return out

    def within(self, cluster: Ints, legs: Ints) -> tuple[Ints, Floats]:
        """Rows of the legs on the left side, and how often they stand there: a leg may be within
        the handle and within a tooth."""
        both = self.inside[legs[:, 0]] & self.inside[legs[:, 1]]
        times = both.astype(np.float64) + self.in_tooth(cluster, legs)
        rows = np.flatnonzero(times)
        return rows, times[rows]


def cut_coefficients(cuts: Sequence[Cut], cluster: Ints, legs: Ints) -> Floats:
    """(cuts, legs) coefficients of y(δ(S)) - y at S ∩ C - 2 Σ y(E(T)) >= -2 room: 1 for a leg
    out of S \\ C, -1 for one between S ∩ C and S \\ C, else 0, and 2 less in a tooth."""
    out = np.zeros((len(cuts), len(legs)))
    for k, cut in enumerate(cuts):
        u, v = cut.inside[legs[:, 0]], cut.inside[legs[:, 1]]
        of_c = cluster == cut.cluster
        at_c = (u & of_c[legs[:, 0]]).astype(np.int8) + (v & of_c[legs[:, 1]])
        out[k] = (u ^ v).astype(np.int8) - at_c
        if cut.teeth:
            out[k] -= 2.0 * cut.in_tooth(cluster, legs)
    return out

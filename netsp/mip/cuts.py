"""Cuts: which sets, what they bound, their coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from netsp.arrays import Bools, Floats, Ints


@dataclass(frozen=True)
class Cut:
    """The cut y(E(S)) + y(F) <= x(S \\ C) + `room`: `inside` marks S, `cluster` is C, `teeth` are
    the pairs of clusters F.

    A subtour cut has no teeth. A 2-matching inequality (`netsp.mip.blossoms`) has an odd number of
    them, each with one end in S, a union of clusters, and no C (-1).
    """

    inside: Bools
    cluster: int
    teeth: tuple[tuple[int, int], ...] = ()

    @property
    def room(self) -> float:
        """(|F| - 1) / 2 with teeth, else 0."""
        return 0.5 * (len(self.teeth) - 1) if self.teeth else 0.0

    def bites(self, cluster: Ints, legs: Ints) -> Bools:
        """(k,) legs (k, 2) between the two clusters of a tooth."""
        out = np.zeros(len(legs), dtype=bool)
        if self.teeth:
            m = int(cluster.max()) + 1
            ends = np.sort(cluster[legs], axis=1)
            out = np.isin(ends[:, 0] * m + ends[:, 1], [g * m + h for g, h in self.teeth])
        return out

    def within(self, cluster: Ints, legs: Ints) -> Ints:
        """Rows of the legs on the left side."""
        both = self.inside[legs[:, 0]] & self.inside[legs[:, 1]]
        return np.flatnonzero(both | self.bites(cluster, legs))


def cut_coefficients(cuts: Sequence[Cut], cluster: Ints, legs: Ints) -> Floats:
    """(cuts, legs) coefficients of y(δ(S)) - y at S ∩ C - 2 y(F) >= -2 room: 1 for a leg out of
    S \\ C, -1 for one between S ∩ C and S \\ C or in a tooth, else 0."""
    out = np.zeros((len(cuts), len(legs)))
    for k, cut in enumerate(cuts):
        u, v = cut.inside[legs[:, 0]], cut.inside[legs[:, 1]]
        of_c = cluster == cut.cluster
        at_c = (u & of_c[legs[:, 0]]).astype(np.int8) + (v & of_c[legs[:, 1]])
        out[k] = (u ^ v).astype(np.int8) - at_c
        if cut.teeth:
            out[k] -= 2.0 * cut.bites(cluster, legs)
    return out

"""The cuts of a relaxation, and how long each has done nothing.

The pool owns its cuts and their counters together, so that a counter can never be another cut's:
what restricts or drops cuts does it to both.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.mip.cuts import Cut

IDLE, SLACK = 8, 2
"""A cut leaves the LP after so many rounds in a row without a price, rounds in which it was slack
counting twice (a cut between vertices that the LP leaves alone is tight and means nothing).
Separation finds it again if need be."""

MOST_KEPT = 0.9
"""Idle cuts are taken out when no more than this share would be left."""


class CutPool:
    """Cuts in the order of their rows.

    Attributes
    ----------
    idle
        (k,) rounds that each has done nothing.
    for_good
        (k,) which of them are never idle.
    """

    def __init__(self) -> None:
        self.cuts: list[Cut] = []
        self.idle: Ints = np.zeros(0, dtype=np.int64)
        self.for_good: Bools = np.zeros(0, dtype=bool)

    def __len__(self) -> int:
        return len(self.cuts)

    def add(self, cuts: Sequence[Cut], *, for_good: bool = False) -> None:
        """Take new cuts, which have not been idle yet."""
        self.cuts += cuts
        self.for_good = np.concatenate([self.for_good, np.full(len(cuts), for_good)])
        self.idle = np.concatenate([self.idle, np.zeros(len(cuts), dtype=np.int64)])

    def replace(self, cuts: Sequence[Cut]) -> None:
        """The same cuts in the same order, over other vertices."""
        if len(cuts) != len(self.cuts):
            raise ValueError(f"expected {len(self.cuts)} cuts, got {len(cuts)}")
        self.cuts = list(cuts)

    def keep(self, kept: Bools) -> None:
        """Drop all cuts but those marked."""
        self.cuts = [c for c, k in zip(self.cuts, kept, strict=True) if k]
        self.idle, self.for_good = self.idle[kept], self.for_good[kept]

    def count(self, prices: Floats, slack: Floats) -> None:
        """Count a round: prices and slacks of all cuts at its optimum."""
        rounds = np.where(slack > 1e-6, SLACK, 1)
        self.idle = np.where(prices < -1e-9, 0, self.idle + rounds)

    def active(self) -> Bools | None:
        """(k,) which cuts are not idle; None if too few are for it to be worth the while."""
        kept = (self.idle < IDLE) | self.for_good
        return None if kept.sum() >= MOST_KEPT * len(kept) else kept

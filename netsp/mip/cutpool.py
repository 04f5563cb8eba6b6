"""Cuts of a relaxation, and for how long each has been idle.

The pool holds the cuts and their counters together, so that no counter can belong to another cut.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.mip.cuts import Cut
from netsp.mip.mip_policy import CutPolicy

SLACK_TOLERANCE = 1e-6
"""Tolerance below which a cut counts as tight."""

PRICE_TOLERANCE = 1e-9
"""Tolerance below which a dual value counts as zero."""


class CutPool:
    """Cuts in the order of their rows.

    Attributes
    ----------
    idle
        (k,) rounds that each cut has been idle.
    permanent
        (k,) mask of the cuts that never count as idle.
    """

    def __init__(self, policy: CutPolicy = CutPolicy()) -> None:
        self.policy = policy
        self.cuts: list[Cut] = []
        self.idle: Ints = np.zeros(0, dtype=np.int64)
        self.permanent: Bools = np.zeros(0, dtype=bool)

    def __len__(self) -> int:
        return len(self.cuts)

    def add(self, cuts: Sequence[Cut], *, permanent: bool = False) -> None:
        """Add new cuts."""
        self.cuts += cuts
        self.permanent = np.concatenate([self.permanent, np.full(len(cuts), permanent)])
        self.idle = np.concatenate([self.idle, np.zeros(len(cuts), dtype=np.int64)])

    def replace(self, cuts: Sequence[Cut]) -> None:
        """Set the same cuts, in the same order, over other vertices."""
        if len(cuts) != len(self.cuts):
            raise ValueError(f"expected {len(self.cuts)} cuts, got {len(cuts)}")
        self.cuts = list(cuts)

    def keep(self, kept: Bools) -> None:
        """Drop all cuts but those marked."""
        self.cuts = [c for c, k in zip(self.cuts, kept, strict=True) if k]
        self.idle, self.permanent = self.idle[kept], self.permanent[kept]

    def count(self, prices: Floats, slack: Floats) -> None:
        """Count a round, from the dual values and slacks of all cuts at its optimum."""
        rounds = np.where(slack > SLACK_TOLERANCE, self.policy.slack_rounds, 1)
        self.idle = np.where(prices < -PRICE_TOLERANCE, 0, self.idle + rounds)

    def active(self) -> Bools | None:
        """Return the mask of cuts that are not idle; None if too few are idle to remove them."""
        kept = (self.idle < self.policy.max_idle_rounds) | self.permanent
        return None if kept.sum() >= self.policy.max_kept_share * len(kept) else kept

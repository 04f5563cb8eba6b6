"""When the root looks at the prices of all legs, and when it gives up."""

from __future__ import annotations

from dataclasses import dataclass, field

PRICE_EVERY, PRICE_SELDOM = 2, 32
"""Rounds of cuts between two looks at the prices of all legs, unless no cut is found; every look
that brings hardly a leg and raises the bound by little doubles the first, up to the second."""

WORTH = 0.02
"""Less than this share of the gap closed is hardly anything."""


@dataclass
class PricingSchedule:
    """When to look at the prices of all legs, and when to give up.

    Attributes
    ----------
    rounds
        Of the LP since the last look.
    every
        So many make the next one due.
    looks
        So far.
    gaps
        After every look.
    """

    rounds: int = 0
    every: int = PRICE_EVERY
    looks: int = 0
    gaps: list[float] = field(default_factory=list)

    @property
    def is_due(self) -> bool:
        """At first, and whenever enough rounds have passed."""
        return self.rounds % self.every == 0

    def note_pass(self, *, idle: bool) -> None:
        """Looks that bring nothing become seldom."""
        self.rounds = 1
        self.looks += 1
        self.every = min(2 * self.every, PRICE_SELDOM) if idle else PRICE_EVERY

    def stalled(self, gap: float, patience: int) -> bool:
        """Whether the last so many looks closed hardly anything of the gap."""
        self.gaps.append(gap)
        if len(self.gaps) <= patience:
            return False
        before = self.gaps[-1 - patience]
        return before - gap < WORTH * before

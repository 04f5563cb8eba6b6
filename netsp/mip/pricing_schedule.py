"""Schedule of the root: when all legs are priced, and when the root ends."""

from __future__ import annotations

from dataclasses import dataclass, field

from netsp.mip.mip_policy import SchedulePolicy


@dataclass
class PricingSchedule:
    """Count of rounds and pricing passes.

    Attributes
    ----------
    policy
        Intervals and thresholds.
    rounds
        LP rounds since the last pass.
    interval
        Rounds after which the next pass is due.
    passes
        Number of passes so far.
    gaps
        Gap after every pass.
    """

    policy: SchedulePolicy = field(default_factory=SchedulePolicy)
    rounds: int = 0
    interval: int = field(init=False)
    passes: int = 0
    gaps: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.interval = self.policy.min_interval

    @property
    def is_due(self) -> bool:
        """True if the next round begins with a pricing pass, as the first does."""
        return self.rounds % self.interval == 0

    def note_pass(self, *, idle: bool) -> None:
        """Count a pass, and double the interval if it was idle."""
        self.rounds = 1
        self.passes += 1
        shortest, longest = self.policy.min_interval, self.policy.max_interval
        self.interval = min(2 * self.interval, longest) if idle else shortest

    def has_stalled(self, gap: float, patience: int) -> bool:
        """Note a gap, and return whether the last passes closed hardly anything of it."""
        self.gaps.append(gap)
        if len(self.gaps) <= patience:
            return False
        before = self.gaps[-1 - patience]
        return before - gap < self.policy.min_gap_closed * before

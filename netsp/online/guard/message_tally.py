"""Tally of a recording: every message or row of it is used, or left out for a reason."""

from __future__ import annotations

from collections import Counter

from netsp.online.guard.guard_policy import RecordingPolicy


class MessageTally:
    """Tally with one entry for each message or row of a recording.

    Parameters
    ----------
    policy : RecordingPolicy
        Maximum number of kinds of messages that a note names.

    Attributes
    ----------
    used : Counter of str
        Number of messages that are used, by kind.
    left_out : dict of str to Counter of str
        Number of messages that are left out, by reason and kind.

    Examples
    --------
    >>> tally = MessageTally()
    >>> tally.use("ATTITUDE")
    >>> tally.leave_out("GLOBAL_POSITION_INT", "no GPS fix", 2)
    >>> tally.total, tally.notes
    (3, ['2 left out: no GPS fix (2 GLOBAL_POSITION_INT)'])
    """

    def __init__(self, policy: RecordingPolicy = RecordingPolicy()) -> None:
        self.policy = policy
        self.used: Counter[str] = Counter()
        self.left_out: dict[str, Counter[str]] = {}

    def use(self, kind: str, count: int = 1) -> None:
        """Count messages, or rows, that are used."""
        self.used[kind] += count

    def leave_out(self, kind: str, reason: str, count: int = 1) -> None:
        """Count messages, or rows, that are left out for a reason, such as "no GPS fix"."""
        if count:
            self.left_out.setdefault(reason, Counter())[kind] += count

    def add(self, other: MessageTally) -> None:
        """Add the counts of another tally."""
        self.used.update(other.used)
        for reason, kinds in other.left_out.items():
            for kind, n in kinds.items():
                self.leave_out(kind, reason, n)

    @property
    def total(self) -> int:
        """Return the number of all messages."""
        return sum(self.used.values()) + sum(sum(c.values()) for c in self.left_out.values())

    @property
    def notes(self) -> list[str]:
        """Return one line for each reason for which messages are left out."""
        lines = []
        for reason, kinds in self.left_out.items():
            named = [f"{n:,} {kind}" for kind, n in kinds.most_common(self.policy.max_named_kinds)]
            more = len(kinds) - len(named)
            text = ", ".join(named) + (f" and {more} more kinds" if more > 0 else "")
            lines.append(f"{sum(kinds.values()):,} left out: {reason} ({text})")
        return lines

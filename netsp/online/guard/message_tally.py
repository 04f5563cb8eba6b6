"""Tally of a recording: every message or row of it is used, or left out for a reason."""

from __future__ import annotations

from collections import Counter

MAX_KINDS = 6
"""Kinds of messages that a note names; the tally counts all of them."""


class MessageTally:
    """Tally with one entry for each message or row of a recording.

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

    def __init__(self) -> None:
        self.used: Counter[str] = Counter()
        self.left_out: dict[str, Counter[str]] = {}

    def use(self, kind: str, count: int = 1) -> None:
        """Count messages that are used.

        Parameters
        ----------
        kind : str
            Name of the message, or "row".
        count : int
            Number of messages.
        """
        self.used[kind] += count

    def leave_out(self, kind: str, reason: str, count: int = 1) -> None:
        """Count messages that are left out.

        Parameters
        ----------
        kind : str
            Name of the message, or "row".
        reason : str
            Why, as "no GPS fix".
        count : int
            Number of messages.
        """
        if count:
            self.left_out.setdefault(reason, Counter())[kind] += count

    @property
    def total(self) -> int:
        """Return the number of all messages."""
        return sum(self.used.values()) + sum(sum(c.values()) for c in self.left_out.values())

    @property
    def notes(self) -> list[str]:
        """Return one line for each reason for which messages are left out."""
        lines = []
        for reason, kinds in self.left_out.items():
            named = [f"{n:,} {kind}" for kind, n in kinds.most_common(MAX_KINDS)]
            more = len(kinds) - len(named)
            text = ", ".join(named) + (f" and {more} more kinds" if more > 0 else "")
            lines.append(f"{sum(kinds.values()):,} left out: {reason} ({text})")
        return lines

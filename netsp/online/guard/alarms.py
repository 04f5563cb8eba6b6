"""Alarms: levels, reasons, and hysteresis, so that none flickers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import IntEnum


class Level(IntEnum):
    """How urgent it is."""

    NOTICE = 1
    CAUTION = 2
    WARNING = 3
    ALARM = 4


@dataclass(frozen=True)
class Alarm:
    """Something that the operator should know.

    Parameters
    ----------
    kind : str
        What it is about: estimate, position, class, slack, short, loop-ahead, loop.
    level : Level
        How urgent.
    text : str
        One or two sentences: why, and what to do.
    is_immediate : bool
        True to raise the alarm at once, without waiting for its reason to last.
    """

    kind: str
    level: Level
    text: str
    is_immediate: bool = False


RAISED_S = {Level.NOTICE: 0.0, Level.CAUTION: 1.0, Level.WARNING: 0.5, Level.ALARM: 0.3}
"""Seconds for which there must be a reason before an alarm is raised to a level."""

AWAY_S = 0.7
"""Seconds that a reason may be away meanwhile: what is ahead comes and goes with the noise."""

LOWERED_S = 4.0
"""Seconds without a reason after which it is lowered."""


@dataclass
class _Kept:
    since: dict[Level, float] = field(default_factory=dict)
    seen: dict[Level, float] = field(default_factory=dict)
    shown: Alarm | None = None
    last: float = 0.0


@dataclass
class Alarms:
    """The alarms that are on.

    Attributes
    ----------
    on : dict of str to Alarm
        By kind.
    """

    on: dict[str, Alarm] = field(default_factory=dict)
    _kept: dict[str, _Kept] = field(default_factory=dict)

    def take(self, now: float, reasons: Iterable[Alarm]) -> list[Alarm]:
        """Reasons that there are now.

        Parameters
        ----------
        now : float
            Seconds.
        reasons : iterable of Alarm
            One of a kind at most.

        Returns
        -------
        list of Alarm
            Those raised, to a higher level than before.
        """
        by_kind = {a.kind: a for a in reasons}
        raised = []
        for kind in {*by_kind, *self._kept}:
            kept = self._kept.setdefault(kind, _Kept())
            reason = by_kind.get(kind)
            for level in Level:
                if reason is not None and reason.level >= level:
                    kept.since.setdefault(level, now)
                    kept.seen[level] = now
                elif level in kept.since and now - kept.seen[level] > AWAY_S:
                    del kept.since[level]
            new = max(
                (
                    v for v, t in kept.since.items()
                    if reason is not None and reason.level >= v
                    and (reason.is_immediate or now - t >= RAISED_S[v])
                ),
                default=None,
            )  # fmt: skip
            was = None if kept.shown is None else kept.shown.level
            if new is not None and (was is None or new >= was):
                assert reason is not None
                kept.shown, kept.last = Alarm(kind, new, reason.text), now
                if was is None or new > was:
                    raised.append(kept.shown)
            elif was is not None and now - kept.last >= LOWERED_S:
                kept.shown = (
                    None if new is None or reason is None else Alarm(kind, new, reason.text)
                )  # fmt: skip
                kept.last = now
        self.on = {k: kept.shown for k, kept in self._kept.items() if kept.shown is not None}
        return sorted(raised, key=lambda a: -a.level)

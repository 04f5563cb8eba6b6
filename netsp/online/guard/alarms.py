"""Alarms: levels, reasons, and hysteresis against flickering."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum

from netsp.online.guard.guard_policy import AlarmPolicy


class Level(IntEnum):
    """Urgency of an alarm."""

    NOTICE = 1
    CAUTION = 2
    WARNING = 3
    ALARM = 4


@dataclass(frozen=True)
class Alarm:
    """Message to the operator.

    Attributes
    ----------
    kind
        Subject: estimate, position, class, plan, slack, short, loop-ahead or loop.
    level
        Urgency.
    text
        One or two sentences: the reason, and what to do.
    is_immediate
        Whether the alarm is raised at once, without waiting for its reason to last.
    around
        Indices of the obstacles of the loop, for alarms about loops.
    """

    kind: str
    level: Level
    text: str
    is_immediate: bool = False
    around: tuple[int, ...] = ()


@dataclass
class _AlarmState:
    """State of the alarm of one kind."""

    since: dict[Level, float] = field(default_factory=dict)
    seen: dict[Level, float] = field(default_factory=dict)
    shown: Alarm | None = None
    last: float = 0.0

    def level(self, now: float, reason: Alarm | None, policy: AlarmPolicy) -> Level | None:
        """Record the current reason, and return the highest level that has lasted long enough."""
        delays = {
            Level.NOTICE: policy.notice_delay_s,
            Level.CAUTION: policy.caution_delay_s,
            Level.WARNING: policy.warning_delay_s,
            Level.ALARM: policy.alarm_delay_s,
        }
        for level in Level:
            if reason is not None and reason.level >= level:
                self.since.setdefault(level, now)
                self.seen[level] = now
            elif level in self.since and now - self.seen[level] > policy.max_absence_s:
                del self.since[level]
        if reason is None:
            return None
        lasting = (
            level
            for level, since in self.since.items()
            if reason.level >= level and (reason.is_immediate or now - since >= delays[level])
        )
        return max(lasting, default=None)

    def show(
        self, now: float, level: Level | None, reason: Alarm | None, policy: AlarmPolicy
    ) -> list[Alarm]:
        """Raise or lower the alarm to a level, and return it if it was raised."""
        old = None if self.shown is None else self.shown.level
        new = None
        if level is not None and reason is not None:
            new = Alarm(reason.kind, level, reason.text, around=reason.around)
        if new is not None and (old is None or new.level >= old):
            self.shown, self.last = new, now
            return [new] if old is None or new.level > old else []
        if old is not None and now - self.last >= policy.lowering_s:
            self.shown, self.last = new, now
        return []


@dataclass
class Alarms:
    """Alarms that are raised and lowered with hysteresis.

    Attributes
    ----------
    policy
        Delays of raising and lowering.
    active
        Alarms that are raised, by kind.
    """

    policy: AlarmPolicy = field(default_factory=AlarmPolicy)
    active: dict[str, Alarm] = field(default_factory=dict)
    _states: dict[str, _AlarmState] = field(default_factory=dict)

    def update(self, now: float, reasons: Iterable[Alarm]) -> list[Alarm]:
        """Update the alarms by the present reasons, at most one of each kind.

        Returns
        -------
        list of Alarm
            Alarms that were raised to a higher level, the gravest first.

        Notes
        -----
        Alarms are lowered late. A loop ahead that is no reason any more, because the same loop is
        closed, is not shown beside it.
        """
        by_kind = {a.kind: a for a in reasons}
        raised = []
        for kind in dict.fromkeys((*by_kind, *self._states)):
            state = self._states.setdefault(kind, _AlarmState())
            level = state.level(now, by_kind.get(kind), self.policy)
            raised += state.show(now, level, by_kind.get(kind), self.policy)
        self.active = {
            k: state.shown for k, state in self._states.items() if state.shown is not None
        }
        if "loop-ahead" not in by_kind and _has_closed(self.active):
            del self.active["loop-ahead"]
        return sorted(raised, key=lambda a: -a.level)


def _has_closed(active: Mapping[str, Alarm]) -> bool:
    """Return whether the loop ahead of one active alarm is the closed loop of another."""
    ahead, closed = active.get("loop-ahead"), active.get("loop")
    return ahead is not None and closed is not None and ahead.around == closed.around != ()

"""Tether of a run compared with its limits: the longest under each, and the times over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Bools, Floats

TETHER_TOLERANCE = 1e-4
"""Tolerance of tether lengths, relative: the accuracy of the tether model."""


@dataclass(frozen=True)
class LimitPeriod:
    """Time in which the tether had one limit.

    Attributes
    ----------
    begin_s
        Start, seconds after the start of the run.
    limit
        Length that the tether may have, in the problem's units.
    longest
        Length of the longest tether in this time, in the problem's units.
    longest_s
        When it was that long, seconds after the start of the run.
    """

    begin_s: float
    limit: float
    longest: float
    longest_s: float


@dataclass(frozen=True)
class Overrun:
    """Time in which the tether was longer than its limit.

    Attributes
    ----------
    begin_s, end_s
        Start and end, seconds after the start of the run.
    longest
        Length of the longest tether in this time, in the problem's units.
    limit
        Limit of the tether in this time, in the problem's units.
    shortening
        Whether the limit was lowered below the tether, which was being shortened.
    """

    begin_s: float
    end_s: float
    longest: float
    limit: float
    shortening: bool

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return self.end_s - self.begin_s


def limit_periods(t: Floats, tether: Floats, limit: Floats) -> list[LimitPeriod]:
    """Return the longest tether under each limit, in the order of the limits.

    Parameters
    ----------
    t, tether, limit : ndarray, shape (n,)
        Times (s) of the rows of a log, lengths of the taut tether, and limits.
    """
    found = []
    for begin, end in _runs(limit):
        k = begin + int(np.argmax(tether[begin:end]))
        found.append(LimitPeriod(float(t[begin]), float(limit[k]), float(tether[k]), float(t[k])))
    return found


def overruns(t: Floats, tether: Floats, limit: Floats, shortening: Bools) -> list[Overrun]:
    """Return the times in which the tether was over its limit.

    Parameters
    ----------
    t, tether, limit : ndarray, shape (n,)
        See `limit_periods`.
    shortening : ndarray of bool, shape (n,)
        Whether the limit was lowered below the tether, which is being shortened.
    """
    over = tether > limit * (1.0 + TETHER_TOLERANCE)
    # a row holds until the next
    ends = np.append(t[1:], t[-1:])
    key = np.column_stack([np.where(over, limit, 0.0), over & shortening])
    found = []
    for begin, end in _runs(key):
        if over[begin]:
            longest = float(tether[begin:end].max())
            found.append(
                Overrun(
                    float(t[begin]),
                    float(ends[end - 1]),
                    longest,
                    float(limit[begin]),
                    bool(shortening[begin]),
                )
            )
    return found


def describe_limits(periods: Sequence[LimitPeriod], over: Sequence[Overrun], units: str) -> str:
    """Return words for the longest tether under each limit, and for the times over the limits."""
    if not periods:
        return "never out"
    first, *later = periods
    parts = [f"longest {first.longest:.6g} of {first.limit:g} {units}"]
    parts += [f"from {p.begin_s:.1f} s on {p.longest:.6g} of {p.limit:g} {units}" for p in later]
    exceeded = [o for o in over if not o.shortening]
    total = sum(o.seconds for o in exceeded)
    parts.append(f"over the limit for {total:.1f} s" + _times(exceeded, units))
    lowered = [o for o in over if o.shortening]
    if lowered:
        total = sum(o.seconds for o in lowered)
        parts.append(f"shortened for {total:.1f} s to a new limit" + _times(lowered, units))
    return ", ".join(parts)


def _times(over: Sequence[Overrun], units: str, max_times: int = 5) -> str:
    """Return words for the first times at which the tether was over its limit; a log has all."""
    if not over:
        return ""
    periods = [
        f"{o.begin_s:.1f} to {o.end_s:.1f} s: up to {o.longest:.4g} of {o.limit:g} {units}"
        for o in over[:max_times]
    ]
    others = f"; {len(over) - max_times} more" if len(over) > max_times else ""
    return f" ({'; '.join(periods)}{others})"


def _runs(values: Floats) -> list[tuple[int, int]]:
    """Return, for each stretch of equal rows, its first index and the index after its last."""
    if not len(values):
        return []
    rows = np.asarray(values).reshape(len(values), -1)
    changes = 1 + np.flatnonzero((rows[1:] != rows[:-1]).any(axis=1))
    bounds = [0, *changes.tolist(), len(values)]
    return list(pairwise(bounds))

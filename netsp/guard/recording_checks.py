"""Checks of a recording that was read: what is unlikely of a tethered robot is told.

A wrong unit, a swapped column or a frame of another place gives numbers that can be read. They show
in distances beyond the tether, in speeds, and in times between positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from netsp.errors import InputError, counted
from netsp.guard.fix import Fix
from netsp.guard.track import GAP
from netsp.link.vehicle_clock import ClockPolicy
from netsp.online.mission import Mission
from netsp.problem import Problem


@dataclass(frozen=True)
class RecordingPolicy:
    """Policy that tells unlikely recordings.

    Attributes
    ----------
    max_speed
        Largest median speed between positions, m/s; no tethered robot is faster. Positive.
    max_far_share
        Largest share of positions that are farther from the base than the tether reaches; 0 to 1.
    max_back_share
        Largest share of rows of a table whose time is before that of the row before: more rows are
        in another order, and are sorted. A clock that is set goes back once. 0 to 1.
    min_back_count
        Least number of such rows from which on a table is sorted; 1 or more.
    max_height
        Largest height above the water that a column of depths may state, m, 0 or more: with larger
        heights alone the column holds heights.
    no_places
        Coordinates that loggers write where there is none, both of them in one row.
    """

    max_speed: float = 20.0
    max_far_share: float = 0.5
    max_back_share: float = 0.3
    min_back_count: int = 2
    max_height: float = 0.5
    no_places: tuple[float, ...] = (-9999.0, -99999.0, -32768.0, -999999.0)

    def __post_init__(self) -> None:
        if not self.max_speed > 0.0:
            raise InputError(f"max_speed: expected a positive speed, got {self.max_speed!r}")
        for name in ("max_far_share", "max_back_share"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InputError(f"{name}: expected 0 to 1, got {getattr(self, name)!r}")
        if not self.max_height >= 0.0:
            raise InputError(f"max_height: expected 0 or more, got {self.max_height!r}")
        if self.min_back_count < 1:
            raise InputError(f"min_back_count: expected 1 or more, got {self.min_back_count!r}")


def in_order_of_time(fixes: list[Fix], policy: RecordingPolicy) -> list[Fix]:
    """Return the rows of a table in the order of their times, where they stand in another order.

    Parameters
    ----------
    fixes : list of Fix
        In the order of the file.
    policy : RecordingPolicy
        Decides whether rows are out of order, or a clock was set.

    Returns
    -------
    list of Fix
        The same list where the rows are in order but for a clock that was set.
    """
    back = int((np.diff([fix.time for fix in fixes]) < 0.0).sum())
    if back < max(policy.min_back_count, policy.max_back_share * (len(fixes) - 1)):
        return fixes
    return sorted(fixes, key=lambda fix: fix.time)


def doubts(
    fixes: Sequence[Fix], site: Problem | Mission, policy: RecordingPolicy | None = None
) -> list[str]:
    """Return what is unlikely of a recording, one line each.

    Parameters
    ----------
    fixes : sequence of Fix
        Fixes with a position, in the order of the recording.
    site : Problem or Mission
        Site of the recording.
    policy : RecordingPolicy, optional
        Limits.

    Returns
    -------
    list of str
        Empty for a likely recording.
    """
    policy = policy or RecordingPolicy()
    places = np.array([fix.position for fix in fixes], dtype=float).reshape(-1, 3)
    times = np.array([fix.time for fix in fixes])
    base = np.asarray(site.base if isinstance(site, Problem) else site.start, dtype=float)
    away = np.linalg.norm(places[:, :2] - base[:2], axis=1)
    units = site.units if isinstance(site, Problem) else "m"
    far = int((away > site.tether_length).sum())
    out = []
    if far > policy.max_far_share * len(fixes):
        out.append(
            f"{far:,} of {len(fixes):,} positions are farther from the base than the tether "
            f"reaches ({site.tether_length:g} {units}), the farthest {away.max():.4g} {units}; "
            "check the frame, the units and the order of the columns"
        )
    steps = np.diff(times)
    back = np.flatnonzero(steps < -ClockPolicy().max_late_s)
    if len(back):
        out.append(
            f"the times go back at {counted(len(back), 'place')}, first from "
            f"{times[back[0]]:.10g} to {times[back[0] + 1]:.10g} s: a message that came late is "
            "left out, a clock that was set or a restart goes on"
        )
    moved = np.linalg.norm(np.diff(places, axis=0), axis=1)
    is_on = steps > 0.0
    if not is_on.any():
        return out
    period = float(np.median(steps[is_on]))
    speed = float(np.median(moved[is_on] / steps[is_on]))
    if speed > policy.max_speed:
        out.append(
            f"the positions move at {speed:.4g} {units}/s; check the unit of the times and of the "
            "lengths"
        )
    elif period > GAP:
        out.append(
            f"{period:.4g} s between positions: times are taken as seconds, and more than "
            f"{GAP:g} s without a position are a gap; name the column time_ms for milliseconds"
        )
    return out

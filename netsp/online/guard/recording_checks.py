"""Plausibility checks of a recording: distances, speeds and times that no tethered robot has.

A wrong unit, swapped columns or a wrong frame still give numbers that can be read. They show up as
positions beyond the tether's reach, high speeds, or long times between positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from netsp.base.errors import InputError, counted
from netsp.model.problem import Problem
from netsp.online.guard.position_track import GAP
from netsp.online.guard.telemetry import Fix
from netsp.online.link.vehicle_clock import ClockPolicy
from netsp.world.mission.mission import Mission


@dataclass(frozen=True)
class RecordingPolicy:
    """Limits that decide whether a recording is implausible or out of order.

    Attributes
    ----------
    max_speed
        Largest plausible median speed between positions, m/s, positive. Tethered robots are slower.
    max_far_share
        Largest plausible share of positions beyond the tether's reach, 0 to 1.
    max_back_share
        Share of rows with an earlier time than the previous row from which on a table is sorted, 0
        to 1. A clock that is set goes back only once.
    min_back_count
        Least number of such rows for a table to be sorted, 1 or more.
    max_height
        Largest height above the water in a column of depths, m, 0 or more. If a value is higher,
        the reader checks whether the column holds heights instead.
    no_places
        Values that loggers write for a missing position, as both coordinates of a row.
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
    """Return the rows of a table sorted by time, if the table is not in order of time.

    Parameters
    ----------
    fixes : list of Fix
        Rows in the order of the file.
    policy : RecordingPolicy
        Limits that tell rows out of order from a clock that was set.

    Returns
    -------
    list of Fix
        The same list object if there is nothing to sort.
    """
    back = int((np.diff([fix.time for fix in fixes]) < 0.0).sum())
    if back < max(policy.min_back_count, policy.max_back_share * (len(fixes) - 1)):
        return fixes
    return sorted(fixes, key=lambda fix: fix.time)


def doubts(
    fixes: Sequence[Fix], site: Problem | Mission, policy: RecordingPolicy | None = None
) -> list[str]:
    """Return notes on what is implausible in a recording, one line each.

    Parameters
    ----------
    fixes : sequence of Fix
        Fixes with a position, in the order of the recording.
    site : Problem or Mission
        Site of the recording.
    policy : RecordingPolicy, optional
        Limits; None takes the defaults.

    Returns
    -------
    list of str
        Notes; empty for a plausible recording.
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
            f"{times[back[0]]:.10g} to {times[back[0] + 1]:.10g} s: late messages are left "
            "out; after a restart or a clock that was set, the track goes on"
        )
    moved = np.linalg.norm(np.diff(places, axis=0), axis=1)
    is_on = steps > 0.0
    if not is_on.any():
        return out
    period = float(np.median(steps[is_on]))
    speed = float(np.median(moved[is_on] / steps[is_on]))
    if speed > policy.max_speed:
        out.append(
            f"the robot moves at {speed:.4g} {units}/s between positions; check the units of times "
            "and lengths"
        )
    elif period > GAP:
        out.append(
            f"{period:.4g} s between positions: the times are taken as seconds, and more than "
            f"{GAP:g} s without a position is a gap; for milliseconds, name the column time_ms"
        )
    return out

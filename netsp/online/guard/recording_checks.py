"""Plausibility checks of a recording: distances, speeds and times that no tethered robot has.

A wrong unit, swapped columns or a wrong frame still give numbers that can be read. They show up as
positions beyond the tether's reach, high speeds, or long times between positions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import counted
from netsp.online.guard.guard_policy import RecordingPolicy, TrackPolicy
from netsp.online.guard.telemetry import Fix
from netsp.online.link.geo_frame import Frame
from netsp.online.link.link_policy import ClockPolicy


def in_order_of_time(fixes: list[Fix], policy: RecordingPolicy) -> list[Fix]:
    """Return the rows of a table sorted by time, if the table is not in order of time.

    The same list object is returned if there is nothing to sort.
    """
    back_count = int((np.diff([fix.time for fix in fixes]) < 0.0).sum())
    if back_count < max(policy.min_back_count, policy.max_back_share * (len(fixes) - 1)):
        return fixes
    return sorted(fixes, key=lambda fix: fix.time)


def plausibility_notes(
    fixes: Sequence[Fix], frame: Frame, policy: RecordingPolicy = RecordingPolicy()
) -> list[str]:
    """Return notes on what is implausible in a recording, one line each.

    `fixes` have a position, and are in the order of the recording.
    """
    places = np.array([fix.position for fix in fixes], dtype=float).reshape(-1, 3)
    times = np.array([fix.time for fix in fixes])
    units = frame.units
    steps = np.diff(times)
    return [
        *_reach_notes(places, frame, policy),
        *_time_notes(times, steps),
        *_speed_notes(places, steps, units, policy),
    ]


def _reach_notes(places: Floats, frame: Frame, policy: RecordingPolicy) -> Iterator[str]:
    units, tether_length = frame.units, frame.site.tether_length
    distance = np.linalg.norm(places[:, :2] - frame.base[:2], axis=1)
    far = int((distance > tether_length).sum())
    if far > policy.max_far_share * len(places):
        yield (
            f"{far:,} of {len(places):,} positions are farther from the base than the tether "
            f"reaches ({tether_length:g} {units}), the farthest {distance.max():.4g} {units}; "
            "check the frame, the units and the order of the columns"
        )


def _time_notes(times: Floats, steps: Floats) -> Iterator[str]:
    backward = np.flatnonzero(steps < -ClockPolicy.max_late_s)
    if len(backward):
        yield (
            f"the times go back at {counted(len(backward), 'place')}, first from "
            f"{times[backward[0]]:.10g} to {times[backward[0] + 1]:.10g} s: late messages are left "
            "out; after a restart or a clock that was set, the track goes on"
        )


def _speed_notes(
    places: Floats, steps: Floats, units: str, policy: RecordingPolicy
) -> Iterator[str]:
    travelled = np.linalg.norm(np.diff(places, axis=0), axis=1)
    is_forward = steps > 0.0
    if not is_forward.any():
        return
    period = float(np.median(steps[is_forward]))
    speed = float(np.median(travelled[is_forward] / steps[is_forward]))
    dropout_s = TrackPolicy.dropout_s
    if speed > policy.max_speed:
        yield (
            f"the robot moves at {speed:.4g} {units}/s between positions; check the units of times "
            "and lengths"
        )
    elif period > dropout_s:
        yield (
            f"{period:.4g} s between positions: the times are taken as seconds, and more than "
            f"{dropout_s:g} s without a position is a gap; for milliseconds, name the column "
            "time_ms"
        )

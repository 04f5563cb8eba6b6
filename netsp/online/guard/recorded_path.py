"""Paths from files of any kind, including recorded flights."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.base.errors import InputError
from netsp.base.files import read_gzip, read_text
from netsp.base.geometry import polylines
from netsp.exchange.maps.path_file import FoundPath, read_paths
from netsp.model.problem import Problem
from netsp.online.guard.replay import read_fixes
from netsp.online.guard.telemetry import Fix
from netsp.online.link.geo_frame import Frame
from netsp.online.link.vehicle_clock import VehicleClock

RECORDINGS = (".tlog", ".bin")
"""File endings of logs of ground stations and vehicles."""


def read_any_paths(
    file: str | Path,
    problem: Problem,
    *,
    frame: str | None = None,
    system: int | None = None,
    noise: float = 0.0,
) -> list[FoundPath]:
    """Read the paths of a file, or the flight of a recording, in the order of the file.

    Parameters
    ----------
    file : str or Path
        File that `netsp.exchange.maps.path_file.read_paths` or `netsp guard --replay` reads.
    problem : Problem
        Problem in whose plane the points are returned.
    frame : str, optional
        Frame of recordings and GeoJSON: "local" or "global".
    system : int, optional
        System id of the vehicle in a telemetry log; by default the only one with positions.
    noise : float
        Largest distance of a point that is left out from the simplified path (Douglas & Peucker
        1973), in the problem's units. Noise of the positions would lengthen the path.

    Raises
    ------
    InputError
        The file cannot be read, or holds no path.
    """
    lower = str(file).lower()
    tables = (".csv", ".csv.gz")
    if lower.endswith(RECORDINGS) or (lower.endswith(tables) and _has_north_and_east(file)):
        found = [_flight(file, Frame(problem, frame), system)]
    else:
        found = read_paths(file, problem, frame)
    return [_simplified(path, noise) for path in found] if noise else found


def _has_north_and_east(file: str | Path) -> bool:
    if str(file).lower().endswith(".gz"):
        head = read_gzip(file)[:4096].decode("utf-8-sig", "replace").splitlines()[:1]
    else:
        head = read_text(file)[:4096].removeprefix("\ufeff").splitlines()[:1]
    names = {name.strip().lower() for name in re.split("[,;\t]", head[0])} if head else set()
    return {"north", "east"} <= names


def _flight(file: str | Path, frame: Frame, system: int | None) -> FoundPath:
    notes: list[str] = []
    try:
        found = read_fixes(file, frame, system, on_note=notes.append)
        fixes = [f for f in found if f.position is not None]
    except InputError as error:
        raise InputError(str(error).removeprefix("--replay: ")) from None
    points = np.array([f.position for f in fixes], dtype=float)
    if len(np.unique(points, axis=0)) < 2:
        raise InputError(f"{file}: expected a recording with two positions or more that differ")
    times, is_late = _continuous_times(fixes)
    if is_late.any():
        notes.append(f"{file}: {int(is_late.sum())} positions left out: their times go back")
    points, times = points[~is_late], times[~is_late]
    order = np.argsort(times, kind="stable")
    plain_notes = tuple(note.removeprefix("--replay: ") for note in notes)
    return FoundPath(Path(file).stem, points[order], times[order], plain_notes)


def _continuous_times(fixes: list[Fix]) -> tuple[Floats, Bools]:
    """Return the times of fixes by a clock that is never set or restarted, and which are late."""
    clock = VehicleClock()
    times, late, offset, last = [], [], 0.0, 0.0
    for fix in fixes:
        reading = clock.read(fix.time)
        if reading.event == "restart":
            offset = last - reading.time
        times.append(reading.time + offset)
        late.append(reading.event == "late")
        if not late[-1]:
            last = times[-1]
    return np.array(times), np.array(late)


def _simplified(path: FoundPath, noise: float) -> FoundPath:
    kept = polylines.essential(path.points, noise)
    times = None if path.times is None else path.times[kept]
    return FoundPath(path.name, path.points[kept], times, path.notes)

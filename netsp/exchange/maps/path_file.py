"""Reader of paths from tables, GeoJSON, GPX and solutions, in the frame of a problem.

Positions in degrees are projected into the problem's plane; positions in metres stay as they are.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.columns import Quantity
from netsp.base.errors import InputError, counted
from netsp.base.field_types import LARGEST
from netsp.base.files import read_text
from netsp.base.polyline_file import read_path
from netsp.base.table_file import Table, read_table
from netsp.base.validated import parse_json_object, shown
from netsp.exchange.maps.gpx import read_gpx
from netsp.exchange.maps.import_policy import DEFAULT_READ, ReadPolicy
from netsp.exchange.maps.projection import Projection
from netsp.exchange.maps.time_stamps import NO_VALUES, TimeStamps, seconds_of
from netsp.model.problem import Problem

ENDINGS = (".csv", ".csv.gz", ".txt", ".json", ".geojson", ".gpx")
"""Endings of the names of files with paths."""

FRAMES = ("local", "global")

Line = tuple[str, list[list[float]], Mapping[str, Any]]
"""Place of a line in its file, its positions, and the properties of its feature."""


@dataclass(frozen=True)
class FoundPath:
    """Path from a file.

    Attributes
    ----------
    name
        Name of the path in the file, or the name of the file.
    points
        ndarray of shape (k, 2) or (k, 3), in the frame of the problem.
    times
        Time stamps of the points, s.
    notes
        Assumptions and omissions, one line each.
    """

    name: str
    points: Floats = field(repr=False)
    times: Floats | None = field(repr=False, default=None)
    notes: tuple[str, ...] = ()


def read_paths(
    file: str | Path, problem: Problem, frame: str | None = None, policy: ReadPolicy = DEFAULT_READ
) -> list[FoundPath]:
    """Return the paths of a file, in its order.

    Parameters
    ----------
    file : str or Path
        Table (x, y and perhaps z or depth; or lon, lat; perhaps t), GeoJSON with lines, GPX with
        tracks or routes, solution, or JSON list of points.
    problem : Problem
        Problem in whose plane the points are returned.
    frame : str, optional
        Frame of GeoJSON: "local" (metres of the problem's plane) or "global" (degrees). By default
        the frame that the file states, else global if the problem has an origin.

    Raises
    ------
    InputError
        The file holds no path, a number is wrong, or degrees are given and the problem has no
        origin.

    Examples
    --------
    >>> from netsp import Problem
    >>> problem = Problem.load("problems/wharf.json")
    >>> (found,) = read_paths("examples/paths/wharf-systematic-1.csv", problem)
    >>> found.points.shape
    (15, 3)
    """
    if frame is not None and frame not in FRAMES:
        raise InputError(f"--frame: expected local or global, got {shown(frame)}")
    name = Path(file).name
    lower = name.lower()
    stem = name[: -len(".csv.gz")] if lower.endswith(".csv.gz") else Path(file).stem
    if lower.endswith(".gpx"):
        found = _of_gpx(file, problem, stem, policy)
    elif lower.endswith((".csv", ".csv.gz", ".txt")):
        found = [_of_table(file, problem, stem, policy)]
    elif lower.endswith((".json", ".geojson")):
        found = _of_json(file, problem, stem, frame, policy)
    else:
        raise InputError(f"{file}: expected a path in a file that ends in {', '.join(ENDINGS)}")
    for path in found:
        where = file if len(found) == 1 else f"{file}: {path.name}"
        if len(np.unique(path.points, axis=0)) < 2:
            raise InputError(f"{where}: expected two points or more that differ")
        if path.times is not None and (np.diff(path.times) < 0.0).any():
            k = int(np.argmax(np.diff(path.times) < 0.0)) + 1
            raise InputError(
                f"{where}: point {k}: time: expected times that never fall, got "
                f"{path.times[k]:.10g} after {path.times[k - 1]:.10g}"
            )
    return found


def _to_plane(problem: Problem, latlon: Sequence[tuple[float, float]], where: str) -> Floats:
    projection = Projection.for_problem(problem)
    if projection is None:
        raise InputError(
            f"{where}: positions are in degrees, and the problem has no origin; expected an origin "
            "in the problem file, or x and y in its plane"
        )
    return np.asarray(projection.to_plane(latlon))


def _of_gpx(file: str | Path, problem: Problem, stem: str, policy: ReadPolicy) -> list[FoundPath]:
    out = []
    notes: list[str] = []
    lines = read_gpx(file, lambda text: notes.append(f"{file}: {text}"), policy)
    for k, line in enumerate(lines):
        xy = _to_plane(problem, [(p.latitude, p.longitude) for p in line.points], str(file))
        heights = [p.height for p in line.points]
        known = None not in heights
        points = np.column_stack([xy, np.array(heights, dtype=float)]) if known else xy
        stamps = [p.time_s for p in line.points]
        times = None if None in stamps else np.array(stamps, dtype=float)
        name = line.name or (stem if len(lines) == 1 else f"{stem} {k + 1}")
        for quantity, values in (("heights", heights), ("times", stamps)):
            if None in values and any(v is not None for v in values):
                notes.append(
                    f"{file}: {name}: {values.count(None)} of {len(values)} points have no "
                    f"{quantity}: {quantity} are not used"
                )
        out.append(FoundPath(name, points, times))
    return [replace(path, notes=tuple(notes)) for path in out]


def _of_table(file: str | Path, problem: Problem, stem: str, policy: ReadPolicy) -> FoundPath:
    wanted = "columns x, y or lon, lat"
    try:
        table = read_table(file, positional=("x", "y", "z"))
    except InputError as error:
        if str(error).endswith("got nothing"):
            raise InputError(f"{file}: expected {wanted}, got nothing") from None
        raise
    if not table.head:
        return _untitled_table(file, stem, wanted)
    plane = table.pair((("x", "y"), ("longitude", "latitude")))
    if plane is None:
        raise table.wanted(wanted)
    up = table.height()
    quantities: list[Quantity] = [*plane, up] if up else [*plane]
    clock: Quantity = "time" if "time" in table else "date"
    values: list[list[float]] = []
    times: list[float] = []
    notes = [f"{file}: {note}" for note in table.notes(["time", "date", *quantities])]
    gaps = 0
    is_global = plane == ("longitude", "latitude")
    stamps = None
    if clock in table:
        meaning = table.columns[clock][1]
        stamps = TimeStamps(meaning, lambda text: notes.append(f"{file}: {text}"), policy)
    for k, number in enumerate(table.lines):
        if _is_gap(table, k, quantities, is_global=is_global):
            gaps += 1
            continue
        place = f"{file}: line {number}, point {len(values)}"
        values.append(_numbers(table, k, quantities, place))
        if stamps is not None:
            date = table.text(k, "date") if clock == "time" else ""
            where = f"{place}: {table.title(clock)}"
            times.append(stamps.seconds(table.plain(k, clock), where, date))
    if gaps:
        rows = counted(gaps, "row")
        notes.append(f"{file}: {rows} left out: no position: a gap of the path")
    if len(values) < 2:
        raise InputError(f"{file}: expected a path of at least 2 points, got {len(values)}")
    points = np.array(values)
    if up == "z":
        table.check_depths(points[:, 2])
    if is_global:
        _project(points, problem, file)
    return FoundPath(stem, points, np.array(times) if times else None, tuple(notes))


def _numbers(table: Table, row: int, quantities: Sequence[Quantity], place: str) -> list[float]:
    """Return the numbers of a row, in metres or degrees."""
    return [
        _number(table.plain(row, name), f"{place}: {table.title(name)}")
        * table.columns[name][1].factor
        + 0.0
        for name in quantities
    ]


def _untitled_table(file: str | Path, stem: str, wanted: str) -> FoundPath:
    """Return the path of a table without titles of columns."""
    notes: list[str] = []
    points = read_path(file, notes.append)
    if points is None:
        raise InputError(f"{file}: expected {wanted}")
    return FoundPath(stem, points, notes=tuple(notes))


def _project(points: Floats, problem: Problem, file: str | Path) -> None:
    """Replace longitude and latitude in the first two columns by x and y."""
    wrong = np.flatnonzero((np.abs(points[:, 0]) > 180.0) | (np.abs(points[:, 1]) > 90.0))
    if len(wrong):
        raise InputError(
            f"{file}: point {wrong[0]}: expected degrees, lon within 180 and lat within 90, "
            f"got {points[wrong[0], 0]:g}, {points[wrong[0], 1]:g}"
        )
    points[:, :2] = _to_plane(problem, [(b, a) for a, b in points[:, :2]], str(file))


def _is_gap(table: Table, row: int, quantities: list[Quantity], *, is_global: bool) -> bool:
    """Return whether a row has no position: an empty cell, or degrees without a GPS fix.

    A row that ends after the first of two coordinates is no gap but a damaged file.
    """
    cells = [table.plain(row, name) for name in quantities]
    if sum(not cell for cell in cells[:2]) == 1:
        return False
    if any(cell.lower() in NO_VALUES for cell in cells):
        return True
    return is_global and all(_is_number(c) and float(c) == 0.0 for c in cells[:2])


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _number(text: str, where: str, max_value: float = LARGEST) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= max_value:
        raise InputError(f"{where}: expected a number, got {shown(text)}")
    return value


def _seconds(text: str, where: str) -> float:
    return _number(text, where) if _is_number(text) else seconds_of(text, where)


def _of_json(
    file: str | Path, problem: Problem, stem: str, frame: str | None, policy: ReadPolicy
) -> list[FoundPath]:
    text = read_text(file).removeprefix("\ufeff")
    if text.lstrip().startswith("["):
        points = read_path(file)
        assert points is not None
        return [FoundPath(stem, points)]
    data = parse_json_object(text, str(file))
    if "tour" in data and "path" in data:
        from netsp.model.solution import Solution

        solution = Solution.from_json(text, source=str(file))
        if len(solution.path) < 2:
            raise InputError(f"{file}: the solution has no path; expected one with a tour")
        return [FoundPath(stem, np.array(solution.path, dtype=float))]
    lines = list(_lines(data, str(file), "", {}, policy.max_collection_depth))
    return _of_geojson(file, data, lines, problem, stem, frame)


def _of_geojson(
    file: str | Path,
    data: Mapping[str, Any],
    lines: list[Line],
    problem: Problem,
    stem: str,
    frame: str | None,
) -> list[FoundPath]:
    if not lines:
        raise InputError(
            f"{file}: expected GeoJSON with a LineString or MultiLineString, got "
            f"{shown(data.get('type'))} without one"
        )
    stated = data.get("frame")
    is_global = (
        frame
        or (stated if stated in FRAMES else None)
        or ("global" if problem.origin is not None else "local")
    ) == "global"
    out = []
    for k, (where, coordinates, properties) in enumerate(lines):
        place = f"{file}: {where}" if where else str(file)
        size = min(len(c) for c in coordinates)
        points = np.array([c[: min(size, 3)] for c in coordinates], dtype=float)
        if is_global:
            if (np.abs(points[:, :2]) > (180.0, 90.0)).any():
                n = int(np.argmax((np.abs(points[:, :2]) > (180.0, 90.0)).any(axis=1)))
                raise InputError(
                    f"{place}: position {n}: expected [longitude, latitude] within 180 and 90 "
                    f"degrees, got {points[n, :2].tolist()}; if these are metres of the problem's "
                    "plane, give --frame local"
                )
            points[:, :2] = _to_plane(problem, [(b, a) for a, b in points[:, :2]], place)
        name = properties.get("name")
        label = (
            name
            if isinstance(name, str) and name
            else (stem if len(lines) == 1 else f"{stem} {k + 1}")
        )
        out.append(FoundPath(label, points, _times_of(properties, len(points), place)))
    return out


def _times_of(properties: Mapping[str, Any], count: int, where: str) -> Floats | None:
    """Return the times of a line (`coordTimes` or `times`); None unless each point has one."""
    given = properties.get("coordTimes", properties.get("times"))
    if not isinstance(given, list) or len(given) != count:
        return None
    return np.array([_seconds(str(v), f"{where}: times[{k}]") for k, v in enumerate(given)])


def _lines(
    data: Any, file: str, where: str, properties: Mapping[str, Any], max_depth: int
) -> Iterator[Line]:
    """Yield each line of GeoJSON: its place in the file, its positions and its properties."""
    place = f"{file}: {where}" if where else file
    if not isinstance(data, Mapping) or max_depth < 0:
        raise InputError(f"{place}: expected a GeoJSON object, got {shown(data)}")
    kind = data.get("type")
    if kind == "FeatureCollection":
        features = data.get("features")
        if not isinstance(features, list):
            raise InputError(f"{place}: features: expected a list, got {shown(features)}")
        for k, feature in enumerate(features):
            yield from _lines(feature, file, f"features[{k}]", {}, max_depth - 1)
    elif kind == "Feature":
        if data.get("geometry") is not None:
            feature_properties = data.get("properties")
            yield from _lines(
                data["geometry"],
                file,
                where,
                feature_properties if isinstance(feature_properties, dict) else {},
                max_depth - 1,
            )
    elif kind == "GeometryCollection":
        parts = data.get("geometries")
        for part in parts if isinstance(parts, list) else []:
            yield from _lines(part, file, where, properties, max_depth - 1)
    elif kind == "LineString":
        yield where, _positions(data.get("coordinates"), place), properties
    elif kind == "MultiLineString":
        parts = data.get("coordinates")
        if not isinstance(parts, list) or not parts:
            raise InputError(f"{place}: coordinates: expected a list of lines, got {shown(parts)}")
        yield where, [p for part in parts for p in _positions(part, place)], properties
    elif not isinstance(kind, str):
        raise InputError(f"{place}: type: expected a type of GeoJSON, got {shown(kind)}")


def _positions(coordinates: Any, where: str) -> list[list[float]]:
    if not isinstance(coordinates, list) or len(coordinates) < 2:
        raise InputError(f"{where}: coordinates: expected two positions or more")
    for k, c in enumerate(coordinates):
        good = (
            isinstance(c, list)
            and len(c) >= 2
            and all(
                isinstance(v, int | float) and not isinstance(v, bool) and abs(v) <= LARGEST
                for v in c[:3]
            )
        )
        if not good:
            raise InputError(f"{where}: position {k}: expected [x, y] or [x, y, z], got {shown(c)}")
    return coordinates


def path_to_geojson(name: str, points: Floats, problem: Problem) -> str:
    """Return a path as GeoJSON, in degrees if the problem has an origin, else in its plane.

    Parameters
    ----------
    points : ndarray, shape (k, 2) or (k, 3)
        Points in the problem's frame.

    Returns
    -------
    str
        FeatureCollection with one LineString; its member "frame" is "local" without an origin.
    """
    projection = Projection.for_problem(problem)
    xy = np.asarray(points, dtype=float)
    rows = xy.copy()
    if projection is not None:
        rows[:, :2] = np.round(projection.to_earth(xy[:, :2])[:, ::-1], 9)
    data: dict[str, Any] = {
        "type": "FeatureCollection",
        **({} if projection is not None else {"frame": "local", "units": problem.units}),
        "features": [
            {
                "type": "Feature",
                "properties": {"name": name, "problem": problem.name},
                "geometry": {"type": "LineString", "coordinates": rows.tolist()},
            }
        ],
    }
    return json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False) + "\n"

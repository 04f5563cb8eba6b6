"""Clouds of points from files: which columns, classes and units they hold, and what is left out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from netsp.arrays import Bools, Floats
from netsp.axes import (
    NOISE_CLASSES,
    UNITS,
    HeightAxis,
    Quantity,
    Table,
    decode_text,
    height_axis,
    map_unit,
    read_table,
)
from netsp.errors import InputError, counted
from netsp.files import read_bytes

TEXT_SUFFIXES = (".csv", ".txt", ".xyz", ".asc", ".pts")
"""Extensions of clouds that are tables of text."""

_PCD_TYPES = {("F", 4): "<f4", ("F", 8): "<f8"} | {
    (kind, size): f"<{letter}{size}" for kind, letter in (("I", "i"), ("U", "u"))
    for size in (1, 2, 4, 8)
}  # fmt: skip


@dataclass(frozen=True)
class PointCloud:
    """Points of a file.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Points in units of the file, z upwards; metres where columns state a unit.
    metres : tuple of float
        Metres per unit of x, y and z.
    notes : tuple of str
        Points, columns and classes that were left out, one line each.
    """

    points: Floats = field(repr=False)
    metres: tuple[float, float, float] = (1.0, 1.0, 1.0)
    notes: tuple[str, ...] = ()


def read_text_cloud(path: str | Path) -> PointCloud:
    """Read a cloud from a table: by the names of its columns, or its first three without names.

    Parameters
    ----------
    path : str or Path
        Table as `netsp.axes.read_table` takes it, or PTS, which begins with the number of points.

    Raises
    ------
    InputError
        No such table, positions in degrees, or another number of points than the file states.
    """
    source = str(path)
    text = decode_text(read_bytes(path), source)
    stated = re.match(r"\s*(\d+)[ \t]*\r?\n", text)
    if stated:
        text = "\n" * stated[0].count("\n") + text[stated.end() :]
    table = read_table(path, positional=("x", "y", "z"), text=text)
    if stated and len(table.rows) != int(stated[1]):
        raise InputError(
            f"{path}: line 1 states {int(stated[1])} points; expected as many rows, got "
            f"{len(table.rows)}"
        )
    plane, up = table.pair(), table.height()
    if plane is None and table.pair((("latitude", "longitude"),)) is not None:
        raise InputError(f"{path}: in degrees; expected x, y and z in metres, such as UTM")
    if plane is None or up is None:
        raise table.wanted("columns x, y and z (or depth)")
    used: tuple[Quantity, ...] = (*plane, up)
    table, gaps = _without_gaps(table, used)
    points = table.numbers(used)
    notes = [f"{counted(gaps, 'row')} without coordinates left out"] if gaps else []
    if table.has_decimal_commas:
        notes.append("numbers are read with decimal commas")
    kept, left_out = _surface(_classes(table), _withheld(table), len(points))
    notes += left_out
    if unused := table.left_out((*used, "classification", "withheld")):
        notes.append(f"unused columns: {', '.join(unused)}")
    return PointCloud(points[kept], notes=tuple(notes))


def _without_gaps(table: Table, used: Sequence[Quantity]) -> tuple[Table, int]:
    """Return the table without rows whose coordinates are all empty or nan, and their number."""
    first = table.columns[used[0]][0]
    blank = {
        k for k, cells in enumerate(table.rows)
        if first >= len(cells) or cells[first].strip().lower() in ("", "nan")
    }  # fmt: skip
    blank = {k for k in blank if all(table.text(k, q).lower() in ("", "nan") for q in used)}
    if not blank:
        return table, 0
    kept = [k for k in range(len(table.rows)) if k not in blank]
    rows, lines = [table.rows[k] for k in kept], [table.lines[k] for k in kept]
    return replace(table, rows=rows, lines=lines), len(blank)


def _classes(table: Table) -> Floats | None:
    if "classification" not in table:
        return None
    try:
        return table.numbers(("classification",))[:, 0]
    except InputError:
        return None  # words, whose meaning is not known


def _withheld(table: Table) -> Bools | None:
    if "withheld" not in table:
        return None
    words = (table.text(k, "withheld").lower() for k in range(len(table.rows)))
    return np.array([word in ("1", "true", "yes") for word in words])


def _surface(classes: Any, withheld: Any, count: int) -> tuple[Bools, list[str]]:
    """Return which points lie on surfaces, and one line for each kind that does not."""
    kept, notes = np.ones(count, dtype=bool), []
    if classes is not None:
        for number, name in NOISE_CLASSES.items():
            noise = np.asarray(classes) == number
            if noise.any():
                kept &= ~noise
                notes.append(
                    f"{counted(int(noise.sum()), 'point')} of class {number} ({name}) left out"
                )
    if withheld is not None and np.asarray(withheld).any():
        more = np.asarray(withheld, dtype=bool) & kept
        kept &= ~more
        if more.any():
            notes.append(f"{counted(int(more.sum()), 'point')} marked as withheld left out")
    return kept, notes


def read_las(path: str | Path) -> PointCloud:
    """Read a LAS or LAZ cloud without noise and withheld points, in the units of its system.

    Parameters
    ----------
    path : str or Path
        LAS 1.0 to 1.4.

    Raises
    ------
    InputError
        Its coordinate system is in degrees, or laspy is not installed.
    """
    try:
        import laspy
    except ImportError:
        raise InputError("LAS clouds need laspy: pip install 'netsp[online]'") from None
    data = laspy.read(str(path))
    points = np.array(data.xyz, dtype=float)
    names = set(data.point_format.dimension_names)
    withheld = np.asarray(data.withheld) if "withheld" in names else None
    kept, notes = _surface(np.asarray(data.classification), withheld, len(points))
    system, keys = _system_of(data.header)
    unit, heights = _KEY_UNITS.get(keys.get(_MAP_UNIT, 0)), HeightAxis()
    if system is not None:
        heights = height_axis(system)
        unit = map_unit(system) if unit is None else unit
        if unit is None:
            raise InputError(f"{path}: in degrees; expected a cloud in metres, such as UTM")
    elif keys.get(_MODEL, 0) == 2:
        raise InputError(f"{path}: in degrees; expected a cloud in metres, such as UTM")
    elif keys or any(v.record_id == _WKT for v in data.header.vlrs):
        notes.append("coordinate system unknown: read as metres, z upwards")
    if not heights.is_stated and 1024 <= keys.get(_VERTICAL, 0) < 32767:
        heights = height_axis(f"EPSG:{keys[_VERTICAL]}")
    unit = 1.0 if unit is None else unit
    metres = _KEY_UNITS.get(keys.get(_HEIGHT_UNIT, 0))
    if metres is None:
        metres = heights.metres if heights.is_stated else unit
    if unit != 1.0 or metres != 1.0:
        notes.append(f"in units of {unit:.7g} m, heights of {metres:.7g} m: converted to metres")
    points[:, 2] *= heights.sign
    if heights.sign < 0.0:
        notes.append("heights count downwards: converted to z upwards")
    return PointCloud(points[kept], (unit, unit, metres), tuple(notes))


_WKT, _KEYS = 2112, 34735  # records of LAS with a coordinate system (LAS 1.4 R15, section 3)
_MODEL, _MAP_UNIT, _VERTICAL, _HEIGHT_UNIT = (
    1024,
    3076,
    4096,
    4099,
)  # keys of GeoTIFF 1.1, section 7
_KEY_UNITS = {9001: 1.0, 9002: UNITS["ft"], 9003: UNITS["us-ft"]}
"""Metres per unit, by its number in GeoTIFF keys."""


def _system_of(header: Any) -> tuple[Any, dict[int, int]]:
    """Return the coordinate system that a LAS header names, None for none, and its GeoTIFF keys."""
    keys: dict[int, int] = {}
    for record in header.vlrs:
        if record.record_id == _KEYS:
            keys = {k.id: k.value_offset for k in getattr(record, "geo_keys", ())}
    try:
        return header.parse_crs(), keys
    except Exception:  # pyproj is not installed, or the record is not one that it knows
        return None, keys


def read_pcd(path: str | Path) -> PointCloud:
    """Read a cloud of the Point Cloud Library, as text or binary.

    Parameters
    ----------
    path : str or Path
        PCD 0.5 to 0.7 with fields x, y and z. Points that are not finite mark beams without an
        echo; they are left out.

    Raises
    ------
    InputError
        A head that lacks a field, too few data, or packed data.
    """
    data = read_bytes(path)
    head: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in head:
        end = data.find(b"\n", at)
        if end < 0 or end > 100_000:
            raise InputError(f"{path}: expected a PCD file with a line DATA")
        words = data[at:end].decode("ascii", "replace").split("#")[0].split()
        if words:
            head[words[0].upper()] = words[1:]
        at = end + 1
    fields = [f.lower() for f in head.get("FIELDS", head.get("COLUMNS", []))]
    if not {"x", "y", "z"} <= set(fields):
        raise InputError(f"{path}: FIELDS: expected x, y and z, got {' '.join(fields) or 'none'}")
    try:
        sizes = [int(v) for v in head.get("SIZE", ["4"] * len(fields))]
        kinds = head.get("TYPE", ["F"] * len(fields))
        counts = [int(v) for v in head.get("COUNT", ["1"] * len(fields))]
        size = int(head["WIDTH"][0]) * int(head.get("HEIGHT", ["1"])[0])
        count = int(head.get("POINTS", [str(size)])[0])
        form = head["DATA"][0].lower()
        places = np.cumsum([0, *counts])
        types = [
            (f"{name}{k}", _PCD_TYPES[kind.upper(), width], (many,))
            for k, (name, kind, width, many) in enumerate(
                zip(fields, kinds, sizes, counts, strict=True)
            )
        ]
    except (KeyError, IndexError, ValueError):
        raise InputError(f"{path}: expected the head of a PCD file (SIZE, TYPE, WIDTH)") from None
    axes = [fields.index(name) for name in ("x", "y", "z")]
    if form == "ascii":
        rows = [line.split() for line in data[at:].decode("ascii", "replace").splitlines()]
        rows = [row for row in rows if row]
        points = np.array([[float(row[places[k]]) for k in axes] for row in rows]).reshape(-1, 3)
    elif form == "binary":
        kind = np.dtype(types)
        if len(data) - at < count * kind.itemsize:
            raise InputError(f"{path}: cut short; expected {counted(count, 'point')}")
        read = np.frombuffer(data, kind, count, at)
        points = np.column_stack([read[kind.names[k]][:, 0] for k in axes]).astype(float)  # type: ignore[index]
    else:
        raise InputError(f"{path}: DATA: expected ascii or binary, got {form}")
    if len(points) != count:
        raise InputError(f"{path}: expected {counted(count, 'point')}, got {len(points)}")
    notes = []
    known = np.isfinite(points).all(axis=1)
    if not known.all():
        notes.append(f"{counted(int((~known).sum()), 'point')} without coordinates left out")
    view = [float(v) for v in head.get("VIEWPOINT", [])]
    if view and view != [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]:
        notes.append("VIEWPOINT is ignored: points keep their coordinates")
    return PointCloud(points[known], notes=tuple(notes))

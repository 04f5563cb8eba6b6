"""Clouds of points from files: their columns, classes and units, and what is left out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.base.axes import HeightAxis, height_axis, map_unit
from netsp.base.columns import MAP_PAIRS, Column, Quantity, meanings
from netsp.base.errors import InputError, counted
from netsp.base.files import read_bytes
from netsp.base.table_file import Table, decode_text, read_table
from netsp.base.units import metres_per_unit_code
from netsp.world.scene.missing_heights import marks_of_no_height
from netsp.world.scene.tally import Tally

TEXT_SUFFIXES = (".csv", ".txt", ".xyz", ".asc", ".pts")
"""Extensions of clouds that are tables of text."""

NOISE_CLASSES = {7: "low noise", 18: "high noise"}
"""Classes of points that belong to no surface (ASPRS LAS 1.4 R15, tables 9 and 17)."""


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
    tally : Tally, optional
        Numbers of points used and left out; None if all are used.
    names_depths : bool
        Whether the file names its heights a depth: they are turned, z is upwards.
    """

    points: Floats = field(repr=False)
    metres: tuple[float, float, float] = (1.0, 1.0, 1.0)
    notes: tuple[str, ...] = ()
    tally: Tally | None = None
    names_depths: bool = False


class SurfaceFilter:
    """Selection of the points of a file that lie on surfaces; counts the others by reason.

    Attributes
    ----------
    kept : ndarray of bool
        Points that lie on surfaces.
    reasons : list of (str, int)
        Reasons, and the number of points left out for each.
    """

    def __init__(self, count: int) -> None:
        self.kept: Bools = np.ones(count, dtype=bool)
        self.reasons: list[tuple[str, int]] = []

    def leave_out(self, which: Any, reason: str) -> None:
        """Leave out points for a reason, such as "of class 7", unless they are left out already."""
        more = np.asarray(which, dtype=bool) & self.kept
        if more.any():
            self.kept &= ~more
            self.reasons.append((reason, int(more.sum())))

    def leave_out_noise(self, classes: Any, withheld: Any) -> None:
        """Leave out points of the noise classes of ASPRS, and points that are marked as
        withheld."""
        if classes is not None:
            for number, name in NOISE_CLASSES.items():
                self.leave_out(np.asarray(classes) == number, f"of class {number} ({name})")
        if withheld is not None:
            self.leave_out(withheld, "marked as withheld")

    def leave_out_unmeasured(self, points: Floats) -> None:
        """Leave out points (n, 3) that are not finite, or whose height is a nodata value."""
        self.leave_out(~np.isfinite(points).all(axis=1), "without coordinates")
        heights = np.where(self.kept, points[:, 2], np.nan)
        for value, which in marks_of_no_height(heights):
            self.leave_out(which, f"of height {value:.6g}, which marks a missing height,")

    def tally(self, before: Sequence[tuple[str, int]] = ()) -> Tally:
        """Return the numbers of points used and left out; `before` lists points left out
        earlier."""
        left_out = (*before, *self.reasons)
        total = len(self.kept) + sum(count for _, count in before)
        return Tally("point", total, int(self.kept.sum()), left_out)

    @property
    def notes(self) -> list[str]:
        """Notes on the points left out, one line for each reason."""
        return [f"{counted(count, 'point')} {reason} left out" for reason, count in self.reasons]


def read_text_cloud(path: str | Path) -> PointCloud:
    """Read a cloud from a table: by the names of its columns, or its first three if they have none.

    Parameters
    ----------
    path : str or Path
        Table as `netsp.base.table_file.read_table` reads it, or PTS, which begins with the number
        of points.

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
    surface = SurfaceFilter(len(points))
    surface.leave_out_unmeasured(points)
    surface.leave_out_noise(_classes(table), _withheld(table))
    notes += surface.notes
    if unused := table.left_out((*used, "classification", "withheld")):
        notes.append(f"unused columns: {', '.join(unused)}")
    tally = surface.tally([("without coordinates", gaps)] if gaps else [])
    return PointCloud(
        points[surface.kept],
        notes=tuple(notes),
        tally=tally,
        names_depths=table.columns[up][1].factor < 0.0,
    )


def coordinate_fields(
    names: Sequence[str], source: str, where: str
) -> tuple[tuple[int, Column], tuple[int, Column], tuple[int, Column]]:
    """Return the indices and meanings of the fields that hold x, y and z.

    Parameters
    ----------
    names : sequence of str
        Names of the fields, as `netsp.base.columns.column` reads them.
    source : str
        Name of the file, for messages.
    where : str
        Term of the format for its fields, for messages.

    Raises
    ------
    InputError
        No fields for x, y and z, or several for one of them.
    """
    columns, _ = meanings(names, source)
    plane = next((p for p in MAP_PAIRS if p[0] in columns and p[1] in columns), None)
    if plane is None or "z" not in columns:
        raise InputError(
            f"{source}: {where}: expected x, y and z, got {' '.join(names)[:80] or 'none'}"
        )
    return columns[plane[0]], columns[plane[1]], columns["z"]


def cloud_of_fields(
    names: Sequence[str], values: Floats, source: str, *, where: str = "fields"
) -> PointCloud:
    """Return the cloud of records with named fields.

    Points that are not finite mark beams without an echo; they are left out.

    Parameters
    ----------
    names : sequence of str
        Names of k fields, as `netsp.base.columns.column` reads them.
    values : ndarray, shape (n, k)
        Values of n points.
    source : str
        Name of the file, for messages.
    where : str
        Term of the format for its fields, for messages.

    Raises
    ------
    InputError
        No fields for x, y and z, or several for one of them.
    """
    used = coordinate_fields(names, source, where)
    columns, _ = meanings(names, source)
    points = np.column_stack([values[:, k] * column.factor for k, column in used]) + 0.0
    surface = SurfaceFilter(len(points))
    surface.leave_out_unmeasured(points)
    marks = [values[:, columns[q][0]] if q in columns else None for q in _MARKS]
    surface.leave_out_noise(marks[0], None if marks[1] is None else marks[1] != 0.0)
    depths = points[surface.kept, 2]
    if used[2][1].factor < 0.0 and len(depths) and depths.min() >= 0.0 and depths.max() > 0.0:
        name = names[columns["z"][0]]
        raise InputError(
            f"{source}: {where}: {name} holds negative numbers only, and depths count downwards; "
            "expected positive depths, or the name z for heights"
        )
    return PointCloud(points[surface.kept], notes=tuple(surface.notes), tally=surface.tally())


_MARKS: tuple[Quantity, Quantity] = ("classification", "withheld")


def _without_gaps(table: Table, used: Sequence[Quantity]) -> tuple[Table, int]:
    """Return the table without rows whose coordinates are all empty or nan, and their number."""
    first = table.columns[used[0]][0]
    blank = {
        k
        for k, cells in enumerate(table.rows)
        if first >= len(cells) or cells[first].strip().lower() in ("", "nan")
    }
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
        return None  # classes in words, which have no known meaning


def _withheld(table: Table) -> Bools | None:
    if "withheld" not in table:
        return None
    words = (table.text(k, "withheld").lower() for k in range(len(table.rows)))
    return np.array([word in ("1", "true", "yes") for word in words])


def read_las(path: str | Path) -> PointCloud:
    """Read a LAS or LAZ cloud without noise and withheld points, in the units of its system.

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
    stated = int(data.header.point_count)
    if len(points) != stated:
        raise InputError(f"{path}: cut short; expected {counted(stated, 'point')}")
    surface = SurfaceFilter(len(points))
    surface.leave_out_unmeasured(points)
    surface.leave_out_noise(np.asarray(data.classification), withheld)
    notes = surface.notes
    unit, metres, sign = _las_units(data.header, path, notes)
    points[:, 2] *= sign
    if sign < 0.0:
        notes.append("heights count downwards: converted to z upwards")
    return PointCloud(
        points[surface.kept], (unit, unit, metres), tuple(notes), tally=surface.tally()
    )


def _las_units(header: Any, path: str | Path, notes: list[str]) -> tuple[float, float, float]:
    """Return the metres per unit of map and heights, and the sign of heights; extend the notes."""
    system, keys = _system_of(header)
    unit, heights = _unit_of_key(keys, _MAP_UNIT, path), HeightAxis()
    if keys.get(_MODEL, 0) == 3:
        raise InputError(f"{path}: geocentric coordinates; expected those of a map, such as UTM")
    if system is not None:
        try:
            stated_unit, heights = map_unit(system), height_axis(system)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        unit = stated_unit if unit is None else unit
        if unit is None:
            raise InputError(f"{path}: in degrees; expected a cloud in metres, such as UTM")
    elif keys.get(_MODEL, 0) == 2:
        raise InputError(f"{path}: in degrees; expected a cloud in metres, such as UTM")
    elif keys or any(v.record_id == _WKT for v in header.vlrs):
        notes.append(
            f"coordinate system unknown: {'read as metres, ' if unit is None else ''}z upwards"
        )
    if not heights.is_stated and 1024 <= keys.get(_VERTICAL, 0) < _USER_DEFINED:
        heights = height_axis(f"EPSG:{keys[_VERTICAL]}")
    unit = 1.0 if unit is None else unit
    metres = _unit_of_key(keys, _HEIGHT_UNIT, path)
    if metres is None:
        metres = heights.metres if heights.is_stated else unit
    if unit != 1.0 or metres != 1.0:
        notes.append(f"in units of {unit:.7g} m, heights of {metres:.7g} m: converted to metres")
    return unit, metres, heights.sign


_WKT = 2112
"""Code of the LAS record with a coordinate system as text (LAS 1.4 R15, section 3)."""

_KEYS = 34735
"""Code of the LAS record with GeoTIFF keys (LAS 1.4 R15, section 3)."""

_MODEL = 1024
"""Code of the GeoTIFF key for the kind of coordinates (GeoTIFF 1.1, section 7, as the next)."""

_MAP_UNIT = 3076
"""Code of the GeoTIFF key for the unit of the map."""

_VERTICAL = 4096
"""Code of the GeoTIFF key for the vertical system."""

_HEIGHT_UNIT = 4099
"""Code of the GeoTIFF key for the unit of heights."""

_USER_DEFINED = 32767
"""Code of GeoTIFF for a value whose meaning is given by other keys."""


def _unit_of_key(keys: dict[int, int], key: int, path: str | Path) -> float | None:
    """Return the metres in the unit that a GeoTIFF key states; None where it states none."""
    code = keys.get(key, 0)
    if code in (0, _USER_DEFINED):
        return None
    metres = metres_per_unit_code(code)
    if metres is None:
        raise InputError(f"{path}: in units EPSG:{code}; expected a known unit of length")
    return metres


def _system_of(header: Any) -> tuple[Any, dict[int, int]]:
    """Return the coordinate system that a LAS header names, None for none, and its GeoTIFF keys."""
    keys: dict[int, int] = {}
    for record in header.vlrs:
        if record.record_id == _KEYS:
            keys = {k.id: k.value_offset for k in getattr(record, "geo_keys", ())}
    try:
        return header.parse_crs(), keys
    except Exception:  # pyproj is not installed, or does not know the record
        return None, keys

"""Meaning of columns of tables, axes of coordinate systems, and units.

All readers of goals, paths, clouds, recordings, grids and maps use this module, so that a depth
counts downwards and a foot is a foot in each of them.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.base.errors import InputError
from netsp.base.field_types import LARGEST
from netsp.base.files import csv_lines, read_bytes, read_gzip
from netsp.base.validated import parse_json, shown

UNITS = {
    "m": 1.0, "km": 1e3, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "us-ft": 1200.0 / 3937.0,
    "in": 0.0254, "yd": 0.9144, "fathom": 1.8288, "nmi": 1852.0,
}  # fmt: skip
"""Metres per unit of length."""

_LENGTH_NAMES = {
    "m": ("metre", "meter", "metres", "meters", "mtr"),
    "km": ("kilometre", "kilometer", "kilometres", "kilometers"),
    "cm": ("centimetre", "centimeter", "centimetres", "centimeters"),
    "mm": ("millimetre", "millimeter", "millimetres", "millimeters"),
    "ft": ("foot", "feet", "international foot", "'"),
    "us-ft": ("us survey foot", "us survey feet", "us_survey_foot", "foot_us", "us foot", "us feet",
              "us_ft", "usft", "ftus", "ft-us", "ftus", "us ft", "survey foot", "survey feet"),
    "in": ("inch", "inches"),
    "yd": ("yard", "yards"),
    "fathom": ("fathoms", "fm", "ftm"),
    "nmi": ("nautical mile", "nautical miles"),
}  # fmt: skip

_ANGLES = {
    "deg": 1.0, "degs": 1.0, "degree": 1.0, "degrees": 1.0, "°": 1.0, "dd": 1.0, "e7": 1e-7,
    "dege7": 1e-7, "rad": math.degrees(1.0), "rads": math.degrees(1.0),
    "radian": math.degrees(1.0), "radians": math.degrees(1.0),
}  # fmt: skip
"""Degrees per unit of angle."""

_DURATIONS = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3,
    "milliseconds": 1e-3, "us": 1e-6, "usec": 1e-6, "µs": 1e-6, "microseconds": 1e-6, "ns": 1e-9,
    "nsec": 1e-9, "nanoseconds": 1e-9, "min": 60.0, "minutes": 60.0, "h": 3600.0, "hours": 3600.0,
}  # fmt: skip
"""Seconds per unit of time."""

_SPEEDS = {
    "m/s": 1.0, "mps": 1.0, "m_s": 1.0, "ms": 1.0, "ms-1": 1.0, "m s-1": 1.0, "cm/s": 0.01,
    "mm/s": 1e-3, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0, "kt": 1852.0 / 3600.0,
    "kts": 1852.0 / 3600.0, "knots": 1852.0 / 3600.0, "ft/s": 0.3048,
}  # fmt: skip
"""Metres per second per unit of speed."""

Quantity = Literal[
    "x", "y", "z", "east", "north", "easting", "northing", "altitude", "latitude", "longitude",
    "time", "date", "heading",
    "velocity_x", "velocity_y", "velocity_z", "name", "identifier", "radius", "armed", "mode",
    "estimate", "paid_out", "classification", "withheld",
]  # fmt: skip
"""Quantities that a column can hold. `east` and `north` count from a place such as home, `easting`
and `northing` are coordinates of a map. A column `z` is preferred to `altitude`, which may count
from the sea floor."""

MAP_PAIRS: tuple[tuple[Quantity, Quantity], ...] = (
    ("x", "y"), ("easting", "northing"), ("east", "north"),
)  # fmt: skip
"""Pairs of columns that hold a place on a map whose y axis points north, the preferred first."""

_ALIASES: Mapping[Quantity, Mapping[str, float]] = {
    "x": dict.fromkeys(
        ("x", "xcoord", "x coord", "x coordinate", "coord x", "coordinate x", "pos x",
         "position x", "position.x", "point x", "points:0", "points 0", "local x"), 1.0),
    "y": dict.fromkeys(
        ("y", "ycoord", "y coord", "y coordinate", "coord y", "coordinate y", "pos y",
         "position y", "position.y", "point y", "points:1", "points 1", "local y"), 1.0),
    "z": {
        **dict.fromkeys(
            ("z", "height", "elevation", "elev", "ele", "up", "zcoord", "z coord", "z coordinate",
             "coord z", "coordinate z", "pos z", "position z", "position.z", "point z", "points:2",
             "points 2", "local z"), 1.0),
        **dict.fromkeys(
            ("depth", "down", "water depth", "waterdepth", "dpt", "sounding", "dive depth",
             "depth below surface"), -1.0),
    },
    "east": {"east": 1.0, "west": -1.0},
    "north": {"north": 1.0, "south": -1.0},
    "easting": dict.fromkeys(("easting", "e", "utm e", "utm x", "x utm", "utm easting"), 1.0),
    "northing": dict.fromkeys(("northing", "n", "utm n", "utm y", "y utm", "utm northing"), 1.0),
    "altitude": dict.fromkeys(("alt", "altitude", "relative alt", "rel alt"), 1.0),
    "latitude": dict.fromkeys(("lat", "latitude", "gps lat", "gps latitude"), 1.0),
    "longitude": dict.fromkeys(
        ("lon", "lng", "long", "longitude", "gps lon", "gps lng", "gps longitude"), 1.0),
    "time": {
        **dict.fromkeys(
            ("t", "time", "timestamp", "time stamp", "seconds", "secs", "sec", "datetime",
             "date time", "utc", "time utc", "utc time", "gps time", "unix time", "epoch",
             "elapsed", "elapsed time", "stamp", "time boot", "boot time"), 1.0),
        "timeus": 1e-6, "timems": 1e-3,
    },
    "date": dict.fromkeys(("date", "utc date", "date utc", "gps date"), 1.0),
    "heading": dict.fromkeys(("heading", "yaw", "hdg", "compass", "psi"), 1.0),
    "velocity_x": dict.fromkeys(("vx", "vel x", "velocity x", "v x"), 1.0),
    "velocity_y": dict.fromkeys(("vy", "vel y", "velocity y", "v y"), 1.0),
    "velocity_z": dict.fromkeys(("vz", "vel z", "velocity z", "v z"), 1.0),
    "name": dict.fromkeys(("name", "label", "title", "objnam", "goal", "waypoint"), 1.0),
    "identifier": dict.fromkeys(
        ("id", "fid", "number", "no", "nr", "no.", "nr.", "index", "point id", "station"), 1.0),
    "radius": {"radius": 1.0, "diameter": 0.5},
    "armed": {"armed": 1.0},
    "mode": {"mode": 1.0, "flight mode": 1.0},
    "estimate": {"estimate": 1.0},
    "paid_out": dict.fromkeys(("paid out", "payout", "tether out", "cable out"), 1.0),
    "classification": dict.fromkeys(
        ("classification", "class", "scalar classification"), 1.0),  # the last is CloudCompare's
    "withheld": {"withheld": 1.0},
}  # fmt: skip
"""Names of columns in lower case with blanks for underscores, and the factor on their values."""

_TEXTS = {"date", "name", "identifier", "mode", "armed", "estimate", "withheld"}
"""Quantities without a unit."""

_PLACES = {
    "x", "y", "z", "east", "north", "easting", "northing", "altitude", "latitude", "longitude",
}  # fmt: skip
"""Quantities whose unknown units are refused. Other columns with an unknown unit are not used."""

_DIRECTIONS = {"up": 1.0, "down": -1.0, "positive up": 1.0, "positive down": -1.0}
"""Sign of the values of a height column, by the word after its name."""

_REFERENCES = {
    "utc", "gmt", "iso", "iso8601", "iso 8601", "unix", "epoch", "gps", "utm", "wgs84", "wgs 84",
    "etrs89", "msl", "cd", "chart datum", "mllw", "navd88", "nap", "nn", "nhn",
}  # fmt: skip
"""Clocks, systems and datums that may stand in brackets in place of a unit."""

NOISE_CLASSES = {7: "low noise", 18: "high noise"}
"""Classes of points that belong to no surface (ASPRS LAS 1.4 R15, tables 9 and 17)."""

CUSTOMARY_NODATA = (
    -9999.0, 9999.0, -99999.0, 99999.0, -32768.0, -32767.0, 32767.0, -999999.0, 999999.0,
)  # fmt: skip
"""Sentinel values that usually mark a missing height.

If a file does not declare them as nodata, they count as missing only where their distance from all
other values exceeds the range of those values.
"""

MAX_HEIGHT = 1e9
"""Sentinel limit of heights, in units of the file: larger values, such as 1e20 or the largest
number of a data type, mark a missing height. Heights on earth are below 1.2e7 mm."""


@dataclass(frozen=True)
class Column:
    """Meaning of a column.

    Parameters
    ----------
    quantity : str
        Quantity that it holds.
    factor : float
        Factor from its values to metres, degrees, seconds or metres per second, z upwards: the
        factor of a depth is negative.
    unit : str
        Unit that its name states; empty where it states none.
    """

    quantity: Quantity
    factor: float = 1.0
    unit: str = ""


def metres_per_unit(name: str) -> float | None:
    """Return the metres in a unit of length by any of its names; None for an unknown one.

    Examples
    --------
    >>> metres_per_unit("Feet"), metres_per_unit("US survey foot") == 1200 / 3937
    (0.3048, True)
    """
    text = " ".join(name.strip().lower().strip(".").split())
    if text in UNITS:
        return UNITS[text]
    return next((UNITS[unit] for unit, names in _LENGTH_NAMES.items() if text in names), None)


def column(name: str) -> Column | None:
    """Return the meaning of a column's name; None for a name without a known meaning.

    The name may be in any case, and have a unit: ``depth``, ``Depth (ft)``, ``x_m``, ``lat [deg]``.

    Raises
    ------
    InputError
        A known quantity in a unit that is not one of its units.

    Examples
    --------
    >>> column("Depth_m")
    Column(quantity='z', factor=-1.0, unit='m')
    >>> column("colour") is None
    True
    """
    text = name.strip().strip('"').lower()
    bare = _bare(text)
    for quantity, names in _ALIASES.items():
        if bare in names:
            return Column(quantity, names[bare])
    bracket = re.fullmatch(r"(.*?)[\s_.,:/]*[\(\[\{<]\s*([^\)\]\}>]*?)\s*[\)\]\}>]", text)
    tail = re.fullmatch(r"(.*?)(?:,\s*|/\s*|[\s_.:-]+)([^\s_,]+(?:/s)?)", text)
    for match, is_certain in ((bracket, True), (tail, False)):
        if match is None:
            continue
        stem, unit = _bare(match[1]), match[2].strip()
        for quantity, names in _ALIASES.items():
            if stem not in names:
                continue
            factor = _unit_factor(quantity, unit)
            if factor is not None:
                return Column(quantity, names[stem] * factor, unit)
            if quantity == "z" and unit in _DIRECTIONS:
                return Column(quantity, names[stem] * _DIRECTIONS[unit])
            if not is_certain:
                continue
            if not unit or unit in _REFERENCES:
                return Column(quantity, names[stem])
            if quantity in _PLACES:
                known = ", ".join(UNITS)
                raise InputError(
                    f"column {shown(name)}: expected a unit of {known}, got {shown(unit)}"
                )
    return None


def _bare(text: str) -> str:
    return " ".join(text.replace("_", " ").split())


def _unit_factor(quantity: Quantity, unit: str) -> float | None:
    if quantity in _TEXTS or quantity == "classification":
        return None
    if quantity == "time":
        return _DURATIONS.get(unit)
    if quantity in ("latitude", "longitude", "heading"):
        return _ANGLES.get(unit)
    if quantity.startswith("velocity"):
        return _SPEEDS.get(unit)
    return metres_per_unit(unit)


def height_meaning(names: Sequence[str]) -> Column | None:
    """Return the meaning of a band or variable by the first of its names that means heights, or
    None.

    Names are descriptions, or standard names of the CF conventions. Depths have a negative factor.

    Raises
    ------
    InputError
        Heights in an unknown unit.

    Examples
    --------
    >>> height_meaning(["Band 1", "sea_floor_depth_below_geoid"]).factor
    -1.0
    """
    for name in names:
        bare = _bare(name.lower())
        for sign, beginnings in _HEIGHT_BEGINNINGS:
            if bare.startswith(beginnings):
                return Column("z", sign)
        meaning = column(name)
        if meaning is not None and meaning.quantity in ("z", "altitude"):
            return meaning
    return None


_HEIGHT_BEGINNINGS = (
    (-1.0, ("sea floor depth", "depth below", "bathymetric depth", "bathymetry depth")),
    (1.0, ("height above", "surface altitude", "bedrock altitude", "sea floor altitude")),
)
"""Sign of the values, and beginnings of names of bands or variables with it (CF conventions)."""


def marks_of_no_height(z: Floats, *more: float) -> list[tuple[float, Bools]]:
    """Return the values that mark a missing height, each with a mask of where it occurs.

    Parameters
    ----------
    z : ndarray
        Heights in the units of their file; NaN where there is none.
    *more : float
        Further values that may mark a missing height, such as the largest of the data type.

    Examples
    --------
    >>> marks_of_no_height(np.array([-4.0, -9999.0, -5.0]))
    [(-9999.0, array([False,  True, False]))]
    """
    customary = (*CUSTOMARY_NODATA, *more)
    suspect = np.isin(z, customary) | (np.abs(z) > MAX_HEIGHT)
    if not suspect.any():
        return []
    others = z[~suspect & ~np.isnan(z)]
    span = float(np.ptp(others)) if len(others) else 0.0
    found = []
    for value in np.unique(z[suspect]):
        apart = float(np.abs(others - value).min()) if len(others) else math.inf
        if abs(value) > MAX_HEIGHT or apart > span:
            found.append((float(value), np.asarray(z == value)))
    return found


@dataclass(frozen=True)
class Table:
    """Table of a text file, with its columns by the quantities that they hold.

    Parameters
    ----------
    source : str
        Name of the file, for messages.
    head : tuple of str
        Names of the columns as they are written; empty for a table without a head.
    columns : mapping
        Position and meaning of each column with a known name, by quantity.
    unused : tuple of str
        Names of the other columns.
    rows : list of list of str
        Cells.
    lines : list of int
        Number of each row's line in the file, from 1.
    has_decimal_commas : bool
        Whether numbers are written as ``1,5``.
    """

    source: str
    head: tuple[str, ...]
    columns: Mapping[Quantity, tuple[int, Column]]
    unused: tuple[str, ...]
    rows: list[list[str]] = field(repr=False)
    lines: list[int] = field(repr=False)
    has_decimal_commas: bool = False

    def __contains__(self, quantity: object) -> bool:
        return quantity in self.columns

    def text(self, row: int, quantity: Quantity) -> str:
        """Return a cell without blanks around it; empty if there is none."""
        if quantity not in self.columns:
            return ""
        k = self.columns[quantity][0]
        cells = self.rows[row]
        return cells[k].strip() if k < len(cells) else ""

    def plain(self, row: int, quantity: Quantity) -> str:
        """Return the text of a number with a decimal point."""
        text = self.text(row, quantity)
        return text.replace(",", ".") if self.has_decimal_commas and _COMMA.match(text) else text

    def number(self, row: int, quantity: Quantity) -> float:
        """Return a number in metres, degrees or seconds, z upwards.

        Raises
        ------
        InputError
            The cell is no finite number.
        """
        try:
            value = float(self.plain(row, quantity))
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST:
            raise InputError(
                f"{self.source}: line {self.lines[row]}: {self.title(quantity)}: expected a "
                f"number, got {shown(self.text(row, quantity))}"
            )
        return value * self.columns[quantity][1].factor + 0.0

    def title(self, quantity: Quantity) -> str:
        """Return the name of the column with a quantity as the file writes it."""
        if quantity in self.columns and self.head:
            return self.head[self.columns[quantity][0]].strip()
        return str(quantity)

    def numbers(self, quantities: Sequence[Quantity]) -> Floats:
        """Return columns of numbers (n, k) in metres, degrees or seconds, z upwards.

        Raises
        ------
        InputError
            A cell is no finite number.
        """
        values = self._numbers(quantities)
        if "z" in quantities:
            self.check_depths(values[:, list(quantities).index("z")])
        return values

    def check_depths(self, z: Floats) -> None:
        """Refuse a column of depths, given as metres upwards (n,), that holds heights: no value
        below 0.

        Raises
        ------
        InputError
            All values count upwards.
        """
        if self.columns["z"][1].factor < 0.0 and len(z) and z.min() >= 0.0 and z.max() > 0.0:
            raise InputError(
                f"{self.source}: column {shown(self.title('z'))} holds negative numbers only, and "
                "depths count downwards; expected positive depths, or the name z for heights"
            )

    def _numbers(self, quantities: Sequence[Quantity]) -> Floats:
        places = [self.columns[q][0] for q in quantities]
        factors = np.array([self.columns[q][1].factor for q in quantities])
        try:
            cells = [[row[k] for k in places] for row in self.rows]
            if self.has_decimal_commas:
                cells = [[c.replace(",", ".") for c in row] for row in cells]
            values = np.array(cells, dtype=float).reshape(len(cells), len(places))
            if (np.abs(values) <= LARGEST).all():
                return np.asarray(values * factors + 0.0)
        except (ValueError, IndexError):
            pass
        return np.array(
            [[self.number(k, q) for q in quantities] for k in range(len(self.rows))]
        ).reshape(len(self.rows), len(places))

    def pair(
        self, pairs: Sequence[tuple[Quantity, Quantity]] = MAP_PAIRS
    ) -> tuple[Quantity, Quantity] | None:
        """Return the first pair of quantities that the table holds, the preferred one first, or
        None."""
        return next((p for p in pairs if p[0] in self and p[1] in self), None)

    def height(self) -> Quantity | None:
        """Return the quantity that holds z: `z` (perhaps from depths), else `altitude`, or None."""
        if "z" in self:
            return "z"
        return "altitude" if "altitude" in self else None

    def wanted(self, text: str) -> InputError:
        """Return an error that states which columns were expected and which there are."""
        got = ", ".join(name.strip() for name in self.head) if self.head else "no names of columns"
        return InputError(f"{self.source}: expected {text}, got {shown(got)}")

    def left_out(self, quantities: Sequence[Quantity]) -> tuple[str, ...]:
        """Return the names of the columns that hold none of the quantities that a reader uses."""
        known = [self.title(q) for q in self.columns if q not in quantities]
        return (*known, *self.unused)

    def notes(self, quantities: Sequence[Quantity], max_length: int = 200) -> list[str]:
        """Return notes on decimal commas, and on columns without the quantities that the reader
        uses.

        `max_length` is the maximum number of characters for the names of unused columns.
        """
        out = ["numbers are read with decimal commas"] if self.has_decimal_commas else []
        names = [shown(name) if "," in name else name for name in self.left_out(quantities)]
        return out + ([f"unused columns: {', '.join(names)[:max_length]}"] if names else [])


_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?$")
_POINT = re.compile(r"[-+]?(\d+\.\d*|\.\d+)([eE][-+]?\d+)?$")
_WHOLE = re.compile(r"[-+]?\d+$")


def decode_text(data: bytes, source: str) -> str:
    """Return the text of a file in UTF-8, or in UTF-16 with a byte order mark, without the mark.

    Raises
    ------
    InputError
        Another encoding.
    """
    is_wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        return data.decode("utf-16" if is_wide else "utf-8-sig").removeprefix("\ufeff")
    except UnicodeDecodeError:
        raise InputError(f"{source}: not a text file in UTF-8") from None


def read_path(file: str | Path, on_note: Callable[[str], None] | None = None) -> Floats | None:
    """Read a polyline (k, 2) or (k, 3) from a table or a JSON list of points; None for a JSON
    object.

    A JSON object is taken for a solution.

    Parameters
    ----------
    file : str or Path
        Table with the columns x, y and perhaps z or depth in any order, or two or three columns
        without names.
    on_note : callable, optional
        Called with one line each for decimal commas and for unused columns.

    Raises
    ------
    InputError
        A row that cannot be read, or fewer than two points.
    """
    text = decode_text(read_bytes(file), str(file))
    if text.lstrip().startswith("{"):
        return None
    if text.lstrip().startswith("["):
        rows = parse_json(text, str(file))
        for k, row in enumerate(rows):
            if not _is_point(row) or len(row) != len(rows[0]):
                raise InputError(f"{file}: point {k}: expected x, y or x, y, z, got {shown(row)}")
        points = np.array(rows, dtype=float)
    elif not text.strip():
        points = np.empty((0, 2))
    else:
        table = read_table(file, positional=("x", "y", "z"), text=text)
        points = _polyline(table)
        if on_note is not None:
            for note in table.notes(("x", "y", "z", "altitude")):
                on_note(f"{file}: {note}")
    if len(points) < 2:
        raise InputError(f"{file}: expected a path of at least 2 points, got {len(points)}")
    return points


def _polyline(table: Table) -> Floats:
    if table.head:
        if table.pair((("x", "y"),)) is None:
            raise table.wanted("columns x, y and perhaps z or depth")
        up = table.height()
        return table.numbers(("x", "y", up) if up else ("x", "y"))
    for k, row in enumerate(table.rows):
        cells = [c.replace(",", ".") if table.has_decimal_commas else c for c in row]
        if not _is_point(cells) or len(row) != len(table.rows[0]):
            raise InputError(
                f"{table.source}: point {k}: expected x, y or x, y, z, got {shown(row)}"
            )
    names: tuple[Quantity, ...] = ("x", "y", "z")
    return table.numbers(names[: len(table.rows[0])])


def _is_point(row: object) -> bool:
    if not isinstance(row, list) or len(row) not in (2, 3):
        return False
    try:
        return all(abs(float(x)) <= LARGEST for x in row)
    except (TypeError, ValueError):
        return False


def read_table(
    file: str | Path,
    *,
    positional: Sequence[Quantity] = (),
    text: str | None = None,
    sample_lines: int = 1000,
) -> Table:
    """Read a table of any separator, decimal sign and order of columns.

    Parameters
    ----------
    file : str or Path
        Table in UTF-8 (or UTF-16 with a byte order mark), perhaps packed (``.gz``); separated by
        semicolons, tabs, commas or blanks. Lines that begin with ``#`` or ``//`` are comments; the
        last of them before the first row may name the columns.
    positional : sequence of str
        Quantities of the first columns of a table without a head; empty to refuse such a table.
    text : str, optional
        Contents of the file, where they have been read already.
    sample_lines : int
        Number of lines that decide the separator and the decimal sign; later lines must agree.

    Raises
    ------
    InputError
        Unreadable or ambiguous: two columns for one quantity, decimal commas between commas, mixed
        decimal signs, rows longer than the head.
    """
    source = str(file)
    if text is None:
        is_packed = source.lower().endswith(".gz")
        text = decode_text(read_gzip(file) if is_packed else read_bytes(file), source)
    numbered, comment = _content(text)
    if not numbered:
        raise InputError(f"{source}: expected a table, got nothing")
    separator = _separator(numbered, source, sample_lines)
    rows, lines = _cells(numbered, separator, source)
    head: tuple[str, ...] = ()
    if not any(_is_number(cell) for cell in rows[0]):
        head, rows, lines = tuple(rows[0]), rows[1:], lines[1:]
    elif comment is not None:
        names = _comment_head(comment, separator)
        if len(names) >= len(rows[0]) or len(names) >= 3:
            head = names
    columns, unused = meanings(head, source) if head else ({}, ())
    if not head:
        columns = _by_position(rows, positional, source, sample_lines)
        unused = tuple(f"column {k + 1}" for k in range(len(positional), max(map(len, rows))))
        if not positional:
            raise InputError(
                f"{source}: line {lines[0]}: expected the names of the columns first, got "
                f"{shown(', '.join(rows[0]))}"
            )
    for line, cells in zip(lines, rows, strict=True):
        if head and len(cells) > len(head) and any(c.strip() for c in cells[len(head) :]):
            hint = "; decimal commas need semicolons between the cells" if separator == "," else ""
            raise InputError(
                f"{source}: line {line}: expected {len(head)} cells as the head has, got "
                f"{len(cells)}{hint}"
            )
    used = [k for q, (k, _) in columns.items() if q not in _TEXTS]
    commas = _decimal_commas(rows, lines, used, source, sample_lines)
    if not head and separator == "," and not commas:
        _check_commas(rows, lines, source, sample_lines)
    return Table(source, head, columns, unused, rows, lines, commas)


def _content(text: str) -> tuple[list[tuple[int, str]], str | None]:
    """Return the numbered lines that are no comments, and the last comment before them."""
    numbered: list[tuple[int, str]] = []
    comment = None
    for number, line in enumerate(text.splitlines(), 1):
        bare = line.strip()
        if not bare.strip(",;"):
            continue
        if bare.startswith(("#", "//")):
            if not numbered:
                comment = bare.lstrip("#/! ").strip()
            continue
        numbered.append((number, line))
    return numbered, comment


def _separator(numbered: Sequence[tuple[int, str]], source: str, sample_lines: int) -> str:
    """Return the separator of a table: a semicolon, a tab, a comma or a blank."""
    first = numbered[0][1].strip()
    stated = re.fullmatch(r"sep=(.)", first.lower())
    if stated and isinstance(numbered, list):
        numbered.pop(0)
        if not numbered:
            raise InputError(f"{source}: expected a table, got nothing")
        return str(stated[1])
    sample = [line for _, line in numbered[:sample_lines]]
    for mark in (";", "\t"):
        if all(mark in line for line in sample):
            return mark
    if not any("," in line for line in sample):
        return " "
    body = [line.split() for line in sample[1:] or sample]
    are_numbers = all(
        len(cells) > 1 and all(_COMMA.match(c) or _WHOLE.match(c) for c in cells) for cells in body
    )
    if are_numbers and any("," in c for cells in body for c in cells):
        return " "
    if "," in first:
        return ","
    return " " if len(first.split()) > 1 else ","


def _cells(
    numbered: Sequence[tuple[int, str]], separator: str, source: str
) -> tuple[list[list[str]], list[int]]:
    lines = [number for number, _ in numbered]
    if separator == " ":
        return [line.split() for _, line in numbered], lines
    if not any('"' in line for _, line in numbered):
        return [line.strip("\r\n").split(separator) for _, line in numbered], lines
    text = "\n".join(line for _, line in numbered)
    if separator == ",":
        rows = list(csv_lines(text, source))
    else:
        try:
            rows = list(csv.reader(io.StringIO(text, newline=""), delimiter=separator))
        except csv.Error as error:
            raise InputError(f"{source}: {error}") from None
    if len(rows) != len(lines):
        raise InputError(f"{source}: expected each row of the table on one line")
    return rows, lines


def _comment_head(comment: str, separator: str) -> tuple[str, ...]:
    """Return the names in a comment, where they name coordinates; else nothing."""
    for mark in (separator, ",", ";", "\t", " "):
        names = tuple(n.strip() for n in (comment.split() if mark == " " else comment.split(mark)))
        found = {c.quantity for n in names if n and (c := column(n)) is not None}
        pairs = (*MAP_PAIRS, ("latitude", "longitude"))
        if any(found.issuperset(pair) for pair in pairs):
            return names
    return ()


def meanings(
    head: Sequence[str], source: str
) -> tuple[dict[Quantity, tuple[int, Column]], tuple[str, ...]]:
    """Return the position and meaning of each known column by its quantity, and the other names.

    Raises
    ------
    InputError
        Two columns for one quantity, or an unknown unit.
    """
    found: dict[Quantity, list[tuple[int, Column]]] = {}
    unused = []
    for k, name in enumerate(head):
        try:
            meaning = column(name)
        except InputError as error:
            raise InputError(f"{source}: {error}") from None
        if meaning is None:
            if name.strip():
                unused.append(name.strip())
        else:
            found.setdefault(meaning.quantity, []).append((k, meaning))
    columns: dict[Quantity, tuple[int, Column]] = {}
    for quantity, places in found.items():
        preferred = [p for p in places if _bare(head[p[0]].lower()) == quantity]
        if len(places) > 1 and (quantity == "z" or len(preferred) != 1):
            if quantity in _TEXTS:
                preferred = places[:1]
            else:
                names = " and ".join(shown(head[k].strip()) for k, _ in places)
                raise InputError(
                    f"{source}: columns {names} both hold {quantity}; expected one of them"
                )
        chosen = preferred[0] if preferred else places[0]
        columns[quantity] = chosen
        unused += [head[k].strip() for k, _ in places if k != chosen[0]]
    return columns, tuple(unused)


def _by_position(
    rows: Sequence[Sequence[str]], positional: Sequence[Quantity], source: str, sample_lines: int
) -> dict[Quantity, tuple[int, Column]]:
    """Return the columns of a table without a head."""
    width = min(map(len, rows))
    sample = rows[:sample_lines]
    if width > len(positional) > 0 and len(sample) > 2:
        first = [cells[0].strip() for cells in sample]
        if all(_WHOLE.match(c) for c in first):
            steps = {b - a for a, b in zip(map(int, first), map(int, first[1:]), strict=False)}
            if len(steps) == 1 and steps.pop() > 0:
                raise InputError(
                    f"{source}: the first column seems to number the rows; expected the names of "
                    "the columns in the first line"
                )
    return {q: (k, Column(q)) for k, q in enumerate(positional) if k < width}


def _decimal_commas(
    rows: Sequence[Sequence[str]],
    lines: Sequence[int],
    used: Sequence[int],
    source: str,
    sample_lines: int,
) -> bool:
    """Return whether numbers are written with decimal commas; refuse a mixture."""
    comma = point = -1
    for k, cells in enumerate(rows):
        for j in used:
            cell = cells[j].strip() if j < len(cells) else ""
            if comma < 0 and "," in cell and _COMMA.match(cell):
                comma = k
            elif point < 0 and "." in cell and _POINT.match(cell):
                point = k
        if k >= sample_lines and comma < 0:
            break
    if comma >= 0 and point >= 0:
        raise InputError(
            f"{source}: line {lines[comma]} has decimal commas and line {lines[point]} decimal "
            "points; expected one of them"
        )
    return comma >= 0


def _check_commas(
    rows: Sequence[Sequence[str]], lines: Sequence[int], source: str, sample_lines: int
) -> None:
    """Refuse a table without a head whose commas may be separators or decimal signs."""
    sample = rows[:sample_lines]
    if not all(_WHOLE.match(c.strip()) for cells in sample for c in cells):
        return
    is_halved = any(re.match(r"0\d", c.strip()) for cells in sample for c in cells[1::2])
    if len(rows[0]) == 6 or (len(rows[0]) == 4 and is_halved):
        raise InputError(
            f"{source}: line {lines[0]}: the commas may be decimal commas; expected decimal "
            "points, or semicolons between the cells"
        )


def _is_number(cell: str) -> bool:
    text = cell.strip()
    if _COMMA.match(text):
        return True
    try:
        float(text)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class HeightAxis:
    """Vertical axis of a coordinate system.

    Parameters
    ----------
    sign : float
        1 where values count upwards, -1 where they are depths.
    metres : float
        Metres per unit.
    is_stated : bool
        Whether the system has a vertical axis; else heights are taken in the unit of the map.
    """

    sign: float = 1.0
    metres: float = 1.0
    is_stated: bool = False

    @property
    def change(self) -> str:
        """Note on converted heights; empty for heights in metres upwards."""
        parts = ["count downwards"] if self.sign < 0.0 else []
        parts += [f"are in units of {self.metres:.7g} m"] if self.metres != 1.0 else []
        return f"heights {' and '.join(parts)}: converted to metres upwards" if parts else ""


def height_axis(crs: Any) -> HeightAxis:
    """Return the direction and the unit of heights in a coordinate system.

    Without a vertical system, heights count upwards, in the unit of a projected map, or in metres
    for a system in degrees.

    Parameters
    ----------
    crs : pyproj.CRS or str
        Coordinate system, such as ``EPSG:25832+5715`` (depths in metres).

    Raises
    ------
    InputError
        Unknown system, or pyproj is not installed.
    """
    system = _system(crs)
    for axis in system.axis_info:
        direction = axis.direction.lower()
        if direction in ("up", "down"):
            factor = axis.unit_conversion_factor or 1.0
            return HeightAxis(-1.0 if direction == "down" else 1.0, float(factor), True)
    return HeightAxis(1.0, map_unit(system) or 1.0)


def map_unit(crs: Any) -> float | None:
    """Return the metres per unit of a coordinate system's map; None if it is in angles.

    Raises
    ------
    InputError
        Unknown or geocentric system, or pyproj is not installed.
    """
    system = _system(crs)
    if system.is_geographic:  # in degrees or grads
        return None
    if system.is_geocentric:
        raise InputError(
            "geocentric coordinates (from the centre of the earth); expected map coordinates, such "
            "as UTM"
        )
    for axis in system.axis_info:
        if axis.direction.lower() not in ("up", "down"):
            return float(axis.unit_conversion_factor or 1.0)
    return 1.0


def metres_per_unit_code(code: int) -> float | None:
    """Return the metres in a unit of length by its EPSG code, as in GeoTIFF keys; None for unknown
    codes.

    Examples
    --------
    >>> metres_per_unit_code(9002)
    0.3048
    """
    known = {9001: 1.0, 9002: UNITS["ft"], 9003: UNITS["us-ft"]}
    if code in known:
        return known[code]
    try:
        from pyproj.database import get_units_map
    except ImportError:
        return None
    units = get_units_map(auth_name="EPSG", category="linear", allow_deprecated=True)
    return next((float(u.conv_factor) for u in units.values() if u.code == str(code)), None)


def _system(crs: Any) -> Any:
    try:
        from pyproj import CRS
        from pyproj.exceptions import ProjError
    except ImportError:
        raise InputError("positions on the earth need pyproj: pip install 'netsp[geo]'") from None
    try:
        return CRS.from_user_input(crs)
    except ProjError as error:
        raise InputError(
            f"crs: expected a coordinate system as EPSG:32632, got {str(crs)[:60]!r} "
            f"({str(error).splitlines()[0][:80]})"
        ) from None

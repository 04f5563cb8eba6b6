"""Meaning of the names of columns.

All readers of goals, paths, clouds, recordings, grids and maps use this module, so that a depth
counts downwards and a foot is a foot in each of them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from netsp.base.errors import InputError
from netsp.base.units import ANGLES, DURATIONS, SPEEDS, UNITS, metres_per_unit
from netsp.base.validated import shown

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

WITHOUT_UNIT = {"date", "name", "identifier", "mode", "armed", "estimate", "withheld"}
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
    if quantity in WITHOUT_UNIT or quantity == "classification":
        return None
    if quantity == "time":
        return DURATIONS.get(unit)
    if quantity in ("latitude", "longitude", "heading"):
        return ANGLES.get(unit)
    if quantity.startswith("velocity"):
        return SPEEDS.get(unit)
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
            if quantity in WITHOUT_UNIT:
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

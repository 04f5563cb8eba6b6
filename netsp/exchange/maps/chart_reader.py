"""Reader of S-57 charts: a cell with its updates, in metres, and the datum of its depths."""

from __future__ import annotations

import re
import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from netsp.base.errors import InputError, UnansweredError, counted
from netsp.base.files import check_file
from netsp.base.units import UNITS
from netsp.exchange.maps.chart_classes import SOUNDINGS
from netsp.exchange.maps.feature import Feature, Map
from netsp.exchange.maps.import_policy import DEFAULT_READ, ReadPolicy
from netsp.exchange.maps.vector import gdal_options, read_plain, read_rows
from netsp.exchange.maps.word_tables import words
from netsp.model.import_record import MAX_NAMED

NUMBERED = re.compile(r"\.(\d{3})$")
"""Extension of a chart's files: 000 of a cell, 001 and more of its updates."""

CELL = ".000"
"""Extension of cells."""

LEADER_BYTES = 24
"""Format ISO/IEC 8211: size of the leader of a record."""

UPDATE = 2
"""Code of an update in EXPP (purpose of the exchange)."""

LATITUDE_LONGITUDE = 1
"""Code of degrees in COUN (unit of coordinates)."""

WGS_84 = 2
"""Code of WGS 84 in HDAT (horizontal datum)."""

GDAL_OPTIONS = {
    "OGR_S57_OPTIONS": "UPDATES=APPLY,SPLIT_MULTIPOINT=OFF,ADD_SOUNDG_DEPTH=OFF,RECODE_BY_DSSI=ON"
}
"""Options of GDAL's reader, which override those of the environment."""

DEPTH_UNITS = {1: "m", 3: "ft", 4: "fathom"}
"""Units of depths by DUNI; 2 (fathoms and feet in one number) is ambiguous and not read."""

HEIGHT_UNITS = {1: "m", 2: "ft"}
"""Units of heights and of lengths by HUNI."""

DEPTHS = frozenset({"DRVAL1", "DRVAL2", "VALSOU", "VALDCO", "BURDEP"})
"""Attributes in the unit of depths."""

LENGTHS = words("ELEVAT HEIGHT HORCLR HORLEN HORWID VERCCL VERCLR VERCOP VERCSA VERLEN")
"""Attributes in the unit of heights."""

DATUMS = dict(enumerate((
    "mean low water springs", "mean lower low water springs", "mean sea level", "lowest low water",
    "mean low water", "lowest low water springs", "approximate mean low water springs",
    "Indian spring low water", "low water springs", "approximate lowest astronomical tide",
    "nearly lowest low water", "mean lower low water", "low water", "approximate mean low water",
    "approximate mean lower low water", "mean high water", "mean high water springs", "high water",
    "approximate mean sea level", "high water springs", "mean higher high water",
    "equinoctial spring low water", "lowest astronomical tide", "a local datum",
    "International Great Lakes Datum 1985", "mean water level", "lower low water large tide",
    "higher high water large tide", "nearly highest high water", "highest astronomical tide",
), 1)) | {44: "Baltic Sea Chart Datum 2000"}  # fmt: skip
"""Names of vertical datums by VERDAT (IHO S-57, appendix A, chapter 2)."""


@dataclass(frozen=True)
class CellIdentity:
    """Edition and update number of a chart's file.

    Attributes
    ----------
    purpose
        EXPP: 1 for a cell, 2 for an update.
    update
        UPDN: number of the last update that the file holds.
    """

    purpose: int
    edition: str
    update: int


def is_chart(file: str | Path, policy: ReadPolicy = DEFAULT_READ) -> bool:
    """Return whether a file is a chart, an update or a catalogue of charts, by name or content.

    True for folders and archives with cells as well, so that `read_chart` can refuse them.
    """
    path = Path(file)
    if NUMBERED.search(path.name):
        return True
    if path.is_dir():
        return bool(_cells_in(path))
    if not path.is_file():
        return False
    if path.suffix.lower() == ".zip":
        return bool(_cells_in_archive(path))
    head = _head(path, policy)
    return _is_exchange_file(head) and b"DSID" in head


def read_chart(
    file: str | Path, crs: str | None, units: str | None, policy: ReadPolicy = DEFAULT_READ
) -> Map:
    """Return a chart with the updates beside it as a map in degrees.

    Depths and lengths are in metres; the z of soundings is a height, so negative.

    Parameters
    ----------
    crs : str, optional
        Refused, because charts are always in degrees.
    units : str, optional
        Unit of depths that the user states, also of lengths if the chart's unit is unknown.

    Raises
    ------
    InputError
        The file is no cell or cannot be read, or its unit is unknown.
    """
    _refuse_containers(Path(file), policy)
    check_file(file)
    cell = _identity(file, policy)
    if crs is not None:
        raise InputError(f"--crs: {file} is always in degrees; leave the option out")
    updates, notes = _updates(Path(file), cell, policy)
    with tempfile.TemporaryDirectory() as folder, gdal_options(GDAL_OPTIONS):
        plain = Path(folder) / f"cell{CELL}"
        shutil.copyfile(file, plain)
        for number, update in enumerate(updates, 1):  # GDAL applies them from 001 on
            shutil.copyfile(update, plain.with_suffix(f".{number:03d}"))
        found = read_plain(file, plain, None, policy)
        (head,) = read_rows(file, plain, "DSID", notes) or [{}]
    _check_coordinates(file, head)
    depth, length = _units(file, head, found, units)
    edition = f"edition {cell.edition}" if cell.edition else "a chart without an edition"
    last = cell.update + len(updates)
    notes.insert(
        0,
        f"{edition}, {f'update {last}' if last else 'no updates'}; depths in {depth} "
        f"below {_datum(_code(head.get('DSPM_SDAT')))}, lengths in {length}"
        + (" (depths: as --units says)" if units is not None else ""),
    )
    notes += _other_datums(found, head)
    if _code(head.get("DSPM_HDAT")) not in (WGS_84, None):
        notes.append(
            f"horizontal datum {head['DSPM_HDAT']} of S-57 is taken as WGS 84; places may be off "
            "by some hundred metres from those of a satellite receiver"
        )
    features = tuple(_in_metres(feature, UNITS[depth], UNITS[length]) for feature in found.features)
    return replace(found, features=features, notes=(*notes, *found.notes), is_chart=True)


def _in_metres(feature: Feature, depth: float, length: float) -> Feature:
    """Return a feature with depths and lengths in metres; z of soundings becomes a height."""
    import shapely

    properties: dict[str, Any] = dict(feature.properties)
    for name, value in feature.properties.items():
        metres = depth if name.upper() in DEPTHS else length if name.upper() in LENGTHS else None
        if metres is None or metres == 1.0:
            continue
        try:
            properties[name] = float(value) * metres
        except (TypeError, ValueError):
            continue  # the chart does not give it
    shape = feature.shape
    if feature.layer.upper() == SOUNDINGS and shape.has_z:
        shape = shapely.transform(shape, lambda c: c * (1.0, 1.0, -depth), include_z=True)
    return replace(feature, properties=properties, shape=shape)


# Checks before the file is read


def _refuse_containers(path: Path, policy: ReadPolicy) -> None:
    """Refuse folders, archives and catalogues of charts, and name the cells in them."""
    catalogue = False
    if path.is_dir():
        cells, description = _cells_in(path), "a folder of charts"
    elif path.suffix.lower() == ".zip":
        cells, description = _cells_in_archive(path), "an archive of charts; unpack it"
    else:
        head = _head(path, policy) if path.is_file() else b""
        catalogue = b"CATD" in head and b"DSID" not in head
        cells, description = _cells_in(path.parent), "the catalogue of an exchange set"
        if not catalogue:
            return
    examples = ", ".join(cells[:MAX_NAMED]) + (", …" if len(cells) > MAX_NAMED else "")
    raise InputError(
        f"{path}: is {description}; expected one chart (….000)"
        + (f", such as {examples}" if examples else "")
    )


def _cells_in(folder: Path) -> list[str]:
    """Return the cells in a folder and two levels below it, the depth of an exchange set."""
    patterns = (f"*{CELL}", f"*/*{CELL}", f"*/*/*{CELL}")
    found = [path for pattern in patterns for path in sorted(folder.glob(pattern))]
    return [path.relative_to(folder).as_posix() for path in found]


def _cells_in_archive(path: Path) -> list[str]:
    try:
        with zipfile.ZipFile(path) as archive:
            return [name for name in archive.namelist() if name.endswith(CELL)]
    except (OSError, zipfile.BadZipFile):
        return []


def _head(path: str | Path, policy: ReadPolicy) -> bytes:
    try:
        with open(path, "rb") as stream:
            return stream.read(policy.identity_bytes)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None


def _is_exchange_file(head: bytes) -> bool:
    """Return whether bytes begin a file of ISO/IEC 8211."""
    return head[:5].isdigit() and head[5:7] in (b"1L", b"2L", b"3L")


def _identity(file: str | Path, policy: ReadPolicy) -> CellIdentity:
    """Return the identity of a chart file from its first record (field DSID).

    Raises
    ------
    InputError
        The file is no cell of S-57.
    """
    head = _head(file, policy)
    if b"INT.IHO.S-1" in head:
        raise InputError(f"{file}: is a chart of S-101; expected one of S-57")
    found = _first_field(head, b"DSID") if _is_exchange_file(head) else None
    texts = found[7:].split(b"\x1f") if found is not None else []
    if found is None or len(texts) < 3:
        raise InputError(f"{file}: cannot be read as a map: not a chart of S-57")
    edition, update = (text.decode("latin-1").strip() for text in texts[1:3])
    identity = CellIdentity(found[5], edition, int(update) if update.isdecimal() else 0)
    if identity.purpose == UPDATE:
        cell = Path(file).with_suffix(CELL).name
        raise InputError(
            f"{file}: is an update of a chart; expected the chart itself ({cell}), to which the "
            "updates beside it are applied"
        )
    return identity


def _first_field(head: bytes, tag: bytes) -> bytes | None:
    """Return a field of the first record after the description; None if it is missing."""
    try:
        start = int(head[:5])
        leader = head[start : start + LEADER_BYTES]
        base = int(leader[12:17])
        sizes = [int(leader[k : k + 1]) for k in (23, 20, 21)]  # of tag, length and position
        directory = head[start + LEADER_BYTES : start + base].rstrip(b"\x1e")
        step = sum(sizes)
        for k in range(0, len(directory) - step + 1, step):
            entry = directory[k : k + step]
            if entry[: sizes[0]] == tag:
                length = int(entry[sizes[0] : sizes[0] + sizes[1]])
                place = start + base + int(entry[sizes[0] + sizes[1] :])
                return head[place : place + length]
    except ValueError:
        return None
    return None


def _updates(file: Path, cell: CellIdentity, policy: ReadPolicy) -> tuple[list[Path], list[str]]:
    """Return the updates beside a cell that follow it without a gap, and notes on the others."""
    beside: dict[int, Path] = {}
    for path in sorted(file.parent.iterdir()):
        extension = NUMBERED.search(path.name)
        if extension and path.stem == file.stem and int(extension[1]) > 0 and path.is_file():
            beside[int(extension[1])] = path
    applied: list[Path] = []
    others: dict[str, list[str]] = {}
    expected = cell.update + 1
    for number, path in sorted(beside.items()):
        edition = _update_edition(path, policy)
        if number <= cell.update:
            continue  # a reissued cell already contains this update
        if edition is None:
            reason = "not an update of S-57"
        elif edition != cell.edition:
            reason = f"of edition {edition}, and the chart is of edition {cell.edition}"
        elif number != expected:
            reason = f"update {expected} is missing"
        else:
            applied.append(path)
            expected += 1
            continue
        others.setdefault(reason, []).append(path.name)
    notes = [
        f"{counted(len(names), 'update')} beside the chart not applied: {reason} "
        f"({', '.join(names[:MAX_NAMED])}{', …' if len(names) > MAX_NAMED else ''})"
        for reason, names in others.items()
    ]
    return applied, notes


def _update_edition(path: Path, policy: ReadPolicy) -> str | None:
    """Return the edition of an update's file; None if the file is no update."""
    head = _head(path, policy)
    found = _first_field(head, b"DSID") if _is_exchange_file(head) else None
    texts = found[7:].split(b"\x1f") if found is not None else []
    if found is None or len(texts) < 3 or found[5] != UPDATE:
        return None
    return texts[1].decode("latin-1").strip()


# Units and datums


def _check_coordinates(file: str | Path, head: Mapping[str, Any]) -> None:
    unit = _code(head.get("DSPM_COUN"))
    if unit not in (LATITUDE_LONGITUDE, None):
        raise InputError(
            f"{file}: coordinates are not latitude and longitude (COUN {unit}); expected a chart "
            "in degrees"
        )


def _units(
    file: str | Path, head: Mapping[str, Any], found: Map, stated: str | None
) -> tuple[str, str]:
    """Return the units of depths and of lengths; refuse units that are unknown."""
    unknown: list[str] = []

    def known(table: Mapping[int, str], ours: str, theirs: str, quantity: str) -> str:
        codes = {head.get(ours)} | {
            feature.get(theirs) for feature in found.features if feature.layer.upper() == "M_UNIT"
        } - {None}
        names = {table.get(_code(code) or 0) for code in codes}
        if len(names) == 1 and (name := names.pop()) is not None:
            return name
        if stated is not None:
            return stated
        listed = ", ".join(sorted(str(code) for code in codes))
        expected = ", ".join(f"{code} ({name})" for code, name in table.items())
        unknown.append(
            f"unit of {quantity} {listed} ({ours[5:]}); expected one of {expected} for all"
        )
        return "m"

    depth = stated or known(DEPTH_UNITS, "DSPM_DUNI", "dunits", "depths")
    length = known(HEIGHT_UNITS, "DSPM_HUNI", "hunits", "lengths")
    if unknown:
        plain = [f"{file}: {text}" for text in unknown]
        option = "; give the right one with --units"
        raise UnansweredError([text + option for text in plain], plain)
    return depth, length


def _code(value: Any) -> int | None:
    """Return the number of a code of S-57; None without a code."""
    try:
        return int(float(value)) or None
    except (TypeError, ValueError, OverflowError):
        return None


def _datum(code: int | None) -> str:
    if code is None:
        return "a datum that the chart does not name"
    return DATUMS.get(code, f"the datum of number {code} in S-57")


def _other_datums(found: Map, head: Mapping[str, Any]) -> list[str]:
    """Return notes on depths below another datum than the chart's."""
    groups: dict[str, list[str]] = {}
    for feature in found.features:
        layer, code = feature.layer.upper(), _code(feature.get("verdat"))
        has_depth = feature.get(*map(str.lower, DEPTHS)) is not None
        is_depth = has_depth or layer in ("M_SDAT", SOUNDINGS)
        if is_depth and code is not None and code != _code(head.get("DSPM_SDAT")):
            groups.setdefault(_datum(code), []).append(feature.where)
    return [
        f"{counted(len(places), 'feature')} with depths below {datum} instead, taken as they are "
        f"({', '.join(places[:MAX_NAMED])}{', …' if len(places) > MAX_NAMED else ''})"
        for datum, places in groups.items()
    ]

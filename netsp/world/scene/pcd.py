"""Clouds of the Point Cloud Library (PCD): text, binary, and binary packed with LZF."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError, counted
from netsp.base.files import FilePolicy, read_bytes
from netsp.base.validated import shown
from netsp.world.scene.point_clouds import PointCloud, cloud_of_fields, coordinate_fields

_TYPES = {("F", 4): "<f4", ("F", 8): "<f8"} | {
    (kind, size): f"<{kind.lower()}{size}" for kind in ("I", "U") for size in (1, 2, 4, 8)
}

PADDING = "_"
"""Name of fields that hold nothing. Packed data do not contain them."""


@dataclass(frozen=True)
class _Head:
    """Header of a PCD file.

    The fields are names, types and counts of its fields, the number of points, the form of its
    data, the place of their first byte, and the seven numbers of its viewpoint.
    """

    names: tuple[str, ...]
    types: tuple[np.dtype[np.void], ...]
    counts: tuple[int, ...]
    points: int
    form: str
    at: int
    view: tuple[float, ...]


def read_pcd(
    path: str | Path,
    *,
    max_head_bytes: int = 100_000,
    max_unpacked_bytes: int = 4 * FilePolicy.max_bytes,
) -> PointCloud:
    """Read a cloud of the Point Cloud Library.

    Parameters
    ----------
    path : str or Path
        PCD 0.5 to 0.7 with fields x, y and z (or depth) in any order. Points that are not finite
        mark beams without an echo; they are left out. VIEWPOINT says where the sensor stood, and
        points keep their coordinates, as the library reads them.
    max_head_bytes : int
        Maximum size of the header.
    max_unpacked_bytes : int
        Maximum size of packed data when they are unpacked.

    Raises
    ------
    InputError
        The header is damaged, a field is missing, or data are missing or damaged.
    """
    data = read_bytes(path)
    head = _head(data, path, max_head_bytes)
    single = [k for k, count in enumerate(head.counts) if count == 1]
    names = [head.names[k] for k in single]
    if head.form == "ascii":
        values = _from_text(data[head.at :], head, single, path)
    elif head.form == "binary":
        values = _from_records(data, head, single, path)
    elif head.form == "binary_compressed":
        values = _from_columns(data[head.at :], head, single, path, max_unpacked_bytes)
    else:
        raise InputError(
            f"{path}: DATA: expected ascii, binary or binary_compressed, got {shown(head.form)}"
        )
    cloud = cloud_of_fields(names, values, str(path), where="FIELDS")
    if head.view in ((), (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)):
        return cloud
    place = ", ".join(f"{v:g}" for v in head.view[:3])
    note = (
        f"VIEWPOINT: the sensor stood at ({place}), which is ignored: points keep the coordinates "
        "of the file; to move the cloud, set its origin and rotate in the scene"
    )
    return replace(cloud, notes=(*cloud.notes, note))


def _head(data: bytes, path: str | Path, max_head_bytes: int) -> _Head:
    lines: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in lines:
        end = data.find(b"\n", at)
        if end < 0 or end > max_head_bytes:
            raise InputError(f"{path}: expected a PCD file with a line DATA")
        words = data[at:end].decode("ascii", "replace").split("#")[0].split()
        if words:
            lines[words[0].upper()] = words[1:]
        at = end + 1
    names = tuple(f.lower() for f in lines.get("FIELDS", lines.get("COLUMNS", [])))
    coordinate_fields(names, str(path), "FIELDS")
    try:
        sizes = [int(v) for v in lines.get("SIZE", ["4"] * len(names))]
        kinds = lines.get("TYPE", ["F"] * len(names))
        counts = tuple(int(v) for v in lines.get("COUNT", ["1"] * len(names)))
        size = int(lines["WIDTH"][0]) * int(lines.get("HEIGHT", ["1"])[0])
        points = int(lines.get("POINTS", [str(size)])[0])
        form = lines["DATA"][0].lower()
        types = tuple(
            np.dtype(_TYPES[kind.upper(), width])
            for kind, width, _ in zip(kinds, sizes, names, strict=True)
        )
        if len(counts) != len(names) or min(counts, default=1) < 1:
            raise ValueError
        view = tuple(float(v) for v in lines.get("VIEWPOINT", []))
    except (KeyError, IndexError, ValueError):
        raise InputError(f"{path}: expected the head of a PCD file (SIZE, TYPE, WIDTH)") from None
    if points != size or points < 0:
        raise InputError(f"{path}: POINTS: expected WIDTH times HEIGHT, {size}, got {points}")
    if view and (len(view) != 7 or not np.isfinite(view).all()):
        raise InputError(f"{path}: VIEWPOINT: expected seven numbers, got {len(view)}")
    return _Head(names, types, counts, points, form, at, view)


def _from_text(data: bytes, head: _Head, single: list[int], path: str | Path) -> Floats:
    """Return the values of the fields that have one value a point, shape (n, k)."""
    places = np.cumsum([0, *head.counts])
    width = int(places[-1])
    rows: list[list[float]] = []
    for number, line in enumerate(data.decode("ascii", "replace").splitlines(), 1):
        cells = line.split()
        if not cells:
            continue
        if len(cells) != width:
            raise InputError(
                f"{path}: point {len(rows) + 1}: expected {width} numbers, got {len(cells)}"
            )
        try:
            rows.append([float(cells[places[k]]) for k in single])
        except ValueError:
            raise InputError(
                f"{path}: line {number} of the data: expected numbers, got {shown(line.strip())}"
            ) from None
    if len(rows) != head.points:
        raise InputError(f"{path}: expected {counted(head.points, 'point')}, got {len(rows)}")
    return np.array(rows, dtype=float).reshape(len(rows), len(single))


def _from_records(data: bytes, head: _Head, single: list[int], path: str | Path) -> Floats:
    fields = enumerate(zip(head.types, head.counts, strict=True))
    kind = np.dtype([(f"{k}", known, (count,)) for k, (known, count) in fields])
    if len(data) - head.at < head.points * kind.itemsize:
        raise InputError(f"{path}: cut short; expected {counted(head.points, 'point')}")
    records = np.frombuffer(data, kind, head.points, head.at)
    values = np.empty((head.points, len(single)))
    for column, k in enumerate(single):
        values[:, column] = records[f"{k}"][:, 0]
    return values


def _from_columns(
    data: bytes, head: _Head, single: list[int], path: str | Path, max_unpacked_bytes: int
) -> Floats:
    if len(data) < 8:
        raise InputError(f"{path}: cut short; expected the sizes of packed data")
    packed, unpacked = struct.unpack_from("<II", data)
    if len(data) - 8 < packed:
        raise InputError(
            f"{path}: cut short; expected {packed} bytes of packed data, got {len(data) - 8}"
        )
    widths = [t.itemsize * c for t, c in zip(head.types, head.counts, strict=True)]
    stored = [0 if name == PADDING else w for name, w in zip(head.names, widths, strict=True)]
    if unpacked != head.points * sum(stored):
        stored = widths  # some writers keep padding
    if unpacked != head.points * sum(stored):
        raise InputError(
            f"{path}: expected {head.points * sum(stored)} bytes of unpacked data for "
            f"{counted(head.points, 'point')}, the file states {unpacked}"
        )
    if unpacked > max_unpacked_bytes:
        raise InputError(f"{path}: unpacks to more than {max_unpacked_bytes / 2**20:g} MiB")
    try:
        plain = unpack_lzf(data[8 : 8 + packed], unpacked)
    except ValueError as error:
        raise InputError(f"{path}: damaged packed data: {error}") from None
    starts = np.cumsum([0, *stored]) * head.points
    values = np.zeros((head.points, len(single)))
    for column, k in enumerate(single):
        if stored[k]:
            values[:, column] = np.frombuffer(plain, head.types[k], head.points, int(starts[k]))
    return values


def unpack_lzf(packed: bytes, size: int) -> bytes:
    """Unpack data in Marc Lehmann's LZF format to `size` bytes.

    A control byte n below 32 is followed by n + 1 literal bytes. Any other begins a reference: its
    upper three bits are the length less two (seven: the next byte is added), its lower five bits
    and the following byte are the distance back less one.

    Raises
    ------
    ValueError
        The data are cut short, refer to what is before their beginning, or have another size.

    Examples
    --------
    >>> unpack_lzf(bytes([1, 97, 98, 0x40, 1]), 6)
    b'ababab'
    """
    out = bytearray()
    at, end = 0, len(packed)
    while at < end:
        control = packed[at]
        at += 1
        if control < 32:
            if at + control >= end:
                raise ValueError("a run of bytes is cut short")
            out += packed[at : at + control + 1]
            at += control + 1
        else:
            length = control >> 5
            if at + (length == 7) >= end:
                raise ValueError("a reference is cut short")
            if length == 7:
                length += packed[at]
                at += 1
            distance = ((control & 31) << 8) + packed[at] + 1
            at += 1
            length += 2
            start = len(out) - distance
            if start < 0:
                raise ValueError("a reference leads to before the beginning")
            if distance >= length:
                out += out[start : start + length]
            else:  # the copy overlaps what it writes: the bytes repeat
                out += (bytes(out[start:]) * (length // distance + 1))[:length]
        if len(out) > size:
            break
    if len(out) != size:
        raise ValueError(f"expected {size} bytes, got {'more' if len(out) > size else len(out)}")
    return bytes(out)

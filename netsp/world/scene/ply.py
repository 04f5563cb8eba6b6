"""Polygon files (PLY): vertices with named properties, and faces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.errors import InputError, counted
from netsp.base.files import read_bytes
from netsp.base.validated import shown

Corners = npt.NDArray[np.int64]

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip

_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}

_CORNERS = ("vertex_indices", "vertex_index")
"""Names of the property of a face that lists its corners."""


@dataclass(frozen=True)
class PlyFile:
    """Contents of a polygon file.

    Parameters
    ----------
    names : tuple of str
        Properties of a vertex that are no lists.
    values : ndarray, shape (n, k)
        Values of these properties.
    faces : list of ndarray
        Corners of each face, as indices of vertices.
    others : mapping of str to int
        Numbers of further elements, such as edges.
    """

    names: tuple[str, ...]
    values: Floats
    faces: list[Corners]
    others: dict[str, int]

    def triangles(self) -> tuple[npt.NDArray[np.int64], int]:
        """Return the faces as triangles (m, 3), and the number of faces with fewer corners.

        Faces of more than three corners are cut from their first corner.
        """
        whole = [f for f in self.faces if len(f) >= 3]
        fans = [np.column_stack([np.full(len(f) - 2, f[0]), f[1:-1], f[2:]]) for f in whole]
        out = np.vstack(fans) if fans else np.empty((0, 3), dtype=np.int64)
        return out.astype(np.int64), len(self.faces) - len(whole)


@dataclass(frozen=True)
class _Element:
    """Element of the header: name, count, and properties as (name, type, type of the length);
    the last is empty unless the property is a list."""

    name: str
    count: int
    properties: list[tuple[str, str, str]]


def read_ply(path: str | Path, *, max_head_bytes: int = 100_000) -> PlyFile:
    """Read a polygon file, PLY 1.0 with vertices, as text or binary.

    Raises
    ------
    InputError
        The header is damaged, data are missing, or a face refers to a missing vertex.
    """
    data = read_bytes(path)
    elements, order, at = _head(data, path, max_head_bytes)
    reader = _Text(data[at:], path) if not order else _Binary(data, order, at, path)
    names: tuple[str, ...] = ()
    values = np.empty((0, 0))
    faces: list[Corners] = []
    others: dict[str, int] = {}
    for element in elements:
        scalars, lists = reader.rows(element)
        if element.name == "vertex":
            names, values = tuple(p[0] for p in element.properties if not p[2]), scalars
        elif element.name == "face":
            corners = next((lists[name] for name in _CORNERS if name in lists), None)
            if corners is None and element.count:
                raise InputError(f"{path}: face: expected the property vertex_indices")
            faces = corners or []
        elif element.count:
            others[element.name] = others.get(element.name, 0) + element.count
    used = np.concatenate(faces) if faces else np.empty(0, dtype=np.int64)
    if len(used) and not 0 <= used.min() <= used.max() < len(values):
        raise InputError(
            f"{path}: a face has a corner that is none of the {counted(len(values), 'vertex')}"
        )
    return PlyFile(names, values, faces, others)


def _head(data: bytes, path: str | Path, max_head_bytes: int) -> tuple[list[_Element], str, int]:
    """Return the elements, the order of bytes (empty for text), and the place of the data."""
    mark = data.find(b"end_header", 0, max_head_bytes)
    end = data.find(b"\n", mark)
    if not data.startswith(b"ply") or mark < 0 or end < 0:
        raise InputError(f"{path}: expected a PLY file with a line end_header")
    elements: list[_Element] = []
    order = None
    for line in data[:mark].decode("latin-1").splitlines()[1:]:
        words = line.split()
        try:
            if not words or words[0] in ("comment", "obj_info"):
                continue
            if words[0] == "format":
                order = _ORDERS[words[1]]
            elif words[0] == "element":
                elements.append(_Element(words[1], int(words[2]), []))
                if elements[-1].count < 0:
                    raise ValueError
            elif words[0] == "property" and words[1] == "list":
                form = (words[4], _TYPES[words[3]], _TYPES[words[2]])
                elements[-1].properties.append(form)
            elif words[0] == "property":
                elements[-1].properties.append((words[2], _TYPES[words[1]], ""))
            else:
                raise ValueError
        except (IndexError, KeyError, ValueError):
            raise InputError(f"{path}: the head of a PLY file: got {shown(line)}") from None
    if order is None:
        raise InputError(f"{path}: format: expected ascii or binary_little_endian")
    return elements, order, end + 1


Rows = tuple[Floats, dict[str, list[Corners]]]


class _Text:
    """Reader of data as text: one element a line."""

    def __init__(self, data: bytes, path: str | Path) -> None:
        self.path = path
        self.lines: Iterator[str] = iter(
            [line for line in data.decode("latin-1").splitlines() if line.strip()]
        )

    def rows(self, element: _Element) -> Rows:
        """Return the values of the properties that are no lists, and the lists."""
        scalars: list[list[float]] = []
        lists: dict[str, list[Corners]] = {p[0]: [] for p in element.properties if p[2]}
        for k in range(element.count):
            cells = next(self.lines, "").split()
            place, row = 0, []
            try:
                for name, _, length in element.properties:
                    many = int(cells[place]) if length else 1
                    place += bool(length)
                    if many < 0 or place + many > len(cells):
                        raise ValueError
                    if length:
                        lists[name].append(
                            np.array([float(c) for c in cells[place : place + many]]).astype(
                                np.int64
                            )
                        )
                    else:
                        row.append(float(cells[place]))
                    place += many
            except (ValueError, IndexError):
                raise InputError(
                    f"{self.path}: {element.name} {k} of {element.count}: expected "
                    f"{len(element.properties)} properties, got "
                    f"{shown(' '.join(cells)) if cells else 'nothing: cut short'}"
                ) from None
            scalars.append(row)
        return np.array(scalars, dtype=float).reshape(element.count, -1), lists


class _Binary:
    """Reader of binary data."""

    def __init__(self, data: bytes, order: str, at: int, path: str | Path) -> None:
        self.data, self.order, self.at, self.path = data, order, at, path

    def rows(self, element: _Element) -> Rows:
        """Return the values of the properties that are no lists, and the lists."""
        lengths = self._equal_lengths(element)
        if lengths is not None:
            return self._records(element, lengths)
        scalars: list[list[float]] = []
        lists: dict[str, list[Corners]] = {p[0]: [] for p in element.properties if p[2]}
        for _ in range(element.count):
            row = []
            for name, kind, length in element.properties:
                many = int(self._read(element, length, 1)[0]) if length else 1
                values = self._read(element, kind, many)
                if length:
                    lists[name].append(values.astype(np.int64))
                else:
                    row.append(float(values[0]))
            scalars.append(row)
        return np.array(scalars, dtype=float).reshape(element.count, -1), lists

    def _read(self, element: _Element, kind: str, many: int) -> npt.NDArray[np.generic]:
        known = np.dtype(self.order + kind)
        if many < 0 or len(self.data) - self.at < many * known.itemsize:
            raise self._cut_short(element)
        values = np.frombuffer(self.data, known, many, self.at)
        self.at += many * known.itemsize
        return values

    def _cut_short(self, element: _Element) -> InputError:
        return InputError(f"{self.path}: cut short; expected {element.count} of {element.name}")

    def _equal_lengths(self, element: _Element) -> list[int] | None:
        """Return the length of each property where all records have those of the first; None where
        they differ."""
        at, out = self.at, []
        if element.count == 0:
            return [1 for _ in element.properties]
        for _, _, length in element.properties:
            out.append(int(self._read(element, length, 1)[0]) if length else 1)
            self._read(element, element.properties[len(out) - 1][1], out[-1])
        self.at = at
        kind = self._kind(element, out)
        if len(self.data) - at < element.count * kind.itemsize:
            return None
        records = np.frombuffer(self.data, kind, element.count, at)
        numbered = enumerate(zip(out, element.properties, strict=True))
        same = all((records[f"n{k}"] == many).all() for k, (many, p) in numbered if p[2])
        return out if same else None

    def _kind(self, element: _Element, lengths: list[int]) -> np.dtype[np.void]:
        fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
        for k, ((_, kind, length), many) in enumerate(
            zip(element.properties, lengths, strict=True)
        ):
            if length:
                fields.append((f"n{k}", self.order + length))
            fields.append((f"v{k}", self.order + kind, (many,)))
        return np.dtype(fields)

    def _records(self, element: _Element, lengths: list[int]) -> Rows:
        kind = self._kind(element, lengths)
        if len(self.data) - self.at < element.count * kind.itemsize:
            raise self._cut_short(element)
        records = np.frombuffer(self.data, kind, element.count, self.at)
        self.at += element.count * kind.itemsize
        columns = [records[f"v{k}"][:, 0] for k, p in enumerate(element.properties) if not p[2]]
        values = np.column_stack(columns) if columns else np.empty((element.count, 0))
        lists = {
            p[0]: list(records[f"v{k}"].astype(np.int64))
            for k, p in enumerate(element.properties)
            if p[2]
        }
        return values.astype(float), lists

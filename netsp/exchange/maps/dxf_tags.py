"""Group codes of DXF drawings, text or binary, by sections and records (Autodesk's reference)."""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from netsp.base.errors import InputError
from netsp.base.field_types import LARGEST
from netsp.base.validated import shown

Tag = tuple[int, str]
"""Group code and value; text is Latin-1, one character for each byte of the file."""

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?")
"""Number as drawings write it; GDAL reads other text as 0, or up to the first odd character."""

NUMERIC_CODES = frozenset({*range(10, 60), *range(60, 80), *range(90, 100), *range(210, 240)})
"""Group codes of places, lengths, angles, flags and counts."""

REQUIRED_CODES = {
    "POINT": (10, 20), "LINE": (10, 20, 11, 21), "CIRCLE": (10, 20, 40),
    "ARC": (10, 20, 40, 50, 51), "ELLIPSE": (10, 20, 11, 21, 40), "INSERT": (10, 20),
    "SOLID": (10, 20, 11, 21, 12, 22), "TRACE": (10, 20, 11, 21, 12, 22),
    "3DFACE": (10, 20, 11, 21, 12, 22), "SPLINE": (71,), "VERTEX": (10, 20),
}  # fmt: skip
"""Group codes without a default, by the type of entity (Autodesk's reference)."""

POLYFACE_FACE = 128
"""Code: flag (70) of a vertex that lists corners of a face and has no place."""

BINARY = b"AutoCAD Binary DXF\r\n\x1a\x00"
"""First bytes of a binary drawing."""

BINARY_TYPES = (
    (range(10, 60), "d"), (range(110, 150), "d"), (range(210, 240), "d"), (range(460, 470), "d"),
    (range(1010, 1060), "d"), (range(60, 80), "h"), (range(170, 180), "h"), (range(270, 290), "h"),
    (range(370, 390), "h"), (range(400, 410), "h"), (range(1060, 1071), "h"), (range(90, 100), "i"),
    (range(420, 430), "i"), (range(440, 460), "i"), (range(1071, 1072), "i"),
    (range(160, 170), "q"), (range(290, 300), "b"),
)  # fmt: skip
"""Types of the values of a binary drawing by group code; other values are text or bytes."""

BINARY_CHUNKS = (*range(310, 320), 1004)
"""Group codes of bytes that follow their count."""


@dataclass
class Record:
    """Entity or other record, with the records that belong to it.

    Attributes
    ----------
    type
        Type such as ``LINE``.
    tags
        All group codes after the type.
    followers
        Vertices of a polyline, attributes of a block reference, and their end.
    """

    type: str
    tags: list[Tag]
    followers: list[Record] = field(default_factory=list)

    def get(self, code: int, default: str = "") -> str:
        """Return the first value of a group code, without spaces around it."""
        return next((value.strip() for c, value in self.tags if c == code), default)

    def number(self, code: int, default: float = 0.0) -> float:
        """Return the first value of a group code as a number; the default if it is no number."""
        try:
            return float(self.get(code))
        except ValueError:
            return default

    def damage(self) -> str:
        """Return what is wrong with the numbers of the record; empty if nothing is."""
        for code, value in self.tags:
            if code in NUMERIC_CODES:
                text = value.strip()
                if not NUMBER.fullmatch(text) or abs(float(text)) > LARGEST:
                    return f"group code {code}: expected a number, got {shown(text)}"
        size = Counter(code for code, _ in self.tags)
        is_face = self.type == "VERTEX" and int(self.number(70)) & POLYFACE_FACE
        needed = () if is_face else REQUIRED_CODES.get(self.type, ())
        for code in needed:
            if not size[code]:
                return f"group code {code}: missing; expected a number"
        if self.type == "LWPOLYLINE" and (
            size[10] != size[20] or int(self.number(90, size[10])) != size[10] or not size[10]
        ):
            return (
                f"expected {self.get(90, 'some')} corners (group code 90), got {size[10]} x and "
                f"{size[20]} y"
            )
        if self.type == "INSERT" and 0.0 in (self.number(41, 1.0), self.number(42, 1.0)):
            return "its scale is 0 (group code 41 or 42)"
        if self.type == "SPLINE":
            knots = size[10] + int(self.number(71)) + 1
            if not size[10]:
                return "no control points (group code 10); expected a spline with them"
            if size[10] != size[20] or size[40] != knots:
                return (
                    f"expected as many x as y and {knots} knots (group code 40), got {size[10]} x, "
                    f"{size[20]} y and {size[40]} knots"
                )
        return next(filter(None, (follower.damage() for follower in self.followers)), "")

    def all_text(self) -> str:
        """Return the text of TEXT (code 1) or MTEXT (pieces 3, then 1)."""
        return "".join(value for c, value in self.tags if c == 3 and self.type == "MTEXT") + (
            self.get(1)
        )

    def all_tags(self) -> Iterator[Tag]:
        """Yield the group codes of the record and of its followers, as in a file."""
        yield 0, self.type
        yield from self.tags
        for follower in self.followers:
            yield from follower.all_tags()


@dataclass(frozen=True)
class Drawing:
    """Sections of a drawing that describe shapes.

    Attributes
    ----------
    header
        Variables such as ``$INSUNITS`` with their first values.
    tables
        Group codes of the section TABLES.
    layers
        Records of the table of layers.
    blocks
        Records of each block, by its name.
    block_records
        Record BLOCK of each block, by its name.
    entities
        Records of the section ENTITIES.
    """

    header: dict[str, str]
    tables: list[Tag]
    layers: list[Record]
    blocks: dict[str, list[Record]]
    block_records: dict[str, Record]
    entities: list[Record]


def read_drawing(file: str | Path, data: bytes) -> Drawing:
    """Return the sections of a drawing.

    Parameters
    ----------
    file : str or Path
        Name in messages.

    Raises
    ------
    InputError
        The data are not DXF, or have no section ENTITIES.
    """
    if data[:4] == b"AC10" and data[:6].isalnum():
        raise InputError(
            f"{file}: cannot be read as a map: a DWG drawing; expected it saved as DXF"
        )
    tags = _binary_tags(file, data) if data.startswith(BINARY) else _text_tags(file, data)
    sections: dict[str, list[Tag]] = {}
    current: list[Tag] | None = None
    name = ""
    for k, (code, value) in enumerate(tags):
        if code == 0 and value.strip() == "SECTION":
            name = tags[k + 1][1].strip() if k + 1 < len(tags) else ""
            current = sections.setdefault(name, [])
        elif code == 0 and value.strip() in ("ENDSEC", "EOF"):
            current = None
        elif current is not None:
            current.append((code, value))
    if current is not None:
        raise InputError(
            f"{file}: cannot be read as a map: cut short: its section {name} has no end (ENDSEC)"
        )
    if "ENTITIES" not in sections:
        raise InputError(
            f"{file}: cannot be read as a map: not a DXF drawing: expected a section ENTITIES"
        )
    header: dict[str, str] = {}
    for (code, value), (_, after) in zip(
        sections.get("HEADER", []), sections.get("HEADER", [])[1:], strict=False
    ):
        if code == 9:
            header[value.strip()] = after.strip()
    tables = sections.get("TABLES", [])[1:]
    layers = [r for r in _records(tables) if r.type == "LAYER"]
    blocks, block_records = _blocks(_records(sections.get("BLOCKS", [])[1:]))
    entities = _grouped(_records(sections["ENTITIES"][1:]))
    return Drawing(header, tables, layers, blocks, block_records, entities)


def written(tags: Iterator[Tag]) -> str:
    """Return group codes as the text of a drawing, two lines for each."""
    return "".join(f"{code:3d}\n{value}\n" for code, value in tags)


def _text_tags(file: str | Path, data: bytes) -> list[Tag]:
    text = data.removeprefix(b"\xef\xbb\xbf").decode("latin-1")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    while lines and not lines[0].strip():
        lines.pop(0)
    out: list[Tag] = []
    for k in range(0, len(lines) - 1, 2):
        try:
            code = int(lines[k])
        except ValueError:
            if not lines[k].strip() and not any(line.strip() for line in lines[k:]):
                break
            raise InputError(
                f"{file}: cannot be read as a map: line {k + 1}: expected a group code of DXF, got "
                f"{shown(lines[k].strip())}"
            ) from None
        if code != 999:
            out.append((code, lines[k + 1]))
    return out


def _binary_tags(file: str | Path, data: bytes) -> list[Tag]:
    """Return the group codes of a binary drawing, of two bytes (since Release 13) or of one."""
    position = len(BINARY)
    wide = data[position : position + 2] == b"\0\0"
    out: list[Tag] = []
    try:
        while position < len(data):
            if wide:
                (code,) = struct.unpack_from("<h", data, position)
                position += 2
            else:
                code = data[position]
                position += 1
                if code == 255:
                    (code,) = struct.unpack_from("<h", data, position)
                    position += 2
            kind = next((kind for codes, kind in BINARY_TYPES if code in codes), "")
            if code in BINARY_CHUNKS:
                position += 1 + data[position]
                continue
            if kind:
                (value,) = struct.unpack_from(f"<{kind}", data, position)
                position += struct.calcsize(f"<{kind}")
                out.append((code, repr(value)))
                continue
            end = data.index(b"\0", position)
            out.append((code, data[position:end].decode("latin-1")))
            position = end + 1
            if out[-1] == (0, "EOF"):
                break
    except (struct.error, IndexError, ValueError):
        raise InputError(
            f"{file}: cannot be read as a map: a binary DXF that is cut short"
        ) from None
    return out


def _records(tags: list[Tag]) -> list[Record]:
    """Return the records of a section."""
    out: list[Record] = []
    for code, value in tags:
        if code == 0:
            out.append(Record(value.strip(), []))
        elif out:
            out[-1].tags.append((code, value))
    return out


def _grouped(records: list[Record]) -> list[Record]:
    """Move vertices and attributes to the records that they belong to."""
    out: list[Record] = []
    holder: Record | None = None
    for record in records:
        if holder is not None and record.type in ("VERTEX", "ATTRIB", "SEQEND"):
            holder.followers.append(record)
            if record.type == "SEQEND":
                holder = None
            continue
        follows = record.type == "POLYLINE" or (
            record.type == "INSERT" and record.get(66) not in ("", "0")
        )
        holder = record if follows else None
        out.append(record)
    return out


def _blocks(records: list[Record]) -> tuple[dict[str, list[Record]], dict[str, Record]]:
    blocks: dict[str, list[Record]] = {}
    heads: dict[str, Record] = {}
    name = None
    inner: list[Record] = []
    for record in records:
        if record.type == "BLOCK":
            name, inner = record.get(2), []
            heads[name] = record
        elif record.type == "ENDBLK":
            if name is not None:
                blocks[name] = _grouped(inner)
            name = None
        elif name is not None:
            inner.append(record)
    return blocks, heads

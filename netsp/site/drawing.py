"""DXF drawings as maps: GDAL reads the shapes, this module what is no shape of the site.

Annotations, paper space and layers that are off or frozen are left out and named; blocks keep the
layers of what they hold. An entity of which GDAL gives nothing is named by its type.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from netsp.errors import InputError, counted
from netsp.files import check_file, read_bytes
from netsp.site.contract import WORDS, words_in
from netsp.site.dxf_tags import Drawing, Record, Tag, read_drawing, written
from netsp.site.feature import Change, Feature, Map, Unread, change_notes
from netsp.site.vector import (
    LOCAL,
    MOST_FEATURES,
    gdal_options,
    in_degrees,
    parts_of,
    read_layer,
    shape_from_gdal,
)
from netsp.site.wkb_shapes import NotFiniteError, ShapeError, collected

if TYPE_CHECKING:
    import shapely

INSUNITS = {
    1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 10: "yd", 21: "us-ft",
}  # fmt: skip
"""Units of the header's $INSUNITS that a site may have (Autodesk's DXF reference)."""

SHAPES = {
    "POINT", "LINE", "LWPOLYLINE", "POLYLINE", "CIRCLE", "ARC", "ELLIPSE", "SPLINE", "INSERT",
    "SOLID", "TRACE", "3DFACE", "HATCH", "MESH",
}  # fmt: skip
"""Types of entities that are read."""

TEXTS = {"TEXT", "MTEXT", "ATTRIB", "ATTDEF", "RTEXT", "ARCALIGNEDTEXT"}

ANNOTATIONS = TEXTS | {
    "DIMENSION", "ARC_DIMENSION", "LARGE_RADIAL_DIMENSION", "LEADER", "MLEADER", "MULTILEADER",
    "TOLERANCE", "ACAD_TABLE", "VIEWPORT", "WIPEOUT", "IMAGE", "OLEFRAME", "OLE2FRAME", "LIGHT",
    "CAMERA", "SUN", "PDFUNDERLAY", "DWFUNDERLAY", "DGNUNDERLAY", "GEOPOSITIONMARKER", "SEQEND",
    "VERTEX", "SECTIONOBJECT",
}  # fmt: skip
"""Types of entities that write on a drawing, and are no shape of the site."""

ENDLESS = {"XLINE", "RAY"}

PAPER = "*paper_space"
DIMENSION_LAYER = "defpoints"
"""Layer that CAD programs keep for the points of dimensions, which is never printed."""

LABELLED = ("POINT", "CIRCLE", "INSERT")
"""Types of entities that stand for one place, and take the name of a text beside it."""

FLAG_POLYGON_MESH, FLAG_POLYFACE = 16, 64
OPTIONS = {"DXF_MERGE_BLOCK_GEOMETRIES": "FALSE", "DXF_INLINE_BLOCKS": "TRUE"}


@dataclass(frozen=True)
class LabelRule:
    """Rule by which a text is the name of a point, a circle or a block beside it.

    Attributes
    ----------
    max_distance
        Largest distance of the text from the place, in heights of the text; positive.
    """

    max_distance: float = 4.0

    def __post_init__(self) -> None:
        if not 0.0 < self.max_distance < math.inf:
            raise InputError(f"max_distance: expected a positive number, got {self.max_distance!r}")


def read_dxf(
    file: str | Path, crs: str | None = None, units: str | None = None,
    labels: LabelRule | None = None,
) -> Map:  # fmt: skip
    """Return a DXF drawing as a map.

    Parameters
    ----------
    file : str or Path
        The drawing, text or binary.
    crs : str, optional
        Its coordinate system; default: a plane of its own.
    units : str, optional
        Unit that the user says, one of `netsp.axes.UNITS`; default: the header's.
    labels : LabelRule, optional
        Which texts are names.

    Returns
    -------
    Map
        One feature for each entity.

    Raises
    ------
    InputError
        Not a drawing, too large, or its unit is none of a site.
    """
    check_file(file)
    drawing = read_drawing(file, read_bytes(file))
    reader = _Reader(file, drawing, labels or LabelRule())
    unit, note = _unit(file, drawing, units)
    found = reader.map(unit, note)
    return found if crs in (None, LOCAL) else in_degrees(found, str(crs), file)


def _unit(file: str | Path, drawing: Drawing, asked: str | None) -> tuple[str | None, str]:
    """Return the unit that the header states, and what is to be said of it."""
    text = drawing.header.get("$INSUNITS", "0")
    try:
        number = int(float(text))
    except (ValueError, OverflowError):
        number = -1
    unit = INSUNITS.get(number)
    says = f"the drawing's header says {unit}" if unit else "the drawing's header states no unit"
    if asked is not None:
        return unit, f"lengths are in {asked}, as asked for ({says})"
    if unit is not None:
        return unit, f"lengths are in {unit}, as the drawing's header says ($INSUNITS {number})"
    if number == 0:
        return None, f"{says}: lengths are taken as metres; --units says otherwise"
    raise InputError(
        f"{file}: $INSUNITS: expected a unit of {', '.join(INSUNITS.values())}, got {text}; give "
        "the unit with --units"
    )


@dataclass
class _Entity:
    """Entity of the drawing on its way to a feature."""

    record: Record
    where: str
    layer: str
    pieces: list[tuple[str, shapely.Geometry]] = field(default_factory=list)
    failure: str = ""


class _Reader:
    """Reader of one drawing."""

    def __init__(self, file: str | Path, drawing: Drawing, labels: LabelRule) -> None:
        self.file = file
        self.drawing = drawing
        self.labels = labels
        self.encoding = _encoding(drawing.header)
        self.hidden = {
            self.text(r.get(2)).lower(): "off" if r.number(62) < 0 else "frozen"
            for r in drawing.layers
            if r.number(62) < 0 or int(r.number(70)) & 1
        }
        self.blocks = {name.lower(): name for name in drawing.blocks}
        self.layers: dict[str, int] = {}
        self.unread: list[Unread] = []
        self.changes: list[Change] = []
        self.complaints: list[str] = []
        self.notes: list[str] = []
        self.texts: list[tuple[str, str, Record]] = []

    def map(self, unit: str | None, note: str) -> Map:
        """Return the map."""
        kept = [e for e in map(self.entity, self.drawing.entities) if e is not None]
        if sum(self.layers.values()) > MOST_FEATURES:
            raise InputError(
                f"{self.file}: {sum(self.layers.values()):,} entities; expected at most "
                f"{MOST_FEATURES:,}"
            )
        self.shapes(kept)
        features = [f for entity in kept for f in self.features(entity)]
        features = self.without_fillings(features, kept)
        features = self.named(features, kept)
        paper = sum(
            len(records) for name, records in self.drawing.blocks.items()
            if name.lower().startswith(PAPER)
        )  # fmt: skip
        if paper:
            self.notes.append(f"{counted(paper, 'record')} of paper space left out")
        return Map(
            tuple(features), False, self.layers, tuple(self.complaints),
            notes=(note, *self.notes, *change_notes(self.changes)), unread=tuple(self.unread),
            unit=unit,
        )  # fmt: skip

    # What is no shape of the site

    def entity(self, record: Record) -> _Entity | None:
        """Return an entity that is to be read; others go to the features that are left out."""
        layer = self.text(record.get(8, "0")) or "0"
        number = self.layers.get(layer, 0)
        self.layers[layer] = number + 1
        handle = record.get(5)
        where = f"{layer}[{number}]" + (f" (handle {handle})" if handle else "")
        reason = self.reason(record, layer)
        if not reason:
            return _Entity(record, where, layer)
        if record.type in TEXTS and self.visible(record, layer):
            self.texts.append((where, layer, record))
        else:
            self.unread.append(Unread(where, layer, reason))
        return None

    def visible(self, record: Record, layer: str) -> bool:
        """Return whether an entity is shown in the model."""
        is_paper = record.get(67, "0") not in ("", "0")
        return not is_paper and layer.lower() not in self.hidden and record.get(60) != "1"

    def reason(self, record: Record, layer: str) -> str:
        """Return why an entity is no shape of the site; empty for one that is."""
        kind = record.type
        if record.get(67, "0") not in ("", "0"):
            return "in paper space"
        if kind in ANNOTATIONS:
            return f"writing on the drawing ({kind})"
        if layer.lower() in self.hidden:
            return f"its layer is {self.hidden[layer.lower()]}"
        if record.get(60) == "1":
            return "invisible"
        if layer.lower() == DIMENSION_LAYER:
            return "on the layer of dimensions' points"
        if kind in ENDLESS:
            return f"a construction line without end ({kind})"
        if kind not in SHAPES:
            return f"its type is not read ({kind})"
        if kind == "INSERT" and record.get(2).lower() not in self.blocks:
            return f"its block {record.get(2)!r} is not in the drawing"
        return ""

    # Shapes

    def shapes(self, entities: list[_Entity]) -> None:
        """Give entities the shapes that GDAL reads, by handles that are made for that."""
        if not entities:
            return
        by_handle = {f"{k + 0x100000:X}": entity for k, entity in enumerate(entities)}
        with tempfile.TemporaryDirectory() as folder, gdal_options(OPTIONS):
            plain = Path(folder) / "drawing.dxf"
            plain.write_text(written(self.plain(by_handle)), encoding="latin-1", newline="\n")
            layer = read_layer(self.file, plain, "entities", self.notes)
        # blocks of which nothing is read are named with what refers to them
        self.notes = [note for note in self.notes if not NO_BLOCK.match(note)]
        for data, properties in zip(layer.shapes, layer.properties, strict=True):
            entity = by_handle[str(properties["EntityHandle"])]
            if data is None:
                continue  # it has no piece then, and is named below
            try:
                shape, changes = shape_from_gdal(data)
            except NotFiniteError as error:
                self.complaints.append(f"{self.file}: {entity.where}: {error}")
                entity.failure = "complained of"
                continue
            except ShapeError as error:
                entity.failure = str(error)
                continue
            self.changes += [Change(entity.where, entity.layer, text) for text in changes]
            inner = str(properties.get("Layer") or entity.layer)
            parts = [part for _, part in parts_of(shape, entity.where)]
            long = [p for p in parts if p.geom_type == "Point" or p.length > 0.0]
            if len(long) < len(parts):
                entity.failure = f"has no length ({entity.record.type})"
            entity.pieces += [(inner, part) for part in long]

    def plain(self, by_handle: dict[str, _Entity]) -> Iterator[Tag]:
        """Yield the drawing with nothing but what is to be read, each with a handle of its own."""
        version = self.drawing.header.get("$ACADVER", "AC1009")
        page = self.drawing.header.get("$DWGCODEPAGE", "ANSI_1252")
        yield from ((0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, version))
        yield from ((9, "$DWGCODEPAGE"), (3, page), (0, "ENDSEC"))
        if self.drawing.tables:
            yield from ((0, "SECTION"), (2, "TABLES"), *self.drawing.tables, (0, "ENDSEC"))
        yield from ((0, "SECTION"), (2, "BLOCKS"))
        for name, records in self.drawing.blocks.items():
            yield from self.drawing.block_records[name].all_tags()
            for record in records:
                if not self.reason(record, self.text(record.get(8, "0"))):
                    yield from _readable(record).all_tags()
            yield 0, "ENDBLK"
        yield from ((0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES"))
        for handle, entity in by_handle.items():
            record = _readable(entity.record)
            tags = [(5, handle), *(tag for tag in record.tags if tag[0] != 5)]
            followers = [f for f in record.followers if f.type != "ATTRIB"]
            yield from Record(record.type, tags, followers).all_tags()
        yield from ((0, "ENDSEC"), (0, "EOF"))

    def features(self, entity: _Entity) -> list[Feature]:
        """Return the feature of an entity; of a block with several layers one for each."""
        record, layer = entity.record, entity.layer
        if record.type == "INSERT" and entity.pieces:
            for text in self.lost_in(record.get(2)):
                self.changes.append(Change(entity.where, layer, text))
        if not entity.pieces:
            if entity.failure != "complained of":
                reason = entity.failure or f"has no shape that is read ({record.type})"
                if record.type == "INSERT" and not entity.failure:
                    reason = f"its block {self.text(record.get(2))!r} holds no shape that is read"
                self.unread.append(Unread(entity.where, layer, reason))
            return []
        groups: dict[str, list[shapely.Geometry]] = {}
        split = not _has_kind(layer) and any(_has_kind(inner) for inner, _ in entity.pieces)
        for inner, piece in entity.pieces:
            own = layer if inner == "0" else inner
            groups.setdefault(own if split else layer, []).append(piece)
        self.layers[layer] += len(groups) - 1
        out = []
        for inner, pieces in groups.items():
            where = entity.where + (f" {inner}" if len(groups) > 1 else "")
            whole = _without_points(pieces)
            if len(whole) < len(pieces):
                self.changes.append(
                    Change(where, layer, "points in its block, beside other shapes: left out")
                )
            shape = whole[0] if len(whole) == 1 else collected(whole)
            out.append(
                Feature(
                    where, layer, "", self.properties(record), shape,
                    folders=() if inner == layer else (inner,),
                    marker=self.marker(entity) if len(groups) == 1 else None,
                )
            )  # fmt: skip
        return out

    def properties(self, record: Record) -> dict[str, Any]:
        """Return the attributes of a block, and the width of a polyline."""
        out: dict[str, Any] = {
            self.text(f.get(2)): self.text(f.get(1)) for f in record.followers if f.type == "ATTRIB"
        }
        if record.type == "INSERT":
            out["block"] = self.text(record.get(2))
        elif record.type == "LWPOLYLINE" and record.number(43) > 0.0:
            out["width"] = record.number(43)
        elif record.type == "POLYLINE" and record.number(40) == record.number(41) > 0.0:
            out["width"] = record.number(40)
        return out

    def marker(self, entity: _Entity) -> shapely.Point | None:
        """Return the place that a circle or a block stands for."""
        import shapely

        record = entity.record
        if record.type == "CIRCLE":
            ring = shapely.get_coordinates(entity.pieces[0][1], include_z=True)
            x, y = 0.5 * (ring[:, :2].min(0) + ring[:, :2].max(0))
            return shapely.Point(x, y, np.nan_to_num(ring[0, 2]))
        if record.type == "INSERT" and record.number(230, 1.0) > 0.0:
            return shapely.Point(record.number(10), record.number(20), record.number(30))
        return None

    def lost_in(self, block: str) -> list[str]:
        """Return what of a block, and of those in it, is not read, one line for each reason."""
        lost: Counter[str] = Counter()
        stack, seen = [block.lower()], set[str]()
        while stack:
            name = stack.pop()
            if name in seen or name not in self.blocks:
                continue
            seen.add(name)
            for record in self.drawing.blocks[self.blocks[name]]:
                reason = self.reason(record, self.text(record.get(8, "0")))
                if reason and record.type not in ("ATTDEF", "SEQEND"):
                    lost[reason] += 1
                elif record.type == "INSERT":
                    stack.append(record.get(2).lower())
        return [
            f"{counted(n, 'record')} of its block {block!r} left out: {reason}"
            for reason, n in lost.items()
        ]

    # Fillings and names

    def without_fillings(self, features: list[Feature], entities: list[_Entity]) -> list[Feature]:
        """Leave out hatches that fill an outline that is read itself."""
        hatches = {e.where for e in entities if e.record.type == "HATCH"}
        if not hatches:
            return features
        drawn = [_areas(f.shape) for f in features if f.where not in hatches]
        outlines = [area for areas in drawn for area in areas]
        out = []
        for feature in features:
            own = _areas(feature.shape) if feature.where in hatches else []
            if own and all(any(_alike(area, other) for other in outlines) for area in own):
                self.unread.append(
                    Unread(feature.where, feature.layer, "fills an outline that is read (HATCH)")
                )
            else:
                out.append(feature)
        return out

    def named(self, features: list[Feature], entities: list[_Entity]) -> list[Feature]:
        """Give places the texts beside them as names, and leave the texts out."""
        from dataclasses import replace

        import shapely

        kinds = {e.where: e.record.type for e in entities}
        places: dict[str, list[int]] = {}
        for k, feature in enumerate(features):
            if kinds.get(feature.where) in LABELLED and feature.get("name", "label") is None:
                places.setdefault(feature.layer, []).append(k)
        pairs = []
        for t, (_, layer, record) in enumerate(self.texts):
            at = shapely.Point(record.number(10), record.number(20))
            reach = self.labels.max_distance * (record.number(40) or 1.0)
            for k in places.get(layer, []):
                away = at.distance(shapely.force_2d(features[k].marker or features[k].shape))
                if away <= reach:
                    pairs.append((away, t, k))
        names: dict[int, int] = {}
        taken: set[int] = set()
        for _, t, k in sorted(pairs):
            if t not in taken and k not in names:
                taken.add(t)
                names[k] = t
        words = {t: _label(self.text(self.texts[t][2].all_text())) for t in taken}
        count = Counter(words.values())
        out = list(features)
        for k, t in names.items():
            if words[t] and count[words[t]] == 1:
                own = features[k]
                out[k] = replace(own, properties={**own.properties, "name": words[t]})
            else:
                taken.discard(t)
        for t, (where, layer, record) in enumerate(self.texts):
            reason = "the name of what it stands beside" if t in taken else "writing on the drawing"
            self.unread.append(Unread(where, layer, f"{reason} ({record.type})"))
        return out

    def text(self, raw: str) -> str:
        """Return text of the drawing in its own encoding."""
        data = raw.encode("latin-1", "replace")
        try:
            text = data.decode("utf-8")
        except UnicodeDecodeError:
            text = data.decode(self.encoding, "replace")
        return UNICODE.sub(lambda found: chr(int(found[1], 16)), text)


NO_BLOCK = re.compile(r"GDAL: Block .* does not exist")
"""Warning of GDAL of a block without records."""

UNICODE = re.compile(r"\\U\+([0-9A-Fa-f]{4})")
"""A character as drawings escape it."""


def _encoding(header: dict[str, str]) -> str:
    """Return Python's name of the code page of a drawing."""
    import codecs

    page = header.get("$DWGCODEPAGE", "").upper().removeprefix("ANSI_")
    for name in (f"cp{page}", page):
        try:
            return codecs.lookup(name).name
        except LookupError:
            continue
    return "cp1252"


def _label(text: str) -> str:
    """Return a text without its formatting (MTEXT), in one line."""
    plain = re.sub(r"\\[ACFHQTWfp][^;\\]*;", "", text)
    plain = re.sub(r"\\S([^;]*);", r"\1", plain)
    plain = re.sub(r"\\[PN~]", " ", plain)
    plain = re.sub(r"\\[LlOoKk]", "", plain)
    plain = re.sub(r"[{}]", "", plain).replace("%%d", "°").replace("%%u", "").replace("%%o", "")
    return " ".join(plain.split())[:MAX_LABEL]


MAX_LABEL = 60
"""Characters of a text that a name keeps."""


def _has_kind(layer: str) -> bool:
    return any(word in WORDS for word in words_in(layer.lower()))


def _without_points(pieces: list[shapely.Geometry]) -> list[shapely.Geometry]:
    """Return the shapes of a block without the points that mark its centre."""
    rest = [p for p in pieces if p.geom_type != "Point"]
    return rest or pieces


def _areas(shape: shapely.Geometry) -> list[shapely.Polygon]:
    """Return the areas of polygons and closed lines."""
    import shapely

    out = []
    for part in getattr(shape, "geoms", [shape]):
        if part.geom_type == "LineString" and part.is_closed and len(part.coords) > 3:
            out.append(shapely.Polygon(shapely.get_coordinates(part)))
        elif part.geom_type == "Polygon":
            out.append(shapely.force_2d(part))
    return out


def _alike(a: shapely.Polygon, b: shapely.Polygon) -> bool:
    """Return whether two outlines are one, but for the steps along their arcs."""
    if not np.allclose(a.bounds, b.bounds, atol=0.01 * math.sqrt(a.area or 1.0)):
        return False
    if not a.is_valid or not b.is_valid:
        return False
    return bool(a.symmetric_difference(b).area <= 0.01 * a.area)


def _readable(record: Record) -> Record:
    """Return a mesh as the polyface mesh that GDAL reads; others as they are."""
    if record.type == "MESH":
        return _of_mesh(record)
    if record.type == "POLYLINE" and int(record.number(70)) & FLAG_POLYGON_MESH:
        return _of_grid(record)
    return record


def _of_mesh(record: Record) -> Record:
    """Return a MESH, with its corners (10, 20, 30) and faces (90, of 93) before subdivision."""
    corners: list[tuple[float, float, float]] = []
    faces: list[list[int]] = []
    tags = iter(record.tags)
    for code, value in tags:
        if code == 10:
            corners.append((float(value), float(next(tags)[1]), float(next(tags)[1])))
        elif code == 93:
            items = [int(next(tags)[1]) for _ in range(int(value))]
            at = 0
            while at < len(items):
                faces.append(items[at + 1 : at + 1 + items[at]])
                at += 1 + items[at]
            break
    return _polyface(record, corners, faces)


def _of_grid(record: Record) -> Record:
    """Return a polygon mesh of rows and columns (flag 16)."""
    flags = int(record.number(70))
    rows, columns = int(record.number(71)), int(record.number(72))
    corners = [
        (f.number(10), f.number(20), f.number(30))
        for f in record.followers
        if f.type == "VERTEX" and not int(f.number(70)) & 16  # the frame of a smooth surface
    ]
    if flags & 4:  # smoothed: the density of the surface
        rows, columns = int(record.number(73)) or rows, int(record.number(74)) or columns
    faces = []
    for i in range(rows if flags & 1 else rows - 1):
        for j in range(columns if flags & 32 else columns - 1):
            a, b = i * columns + j, i * columns + (j + 1) % columns
            c, d = (i + 1) % rows * columns + (j + 1) % columns, (i + 1) % rows * columns + j
            faces.append([a, b, c, d])
    return _polyface(record, corners, faces)


def _polyface(
    record: Record, corners: list[tuple[float, float, float]], faces: list[list[int]]
) -> Record:
    """Return a polyface mesh; faces of many corners become triangles."""
    shared = [(c, v) for c, v in record.tags if c in (5, 8, 60, 67)]
    layer = (8, record.get(8, "0"))
    head = Record("POLYLINE", [*shared, (66, "1"), (70, str(FLAG_POLYFACE)),
                               (71, str(len(corners))), (72, str(len(faces)))])  # fmt: skip
    for x, y, z in corners:
        head.followers.append(
            Record("VERTEX", [layer, (10, repr(x)), (20, repr(y)), (30, repr(z)), (70, "192")])
        )
    for face in faces:
        fans = [face] if len(face) <= 4 else [[face[0], *face[k : k + 2]]
                                              for k in range(1, len(face) - 1)]  # fmt: skip
        for fan in fans:
            if all(0 <= i < len(corners) for i in fan):
                numbers = [(71 + k, str(i + 1)) for k, i in enumerate(fan)]
                head.followers.append(
                    Record(
                        "VERTEX", [layer, (10, "0"), (20, "0"), (30, "0"), (70, "128"), *numbers]
                    )
                )
    head.followers.append(Record("SEQEND", [layer]))
    return head

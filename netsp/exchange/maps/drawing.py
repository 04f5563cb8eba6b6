"""Reader of DXF drawings: GDAL reads the shapes, this module decides what belongs to the site.

Annotations, paper space and layers that are off or frozen are left out and named; what a block
holds keeps its layers. An entity of which GDAL gives nothing is named by its type.
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

from netsp.base.arrays import Floats
from netsp.base.errors import InputError, UnansweredError, counted
from netsp.base.files import check_file, read_bytes
from netsp.base.geometry.polygons import union
from netsp.base.units import UNITS
from netsp.exchange.maps.contract import WORDS, words_in
from netsp.exchange.maps.dxf_shapes import WITHOUT_WIDTH, shape_damage, simple_entities
from netsp.exchange.maps.dxf_tags import Drawing, Record, Tag, read_drawing, written
from netsp.exchange.maps.feature import Change, Feature, Map, Unread, change_notes
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
from netsp.exchange.maps.vector import (
    LOCAL,
    GdalLayer,
    gdal_options,
    in_degrees,
    parts_of,
    read_layer,
    shape_from_gdal,
)
from netsp.exchange.maps.wkb_shapes import NotFiniteError, ShapeError, collected
from netsp.exchange.maps.word_tables import words

if TYPE_CHECKING:
    import shapely

US_FOOT = UNITS["us-ft"]

INSUNITS = {
    1: ("inches", 0.0254), 2: ("feet", 0.3048), 3: ("miles", 1609.344), 4: ("millimetres", 1e-3),
    5: ("centimetres", 0.01), 6: ("metres", 1.0), 7: ("kilometres", 1e3),
    8: ("microinches", 2.54e-8), 9: ("mils", 2.54e-5), 10: ("yards", 0.9144),
    11: ("angstroms", 1e-10), 12: ("nanometres", 1e-9), 13: ("microns", 1e-6),
    14: ("decimetres", 0.1), 15: ("decametres", 10.0), 16: ("hectometres", 100.0),
    21: ("US survey feet", US_FOOT), 22: ("US survey inches", US_FOOT / 12.0),
    23: ("US survey yards", 3.0 * US_FOOT), 24: ("US survey miles", 5280.0 * US_FOOT),
}  # fmt: skip
"""Units of the header's $INSUNITS: name and metres (Autodesk's DXF reference).

The units of astronomy (17 to 20) are missing, because no site has them.
"""

SHAPES = words(
    "POINT LINE LWPOLYLINE POLYLINE CIRCLE ARC ELLIPSE SPLINE INSERT SOLID TRACE 3DFACE HATCH "
    "MESH MLINE"
)
"""Types of entities that are read."""

TEXTS = {"TEXT", "MTEXT", "ATTRIB", "ATTDEF", "RTEXT", "ARCALIGNEDTEXT"}

WRITING = TEXTS | words(
    "DIMENSION ARC_DIMENSION LARGE_RADIAL_DIMENSION LEADER MLEADER MULTILEADER TOLERANCE "
    "ACAD_TABLE SECTIONOBJECT"
)
"""Types of entities that write on a drawing."""

PICTURES = frozenset(
    ["IMAGE", "WIPEOUT", "OLEFRAME", "OLE2FRAME", "PDFUNDERLAY", "DWFUNDERLAY", "DGNUNDERLAY"]
)
"""Types of entities that show or cover a picture."""

NO_SHAPES = {"VIEWPORT", "LIGHT", "CAMERA", "SUN", "GEOPOSITIONMARKER", "SEQEND", "VERTEX"}
"""Types of entities for display or placement, without a shape of the site."""

SOLIDS = words(
    "3DSOLID REGION BODY SURFACE EXTRUDEDSURFACE LOFTEDSURFACE NURBSURFACE PLANESURFACE "
    "REVOLVEDSURFACE SWEPTSURFACE"
)
"""Types of entities whose shape is in the format of a solid modeller (ACIS)."""

ENDLESS = {"XLINE", "RAY"}

EXTERNAL_BLOCK = 4
"""Code: flag (70) of a block that stands for another drawing."""

PAPER = "*paper_space"
DIMENSION_LAYER = "defpoints"
"""Layer that CAD programs keep for the points of dimensions, which they never print."""

LABELLED = ("POINT", "CIRCLE", "INSERT")
"""Types of entities that stand for one place, and take the name of a text beside it."""


def read_dxf(
    file: str | Path,
    crs: str | None = None,
    units: str | None = None,
    policy: ImportPolicy = DEFAULT_IMPORT,
) -> Map:
    """Return a DXF drawing as a map with one feature for each entity.

    Parameters
    ----------
    file : str or Path
        Drawing, text or binary.
    crs : str, optional
        Coordinate system of the drawing; default: a local plane.
    units : str, optional
        Unit that the user states, one of `netsp.base.units.UNITS`; default: the header's.

    Raises
    ------
    InputError
        The file is no drawing or too large, or its unit is unknown.
    """
    check_file(file)
    drawing = read_drawing(file, read_bytes(file))
    reader = _Reader(file, drawing, policy)
    metres, note = _unit(file, drawing, units)
    found = reader.map(metres, note)
    return found if crs in (None, LOCAL) else in_degrees(found, str(crs), file)


def _unit(file: str | Path, drawing: Drawing, unit: str | None) -> tuple[float | None, str]:
    """Return the metres per unit that the header states, and a note on the unit.

    If the header could state a unit but states none, the user must give it. Releases before 2000
    could not state one: their lengths are taken as metres.
    """
    text = drawing.header.get("$INSUNITS", "")
    try:
        number = int(float(text or "0"))
    except (ValueError, OverflowError):
        number = -1
    name, metres = INSUNITS.get(number, ("", None))
    header_unit = (
        f"the drawing's header says {name}" if name else "the drawing's header states no unit"
    )
    if unit is not None:
        return metres, f"lengths are in {unit}, as asked for ({header_unit})"
    if metres is not None:
        return metres, f"lengths are in {name}, as the drawing's header says ($INSUNITS {number})"
    if not text and "$MEASUREMENT" not in drawing.header:
        return None, f"{header_unit}: lengths are taken as metres; --units says otherwise"
    description = (
        "states no unit" if number == 0 else f"has $INSUNITS {text}, which is no unit of a site"
    )
    plain = f"{file}: the drawing's header {description}"
    raise UnansweredError(
        [f"{plain}; give the unit with --units, as --units mm"], [plain], ["units"]
    )


@dataclass
class _Entity:
    """Entity of the drawing that becomes a feature."""

    record: Record
    where: str
    layer: str
    pieces: list[tuple[str, shapely.Geometry]] = field(default_factory=list)
    failure: str = ""


class _Reader:
    """Reader of one drawing."""

    def __init__(self, file: str | Path, drawing: Drawing, policy: ImportPolicy) -> None:
        self.file = file
        self.drawing = drawing
        self.policy = policy
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
        self.sizes: dict[str, int] = {}
        self.cyclic: dict[str, bool] = {}
        self.widths: dict[str, float] = {}

    def map(self, metres: float | None, note: str) -> Map:
        """Return the map of the drawing."""
        kept = [e for e in map(self.entity, self.drawing.entities) if e is not None]
        if sum(self.layers.values()) > self.policy.read.max_features:
            raise InputError(
                f"{self.file}: {sum(self.layers.values()):,} entities; expected at most "
                f"{self.policy.read.max_features:,}"
            )
        self.shapes(kept)
        features = [f for entity in kept for f in self.features(entity)]
        features = self.without_fillings(features, kept)
        features = self.named(features, kept)
        paper = sum(
            len(records)
            for name, records in self.drawing.blocks.items()
            if name.lower().startswith(PAPER)
        )
        if paper:
            self.notes.append(f"{counted(paper, 'record')} of paper space left out")
        return Map(
            tuple(features),
            False,
            self.layers,
            tuple(self.complaints),
            notes=(note, *self.notes, *change_notes(self.changes)),
            unread=tuple(self.unread),
            metres=metres,
        )

    # Selection of entities

    def entity(self, record: Record) -> _Entity | None:
        """Return an entity that is to be read; others are added to the features left out."""
        layer = self.text(record.get(8, "0")) or "0"
        number = self.layers.get(layer, 0)
        self.layers[layer] = number + 1
        handle = record.get(5)
        where = f"{layer}[{number}]" + (f" (handle {handle})" if handle else "")
        reason = self.reason(record, layer)
        if not reason:
            if why := self.damage(record):
                self.complaints.append(
                    f"{self.file}: {where}: a damaged {record.type}: {why}; repair or delete it, "
                    "or audit the drawing in its program and save it again"
                )
                return None
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
        """Return why an entity is no shape of the site; empty for a shape of the site."""
        kind = record.type
        if record.get(67, "0") not in ("", "0"):
            return "in paper space"
        if kind in WRITING:
            return f"writing on the drawing ({kind})"
        if kind in PICTURES:
            return f"a picture ({kind})"
        if kind in NO_SHAPES:
            return f"no shape of the site ({kind})"
        if layer.lower() in self.hidden:
            return f"its layer is {self.hidden[layer.lower()]}"
        if record.get(60) == "1":
            return "invisible"
        if layer.lower() == DIMENSION_LAYER:
            return "on the layer of dimensions' points"
        if kind in ENDLESS:
            return f"a construction line without end ({kind})"
        if kind in SOLIDS:
            return f"a solid, whose shape is not read ({kind}): draw its outline as a polyline"
        if kind not in SHAPES:
            return f"its type is not read ({kind}): explode it, or draw its outline as a polyline"
        block = record.get(2).lower()
        if kind == "INSERT" and block not in self.blocks:
            return f"its block {self.text(record.get(2))!r} is not in the drawing"
        if kind == "INSERT" and int(self.head(block).number(70)) & EXTERNAL_BLOCK:
            return (
                f"another drawing ({self.text(self.head(block).get(1)) or block}): bind it to this "
                "one, or import it, too"
            )
        return ""

    def head(self, block: str) -> Record:
        """Return the record that begins a block."""
        return self.drawing.block_records[self.blocks[block]]

    def damage(self, record: Record) -> str:
        """Return what is wrong with an entity or the blocks in it; empty if nothing is."""
        reason = record.damage() or shape_damage(record)
        if reason or record.type != "INSERT":
            return reason
        if self.holds_itself(record.get(2)):
            return f"its block {self.text(record.get(2))!r} holds itself"
        for block in self.blocks_in(record.get(2)):
            head = self.head(block)
            inner = (
                r
                for r in self.drawing.blocks[self.blocks[block]]
                if not self.reason(r, self.text(r.get(8, "0")))
            )
            for part in (head, *inner):
                if why := part.damage() or shape_damage(part):
                    handle = f" (handle {part.get(5)})" if part.get(5) else ""
                    return f"its block {self.text(head.get(2))!r}: {part.type}{handle}: {why}"
        return ""

    def holds_itself(self, block: str, above: tuple[str, ...] = ()) -> bool:
        """Return whether a block refers to itself, directly or through others."""
        name = block.lower()
        if name in above or len(above) >= self.policy.read.max_geometry_depth:
            return True
        if name not in self.cyclic:
            self.cyclic[name] = any(
                self.holds_itself(record.get(2), (*above, name))
                for record in self.drawing.blocks[self.blocks[name]]
                if record.type == "INSERT" and record.get(2).lower() in self.blocks
            )
        return self.cyclic[name]

    def size(self, record: Record) -> int:
        """Return the number of shapes of an entity; of a block, the number of its entities."""
        if record.type != "INSERT":
            return len(simple_entities(record)) if record.type == "MLINE" else 1
        name = record.get(2).lower()
        if name not in self.sizes:
            self.sizes[name] = sum(
                self.size(r)
                for r in self.drawing.blocks[self.blocks[name]]
                if not self.reason(r, self.text(r.get(8, "0")))
            )
        columns, rows = _array(record)
        return columns * rows * self.sizes[name]

    def blocks_in(self, block: str) -> Iterator[str]:
        """Yield a block and those in it, each once, in lower case."""
        stack, seen = [block.lower()], set[str]()
        while stack:
            name = stack.pop()
            if name in seen or name not in self.blocks:
                continue
            seen.add(name)
            yield name
            stack += [
                record.get(2).lower()
                for record in self.drawing.blocks[self.blocks[name]]
                if record.type == "INSERT" and not self.reason(record, self.text(record.get(8)))
            ]

    # Shapes

    def shapes(self, entities: list[_Entity]) -> None:
        """Give entities the shapes that GDAL reads, matched by handles made for that."""
        if not entities:
            return
        total = sum(self.size(entity.record) for entity in entities)
        if total > self.policy.read.max_features:
            raise InputError(
                f"{self.file}: {total:,} entities in all its blocks; expected at most "
                f"{self.policy.read.max_features:,}"
            )
        by_handle = {f"{k + 0x100000:X}": entity for k, entity in enumerate(entities)}
        try:
            layer = self.from_gdal(by_handle)
        except InputError as error:
            raise InputError(self.damaged(list(by_handle.items()), error)) from None
        # blocks of which nothing is read are reported with their references
        self.notes = [note for note in self.notes if not NO_LOSS.match(note)]
        handles = [str(properties["EntityHandle"]) for properties in layer.properties]
        found = Counter(handles)
        for handle, entity in by_handle.items():
            expected = self.size(entity.record)
            if found[handle] < expected and entity.record.type == "INSERT":
                self.complaints.append(
                    f"{self.file}: {entity.where}: GDAL reads {found[handle]} of the {expected} "
                    f"entities in its block {self.text(entity.record.get(2))!r}; explode the block"
                )
        for data, handle, properties in zip(layer.shapes, handles, layer.properties, strict=True):
            entity = by_handle[handle]
            if data is None:
                continue  # reported later, because the entity gets no piece
            try:
                shape, changes = shape_from_gdal(data, self.policy.read)
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

    def from_gdal(self, by_handle: dict[str, _Entity]) -> GdalLayer:
        """Return the layer that GDAL reads of some entities."""
        options = {
            "DXF_MERGE_BLOCK_GEOMETRIES": "FALSE",
            "DXF_INLINE_BLOCKS": "TRUE",
            "DXF_FEATURE_LIMIT_PER_BLOCK": str(self.policy.read.max_features),
        }
        with tempfile.TemporaryDirectory() as folder, gdal_options(options):
            plain = Path(folder) / "drawing.dxf"
            plain.write_text(written(self.plain(by_handle)), encoding="latin-1", newline="\n")
            return read_layer(self.file, plain, "entities", self.notes, self.policy.read)

    def damaged(self, entities: list[tuple[str, _Entity]], error: InputError) -> str:
        """Return the message on the entity that makes GDAL fail, found by bisection."""

        def is_read(tested: list[tuple[str, _Entity]]) -> bool:
            try:
                self.from_gdal(dict(tested))
            except InputError:
                return False
            return True

        low, high = (
            0,
            len(entities),
        )  # GDAL reads the first `low` entities, but not the first `high`
        if not is_read([]):
            return str(error)
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if is_read(entities[:middle]) else (low, middle)
        entity = entities[low][1]
        return (
            f"{self.file}: {entity.where}: a damaged {entity.record.type}; repair or delete it, or "
            "audit the drawing in its program and save it again"
        )

    def plain(self, by_handle: dict[str, _Entity]) -> Iterator[Tag]:
        """Yield the drawing with only the entities to be read, each with a handle of its own."""
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
                    for simple in self.simple(record):
                        yield from simple.all_tags()
            yield 0, "ENDBLK"
        yield from ((0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES"))
        for handle, entity in by_handle.items():
            for record in self.simple(entity.record):
                tags = [(5, handle), *(tag for tag in record.tags if tag[0] != 5)]
                followers = [f for f in record.followers if f.type != "ATTRIB"]
                yield from Record(record.type, tags, followers).all_tags()
        yield from ((0, "ENDSEC"), (0, "EOF"))

    def simple(self, record: Record) -> list[Record]:
        """Return an entity as GDAL reads it, with names of blocks spelt like the block itself."""
        if record.type != "INSERT":
            return simple_entities(record)
        name = self.blocks[record.get(2).lower()]
        tags = [(code, name if code == 2 else value) for code, value in record.tags]
        return [Record(record.type, tags, record.followers)]

    def features(self, entity: _Entity) -> list[Feature]:
        """Return the feature of an entity; of a block with several layers, one for each."""

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
            own_layer = layer if inner == "0" else inner
            groups.setdefault(own_layer if split else layer, []).append(piece)
        self.layers[layer] += len(groups) - 1
        widths = set(_widths(record))
        if len(widths) > 1 and max(widths) > 0.0:
            self.changes.append(Change(entity.where, layer, CHANGING_WIDTH))
        elif record.type == "INSERT" and self.width(record) > 0.0:
            self.changes.append(Change(entity.where, layer, WIDTH_OF_BLOCK))
        out = []
        for inner, pieces in groups.items():
            where = entity.where + (f" {inner}" if len(groups) > 1 else "")
            whole = _without_points(pieces)
            if len(whole) < len(pieces):
                self.changes.append(
                    Change(where, layer, "points in its block, beside other shapes: left out")
                )
            if record.type == "MLINE" and all(p.geom_type == "Polygon" for p in whole):
                whole = [union(whole)]
            shape = whole[0] if len(whole) == 1 else collected(whole)
            out.append(
                Feature(
                    where,
                    layer,
                    "",
                    self.properties(record),
                    shape,
                    folders=() if inner == layer else (inner,),
                    marker=self.marker(entity) if len(groups) == 1 else None,
                )
            )
        return out

    def properties(self, record: Record) -> dict[str, Any]:
        """Return the attributes of a block, and the width of a polyline."""
        out: dict[str, Any] = {
            self.text(f.get(2)): self.text(f.get(1)) for f in record.followers if f.type == "ATTRIB"
        }
        if record.type == "INSERT":
            out["block"] = self.text(record.get(2))
        width = self.width(record)
        if width > 0.0:
            out["width"] = width
        return out

    def width(self, record: Record) -> float:
        """Return the largest width of a polyline, or of the polylines in a block; 0 for none."""
        if record.type == "INSERT":
            name = record.get(2).lower()
            if name not in self.widths:
                inner = self.drawing.blocks[self.blocks[name]]
                self.widths[name] = max(
                    (self.width(r) for r in inner if not self.reason(r, self.text(r.get(8, "0")))),
                    default=0.0,
                )
            return self.widths[name] * max(abs(record.number(code, 1.0)) for code in (41, 42))
        return max(_widths(record), default=0.0)

    def marker(self, entity: _Entity) -> shapely.Geometry | None:
        """Return the place that a circle or a block stands for, or the places of an array."""
        import shapely

        record = entity.record
        if record.type == "CIRCLE":
            ring = shapely.get_coordinates(entity.pieces[0][1], include_z=True)
            x, y = 0.5 * (ring[:, :2].min(0) + ring[:, :2].max(0))
            return shapely.Point(x, y, np.nan_to_num(ring[0, 2]))
        if record.type != "INSERT":
            return None
        columns, rows = _array(record)
        turn = math.radians(record.number(50))
        along = np.array([math.cos(turn), math.sin(turn)]) * record.number(44)
        across = np.array([-math.sin(turn), math.cos(turn)]) * record.number(45)
        start = np.array([record.number(10), record.number(20)])
        corners = [start + j * along + i * across for i in range(rows) for j in range(columns)]
        places = _in_world(
            np.column_stack([np.array(corners), np.full(len(corners), record.number(30))]),
            np.array([record.number(210), record.number(220), record.number(230, 1.0)]),
        )
        spots = shapely.points(places)
        return spots[0] if len(spots) == 1 else shapely.MultiPoint(spots)

    def lost_in(self, block: str) -> list[str]:
        """Return one line for each reason why records in a block are not read."""
        lost: Counter[str] = Counter()
        for name in self.blocks_in(block):
            for record in self.drawing.blocks[self.blocks[name]]:
                reason = self.reason(record, self.text(record.get(8, "0")))
                if reason and record.type not in ("ATTDEF", "SEQEND"):
                    lost[reason] += 1
        return [
            f"{counted(n, 'record')} of its block {block!r} left out: {reason}"
            for reason, n in lost.items()
        ]

    # Fillings and names

    def without_fillings(self, features: list[Feature], entities: list[_Entity]) -> list[Feature]:
        """Leave out hatches that fill an outline that is read."""
        hatches = {e.where for e in entities if e.record.type == "HATCH"}
        if not hatches:
            return features
        drawn = [_areas(f.shape) for f in features if f.where not in hatches]
        outlines = [area for areas in drawn for area in areas]
        out = []
        for feature in features:
            areas_filled = _areas(feature.shape) if feature.where in hatches else []
            if areas_filled and all(
                any(_alike(area, other) for other in outlines) for area in areas_filled
            ):
                self.unread.append(
                    Unread(feature.where, feature.layer, "fills an outline that is read (HATCH)")
                )
            else:
                out.append(feature)
        return out

    def named(self, features: list[Feature], entities: list[_Entity]) -> list[Feature]:
        """Name places after the texts beside them, and leave the texts out."""
        from dataclasses import replace

        import shapely

        kinds = {e.where: e.record.type for e in entities}
        places: dict[str, list[int]] = {}
        for k, feature in enumerate(features):
            if kinds.get(feature.where) in LABELLED and feature.get("name", "label") is None:
                places.setdefault(feature.layer, []).append(k)
        pairs = []
        for t, (_, layer, record) in enumerate(self.texts):
            place = shapely.Point(record.number(10), record.number(20))
            reach = self.policy.max_label_distance * (record.number(40) or 1.0)
            for k in places.get(layer, []):
                distance = place.distance(shapely.force_2d(features[k].marker or features[k].shape))
                if distance <= reach:
                    pairs.append((distance, t, k))
        names: dict[int, int] = {}
        used: set[int] = set()
        for _, t, k in sorted(pairs):
            if t not in used and k not in names:
                used.add(t)
                names[k] = t
        labels = {
            t: _label(self.text(self.texts[t][2].all_text()), self.policy.max_label_length)
            for t in used
        }
        count = Counter(labels.values())
        out = list(features)
        for k, t in names.items():
            if labels[t] and count[labels[t]] == 1:
                feature = features[k]
                out[k] = replace(feature, properties={**feature.properties, "name": labels[t]})
            else:
                used.discard(t)
        for t, (where, layer, record) in enumerate(self.texts):
            reason = "the name of what it stands beside" if t in used else "writing on the drawing"
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


def _widths(record: Record) -> list[float]:
    """Return the widths that a polyline states, of all its parts and their ends."""
    if record.type == "LWPOLYLINE":
        parts = [record]
    elif record.type == "POLYLINE" and not int(record.number(70)) & WITHOUT_WIDTH:
        parts = [record, *record.followers]
    else:
        return []
    return [float(v) for part in parts for code, v in part.tags if code in (40, 41, 43)]


def _array(record: Record) -> tuple[int, int]:
    """Return the columns and rows in which an INSERT stands."""
    columns, rows = (max(1, int(record.number(code, 1.0))) for code in (70, 71))
    return columns, rows


def _in_world(places: Floats, normal: Floats) -> Floats:
    """Return places of an entity's coordinate system in the drawing's (arbitrary axis algorithm).

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Places as the entity has them.
    normal : ndarray, shape (3,)
        Direction of extrusion of the entity, not zero.
    """
    up = normal / (float(np.linalg.norm(normal)) or 1.0)
    # Autodesk's bound: nearer to the z axis, y replaces z
    near = max(abs(up[0]), abs(up[1])) < 1.0 / 64.0
    x = np.cross([0.0, 1.0, 0.0] if near else [0.0, 0.0, 1.0], up)
    x /= float(np.linalg.norm(x)) or 1.0
    return np.asarray(places @ np.array([x, np.cross(up, x), up]))


CHANGING_WIDTH = "a width that changes: taken as the largest"
WIDTH_OF_BLOCK = "lines in its block are as wide as the widest polyline there"

NO_LOSS = re.compile(r"GDAL: (Block .* does not exist|Non closed ring detected)")
"""Warnings of GDAL that report no loss: of a block without records, and of each 3DFACE."""

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


def _label(text: str, max_length: int) -> str:
    """Return a text without its formatting (MTEXT), in one line."""
    plain = re.sub(r"\\[ACFHQTWfp][^;\\]*;", "", text)
    plain = re.sub(r"\\S([^;]*);", r"\1", plain)
    plain = re.sub(r"\\[PN~]", " ", plain)
    plain = re.sub(r"\\[LlOoKk]", "", plain)
    plain = re.sub(r"[{}]", "", plain).replace("%%d", "°").replace("%%u", "").replace("%%o", "")
    return " ".join(plain.split())[:max_length]


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
    """Return whether two outlines are equal but for the steps along their arcs."""
    if not np.allclose(a.bounds, b.bounds, atol=0.01 * math.sqrt(a.area or 1.0)):
        return False
    if not a.is_valid or not b.is_valid:
        return False
    return bool(a.symmetric_difference(b).area <= 0.01 * a.area)

"""Reader of KML and KMZ (OGC 12-007r2): folders, links and altitude modes.

The page of an archive is ``doc.kml`` at its root. Pages that it links to, in the archive or beside
a KML file, are read; links to other places are named and never fetched.
"""

from __future__ import annotations

import io
import math
import posixpath
import re
import zipfile
import zlib
from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from netsp.base.errors import InputError
from netsp.base.files import FilePolicy, read_bytes
from netsp.base.validated import shown
from netsp.exchange.maps.feature import Change, Feature, Map, Unread, change_notes, with_tags
from netsp.exchange.maps.import_policy import DEFAULT_READ, ReadPolicy
from netsp.exchange.maps.wkb_shapes import ShapeError, area_of, ring_of

if TYPE_CHECKING:
    import shapely

ZIP = b"PK\x03\x04"
"""First bytes of an archive."""

CONTAINERS = ("Folder", "Document")
OVERLAYS = ("GroundOverlay", "ScreenOverlay", "PhotoOverlay", "Tour")
GEOMETRIES = (
    "Point",
    "LineString",
    "LinearRing",
    "Polygon",
    "MultiGeometry",
    "Track",
    "MultiTrack",
    "Model",
)

PLACES = ("coordinates", "coord")
"""Elements that hold places."""

BESIDES = ("Camera", "LookAt", "Region")
"""Elements of a placemark that describe its view."""

ABOVE_FLOOR = ("relativeToSeaFloor", "clampToSeaFloor")
"""Altitude modes that count from the sea floor."""

NO_MODE = "heights without an altitudeMode: taken as heights z above the water"
CLAMPED = "heights that clampToGround ignores: z 0, the surface"
HIDDEN = "hidden in the viewer (visibility 0): read like those that are shown"


def read_kml(file: str | Path, crs: str | None = None, policy: ReadPolicy = DEFAULT_READ) -> Map:
    """Return a KML or KMZ file as a map whose layers are folders, with the pages that it links to.

    Parameters
    ----------
    crs : str, optional
        Coordinate system that the user states; None for degrees, as in KML.

    Raises
    ------
    InputError
        The file is not KML, or too large.
    """
    reader = _Reader(file, degrees=crs is None, policy=policy)
    reader.seen.add(f"\n{Path(file).resolve()}")
    if zipfile.is_zipfile(file):
        archive = _Archive.open(file)
        reader.read_archive(archive, archive.main, (), folder=Path(file).parent)
    else:
        data = read_bytes(file)
        if data.startswith(ZIP):
            raise InputError(f"{file}: cannot be read as a map: a damaged archive")
        reader.read_page(_Page(Path(file).name, data, Path(file).parent), (), is_root=True)
    return reader.map()


@dataclass
class _Archive:
    """Pages of a KMZ by their paths."""

    file: str | Path
    pages: dict[str, zipfile.ZipInfo]
    archive: zipfile.ZipFile
    main: str

    @classmethod
    def open(cls, file: str | Path, data: bytes | None = None) -> _Archive:
        raw = read_bytes(file) if data is None else data
        try:
            archive = zipfile.ZipFile(io.BytesIO(raw))
            entries = archive.infolist()
        except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
            raise InputError(f"{file}: cannot be read as a map: {error}") from None
        pages = {
            path: e
            for e in entries
            if (path := posixpath.normpath(e.filename.replace("\\", "/"))).lower().endswith(".kml")
            and not _is_resource_fork(path)
        }
        if not pages:
            raise InputError(f"{file}: cannot be read as a map: holds no .kml")
        # doc.kml at the root, else the first page nearest to the root
        main = min(pages, key=lambda p: (p.count("/"), posixpath.basename(p).lower() != "doc.kml"))
        return cls(file, pages, archive, main)

    def read(self, path: str) -> bytes:
        entry = self.pages[path]
        try:
            limit = FilePolicy.max_bytes / 2**20
            if entry.file_size > FilePolicy.max_bytes:
                raise InputError(f"{self.file}: unpacks to more than {limit:g} MiB")
            return self.archive.read(entry)
        except (
            zipfile.BadZipFile,
            zlib.error,
            OSError,
            RuntimeError,
            NotImplementedError,
            EOFError,
        ) as error:
            raise InputError(f"{self.file}: cannot be read as a map: {path}: {error}") from None


def _is_resource_fork(path: str) -> bool:
    """Return whether a file of an archive is one that macOS adds."""
    parts = path.split("/")
    return "__MACOSX" in parts or parts[-1].startswith("._")


@dataclass(frozen=True)
class _Page:
    """Page with its text, and the folder or archive that its links start from."""

    name: str
    data: bytes
    folder: Path
    archive: _Archive | None = None
    path: str = ""


@dataclass(frozen=True)
class _Position:
    """Place in the tree of folders."""

    folders: tuple[str, ...] = ()
    is_hidden: bool = False

    @property
    def layer(self) -> str:
        """Path of the folders, without the document unless it is the only one."""
        return "/".join(self.folders[1:] or self.folders)


@dataclass
class _Reader:
    """Reader of a map, page by page."""

    file: str | Path
    degrees: bool
    policy: ReadPolicy
    features: list[Feature] = field(default_factory=list)
    unread: list[Unread] = field(default_factory=list)
    changes: list[Change] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)
    layers: dict[str, int] = field(default_factory=dict)
    numbers: dict[str, int] = field(default_factory=dict)
    seen: set[str] = field(default_factory=set)
    size: int = 0
    count: int = 0

    def map(self) -> Map:
        """Return the map."""
        return Map(
            tuple(self.features),
            True,
            self.layers,
            tuple(self.complaints),
            notes=tuple(change_notes(self.changes)),
            unread=tuple(self.unread),
        )

    def read_archive(
        self, archive: _Archive, page: str, folders: tuple[str, ...], folder: Path
    ) -> None:
        """Read a page of an archive; name pages that nothing links to."""
        name = Path(archive.file).name
        self.seen.add(f"{archive.file}\n{page}")
        self.read_page(
            _Page(
                f"{name}: {page}" if folders or page != archive.main else name,
                archive.read(page),
                folder,
                archive,
                page,
            ),
            folders,
            is_root=not folders,
        )
        if page != archive.main:
            return
        for other in archive.pages:
            if f"{archive.file}\n{other}" not in self.seen:
                self.seen.add(f"{archive.file}\n{other}")
                self.leave_out_page(other, f"a page that {page} does not link to")

    def leave_out_page(self, path: str, reason: str) -> None:
        """Leave out a page of an archive."""
        self.layers[path] = self.layers.get(path, 0) + 1
        self.unread.append(Unread(path, path, reason))

    def read_page(self, page: _Page, folders: tuple[str, ...], *, is_root: bool) -> None:
        """Read one page."""
        self.size += len(page.data)
        limit = FilePolicy.max_bytes / 2**20
        if self.size > FilePolicy.max_bytes:
            raise InputError(f"{self.file}: unpacks to more than {limit:g} MiB")
        if len(self.seen) > self.policy.max_pages:
            raise InputError(f"{self.file}: links to more than {self.policy.max_pages} pages")
        called = str(self.file) if is_root else f"{self.file}: {page.name}"
        root = _parsed(page.data, called, self.policy.max_element_depth)
        if root.tag not in ("kml", *CONTAINERS, "Placemark", "NetworkLink", *OVERLAYS):
            raise InputError(f"{called}: expected a kml element, got {shown(root.tag)}")
        # KML 2.1: a Schema gives placemarks another name
        schemas = {str(e.get("name")) for e in root.iter("Schema")} - set(_FEATURES)
        for element in root.iter():
            if element.tag in schemas:
                element.tag = "Placemark"
        position = _Position(folders)
        if root.tag == "kml":
            for child in root:
                self.feature(child, position, page, called)
        else:
            self.feature(root, position, page, called)

    def feature(self, element: Element, position: _Position, page: _Page, called: str) -> None:
        """Read a feature: a container and its contents, a placemark, a link, or another element."""
        tag = element.tag
        is_hidden = position.is_hidden or (_text(element, "visibility") or "").lower() in (
            "0",
            "false",
        )
        if tag in CONTAINERS:
            name = _text(element, "name") or (tag if position.folders else Path(self.file).stem)
            inside = _Position((*position.folders, name), is_hidden)
            if not len(element) or not any(c.tag in _FEATURES for c in element):
                self.layers.setdefault(inside.layer, 0)
            for child in element:
                self.feature(child, inside, page, called)
        elif tag == "Placemark":
            self.placemark(element, position, called, is_hidden=is_hidden)
        elif tag == "NetworkLink":
            self.link(element, position, page)
        elif tag in OVERLAYS:
            self.leave_out(position, f"a {tag}, which is no shape", _box_of(element))
        elif tag == "NetworkLinkControl":
            if element.find(".//Update") is not None:
                self.leave_out(position, "an Update of other pages, which is not read")
        elif _holds(element, (*PLACES, *_FEATURES)):
            self.leave_out(position, f"an element {tag} that KML does not have")

    def where(self, position: _Position) -> str:
        """Count a feature of a folder, and return its name in messages."""
        layer = position.layer
        number = self.numbers.get(layer, 0)
        self.numbers[layer] = number + 1
        self.count += 1
        if self.count > self.policy.max_features:
            raise InputError(
                f"{self.file}: more than {self.policy.max_features:,} features; expected at most "
                "that many"
            )
        return f"{layer}[{number}]"

    def leave_out(
        self, position: _Position, reason: str, shape: shapely.Geometry | None = None
    ) -> None:
        """Leave out a feature for a reason."""
        self.layers[position.layer] = self.layers.get(position.layer, 0) + 1
        self.unread.append(Unread(self.where(position), position.layer, reason, shape))

    def placemark(
        self, element: Element, position: _Position, called: str, *, is_hidden: bool
    ) -> None:
        """Read a placemark; the parts of a collection become features of their own."""
        geometries = [child for child in element if child.tag in GEOMETRIES]
        strays = list(_strays(element))
        for stray in strays:
            self.leave_out(
                position, f"places in an element {stray.tag}, which is no geometry of KML"
            )
        if not geometries:
            if not strays:
                self.leave_out(position, "has no geometry")
            return
        where, layer = self.where(position), position.layer
        properties = with_tags(_properties(element))
        several = len(geometries) > 1 or geometries[0].tag in ("MultiGeometry", "MultiTrack")
        parts = list(_parts(geometries, where if several else None))
        if not parts:
            self.layers[layer] = self.layers.get(layer, 0) + 1
            self.unread.append(Unread(where, layer, "has no geometry"))
        for place, part in parts:
            name = place or where
            self.layers[layer] = self.layers.get(layer, 0) + 1
            changes: list[str] = [HIDDEN] if is_hidden else []
            try:
                shape, is_above_floor = _shape(part, changes, degrees=self.degrees)
            except ShapeError as error:
                self.unread.append(Unread(name, layer, str(error)))
                continue
            except InputError as error:
                self.complaints.append(f"{called}: {name}: {error}")
                continue
            self.changes += [Change(name, layer, text) for text in changes]
            self.features.append(
                Feature(
                    name,
                    layer,
                    element.get("id") or "",
                    properties,
                    shape,
                    folders=tuple(reversed(position.folders)),
                    is_above_floor=is_above_floor,
                    kind="path" if part.tag == "Track" else "",
                )
            )

    def link(self, element: Element, position: _Position, page: _Page) -> None:
        """Read the page of a link, or name a link that is not read."""
        holder = next((child for child in element if child.tag in ("Link", "Url")), None)
        href = (_text(holder, "href") or "").strip() if holder is not None else ""
        target = _target(href, page)
        name = _text(element, "name") or posixpath.basename(href)
        if isinstance(target, str):
            self.leave_out(position, f"a link to {shown(href)}, {target}")
            return
        archive, path, folder = target
        key = f"{archive.file if archive else ''}\n{path}"
        if key in self.seen:
            self.leave_out(position, f"a link to {shown(href)}, which is read already")
            return
        self.seen.add(key)
        folders = (*position.folders, name) if name else position.folders
        if archive is not None:
            self.read_archive(archive, str(path), folders, folder)
            return
        file = Path(path)
        data = read_bytes(file)
        if zipfile.is_zipfile(io.BytesIO(data)):
            inner = _Archive.open(file, data)
            self.read_archive(inner, inner.main, folders, file.parent)
        else:
            self.read_page(_Page(href, data, file.parent), folders, is_root=False)


_FEATURES = (*CONTAINERS, "Placemark", "NetworkLink", *OVERLAYS)


def _target(href: str, page: _Page) -> tuple[_Archive | None, str | Path, Path] | str:
    """Return the page that a link leads to, or why it is not read."""
    if not href:
        return "which leads nowhere"
    parts = urlsplit(href)
    if parts.scheme or parts.netloc or href.startswith(("/", "\\")):
        return "which is not fetched: expected a page beside this file"
    path = unquote(parts.path).replace("\\", "/")
    if page.archive is not None:
        inner = posixpath.normpath(posixpath.join(posixpath.dirname(page.path), path))
        for candidate in (inner, posixpath.normpath(path)):
            found = next((p for p in page.archive.pages if p.lower() == candidate.lower()), None)
            if found is not None:
                return page.archive, found, page.folder
    if ".." in path.split("/"):
        return "which is outside the folder of this file"
    beside = page.folder / path
    if beside.suffix.lower() not in (".kml", ".kmz") or not beside.is_file():
        return "which is not there"
    return None, beside.resolve(), page.folder


def _parsed(data: bytes, called: str, max_depth: int) -> Element:
    """Return the root of a page, with names without prefixes."""
    builder = TreeBuilder()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > max_depth:
            raise InputError(f"{called}: elements nested more than {max_depth} times")
        builder.start(tag.rpartition(":")[2], attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag.rpartition(":")[2])

    def doctype(*_: Any) -> None:
        raise InputError(f"{called}: expected KML without a document type, got <!DOCTYPE")

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data.lstrip(b" \t\r\n"), True)
        return builder.close()
    except (expat.ExpatError, ValueError, LookupError, AssertionError) as error:
        raise InputError(f"{called}: cannot be read as a map: not XML: {error}") from None


def _text(element: Element | None, name: str) -> str | None:
    if element is None:
        return None
    text = next((child.text for child in element if child.tag == name), None)
    return (text or "").strip() or None


def _properties(element: Element) -> dict[str, Any]:
    """Return the properties of a placemark: its own texts, and its extended data."""
    out: dict[str, Any] = {}
    for tag in ("name", "description", "address"):
        if (value := _text(element, tag)) is not None:
            out[tag] = value
    for holder in element:
        if holder.tag == "ExtendedData":
            for child in holder:  # elements of other namespaces hold data as well
                if child.tag not in ("Data", "SchemaData") and not len(child):
                    out.setdefault(child.tag, (child.text or "").strip() or None)
            for child in holder.iter():
                if child.tag == "Data" and child.get("name"):
                    out.setdefault(str(child.get("name")), _text(child, "value"))
                elif child.tag == "SimpleData" and child.get("name"):
                    out.setdefault(str(child.get("name")), (child.text or "").strip() or None)
    return out


def _holds(element: Element, tags: Container[str]) -> bool:
    """Return whether an element has one of some names, or holds such an element."""
    return any(e.tag in tags for e in element.iter())


def _strays(element: Element) -> Iterator[Element]:
    """Yield the elements with places in a placemark or a collection that are no geometries."""
    for child in element:
        if child.tag in ("MultiGeometry", "MultiTrack"):
            yield from _strays(child)
        elif child.tag not in (*GEOMETRIES, *BESIDES) and _holds(child, PLACES):
            yield child


def _parts(geometries: list[Element], where: str | None) -> Iterator[tuple[str | None, Element]]:
    """Yield the geometries of a placemark that are no collections, with their names."""
    for k, geometry in enumerate(geometries):
        place = None if where is None else f"{where}.geometries[{k}]"
        if geometry.tag in ("MultiGeometry", "MultiTrack"):
            inner = [child for child in geometry if child.tag in GEOMETRIES]
            outer = where if len(geometries) == 1 else place
            yield from _parts(inner, outer)
        else:
            yield place, geometry


def _shape(element: Element, changes: list[str], *, degrees: bool) -> tuple[shapely.Geometry, bool]:
    """Return the shape of an element, and whether its heights count from the sea floor."""
    import shapely

    tag = element.tag
    if tag == "Model":
        raise ShapeError("a 3D model, whose shape is not read")
    if tag == "Polygon":
        rings = [
            _ring(ring, degrees=degrees)
            for boundary in ("outerBoundaryIs", "innerBoundaryIs")
            for holder in element
            if holder.tag == boundary
            for ring in holder
            if ring.tag == "LinearRing"
        ]
        outer = next((h for h in element if h.tag == "outerBoundaryIs"), None)
        if outer is None or not rings or not len(rings[0]):
            raise ShapeError("has no coordinates")
        rings, above = _heights(rings, element, changes)
        return area_of(rings, changes), above
    if tag == "Track":
        points = _numbers(
            [re.sub(r"\s+", ",", (c.text or "").strip()) for c in element if c.tag == "coord"],
            degrees=degrees,
        )
    else:
        points = _ring(element, degrees=degrees)
        if sum(child.tag == "coordinates" for child in element) > 1:
            changes.append("several lists of coordinates: taken as one")
    if not len(points):
        raise ShapeError("has no coordinates")
    (points,), above = _heights([points], element, changes)
    if tag == "Point":
        if len(points) > 1:
            changes.append("a point with several places: the first is taken")
        return shapely.Point(points[0]), above
    if tag == "LinearRing":
        return _closed_line(points, changes), above
    if len(points) == 1:
        raise ShapeError("a line of one place")
    return shapely.LineString(points), above


def _closed_line(points: np.ndarray, changes: list[str]) -> shapely.Geometry:
    """Return a LinearRing as a closed line."""
    import shapely

    if len(np.unique(points[:, :2], axis=0)) == 1:
        raise ShapeError("a ring that is one point")
    return shapely.LineString(ring_of(points, changes))


def _ring(element: Element, *, degrees: bool) -> np.ndarray:
    text = " ".join(c.text or "" for c in element if c.tag == "coordinates")
    return _numbers(re.sub(r"\s*,\s*", ",", text).split(), degrees=degrees)


def _numbers(places: list[str], *, degrees: bool) -> np.ndarray:
    """Return places as longitude, latitude and height, with NaN for a missing height."""
    out = np.full((len(places), 3), math.nan)
    for k, place in enumerate(places):
        values = place.rstrip(",").split(",")
        try:
            numbers = [float(v) for v in values[:3]]
        except ValueError:
            numbers = []
        if len(numbers) < 2 or not all(map(math.isfinite, numbers)):
            raise InputError(f"expected longitude,latitude[,altitude], got {shown(place)}")
        if degrees and (abs(numbers[0]) > 180.0 or abs(numbers[1]) > 90.0):
            raise InputError(
                f"expected longitude,latitude within 180 and 90 degrees, got {shown(place)}"
            )
        out[k, : len(numbers)] = numbers
    return out


def _heights(
    rings: list[np.ndarray], element: Element, changes: list[str]
) -> tuple[list[np.ndarray], bool]:
    """Return places with heights by the altitude mode, and whether they count from the floor."""
    mode = _text(element, "altitudeMode")
    heights = np.concatenate([ring[:, 2] for ring in rings])
    has_heights = bool((np.nan_to_num(heights) != 0.0).any())
    if mode in ABOVE_FLOOR:
        return [ring[:, :2] for ring in rings], True
    if mode == "clampToGround":
        if has_heights:
            changes.append(CLAMPED)
        return [ring[:, :2] for ring in rings], False
    if mode is None and has_heights:
        changes.append(NO_MODE)
    if mode not in (None, "absolute", "relativeToGround"):
        raise InputError(
            f"altitudeMode: expected clampToGround, relativeToGround, absolute, "
            f"{' or '.join(ABOVE_FLOOR)}, got {shown(mode)}"
        )
    if np.isnan(heights).all():
        return [ring[:, :2] for ring in rings], False
    return [np.column_stack([r[:, :2], np.nan_to_num(r[:, 2])]) for r in rings], False


def _box_of(element: Element) -> shapely.Geometry | None:
    """Return the box of an overlay, for the picture."""
    import shapely

    box = next((child for child in element if child.tag == "LatLonBox"), None)
    try:
        west, south, east, north = (
            float(_text(box, side) or "nan") for side in ("west", "south", "east", "north")
        )
    except ValueError:
        return None
    if not all(map(math.isfinite, (west, south, east, north))):
        return None
    return shapely.box(west, south, east, north)

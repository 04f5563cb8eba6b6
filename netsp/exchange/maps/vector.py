"""Reader of maps through GDAL: shapefiles, GeoPackages, S-57 charts and other formats.

pyogrio contains GDAL. Geometries that Shapely does not read are repaired or named
(`netsp.exchange.maps.wkb_shapes`).
"""

from __future__ import annotations

import math
import re
import sqlite3
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from netsp.base.axes import height_axis, map_unit
from netsp.base.errors import InputError, UnansweredError
from netsp.base.files import check_file, read_bytes
from netsp.exchange.maps.feature import Change, Feature, Map, Unread, change_notes, with_tags
from netsp.exchange.maps.import_policy import DEFAULT_READ, ReadPolicy
from netsp.exchange.maps.wkb_shapes import NotFiniteError, ShapeError, collected, shape_of

if TYPE_CHECKING:
    import shapely

PLANE_SYSTEMS = ("LOCAL_CS", "ENGCRS", "ENGINEERINGCRS")
"""First words, in well-known text, of systems without a place on the earth."""

OSM_SUFFIXES = (".osm", ".pbf")
"""Extensions of OpenStreetMap's own formats."""

TEXT_DRIVERS = ("MapInfo File", "DGN")
"""GDAL's drivers of formats with texts, which GDAL gives as points with the style of a label."""

SQLITE = b"SQLite format 3\0"
"""First bytes of a GeoPackage."""

GML_MEMBER = re.compile(
    rb"<(?:[\w.-]+:)?(?:featureMembers?|member)\b[^>]*>\s*<(?:[\w.-]+:)?([\w.-]+)"
)
"""Feature of GML, whose element is named like its layer."""

SOURCE_PLACE = re.compile(r"^\S+\.(?:cpp|c|h), \d+: ")
"""Place in GDAL's source code with which some of its messages begin."""

UNSUPPORTED = "Geometry type is not supported"
"""Words of pyogrio for layers that are declared to hold faces."""

MIXED_TYPES = "Unrecognized geometry type"
"""Words of pyogrio for layers with several types of geometries, some with heights."""

LOCAL = "local"
"""Coordinate system of a map without a place on the earth."""


def read_vector(file: str | Path, crs: str | None, policy: ReadPolicy = DEFAULT_READ) -> Map:
    """Return a file of any format that GDAL reads as a map, in degrees or in the file's own plane.

    Parameters
    ----------
    crs : str, optional
        Coordinate system of layers that name none, ``local`` for a plane without a place on the
        earth.

    Raises
    ------
    InputError
        The file cannot be read or is too large, only some layers have a place on the earth, or
        pyogrio is not installed.
    """
    check_file(file)
    with _readable(file) as plain:
        return read_plain(file, plain, crs, policy)


def read_plain(
    file: str | Path, plain: str | Path, crs: str | None, policy: ReadPolicy = DEFAULT_READ
) -> Map:
    """Return a file as a map, as `read_vector`, from a copy of it that GDAL reads.

    Parameters
    ----------
    file : str or Path
        The user's file, for messages.
    plain : str or Path
        File that is read.
    """
    found = _Found(file, policy)
    places: dict[str, bool] = {}
    is_osm = Path(file).suffix.lower() in OSM_SUFFIXES
    for name, kind in gdal_layers(file, plain, found.notes):
        if kind is None:
            found.add_table(name, _row_count(plain, name, policy.max_features))
            continue
        layer = read_layer(file, plain, name, found.notes, policy)
        if is_osm and not layer.shapes:
            continue  # GDAL has the same five layers for every file
        system = crs if crs is not None else layer.crs
        if crs is not None and layer.crs is not None and not _is_same_system(crs, layer.crs):
            found.notes.append(
                f"layer {name!r}: its own system {_system_name(layer.crs)} is not used; it is read "
                f"as {crs}"
            )
        if system is not None and system.startswith(PLANE_SYSTEMS) and map_unit(system) == 1.0:
            system = LOCAL  # the file states that it has no place on the earth
        if system is None:
            plain = f"{file}: layer {name!r}: names no coordinate system"
            option = f"; give it with --crs EPSG:4326 (degrees), another EPSG code or --crs {LOCAL}"
            raise UnansweredError([plain + option], [plain], ["crs"])
        places[name] = system != LOCAL
        found.is_osm = is_osm
        found.add_layer(name, layer, _mover(str(system), f"{file}: layer {name!r}"))
        change = "" if system == LOCAL else height_axis(str(system)).change
        if change and any(f.layer == name and f.shape.has_z for f in found.features):
            found.notes.append(f"layer {name!r}: {change}")
    if len(set(places.values())) > 1:
        local_layer = next(name for name, on in places.items() if not on)
        raise InputError(
            f"{file}: layer {local_layer!r} has no place on the earth and others have; expected "
            "one system for all"
        )
    if not places:
        raise InputError(
            f"{file}: has no layer with places; expected geometries (tables of goals are read "
            "beside a map: --goals TABLE)"
        )
    return found.map(all(places.values()))


@dataclass(frozen=True)
class GdalLayer:
    """Layer as GDAL reads it.

    Attributes
    ----------
    crs
        Its coordinate system; None without one.
    numbers
        Numbers of its features.
    shapes
        Well-known binary of each feature; None without a geometry.
    texts
        Numbers of the features that are texts.
    """

    crs: str | None
    numbers: list[int]
    shapes: list[bytes | None]
    properties: list[dict[str, Any]]
    texts: frozenset[int] = frozenset()


def gdal_layers(file: str | Path, plain: str | Path, notes: list[str]) -> list[tuple[str, Any]]:
    """Return the layers of a file and the types of their geometries, which are None for tables.

    Parameters
    ----------
    file : str or Path
        The user's file, for messages.
    plain : str or Path
        File that is read.
    notes : list of str
        Extended by GDAL's warnings.
    """
    layers = _call(file, notes, _pyogrio().list_layers, plain)
    return [(str(name), kind) for name, kind in layers]


def read_layer(
    file: str | Path, plain: str | Path, layer: str, notes: list[str], policy: ReadPolicy
) -> GdalLayer:
    """Return one layer as GDAL reads it; for the parameters see `gdal_layers`.

    Raises
    ------
    InputError
        The layer cannot be read, or has too many features.
    """
    meta, ids, shapes, columns = _call(
        file, notes, _pyogrio().raw.read, plain, layer=layer, return_fids=True, force_2d=False
    )
    if len(shapes) > policy.max_features:
        raise InputError(
            f"{file}: layer {layer!r}: {len(shapes):,} features; expected at most "
            f"{policy.max_features:,}"
        )
    names = [str(name) for name in meta["fields"]]
    properties = [
        {name: _plain(column[k]) for name, column in zip(names, columns, strict=True)}
        for k in range(len(shapes))
    ]
    numbers = [int(i) for i in ids]
    return GdalLayer(meta.get("crs"), numbers, list(shapes), properties, _texts(file, plain, layer))


def _texts(file: str | Path, plain: str | Path, layer: str) -> frozenset[int]:
    """Return the numbers of the features of a layer that are texts."""
    pyogrio = _pyogrio()
    if _call(file, [], pyogrio.read_info, plain, layer=layer)["driver"] not in TEXT_DRIVERS:
        return frozenset()
    quoted = layer.replace('"', '\\"')
    _, ids, _, (styles,) = _call(
        file,
        [],
        pyogrio.raw.read,
        plain,
        sql=f'SELECT OGR_STYLE FROM "{quoted}"',
        sql_dialect="OGRSQL",
        return_fids=True,
        read_geometry=False,
    )
    return frozenset(
        int(number)
        for number, style in zip(ids, styles, strict=True)
        if str(style).startswith("LABEL")
    )


def read_rows(
    file: str | Path, plain: str | Path, layer: str, notes: list[str]
) -> list[dict[str, Any]]:
    """Return the rows of a table without places; for the parameters see `gdal_layers`.

    Raises
    ------
    InputError
        The table cannot be read.
    """
    meta, _, _, columns = _call(
        file, notes, _pyogrio().raw.read, plain, layer=layer, read_geometry=False
    )
    names = [str(name) for name in meta["fields"]]
    plain_columns = [[_plain(value) for value in column] for column in columns]
    return [dict(zip(names, row, strict=True)) for row in zip(*plain_columns, strict=True)]


@contextmanager
def gdal_options(options: Mapping[str, str]) -> Iterator[None]:
    """Set options of GDAL while the body runs."""
    pyogrio = _pyogrio()
    before = {name: pyogrio.get_gdal_config_option(name) for name in options}
    pyogrio.set_gdal_config_options(dict(options))
    try:
        yield
    finally:
        pyogrio.set_gdal_config_options(before)


@contextmanager
def _readable(file: str | Path) -> Iterator[str | Path]:
    """Yield a file that pyogrio reads; for layers declared to hold faces this is a virtual file.

    pyogrio refuses such layers (PolyhedralSurface, TIN, Triangle) whatever they hold.
    """
    try:
        _call(file, [], _pyogrio().list_layers, file)
    except InputError as error:
        names = _layer_names(file) if UNSUPPORTED in str(error) else {}
        if not names:
            raise
    else:
        yield file
        return
    source = f"<SrcDataSource>{escape(str(Path(file).resolve()))}</SrcDataSource>"
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "layers.vrt"
        layers = [
            f"<OGRVRTLayer name={quoteattr(name)}>{source}"
            f"<GeometryType>{kind}</GeometryType></OGRVRTLayer>"
            for name, kind in names.items()
        ]
        plain.write_text(f"<OGRVRTDataSource>{''.join(layers)}</OGRVRTDataSource>", "utf-8")
        yield plain


def _layer_names(file: str | Path) -> dict[str, str]:
    """Return the layers and types of a GeoPackage or of GML, else one layer named like the file."""
    data = read_bytes(file)
    if data.startswith(SQLITE):
        with closing(sqlite3.connect(f"{Path(file).resolve().as_uri()}?mode=ro", uri=True)) as base:
            rows = base.execute("SELECT table_name, data_type FROM gpkg_contents").fetchall()
        return {str(name): "wkbUnknown" if kind == "features" else "wkbNone" for name, kind in rows}
    names = [name.decode("ascii", "replace") for name in GML_MEMBER.findall(data)]
    return dict.fromkeys(names or [Path(file).stem], "wkbUnknown")


def _row_count(file: str | Path, layer: str, max_rows: int) -> int:
    found = _call(file, [], _pyogrio().read_info, file, layer=layer, force_feature_count=True)
    return min(max(int(found["features"]), 0), max_rows)


class _Found:
    """Features, notes and complaints found in a file so far."""

    def __init__(self, file: str | Path, policy: ReadPolicy) -> None:
        self.file, self.policy = file, policy
        self.notes: list[str] = []
        self.features: list[Feature] = []
        self.unread: list[Unread] = []
        self.changes: list[Change] = []
        self.complaints: list[str] = []
        self.layers: dict[str, int] = {}
        self.is_osm = False

    def add_table(self, name: str, rows: int) -> None:
        """Leave out the rows of a table without places."""
        self.layers[name] = rows
        self.unread += [Unread(f"{name}[{k}]", name, "a table without places") for k in range(rows)]

    def add_layer(self, name: str, layer: GdalLayer, move: Mover) -> None:
        """Add the features of a layer, or the reasons why they cannot be used."""
        self.layers.setdefault(name, 0)
        for k, data, properties in zip(layer.numbers, layer.shapes, layer.properties, strict=True):
            where = f"{name}[{k}]"
            if k in layer.texts:
                self.layers[name] += 1
                self.unread.append(Unread(where, name, "writing on the map (a text)"))
                continue
            try:
                shapes = self.shapes(where, name, data, move)
            except NotFiniteError as error:
                self.layers[name] += 1
                self.complaints.append(f"{self.file}: {where}: {error}")
                continue
            except ShapeError as error:
                self.layers[name] += 1
                self.unread.append(Unread(where, name, str(error)))
                continue
            tags = with_tags(properties)
            for place, area in shapes:
                shape = area
                if self.is_osm and tags.get("natural") == "coastline":
                    shape = _shore(area)  # GDAL turns closed lines into areas
                self.layers[name] += 1
                self.features.append(Feature(place, name, "", tags, shape))

    def shapes(
        self, where: str, layer: str, data: bytes | None, move: Mover
    ) -> list[tuple[str, shapely.Geometry]]:
        """Return the shape of a feature, or the parts of a collection, with their names."""
        if data is None:
            raise ShapeError("has no geometry")
        shape, changes = shape_from_gdal(data, self.policy)
        parts = list(parts_of(shape, where))
        if not parts:
            raise ShapeError("has no geometry")
        self.changes += [Change(where, layer, text) for text in changes]
        return [(place, move(part)) for place, part in parts]

    def map(self, is_geographic: bool) -> Map:
        """Return the map."""
        return Map(
            tuple(self.features),
            is_geographic,
            self.layers,
            tuple(self.complaints),
            notes=(*self.notes, *change_notes(self.changes)),
            unread=tuple(self.unread),
        )


def _shore(shape: shapely.Geometry) -> shapely.Geometry:
    """Return the outlines of areas as closed lines in their direction; other shapes unchanged."""
    if "Polygon" not in shape.geom_type:
        return shape
    import shapely

    return collected(
        [shapely.LineString(part.exterior.coords) for part in getattr(shape, "geoms", [shape])]
    )


def shape_from_gdal(data: bytes, policy: ReadPolicy) -> tuple[shapely.Geometry, tuple[str, ...]]:
    """Return a shape of any type that GDAL gives, without measures, and the changes made to it."""
    import shapely

    with np.errstate(invalid="ignore"):  # places that are no numbers are refused below
        shape = shapely.from_wkb(data, on_invalid="ignore")
    changes: tuple[str, ...] = ()
    if shape is None or getattr(shape, "has_m", False):
        shape, changes = shape_of(data, policy)
    if not np.isfinite(shapely.get_coordinates(shape)).all():
        raise NotFiniteError
    if "Polygon" in shape.geom_type and not shape.is_empty and not shape.length:
        raise ShapeError("an area that is one point")
    return shape, changes


def parts_of(shape: shapely.Geometry, where: str) -> Iterator[tuple[str, shapely.Geometry]]:
    """Yield the non-empty geometries of a feature, with their names in messages.

    The parts of a collection ``piles[3]`` are named like ``piles[3].geometries[0]``.
    """
    if shape.is_empty:
        return
    if shape.geom_type != "GeometryCollection":
        yield where, shape
        return
    for k, part in enumerate(shape.geoms):
        yield from parts_of(part, f"{where}.geometries[{k}]")


Mover = Callable[["shapely.Geometry"], "shapely.Geometry"]
"""Function that moves a shape from the file's system to degrees."""


def _mover(crs: str, where: str) -> Mover:
    """Return the function that moves shapes to degrees; for a local system it changes nothing."""
    import shapely

    transform = None if crs == LOCAL else _to_degrees(crs, where)
    if transform is None:
        return lambda shape: shape

    up = height_axis(crs)

    def degrees(c: np.ndarray) -> np.ndarray:
        out = c.copy()
        out[:, 0], out[:, 1] = transform.transform(c[:, 0], c[:, 1])
        out[:, 2:] *= up.sign * up.metres
        return out

    def moved(shape: shapely.Geometry) -> shapely.Geometry:
        out = shapely.transform(shape, degrees, include_z=bool(shape.has_z))
        if not np.isfinite(shapely.get_coordinates(out)).all():
            raise NotFiniteError
        return out

    return moved


def _system_name(crs: str) -> str:
    """Return the name of a coordinate system, without its definition."""
    found = re.search(r'"([^"]{1,80})"', crs)
    return crs if len(crs) <= 40 or found is None else found[1]


def _is_same_system(crs: str, other: str) -> bool:
    """Return whether two texts name one coordinate system."""
    if crs.strip().lower() == other.strip().lower():
        return True
    try:
        from pyproj import CRS
        from pyproj.exceptions import ProjError
    except ImportError:
        return False
    try:
        return bool(CRS.from_user_input(crs) == CRS.from_user_input(other))
    except ProjError:  # local, or a system that is refused where it is used
        return False


def _to_degrees(crs: str, where: str) -> Any:
    """Return a transformer to longitude and latitude on WGS 84; None if it would change nothing."""
    try:
        from pyproj import CRS, Transformer
        from pyproj.exceptions import ProjError
    except ImportError:
        raise InputError("positions on the earth need pyproj: pip install 'netsp[geo]'") from None
    try:
        system = CRS.from_user_input(crs)
        if system.to_epsg() == 4326 or system.to_authority() == ("OGC", "CRS84"):
            return None
        return Transformer.from_crs(system, "EPSG:4326", always_xy=True)
    except ProjError as error:
        raise InputError(
            f"{where}: crs: expected a coordinate system as EPSG:32632, got {crs[:60]!r} "
            f"({str(error).splitlines()[0][:80]})"
        ) from None


def in_degrees(map_: Map, crs: str, file: str | Path) -> Map:
    """Return a map in degrees from one whose shapes are in a system that the user states.

    With the system ``local`` the shapes stay in their plane.
    """
    move = _mover(crs, str(file))
    features: list[Feature] = []
    complaints: list[str] = []
    for feature in map_.features:
        try:
            marker = None if feature.marker is None else move(feature.marker)
            features.append(replace(feature, shape=move(feature.shape), marker=marker))
        except NotFiniteError as error:
            complaints.append(f"{file}: {feature.where}: {error}")
    return replace(
        map_,
        features=tuple(features),
        is_geographic=crs != LOCAL,
        complaints=(*map_.complaints, *complaints),
    )


def _plain(value: Any) -> Any:
    """Return a value of a column as a Python object; None for NaN."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and math.isnan(value):
        return None
    return value


def _call(file: str | Path, notes: list[str], function: Any, *args: Any, **more: Any) -> Any:
    """Call a function of GDAL; its errors become an InputError, and its warnings notes."""
    import warnings

    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            out = function(*args, **more)
    except Exception as error:
        first = _user_text(str(error) or type(error).__name__, file, args)[:160]
        raise InputError(f"{file}: cannot be read as a map: {first}") from None
    for warning in caught:
        text = f"GDAL: {_user_text(str(warning.message), file, args)[:160]}"
        if MIXED_TYPES in text:
            continue  # no loss
        if issubclass(warning.category, RuntimeWarning) and text not in notes:
            notes.append(text)
    return out


def _user_text(text: str, file: str | Path, args: Sequence[Any]) -> str:
    """Return the first line of GDAL's message, for the user's file, without places in GDAL's code.

    Line numbers of a temporary file are replaced, because they are not those of the user's file.
    """
    first = SOURCE_PLACE.sub("", text.splitlines()[0].split("; It might")[0])
    for plain in (str(arg) for arg in args if isinstance(arg, Path) and str(arg) != str(file)):
        damaged = "a damaged entity; audit the drawing in its program and save it again"
        first = re.sub(rf"error at line \d+ of {re.escape(plain)}", damaged, first)
        first = first.replace(plain, str(file))
    return first


def _pyogrio() -> Any:
    try:
        import pyogrio
    except ImportError:
        raise InputError("maps other than GeoJSON need pyogrio: pip install 'netsp[geo]'") from None
    import pyogrio.raw

    return pyogrio

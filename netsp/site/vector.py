"""Maps of every other kind through GDAL's readers: KML and KMZ, shapefiles, GeoPackages, DXF
drawings, S-57 charts.

pyogrio brings GDAL with it. A drawing has neither a place on the earth nor a unit that GDAL tells;
its layers are a field of its entities, and its circles arrive as closed lines of many corners.
"""

from __future__ import annotations

import math
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from netsp.axes import height_axis
from netsp.errors import InputError, UnansweredError
from netsp.files import MOST_BYTES, check_file
from netsp.site.feature import Feature, Map, Unread

MOST_FEATURES = 100_000
"""Of a map: more make no problem that anybody solves."""

LOCAL = "local"
"""The coordinate system of a map without a place on the earth."""

NAMES = ("name", "objnam", "id", "label")


def read_vector(file: str | Path, crs: str | None) -> Map:
    """A file of any format that GDAL reads as a map.

    Parameters
    ----------
    file : str or Path
        The file.
    crs : str, optional
        Coordinate system of layers that name none, ``local`` for a plane of its own.

    Returns
    -------
    Map
        In degrees, or in the file's own plane.

    Raises
    ------
    InputError
        Not readable, too large, some layers with a place on the earth and some without, or pyogrio
        is not installed.
    """
    check_file(file)
    with _unpacked(file) as plain:
        return _read(file, plain, crs)


def _read(file: str | Path, plain: str | Path, crs: str | None) -> Map:
    """What stands in a file, which may have been unpacked to another place."""
    pyogrio = _pyogrio()
    drawing = Path(file).suffix.lower() == ".dxf"
    features: list[Feature] = []
    layers: dict[str, int] = {}
    complaints: list[str] = []
    unread: list[Unread] = []
    places: dict[str, bool] = {}
    for layer, kind in _call(file, pyogrio.list_layers, plain):
        if kind is None:
            continue  # a table without places
        meta, ids, shapes, columns = _call(
            file, pyogrio.raw.read, plain, layer=layer, return_fids=True, force_2d=False
        )
        if len(shapes) > MOST_FEATURES:
            raise InputError(
                f"{file}: layer {layer!r}: {len(shapes):,} features; expected at most "
                f"{MOST_FEATURES:,}"
            )
        own = crs if crs is not None else meta.get("crs")
        if own is None and drawing:
            own = LOCAL
        if own is None:
            plain = f"{file}: layer {layer!r}: names no coordinate system"
            option = f"; give it with --crs EPSG:4326 (degrees), another EPSG code or --crs {LOCAL}"
            raise UnansweredError([plain + option], [plain], ["crs"])
        if not len(shapes):
            layers.setdefault(layer, 0)
        places[layer] = own != LOCAL
        geometries = _geometries(shapes, str(own), f"{file}: layer {layer!r}")
        for k, shape in enumerate(geometries):
            properties = {
                str(name): _plain(column[k])
                for name, column in zip(meta["fields"], columns, strict=True)
            }
            inner = str(properties.get("Layer") or layer) if drawing else layer
            layers[inner] = layers.get(inner, 0) + 1
            where = f"{inner}[{int(ids[k]) if not drawing else layers[inner] - 1}]"
            if shape is None or shape.is_empty:
                unread.append(Unread(where, inner, "has no geometry"))
                continue
            if not np.isfinite(_coordinates(shape)).all():
                complaints.append(f"{file}: {where}: expected finite coordinates")
                continue
            features.append(Feature(where, inner, "", properties, shape))
    if len(set(places.values())) > 1:
        some = next(name for name, on in places.items() if not on)
        raise InputError(
            f"{file}: layer {some!r} has no place on the earth and others have; expected one "
            "system for all"
        )
    if not layers:
        raise InputError(f"{file}: has no layer with places")
    return Map(
        tuple(features), all(places.values()), layers, tuple(complaints), unread=tuple(unread)
    )


def _geometries(shapes: Any, crs: str, where: str) -> list[Any]:
    """Return shapes of WKB in degrees and metres upwards, or as they are where the system is local;
    None for none."""
    import shapely

    made = [None if s is None else shapely.from_wkb(s, on_invalid="ignore") for s in shapes]
    if crs == LOCAL:
        return made
    transform = _to_degrees(crs, where)
    if transform is None:
        return made

    up = height_axis(crs)

    def degrees(c: np.ndarray) -> np.ndarray:
        out = c.copy()
        out[:, 0], out[:, 1] = transform.transform(c[:, 0], c[:, 1])
        out[:, 2:] *= up.sign * up.metres
        return out

    return [
        None if s is None else shapely.transform(s, degrees, include_z=bool(s.has_z)) for s in made
    ]


def _to_degrees(crs: str, where: str) -> Any:
    """A transformer to longitude and latitude on WGS 84; None where they are so already."""
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
    """A map whose shapes are in a system given by the user.

    Parameters
    ----------
    map_ : Map
        Its shapes as the file has them.
    crs : str
        Their system, or ``local``.
    file : str or Path
        For messages.

    Returns
    -------
    Map
        In degrees, or the same where the system is local.
    """
    import shapely

    shapes = [shapely.to_wkb(f.shape) for f in map_.features]
    made = _geometries(shapes, crs, str(file))
    features = tuple(
        Feature(f.where, f.layer, f.identity, f.properties, s)
        for f, s in zip(map_.features, made, strict=True)
    )
    return replace(map_, features=features, geographic=crs != LOCAL)


def _coordinates(shape: Any) -> np.ndarray:
    import shapely

    return np.asarray(shapely.get_coordinates(shape))


def _plain(value: Any) -> Any:
    """A value of a column as Python has it."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and math.isnan(value):
        return None
    return value


@contextmanager
def _unpacked(file: str | Path) -> Iterator[str | Path]:
    """Where a file is to be read: the page in a KMZ apart from it, because GDAL reads no data of
    places (their schema) in the archive."""
    if Path(file).suffix.lower() != ".kmz":
        yield file
        return
    try:
        with zipfile.ZipFile(file) as archive:
            pages = [e for e in archive.infolist() if e.filename.lower().endswith(".kml")]
            if not pages:
                raise InputError(f"{file}: cannot be read as a map: holds no .kml")
            if pages[0].file_size > MOST_BYTES:
                raise InputError(f"{file}: unpacks to more than {MOST_BYTES / 2**20:g} MiB")
            text = archive.read(pages[0])
    except (zipfile.BadZipFile, zlib.error, OSError, RuntimeError, NotImplementedError) as error:
        raise InputError(f"{file}: cannot be read as a map: {error}") from None
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "doc.kml"
        page.write_bytes(text)
        yield page


def _call(file: str | Path, function: Any, *args: Any, **more: Any) -> Any:
    """A call of GDAL, whose readers raise what they like."""
    import warnings

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return function(*args, **more)
    except Exception as error:
        first = (str(error) or type(error).__name__).splitlines()[0].split("; It might")[0][:160]
        raise InputError(f"{file}: cannot be read as a map: {first}") from None


def _pyogrio() -> Any:
    try:
        import pyogrio
    except ImportError:
        raise InputError("maps other than GeoJSON need pyogrio: pip install 'netsp[geo]'") from None
    import pyogrio.raw

    return pyogrio

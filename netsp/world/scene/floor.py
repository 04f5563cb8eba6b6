"""Sea floor from a bathymetry grid: GeoTIFF, ASC, tables and other formats of rasterio."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.axes import height_axis, map_unit
from netsp.base.columns import Column, height_meaning
from netsp.base.errors import InputError, counted
from netsp.base.files import read_bytes
from netsp.base.units import metres_per_unit
from netsp.world.scene.missing_heights import marks_of_no_height
from netsp.world.scene.point_clouds import read_text_cloud
from netsp.world.scene.scene_policy import FloorPolicy
from netsp.world.scene.tally import Tally

TABLES = (".xyz", ".csv", ".txt", ".pts", ".dat")
"""Extensions of grids that are tables of text, with a row for each cell."""

UPWARD_FORMATS = ("BAG",)
"""Formats of GDAL whose heights count upwards although their vertical systems name a depth (Open
Navigation Surface, format specification 1.6: elevations are positive above the datum)."""

MAX_ROW_SLOPE = 1e-9
"""Tolerance for the slope of a grid's rows against the east, from rounding of the geotransform."""

MAX_STEP_SHIFT = 0.02
"""Tolerance for the distance of a table's coordinates from a grid, from rounding, as a share of a
step."""

_ESRI_WORDS = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter")


def load_floor(
    path: str | Path,
    *,
    scale: float = 1.0,
    origin: tuple[float, float] = (0.0, 0.0),
    depths: bool | None = None,
) -> tuple[Floats, npt.NDArray[np.int64], tuple[str, ...]]:
    """Read a sea floor as a closed mesh.

    Heights at the middles of the grid's cells are joined by triangles, walls and a flat bottom.
    Heights are the grid's values times the scale of its band plus its offset, in the unit of the
    band, else of its vertical system, else of its map. Cells without a value take that of the
    nearest cell that has one.

    Parameters
    ----------
    path : str or Path
        Grid with a place on the map.
    scale : float
        Metres per unit of map and heights, for a grid that states no unit.
    origin : (x, y)
        Point that becomes (0, 0), in units of the map.
    depths : bool, optional
        Whether values count downwards, if the grid's vertical system does not state it. None
        decides by the name of the band or column; unknown names count upwards.

    Returns
    -------
    vertices : ndarray, shape (n, 3)
        Vertices, metres, z upwards.
    faces : ndarray, shape (m, 3)
        Outward triangles.
    notes : tuple of str
        Conversions, and cells without a height, one line each.

    Raises
    ------
    InputError
        The file cannot be read, has no values, is in degrees or has too many cells, or rasterio is
        not installed.
    """
    floor = read_floor(path, scale=scale, origin=origin, depths=depths)
    return floor.vertices, floor.faces, floor.notes


@dataclass(frozen=True)
class FloorReading:
    """Sea floor of a file in a scene.

    Attributes
    ----------
    vertices
        (n, 3), metres, z upwards.
    faces
        (m, 3) outward triangles.
    notes
        Conversions, and cells without a height, one line each.
    tally
        Numbers of cells with a height, and without one.
    """

    vertices: Floats
    faces: npt.NDArray[np.int64]
    notes: tuple[str, ...]
    tally: Tally


def read_floor(
    path: str | Path,
    *,
    scale: float = 1.0,
    origin: tuple[float, float] = (0.0, 0.0),
    depths: bool | None = None,
    policy: FloorPolicy | None = None,
) -> FloorReading:
    """Read a sea floor as `load_floor` does, with the numbers of its cells."""
    policy = policy or FloorPolicy()
    is_table = Path(path).suffix.lower() in TABLES or _is_plain_table(path)
    grid = _grid_of_table(path, policy) if is_table else _read(path, policy)
    if scale != 1.0 and (grid.metres != 1.0 or grid.height_metres not in (None, 1.0)):
        raise InputError(
            f"{path}: scale: the grid states its unit and is read in metres; expected no scale, "
            f"got {scale:g}"
        )
    notes = list(grid.notes)
    by_name = grid.called_depth and depths is None
    if by_name and grid.z.max() <= 0.0:
        by_name = False
        notes.append(
            "named a depth, but no value is above 0: taken as heights; set depths to true if the "
            "values count downwards"
        )
    sign = -1.0 if depths or grid.counts_down or by_name else 1.0
    if sign < 0.0 and not depths:
        notes.append("heights count downwards: converted to z upwards")
    height = grid.metres if grid.height_metres is None else grid.height_metres
    if grid.metres != 1.0 or height != 1.0:
        notes.append(
            f"map in units of {grid.metres:.7g} m, heights of {height:.7g} m: converted to metres"
        )
    if sign > 0.0 and grid.z.min() > 0.0:
        notes.append("all heights are above 0: set depths to true if values count downwards")
    x = (grid.x - origin[0]) * grid.metres * scale
    y = (grid.y - origin[1]) * grid.metres * scale
    z = grid.z * (sign * height * scale) + 0.0
    if x[0] > x[-1]:
        x, z = x[::-1], z[:, ::-1]
    if y[0] > y[-1]:
        y, z = y[::-1], z[::-1]
    vertices, faces = _closed_mesh(x, y, z, policy.base_share)
    left_out = (("without a height", grid.gaps),) if grid.gaps else ()
    tally = Tally("cell", z.size, z.size - grid.gaps, left_out)
    return FloorReading(vertices, faces, tuple(notes), tally)


def _closed_mesh(
    x: Floats, y: Floats, z: Floats, base_share: float
) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return vertices and outward triangles of a floor of heights z (m, n), walls and bottom."""
    bottom = float(z.min()) - base_share * max(np.ptp(x), np.ptp(y))
    gx, gy = np.meshgrid(x, y)
    top = np.column_stack([gx.ravel(), gy.ravel(), z.ravel()])
    below = top.copy()
    below[:, 2] = bottom
    rows, columns = z.shape
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()
    up = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    rim = np.concatenate([at[0, :-1], at[:-1, -1], at[-1, :0:-1], at[:0:-1, 0]])
    after, n = np.roll(rim, -1), rows * columns
    first = np.column_stack([rim, rim + n, after + n])
    walls = np.vstack([first, np.column_stack([rim, after + n, after])])
    vertices = np.vstack([top, below])
    return vertices, np.vstack([up, up[:, ::-1] + n, walls]).astype(np.int64)


@dataclass(frozen=True)
class _Grid:
    """Grid of heights: centres x (n,) and y (m,) of the cells, in units of the map, and z (m, n).

    `metres` and `height_metres` are metres per unit of map and heights (None: those of the map).
    `counts_down` is the direction by the vertical system, `called_depth` the one by name. `gaps`
    counts cells without a value.
    """

    x: Floats
    y: Floats
    z: Floats
    metres: float = 1.0
    height_metres: float | None = None
    counts_down: bool = False
    called_depth: bool = False
    notes: tuple[str, ...] = ()
    gaps: int = 0


@dataclass(frozen=True)
class _Band:
    """Band of a grid: its number from 1, the name that states its contents, and their meaning."""

    number: int
    title: str
    meaning: Column | None


@dataclass(frozen=True)
class _Raster:
    """Band of a file with heights z (m, n), nan where it has none, and what the file states of it.

    `system` is the map's system as WKT, `transform` the geotransform, `factors` scale and offset of
    the values, `unit` that of the band, and `positive` the direction in which heights count.
    """

    z: Floats
    band: _Band
    others: list[_Band]
    system: str | None
    transform: Any
    dtype: np.dtype[Any]
    factors: tuple[float, float]
    unit: str | None
    driver: str
    positive: str


def _read_raster(path: str | Path, policy: FloorPolicy) -> _Raster:
    rasterio = _rasterio()
    if not Path(path).is_file():
        raise InputError(f"{path}: cannot be read: no such file")
    try:
        with warnings.catch_warnings():
            # a grid without a place on the map is refused below
            warnings.simplefilter("ignore")
            with _opened(rasterio, path) as grid:
                if grid.width * grid.height > policy.max_cells:
                    raise InputError(
                        f"{path}: {grid.width} x {grid.height} cells; expected at most "
                        f"{policy.max_cells:,} in all"
                    )
                band, others = _chosen_band(grid, path)
                at = band.number - 1
                return _Raster(
                    z=grid.read(band.number, masked=True).astype(float).filled(np.nan),
                    band=band,
                    others=others,
                    system=grid.crs.to_wkt() if grid.crs is not None else None,
                    transform=grid.transform,
                    dtype=np.dtype(grid.dtypes[at]),
                    factors=(grid.scales[at], grid.offsets[at]),
                    unit=grid.units[at],
                    driver=grid.driver,
                    positive={**grid.tags(), **grid.tags(band.number)}.get("positive", ""),
                )
    except InputError:
        raise
    except Exception as error:  # GDAL's readers raise many kinds of exceptions
        first = (str(error) or type(error).__name__).splitlines()[0][:120]
        raise InputError(f"{path}: cannot be read as a grid: {first}") from None


def _check_place(t: Any, path: str | Path) -> None:
    """Raise InputError unless a geotransform places a grid on the map with rows that run east."""
    if t.is_identity:
        raise InputError(
            f"{path}: the grid has no place on the map; add a geotransform "
            "(gdal_translate -a_ullr west north east south)"
        )
    if max(abs(t.b), abs(t.d)) > MAX_ROW_SLOPE * max(abs(t.a), abs(t.e)):
        raise InputError(f"{path}: the grid is turned; expected rows that run east")


def _read(path: str | Path, policy: FloorPolicy) -> _Grid:
    raster = _read_raster(path, policy)
    metres, axis = 1.0, None
    if raster.system is not None:
        try:
            horizontal, axis = map_unit(raster.system), height_axis(raster.system)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        if horizontal is None:
            raise InputError(f"{path}: in degrees; expected a grid in metres, such as UTM")
        metres = horizontal
    z, t, band = raster.z, raster.transform, raster.band
    _check_place(t, path)
    rows, columns = z.shape
    if rows < 2 or columns < 2:
        raise InputError(f"{path}: expected at least 2 x 2 cells, got {columns} x {rows}")
    notes = []
    if raster.others:
        names = ", ".join(b.title for b in raster.others if b.title)
        unused = counted(len(raster.others), "further band")
        notes.append(f"{unused} not used{f' ({names[:80]})' if names else ''}")
    z[~np.isfinite(z)] = np.nan
    z, gaps = _without_gaps(z, path, notes, _extremes(raster.dtype))
    factor, offset = raster.factors
    if (factor, offset) != (1.0, 0.0):
        z = z * factor + offset
        notes.append(f"values times {factor:.7g} plus {offset:.7g}, as its band says")
    heights = _unit_of_band(raster.unit, path)
    if heights is None and band.meaning is not None and band.meaning.unit:
        heights = abs(band.meaning.factor)
    if heights is None and axis is not None and axis.is_stated:
        heights = axis.metres
    down = axis is not None and axis.sign < 0.0 and raster.driver not in UPWARD_FORMATS
    down = down or raster.positive.strip().lower() == "down"
    called_depth = band.meaning is not None and band.meaning.factor < 0.0
    x, y = t.c + t.a * (np.arange(columns) + 0.5), t.f + t.e * (np.arange(rows) + 0.5)
    called_depth = called_depth and not raster.positive
    return _Grid(x, y, z, metres, heights, down, called_depth, tuple(notes), gaps)


@contextmanager
def _opened(rasterio: Any, path: str | Path) -> Iterator[Any]:
    """Open a grid, skipping a byte order mark; of several variables, open the one of heights."""
    with Path(path).open("rb") as file:
        has_mark = file.read(3) == b"\xef\xbb\xbf"
    if has_mark:
        text = read_bytes(path)[3:]
        with rasterio.io.MemoryFile(text, ext=Path(path).suffix) as memory, memory.open() as grid:
            yield grid
        return
    with rasterio.open(str(path)) as grid:
        if grid.count or not grid.subdatasets:
            yield grid
            return
        names = {sub: sub.rsplit(":", 1)[-1].strip("/") for sub in grid.subdatasets}
    chosen = [sub for sub, name in names.items() if height_meaning([name]) is not None]
    if len(chosen) != 1:
        raise InputError(
            f"{path}: several grids ({', '.join(names.values())[:80]}); expected exactly one "
            "named elevation, height or depth"
        )
    with rasterio.open(chosen[0]) as grid:
        yield grid


def _chosen_band(grid: Any, path: str | Path) -> tuple[_Band, list[_Band]]:
    """Return the first band whose name means heights, else the first band, and all others."""
    bands = []
    for number in range(1, grid.count + 1):
        tags = grid.tags(number)
        keys = ("standard_name", "long_name", "NETCDF_VARNAME")
        names = [grid.descriptions[number - 1], *(tags.get(key) for key in keys)]
        known = [str(name) for name in names if name]
        try:
            meaning = height_meaning(known)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        bands.append(_Band(number, known[0] if known else "", meaning))
    if not bands:
        raise InputError(f"{path}: expected a grid with a band, got none")
    chosen = next((b for b in bands if b.meaning is not None), bands[0])
    return chosen, [b for b in bands if b is not chosen]


def _extremes(kind: np.dtype[Any]) -> tuple[float, ...]:
    """Return the extreme values of an integer type, which often mark a missing height."""
    if kind.kind not in "iu":
        return ()
    ends = np.iinfo(kind)
    return (float(ends.max), float(ends.min)) if kind.kind == "i" else (float(ends.max),)


def _unit_of_band(unit: str | None, path: str | Path) -> float | None:
    """Return the metres per unit that a band states; None where it states none."""
    if not unit or not unit.strip():
        return None
    metres = metres_per_unit(unit)
    if metres is None:
        raise InputError(f"{path}: heights in {unit.strip()[:40]!r}; expected a unit of length")
    return metres


def _without_gaps(
    z: Floats, path: str | Path, notes: list[str], extremes: tuple[float, ...] = ()
) -> tuple[Floats, int]:
    """Return the values with gaps filled from the nearest cell, and the number of gaps."""
    for value, cells in marks_of_no_height(z, *extremes):
        z[cells] = np.nan
        notes.append(
            f"{counted(int(cells.sum()), 'cell')} of {value:.6g} taken as empty, although "
            "the grid does not call this value nodata"
        )
    missing = np.isnan(z)
    gaps = int(missing.sum())
    if missing.all():
        raise InputError(f"{path}: expected heights, got none")
    if not gaps:
        return z, 0
    from scipy.ndimage import distance_transform_edt

    notes.append(f"{counted(gaps, 'cell')} without a height take that of the nearest cell")
    nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return np.asarray(z[tuple(nearest)]), gaps


def _is_plain_table(path: str | Path) -> bool:
    """Return whether an ASC file is a table of points instead of ESRI's grid."""
    if Path(path).suffix.lower() != ".asc" or not Path(path).is_file():
        return False
    with Path(path).open("rb") as file:
        words = file.read(64).removeprefix(b"\xef\xbb\xbf").lower().split()
    return bool(words) and words[0].decode("latin-1") not in (*_ESRI_WORDS, "dx", "dy", "cellsize")


def _grid_of_table(path: str | Path, policy: FloorPolicy) -> _Grid:
    """Read a table with a row for each cell, in any order; cells without a row are gaps."""
    if not Path(path).is_file():
        raise InputError(f"{path}: cannot be read: no such file")
    cloud = read_text_cloud(path)
    x, columns = _steps(cloud.points[:, 0], path, policy.max_cells)
    y, rows = _steps(cloud.points[:, 1], path, policy.max_cells)
    if len(x) * len(y) > policy.max_cells:
        raise InputError(
            f"{path}: {len(x)} x {len(y)} cells; expected at most {policy.max_cells:,} in all"
        )
    places = rows * len(x) + columns
    if len(np.unique(places)) != len(places):
        raise InputError(f"{path}: two rows for one cell; expected one height for each")
    z = np.full(len(x) * len(y), np.nan)
    # values as the table states them: `read_floor` turns depths
    z[places] = -cloud.points[:, 2] if cloud.names_depths else cloud.points[:, 2]
    notes = list(cloud.notes)
    filled, gaps = _without_gaps(z.reshape(len(y), len(x)), path, notes)
    return _Grid(x, y, filled, called_depth=cloud.names_depths, notes=tuple(notes), gaps=gaps)


def _steps(
    values: Floats, path: str | Path, max_cells: int
) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return the equally spaced coordinates along an axis, and the index of each value."""
    known, places = np.unique(values, return_inverse=True)
    if len(known) < 2:
        raise InputError(f"{path}: expected at least 2 x 2 cells")
    apart = np.diff(known)
    numbers = np.concatenate([[0.0], np.cumsum(np.round(apart / apart.min()))])
    step = (known[-1] - known[0]) / numbers[-1]
    if numbers[-1] >= max_cells or (
        np.abs(known - known[0] - step * numbers).max() > MAX_STEP_SHIFT * step
    ):
        raise InputError(
            f"{path}: its points lie on no grid of equal steps; give a regular grid, or use the "
            "file as the cloud of a scene"
        )
    steps = known[0] + step * np.arange(numbers[-1] + 1.0)
    return steps, numbers[places.ravel()].astype(np.int64)


def _rasterio() -> Any:
    try:
        import rasterio
    except ImportError:
        raise InputError("bathymetry grids need rasterio: pip install 'netsp[geo]'") from None
    return rasterio

"""A sea floor from a bathymetry grid: GeoTIFF, ASC and whatever else rasterio reads."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.arrays import Floats
from netsp.axes import height_axis, map_unit, metres_per_unit
from netsp.errors import InputError, counted

MOST_POINTS = 4_000_000
"""Of a grid; it becomes twice as many triangles."""

SHARE = 0.05
"""Thickness of the floor below its deepest point, as a share of its longer side."""


CUSTOMARY_NODATA = (-9999.0, -99999.0, -32768.0, -32767.0, -999999.0)
"""Values that customarily stand for no height. Where a grid does not say so they are taken as such
if they lie farther from all other values than those lie apart."""

MAX_HEIGHT = 1e30  # metres; larger values are the largest numbers of a data type, not heights

_DEPTH_WORDS = ("depth", "bathymetry depth", "water depth", "tiefe")


def floor_mesh(
    path: str | Path, *, scale: float = 1.0, origin: tuple[float, float] = (0.0, 0.0),
    depths: bool = False,
) -> tuple[Floats, npt.NDArray[np.int64]]:  # fmt: skip
    """The floor as a closed mesh, as of `load_floor` without its notes."""
    vertices, faces, _ = load_floor(path, scale=scale, origin=origin, depths=depths)
    return vertices, faces


def load_floor(
    path: str | Path, *, scale: float = 1.0, origin: tuple[float, float] = (0.0, 0.0),
    depths: bool = False,
) -> tuple[Floats, npt.NDArray[np.int64], tuple[str, ...]]:  # fmt: skip
    """Read a sea floor as a closed mesh: heights at the middles of the grid's cells joined by
    triangles, walls, and a flat bottom.

    Heights are the grid's values times the scale of its band plus its offset, in the unit of the
    band, else of its vertical system, else of its map. Cells without a value take that of the
    nearest cell that has one.

    Parameters
    ----------
    path : str or Path
        The grid, with its place on the map.
    scale : float
        Metres per unit of map and heights, of a grid that states no unit.
    origin : (x, y)
        What becomes (0, 0), in units of the map.
    depths : bool
        Whether values count downwards, where the grid's vertical system does not say so.

    Returns
    -------
    vertices : ndarray, shape (n, 3)
        Metres, z up.
    faces : ndarray, shape (m, 3)
        Outward triangles.
    notes : tuple of str
        What was converted, and cells without a height, one line each.

    Raises
    ------
    InputError
        Not readable, no values, in degrees, too many cells, or rasterio is not installed.
    """
    grid = _read(path)
    if scale != 1.0 and (grid.metres != 1.0 or grid.height_metres not in (None, 1.0)):
        raise InputError(
            f"{path}: scale: the grid states its unit and is read in metres; expected no scale, "
            f"got {scale:g}"
        )
    notes = list(grid.notes)
    sign = -1.0 if depths or grid.counts_down else 1.0
    if grid.counts_down and not depths:
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
    bottom = float(z.min()) - SHARE * max(np.ptp(x), np.ptp(y))
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
    walls = np.vstack([
        np.column_stack([rim, rim + n, after + n]), np.column_stack([rim, after + n, after]),
    ])  # fmt: skip
    vertices = np.vstack([top, below])
    return vertices, np.vstack([up, up[:, ::-1] + n, walls]).astype(np.int64), tuple(notes)


@dataclass(frozen=True)
class _Grid:
    """Middles x (n,), y (m,) of the cells, units of the map, and finite values z (m, n)."""

    x: Floats
    y: Floats
    z: Floats
    metres: float = 1.0
    height_metres: float | None = None
    counts_down: bool = False
    notes: tuple[str, ...] = ()


def _read(path: str | Path) -> _Grid:
    rasterio = _rasterio()
    if not Path(path).is_file():
        raise InputError(f"{path}: cannot be read: no such file")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of files without a place on the map: told below
            with rasterio.open(str(path)) as grid:
                if grid.width * grid.height > MOST_POINTS:
                    raise InputError(
                        f"{path}: {grid.width} x {grid.height} cells; expected at most "
                        f"{MOST_POINTS:,} in all"
                    )
                bands, system = grid.count, grid.crs.to_wkt() if grid.crs is not None else None
                t = grid.transform
                z = grid.read(1, masked=True).astype(float).filled(np.nan)
                band = grid.scales[0], grid.offsets[0]
                unit, said = grid.units[0], grid.descriptions[0]
    except InputError:
        raise
    except Exception as error:  # GDAL's many readers raise what they like
        first = (str(error) or type(error).__name__).splitlines()[0][:120]
        raise InputError(f"{path}: cannot be read as a grid: {first}") from None
    metres, axis = 1.0, None
    if system is not None:
        horizontal, axis = map_unit(system), height_axis(system)
        if horizontal is None:
            raise InputError(f"{path}: in degrees; expected a grid in metres, such as UTM")
        metres = horizontal
    if t.b or t.d:
        raise InputError(f"{path}: the grid is turned; expected rows that run east")
    rows, columns = z.shape
    if rows < 2 or columns < 2:
        raise InputError(f"{path}: expected at least 2 x 2 cells, got {columns} x {rows}")
    notes = [f"{counted(bands - 1, 'further band')} not used"] if bands > 1 else []
    z[~np.isfinite(z)] = np.nan
    z = _without_nodata(z, path, notes)
    if band != (1.0, 0.0):
        z = z * band[0] + band[1]
        notes.append(f"values times {band[0]:.7g} plus {band[1]:.7g}, as its band says")
    heights = _unit_of_band(unit, path)
    if heights is None and axis is not None and axis.is_stated:
        heights = axis.metres
    down = axis is not None and axis.sign < 0.0
    if said and said.strip().lower() in _DEPTH_WORDS and not down and np.nanmax(z) > 0.0:
        notes.append(f"its band is called {said!r}: set depths to true if values count downwards")
    x, y = t.c + t.a * (np.arange(columns) + 0.5), t.f + t.e * (np.arange(rows) + 0.5)
    return _Grid(x, y, z, metres, heights, down, tuple(notes))


def _unit_of_band(unit: str | None, path: str | Path) -> float | None:
    """Return the metres per unit that a band states; None where it states none."""
    if not unit or not unit.strip():
        return None
    metres = metres_per_unit(unit)
    if metres is None:
        raise InputError(f"{path}: heights in {unit.strip()[:40]!r}; expected a unit of length")
    return metres


def _without_nodata(z: Floats, path: str | Path, notes: list[str]) -> Floats:
    """Return the values with gaps filled from the nearest cell, and note how many there are."""
    for value in np.unique(z[np.isin(z, CUSTOMARY_NODATA) | (np.abs(z) > MAX_HEIGHT)]):
        cells = z == value
        others = z[~cells & ~np.isnan(z) & (np.abs(z) <= MAX_HEIGHT)]
        others = others[~np.isin(others, CUSTOMARY_NODATA)]
        apart = np.abs(others - value).min() if len(others) else np.inf
        if abs(value) <= MAX_HEIGHT and apart <= (np.ptp(others) if len(others) else 0.0):
            continue  # a height among others
        z[cells] = np.nan
        notes.append(
            f"{counted(int(cells.sum()), 'cell')} of {value:.6g} taken as empty, although "
            "the grid does not call this value nodata"
        )
    missing = np.isnan(z)
    if missing.all():
        raise InputError(f"{path}: expected heights, got none")
    if not missing.any():
        return z
    from scipy.ndimage import distance_transform_edt

    notes.append(
        f"{counted(int(missing.sum()), 'cell')} without a height take that of the nearest cell"
    )
    nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return np.asarray(z[tuple(nearest)])


def _rasterio() -> Any:
    try:
        import rasterio
    except ImportError:
        raise InputError("bathymetry grids need rasterio: pip install 'netsp[geo]'") from None
    return rasterio

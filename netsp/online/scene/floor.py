"""A sea floor from a bathymetry grid: GeoTIFF, ASC and whatever else rasterio reads."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.arrays import Floats
from netsp.errors import InputError

MOST_POINTS = 4_000_000
"""Of a grid; it becomes twice as many triangles."""

SHARE = 0.05
"""Thickness of the floor below its deepest point, as a share of its longer side."""


def floor_mesh(
    path: str | Path, *, scale: float = 1.0, origin: tuple[float, float] = (0.0, 0.0),
    depths: bool = False,
) -> tuple[Floats, npt.NDArray[np.int64]]:  # fmt: skip
    """The floor as a closed mesh: heights at the middles of the grid's cells joined by triangles,
    walls, and a flat bottom.

    Cells without a value take that of the nearest cell that has one.

    Parameters
    ----------
    path : str or Path
        The grid, with its place on the map.
    scale : float
        Metres per unit of map and heights.
    origin : (x, y)
        What becomes (0, 0), in units of the map.
    depths : bool
        Whether values count downwards.

    Returns
    -------
    vertices : ndarray, shape (n, 3)
        Metres, z up.
    faces : ndarray, shape (m, 3)
        Outward triangles.

    Raises
    ------
    InputError
        Not readable, no values, in degrees, too many cells, or rasterio is not installed.
    """
    x, y, z = _read(path)
    if depths:
        z = -z
    x, y, z = (x - origin[0]) * scale, (y - origin[1]) * scale, z * scale
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
    return np.vstack([top, below]), np.vstack([up, up[:, ::-1] + n, walls]).astype(np.int64)


def _read(path: str | Path) -> tuple[Floats, Floats, Floats]:
    """x (n,), y (m,) of the cells' middles and values (m, n), all finite."""
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
                degrees = grid.crs is not None and grid.crs.is_geographic
                t = grid.transform
                z = grid.read(1, masked=True).astype(float).filled(np.nan)
    except InputError:
        raise
    except Exception as error:  # GDAL's many readers raise what they like
        first = (str(error) or type(error).__name__).splitlines()[0][:120]
        raise InputError(f"{path}: cannot be read as a grid: {first}") from None
    if degrees:
        raise InputError(f"{path}: in degrees; expected a grid in metres, such as UTM")
    if t.b or t.d:
        raise InputError(f"{path}: the grid is turned; expected rows that run east")
    rows, columns = z.shape
    if rows < 2 or columns < 2:
        raise InputError(f"{path}: expected at least 2 x 2 cells, got {columns} x {rows}")
    z[~np.isfinite(z)] = np.nan
    missing = np.isnan(z)
    if missing.all():
        raise InputError(f"{path}: expected heights, got none")
    if missing.any():
        from scipy.ndimage import distance_transform_edt

        nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
        z = z[tuple(nearest)]
    x, y = t.c + t.a * (np.arange(columns) + 0.5), t.f + t.e * (np.arange(rows) + 0.5)
    return x, y, z


def _rasterio() -> Any:
    try:
        import rasterio
    except ImportError:
        raise InputError("bathymetry grids need rasterio: pip install 'netsp[geo]'") from None
    return rasterio

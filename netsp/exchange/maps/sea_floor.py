"""Sea floor of a chart: depth areas, contours and soundings as a grid of heights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.base.errors import InputError
from netsp.base.files import write_text
from netsp.base.validated import shown
from netsp.exchange.maps.import_policy import DEFAULT_READ, ReadPolicy

if TYPE_CHECKING:
    import shapely

SUFFIXES = (".asc", ".tif", ".tiff")
"""Formats that a sea floor is written in: ESRI's text grid, and GeoTIFF."""

NO_HEIGHT = -9999.0
"""Sentinel for the height of cells whose depth the chart does not give."""


@dataclass(frozen=True)
class DepthArea:
    """Area of a chart with a range of depths, in the problem's plane.

    Attributes
    ----------
    min_depth, max_depth
        Depths, metres downwards; None if the chart does not give them.
    """

    shape: shapely.Geometry
    min_depth: float | None
    max_depth: float | None


@dataclass(frozen=True)
class Danger:
    """Rock, wreck or obstruction with the depth of its top, in the problem's plane.

    Attributes
    ----------
    depth
        Depth of its top, metres downwards; negative if it dries.
    """

    shape: shapely.Geometry
    depth: float


@dataclass(frozen=True)
class SeaFloor:
    """Grid of heights below the chart's datum.

    Attributes
    ----------
    west, south
        Corner of the grid in the problem's plane, metres.
    cell
        Side of a cell, metres.
    heights
        Heights z, the northernmost row first; NaN where the chart gives none.
    """

    west: float
    south: float
    cell: float
    heights: Floats

    def save(self, file: str | Path) -> None:
        """Write the grid to a file that a scene takes as its floor.

        Raises
        ------
        InputError
            The file's extension is none of `SUFFIXES`, or it cannot be written.
        """
        check_suffix(file)
        filled = np.where(np.isfinite(self.heights), self.heights, NO_HEIGHT)
        rows, columns = filled.shape
        if Path(file).suffix.lower() == ".asc":
            head = (
                f"ncols {columns}\nnrows {rows}\nxllcorner {self.west:.6f}\n"
                f"yllcorner {self.south:.6f}\ncellsize {self.cell:.9g}\n"
                f"NODATA_value {NO_HEIGHT:g}\n"
            )
            lines = (" ".join(f"{v:.3f}" for v in row) for row in filled)
            write_text(file, head + "\n".join(lines) + "\n")
            return
        _save_geotiff(file, filled, (self.west, self.south + rows * self.cell), self.cell)


def check_suffix(file: str | Path) -> None:
    """Raise InputError unless the name of a file ends like a sea floor's (`SUFFIXES`)."""
    if Path(file).suffix.lower() not in SUFFIXES:
        raise InputError(
            f"floor: expected a name that ends in {', '.join(SUFFIXES)}, got {shown(str(file))}"
        )


def sea_floor(
    areas: Sequence[DepthArea],
    contours: Floats,
    land: Sequence[shapely.Geometry],
    box: tuple[float, float, float, float],
    cell: float,
    *,
    soundings: Floats | None = None,
    dangers: Sequence[Danger] = (),
    policy: ReadPolicy = DEFAULT_READ,
) -> SeaFloor:
    """Return the sea floor that a chart's depths give.

    Depths are interpolated between soundings and contours, and kept within the range of depths of
    the area around them, the shallower where areas overlap. Beyond all soundings and contours an
    area has its least depth. Land is at the datum.

    The floor is never deeper than a sounding or the top of a danger, also between the centres of
    cells, where a scene interpolates. A sounding shallower than its area raises the floor up to the
    neighbouring soundings and contours.

    Parameters
    ----------
    contours : ndarray, shape (k, 3)
        Corners of contours: x, y and depth downwards.
    box : (xmin, ymin, xmax, ymax)
        Extent that the grid must hold.
    cell : float
        Side of a cell, metres.
    soundings : ndarray, shape (k, 3), optional
        x, y and depth downwards.

    Raises
    ------
    InputError
        The grid would be too large, or the chart gives no depth within the box.
    """
    west, south, east, north = box
    columns, rows = (max(2, int(np.ceil(span / cell))) for span in (east - west, north - south))
    if max(columns, rows) > policy.max_floor_cells:
        raise InputError(
            f"floor: {columns} x {rows} cells of {cell:g} m; expected at most "
            f"{policy.max_floor_cells} along a side, so larger cells"
        )
    spots = np.empty((0, 3)) if soundings is None else soundings
    x: Floats = west + cell * np.arange(0.5, columns)
    y: Floats = south + cell * np.arange(0.5, rows)
    min_depth, max_depth, has_area = _depth_ranges(areas, x, y)
    between, by_shoal = _interpolated(contours, spots, _is_shoal(spots, areas), x, y)
    # beyond all soundings: the least depth
    depth = np.where(np.isfinite(between), between, min_depth)
    depth = np.minimum(np.maximum(depth, min_depth), np.maximum(max_depth, min_depth))
    depth[by_shoal] = np.minimum(depth, between)[by_shoal]
    depth[~has_area] = np.nan
    for shape in land:
        depth[_covered(shape, x, y)] = 0.0
    depth[~np.isfinite(depth)] = np.nan
    _cap(depth, spots, (west, south), cell)
    for danger in dangers:
        _cap_danger(depth, danger, x, y, (west, south), cell)
    if np.isnan(depth).all():
        raise InputError("floor: the chart gives no depth within the tether's reach")
    return SeaFloor(west, south, cell, 0.0 - depth[::-1])


def _depth_ranges(areas: Sequence[DepthArea], x: Floats, y: Floats) -> tuple[Floats, Floats, Bools]:
    """Return the minimum and maximum depth at each cell by the areas around it, and whether there
    are any."""
    min_depth = np.full((len(y), len(x)), -np.inf)
    max_depth = np.full((len(y), len(x)), np.inf)
    has_area = np.zeros((len(y), len(x)), dtype=bool)
    for area in areas:
        inside = _covered(area.shape, x, y)
        low = area.min_depth if area.min_depth is not None else -np.inf
        high = area.max_depth if area.max_depth is not None else np.inf
        max_depth[inside] = np.minimum(max_depth[inside], high)
        first = inside & ~has_area
        min_depth[first] = low
        both = inside & has_area
        min_depth[both] = np.minimum(min_depth[both], low)
        has_area |= inside
    return min_depth, max_depth, has_area


def _is_shoal(soundings: Floats, areas: Sequence[DepthArea]) -> np.ndarray:
    """Return a mask of soundings shallower than the least depth of every area around them."""
    import shapely

    min_depth = np.full(len(soundings), np.inf)
    tree = shapely.STRtree([area.shape for area in areas])
    spots = shapely.points(soundings[:, :2])
    for spot, area in tree.query(spots, predicate="intersects").T.tolist():
        low = areas[area].min_depth
        min_depth[spot] = min(min_depth[spot], -np.inf if low is None else low)
    return np.asarray(np.isfinite(min_depth) & (soundings[:, 2] < min_depth))


def _cap(depth: Floats, soundings: Floats, corner: tuple[float, float], cell: float) -> None:
    """Keep the floor above soundings: each limits the depth of the four cells around it."""
    rows, columns = depth.shape
    left, low = (np.floor((soundings[:, k] - corner[k]) / cell - 0.5).astype(int) for k in (0, 1))
    for row, column in ((low, left), (low, left + 1), (low + 1, left), (low + 1, left + 1)):
        held = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        np.fmin.at(depth, (row[held], column[held]), soundings[held, 2])


def _cap_danger(
    depth: Floats, danger: Danger, x: Floats, y: Floats, corner: tuple[float, float], cell: float
) -> None:
    """Keep the floor above the top of a danger, wherever it lies."""
    import shapely

    if "Point" in danger.shape.geom_type:
        places = shapely.get_coordinates(danger.shape)
        _cap(depth, np.column_stack([places, np.full(len(places), danger.depth)]), corner, cell)
        return
    # centres of the cells around a point are at most a diagonal (1.42 cells) away
    held = _covered(danger.shape.buffer(1.5 * cell), x, y)
    depth[held] = np.fmin(depth[held], danger.depth)


def _covered(shape: shapely.Geometry, x: Floats, y: Floats) -> np.ndarray:
    """Return a mask of the cells whose centres lie in a shape."""
    import shapely

    low_x, low_y, high_x, high_y = shape.bounds
    columns = np.flatnonzero((x >= low_x) & (x <= high_x))
    rows = np.flatnonzero((y >= low_y) & (y <= high_y))
    inside = np.zeros((len(y), len(x)), dtype=bool)
    if len(columns) and len(rows):
        shapely.prepare(shape)
        block = np.ix_(rows, columns)
        gx, gy = np.meshgrid(x[columns], y[rows])
        inside[block] = shapely.contains_xy(shape, gx, gy)
    return inside


def _interpolated(
    contours: Floats, soundings: Floats, is_shoal: np.ndarray, x: Floats, y: Floats
) -> tuple[Floats, np.ndarray]:
    """Return depths interpolated linearly (NaN outside), and a mask of cells that use a shoal."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import Delaunay, QhullError

    points = np.vstack([contours, soundings])
    marks = np.concatenate([np.zeros(len(contours), dtype=bool), is_shoal])
    order = np.lexsort((points[:, 2], points[:, 1], points[:, 0]))
    points, marks = points[order], marks[order]
    # of several depths at one place, the least
    is_first = np.any(np.diff(points[:, :2], axis=0, prepend=np.nan) != 0.0, axis=1)
    known, marks = points[is_first], marks[is_first]
    none = np.full((len(y), len(x)), np.nan)
    if len(known) < 3:
        return none, np.isfinite(none)
    try:
        triangles = Delaunay(known[:, :2])
    except QhullError:  # all points on one line
        return none, np.isfinite(none)
    gx, gy = np.meshgrid(x, y)
    depths = np.asarray(LinearNDInterpolator(triangles, known[:, 2])(gx, gy), dtype=float)
    triangle_of_cell = triangles.find_simplex(np.stack([gx, gy], axis=-1))
    is_inside = (triangle_of_cell >= 0) & np.isfinite(depths)
    by_shoal = marks[triangles.simplices].any(axis=1)[triangle_of_cell] & is_inside
    return depths, by_shoal


def _save_geotiff(
    file: str | Path, heights: Floats, corner: tuple[float, float], cell: float
) -> None:
    import warnings

    try:
        import rasterio
        from rasterio.transform import from_origin
    except ImportError:
        raise InputError("GeoTIFF needs rasterio: pip install 'netsp[geo]'") from None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # rasterio warns of a plane without a place on the earth
        try:
            with rasterio.open(
                str(file),
                "w",
                driver="GTiff",
                height=heights.shape[0],
                width=heights.shape[1],
                count=1,
                dtype="float32",
                nodata=NO_HEIGHT,
                transform=from_origin(corner[0], corner[1], cell, cell),
                compress="deflate",
            ) as grid:
                grid.write(heights.astype("float32"), 1)
        except Exception as error:
            raise InputError(f"{file}: cannot be written: {str(error)[:120]}") from None

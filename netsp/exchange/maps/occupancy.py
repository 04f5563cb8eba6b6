"""Reader of occupancy images as ROS's map server writes them: a picture of cells, and a YAML file.

A pixel's value v becomes the probability p = (255 - v) / 255 that its cell is occupied (v / 255 if
`negate`). Above `occupied_thresh` it is occupied, below `free_thresh` free, and between them
unknown. In the mode "trinary" an alpha channel is averaged in like a colour; in the mode "scale" a
cell that is not opaque is unknown (docs.ros.org, nav2_map_server, `MapMode`).
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError

from netsp.base.arrays import Bools, Floats
from netsp.base.errors import InputError, counted
from netsp.base.field_types import Number, Positive
from netsp.base.files import check_file, read_text
from netsp.base.validated import Model, explain, shown
from netsp.exchange.maps.drawn_shapes import simple_polygons
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
from netsp.model.problem import Problem

if TYPE_CHECKING:
    import shapely

IMAGES = (".png", ".pgm")
FILES = (".yaml", ".yml")

MODES = ("1", "L", "LA", "P", "RGB", "RGBA", "I", "I;16", "I;16B", "I;16L")
"""Modes of Pillow whose values are known to run from black to white."""


class MapFile(Model):
    """YAML file of a map; other fields are ignored."""

    image: Annotated[str, Field(description="file of the image, beside this file")]
    resolution: Annotated[Positive, Field(description="size of a cell, m")]
    origin: Annotated[
        tuple[Number, Number, Number],
        Field(description="x, y (m) of the lower left corner, and its rotation (radians)"),
    ] = (0.0, 0.0, 0.0)
    mode: Annotated[
        Literal["trinary", "scale"], Field(description="meaning of values and of transparency")
    ] = "trinary"
    negate: Annotated[Literal[0, 1], Field(description="whether white is occupied")] = 0
    occupied_thresh: Annotated[
        Number, Field(description="probability from which a cell is occupied", ge=0, le=1)
    ] = 0.65
    free_thresh: Annotated[
        Number, Field(description="probability up to which it is free", ge=0, le=1)
    ] = 0.196


def read_occupancy(
    file: str | Path,
    base: Sequence[float],
    goals: Sequence[Any],
    tether: float,
    *,
    clearance: float = 0.0,
    resolution: float | None = None,
    tolerance: float | None = None,
    unknown_is_free: bool = False,
    name: str | None = None,
    on_note: Callable[[str], None] | None = None,
    policy: ImportPolicy = DEFAULT_IMPORT,
) -> Problem:
    """Return the problem of an occupancy image, in metres of the map's own coordinates.

    Obstacles are simple polygons, and the bounds are the edge of the image.

    Parameters
    ----------
    file : str or Path
        YAML file of the map, or its image (PNG, PGM) with a resolution.
    goals : sequence
        Goals as in a problem.
    resolution : float, optional
        Size of a cell, metres, for an image alone; its lower left corner is then (0, 0).
    tolerance : float, optional
        Largest distance by which obstacles reach beyond occupied cells, metres; default: one cell.
    unknown_is_free : bool
        Whether unknown cells are free; by default they are obstacles.
    name : str, optional
        Name of the problem; default: the file's.
    on_note : callable, optional
        Called with assumptions, one line each.

    Raises
    ------
    InputError
        The image cannot be read, is too large, or gives no valid problem.
    """
    map_file, image = _opened(file, resolution)
    cell = map_file.resolution
    slack = cell if tolerance is None else tolerance
    if not slack >= 0.1 * cell:
        raise InputError(
            f"--tolerance: expected at least a tenth of the cell of {cell:g} m, got {slack:g}"
        )
    values, alpha = _values(image, policy.read.max_image_cells)
    note = on_note or (lambda text: None)
    occupied = _occupied(values, alpha, map_file, note, unknown_is_free=unknown_is_free)
    points = [base, *(_place(g) for g in goals)]
    polygons, cell_notes = _polygons(occupied, map_file, slack, points, policy)
    for text in cell_notes:
        note(f"{map_file.image}: {text}")
    try:
        return Problem.model_validate(
            {
                "name": name or Path(file).stem,
                "base": tuple(base),
                "goals": list(goals),
                "tether_length": tether,
                "clearance": clearance,
                "units": "m",
                "obstacles": [
                    {"polygon": _corners(p), "name": f"W{k}"} for k, p in enumerate(polygons, 1)
                ],
                "bounds": _bounds(map_file, values.shape),
            }
        )
    except ValidationError as error:
        raise InputError(f"{file}: {explain(error)}") from None


def _occupied(
    values: Floats,
    alpha: Floats | None,
    map_file: MapFile,
    note: Callable[[str], None],
    *,
    unknown_is_free: bool,
) -> Bools:
    """Return a mask of the cells that are obstacles, and note assumptions."""
    occupied, unknown = _kinds(values, alpha, map_file)
    if alpha is not None:
        clear = counted(int((alpha < 255.0).sum()), "cell")
        note(
            f"{clear} not opaque: unknown, as map_server reads the mode scale"
            if map_file.mode == "scale"
            else f"its alpha channel is averaged in, as map_server reads the mode trinary; {clear} "
            "not opaque"
        )
    if not unknown.any():
        return occupied
    kind = "free" if unknown_is_free else "obstacles"
    note(f"{counted(int(unknown.sum()), 'cell')} that the map does not know: taken as {kind}")
    return occupied if unknown_is_free else occupied | unknown


def _bounds(map_file: MapFile, shape: tuple[int, ...]) -> list[Any]:
    """Return the edge of an image: two corners of a box, or four of a turned one."""
    rows, columns = shape
    corners = [(0.0, 0.0), (columns, 0.0), (columns, rows), (0.0, rows)]
    outline = [_apply(_placing(map_file, 0), c, r) for c, r in corners]
    return [*outline[0], *outline[2]] if map_file.origin[2] == 0.0 else outline


def _place(goal: Any) -> Any:
    return goal.get("position") if isinstance(goal, dict) else getattr(goal, "position", goal)


def _opened(file: str | Path, resolution: float | None) -> tuple[MapFile, Path]:
    """Return the fields of the map's YAML file, and the path of its image."""
    path = Path(file)
    if path.suffix.lower() in IMAGES:
        if resolution is None:
            raise InputError(f"{file}: an image alone; expected --resolution (m) or its YAML file")
        return MapFile(image=path.name, resolution=resolution), path
    if resolution is not None:
        raise InputError(f"--resolution: {file} has one; expected it with an image alone")
    try:
        import yaml
    except ImportError:
        raise InputError("maps in YAML need PyYAML: pip install 'netsp[geo]'") from None
    try:
        # all scalars as text, because other fields do not matter and 5e-2 is a number
        data = yaml.load(read_text(path), Loader=yaml.BaseLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{file}: not YAML: {reason[:200]}") from None
    if not isinstance(data, dict):
        raise InputError(f"{file}: expected image, resolution, origin, … as fields")
    if data.get("mode", "trinary") not in ("trinary", "scale", "raw"):
        raise InputError(f"{file}: mode: expected trinary or scale, got {shown(data['mode'])}")
    if data.get("mode") == "raw":
        raise InputError(f"{file}: mode: expected trinary or scale, got 'raw'")
    fields = {
        k: v if k in ("image", "mode") else _numbers(v)
        for k, v in data.items()
        if k in MapFile.model_fields
    }
    try:
        map_file = MapFile.model_validate(fields)
    except ValidationError as error:
        raise InputError(f"{file}: {explain(error)}") from None
    if not map_file.free_thresh < map_file.occupied_thresh:
        raise InputError(
            f"{file}: free_thresh: expected less than occupied_thresh "
            f"{map_file.occupied_thresh:g}, got {map_file.free_thresh:g}"
        )
    return map_file, path.parent / map_file.image


def _numbers(value: Any) -> Any:
    """Return texts as numbers if they are, and yes and no as 1 and 0."""
    if isinstance(value, list):
        return [_numbers(v) for v in value]
    if isinstance(value, str) and value.lower() in ("true", "false", "yes", "no"):
        return int(value.lower() in ("true", "yes"))
    try:
        number = float(value)
    except (TypeError, ValueError):
        return value
    return int(number) if number in (0.0, 1.0) else number


def _rasterio() -> Any:
    try:
        import rasterio
        import rasterio.features
    except ImportError:
        raise InputError("occupancy images need rasterio: pip install 'netsp[geo]'") from None
    return rasterio


def _values(image: Path, max_cells: int) -> tuple[Floats, Floats | None]:
    """Return the means of the colours, and how opaque each cell is (None if all are).

    Both have shape (rows, columns), from 0 (black, transparent) to 255, the first row at the top.
    """
    check_file(image)
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(image, formats=("PNG", "PPM")) as opened:
                columns, rows = opened.size
                if columns * rows > max_cells:
                    raise InputError(
                        f"{image}: {columns} x {rows} cells; expected at most {max_cells:g} in all"
                    )
                if opened.mode not in MODES:
                    raise InputError(
                        f"{image}: pixels of kind {opened.mode!r}; expected grey or colours of 8 "
                        "or 16 bits"
                    )
                if "transparency" in opened.info and opened.mode in ("1", "L", "P", "RGB"):
                    values = np.asarray(opened.convert("RGBA"))
                elif opened.mode == "P":
                    values = np.asarray(opened.convert("RGB"))
                else:
                    values = np.asarray(opened)
    except (UnidentifiedImageError, Image.DecompressionBombError):
        raise InputError(f"{image}: not an image; expected PNG or PGM") from None
    except (OSError, ValueError, SyntaxError) as error:
        raise InputError(f"{image}: not a whole image: {shown(str(error))}") from None
    if values.dtype == bool:
        return np.where(values, 255.0, 0.0), None
    # Pillow opens images of 16 bits as integers of 32
    largest = 255.0 if values.dtype == np.uint8 else 65535.0
    alpha = None
    if values.ndim == 3:  # the last of two or four channels is alpha
        if values.shape[2] in (2, 4):
            alpha = values[:, :, -1].astype(float)
        values = values[:, :, : 3 if values.shape[2] >= 3 else 1].mean(axis=2)
    return np.asarray(values * (255.0 / largest)), alpha


def _kinds(values: Floats, alpha: Floats | None, map_file: MapFile) -> tuple[Bools, Bools]:
    """Return which cells are occupied, and which unknown."""
    if alpha is not None and map_file.mode == "trinary":
        values = (3.0 * values + alpha) / 4.0  # grey stands for three equal colours
    p = values / 255.0 if map_file.negate else 1.0 - values / 255.0
    occupied = p > map_file.occupied_thresh
    unknown = ~occupied & (p >= map_file.free_thresh)
    if alpha is not None and map_file.mode == "scale":
        clear = alpha < 255.0
        occupied, unknown = occupied & ~clear, unknown | clear
    return occupied, unknown


def _placing(map_file: MapFile, rows: int) -> tuple[float, ...]:
    """Return the affine map (a, b, c, d, e, f): x = a column + b row + c, y = d column + e row + f.

    Rows count upwards from the lower left corner; if their number is given, downwards from the top.
    """
    size, (x, y, turn) = map_file.resolution, map_file.origin
    right = size * np.array([math.cos(turn), math.sin(turn)])
    up = size * np.array([-math.sin(turn), math.cos(turn)])
    if not rows:
        return (right[0], up[0], x, right[1], up[1], y)
    top = np.array([x, y]) + rows * up
    return (right[0], -up[0], top[0], right[1], -up[1], top[1])


def _apply(m: tuple[float, ...], column: float, row: float) -> tuple[float, float]:
    return (float(m[0] * column + m[1] * row + m[2]), float(m[3] * column + m[4] * row + m[5]))


def _polygons(
    occupied: Bools,
    map_file: MapFile,
    tolerance: float,
    points: Sequence[Any],
    policy: ImportPolicy,
) -> tuple[list[shapely.Polygon], list[str]]:
    """Return simple polygons around the occupied cells, and notes on them."""
    import shapely

    rasterio = _rasterio()
    cells = [
        shapely.geometry.shape(shape)
        for shape, _ in rasterio.features.shapes(
            occupied.astype(np.uint8),
            mask=occupied,
            connectivity=4,
            transform=rasterio.Affine(*_placing(map_file, len(occupied))),
        )
    ]
    if not cells:
        return [], []
    max_pieces = policy.read.max_image_pieces
    if len(cells) > max_pieces:
        raise InputError(
            f"{map_file.image}: {len(cells):,} separate pieces of obstacles; expected at most "
            f"{max_pieces:,}: a map without noise"
        )
    exact = shapely.union_all(cells)
    grown = exact.buffer(policy.outlines.growth * tolerance, quad_segs=4)
    parts = list(getattr(grown, "geoms", [grown]))
    tree = shapely.STRtree(cells)
    shares = policy.outlines.simplifications
    outlines = shapely.union_all(
        [
            _simplified(
                part,
                shapely.union_all([cells[k] for k in tree.query(part, "intersects")]),
                tolerance,
                shares,
            )
            for part in parts
        ]
    )
    free = [shapely.Point(float(p[0]), float(p[1])) for p in points]
    return simple_polygons(outlines, lambda hole: any(hole.contains(p) for p in free))


def _simplified(
    grown: shapely.Polygon, cells: shapely.Geometry, tolerance: float, shares: tuple[float, ...]
) -> shapely.Geometry:
    """Return an outline with fewer corners that holds its cells and stays within the tolerance."""
    limit = cells.buffer(tolerance, quad_segs=16)
    for share, whole in itertools.product(shares, (False, True)):
        out = grown.simplify(share * tolerance, preserve_topology=whole)
        if out.geom_type == "Polygon" and out.is_valid and out.covers(cells) and limit.covers(out):
            return out
    return grown


def _corners(polygon: shapely.Polygon) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in polygon.exterior.coords[:-1]]

"""Line work of maps as outlines: pieces are joined, and open lines get a width."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.geometry.polygons import union
from netsp.exchange.maps.import_policy import DEFAULT_OUTLINES, OutlinePolicy

if TYPE_CHECKING:
    import shapely


def lines_of(shape: shapely.Geometry) -> list[shapely.LineString]:
    """Return the lines of a LineString or MultiLineString, in 2D, without those of no length."""
    import shapely

    flat = shapely.force_2d(shape)
    return [line for line in getattr(flat, "geoms", [flat]) if line.length > 0.0]


def outlines(
    lines: Sequence[shapely.LineString], tolerance: float
) -> tuple[list[tuple[shapely.Polygon, list[int]]], list[int]]:
    """Join lines whose ends meet, and return the areas that they enclose.

    Parameters
    ----------
    lines : sequence of shapely.LineString
        Pieces of outlines, in the plane.
    tolerance : float
        Largest distance of ends that are one corner, metres.

    Returns
    -------
    areas : list of (shapely.Polygon, list of int)
        Each area, with the indices of its lines.
    open_lines : list of int
        Indices of the lines that are part of no area.

    Examples
    --------
    >>> import shapely
    >>> pieces = [shapely.LineString([(0, 0), (2, 0), (2, 2)]),
    ...           shapely.LineString([(0, 0), (0, 2), (2, 2)])]
    >>> areas, open_lines = outlines(pieces, 0.01)
    >>> areas[0][0].area, areas[0][1], open_lines
    (4.0, [0, 1], [])
    """
    import shapely

    if not lines:
        return [], []
    ends = np.array([[line.coords[0], line.coords[-1]] for line in lines]).reshape(-1, 2)
    corner, component = _corners(ends, tolerance)
    areas: list[tuple[shapely.Polygon, list[int]]] = []
    open_lines: list[int] = []
    for members in _groups(component[::2]):
        snapped = [
            _snapped(lines[k], ends[corner[2 * k]], ends[corner[2 * k + 1]]) for k in members
        ]
        kept = [(k, line) for k, line in zip(members, snapped, strict=True) if line is not None]
        faces = shapely.polygonize([line for _, line in kept])
        whole = union(list(faces.geoms))
        used: set[int] = set()
        for part in getattr(whole, "geoms", [whole]):
            if part.is_empty:
                continue
            own_lines = [k for k, line in kept if part.covers(line)]
            used.update(own_lines)
            areas.append((part, own_lines))
        open_lines += [k for k in members if k not in used]
    return areas, sorted(open_lines)


def is_land(line: shapely.LineString, area: shapely.Polygon | None = None) -> bool:
    """Return whether a coastline has its area on the left, where OpenStreetMap has the land.

    Parameters
    ----------
    area : shapely.Polygon, optional
        Area that the line bounds; default: the area that it encloses.

    Returns
    -------
    bool
        True for an island, False for a shore around water.

    Examples
    --------
    >>> import shapely
    >>> island = shapely.LineString([(0, 0), (2, 0), (2, 2), (0, 0)])
    >>> is_land(island), is_land(island.reverse())
    (True, False)
    """
    import shapely

    if area is None:
        return bool(shapely.is_ccw(line))
    ring = area.exterior if shapely.is_ccw(area.exterior) else area.exterior.reverse()
    lower, upper = (
        ring.project(line.interpolate(share, normalized=True)) for share in (0.5, 0.501)
    )
    ahead = (upper - lower) % ring.length
    return bool(ahead < 0.5 * ring.length)


def widened(
    line: shapely.LineString, width: float, policy: OutlinePolicy = DEFAULT_OUTLINES
) -> shapely.Geometry:
    """Return the area within half a width (metres) of a line, with square ends.

    The area is a polygon with few corners that holds every point within half the width.
    """
    import shapely

    points = shapely.get_coordinates(shapely.remove_repeated_points(line))
    ahead = np.diff(points, axis=0)
    ahead /= np.hypot(*ahead.T)[:, None]
    # a mitred buffer would end flat where the line turns back, so its parts overlap there
    turns_back = (ahead[1:] * ahead[:-1]).sum(axis=1) < -policy.reversal_cosine
    ends = [0, *(1 + np.flatnonzero(turns_back)).tolist(), len(points) - 1]
    parts = [part for a, b in itertools.pairwise(ends) for part in _simple_parts(points[a : b + 1])]
    return union(
        shapely.buffer(
            parts,
            0.5 * width,
            cap_style="square",
            join_style="mitre",
            mitre_limit=policy.mitre_limit,
        )
    )


def _simple_parts(points: Floats) -> list[shapely.LineString]:
    """Return a polyline in parts that do not meet themselves.

    GEOS may lose a piece of the buffer of a line that crosses itself.
    """
    import shapely

    line = shapely.LineString(points)
    if line.is_simple:
        return [line]
    middle = len(points) // 2
    return _simple_parts(points[: middle + 1]) + _simple_parts(points[middle:])


def _corners(ends: Floats, tolerance: float) -> tuple[Ints, Ints]:
    """Return for each end the first end at its corner, and the component of its line."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    n = len(ends)
    near = cKDTree(ends).query_pairs(tolerance, output_type="ndarray").reshape(-1, 2)

    def components(pairs: Ints) -> Ints:
        links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
        return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)

    group = components(near)
    _, first = np.unique(group, return_index=True)
    lines = np.arange(n).reshape(-1, 2)
    return first[group], components(np.vstack([near, lines]))


def _groups(labels: Ints) -> list[list[int]]:
    order = np.argsort(labels, kind="stable")
    cuts = np.flatnonzero(np.diff(labels[order])) + 1
    return [part.tolist() for part in np.split(order, cuts)]


def _snapped(line: shapely.LineString, start: Floats, end: Floats) -> shapely.LineString | None:
    """Return a line with its ends moved to their corners; None if no length is left."""
    import shapely

    points = np.array(line.coords)
    points[0], points[-1] = start, end
    moved = shapely.LineString(points)
    return moved if moved.length > 0.0 else None

"""Simple polygons: validity, an interior point, signed distance."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import shapely

Vertices = Sequence[tuple[float, float]]

SAME_PLACE = 1e-12
"""Tolerance for the distance of points that count as equal, as a share of the largest
coordinate."""

UNION_GRIDS = (0.0, 1e-12, 1e-10, 1e-8)
"""Tolerance for coordinates in `union`: spacings of the grids tried, as shares of the largest
coordinate."""


def check_polygon(vertices: Vertices) -> None:
    """Raise ValueError unless the vertices bound a simple polygon of positive area."""
    import shapely

    if len(set(vertices)) < 3:
        raise ValueError(f"expected at least 3 distinct vertices, got {len(set(vertices))}")
    shape = shapely.Polygon(vertices)
    size = float(np.ptp(np.asarray(vertices), axis=0).max())
    reason = "" if shape.is_valid else shapely.is_valid_reason(shape)
    # the hull, because the signed areas of a bow tie cancel although its vertices are not collinear
    if shapely.convex_hull(shape).area <= 1e-12 * size**2 or (not reason and shape.area == 0.0):
        raise ValueError("polygon has zero area; expected one that encloses something")
    if reason:
        raise ValueError(
            f"polygon is not simple: {_plain_reason(reason)}; expected edges that do not cross"
        )


def union(shapes: Sequence[Any]) -> Any:
    """Return the union of shapes, checked for missing pieces.

    GEOS 3.14 may silently lose pieces where edges nearly coincide. If a corner of a shape is not in
    the union, the union is computed again with coordinates rounded to a grid.

    Examples
    --------
    >>> from shapely import box
    >>> union([box(0, 0, 2, 1), box(1, 0, 3, 1)]).area
    3.0
    """
    import shapely

    corners = shapely.get_coordinates(shapes)
    scale = float(np.abs(corners).max()) if len(corners) else 0.0
    area = max((shape.area for shape in shapes), default=0.0)
    for grid in UNION_GRIDS:
        whole = shapely.union_all(shapes, grid_size=grid * scale if grid else None)
        shapely.prepare(whole)
        tolerance = max(2.0 * grid, SAME_PLACE) * scale
        found = shapely.dwithin(whole, shapely.points(corners), tolerance)
        if found.all() and whole.area >= area * (1.0 - SAME_PLACE):
            break
    return whole


def _plain_reason(reason: str) -> str:
    """Return GEOS's reason, such as "Self-intersection[0.0005 11.5]", in plain words."""
    kind, _, place = reason.removesuffix("]").partition("[")
    at = ", ".join(f"{float(v):.6g}" for v in place.split())
    plain = {"Self-intersection": "edges cross", "Ring Self-intersection": "it touches itself"}
    return f"{plain.get(kind, kind.lower())} at ({at})" if at else kind.lower()


def counterclockwise(vertices: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return vertices (k, 2) in counter-clockwise order, without repeated or collinear ones."""
    v = np.asarray(vertices, dtype=float)
    keep = np.any(v != np.roll(v, 1, axis=0), axis=1)
    v = v[keep]
    while len(v) > 3:
        a, b = v - np.roll(v, 1, axis=0), np.roll(v, -1, axis=0) - v
        cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        flat = np.abs(cross) <= 1e-12 * np.hypot(*a.T) * np.hypot(*b.T)
        if not flat.any():
            break
        v = v[~_every_other(flat)]
    x, y = v.T
    if np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0:
        v = v[::-1].copy()
    return v


def _every_other(flat: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return the mask of flat corners of a ring that can be left out together.

    Of a run of flat corners every other one is chosen, because leaving one out may make its
    neighbours less flat. At least one corner is chosen, and at least three remain.
    """
    k = len(flat)
    number = np.arange(k)
    last_other = np.maximum.accumulate(np.where(flat, -1, number))
    out = flat & ((number - last_other) % 2 == 1)
    if flat[0] and flat[-1]:
        out[-1] = False
    out[np.flatnonzero(out)[k - 3 :]] = False
    return np.asarray(out)


def polygon_signed_distance(vertices: Vertices, xy: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the distance of points (..., 2) to the outline, negative inside."""
    p = np.asarray(xy, dtype=float)
    a = np.asarray(vertices, dtype=float)
    b = np.roll(a, -1, axis=0)
    edge = b - a
    rel = p[..., None, :] - a
    length2 = np.maximum((edge**2).sum(axis=-1), np.finfo(float).tiny)
    t = np.clip((rel * edge).sum(axis=-1) / length2, 0.0, 1.0)
    gap = rel - t[..., None] * edge
    distance = np.sqrt((gap**2).sum(axis=-1)).min(axis=-1)
    up = (a[:, 1] > p[..., None, 1]) != (b[:, 1] > p[..., None, 1])
    dy = np.where(edge[:, 1] == 0.0, 1.0, edge[:, 1])
    x = a[:, 0] + (p[..., None, 1] - a[:, 1]) / dy * edge[:, 0]
    inside = (up & (p[..., None, 0] < x)).sum(axis=-1) % 2 == 1
    return np.asarray(np.where(inside, -distance, distance))


@functools.lru_cache(maxsize=4096)
def polygon_thickness(vertices: tuple[tuple[float, float], ...]) -> float:
    """Return the width of the thinnest part of a simple polygon, to a millionth of its size.

    The result is cached, because each change of an obstacle rebuilds the scene.
    """
    import shapely

    shape = shapely.Polygon(vertices)
    low, high = 0.0, math.sqrt(shape.area)
    for _ in range(20):
        # an opening that keeps corners loses area only where the polygon is thin
        t = 0.5 * (low + high)
        opened = shape.buffer(-t / 2, join_style="mitre").buffer(t / 2, join_style="mitre")
        if shape.difference(opened).area < 1e-6 * shape.area:
            low = t
        else:
            high = t
    return low


def polygon_interior_point(vertices: Vertices) -> tuple[float, float]:
    """Return a point well inside a polygon, the same on every machine.

    It is the centroid, unless the centroid is less than a tenth as deep as the deepest of the
    candidates: the middles of the horizontal chords at 15 fixed heights. Then it is that candidate.
    """
    v = np.asarray(vertices, dtype=float)
    origin = v[0]
    x, y = (v - origin).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    centroid = origin + np.array(
        [np.sum((x + np.roll(x, -1)) * cross), np.sum((y + np.roll(y, -1)) * cross)]
    ) / (3.0 * np.sum(cross))
    candidates, half = [centroid], [np.inf]
    low, high = v[:, 1].min(), v[:, 1].max()
    for k in range(1, 16):
        height = low + (high - low) * k / 16
        chords = [(x0, x1) for x0, x1 in _chords(v, float(height)) if x1 > x0]
        candidates += [np.array([(x0 + x1) / 2, height]) for x0, x1 in chords]
        half += [(x1 - x0) / 2 for x0, x1 in chords]
    depth = _depths(vertices, np.array(candidates), np.array(half))
    best = int(np.argmax(depth))
    chosen = candidates[0] if depth[0] >= 0.1 * depth[best] else candidates[best]
    return float(chosen[0]), float(chosen[1])


def _depths(
    vertices: Vertices,
    points: npt.NDArray[np.float64],
    bounds: npt.NDArray[np.float64],
    chunk_points: int = 64,
) -> npt.NDArray[np.float64]:
    """Return the depths of points (n, 2) in a polygon, given an upper bound on each.

    A point gets -inf if its bound shows that another point lies deeper. Distances are computed for
    `chunk_points` points at a time, to save memory.
    """
    out = np.full(len(points), -np.inf)
    order = np.argsort(-bounds, kind="stable")
    for first in range(0, len(order), chunk_points):
        chunk = order[first : first + chunk_points]
        if bounds[chunk[0]] * (1.0 + 1e-9) < out.max():
            break
        out[chunk] = -polygon_signed_distance(vertices, points[chunk])
    return out


def _chords(v: npt.NDArray[np.float64], height: float) -> list[tuple[float, float]]:
    w = np.roll(v, -1, axis=0)
    hit = (v[:, 1] > height) != (w[:, 1] > height)
    a, b = v[hit], w[hit]
    xs = np.sort(a[:, 0] + (height - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0]))
    return [(float(p), float(q)) for p, q in zip(xs[::2], xs[1::2], strict=False)]


def box_around(shapes: Sequence[shapely.Geometry], margin: float) -> shapely.Polygon:
    """Return the upright box around shapes, larger by a margin on each side.

    Shapes on one line have an envelope without area, whose buffer is not a box.

    Examples
    --------
    >>> import shapely
    >>> box_around([shapely.MultiPoint([(0, 0), (4, 0)])], 1.0).bounds
    (-1.0, -1.0, 5.0, 1.0)
    """
    import shapely

    left, bottom, right, top = shapely.total_bounds(np.array(shapes, dtype=object)).tolist()
    return shapely.box(left - margin, bottom - margin, right + margin, top + margin)

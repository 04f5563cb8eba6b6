"""Polygons of maps as obstacles: simple, without holes, and circles where they draw circles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry.polygons import union
from netsp.exchange.maps.import_policy import DEFAULT_OUTLINES, OutlinePolicy

if TYPE_CHECKING:
    import shapely

SIDE_TOLERANCE = 1e-6
"""Tolerance of rounding: shorter sides of a polygon are dropped, metres."""


def circle_of(
    ring: Floats, policy: OutlinePolicy = DEFAULT_OUTLINES
) -> tuple[tuple[float, float], float] | None:
    """Return the circle that a ring of corners draws; it holds the ring.

    Drawings and buffers have no other form for a circle.

    Parameters
    ----------
    ring : ndarray, shape (n, 2)
        Corners, not closed.

    Returns
    -------
    tuple or None
        Centre and radius; None for any other ring.
    """
    if len(ring) < policy.min_circle_corners:
        return None
    centre = ring.mean(0)
    off = np.hypot(*(ring - centre).T)
    steps = np.hypot(*(np.roll(ring, -1, axis=0) - ring).T)
    even = np.ptp(steps) <= policy.max_step_spread * steps.mean()
    if not even or np.ptp(off) > policy.max_radius_spread * off.mean():
        return None
    return (float(centre[0]), float(centre[1])), float(off.max())


def simple_polygons(shape: shapely.Geometry, inner: Any) -> tuple[list[shapely.Polygon], list[str]]:
    """Return an area as simple polygons without holes.

    Parameters
    ----------
    shape : shapely.Geometry
        Polygon, multipolygon or closed line, in the plane.
    inner : callable
        ``inner(polygon)`` returns whether a place that must stay free lies in it.

    Returns
    -------
    polygons : list of shapely.Polygon
        Parts; they touch where a hole was cut open.
    notes : list of str
        Changes to the shape.
    """
    import shapely

    notes: list[str] = []
    flat = shapely.force_2d(shape)
    if "Line" in flat.geom_type:
        lines = getattr(flat, "geoms", [flat])
        flat = union([shapely.Polygon(line.coords) for line in lines])
    if not flat.is_valid:
        notes.append("crosses or touches itself: repaired")
        flat = shapely.make_valid(flat, method="structure", keep_collapsed=False)
    parts = [p for p in getattr(flat, "geoms", [flat]) if p.geom_type == "Polygon" and p.area > 0.0]
    out: list[shapely.Polygon] = []
    filled = cut = 0
    for part in parts:
        holes = [shapely.Polygon(r) for r in part.interiors]
        kept = [h for h in holes if inner(h)]
        filled += len(holes) - len(kept)
        pieces = [shapely.Polygon(part.exterior, [h.exterior for h in kept])]
        while pieces:
            piece = pieces.pop()
            if not piece.interiors:
                out.append(piece)
                continue
            cut += 1
            pieces += _halves(piece)
    if filled:
        notes.append(f"{filled} hole{'s' * (filled > 1)} with nothing to visit inside: filled")
    if cut:
        notes.append("has a pool inside: cut into parts that touch")
    return out, notes


def outline_of(
    polygon: shapely.Polygon, policy: OutlinePolicy = DEFAULT_OUTLINES
) -> dict[str, Any]:
    """Return a polygon without holes as an obstacle of a problem file: a circle if it draws one.

    Returns
    -------
    dict
        ``center`` and ``radius``, or ``polygon``.
    """
    import shapely

    ring = shapely.get_coordinates(polygon.exterior)[:-1]
    ring = ring[np.hypot(*(ring - np.roll(ring, -1, axis=0)).T) > SIDE_TOLERANCE]
    circle = circle_of(ring, policy)
    if circle is not None:
        return {"center": circle[0], "radius": circle[1]}
    return {"polygon": ring.tolist()}


def spurs_of(
    shape: shapely.Geometry, polygons: list[shapely.Polygon], tolerance: float
) -> list[shapely.LineString]:
    """Return the parts of outlines that run out and back, which no polygon of them holds.

    Parameters
    ----------
    shape : shapely.Geometry
        Polygon, multipolygon or closed line, as drawn, in the plane.
    polygons : list of shapely.Polygon
        Polygons that `simple_polygons` made of it.
    tolerance : float
        Shorter parts are rounding, metres.

    Returns
    -------
    list of shapely.LineString
        Thin walls.
    """
    import shapely

    flat = shapely.force_2d(shape)
    lines = (
        [flat]
        if "Line" in flat.geom_type
        else [part.exterior for part in getattr(flat, "geoms", [flat])]
    )
    if "Line" not in flat.geom_type and flat.is_valid:
        return []
    inside = union(polygons)
    out = []
    for line in lines:
        rest = shapely.line_merge(shapely.difference(shapely.node(line), inside))
        parts = getattr(rest, "geoms", [rest])
        # a closed rest is the ring of a hole, no wall
        out += [s for s in parts if s.length > tolerance and not s.is_closed]
    return out


def _halves(piece: shapely.Polygon) -> list[shapely.Polygon]:
    """Return a polygon cut by a vertical line through its first hole."""
    import shapely

    x = piece.interiors[0].centroid.x
    low_x, low_y, high_x, high_y = piece.bounds
    halves = []
    for side in ((low_x, x), (x, high_x)):
        cut = piece.intersection(shapely.box(side[0], low_y, side[1], high_y))
        halves += [p for p in getattr(cut, "geoms", [cut]) if p.geom_type == "Polygon"]
    return halves

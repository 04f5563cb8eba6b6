"""Cropping of a map to what a tether can reach."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

CROP_CORNERS = 64
"""Corners of the polygon that obstacles are clipped to; it holds the circle of reach."""


def cropped(
    obstacles: list[dict[str, Any]], center: tuple[float, float], radius: float
) -> tuple[list[dict[str, Any]], list[dict[str, Any]], int]:
    """Leave out obstacles beyond a circle, and cut off the parts of others beyond it.

    A tether that stays within the circle is in the same classes with the cut obstacles as with the
    whole ones: a loop about one part alone would leave the circle.

    Parameters
    ----------
    obstacles : list of dict
        Circles and polygons as a problem file has them.
    center : (x, y)
        Centre of the circle.
    radius : float
        Its radius, metres.

    Returns
    -------
    kept : list of dict
        Obstacles within the circle, cut where they cross it.
    dropped : list of dict
        Obstacles beyond it.
    cut_count : int
        Number of obstacles that were cut.
    """
    import shapely

    # circumscribed, so that the polygon holds the whole circle
    outer = radius / math.cos(math.pi / CROP_CORNERS)
    turn = 2.0 * math.pi * np.arange(CROP_CORNERS) / CROP_CORNERS
    window = shapely.Polygon(
        np.column_stack([np.cos(turn), np.sin(turn)]) * outer + np.array(center)
    )
    spot = shapely.Point(center)
    kept: list[dict[str, Any]] = []
    dropped: list[dict[str, Any]] = []
    cut_count = 0
    for thing in obstacles:
        if "radius" in thing:
            far = math.dist(thing["center"], center) - thing["radius"] > radius
            (dropped if far else kept).append(thing)
            continue
        polygon = shapely.Polygon(thing["polygon"])
        if polygon.distance(spot) > radius:
            dropped.append(thing)
            continue
        if window.contains(polygon):
            kept.append(thing)
            continue
        cut_count += 1
        parts = _parts(polygon.intersection(window))
        for number, part in enumerate(parts, 1):
            ring = shapely.get_coordinates(part.exterior)[:-1]
            more: dict[str, Any] = {"polygon": ring.tolist()}
            if len(parts) > 1 and thing["name"] is not None:
                more["name"] = f"{thing['name']} {number}"
            kept.append({**thing, **more})
    return kept, dropped, cut_count


def _parts(shape: Any) -> list[Any]:
    """Return the polygons of a shape, without slivers that have no area."""
    return [
        p for p in getattr(shape, "geoms", [shape]) if p.geom_type == "Polygon" and p.area > 1e-9
    ]

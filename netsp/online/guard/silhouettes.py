"""Silhouettes of solids from above."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import shapely

from netsp.base.arrays import Floats
from netsp.world.scene.shapes import Box, Capsule, Cylinder, Post, Prism, Sphere, Torus


def silhouette(shape: Any, arc_segments: int = 12) -> list[Floats]:
    """Return the rims of a solid from above, each of shape (k, 2), m; none if it is unbounded.

    Holes are not shown. A quarter of a circle has `arc_segments` segments.
    """
    area = _area(shape, arc_segments)
    if area is None or area.is_empty:
        return []
    parts = area.geoms if hasattr(area, "geoms") else [area]
    return [np.asarray(part.exterior.coords)[:, :2] for part in parts]


def _area(shape: Any, arc_segments: int) -> Any:
    """Return the area that a solid covers from above; None if it is unbounded."""
    if isinstance(shape, Sphere | Post):
        return shapely.Point(shape.center[:2]).buffer(shape.radius, arc_segments)
    if isinstance(shape, Capsule):
        return shapely.LineString([shape.a[:2], shape.b[:2]]).buffer(shape.radius, arc_segments)
    if isinstance(shape, Cylinder):
        return shapely.MultiPoint(_rims(shape, 4 * arc_segments)).convex_hull
    if isinstance(shape, Box):
        half = 0.5 * np.array(shape.size)
        corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * half
        return shapely.MultiPoint(
            (np.array(shape.center) + corners @ shape.axes())[:, :2]
        ).convex_hull
    if isinstance(shape, Torus):
        return shapely.LineString(shape.centreline()[:, :2]).buffer(
            shape.minor_radius, arc_segments
        )
    if isinstance(shape, Prism):
        return shapely.Polygon(shape.polygon).buffer(shape.grow, arc_segments)
    return None


def _rims(shape: Cylinder, count: int) -> Floats:
    """Return points of the edges of a cylinder's faces, from above, shape (2 count, 2)."""
    a, b = np.array(shape.a), np.array(shape.b)
    axis = (b - a) / np.linalg.norm(b - a)
    u = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)[:, None]
    rim = shape.radius * (np.cos(angle) * u + np.sin(angle) * v)
    return np.vstack([a + rim, b + rim])[:, :2]

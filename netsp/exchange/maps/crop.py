"""Cropping of a map to the reach of a tether."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from netsp.exchange.maps.import_policy import DEFAULT_OUTLINES, OutlinePolicy

if TYPE_CHECKING:
    import shapely

AREA_TOLERANCE = 1e-9
"""Tolerance of rounding: cut parts with a smaller area are dropped, m²."""


@dataclass(frozen=True)
class CropWindow:
    """Circle that holds the reach of a tether, and a polygon around it.

    Obstacles cut to the polygon give a tether within the circle the same homotopy classes as whole
    ones, because a loop around one part of a cut obstacle would leave the circle.

    Attributes
    ----------
    center
        (x, y) of the circle, metres.
    radius
        Radius of the circle, metres.
    n_corners
        Number of corners of the polygon.
    """

    center: tuple[float, float]
    radius: float
    n_corners: int = DEFAULT_OUTLINES.crop_corners

    @classmethod
    def about(
        cls,
        bases: Sequence[Sequence[float]],
        reach: float,
        margin: float,
        policy: OutlinePolicy = DEFAULT_OUTLINES,
    ) -> CropWindow:
        """Return the window that holds the reach of a tether from each base.

        Parameters
        ----------
        bases : sequence of (x, y)
            Places where the tether may be fixed.
        reach : float
            Reach of the tether, metres.
        margin : float
            Share of the radius by which the circle is larger.
        """
        import shapely

        places = np.array([base[:2] for base in bases], dtype=float)
        circle = shapely.minimum_bounding_circle(shapely.MultiPoint(places))
        middle = places[0] if len(places) == 1 else np.array(circle.centroid.coords[0])
        away = float(np.hypot(*(places - middle).T).max())
        radius = (away + reach) * (1.0 + margin)
        return cls((float(middle[0]), float(middle[1])), radius, policy.crop_corners)

    @cached_property
    def polygon(self) -> shapely.Polygon:
        """Polygon with `n_corners` corners that holds the circle."""
        import shapely

        outer = self.radius / math.cos(math.pi / self.n_corners)
        turn = 2.0 * math.pi * np.arange(self.n_corners) / self.n_corners
        made = shapely.Polygon(
            np.column_stack([np.cos(turn), np.sin(turn)]) * outer + np.array(self.center)
        )
        shapely.prepare(made)
        return made

    def is_beyond(self, shape: shapely.Geometry, grown: float = 0.0) -> bool:
        """Return whether a shape, grown by a width (metres), lies outside the circle."""
        import shapely

        west, south, east, north = shape.bounds
        x, y = self.center
        off = math.hypot(max(west - x, x - east, 0.0), max(south - y, y - north, 0.0))
        if off - grown > self.radius:  # decides for most features
            return True
        return bool(shape.distance(shapely.Point(self.center)) - grown > self.radius)

    def cut(self, shape: shapely.Geometry) -> tuple[shapely.Geometry, bool]:
        """Return the part of an area within the polygon, and whether something was cut off.

        Parameters
        ----------
        shape : shapely.Geometry
            One or several polygons in the plane; an invalid shape is returned whole.
        """
        if self.polygon.contains(shape) or not shape.is_valid:
            return shape, False
        import shapely

        parts = _polygons(shape.intersection(self.polygon))
        return (parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)), True


def cropped(
    obstacles: list[dict[str, Any]], window: CropWindow
) -> tuple[list[dict[str, Any]], list[dict[str, Any]], list[dict[str, Any]]]:
    """Return obstacles without those beyond a window, and cut where they cross it.

    Parameters
    ----------
    obstacles : list of dict
        Circles and polygons as in a problem file.

    Returns
    -------
    kept : list of dict
        Obstacles within the window, cut where they cross it.
    dropped : list of dict
        Obstacles beyond the window.
    cut_off : list of dict
        Obstacles that were cut, whole.
    """
    import shapely

    kept: list[dict[str, Any]] = []
    dropped: list[dict[str, Any]] = []
    cut_off: list[dict[str, Any]] = []
    for obstacle in obstacles:
        if "radius" in obstacle:
            is_far = (
                math.dist(obstacle["center"], window.center) - obstacle["radius"] > window.radius
            )
            (dropped if is_far else kept).append(obstacle)
            continue
        polygon = shapely.Polygon(obstacle["polygon"])
        if window.is_beyond(polygon):
            dropped.append(obstacle)
            continue
        part, is_cut = window.cut(polygon)
        if not is_cut:
            kept.append(obstacle)
            continue
        cut_off.append(obstacle)
        parts = _polygons(part)
        for number, piece in enumerate(parts, 1):
            ring = shapely.get_coordinates(piece.exterior)[:-1]
            changes: dict[str, Any] = {"polygon": ring.tolist()}
            if len(parts) > 1 and obstacle["name"] is not None:
                changes["name"] = f"{obstacle['name']} {number}"
            kept.append({**obstacle, **changes})
    return kept, dropped, cut_off


def _polygons(shape: Any) -> list[Any]:
    """Return the polygons of a shape, without slivers that have no area."""
    return [
        p
        for p in getattr(shape, "geoms", [shape])
        if p.geom_type == "Polygon" and p.area > AREA_TOLERANCE
    ]

"""Cropping of a map to what a tether can reach."""

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
    """Circle that holds all that a tether reaches, and a polygon about it.

    A tether that stays within the circle is in the same classes with obstacles cut to the polygon
    as with the whole ones: a loop about one part alone would leave the circle.

    Attributes
    ----------
    center
        (x, y) of the circle, metres.
    radius
        Of the circle, metres.
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
        """Return the window that holds the reach of a tether from each of some bases.

        Parameters
        ----------
        bases : sequence of (x, y)
            Where the tether may be fixed.
        reach : float
            How far it reaches, metres.
        margin : float
            Share of the radius by which the circle is larger.

        Returns
        -------
        CropWindow
            About a single base where there is one.
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
        """Polygon of `CROP_CORNERS` corners that holds the circle."""
        import shapely

        outer = self.radius / math.cos(math.pi / self.n_corners)
        turn = 2.0 * math.pi * np.arange(self.n_corners) / self.n_corners
        made = shapely.Polygon(
            np.column_stack([np.cos(turn), np.sin(turn)]) * outer + np.array(self.center)
        )
        shapely.prepare(made)
        return made

    def is_beyond(self, shape: shapely.Geometry, grown: float = 0.0) -> bool:
        """Return whether a shape, grown by a width, has nothing within the circle.

        Parameters
        ----------
        shape : shapely.Geometry
            In the plane.
        grown : float
            Width, metres.

        Returns
        -------
        bool
            Whether it can be left out.
        """
        import shapely

        west, south, east, north = shape.bounds
        x, y = self.center
        off = math.hypot(max(west - x, x - east, 0.0), max(south - y, y - north, 0.0))
        if off - grown > self.radius:  # the box decides for most of a map
            return True
        return bool(shape.distance(shapely.Point(self.center)) - grown > self.radius)

    def cut(self, shape: shapely.Geometry) -> tuple[shapely.Geometry, bool]:
        """Return the part of an area within the polygon, and whether that is less than all of it.

        Parameters
        ----------
        shape : shapely.Geometry
            A polygon or several, in the plane; one that crosses itself is returned as it is.

        Returns
        -------
        part : shapely.Geometry
            Polygons.
        is_cut : bool
            Whether something was cut off.
        """
        if self.polygon.contains(shape) or not shape.is_valid:
            return shape, False
        import shapely

        parts = _polygons(shape.intersection(self.polygon))
        return (parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)), True


def cropped(
    obstacles: list[dict[str, Any]], window: CropWindow
) -> tuple[list[dict[str, Any]], list[dict[str, Any]], list[dict[str, Any]]]:
    """Leave out obstacles beyond a window, and cut off the parts of others beyond it.

    Parameters
    ----------
    obstacles : list of dict
        Circles and polygons as a problem file has them.
    window : CropWindow
        What the tether reaches.

    Returns
    -------
    kept : list of dict
        Obstacles within the window, cut where they cross it.
    dropped : list of dict
        Obstacles beyond it.
    cut_off : list of dict
        Obstacles that were cut.
    """
    import shapely

    kept: list[dict[str, Any]] = []
    dropped: list[dict[str, Any]] = []
    cut_off: list[dict[str, Any]] = []
    for thing in obstacles:
        if "radius" in thing:
            far = math.dist(thing["center"], window.center) - thing["radius"] > window.radius
            (dropped if far else kept).append(thing)
            continue
        polygon = shapely.Polygon(thing["polygon"])
        if window.is_beyond(polygon):
            dropped.append(thing)
            continue
        part, is_cut = window.cut(polygon)
        if not is_cut:
            kept.append(thing)
            continue
        cut_off.append(thing)
        parts = _polygons(part)
        for number, piece in enumerate(parts, 1):
            ring = shapely.get_coordinates(piece.exterior)[:-1]
            more: dict[str, Any] = {"polygon": ring.tolist()}
            if len(parts) > 1 and thing["name"] is not None:
                more["name"] = f"{thing['name']} {number}"
            kept.append({**thing, **more})
    return kept, dropped, cut_off


def _polygons(shape: Any) -> list[Any]:
    """Return the polygons of a shape, without slivers that have no area."""
    return [
        p
        for p in getattr(shape, "geoms", [shape])
        if p.geom_type == "Polygon" and p.area > AREA_TOLERANCE
    ]

"""Depths of a chart: areas that are too shallow, and the features that shape the sea floor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.geometry.polygons import union
from netsp.exchange.maps.chart_classes import (
    CONTOURS,
    DEPTH_AREAS,
    LAND,
    SOUNDINGS,
    UNSURVEYED,
    contour_depth,
    depth_range,
    is_covered,
    sounding_depth,
)
from netsp.exchange.maps.feature import Feature
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
from netsp.exchange.maps.sea_floor import Danger, DepthArea, SeaFloor, sea_floor

if TYPE_CHECKING:
    import shapely

    from netsp.exchange.maps.crop import CropWindow


def shallow_areas(features: Sequence[Feature], draught: float) -> list[Feature]:
    """Return the areas of a chart that may be shallower than a draught (metres).

    These are depth areas and dredged areas whose least depth is smaller or unknown, and unsurveyed
    areas.
    """
    out = []
    for feature in features:
        layer = feature.layer.upper()
        if "Polygon" not in feature.shape.geom_type:
            continue
        min_depth, _ = depth_range(feature)
        if layer == UNSURVEYED or (
            layer in DEPTH_AREAS and (min_depth is None or min_depth < draught)
        ):
            out.append(feature)
    return out


def shoal_soundings(
    features: Sequence[Feature], draught: float, shallow: Sequence[Feature]
) -> list[Feature]:
    """Return the soundings of a chart that are shallower than a draught (metres).

    Parameters
    ----------
    shallow : sequence of Feature
        Areas that are obstacles already; soundings within them are skipped.

    Returns
    -------
    list of Feature
        Features of class SOUNDG, reduced to their shoal soundings.
    """
    import shapely

    tree = shapely.STRtree([area.shape for area in shallow])
    out = []
    for feature in features:
        if feature.layer.upper() != SOUNDINGS or not feature.shape.has_z:
            continue
        places = shapely.get_coordinates(feature.shape, include_z=True)
        places = places[-places[:, 2] < draught]
        held, _ = tree.query(shapely.points(places[:, :2]), predicate="intersects")
        open_ones = np.delete(places, held, axis=0)
        if len(open_ones):
            out.append(replace(feature, shape=shapely.MultiPoint(open_ones[:, :2])))
    return out


def uncharted_share(
    features: Sequence[Feature], plane: Callable[[shapely.Geometry], Any], window: CropWindow
) -> float:
    """Return the share of a window, from 0 to 1, that the chart does not cover.

    Parameters
    ----------
    plane : callable
        Projects a shape to the problem's plane.

    Returns
    -------
    float
        0 if the chart does not state what it covers.
    """
    covered = [plane(feature.shape) for feature in features if is_covered(feature)]
    return _share_beyond(covered, window) if covered else 0.0


def depthless_share(
    features: Sequence[Feature], plane: Callable[[shapely.Geometry], Any], window: CropWindow
) -> float:
    """Return the share of a window, from 0 to 1, without land, depth, dredged or unsurveyed area.

    Parameters
    ----------
    plane : callable
        Projects a shape to the problem's plane.
    """
    classes = (*DEPTH_AREAS, LAND, UNSURVEYED)
    areas = [
        plane(feature.shape)
        for feature in features
        if feature.layer.upper() in classes and "Polygon" in feature.shape.geom_type
    ]
    return _share_beyond(areas, window)


def _share_beyond(areas: Sequence[shapely.Geometry], window: CropWindow) -> float:
    import shapely

    circle = window.polygon
    near = [shapely.make_valid(area) for area in areas if not window.is_beyond(area)]
    return float(circle.difference(union(near)).area / circle.area)


@dataclass
class FloorFeatures:
    """Features of a chart that shape its sea floor.

    Attributes
    ----------
    used
        Features within the window.
    beyond
        Features beyond it.
    depthless
        Contours and soundings for which the chart gives no depth.
    """

    used: list[Feature] = field(default_factory=list)
    beyond: list[Feature] = field(default_factory=list)
    depthless: list[Feature] = field(default_factory=list)


def chart_floor(
    features: Sequence[Feature],
    plane: Callable[[shapely.Geometry], Any],
    window: CropWindow | None,
    cell: float | None,
    policy: ImportPolicy = DEFAULT_IMPORT,
) -> tuple[SeaFloor, FloorFeatures]:
    """Return the sea floor of a chart, and the features that shape it.

    Parameters
    ----------
    plane : callable
        Projects a shape to the problem's plane.
    window : CropWindow or None
        Extent of the floor; None stands for the extent of all depth areas.
    cell : float or None
        Side of its cells, metres; None for `policy.floor_cells` along the longer side.

    Raises
    ------
    InputError
        The chart gives no depth within the window, or the floor would have too many cells.
    """
    parts = _FloorParts()
    for feature in features:
        parts.add(feature, plane, window)
    box = _box_of_window(window) if window is not None else parts.box()
    side = cell if cell is not None else max(box[2] - box[0], box[3] - box[1]) / policy.floor_cells
    floor = sea_floor(
        parts.areas,
        np.vstack(parts.contours),
        parts.land,
        box,
        side,
        soundings=np.vstack(parts.soundings),
        dangers=parts.dangers,
        policy=policy.read,
    )
    return floor, parts.found


@dataclass
class _FloorParts:
    """Depths of a chart's features, in the problem's plane."""

    found: FloorFeatures = field(default_factory=FloorFeatures)
    areas: list[DepthArea] = field(default_factory=list)
    contours: list[Floats] = field(default_factory=lambda: [np.empty((0, 3))])
    soundings: list[Floats] = field(default_factory=lambda: [np.empty((0, 3))])
    dangers: list[Danger] = field(default_factory=list)
    land: list[Any] = field(default_factory=list)

    def add(
        self, feature: Feature, plane: Callable[[shapely.Geometry], Any], window: CropWindow | None
    ) -> None:
        """Add a feature that states depths or is land."""
        layer = feature.layer.upper()
        is_area = "Polygon" in feature.shape.geom_type
        top = sounding_depth(feature)
        is_depth = layer in (SOUNDINGS, CONTOURS) or (layer in DEPTH_AREAS and is_area)
        if not is_depth and top is None and not (layer == LAND and is_area):
            return
        shape = plane(feature.shape)
        if window is not None and window.is_beyond(shape):
            if is_depth or top is not None:
                self.found.beyond.append(feature)
            return
        if layer == LAND:
            self.land.append(shape)
            return
        if layer in DEPTH_AREAS:
            self.areas.append(DepthArea(shape, *depth_range(feature)))
        elif top is not None and not is_depth:
            self.dangers.append(Danger(shape, top))
        else:
            places = _depths(feature, shape)
            if places is None:
                self.found.depthless.append(feature)
                return
            (self.soundings if layer == SOUNDINGS else self.contours).append(places)
        self.found.used.append(feature)

    def box(self) -> tuple[float, float, float, float]:
        """Return the extent of all depth areas."""
        if not self.areas:
            raise InputError("floor: the chart has no area with depths")
        corners = np.array([a.shape.bounds for a in self.areas])
        low, high = corners[:, :2].min(axis=0), corners[:, 2:].max(axis=0)
        return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))


def _box_of_window(window: CropWindow) -> tuple[float, float, float, float]:
    (x, y), r = window.center, window.radius
    return (x - r, y - r, x + r, y + r)


def _depths(feature: Feature, shape: shapely.Geometry) -> Floats | None:
    """Return x, y and depth of a feature's soundings or corners; None if it gives no depth."""
    import shapely

    places = shapely.get_coordinates(shape)
    if feature.layer.upper() == CONTOURS:
        depth = contour_depth(feature)
        if depth is None:
            return None
        return np.column_stack([places, np.full(len(places), depth)])
    depths = 0.0 - shapely.get_coordinates(feature.shape, include_z=True)[:, 2]
    known = np.isfinite(depths)
    return np.column_stack([places, depths])[known] if known.any() else None

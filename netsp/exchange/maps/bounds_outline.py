"""Outline of the bounds of a map, and the islands in it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from netsp.base.errors import counted
from netsp.exchange.maps.drawn_shapes import outline_of, simple_polygons
from netsp.exchange.maps.feature import Feature
from netsp.exchange.maps.line_work import lines_of, outlines
from netsp.exchange.maps.map_context import MapContext

if TYPE_CHECKING:
    import shapely


def bounds_of(
    context: MapContext, features: list[Feature]
) -> tuple[list[list[float]] | None, list[Any]]:
    """Return the outline of the bounds, and the islands in it: obstacles without a name."""
    import shapely

    if not features:
        return None, []
    shapes = [context.plane(f.shape) for f in features]
    lines = [line for shape in shapes if "Line" in shape.geom_type for line in lines_of(shape)]
    areas, rest = outlines(lines, context.options.join_tolerance)
    whole = [area for area, _ in areas] + [s for s in shapes if "Polygon" in s.geom_type]
    places = ", ".join(f.where for f in features)[:100]
    if rest:
        context.complain(
            f"{places}: bounds that are not closed; expected a closed line or a polygon"
        )
        return None, []
    if len(whole) > 1 and all(f.get("fence") == "inclusion" for f in features):
        common = shapely.intersection_all(list(map(shapely.make_valid, whole)))
        parts = [g for g in shapely.get_parts(common) if g.geom_type == "Polygon"]
        whole = [shapely.MultiPolygon(parts)]
        context.notes.append(
            f"{len(features)} inclusion fences ({places}): the bounds are where all of them "
            "overlap, because the vehicle stays within each"
        )
        if whole[0].area <= 0.0:
            context.complain(f"{places}: inclusion fences that do not overlap; expected one area")
            return None, []
    if len(whole) != 1:
        context.complain(
            f"expected one outline of kind bounds, got {len(whole)}: {places}; keep one, or "
            "make obstacles of what lies between them",
            "; --map ignore=LAYER leaves out a layer",
        )
        return None, []
    return _outline_of(context, features[0], whole[0])


def _outline_of(
    context: MapContext, feature: Feature, area: shapely.Geometry
) -> tuple[list[list[float]] | None, list[Any]]:
    """Return the outline of an area, and its holes as islands."""
    import shapely

    drawn = shapely.get_parts(area)
    holes = [shapely.Polygon(ring) for part in drawn for ring in part.interiors]
    filled = shapely.MultiPolygon([shapely.Polygon(part.exterior) for part in drawn])
    polygons, notes = simple_polygons(filled, lambda p: False)
    context.notes += [f"{feature.where}: {note}" for note in notes]
    if len(polygons) != 1:
        context.complain(f"{feature.where}: expected bounds in one piece, got {len(polygons)}")
        return None, []
    ring: list[list[float]] = shapely.get_coordinates(polygons[0].exterior)[:-1].tolist()
    islands = [
        {
            "feature": feature,
            "name": None,
            "where": feature.where,
            **outline_of(polygon, context.policy.outlines),
        }
        for hole in holes
        for polygon in simple_polygons(hole, lambda p: False)[0]
    ]
    if islands:
        context.notes.append(
            f"{feature.where}: {counted(len(islands), 'hole')} in the bounds: an obstacle each"
        )
    return ring, islands

"""Base and goals of a map, and of tables beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from netsp.base.errors import InputError
from netsp.exchange.maps.csv_table import from_table
from netsp.exchange.maps.feature import Feature
from netsp.exchange.maps.map_context import MapContext, length_text
from netsp.exchange.maps.projection import Projection
from netsp.model.import_record import UsedAs


def base_of(
    context: MapContext, parts: dict[str, list[Feature]]
) -> tuple[Any, Feature | None] | None:
    """Return the place of the tether's anchor and its feature; set the projection."""
    bases = parts["base"]
    if len(bases) > 1:
        context.complain(
            f"expected one base, got {len(bases)}: {', '.join(b.where for b in bases)[:100]}"
        )
        return None
    feature = bases[0] if bases else None
    is_in_plane = not context.map.is_geographic
    if feature is None and (is_in_plane or context.projection is None):
        if not context.complaints:  # a damaged feature may be the base
            if is_in_plane:
                context.complain(
                    "has no base; expected a Point of kind base, or a point on a layer named base",
                    " (--map base=LAYER; on the earth also --crs SYSTEM with --base LAT,LON)",
                )
            else:
                expected = "has no base; expected a Point of kind base"
                context.complain(expected, ", or --base LAT,LON", "base")
        return None
    if is_in_plane:
        assert feature is not None
        return context.place(feature.shape, feature), feature
    if context.projection is None:
        assert feature is not None
        heading = context.number(feature, "heading") or 0.0
        try:
            context.projection = Projection(
                feature.shape.y, feature.shape.x, heading, name=feature.where
            )
        except InputError as error:
            context.complain(str(error))
            return None
    x, y = context.projection.base.tolist()
    if feature is None:
        return (x, y, 0.0), None
    z = context.height(feature)
    place = context.plane(feature.shape)
    shift = float(np.hypot(place.x - x, place.y - y))
    if shift > context.policy.max_base_shift:
        context.notes.append(
            f"{feature.where}: the base is at the place that was given, {length_text(shift)} "
            "away; only the properties of the file's base are used"
        )
    return (x, y, z), feature


def goals_of(context: MapContext, features: list[Feature]) -> list[dict[str, Any]]:
    """Return the goals of features, one for each of their points."""
    goals: list[dict[str, Any]] = []
    for feature in features:
        points = getattr(feature.shape, "geoms", [feature.shape])
        for k, point in enumerate(points, 1):
            name = context.name(feature)
            if name is not None and len(points) > 1:
                name = f"{name} {k}"
            place = context.place(point, feature)
            goals.append(
                {"name": name, "position": place, "where": feature.where, "source": feature}
            )
    return goals


def table_goals(context: MapContext) -> list[dict[str, Any]]:
    """Return the goals of a table beside the map."""
    return [
        {"name": context.name(row), "position": place, "where": row.where, "source": row}
        for row, place in table_places(context, "goal", context.options.goals)
    ]


def table_places(
    context: MapContext, kind: UsedAs, file: str | Path | None
) -> list[tuple[Feature, tuple[float, float, float]]]:
    """Return the rows of a table of goals or candidates, and their places in the plane."""
    import shapely

    if file is None:
        return []
    found, names = from_table(file, context.projection, context.notes.append)
    places = np.column_stack([found, np.zeros(len(found))])[:, :3]  # at the surface without z
    layer = context.ledger.add_layer(Path(file).name, len(places))
    out = []
    for k, (place, name) in enumerate(zip(places.tolist(), names, strict=True)):
        # as in the map: in degrees or in its unit
        spot = (
            tuple(context.projection.to_earth([place[:2]])[0][::-1])
            if context.projection is not None
            else (place[0] / context.unit, place[1] / context.unit)
        )
        row = Feature(f"{layer}[{k}]", layer, "", {"name": name}, shapely.Point(spot))
        context.ledger.use(row, kind)
        out.append((row, (place[0], place[1], place[2])))
    return out


def complain_of_no_goal(context: MapContext) -> None:
    """Complain that the map has no goal, and ask for obstacles to inspect."""
    if context.complaints:
        if context.options.inspection is None:
            context.asks.append("inspect")  # so that the user can answer all at once
        return
    context.complain(
        "has no goal; expected a point without radius_m, a layer of goals, a table of goals, "
        "or obstacles to inspect",
        " (--map goal=LAYER, --goals TABLE, --inspect N --standoff S)",
        "inspect",
    )

"""Shallow areas and the sea floor of a chart."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from netsp.exchange.maps.chart_classes import depth_range
from netsp.exchange.maps.chart_depths import (
    chart_floor,
    depthless_share,
    shallow_areas,
    shoal_soundings,
    uncharted_share,
)
from netsp.exchange.maps.crop import CropWindow
from netsp.exchange.maps.feature import Feature
from netsp.exchange.maps.map_context import MapContext, length_text
from netsp.exchange.maps.sea_floor import SeaFloor


def use_depths(
    context: MapContext,
    parts: dict[str, list[Feature]],
    places: Mapping[str, Any],
    reach: CropWindow | None,
) -> SeaFloor | None:
    """Make obstacles of shallow areas, and return the sea floor, if the options ask for them."""
    free = [f for f in context.map.features if context.kinds.get(f.layer.lower()) != "ignore"]
    left_out = [
        f for f in free if context.ledger.is_left_out(f) and f.layer.lower() not in context.kinds
    ]
    draught = context.options.draught
    if draught is not None:
        shallow = shallow_areas(left_out, draught)
        _check_depth(context, shallow, places, draught)
        shoals = shoal_soundings(left_out, draught, shallow)
        for feature in (*shallow, *shoals):
            context.ledger.use(feature, "obstacle")
        parts["obstacle"] += [*shallow, *shoals]
    if reach is not None:
        _note_unknown_water(context, reach)
    if not context.options.floor or context.complaints:
        return None
    return _floor(context, free)


def _note_unknown_water(context: MapContext, reach: CropWindow) -> None:
    """Add notes on water within the reach whose depth or obstacles the chart does not give."""
    features = context.map.features
    if context.options.draught is not None:
        _note_share(
            context,
            depthless_share(features, context.plane, reach),
            "is water whose depth the chart does not give; --draught makes no obstacle of it",
        )
    _note_share(
        context,
        uncharted_share(features, context.plane, reach),
        "is not on this chart, and free of obstacles in the problem",
    )


def _floor(context: MapContext, free: list[Feature]) -> SeaFloor | None:
    """Return the sea floor of a chart's features; the ledger gets their use."""
    floor, found = chart_floor(
        free, context.plane, context.window, context.options.floor_cell, context.policy
    )
    for feature in found.used:  # shallow areas stay obstacles
        if context.ledger.is_left_out(feature):
            context.ledger.use(feature, "floor")
    for feature in found.beyond:
        if context.ledger.is_left_out(feature):
            context.ledger.leave_out(feature, context.beyond_reach)
    for feature in found.depthless:
        context.ledger.leave_out(feature, "a depth that the chart does not give")
    return floor


def _check_depth(
    context: MapContext, shallow: list[Feature], places: Mapping[str, Any], draught: float
) -> None:
    """Complain of a base or goals that lie in water that may be too shallow."""
    import shapely

    areas = [context.plane(feature.shape) for feature in shallow]
    tree = shapely.STRtree(areas)
    for called, place in places.items():
        held = tree.query(shapely.Point(place[:2]), predicate="within").tolist()
        if not held:
            continue
        area = shallow[min(held)]
        min_depth, _ = depth_range(area)
        depth = (
            "of unknown depth"
            if min_depth is None
            else f"from {length_text(min_depth)} of depth on"
        )
        context.complain(
            f"{called}: lies in {context.called(area)}, {depth}, and the draught is "
            f"{length_text(draught)}; expected a place in deeper water, or a smaller draught"
        )


def _note_share(context: MapContext, share: float, description: str) -> None:
    if share >= context.policy.min_noted_share:
        context.notes.append(f"{100.0 * share:.2g} % of the tether's reach {description}")

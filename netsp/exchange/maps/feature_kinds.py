"""Kinds of the features of a map, as the ledger records them."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from netsp.base.errors import InputError
from netsp.exchange.maps.chart_classes import EQUIPMENT, lone_equipment
from netsp.exchange.maps.contract import Decision, kind_of
from netsp.exchange.maps.feature import Feature
from netsp.exchange.maps.map_context import MapContext, first_of
from netsp.model.import_record import KIND_COLUMNS, UsedAs


def features_by_kind(context: MapContext) -> dict[str, list[Feature]]:
    """Return the features of each kind; the others are left out for a reason."""
    parts: dict[str, list[Feature]] = {k: [] for k in KIND_COLUMNS}
    for unread in context.map.unread:
        context.ledger.leave_out(unread, unread.reason)
    wrong: dict[str, list[str]] = {}
    layers = context.map.layer_names
    lone = lone_equipment(context.map.features, context.policy) if context.is_chart else set()
    for feature in context.map.features:
        try:
            decision = kind_of(
                feature,
                context.kinds,
                is_chart=context.is_chart,
                layers=layers,
                policy=context.policy,
            )
        except InputError as error:
            complaint = str(error).removeprefix(feature.where)
            wrong.setdefault(complaint, []).append(feature.where)
            continue
        if decision.reason == EQUIPMENT and feature.where in lone:
            decision = Decision("obstacle")
        if decision.kind in parts:
            kind = cast("UsedAs", decision.kind)
            parts[kind].append(_marked(feature) if kind in ("base", "goal") else feature)
            context.ledger.use(feature, kind)
        else:
            context.ledger.leave_out(feature, decision.reason)
    for complaint, places in wrong.items():  # probably one slip in all of them
        context.complain(f"{first_of(places)}{complaint}")
    for layer, size in context.map.layers.items():
        if layer and not size:
            context.notes.append(f"layer {layer!r} is empty")
    return parts


def _marked(feature: Feature) -> Feature:
    """Return a goal or a base as a point; a symbol stands where it marks."""
    if feature.marker is None or "Point" in feature.shape.geom_type:
        return feature
    return replace(feature, shape=feature.marker)

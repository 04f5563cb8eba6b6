"""Viewpoints of the obstacles to be inspected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import ValidationError

from netsp.base.errors import InputError, counted
from netsp.base.validated import explain, shown
from netsp.exchange.maps.map_context import MapContext, area_of
from netsp.exchange.maps.options import InspectionOptions
from netsp.model.import_record import MAX_NAMED
from netsp.model.shorthand import Inspection


def viewpoints_of(
    context: MapContext,
    obstacles: list[dict[str, Any]],
    anchor: Any,
    tether: float | None,
    clearance: float,
) -> list[dict[str, Any]]:
    """Return the viewpoints of the obstacles to be inspected."""
    goals: list[dict[str, Any]] = []
    chosen = _chosen(context, obstacles)
    for k, obstacle in enumerate(obstacles):
        feature = obstacle["feature"]
        inspection = context.options.inspection if k in chosen else None
        if inspection is None and feature.get("viewpoints", "inspect") is None:
            continue
        try:
            found = _inspection(context, obstacle, f"#{k}", inspection).goals(obstacle)
        except (ValidationError, ValueError, TypeError) as error:
            text = explain(error) if isinstance(error, ValidationError) else str(error)
            context.complain(f"{feature.where}: {text}")
            continue
        goals += [{**g, "where": feature.where, "layer": feature.layer} for g in found]
    if context.options.inspection is not None:
        goals = _free_viewpoints(context, goals, obstacles, anchor, tether, clearance)
    return goals


def _inspection(
    context: MapContext, obstacle: dict[str, Any], name: str, default: InspectionOptions | None
) -> Inspection:
    """Return the inspection of an obstacle, by its own properties or else by the options."""
    feature = obstacle["feature"]
    stated, standoff, heights = (
        feature.get(*names) for names in (("viewpoints", "inspect"), ("standoff",), ("depths",))
    )
    fields: dict[str, Any] = {"viewpoints": None, "depths": (0.0,)}
    if default is not None:
        fields = {
            "viewpoints": default.viewpoints,
            "standoff": default.standoff,
            "depths": default.depths,
        }
    if stated is not None:
        fields["viewpoints"] = _whole(stated)
    if standoff is not None or default is None:
        fields["standoff"] = _real(standoff) * context.unit
    if heights is not None:
        fields["depths"] = [h * context.unit for h in _list(heights)]
    return Inspection.model_validate({"inspect": obstacle["name"] or name, **fields})


def _chosen(context: MapContext, obstacles: list[dict[str, Any]]) -> set[int]:
    """Return the indices of the obstacles that the user wants to inspect."""
    import shapely

    inspection = context.options.inspection
    if inspection is None:
        return set()
    rule = inspection.chosen
    areas = [shapely.box(*box) for box in rule.boxes]
    if rule.earth_boxes and context.projection is None:
        raise InputError(
            f"{context.file}: has no place on the earth; expected a box in its plane (m)"
        )
    for south, west, north, east in rule.earth_boxes:
        corners = [(south, west), (south, east), (north, east), (north, west)]
        assert context.projection is not None
        areas.append(shapely.Polygon(context.projection.to_plane(corners)))
    found = {
        k
        for k, obstacle in enumerate(obstacles)
        if (rule.layers or not context.is_shallow(obstacle["feature"]))
        and any(
            rule.matches(layer, context.name(obstacle["feature"]) or obstacle["name"])
            for layer in (obstacle["feature"].layer, *obstacle["feature"].folders)
        )
        and rule.is_in_boxes(area_of(obstacle), areas)
    }
    if not found and obstacles:
        layers = dict.fromkeys(obstacle["feature"].layer for obstacle in obstacles)
        context.complain(
            "no obstacle within the tether's reach is among those chosen to be inspected; "
            f"there are obstacles of the layers {', '.join(n or '(none)' for n in layers)}"
        )
    return found


def _free_viewpoints(
    context: MapContext,
    goals: list[dict[str, Any]],
    obstacles: list[dict[str, Any]],
    anchor: Any,
    tether: float | None,
    clearance: float,
) -> list[dict[str, Any]]:
    """Return the viewpoints with room for the robot; note the others by layer and cause."""
    if not goals:
        return goals
    places = np.array([g["position"] for g in goals])
    distance = np.linalg.norm(places - np.array(anchor), axis=1)
    is_far = (
        (distance > tether) if context.window is not None and tether is not None else distance < 0.0
    )
    is_in = _distance(places[:, :2], obstacles) < max(clearance, 1e-9)
    seen: set[tuple[float, ...]] = set()
    kept: list[dict[str, Any]] = []
    left_out: dict[tuple[str, str], list[str]] = {}
    for k, goal in enumerate(goals):
        cause = ""
        if is_in[k]:
            cause = "within an obstacle or its clearance"
        elif is_far[k]:
            cause = "farther from the base than the tether is long"
        elif (place := tuple(places[k])) in seen:
            cause = "in the same place as another"
        else:
            seen.add(place)
            kept.append(goal)
            continue
        left_out.setdefault((goal["layer"], cause), []).append(str(goal["name"]))
    _note_left_out(context, left_out)
    if not kept and not _complains_of_base(context, anchor, obstacles):
        number: Counter[str] = Counter()
        for (_, cause), names in left_out.items():
            number[cause] += len(names)
        causes = ", ".join(f"{n} {cause}" for cause, n in number.items())
        context.complain(
            f"no viewpoint around an obstacle is left ({causes}); expected another standoff, "
            "base or tether"
        )
    return kept


def _note_left_out(context: MapContext, left_out: Mapping[tuple[str, str], list[str]]) -> None:
    """Add a note on the viewpoints left out of each layer for each cause."""
    for (layer, cause), names in left_out.items():
        shown_names = ", ".join(names[:MAX_NAMED]) + (", …" if len(names) > MAX_NAMED else "")
        called = f"layer {layer!r}: " if layer else ""
        context.notes.append(
            f"{called}{counted(len(names), 'viewpoint')} left out: {cause} ({shown_names})"
        )


def _complains_of_base(context: MapContext, anchor: Any, obstacles: list[dict[str, Any]]) -> bool:
    """Complain of a base within an obstacle, and return whether it is."""
    import shapely

    spot = shapely.Point(anchor[:2])
    for obstacle in obstacles:
        if context.is_shallow(obstacle["feature"]):
            continue  # reported with its depth already
        if area_of(obstacle).contains(spot):
            context.complain(
                f"base: lies inside {context.called(obstacle['feature'])}; expected a place in "
                "the water"
            )
            return True
    return False


def _distance(places: np.ndarray, obstacles: list[dict[str, Any]]) -> np.ndarray:
    """Return the distance of each place from the nearest obstacle, 0 or less within one."""
    import shapely

    out = np.full(len(places), np.inf)
    circles = [
        (*obstacle["center"], obstacle["radius"]) for obstacle in obstacles if "radius" in obstacle
    ]
    for x, y, radius in circles:
        out = np.minimum(out, np.hypot(places[:, 0] - x, places[:, 1] - y) - radius)
    polygons = [
        shapely.Polygon(obstacle["polygon"]) for obstacle in obstacles if "polygon" in obstacle
    ]
    if polygons:
        tree = shapely.STRtree(polygons)
        points = shapely.points(places)
        (near, _), distances = tree.query_nearest(points, return_distance=True, all_matches=False)
        out[near] = np.minimum(out[near], distances)
    return out


def _whole(value: Any) -> int:
    number = _real(value)
    if number != int(number):
        raise ValueError(f"viewpoints: expected a whole number, got {shown(value)}")
    return int(number)


def _real(value: Any) -> float:
    if value is None:
        raise ValueError("standoff: missing; expected a distance from its surface")
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ValueError(f"expected a number, got {shown(value)}") from None


def _list(value: Any) -> list[float]:
    """Return the heights of a list, or of a text with commas or spaces as in tables."""
    values = value.replace(",", " ").split() if isinstance(value, str) else value
    return [_real(v) for v in (values if isinstance(values, list) else [values])]

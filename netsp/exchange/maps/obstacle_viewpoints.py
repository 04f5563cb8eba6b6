"""Viewpoints of the obstacles to be inspected."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from pydantic import ValidationError

from netsp.base.errors import InputError, counted
from netsp.base.validated import explain, shown
from netsp.exchange.maps.map_context import MapContext, area_of
from netsp.model.import_record import MAX_NAMED


def viewpoints_of(
    context: MapContext,
    obstacles: list[dict[str, Any]],
    anchor: Any,
    tether: float | None,
    clearance: float,
) -> list[dict[str, Any]]:
    """Return the viewpoints of the obstacles to be inspected."""
    from netsp.model.shorthand import Inspection

    goals: list[dict[str, Any]] = []
    chosen = _chosen(context, obstacles)
    for k, obstacle in enumerate(obstacles):
        feature, inspection = (
            obstacle["feature"],
            context.options.inspection if k in chosen else None,
        )
        stated = feature.get("viewpoints", "inspect")
        if stated is None and inspection is None:
            continue
        standoff = feature.get("standoff")
        heights = feature.get("depths")
        try:
            parsed = Inspection.model_validate(
                {
                    "inspect": obstacle["name"] or f"#{k}",
                    "viewpoints": _whole(stated)
                    if stated is not None
                    else inspection and inspection.viewpoints,
                    "standoff": inspection.standoff
                    if standoff is None and inspection is not None
                    else _real(standoff) * context.unit,
                    "depths": [h * context.unit for h in _list(heights)]
                    if heights is not None
                    else (inspection.depths if inspection is not None else (0.0,)),
                }
            )
        except (ValidationError, ValueError, TypeError) as error:
            text = explain(error) if isinstance(error, ValidationError) else str(error)
            context.complain(f"{feature.where}: {text}")
            continue
        goals += [
            {**g, "where": feature.where, "layer": feature.layer} for g in parsed.goals(obstacle)
        ]
    if context.options.inspection is not None:
        goals = _free_viewpoints(context, goals, obstacles, anchor, tether, clearance)
    return goals


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
    groups: dict[tuple[str, str], list[str]] = {}
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
        groups.setdefault((goal["layer"], cause), []).append(str(goal["name"]))
    for (layer, cause), names in groups.items():
        shown_names = ", ".join(names[:MAX_NAMED]) + (", …" if len(names) > MAX_NAMED else "")
        called = f"layer {layer!r}: " if layer else ""
        context.notes.append(
            f"{called}{counted(len(names), 'viewpoint')} left out: {cause} ({shown_names})"
        )
    if not kept and not _complains_of_base(context, anchor, obstacles):
        number: Counter[str] = Counter()
        for (_, cause), names in groups.items():
            number[cause] += len(names)
        causes = ", ".join(f"{n} {cause}" for cause, n in number.items())
        context.complain(
            f"no viewpoint about an obstacle is left ({causes}); expected another standoff, "
            "base or tether"
        )
    return kept


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

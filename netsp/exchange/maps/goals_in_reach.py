"""Goals within a straight tether, and complaints about the others."""

from __future__ import annotations

from typing import Any

import numpy as np

from netsp.base.units import UNITS
from netsp.exchange.maps.map_context import MapContext, label, length_text

SKIP_OPTION = "; leave out what is out of reach with --skip-unreachable"
UNITS_OPTION = "; give the unit with --units, as --units mm"


def goals_within_reach(
    context: MapContext, goals: list[dict[str, Any]], anchor: Any, tether: float
) -> list[dict[str, Any]]:
    """Return the goals within a straight tether; complain of the others, or leave them out."""
    near: list[dict[str, Any]] = []
    far: list[tuple[float, dict[str, Any]]] = []
    for goal in goals:
        distance = float(np.linalg.norm(np.array(goal["position"]) - np.array(anchor)))
        if distance <= tether:
            near.append(goal)
        else:
            far.append((distance, goal))
    if context.options.skip_unreachable and near:
        staying = {goal["where"] for goal in near}
        for distance, goal in far:
            feature = goal.get("source")
            if feature is None or goal["where"] in staying:  # one of several goals of a feature
                context.notes.append(
                    f"{label(goal)}: is {length_text(distance)} from the base: left out"
                )
            else:
                context.ledger.leave_out(
                    feature,
                    f"farther from the base than the tether is long ({length_text(tether)})",
                )
    elif len(far) > context.policy.max_listed_goals:
        distance, goal = max(far, key=lambda f: f[0])
        context.complain(
            f"{len(far)} goals are farther from the base than the tether is long "
            f"({length_text(tether)}), {label(goal)} {length_text(distance)}"
            f"{_cause(context, goal, distance, tether)}",
            *_remedy(context, distance, tether),
        )
    else:
        for distance, goal in far:
            context.complain(
                f"{label(goal)}: is {length_text(distance)} from the base, and the tether "
                f"{length_text(tether)} long{_cause(context, goal, distance, tether)}",
                *_remedy(context, distance, tether),
            )
    return near


def _cause(context: MapContext, goal: dict[str, Any], distance: float, tether: float) -> str:
    """Return a likely cause for a goal that is far away, or an empty text."""
    if _is_unit_doubtful(context, distance, tether):
        return ": the map states no unit, so its lengths were taken as metres"
    if context.projection is None:
        return ""
    ((lat, lon),) = context.projection.to_earth([goal["position"][:2]])
    if abs(lon) <= 90.0:
        ((x, y),) = context.projection.to_plane([[lon, lat]])
        as_read, swapped = (
            np.hypot(*(np.array(place) - context.projection.base))
            for place in (goal["position"][:2], (x, y))
        )
        if swapped <= 10.0 * tether < as_read:
            return ": latitude and longitude look swapped"
    return ""


def _remedy(context: MapContext, distance: float, tether: float) -> tuple[str, str | None]:
    """Return the option that helps with a goal that is far away, and what to ask the user for."""
    if _is_unit_doubtful(context, distance, tether):
        return UNITS_OPTION, "units"
    return SKIP_OPTION, None


def _is_unit_doubtful(context: MapContext, distance: float, tether: float) -> bool:
    """Return whether nobody stated a unit, and a goal that far away may be meant in millimetres."""
    is_assumed = context.options.units is None and context.map.metres is None
    if context.map.is_geographic or context.is_chart or not is_assumed:
        return False
    return distance * UNITS["mm"] <= tether < distance / 10.0


def check_scale(
    context: MapContext, goals: list[dict[str, Any]], anchor: Any, tether: float
) -> None:
    """Complain of coordinates in a plane that look like degrees, for the tether's length."""
    if context.map.is_geographic or not goals:
        return
    places = np.array([anchor, *(g["position"] for g in goals)])[:, :2] / context.unit
    span = float(np.ptp(places * context.unit, axis=0).max())
    small = bool((np.abs(places) <= [180.0, 90.0]).all())
    whole = bool((places == np.round(places)).all())
    if small and not whole and span <= context.policy.max_degrees_span * tether:
        context.complain(
            f"coordinates span {span:g} m, and the tether is {length_text(tether)} long: they look "
            "like degrees; expected metres",
            ", or --crs EPSG:4326",
            "crs",
        )

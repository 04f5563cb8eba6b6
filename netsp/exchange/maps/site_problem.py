"""Problem of a map, from its features and the options of the import."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from netsp.base.errors import InputError
from netsp.base.validated import explain
from netsp.exchange.maps.base_and_goals import (
    base_of,
    complain_of_no_goal,
    goals_of,
    table_goals,
    table_places,
)
from netsp.exchange.maps.bounds_outline import bounds_of
from netsp.exchange.maps.chart_water import use_depths
from netsp.exchange.maps.crop import CropWindow
from netsp.exchange.maps.feature_kinds import features_by_kind
from netsp.exchange.maps.goals_in_reach import check_scale, goals_within_reach
from netsp.exchange.maps.imported_site import ImportedSite
from netsp.exchange.maps.map_context import MapContext, label
from netsp.exchange.maps.numbered_names import number_names
from netsp.exchange.maps.obstacle_outlines import ObstacleOutlines
from netsp.exchange.maps.obstacle_viewpoints import viewpoints_of
from netsp.model.import_record import Site
from netsp.model.problem import Problem


def site_of(context: MapContext, name: str) -> ImportedSite:
    """Return the problem of a map with what was left out of it, or raise all complaints."""
    context.complaints += [(text, "") for text in context.map.complaints]
    parts = features_by_kind(context)
    base = base_of(context, parts)
    if base is None:
        raise context.refused()
    anchor, base_feature = base
    tether = context.length(base_feature, "tether_length", context.options.tether)
    if tether is None:
        option = ", or --tether L"
        context.complain(
            "has no tether length; expected tether_length of the base", option, "tether"
        )
    clearance = context.length(base_feature, "clearance", context.options.clearance) or 0.0
    goals = goals_of(context, parts["goal"]) + table_goals(context)
    candidates = [
        place for _, place in table_places(context, "candidate", context.options.candidates)
    ]
    reach = _window_of_reach(context, [anchor, *candidates], tether, clearance)
    floor = None
    if context.is_chart:
        places = {"base": anchor, **{label(goal): goal["position"] for goal in goals}}
        floor = use_depths(context, parts, places, reach)
    outlines = ObstacleOutlines(context, [anchor, *candidates, *(g["position"] for g in goals)])
    obstacles = outlines.obstacles(parts["obstacle"])
    bounds, islands = bounds_of(context, parts["bounds"])
    obstacles += islands
    number_names(context, obstacles, "obstacles")
    goals += viewpoints_of(context, obstacles, anchor, tether, clearance)
    number_names(context, goals, "goals")
    viewpoints = frozenset(str(goal["name"]) for goal in goals if "layer" in goal)
    if not goals:
        complain_of_no_goal(context)
    if tether is not None:
        check_scale(context, goals, anchor, tether)
        goals = goals_within_reach(context, goals, anchor, tether)
    if context.complaints:
        raise context.refused()
    data = {
        "schema_version": 1,
        "name": name,
        "base": list(anchor),
        "goals": [_bare(g) for g in goals],
        "obstacles": [_bare(o) for o in obstacles],
        "tether_length": tether,
        "clearance": clearance,
        **({"bounds": bounds} if bounds else {}),
        **context.origin(),
        "site": Site(
            file=Path(context.file).name[: context.policy.max_file_name_length],
            imported=context.ledger.records(),
            cropped=outlines.cropped,
        ),
    }
    problem = _validated(context, data, goals, obstacles)
    assert problem.site is not None
    return ImportedSite(
        problem,
        tuple(context.plane(shape) for shape in context.ledger.left_out_shapes),
        (*context.map.notes, *context.notes, *problem.site.notes),
        viewpoints,
        floor,
        tuple(goal.get("source") for goal in goals),
    )


def _window_of_reach(
    context: MapContext, bases: list[Any], tether: float | None, clearance: float
) -> CropWindow | None:
    """Return the window of the tether's reach; the map is cropped to it if it should be."""
    if tether is None:
        return None
    margin = context.options.crop_margin
    reach = CropWindow.about(bases, tether + clearance, margin, context.policy.outlines)
    if context.is_chart if context.options.crop is None else context.options.crop:
        context.window = reach
    return reach


def _validated(
    context: MapContext, data: dict[str, Any], goals: list[Any], obstacles: list[Any]
) -> Problem:
    """Return the problem of checked data; its errors name features of the map."""
    try:
        return Problem.model_validate(data)
    except ValidationError as error:
        wheres = {"goals": goals, "obstacles": obstacles}

        def own_name(found: re.Match[str]) -> str:
            entries, k = wheres[found[1]], int(found[2])
            return str(entries[k]["where"]) if k < len(entries) else found[0]

        text = re.sub(r"\b(goals|obstacles)\[(\d+)\]", own_name, explain(error))
        raise InputError(f"{context.file}: {text}") from None


def _bare(entry: dict[str, Any]) -> dict[str, Any]:
    """Return the data of a goal or obstacle without its origin, and without a missing name."""
    internal = ("where", "feature", "source", "layer")
    return {k: v for k, v in entry.items() if k not in internal and v is not None}

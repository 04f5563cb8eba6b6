"""Path drawn by hand on the map: its figures while it grows, and its file."""

from __future__ import annotations

from typing import Any

import numpy as np

from netsp.app.app_policy import AppPolicy
from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import checked_argument, is_index
from netsp.base.validated import shown
from netsp.exchange.maps.path_file import path_to_geojson
from netsp.model.problem import Problem
from netsp.roadmap.tether_classes import Tethers
from netsp.study.compare.path_comparison import order_length
from netsp.study.paths import PathMeasures, measure_path


def drawn_points(value: object, policy: AppPolicy = AppPolicy()) -> list[list[float]]:
    """Check the points of a drawn path.

    Raises
    ------
    InputError
        The value is not a list of pairs of numbers, or has too many.
    """
    if not isinstance(value, list) or len(value) > policy.max_drawn_points:
        raise InputError(f"drawn: expected a list of at most {policy.max_drawn_points} points")
    points = []
    for k, point in enumerate(value):
        if not isinstance(point, list) or len(point) != 2:
            raise InputError(f"drawn: point {k}: expected [x, y], got {shown(point)}")
        points.append([checked_argument(f"drawn: point {k}", v, -1e12) for v in point])
    return points


def drawn_figures(problem: Problem, points: list[list[float]]) -> dict[str, Any] | None:
    """Measure a drawn path.

    Parameters
    ----------
    problem : Problem
        Problem on the map.
    points : list of [x, y]
        Points from `drawn_points`.

    Returns
    -------
    dict or None
        Figures, as of `netsp compare-path`; None for fewer than two distinct points.
    """
    line = np.array(points, dtype=float).reshape(-1, 2)
    if len(np.unique(line, axis=0)) < 2:
        return None
    m = measure_path(problem, line)
    through = sorted({k for s in m.stretches if s.kind == "obstacle" for k in s.obstacles})
    return {
        "length": m.length,
        "time_s": m.duration_s,
        "speed": m.speed,
        "radius": m.radius,
        "visits": [
            {"goal": v.goal, "first": v.is_first, "tether": v.tether, "word": list(v.word)}
            for v in m.visits
        ],
        "order": list(m.order),
        "missing": list(m.missing),
        "revisits": list(m.revisits),
        "longest_tether": m.longest_tether,
        "longest_place": list(m.longest_place),
        "fits": m.fits,
        "end_tether": m.end_tether,
        "end_z": float(m.points[-1, 2]),
        "end_word": list(m.end_word),
        "word": list(m.word),
        "entangled": list(m.entangled),
        "comes_home": m.is_closed,
        "free": m.is_free,
        "through": through,
        "out_of_bounds": any(s.kind == "bounds" for s in m.stretches),
    }


def end_tether(
    tethers: Tethers, points: list[list[float]], figures: dict[str, Any]
) -> list[list[float]]:
    """Return the line of the taut tether at the end of a path.

    Parameters
    ----------
    tethers : Tethers
        Tethers of the problem.
    points : list of [x, y]
        The path.
    figures : dict
        Figures from `drawn_figures`.

    Returns
    -------
    list of [x, y]
        Points of the line; empty if it is longer than the tether or ends in an obstacle.
    """
    x, y = points[-1]
    tether = tethers.to(x, y, tuple(figures["end_word"]), figures["end_z"])
    return [] if tether is None else [[float(x), float(y)] for x, y in tether.path[:, :2]]


def worth_of_order(
    problem: Problem, value: object, policy: AppPolicy = AppPolicy()
) -> dict[str, Any]:
    """Find the shortest tour that visits goals in an order.

    Parameters
    ----------
    problem : Problem
        Problem with the goals.
    value : object
        Value of a message: indices of goals, without repetition.

    Returns
    -------
    dict
        ``order``, ``length`` (None if there is no tour), and ``note`` in words.

    Raises
    ------
    InputError
        The value is no such list.
    """
    has_no_repetition = isinstance(value, list) and len(set(map(str, value))) == len(value)
    if (
        not isinstance(value, list)
        or not has_no_repetition
        or not all(is_index(g, len(problem.goals)) for g in value)
    ):
        raise InputError(f"order: expected numbers of goals, none twice, got {shown(value)}")
    length, note = order_length(problem, tuple(value), time_limit=policy.order_limit_s)
    return {"order": value, "length": length, "note": note}


def drawn_file(problem: Problem, points: list[list[float]]) -> str:
    """Return a drawn path as GeoJSON, as `netsp compare-path` reads it.

    Returns
    -------
    str
        Text of the file, with the heights for which its figures are computed.

    Raises
    ------
    InputError
        The path has fewer than two distinct points.
    """
    line: Floats = np.array(points, dtype=float).reshape(-1, 2)
    if len(np.unique(line, axis=0)) < 2:
        raise InputError("no path is drawn yet; draw one on the map")
    m: PathMeasures = measure_path(problem, line)
    return path_to_geojson(f"{problem.name} by hand", m.points, problem)

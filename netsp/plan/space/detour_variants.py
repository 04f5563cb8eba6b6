"""Ways that pass bodies with free ends on their other sides.

Such bodies give no letters, so that a search by words finds one way where there are several that
are locally shortest: over a mooring line, and under it. On which side the robot passes decides
where its tether will hang. So ways are bent outwards to all sides, and pulled taut again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.plan.space.mission_policy import DetourPolicy
from netsp.plan.space.planning_context import PlanningContext, keeps_clearance


def find_bent_paths(
    context: PlanningContext, known: list[Floats], max_length: float
) -> list[Floats]:
    """Locally shortest ways between the same ends as others.

    Parameters
    ----------
    context : PlanningContext
        Where they are.
    known : list of ndarray of shape (k, 3)
        Taut ways that are known, at least one, shortest first, metres.
    max_length : float
        Metres that they may be long.

    Returns
    -------
    list of ndarray of shape (m, 3)
        Taut ways that are like none of those, shortest first.
    """
    begin, end = known[0][0], known[0][-1]
    found: list[Floats] = []
    delta, policy = context.mission.delta, context.policy.detours
    for bent in _bent_paths(begin, end, max_length, policy):
        if not _is_free(context, bent) or any(
            _is_seen_from(context, way, bent) for way in known + found
        ):
            continue
        path = context.pull_taut(bent)
        if polylines.length(path) > max_length or not keeps_clearance(
            context.field, path, context.mission
        ):
            continue
        if all(not _is_alike(path, other, delta) for other in known + found):
            found.append(path)
    found.sort(key=polylines.length)
    return found[: policy.max_bent_paths]


def _bent_paths(
    begin: Floats, end: Floats, max_length: float, policy: DetourPolicy
) -> Iterator[Floats]:
    """RobotPaths with one bend or two, out from the straight one."""
    step = end - begin
    far = float(np.linalg.norm(step))
    if far < 1e-9 or max_length <= far:
        return
    u, v = perpendiculars(step)
    out = 0.5 * math.sqrt(max_length**2 - far**2)
    for share in policy.bend_shares:
        for angle in np.linspace(0.0, 2.0 * math.pi, policy.n_bend_directions, endpoint=False):
            away = share * out * (math.cos(angle) * u + math.sin(angle) * v)
            yield np.array([begin, begin + 0.5 * step + away, end])


def perpendiculars(step: Floats) -> tuple[Floats, Floats]:
    """Two directions at right angles to one and to each other.

    Parameters
    ----------
    step : ndarray, shape (3,)
        The direction, of any length but 0.

    Returns
    -------
    tuple of ndarray, shape (3,)
        Of length 1.
    """
    ahead = step / np.linalg.norm(step)
    u = np.cross(ahead, np.eye(3)[int(np.argmin(np.abs(ahead)))])
    u /= np.linalg.norm(u)
    return u, np.cross(ahead, u)


def _is_free(context: PlanningContext, path: Floats) -> bool:
    return all(context.field.line_of_sight(a, b) for a, b in pairwise(path))


def _is_seen_from(context: PlanningContext, way: Floats, bent: Floats) -> bool:
    """Whether one can be pulled into the other, straight across."""
    shares = np.linspace(0.0, 1.0, context.policy.detours.n_sight_lines + 2)[1:-1]
    one, other = _points_at(way, shares), _points_at(bent, shares)
    return all(context.field.line_of_sight(a, b) for a, b in zip(one, other, strict=True))


def _is_alike(a: Floats, b: Floats, delta: float) -> bool:
    if abs(polylines.length(a) - polylines.length(b)) > delta:
        return False
    shares = np.array([0.25, 0.5, 0.75])
    return bool(
        np.linalg.norm(_points_at(a, shares) - _points_at(b, shares), axis=1).max() < 2.0 * delta
    )


def _points_at(path: Floats, shares: Floats) -> Floats:
    """(k, 3) the points at shares of a path's length."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    return np.column_stack([np.interp(shares * lengths[-1], lengths, path[:, k]) for k in range(3)])

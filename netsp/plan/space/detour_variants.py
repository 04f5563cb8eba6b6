"""Paths that pass bodies with free ends on their other sides.

Such bodies give no letters. A search by words therefore finds one path where several are locally
shortest, such as over a mooring line and under it. The side on which the robot passes decides where
its tether will hang. So paths are bent outwards in all directions, and pulled taut again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.plan.space.mission_policy import DetourPolicy
from netsp.plan.space.planning_context import PlanningContext, keeps_clearance


def find_bent_paths(
    context: PlanningContext, known: list[Floats], max_length: float
) -> list[Floats]:
    """Return further locally shortest paths between the ends of known ones.

    Parameters
    ----------
    known : list of ndarray of shape (k, 3)
        Taut paths, at least one, shortest first, metres.
    max_length : float
        Maximum length, metres.

    Returns
    -------
    list of ndarray of shape (m, 3)
        Taut paths that are like none of the known ones, shortest first.
    """
    begin, end = known[0][0], known[0][-1]
    found: list[Floats] = []
    delta, policy = context.mission.delta, context.policy.detours
    for bent in _bent_paths(begin, end, max_length, policy):
        if not _is_free(context, bent) or any(
            _is_seen_from(context, known_path, bent) for known_path in known + found
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
    """Yield paths out from the straight one, with one bend or with two.

    A plate with a waypoint close behind it is passed only by going straight out first.
    """
    step = end - begin
    straight_length = float(np.linalg.norm(step))
    if straight_length < 1e-9 or max_length <= straight_length:
        return
    u, v = perpendiculars(step)
    max_offset = 0.5 * math.sqrt(max_length**2 - straight_length**2)
    for share in policy.bend_shares:
        for angle in np.linspace(0.0, 2.0 * math.pi, policy.n_bend_directions, endpoint=False):
            offset = share * max_offset * (math.cos(angle) * u + math.sin(angle) * v)
            yield np.array([begin, begin + 0.5 * step + offset, end])
            yield np.array([begin, begin + offset, end + offset, end])


def perpendiculars(step: Floats) -> tuple[Floats, Floats]:
    """Return two unit vectors (3,) perpendicular to a direction and to each other."""
    ahead = step / np.linalg.norm(step)
    u = np.cross(ahead, np.eye(3)[int(np.argmin(np.abs(ahead)))])
    u /= np.linalg.norm(u)
    return u, np.cross(ahead, u)


def _is_free(context: PlanningContext, path: Floats) -> bool:
    """Return whether all segments of a path are free."""
    return context.field.lines_of_sight(path[:-1], path[1:])


def _is_seen_from(context: PlanningContext, known_path: Floats, bent: Floats) -> bool:
    """Return whether one path can be pulled straight across into the other.

    Lines of sight join points of both paths at equal shares, and each of them to the next one of
    the other path: a thin plate may stand between two shares.
    """
    shares = np.linspace(0.0, 1.0, context.policy.detours.n_sight_lines + 2)
    known_points, bent_points = _points_at(known_path, shares), _points_at(bent, shares)
    begins = np.vstack([known_points[1:-1], known_points[:-1], bent_points[:-1]])
    ends = np.vstack([bent_points[1:-1], bent_points[1:], known_points[1:]])
    return context.field.lines_of_sight(begins, ends)


def _is_alike(a: Floats, b: Floats, delta: float) -> bool:
    """Return whether two taut paths are the same but for a tolerance of delta."""
    if abs(polylines.length(a) - polylines.length(b)) > delta:
        return False
    shares = np.array([0.25, 0.5, 0.75])
    return bool(
        np.linalg.norm(_points_at(a, shares) - _points_at(b, shares), axis=1).max() < 2.0 * delta
    )


def _points_at(path: Floats, shares: Floats) -> Floats:
    """Return the points (k, 3) at shares of the length of a path."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    return np.column_stack([np.interp(shares * lengths[-1], lengths, path[:, k]) for k in range(3)])

"""Passages of a path between two obstacles that touch."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.judge.orientation import orientations
from netsp.judge.solid_distances import Bridge


def passes(bridge: Bridge, path: Floats, reach: float) -> bool:
    """Return whether a path (n, 2) passes a bridge from one side to the other.

    Crossings of the bridge cut the path into pieces on alternating sides. A piece that stays within
    `reach` of the contact is ignored: the robot waits there, or rounding put it on the other side.
    """
    cuts = _cuts(bridge.line, path)
    if not cuts:
        return False
    away = np.hypot(*(path - bridge.contact).T) > reach
    sides = []
    ends = [(-1, path[0]), *cuts, (len(path) - 1, path[-1])]
    for side, ((k, begin), (m, end)) in enumerate(pairwise(ends)):
        ends_away = np.hypot(*(np.array([begin, end]) - bridge.contact).T) > reach
        if away[k + 1 : m + 1].any() or ends_away.any():
            sides.append(side % 2)
    return len(set(sides)) > 1


def _cuts(line: Floats, path: Floats) -> list[tuple[int, Floats]]:
    """Return the crossings of a path and a polyline in order: segment of the path, and point.

    Points of the path on the line count as above it, in the sense of `netsp.judge.stringpull`.
    """
    found = []
    p, q = path[:-1], path[1:]
    for u, v in pairwise(line):
        if tuple(v) < tuple(u):
            u, v = v, u
        above = orientations(*_rows(u, v, path)) >= 0
        apart = np.flatnonzero(above[:-1] != above[1:])
        if not len(apart):
            continue
        a, b = p[apart], q[apart]
        onward: Bools = (a[:, 0] < b[:, 0]) | ((a[:, 0] == b[:, 0]) & (a[:, 1] < b[:, 1]))
        sides = [orientations(a, b, np.broadcast_to(w, a.shape)) for w in (u, v)]
        left = [(s > 0) | ((s == 0) & ~onward) for s in sides]
        for k in apart[left[0] != left[1]].tolist():
            step, edge = q[k] - p[k], v - u
            cross = step[0] * edge[1] - step[1] * edge[0]
            off = u - p[k]
            t = (off[0] * edge[1] - off[1] * edge[0]) / cross if cross else 0.0
            t = min(max(t, 0.0), 1.0)
            found.append((k, t, p[k] + t * step))
    return [(k, point) for k, _, point in sorted(found, key=lambda f: f[:2])]


def _rows(u: Floats, v: Floats, path: Floats) -> tuple[Floats, Floats, Floats]:
    return np.broadcast_to(u, path.shape), np.broadcast_to(v, path.shape), path

"""Polylines, as arrays (k, d) of points in plane or space."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from netsp.base.arrays import Bools, Floats


def length(path: Floats) -> float:
    """Return the length of a polyline; 0 for fewer than two points."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def along(path: Floats) -> Floats:
    """Return the length (k,) along a polyline up to each of its points."""
    steps: Floats = np.linalg.norm(np.diff(path, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def dense(path: Floats, step: float) -> Floats:
    """Return points (n, d) of a polyline, at most `step` apart: its vertices without the first, and
    points between them."""
    out = []
    for a, b in pairwise(path):
        k = max(1, int(np.ceil(np.linalg.norm(b - a) / step)))
        out.append(a + (b - a) * (np.arange(1, k + 1) / k)[:, None])
    return np.vstack(out) if out else np.zeros((0, path.shape[1]))


def points_along(path: Floats, step: float) -> Floats:
    """Return points (n, d) along a polyline at equal spacing, at most `step`, with both ends."""
    s = along(path)
    n = max(1, int(np.ceil(s[-1] / step)))
    u = np.linspace(0.0, s[-1], n + 1)
    return np.column_stack([np.interp(u, s, path[:, k]) for k in range(path.shape[1])])


def part(path: Floats, start: float, end: float) -> Floats:
    """Return the part (n, d) of a polyline between two arc lengths."""
    s = along(path)
    ends = np.column_stack([np.interp([start, end], s, path[:, k]) for k in range(path.shape[1])])
    return np.vstack([ends[:1], path[(s > start) & (s < end)], ends[1:]])


def essential(path: Floats, tolerance: float) -> Bools:
    """Return the mask (k,) of points that keep a polyline within a tolerance of itself.

    Source: Douglas & Peucker 1973.
    """
    kept = np.zeros(len(path), dtype=bool)
    kept[[0, -1] if len(path) else []] = True
    spans = [(0, len(path) - 1)]
    while spans:
        a, b = spans.pop()
        if b - a < 2:
            continue
        begin, step = path[a], path[b] - path[a]
        fraction = ((path[a + 1 : b] - begin) @ step) / max(float(step @ step), 1e-300)
        nearest = begin + np.clip(fraction, 0.0, 1.0)[:, None] * step
        off = np.linalg.norm(path[a + 1 : b] - nearest, axis=1)
        k = int(off.argmax())
        if off[k] > tolerance:
            kept[a + 1 + k] = True
            spans += [(a, a + 1 + k), (a + 1 + k, b)]
    return kept


def distance(path: Floats, point: Floats) -> float:
    """Return the distance of a point from the nearest point of a path (n, d)."""
    if len(path) == 1:
        return float(np.linalg.norm(path[0] - point))
    begin, step = path[:-1], np.diff(path, axis=0)
    fraction = ((point - begin) * step).sum(1) / np.maximum((step * step).sum(1), 1e-300)
    nearest = begin + np.clip(fraction, 0.0, 1.0)[:, None] * step
    return float(np.linalg.norm(nearest - point, axis=1).min())

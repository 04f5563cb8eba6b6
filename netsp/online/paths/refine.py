"""Paths made safer and smoother before they are followed.

`paper`: the three steps of Amer et al. 2025, section V-B, repeated until the path is free.
`gradient`: ours; it moves points up the distance field only, so no point's clearance gets smaller,
and keeps the ends where they are.

What the paper does not say: how long its segments are (here 10 points, 5 in common), how far points
are moved (0.1 of the clearance), and that moving points away from the path's centroid pushes those
between centroid and structure *into* the structure. The ends are kept, or the path would not lead
from the robot to the waypoint.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from netsp.arrays import Floats
from netsp.geometry import polylines
from netsp.online.scene.field import DistanceField, pushed_out

REFINEMENTS = ("none", "paper", "gradient")

SEGMENT, OVERLAP = 10, 5
TRIALS = 10
ROUNDS = 5


def refined(
    name: str, field: DistanceField, path: Floats, clearance: float, rng: np.random.Generator
) -> Floats:
    """A path (k, 3) refined; as it was if what came of it is not free."""
    if name == "none" or len(path) < 3:
        return path
    room = max(0.0, min(clearance, float(field.distance(path[[0, -1]]).min())) - 1e-3)
    if name == "gradient":
        better = lifted(field, path, clearance)
        return better if clear(field, better, min(room, lowest(field, path))) else path
    best = path
    for _ in range(ROUNDS):
        best = offset(best, clearance)
        best = perturbed(field, best, 0.1 * clearance, rng)
        best = smoothed(best)
        if clear(field, best, 0.0):
            return best
        # what went into something is brought out again, and the three steps are repeated
        best = lifted(field, best, clearance)
    return path


def offset(path: Floats, by: float) -> Floats:
    """Every point but the ends moved away from the centroid of all."""
    away = path - path.mean(axis=0)
    far = np.linalg.norm(away, axis=1, keepdims=True)
    out = path + by * away / np.maximum(far, 1e-12)
    out[[0, -1]] = path[[0, -1]]
    return np.asarray(out)


def perturbed(field: DistanceField, path: Floats, by: float, rng: np.random.Generator) -> Floats:
    """Every point but the ends moved in the best of some random directions, if that takes it
    farther from solids."""
    out = path.copy()
    inner = len(path) - 2
    for _ in range(TRIALS):
        direction = rng.normal(size=(inner, 3))
        tried = out[1:-1] + by * direction / np.linalg.norm(direction, axis=1, keepdims=True)
        better = field.distance(tried) > field.distance(out[1:-1])
        out[1:-1][better] = tried[better]
    return out


def smoothed(path: Floats) -> Floats:
    """Cubic least-squares fits on overlapping segments, averaged where they overlap."""
    total, count = np.zeros_like(path), np.zeros((len(path), 1))
    step = SEGMENT - OVERLAP
    for first in range(0, max(1, len(path) - OVERLAP), step):
        part = slice(first, min(first + SEGMENT, len(path)))
        points = path[part]
        if len(points) <= 4:
            total[part] += points
        else:
            u = polylines.along(points)
            if u[-1] == 0.0:
                total[part] += points
            else:
                basis = np.vander(u / u[-1], 4)
                total[part] += basis @ np.linalg.lstsq(basis, points, rcond=None)[0]
        count[part] += 1.0
    out = total / count
    out[[0, -1]] = path[[0, -1]]
    return np.asarray(out)


def lifted(field: DistanceField, path: Floats, clearance: float) -> Floats:
    """Every point but the ends moved up the distance field's gradient to the clearance."""
    out = path.copy()
    out[1:-1] = pushed_out(field, path[1:-1], clearance)
    return out


def lowest(field: DistanceField, path: Floats) -> float:
    """Least distance at the points of a path."""
    return float(field.distance(path).min())


def clear(field: DistanceField, path: Floats, room: float) -> bool:
    """Whether the straight lines between the points keep `room` from solids."""
    grown = field.grown(room)
    return all(grown.line_of_sight(a, b, depth=1e-2 * max(room, 0.1)) for a, b in pairwise(path))

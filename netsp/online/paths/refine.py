"""Ways made safer and smoother before they are followed.

`paper`: the three steps of Amer et al. 2025, section V-B, repeated until the way is free.
`gradient`: ours; it moves points up the distance field only, so no point's clearance gets smaller,
and keeps the ends where they are.

What the paper does not say: how long its segments are (here 10 points, 5 in common), how far points
are moved (0.1 of the clearance), and that moving points away from the path's centroid pushes those
between centroid and structure *into* the structure. The ends are kept, or the way would not lead
from the robot to the waypoint.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from netsp.arrays import Floats
from netsp.online.scene.field import DistanceField, pushed_out

REFINEMENTS = ("none", "paper", "gradient")

SEGMENT, OVERLAP = 10, 5
TRIALS = 10
ROUNDS = 5


def refined(
    name: str, field: DistanceField, way: Floats, clearance: float, rng: np.random.Generator
) -> Floats:
    """A way (k, 3) refined; as it was if what came of it is not free."""
    if name == "none" or len(way) < 3:
        return way
    room = max(0.0, min(clearance, float(field.distance(way[[0, -1]]).min())) - 1e-3)
    if name == "gradient":
        better = lifted(field, way, clearance)
        return better if clear(field, better, min(room, lowest(field, way))) else way
    best = way
    for _ in range(ROUNDS):
        best = offset(best, clearance)
        best = perturbed(field, best, 0.1 * clearance, rng)
        best = smoothed(best)
        if clear(field, best, 0.0):
            return best
        # what went into something is brought out again, and the three steps are repeated
        best = lifted(field, best, clearance)
    return way


def offset(way: Floats, by: float) -> Floats:
    """Every point but the ends moved away from the centroid of all."""
    away = way - way.mean(axis=0)
    far = np.linalg.norm(away, axis=1, keepdims=True)
    out = way + by * away / np.maximum(far, 1e-12)
    out[[0, -1]] = way[[0, -1]]
    return np.asarray(out)


def perturbed(field: DistanceField, way: Floats, by: float, rng: np.random.Generator) -> Floats:
    """Every point but the ends moved in the best of some random directions, if that takes it
    farther from solids."""
    out = way.copy()
    inner = len(way) - 2
    for _ in range(TRIALS):
        direction = rng.normal(size=(inner, 3))
        tried = out[1:-1] + by * direction / np.linalg.norm(direction, axis=1, keepdims=True)
        better = field.distance(tried) > field.distance(out[1:-1])
        out[1:-1][better] = tried[better]
    return out


def smoothed(way: Floats) -> Floats:
    """Cubic least-squares fits on overlapping segments, averaged where they overlap."""
    total, count = np.zeros_like(way), np.zeros((len(way), 1))
    step = SEGMENT - OVERLAP
    for first in range(0, max(1, len(way) - OVERLAP), step):
        part = slice(first, min(first + SEGMENT, len(way)))
        points = way[part]
        if len(points) <= 4:
            total[part] += points
        else:
            u = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
            if u[-1] == 0.0:
                total[part] += points
            else:
                basis = np.vander(u / u[-1], 4)
                total[part] += basis @ np.linalg.lstsq(basis, points, rcond=None)[0]
        count[part] += 1.0
    out = total / count
    out[[0, -1]] = way[[0, -1]]
    return np.asarray(out)


def lifted(field: DistanceField, way: Floats, clearance: float) -> Floats:
    """Every point but the ends moved up the distance field's gradient to the clearance."""
    out = way.copy()
    out[1:-1] = pushed_out(field, way[1:-1], clearance)
    return out


def lowest(field: DistanceField, way: Floats) -> float:
    """Least distance at the points of a way."""
    return float(field.distance(way).min())


def clear(field: DistanceField, way: Floats, room: float) -> bool:
    """Whether the straight lines between the points keep `room` from solids."""
    grown = field.grown(room)
    return all(grown.line_of_sight(a, b, depth=1e-2 * max(room, 0.1)) for a, b in pairwise(way))

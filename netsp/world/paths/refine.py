"""Refinement of paths, which makes them safer and smoother before they are followed.

`paper`: the three steps of Amer et al. 2025, section V-B, repeated until the path is free.
`gradient`: moves points up the distance field, so that no clearance gets smaller; not in the paper.

The paper does not state the length of segments, the length of moves or the number of trials of a
point (all in `RefineParams`). Nor does it say that moving points away from the centroid of the path
pushes points between centroid and structure *into* the structure. Here, the ends of a path stay, so
that it still leads from the robot to the waypoint.

About random moves the paper says that collision-free ones "are accepted", and in the next sentence
that this is "to locally increase clearance". By the first sentence any free move is kept
(`RefineParams.keeps` "free"), by the second only moves away from solids ("farther").
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.world.scene.field import DistanceField, pushed_out

REFINEMENTS = ("none", "paper", "gradient")

PERTURBATIONS = ("free", "farther")


@dataclass(frozen=True)
class RefineParams:
    """Options of the paper's three steps of refinement.

    Parameters
    ----------
    keeps : {"free", "farther"}
        Rule for the random moves of a point: keep the first free one, or every one that takes the
        point farther from solids.
    max_trials : int
        Number of random directions tried for each point; 1 or more.
    step_share : float
        Length of a random move, as a share of the clearance; more than 0.
    segment : int
        Number of points of a segment to which one cubic is fitted; 5 or more.
    overlap : int
        Number of points that successive segments share; fewer than `segment`.
    max_rounds : int
        Maximum number of repetitions of the three steps; if the path is still not free, it stays
        unrefined. 1 or more.
    """

    keeps: str = "free"
    max_trials: int = 10
    step_share: float = 0.1
    segment: int = 10
    overlap: int = 5
    max_rounds: int = 5

    def __post_init__(self) -> None:
        if self.keeps not in PERTURBATIONS:
            raise InputError(f"keeps: expected {' or '.join(PERTURBATIONS)}, got {self.keeps!r}")
        for name, minimum in (("max_trials", 1), ("segment", 5), ("overlap", 0), ("max_rounds", 1)):
            if getattr(self, name) < minimum:
                raise InputError(f"{name}: expected {minimum} or more, got {getattr(self, name)!r}")
        if self.overlap >= self.segment:
            raise InputError(f"overlap: expected less than {self.segment}, got {self.overlap!r}")
        if not 0.0 < self.step_share < np.inf:
            raise InputError(f"step_share: expected more than 0, got {self.step_share!r}")


def refined(
    name: str,
    field: DistanceField,
    path: Floats,
    clearance: float,
    rng: np.random.Generator,
    params: RefineParams | None = None,
) -> Floats:
    """Return the refined path (k, 3), or the original one if the refined path is not free."""
    params = params or RefineParams()
    if name == "none" or len(path) < 3:
        return path
    if name == "gradient":
        room = max(0.0, min(clearance, float(field.distance(path[[0, -1]]).min())) - 1e-3)
        better = lifted(field, path, clearance)
        return better if clear(field, better, min(room, lowest(field, path))) else path
    best = path
    for _ in range(params.max_rounds):
        best = stepped(field, best, clearance, rng, params)
        if clear(field, best, 0.0):
            return best
        # move points out of solids, and repeat the three steps
        best = lifted(field, best, clearance)
    return path


def stepped(
    field: DistanceField,
    path: Floats,
    clearance: float,
    rng: np.random.Generator,
    params: RefineParams,
) -> Floats:
    """Return a path after one round of the paper's three steps; it need not be free."""
    moved = offset(path, clearance)
    moved = perturbed(field, moved, params.step_share * clearance, rng, params)
    return smoothed(moved, params)


def offset(path: Floats, by: float) -> Floats:
    """Return a path with all points but the ends moved away from the centroid of all points."""
    away = path - path.mean(axis=0)
    far = np.linalg.norm(away, axis=1, keepdims=True)
    out = path + by * away / np.maximum(far, 1e-12)
    out[[0, -1]] = path[[0, -1]]
    return np.asarray(out)


def perturbed(
    field: DistanceField, path: Floats, by: float, rng: np.random.Generator, params: RefineParams
) -> Floats:
    """Return a path with random moves of all points but the ends, as far as the rule accepts
    them."""
    out = path.copy()
    waits = np.ones(len(path) - 2, dtype=bool)
    for _ in range(params.max_trials):
        direction = rng.normal(size=(len(waits), 3))
        tried = out[1:-1] + by * direction / np.linalg.norm(direction, axis=1, keepdims=True)
        if params.keeps == "farther":
            kept = field.distance(tried) > field.distance(out[1:-1])
        else:
            kept = waits & (field.distance(tried) > 0.0)
            waits &= ~kept
        out[1:-1][kept] = tried[kept]
    return out


def smoothed(path: Floats, params: RefineParams | None = None) -> Floats:
    """Return a path smoothed by cubics fitted to overlapping segments, averaged where they
    overlap."""
    params = params or RefineParams()
    total, count = np.zeros_like(path), np.zeros((len(path), 1))
    for first in range(0, max(1, len(path) - params.overlap), params.segment - params.overlap):
        part = slice(first, min(first + params.segment, len(path)))
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
    """Return a path with every point but the ends moved up the distance field to the clearance."""
    out = path.copy()
    out[1:-1] = pushed_out(field, path[1:-1], clearance)
    return out


def lowest(field: DistanceField, path: Floats) -> float:
    """Return the smallest distance of the points of a path from solids."""
    return float(field.distance(path).min())


def clear(field: DistanceField, path: Floats, room: float) -> bool:
    """Return whether the straight lines between the points of a path keep a distance from
    solids."""
    grown = field.grown(room)
    return all(grown.line_of_sight(a, b, depth=1e-2 * max(room, 0.1)) for a, b in pairwise(path))

"""Resolutions for tethers: how far apart their nodes may be."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats
from netsp.model.problem import Problem
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import scene_of
from netsp.world.tether.tether_policy import THINNEST


def suggested_delta(problem: Problem) -> float:
    """Return a resolution for the tether of a problem, metres.

    It is a three-hundredth of the tether's length, and fine enough for the thinnest obstacle.
    """
    return min(problem.tether_length / 300.0, coarsest_delta(problem) / 1.1)


def coarsest_delta(problem: Problem) -> float:
    """Return the coarsest resolution at which a tether passes through no obstacle, metres."""
    thickness = scene_of(problem).thickness()
    return float(min([problem.tether_length / 20.0, *(t / THINNEST for _, t in thickness)]))


def delta_for_path(field: DistanceField, path: Floats) -> float:
    """Return a resolution for a path in a scene, metres.

    It is a hundredth of the path's extent, and fine enough for the thinnest solid.
    """
    size = float(np.linalg.norm(path.max(0) - path.min(0))) or 1.0
    thinnest = min((t for _, t in field.thickness), default=np.inf)
    return float(max(min(size / 100.0, thinnest / (1.05 * THINNEST)), size / 5000.0))

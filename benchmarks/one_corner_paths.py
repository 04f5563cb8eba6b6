"""Bounds beside paths with one corner: the law of `space_law.py` in a second or two a scene.

The paths are straight, or have one corner in open water or in a passage that is known, and are
checked point by point. They are longer than the shortest ones, but need no search.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from random_scenes import random_scene

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.plan.space.mission_policy import PotentialPolicy, StatePolicy
from netsp.plan.space.path_bound import LegBounds, bound_all_tours
from netsp.plan.space.places import Places
from netsp.plan.space.planning_context import PlanningContext
from netsp.plan.space.space_legs import RobotPaths
from netsp.world.scene.field import DistanceField

COARSE = PotentialPolicy(min_cells=4_000, max_cells=30_000)
"""Effort of bounds that take a tenth of a second."""

MAX_WAYPOINTS, MAX_LEGS, CORNERS = 5, 3, 150
"""Waypoints of a scene, legs whose bound is raised, and random corners."""


@dataclass(frozen=True)
class Comparison:
    """Bounds of a scene beside paths and a tour.

    Attributes
    ----------
    lengths, bounds
        (v, v) lengths of paths, infinite where there is none, and bounds of the same legs, metres.
    tour, bound
        Length of a tour out to each waypoint and back, and bound on all tours, metres.
    """

    lengths: Floats
    bounds: Floats
    tour: float
    bound: float | None

    @property
    def legs(self) -> int:
        """Return the number of legs that were compared."""
        return int(np.isfinite(self.lengths[np.triu_indices(len(self.lengths), 1)]).sum())

    @property
    def above(self) -> int:
        """Return the number of bounds that are above a path or the tour."""
        legs = int((np.triu(self.bounds, 1) > self.lengths * (1.0 + 1e-9)).sum())
        return legs + (self.bound is not None and self.bound > self.tour * (1.0 + 1e-9))


def compare(kind: str, seed: int, folder: Path) -> Comparison | None:
    """Compare bounds with paths in a random scene; None if fewer than two waypoints have a path
    from the start.

    The tether is hardly longer than the longest of the paths to the waypoints, along which the
    robot goes out and back.
    """
    drawn = random_scene(kind, seed, folder)
    waypoints = tuple(w.model_copy(update={"alternatives": ()}) for w in drawn.mission.waypoints)
    mission = drawn.mission.model_copy(
        update={"waypoints": waypoints[:MAX_WAYPOINTS], "start": drawn.mission.anchor}
    )
    scene, field = drawn.scene, drawn.scene.field()
    points = np.array([mission.start, *(w.position for w in mission.waypoints)])
    near = np.minimum(mission.clearance, field.distance(points))
    rooms = np.maximum(0.0, np.minimum(near[:, None], near[None]) - 0.25 * mission.delta)
    low, high = np.array([-4.0, -4.0, -5.0]), np.array([4.0, 4.0, 0.0])
    corners = np.random.default_rng(0).uniform(low, high, (CORNERS, 3))
    corners = np.vstack([drawn.hints, corners])
    corners = corners[((corners >= low) & (corners <= high)).all(axis=1)]
    lengths = one_corner_lengths(field, points, corners, rooms)
    seen = np.flatnonzero(np.isfinite(lengths[0, 1:]))
    if len(seen) < 2:
        return None
    kept = np.r_[0, 1 + seen]
    lengths = lengths[np.ix_(kept, kept)]
    np.fill_diagonal(lengths, 0.0)
    mission = mission.model_copy(
        update={
            "waypoints": tuple(mission.waypoints[k] for k in seen),
            "tether_length": 1.02 * float(lengths[0].max()),
        }
    )
    context = PlanningContext.for_mission(mission, scene, field)
    places = Places.for_mission(mission, field)
    known = RobotPaths(context, places, StatePolicy().effort(len(places)))
    every = list(range(len(places)))
    legs = LegBounds(known, every, COARSE)
    is_blocked = np.triu(lengths > 1.001 * legs.costs) & np.isfinite(lengths)
    for u, v in np.argwhere(is_blocked)[:MAX_LEGS].tolist():
        while legs.raise_bound(u, v, Clock()):
            pass
    bound = bound_all_tours(known, every, Clock(1.0), potential=COARSE)
    return Comparison(lengths, legs.costs, 2.0 * float(lengths[0].sum()), bound)


def one_corner_lengths(
    field: DistanceField, points: Floats, corners: Floats, rooms: Floats
) -> Floats:
    """Return the lengths (v, v) of paths between points that keep the room (v, v) of their leg;
    infinite where there is none."""
    corners = corners[field.distance(corners) > 0.0]
    out = np.full(rooms.shape, np.inf)
    for u, v in itertools.combinations(range(len(points)), 2):
        a, b = points[u], points[v]
        far = np.linalg.norm(corners - a, axis=1) + np.linalg.norm(corners - b, axis=1)
        for c in (a, *corners[np.argsort(far)]):
            if has_room(field, a, c, rooms[u, v]) and has_room(field, c, b, rooms[u, v]):
                out[u, v] = out[v, u] = np.linalg.norm(c - a) + np.linalg.norm(b - c)
                break
    return out


def has_room(field: DistanceField, a: Floats, b: Floats, room: float) -> bool:
    """Return whether a segment keeps a room, sampled at half a centimetre."""
    count = 2 + int(np.linalg.norm(b - a) / 5e-3)
    points = a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)
    return bool(field.distance(points).min() >= room)

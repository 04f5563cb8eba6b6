"""Detour of a tether around an obstacle that appears on it, on the shorter side."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.ops import substring

from netsp.base.arrays import Floats
from netsp.model.problem import Problem


def pushed_aside(problem: Problem, nodes: Floats, by: float) -> Floats:
    """Return the tether's nodes (k, 3) with every stretch inside obstacles replaced by the shorter
    part of their outline, at a distance `by` outside of it, in the problem's units.

    A robot inside an obstacle is taken back along the tether to where it leaves the obstacle.
    Heights stay as they are along the tether.
    """
    line = np.array(nodes)
    solids = shapely.union_all([o.shape(problem.clearance) for o in problem.obstacles])
    base = shapely.Point(line[0, :2])
    for solid in getattr(solids, "geoms", [solids]):
        core, rim = solid.buffer(-by), solid.buffer(by)
        if core.is_empty or rim.covers(base):
            continue
        # a stretch around the rim enters the core again at most at its own ends
        for _ in range(20):
            line_in_plan = shapely.LineString(line[:, :2])
            inside = line_in_plan.intersection(core)
            if line_in_plan.length == 0.0 or inside.is_empty:
                break
            first_inside = min(
                (p for p in getattr(inside, "geoms", [inside])),
                key=lambda p: line_in_plan.project(shapely.Point(p.coords[0])),
            )
            middle = line_in_plan.project(first_inside.interpolate(0.5, normalized=True))
            outside = line_in_plan.difference(rim)
            pieces = list(getattr(outside, "geoms", [outside]))
            spans = [
                sorted(line_in_plan.project(shapely.Point(p.coords[k])) for k in (0, -1))
                for p in pieces
                if not p.is_empty
            ]
            start = max((b for _, b in spans if b <= middle), default=0.0)
            end = min((a for a, _ in spans if a >= middle), default=None)
            line = _led_around(line, rim, start, end)
    return line


def _led_around(line: Floats, rim: shapely.Polygon, start: float, end: float | None) -> Floats:
    """Return a line with its stretch from `start` to `end` (lengths in the plan) along a rim;
    without an end, cut off at the start."""
    s = np.r_[0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))]

    def point_at(distance: float) -> Floats:
        return np.array([np.interp(distance, s, line[:, k]) for k in range(3)])

    head = np.vstack([line[s < start], point_at(start)])
    if end is None:
        return head
    ring = rim.exterior
    a, b = (ring.project(shapely.Point(point_at(distance)[:2])) for distance in (start, end))
    low, high = min(a, b), max(a, b)
    arc_ahead = np.array(substring(ring, low, high).coords)
    arc_behind = np.vstack(
        [
            np.array(substring(ring, high, ring.length).coords),
            np.array(substring(ring, 0.0, low).coords),
        ]
    )
    arc_ahead = arc_ahead if a <= b else arc_ahead[::-1]
    arc_behind = arc_behind[::-1] if a <= b else arc_behind
    arc = min((arc_ahead, arc_behind), key=lambda w: float(np.hypot(*np.diff(w, axis=0).T).sum()))
    z = np.linspace(point_at(start)[2], point_at(end)[2], len(arc))
    return np.vstack([head, np.column_stack([arc, z]), point_at(end), line[s > end]])

"""Fence of a plan: obstacles as exclusion zones that fit into the vehicle's storage.

ArduPilot stores a fence as one record of bytes for each zone between a header and an end mark. A
circle takes its kind, two coordinates and a radius; a polygon its kind, its number of corners and
two coordinates a corner. So the limit counts bytes, not points: a flight controller of the Pixhawk
family without a memory card stores 51 circles, or one polygon of 83 corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import Point2
from netsp.model.problem import Circle, Polygon, Problem


@dataclass(frozen=True)
class FencePolicy:
    """Storage of a vehicle for its fence, and limits of the fence's zones.

    Attributes
    ----------
    max_bytes
        Storage of the vehicle for its fence, bytes. Flight controllers of the Pixhawk family
        without a memory card have 672, and ArduSub 4.7 stored 51 circles there. At least 18.
    head_bytes
        Bytes of the header and the end mark together.
    circle_bytes
        Bytes of a circle.
    polygon_bytes
        Bytes of a polygon without its corners.
    corner_bytes
        Bytes of a corner.
    max_corners
        Maximum number of corners of a polygon; the vehicle stores the number in one byte.
    max_growth
        Share of the clearance by which a simplified zone may reach beyond its obstacle, from 0 to
        less than 1. The path keeps the whole clearance; the rest is room for the vehicle's errors.
    growth_steps
        Number of growth limits up to the largest; zones grow by the smallest limit at which the
        fence fits.
    offset_shares
        Shares of the growth limit by which an obstacle is offset before its outline is simplified
        with the rest of the limit.
    quarter_segments
        Number of segments of a quarter circle of the region that a zone may fill; 16 segments cut
        its growth limit by up to 0.12 %.
    touch_distance
        Distance below which a path touches a zone, m: plan files round radii up to 1 mm and
        coordinates to 0.1 mm.
    """

    max_bytes: int = 672
    head_bytes: int = 5
    circle_bytes: int = 13
    polygon_bytes: int = 2
    corner_bytes: int = 8
    max_corners: int = 255
    max_growth: float = 0.5
    growth_steps: int = 8
    offset_shares: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75)
    quarter_segments: int = 16
    touch_distance: float = 2e-3

    def __post_init__(self) -> None:
        if not self.max_bytes >= self.min_bytes:
            raise InputError(
                f"max_bytes: expected {self.min_bytes} or more, got {self.max_bytes!r}"
            )
        if not 0.0 <= self.max_growth < 1.0:
            raise InputError(f"max_growth: expected 0 to less than 1, got {self.max_growth!r}")

    @property
    def min_bytes(self) -> int:
        """Size of the smallest fence with a zone: one circle."""
        return self.head_bytes + self.circle_bytes

    def size(self, zones: Sequence[Zone]) -> int:
        """Return the number of bytes of a fence, with header and end mark."""
        return self.head_bytes + sum(self.size_of(z) for z in zones)

    def size_of(self, zone: Zone) -> int:
        """Return the number of bytes of a zone, without header and end mark."""
        if isinstance(zone.shape, Circle):
            return self.circle_bytes
        return self.polygon_bytes + self.corner_bytes * len(zone.shape.polygon)


@dataclass(frozen=True)
class Zone:
    """Exclusion zone of a fence.

    Attributes
    ----------
    obstacle
        Index of its obstacle in the problem.
    shape
        Circle or polygon that contains the obstacle.
    growth
        Upper bound on the distance by which the zone reaches beyond its obstacle, in the problem's
        units; 0 for the obstacle itself.
    """

    obstacle: int
    shape: Circle | Polygon
    growth: float = 0.0


@dataclass(frozen=True)
class Fence:
    """Fence of a plan.

    Attributes
    ----------
    zones
        Zones in the order of the problem's obstacles.
    left_out
        Indices of the obstacles without a zone.
    n_bytes
        Number of bytes that the vehicle needs to store the fence.
    touched
        Indices of the obstacles whose zones the path touches or enters.
    """

    zones: tuple[Zone, ...]
    left_out: tuple[int, ...]
    n_bytes: int
    touched: tuple[int, ...] = ()

    @property
    def simplified(self) -> tuple[Zone, ...]:
        """Zones that reach beyond their obstacles."""
        return tuple(z for z in self.zones if z.growth > 0.0)


def fence_of(
    problem: Problem, path: Sequence[Point2] | Floats, policy: FencePolicy | None = None
) -> Fence:
    """Return a fence around the obstacles of a problem that fits into the vehicle's storage.

    If the exact obstacles take too many bytes, a polygon with fewer corners, or a circle, replaces
    each polygon. A simplified zone contains its obstacle, reaches beyond it by a share of the
    clearance at most, and does not touch the path. The share is the smallest of
    `policy.growth_steps` shares at which the fence fits. If none fits, the fence takes obstacles by
    their distance from the path, the nearest first, as long as they fit.

    Parameters
    ----------
    path : sequence of (x, y)
        Vertices of the tour, in the problem's units.

    Examples
    --------
    >>> site = Problem(base=(0, 0), goals=[(9, 0)], tether_length=20,
    ...                obstacles=[Circle(center=(x, 5), radius=0.1) for x in range(60)])
    >>> fence = fence_of(site, [(0, 0), (9, 0)])
    >>> len(fence.zones), fence.left_out[0], fence.n_bytes
    (51, 51, 668)
    """
    policy = policy or FencePolicy()
    line = shapely.LineString(np.asarray(path, dtype=float)[:, :2])
    zones = _fitting_zones(problem, line, policy)
    distance = {z.obstacle: problem.obstacles[z.obstacle].shape().distance(line) for z in zones}
    kept: list[Zone] = []
    for zone in sorted(zones, key=lambda z: (distance[z.obstacle], z.obstacle)):
        if not _is_large(zone, policy) and policy.size([*kept, zone]) <= policy.max_bytes:
            kept.append(zone)
    kept.sort(key=lambda z: z.obstacle)
    fenced = {z.obstacle for z in kept}
    left_out = tuple(k for k in range(len(problem.obstacles)) if k not in fenced)
    touched = tuple(z.obstacle for z in kept if _distance(z.shape, line) <= policy.touch_distance)
    return Fence(tuple(kept), left_out, policy.size(kept), touched)


def _fitting_zones(problem: Problem, line: shapely.LineString, policy: FencePolicy) -> list[Zone]:
    """Return zones that grow as little as it takes to fit, or else as much as they may."""

    def grown(step: int) -> list[Zone]:
        max_growth = policy.max_growth * problem.clearance * step / policy.growth_steps
        return [
            _simplified(z, problem.obstacles[z.obstacle], max_growth, line, policy) for z in exact
        ]

    def fits(zones: list[Zone]) -> bool:
        return policy.size(zones) <= policy.max_bytes and not any(
            _is_large(z, policy) for z in zones
        )

    exact = [Zone(k, o) for k, o in enumerate(problem.obstacles)]
    if fits(exact):
        return exact
    too_small, step = 0, policy.growth_steps
    zones = grown(step)
    if not fits(zones):
        return zones
    while step - too_small > 1:
        middle_step = (too_small + step) // 2
        tried = grown(middle_step)
        if fits(tried):
            zones, step = tried, middle_step
        else:
            too_small = middle_step
    return zones


def _distance(shape: Circle | Polygon, line: shapely.LineString) -> float:
    """Return the distance from a zone to a path; 0 if they touch."""
    if isinstance(shape, Circle):  # the polygon that stands for a circle is inscribed in it
        return max(0.0, float(line.distance(shapely.Point(shape.center))) - shape.radius)
    return float(shape.shape().distance(line))


def _is_large(zone: Zone, policy: FencePolicy) -> bool:
    return isinstance(zone.shape, Polygon) and len(zone.shape.polygon) > policy.max_corners


def _simplified(
    zone: Zone,
    obstacle: Circle | Polygon,
    max_growth: float,
    line: shapely.LineString,
    policy: FencePolicy,
) -> Zone:
    """Return the zone of the fewest bytes found around an obstacle, within a limit of growth."""
    if isinstance(obstacle, Circle) or max_growth <= 0.0:
        return zone
    body = shapely.Polygon(obstacle.polygon)
    limit = body.buffer(max_growth, quad_segs=policy.quarter_segments)
    best = zone
    for share in policy.offset_shares:
        offset_body = body.buffer(share * max_growth, join_style="mitre") if share else body
        for shape in (
            offset_body.simplify((1.0 - share) * max_growth),
            offset_body.convex_hull.simplify(0.5 * max_growth),
        ):
            if shape.geom_type != "Polygon" or shape.interiors or len(shape.exterior.coords) < 4:
                continue
            is_clear = shape.distance(line) > policy.touch_distance
            if not (is_clear and shape.covers(body) and limit.covers(shape)):
                continue
            corners = tuple((float(x), float(y)) for x, y in shape.exterior.coords[:-1])
            tried = Zone(zone.obstacle, Polygon(polygon=corners), max_growth)
            if policy.size_of(tried) < policy.size_of(best):
                best = tried
    circle = _circle_about(obstacle)
    # the disc is a polygon around the circle, whose corners lie farther out
    circumradius = circle.radius / np.cos(np.pi / (4.0 * policy.quarter_segments))
    disc = shapely.Point(circle.center).buffer(circumradius, quad_segs=policy.quarter_segments)
    round_zone = Zone(zone.obstacle, circle, max_growth)
    if (
        limit.covers(disc)
        and _distance(circle, line) > policy.touch_distance
        and policy.size_of(round_zone) < policy.size_of(best)
    ):
        best = round_zone
    return best


def _circle_about(obstacle: Polygon) -> Circle:
    """Return the smallest circle around a polygon, enlarged by a rounding error."""
    corners = np.array(obstacle.polygon)
    middle = shapely.minimum_bounding_circle(shapely.MultiPoint(corners)).centroid
    radius = float(np.hypot(corners[:, 0] - middle.x, corners[:, 1] - middle.y).max())
    return Circle(center=(middle.x, middle.y), radius=radius * (1.0 + 1e-9))

"""Boxes that fill the seams where solids touch.

The distance field of a scene is the minimum of the distances to its solids, which is exact outside.
Inside, a point on a face that two solids share has depth 0, although there is no water nearby. The
edges of a tether may cut into a surface by an eighth of delta, so a tether would pass along such a
face as through a slit. So every flat seam is filled with boxes that lie within the two solids.
Distances outside change by at most the gap that counts as touching.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon, box
from shapely.geometry.polygon import orient

from netsp.base.arrays import Floats
from netsp.base.bounded_work import end_if_abandoned
from netsp.world.scene.scene_policy import SeamPolicy
from netsp.world.scene.shapes import Box, Cylinder, HalfSpace, Prism, Shape

Rectangle = tuple[tuple[float, float, float, float], Floats]
"""Ends (x0, y0, x1, y1) of a rectangle in a frame of its own, and the first axis of the frame."""


@dataclass(frozen=True)
class Face:
    """Flat face of a solid.

    Parameters
    ----------
    corners : ndarray, shape (k, 3)
        Corners of a convex polygon, metres.
    normal : ndarray, shape (3,)
        Unit vector out of the solid.
    depth : float
        Depth of the solid behind all of the face, metres.
    inset : bool
        Whether the solid is only as deep behind a point of the face as the point is from its rim.
    """

    corners: Floats
    normal: Floats
    depth: float
    inset: bool = False


def seam_boxes(
    shapes: Sequence[Shape], policy: SeamPolicy | None = None
) -> list[tuple[int, list[float]]]:
    """Return boxes that fill the seams between solids.

    Parameters
    ----------
    shapes : sequence of Shape
        Solids.
    policy : SeamPolicy, optional
        Policy of seams.

    Returns
    -------
    list of (int, list of float)
        Index of one of the two solids, and the row of a box (`netsp.world.scene.solids`).
    """
    policy = policy or SeamPolicy()
    flat = [k for k, s in enumerate(shapes) if isinstance(s, Box | Cylinder | Prism | HalfSpace)]
    ends = np.array([_ends(shapes[k], policy) for k in flat]).reshape(-1, 2, 3)
    rows = []
    for n, a in enumerate(flat[:-1]):
        end_if_abandoned()
        others = ends[n + 1 :]
        gap = policy.max_gap
        near = (others[:, 0] <= ends[n, 1] + gap) & (others[:, 1] >= ends[n, 0] - gap)
        for m in np.flatnonzero(near.all(1)):
            b = flat[n + 1 + int(m)]
            at = 0.5 * (np.maximum(ends[n, 0], others[m, 0]) + np.minimum(ends[n, 1], others[m, 1]))
            for first in _faces(shapes[a], at, policy):
                for second in _faces(shapes[b], at, policy):
                    rows += [(a, row) for row in _between(first, second, policy)]
    return rows


def _ends(shape: Shape, policy: SeamPolicy) -> Floats:
    """Return the bounding box (2, 3) of a solid, cut off at a large size where there is no end."""
    found, far = shape.box(), policy.endless_size
    if found is None:
        return np.array([[-far] * 3, [far] * 3])
    if isinstance(shape, Prism):
        found[:, 2] = -far, far
    return found


def _faces(shape: Shape, at: Floats, policy: SeamPolicy) -> Iterator[Face]:
    """Yield the flat faces of a solid; of faces without end, the part about a point."""
    if isinstance(shape, Box):
        axes, half = shape.axes(), 0.5 * np.array(shape.size)
        for k in range(3):
            u, v = (axes[i] * half[i] for i in range(3) if i != k)
            for side in (1.0, -1.0):
                middle = np.array(shape.center) + side * half[k] * axes[k]
                corners = middle + np.array([u + v, u - v, -u - v, v - u])
                yield Face(corners, side * axes[k], 2.0 * half[k])
    elif isinstance(shape, Cylinder):
        a, b = np.array(shape.a), np.array(shape.b)
        axis = (b - a) / shape.length
        u, v = _across(axis)
        angle = np.linspace(0.0, 2.0 * np.pi, policy.circle_corners, endpoint=False)[:, None]
        ring = shape.radius * (np.cos(angle) * u + np.sin(angle) * v)
        yield Face(a + ring, -axis, shape.length)
        yield Face(b + ring, axis, shape.length)
    elif isinstance(shape, HalfSpace):
        normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
        u, v = _across(normal)
        middle = at - ((at - np.array(shape.point)) @ normal) * normal
        square = np.array([u + v, u - v, -u - v, v - u])
        yield Face(middle + policy.endless_size * square, normal, np.inf)
    elif isinstance(shape, Prism):
        polygon = Polygon(shape.polygon)
        ring = np.array(polygon.exterior.coords)
        if not polygon.exterior.is_ccw:
            ring = ring[::-1]
        up = np.array([0.0, 0.0, policy.endless_size])
        for p, q in pairwise(ring):
            along = (q - p) / np.linalg.norm(q - p)
            normal = np.array([along[1], -along[0], 0.0])
            a, b = (np.array([*c, at[2]]) + shape.grow * normal for c in (p, q))
            yield Face(np.array([a - up, b - up, b + up, a + up]), normal, shape.thickness(), True)


def _across(axis: Floats) -> tuple[Floats, Floats]:
    """Return two unit vectors across an axis and one another."""
    u = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    u /= np.linalg.norm(u)
    return u, np.cross(axis, u)


def _between(first: Face, second: Face, policy: SeamPolicy) -> Iterator[list[float]]:
    """Yield the rows of the boxes between two faces that touch or nearly touch."""
    if first.normal @ second.normal > -np.cos(policy.max_angle):
        return
    gap = float((second.corners.mean(0) - first.corners[0]) @ first.normal)
    if not -policy.max_overlap <= gap <= policy.max_gap:
        return
    # depth of each box in both solids, from half way between the faces
    thick = min(first.depth, second.depth, policy.max_depth) - 0.5 * abs(gap)
    normal, origin = first.normal, first.corners[0]
    u = max(np.roll(first.corners, -1, axis=0) - first.corners, key=np.linalg.norm)
    u = u / np.linalg.norm(u)
    v = np.cross(normal, u)
    frame = np.column_stack([u, v])
    shared = Polygon((first.corners - origin) @ frame).intersection(
        Polygon((second.corners - origin) @ frame)
    )
    if first.inset or second.inset:
        thick = 0.5 * min(thick, _width(shared))
        shared = shared.buffer(-thick, join_style="mitre")
    if not isinstance(shared, Polygon) or shared.is_empty:
        return
    if min(thick, _width(shared)) < policy.min_width:
        return
    level = origin + 0.5 * gap * normal
    for (x0, y0, x1, y1), turned in _rectangles(shared, policy):
        along = turned[0] * u + turned[1] * v
        middle = np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1)])
        across = np.cross(normal, along)
        centre = level + middle[0] * along + middle[1] * across
        half = [0.5 * (x1 - x0), 0.5 * (y1 - y0), thick]
        yield [*centre, *half, *along, *across, *normal]


def _width(shared: Polygon) -> float:
    """Return the shorter side of the rectangle about a convex polygon."""
    if not isinstance(shared, Polygon) or shared.is_empty:
        return 0.0
    corners = np.array(shared.minimum_rotated_rectangle.exterior.coords)[:3]
    return float(np.linalg.norm(np.diff(corners, axis=0), axis=1).min())


def _rectangles(shared: Polygon, policy: SeamPolicy) -> Iterator[Rectangle]:
    """Yield rectangles inside a convex polygon that cover it except for slivers."""
    around = shared.minimum_rotated_rectangle
    corners = np.array(around.exterior.coords)[:4]
    edges = np.diff(corners[:3], axis=0)
    first = edges[np.linalg.norm(edges, axis=1).argmax()]
    first = first / np.linalg.norm(first)
    frame = np.column_stack([first, [-first[1], first[0]]])
    if shared.area >= (1.0 - 1e-9) * around.area:
        local = corners @ frame
        yield (*local.min(0), *local.max(0)), first
        return
    shared = shapely.remove_repeated_points(shared, policy.min_width)
    if len(shared.exterior.coords) - 1 <= policy.max_few_sides:
        yield from _on_sides(shared, policy)
    else:
        yield from _in_strips(shared, first, policy)


def _on_sides(shared: Polygon, policy: SeamPolicy) -> Iterator[Rectangle]:
    """Yield rectangles of growing heights on each side of a convex polygon."""
    corners = np.array(orient(shared).exterior.coords)
    for p, q in pairwise(corners):
        length = float(np.linalg.norm(q - p))
        along = (q - p) / length
        turned = Polygon(corners @ np.column_stack([along, [-along[1], along[0]]]))
        x, y = along @ p, -along[1] * p[0] + along[0] * p[1]
        left, _, right, top = turned.bounds
        height, top = policy.min_height, top - y
        while height < policy.height_growth * top:
            upper = min(height, top - policy.min_width)
            across = LineString([(left - 1.0, y + upper), (right + 1.0, y + upper)])
            x0, _, x1, _ = turned.intersection(across).bounds
            x0, x1 = max(x, x0), min(x + length, x1)
            if x1 - x0 > policy.min_width:
                yield (x0, y, x1, y + upper), along
            height *= policy.height_growth


def _in_strips(shared: Polygon, first: Floats, policy: SeamPolicy) -> Iterator[Rectangle]:
    """Yield rectangles between cuts across a convex polygon, in a frame with the given first
    axis."""
    turned = Polygon(
        np.array(shared.exterior.coords) @ np.column_stack([first, [-first[1], first[0]]])
    )
    x0, y0, x1, y1 = turned.bounds
    wanted = np.ceil((x1 - x0) / policy.strip_width)
    strips = int(np.clip(wanted, policy.min_strips, policy.max_strips))
    cuts = np.linspace(x0, x1, strips + 1)[1:-1]
    # the lower side is convex and the upper concave: between two cuts they are narrowest at these
    sides = [turned.intersection(box(x, y0 - 1.0, x, y1 + 1.0)).bounds for x in cuts]
    # successive boxes must overlap: boxes that only touch would leave another seam
    nested = {(k, strips - 2 - k) for k in range((strips - 2) // 2)}
    in_a_row = {(k, k + 4) for k in range(0, strips - 5, 2)} | {(strips - 6, strips - 2)}
    for i, j in sorted(nested | in_a_row):
        low = max(sides[i][1], sides[j][1])
        high = min(sides[i][3], sides[j][3])
        if high - low > policy.min_width:
            yield (cuts[i], low, cuts[j], high), first

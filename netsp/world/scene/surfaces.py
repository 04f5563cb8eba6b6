"""Triangles of a scene's surface, for pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.number_ranges import check_positive
from netsp.world.scene.scene import Scene
from netsp.world.scene.shapes import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Post,
    Prism,
    Shape,
    Sphere,
    Torus,
)

Faces = npt.NDArray[np.int64]
Triangles = tuple[Floats, Faces]


@dataclass(frozen=True)
class SurfacePolicy:
    """Policy of the surfaces that pictures show. All numbers are positive.

    Attributes
    ----------
    circle_sides
        Number of sides of the polygon that stands for a circle.
    max_cloud_points
        Maximum number of points of a cloud that are drawn.
    """

    circle_sides: int = 32
    max_cloud_points: int = 20_000

    def __post_init__(self) -> None:
        check_positive(self)


def surface_of(
    shape: Shape, low: Floats, high: Floats, policy: SurfacePolicy | None = None
) -> Triangles:
    """Return the vertices (n, 3) and faces (m, 3) of a shape.

    A shape without end is cut off at the corners `low` and `high` (3,) of the picture.
    """
    sides = (policy or SurfacePolicy()).circle_sides
    if isinstance(shape, Sphere):
        return _tube(np.array([shape.center, shape.center]), shape.radius, sides, round_ends=True)
    if isinstance(shape, Capsule):
        return _tube(np.array([shape.a, shape.b]), shape.radius, sides, round_ends=True)
    if isinstance(shape, Cylinder):
        return _tube(np.array([shape.a, shape.b]), shape.radius, sides)
    if isinstance(shape, Torus):
        closed = shape.angle == 360.0
        return _tube(shape.centreline(), shape.minor_radius, sides, round_ends=not closed)
    if isinstance(shape, Box):
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        vertices = np.array(shape.center) + 0.5 * corners * shape.size @ shape.axes()
        return vertices, _BOX
    if isinstance(shape, Post):
        x, y = shape.center
        return _tube(np.array([[x, y, low[2]], [x, y, high[2]]]), shape.radius, sides)
    if isinstance(shape, Prism):
        return _walls(shape, float(low[2]), float(high[2]))
    return _plane(shape, low, high)


_BOX = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def _tube(line: Floats, radius: float, sides: int, round_ends: bool = False) -> Triangles:
    """Return a tube about a line of points, with flat or round ends."""
    ahead = np.diff(line, axis=0, append=2 * line[-1:] - line[-2:-1])
    if not np.any(ahead):
        ahead[:] = [0.0, 0.0, 1.0]
    tangents = ahead.copy()
    tangents[1:-1] = ahead[1:-1] + ahead[:-2]
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    centres, radii, axes = list(line), [radius] * len(line), list(tangents)
    if round_ends:
        steps = np.radians([80.0, 60.0, 40.0, 20.0])
        first = [(line[0] - tangents[0] * radius * np.sin(s), radius * np.cos(s)) for s in steps]
        last = [(line[-1] + tangents[-1] * radius * np.sin(s), radius * np.cos(s)) for s in steps]
        centres = [c for c, _ in first] + centres + [c for c, _ in reversed(last)]
        radii = [r for _, r in first] + radii + [r for _, r in reversed(last)]
        axes = [tangents[0]] * 4 + axes + [tangents[-1]] * 4
    turn = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    across = np.eye(3)[np.abs(axes[0]).argmin()]
    rings = []
    for centre, r, axis in zip(centres, radii, axes, strict=True):
        across = across - (across @ axis) * axis
        across = across / np.linalg.norm(across)
        other = np.cross(axis, across)
        rings.append(centre + r * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * other))
    vertices = np.vstack([*rings, centres[0], centres[-1]])
    k = np.arange(sides)
    nxt = (k + 1) % sides
    faces = [
        np.vstack(
            [np.column_stack([a + k, a + nxt, b + k]), np.column_stack([a + nxt, b + nxt, b + k])]
        )
        for a, b in ((sides * i, sides * (i + 1)) for i in range(len(rings) - 1))
    ]
    top = sides * (len(rings) - 1)
    ends = sides * len(rings)
    faces.append(np.column_stack([nxt, k, np.full(sides, ends)]))
    faces.append(np.column_stack([top + k, top + nxt, np.full(sides, ends + 1)]))
    return vertices, np.vstack(faces)


def _walls(shape: Prism, bottom: float, top: float) -> Triangles:
    import shapely

    grown = shapely.Polygon(shape.polygon).buffer(shape.grow, quad_segs=6)
    outer = shapely.Polygon(grown.exterior)
    ring = np.array(outer.exterior.coords)[:-1]
    n = len(ring)
    k, nxt = np.arange(n), (np.arange(n) + 1) % n
    vertices = np.vstack(
        [np.column_stack([ring, np.full(n, bottom)]), np.column_stack([ring, np.full(n, top)])]
    )
    faces = [np.column_stack([k, nxt, n + k]), np.column_stack([nxt, n + nxt, n + k])]
    place = {tuple(p): i for i, p in enumerate(ring)}
    for lid in shapely.constrained_delaunay_triangles(outer).geoms:
        corners = [place.get(tuple(p), -1) for p in np.array(lid.exterior.coords)[:3]]
        if min(corners) >= 0:
            faces += [np.array([corners]), n + np.array([corners])]
    return vertices, np.vstack(faces)


def _plane(shape: HalfSpace, low: Floats, high: Floats) -> Triangles:
    normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    middle = 0.5 * (low + high)
    middle = middle - ((middle - shape.point) @ normal) * normal
    reach = 0.5 * float(np.linalg.norm(high - low))
    vertices = np.array(
        [middle + reach * (a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )
    return vertices, np.array([[0, 1, 2], [0, 2, 3]])


def extent(scene: Scene, *points: Floats) -> tuple[Floats, Floats]:
    """Return the corners of the box that a picture of the scene shows, with some room."""
    boxes = [np.asarray(p, dtype=float).reshape(-1, 3) for p in points if len(p)]
    flat = []
    for solid in scene.all_solids():
        box = solid.shape.box()
        if box is not None and isinstance(solid.shape, Post | Prism):
            flat.append(box)
        elif box is not None:
            boxes.append(box)
    boxes += [vertices for _, (vertices, _) in scene.meshes()]
    if scene.cloud is not None:
        boxes.append(drawn_points(scene))
    if not boxes and not flat and scene.bounds is not None:
        boxes.append(np.array(scene.bounds).reshape(2, 3))
    if not boxes and not flat:
        raise InputError(f"{scene.name}: nothing to draw")
    if flat:
        xy = np.vstack(flat)
        z = np.vstack(boxes)[:, 2] if boxes else np.zeros(1)
        tall = 0.15 * float(np.ptp(xy[:, :2], axis=0).max())
        boxes += [
            np.column_stack([xy[:, :2], np.full(len(xy), z.min() - tall)]),
            np.column_stack([xy[:, :2], np.full(len(xy), z.max() + tall)]),
        ]
    everything = np.vstack(boxes)
    low, high = everything.min(0), everything.max(0)
    room = 0.03 * float((high - low).max()) + 1e-9
    return low - room, high + room


def drawn_points(scene: Scene, policy: SurfacePolicy | None = None) -> Floats:
    """Return evenly chosen points of the scene's cloud, few enough to draw."""
    from netsp.world.scene.readers import read_cloud_file

    assert scene.cloud is not None
    max_points = (policy or SurfacePolicy()).max_cloud_points
    points = read_cloud_file(scene.cloud.file, scene.cloud.placement).points
    return np.asarray(points[:: -(-len(points) // max_points)])

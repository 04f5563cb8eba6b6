"""Shapes of Shapely from well-known binary of all geometry types (ISO 19125-1, SQL/MM part 3).

Shapely reads points, lines and polygons only. Curves become lines of short steps, faces of surfaces
the outline of what they cover from above, and rings that are not closed are closed.
"""

from __future__ import annotations

import enum
import itertools
import math
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry.polygons import union
from netsp.exchange.maps.import_policy import DEFAULT_READ, ReadPolicy

if TYPE_CHECKING:
    import shapely


class Wkb(enum.IntEnum):
    """Codes of geometry types in well-known binary."""

    POINT = 1
    LINE = 2
    POLYGON = 3
    MULTI_POINT = 4
    MULTI_LINE = 5
    MULTI_POLYGON = 6
    COLLECTION = 7
    ARCS = 8
    COMPOUND_CURVE = 9
    CURVE_POLYGON = 10
    MULTI_CURVE = 11
    MULTI_SURFACE = 12
    POLYHEDRAL_SURFACE = 15
    TIN = 16
    TRIANGLE = 17


FACES = (Wkb.POLYHEDRAL_SURFACE, Wkb.TIN)
COLLECTIONS = (
    *(Wkb.MULTI_POINT, Wkb.MULTI_LINE, Wkb.MULTI_POLYGON, Wkb.COLLECTION),
    *(Wkb.MULTI_CURVE, Wkb.MULTI_SURFACE),
    *FACES,
)

CLOSED = "a ring is not closed: closed by its first corner"
FROM_ABOVE = "made of faces: taken as their outline from above"
COLLAPSED = "an area of no width: taken as a line"


class ShapeError(Exception):
    """Shape that cannot be used; the text is the reason."""


class NotFiniteError(ShapeError):
    """Shape with coordinates that are not finite, which is a defect of the file."""

    def __init__(self) -> None:
        super().__init__("expected finite coordinates")


def shape_of(
    data: bytes, policy: ReadPolicy = DEFAULT_READ
) -> tuple[shapely.Geometry, tuple[str, ...]]:
    """Return the shape of well-known binary of any type, without measures (M).

    Parameters
    ----------
    data : bytes
        ISO or extended well-known binary.

    Returns
    -------
    shape : shapely.Geometry
        Point, line, polygon, one of their collections, or a `GeometryCollection`.
    changes : tuple of str
        Changes such as `CLOSED`.

    Raises
    ------
    ShapeError
        The data are damaged, or of another type.

    Examples
    --------
    >>> import shapely, struct
    >>> corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)]
    >>> ring = struct.pack("<I", 3) + b"".join(struct.pack("<2d", *c) for c in corners)
    >>> shape, changes = shape_of(struct.pack("<BII", 1, 3, 1) + ring)
    >>> shape.area, changes
    (2.0, ('a ring is not closed: closed by its first corner',))
    """
    import shapely

    reader = _Reader(data, policy)
    try:
        shape = reader.geometry()
    except (struct.error, IndexError, MemoryError):
        raise ShapeError("its geometry is damaged (cut short)") from None
    except (ValueError, shapely.errors.ShapelyError) as error:
        raise ShapeError(f"its geometry is damaged ({str(error).splitlines()[0][:80]})") from None
    return shape, tuple(dict.fromkeys(reader.changes))


def ring_of(points: Floats, changes: list[str]) -> Floats:
    """Return the corners of a ring, closed; if it was open, `CLOSED` is appended to the changes."""
    if len(points) and not np.array_equal(points[0, :2], points[-1, :2]):
        changes.append(CLOSED)
        return np.vstack([points, points[:1]])
    return points


def area_of(rings: list[Floats], changes: list[str]) -> shapely.Geometry:
    """Return the polygon of rings, the outer one first, perhaps empty.

    An outer ring with two distinct corners gives a line. Changes are appended to `changes`.
    """
    import shapely

    if not rings or not len(rings[0]):
        return shapely.Polygon()
    if not np.isfinite(np.vstack(rings)[:, :2]).all():
        raise NotFiniteError
    outer = rings[0]
    distinct = np.unique(outer[:, :2], axis=0)
    if len(distinct) == 1:
        raise ShapeError("an area that is one point")
    if len(distinct) == 2:
        changes.append(COLLAPSED)
        return shapely.LineString(
            outer[np.append(True, (np.diff(outer[:, :2], axis=0) != 0).any(1))]
        )
    holes = [r for r in rings[1:] if len(np.unique(r[:, :2], axis=0)) > 2]
    return shapely.Polygon(ring_of(outer, changes), [ring_of(h, changes) for h in holes])


def outline_of_faces(faces: list[shapely.Geometry], changes: list[str]) -> shapely.Geometry:
    """Return the area that faces in space cover from above, or the line of an upright wall.

    `FROM_ABOVE` is appended to the changes.
    """
    import shapely

    changes.append(FROM_ABOVE)
    flat = [shapely.force_2d(f) for f in faces if not f.is_empty]
    solid = [f for f in flat if f.geom_type == "Polygon" and _has_area(f)]
    whole = union([shapely.make_valid(f) for f in solid])
    areas = [p for p in getattr(whole, "geoms", [whole]) if "Polygon" in p.geom_type]
    whole = union(areas)
    if not whole.is_empty:
        return whole
    lines = [shapely.LineString(shapely.get_coordinates(f)) for f in flat]
    wall = shapely.line_merge(shapely.union_all([s for s in lines if s.length > 0.0]))
    return wall


def arc_points(start: Floats, middle: Floats, end: Floats, max_step: float) -> Floats:
    """Return points along the arc through three points, both ends included.

    Parameters
    ----------
    start, middle, end : ndarray, shape (2,) or (3,)
        Points in the order of the arc; a full circle ends where it starts, with the middle
        opposite.
    max_step : float
        Maximum angle between consecutive points, radians.

    Returns
    -------
    ndarray
        Points of the arc; three points on one line are returned unchanged.
    """
    a, b, c = start[:2], middle[:2], end[:2]
    if np.array_equal(a, c):
        centre, turn = 0.5 * (a + b), 2.0 * math.pi
    else:
        d1, d2 = b - a, c - a
        cross = float(d1[0] * d2[1] - d1[1] * d2[0])
        if abs(cross) <= 1e-12 * float(np.hypot(*d1) * np.hypot(*d2)):
            return np.vstack([start, middle, end])
        q1, q2 = float(d1 @ d1), float(d2 @ d2)
        centre = a + np.array([d2[1] * q1 - d1[1] * q2, d1[0] * q2 - d2[0] * q1]) / (2.0 * cross)
        angles = [math.atan2(*(p - centre)[::-1]) for p in (a, c)]
        turn = (angles[1] - angles[0]) % (2.0 * math.pi)
        if cross < 0.0:
            turn -= 2.0 * math.pi
    radius = float(np.hypot(*(a - centre)))
    first = math.atan2(*(a - centre)[::-1])
    steps = max(2, math.ceil(abs(turn) / max_step - 1e-9))
    share = np.linspace(0.0, 1.0, steps + 1)
    angle_at = first + turn * share
    plane = centre + radius * np.column_stack([np.cos(angle_at), np.sin(angle_at)])
    plane[0], plane[-1] = a, c
    if len(start) == 2:
        return plane
    height = start[2] + (end[2] - start[2]) * share
    return np.column_stack([plane, height])


def _has_area(polygon: shapely.Geometry) -> bool:
    """Return whether a face is visible from above, beyond the rounding of upright sides."""
    return bool(polygon.area > 1e-9 * polygon.length**2)


@dataclass
class _Reader:
    """Reader of one geometry."""

    data: bytes
    policy: ReadPolicy
    position: int = 0

    def __post_init__(self) -> None:
        self.changes: list[str] = []

    def geometry(self, depth: int = 0, *, is_face: bool = False) -> shapely.Geometry:
        import shapely

        if depth > self.policy.max_geometry_depth:
            raise ShapeError(f"geometries nested more than {self.policy.max_geometry_depth} times")
        kind, order, has_z, has_m = self._head()
        size = 2 + has_z + has_m
        if kind == Wkb.POINT:
            return self._point(self._floats(1, size, order)[:, : 2 + has_z])
        if kind in (Wkb.LINE, Wkb.ARCS):
            points = self._points(order, size)[:, : 2 + has_z]
            return _line(
                _along_arcs(points, self.policy.max_arc_step) if kind == Wkb.ARCS else points
            )
        if kind in (Wkb.POLYGON, Wkb.TRIANGLE):
            count = self._count(order)
            rings = [self._points(order, size)[:, : 2 + has_z] for _ in range(count)]
            # an upright face is a line from above, which is no change
            area = area_of(rings, [] if is_face else self.changes)
            return (
                area if kind == Wkb.POLYGON or is_face else outline_of_faces([area], self.changes)
            )
        count = (
            self._count(order)
            if kind in (*COLLECTIONS, Wkb.COMPOUND_CURVE, Wkb.CURVE_POLYGON)
            else 0
        )
        if kind in (Wkb.COMPOUND_CURVE, Wkb.CURVE_POLYGON) or kind in COLLECTIONS:
            parts = [self.geometry(depth + 1, is_face=kind in FACES) for _ in range(count)]
        else:
            raise ShapeError(f"its geometry is of a type that is not read (number {kind})")
        parts = [p for p in parts if not p.is_empty]
        if kind == Wkb.COMPOUND_CURVE:
            pieces = [np.asarray(shapely.get_coordinates(p, include_z=has_z)) for p in parts]
            return _line(_joined(pieces))
        if kind == Wkb.CURVE_POLYGON:
            rings = [np.asarray(shapely.get_coordinates(p, include_z=has_z)) for p in parts]
            return area_of(rings, self.changes)
        if kind in FACES:
            return outline_of_faces(parts, self.changes) if parts else shapely.Polygon()
        return collected(parts)

    def _point(self, coordinates: Floats) -> shapely.Geometry:
        import shapely

        if np.isnan(coordinates).all():  # ISO: an empty point
            return shapely.Point()
        if not np.isfinite(coordinates[:, :2]).all():
            raise NotFiniteError
        return shapely.Point(coordinates[0])

    def _head(self) -> tuple[int, str, bool, bool]:
        order = "<" if self.data[self.position] else ">"
        (code,) = struct.unpack_from(f"{order}I", self.data, self.position + 1)
        self.position += 5
        has_z, has_m = bool(code & 0x80000000), bool(code & 0x40000000)
        if code & 0x20000000:  # extended: the system's number
            self.position += 4
        code &= 0x0FFFFFFF
        has_z |= code // 1000 in (1, 3)
        has_m |= code // 1000 in (2, 3)
        return code % 1000, order, has_z, has_m

    def _count(self, order: str) -> int:
        (count,) = struct.unpack_from(f"{order}I", self.data, self.position)
        self.position += 4
        if count > len(self.data):
            raise ShapeError("its geometry is damaged (cut short)")
        return int(count)

    def _points(self, order: str, size: int) -> Floats:
        return self._floats(self._count(order), size, order)

    def _floats(self, count: int, size: int, order: str) -> Floats:
        end = self.position + 8 * count * size
        if end > len(self.data):
            raise ShapeError("its geometry is damaged (cut short)")
        out = np.frombuffer(self.data, f"{order}f8", count * size, self.position).astype(float)
        self.position = end
        return out.reshape(count, size)


def collected(parts: list[shapely.Geometry]) -> shapely.Geometry:
    """Return geometries as one: a multipart geometry, or a `GeometryCollection` if types differ."""
    import shapely

    simple = [p for part in parts for p in getattr(part, "geoms", [part])]
    kinds = {p.geom_type for p in simple}
    for kind, whole in (
        ("Point", shapely.MultiPoint),
        ("LineString", shapely.MultiLineString),
        ("Polygon", shapely.MultiPolygon),
    ):
        if kinds == {kind}:
            return whole(simple)
    return shapely.GeometryCollection(parts)


def _line(points: Floats) -> shapely.Geometry:
    import shapely

    if not len(points):
        return shapely.LineString()
    if not np.isfinite(points[:, :2]).all():
        raise NotFiniteError
    if len(points) == 1:
        raise ShapeError("a line of one place")
    return shapely.LineString(points)


def _along_arcs(points: Floats, max_step: float) -> Floats:
    """Return the points along arcs, each through a corner, a middle and the next corner."""
    if len(points) < 3 or len(points) % 2 == 0:
        return points
    arcs = [
        arc_points(points[k], points[k + 1], points[k + 2], max_step)
        for k in range(0, len(points) - 2, 2)
    ]
    return _joined(arcs)


def _joined(pieces: list[Floats]) -> Floats:
    """Return pieces of a curve as one, each starting at the end of the previous one."""
    if not pieces:
        return np.empty((0, 2))
    rest = [
        after[1:] if np.array_equal(before[-1], after[0]) else after
        for before, after in itertools.pairwise(pieces)
    ]
    return np.vstack([pieces[0], *rest])

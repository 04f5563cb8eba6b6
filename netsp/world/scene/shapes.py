"""Solids of a scene as files state them, and their rows for kernels."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from netsp.base.arrays import Floats
from netsp.base.field_types import NonNegative, Number, Point2, Point3, Positive
from netsp.base.geometry.polygons import polygon_thickness
from netsp.base.validated import Model
from netsp.model.problem import Polygon
from netsp.world.scene import solids as kinds

SolidRow = tuple[int, list[float]]


class Sphere(Model):
    """Ball."""

    center: Annotated[Point3, Field(description="(x, y, z), m")]
    radius: Annotated[Positive, Field(description="radius, m")]

    def row(self) -> SolidRow:
        """Return the kind and the row for kernels (`netsp.world.scene.solids`)."""
        return kinds.CAPSULE, [*self.center, *self.center, self.radius]

    def thickness(self) -> float:
        """Return the thickness of the thinnest part, metres; infinite for a half space."""
        return 2.0 * self.radius

    def box(self) -> Floats:
        """Return the bounding box (2, 3), metres; 0 along axes without end."""
        return _around([self.center], self.radius)


class Capsule(Model):
    """All points within a radius of a segment: a pipe or strut with round ends."""

    a: Annotated[Point3, Field(description="(x, y, z) of one end of its axis, m")]
    b: Annotated[Point3, Field(description="(x, y, z) of the other end, m")]
    radius: Annotated[Positive, Field(description="radius, m")]

    def row(self) -> SolidRow:
        """Return the kind and the row for kernels (`netsp.world.scene.solids`)."""
        return kinds.CAPSULE, [*self.a, *self.b, self.radius]

    def thickness(self) -> float:
        """Return the thickness of the thinnest part, metres; infinite for a half space."""
        return 2.0 * self.radius

    def box(self) -> Floats:
        """Return the bounding box (2, 3), metres; 0 along axes without end."""
        return _around([self.a, self.b], self.radius)


class Cylinder(Model):
    """Cylinder with flat ends: a pipe, a flange."""

    a: Annotated[Point3, Field(description="(x, y, z) of the centre of one face, m")]
    b: Annotated[Point3, Field(description="(x, y, z) of the centre of the other, m")]
    radius: Annotated[Positive, Field(description="radius, m")]

    @model_validator(mode="after")
    def _long(self) -> Self:
        if math.dist(self.a, self.b) < 1e-9:
            raise ValueError("a and b: expected two different points")
        return self

    @property
    def length(self) -> float:
        """Length of its axis, metres."""
        return math.dist(self.a, self.b)

    def row(self) -> SolidRow:
        """Return the kind and the row for kernels (`netsp.world.scene.solids`)."""
        axis = (np.array(self.b) - np.array(self.a)) / self.length
        return kinds.CYLINDER, [*self.a, *axis, self.radius, self.length]

    def thickness(self) -> float:
        """Return the thickness of the thinnest part, metres; infinite for a half space."""
        return min(2.0 * self.radius, self.length)

    def box(self) -> Floats:
        """Return the bounding box (2, 3), metres; 0 along axes without end."""
        axis = (np.array(self.b) - np.array(self.a)) / self.length
        reach = self.radius * np.sqrt(np.maximum(0.0, 1.0 - axis**2))
        ends = np.array([self.a, self.b])
        return np.array([ends.min(0) - reach, ends.max(0) + reach])


class Box(Model):
    """Box of a full size, turned by angles in degrees about x, then y, then z."""

    center: Annotated[Point3, Field(description="(x, y, z), m")]
    size: Annotated[
        tuple[Positive, Positive, Positive], Field(description="full lengths of its edges, m")
    ]
    rotation: Annotated[
        tuple[Number, Number, Number], Field(description="angles about x, then y, then z, degrees")
    ] = (0.0, 0.0, 0.0)

    def axes(self) -> Floats:
        """Return the axes of the box in the world, as rows."""
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_euler("xyz", self.rotation, degrees=True).as_matrix().T)

    def row(self) -> SolidRow:
        """Return the kind and the row for kernels (`netsp.world.scene.solids`)."""
        half = [0.5 * s for s in self.size]
        return kinds.BOX, [*self.center, *half, *self.axes().ravel()]

    def thickness(self) -> float:
        """Return the thickness of the thinnest part, metres; infinite for a half space."""
        return min(self.size)

    def box(self) -> Floats:
        """Return the bounding box (2, 3), metres; 0 along axes without end."""
        reach = 0.5 * np.abs(self.axes()).T @ np.array(self.size)
        return np.array([np.array(self.center) - reach, np.array(self.center) + reach])


class Torus(Model):
    """All points within a radius of an arc: a ring, or an elbow of a pipe.

    The arc begins in the direction `start`, and turns by `angle` degrees about `axis`.
    """

    center: Annotated[Point3, Field(description="(x, y, z), m")]
    axis: Annotated[Point3, Field(description="direction (x, y, z), of any length")] = (
        0.0,
        0.0,
        1.0,
    )
    major_radius: Annotated[
        Positive, Field(description="radius of the circle that the tube follows, m")
    ]
    minor_radius: Annotated[Positive, Field(description="radius of the tube, m")]
    start: Annotated[
        Point3 | None, Field(description="direction (x, y, z) in which an open one begins")
    ] = None
    angle: Annotated[
        Annotated[float, Field(gt=0.0, le=360.0)],
        Field(description="angle of the ring that is solid, degrees; 360 closes it"),
    ] = 360.0

    @model_validator(mode="after")
    def _shape(self) -> Self:
        if math.hypot(*self.axis) < 1e-9:
            raise ValueError(f"axis: expected a direction, got {list(self.axis)}")
        if self.minor_radius > self.major_radius:
            raise ValueError(
                f"minor_radius: expected at most major_radius {self.major_radius:g}, "
                f"got {self.minor_radius:g}"
            )
        if self.start is not None and not (
            np.linalg.norm(np.cross(self.start, self.axis))
            > 1e-6 * math.hypot(*self.start) * math.hypot(*self.axis)
        ):
            raise ValueError("start: expected a direction across the axis")
        if self.start is None and self.angle < 360.0:
            raise ValueError("start: missing; an angle below 360 needs the direction it begins in")
        return self

    def frame(self) -> tuple[Floats, Floats, Floats]:
        """Return the unit axis, the start, and their cross product."""
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        start = np.array(self.start if self.start is not None else np.eye(3)[np.abs(axis).argmin()])
        start = start - (start @ axis) * axis
        start /= np.linalg.norm(start)
        return axis, start, np.cross(axis, start)

    def row(self) -> SolidRow:
        """Return the kind and the row for kernels (`netsp.world.scene.solids`)."""
        axis, start, _ = self.frame()
        angle = math.radians(self.angle)
        return kinds.TORUS, [
            *self.center,
            *axis,
            *start,
            self.major_radius,
            self.minor_radius,
            angle,
        ]

    def thickness(self) -> float:
        """Return the thickness of the thinnest part, metres; infinite for a half space."""
        return 2.0 * self.minor_radius

    def centreline(self) -> Floats:
        """Return points (k, 3) of the arc."""
        _, start, across = self.frame()
        t = np.radians(np.linspace(0.0, self.angle, max(3, int(self.angle / 5.0) + 1)))[:, None]
        return self.center + self.major_radius * (np.cos(t) * start + np.sin(t) * across)

    def box(self) -> Floats:
        """Return the bounding box (2, 3), metres; 0 along axes without end."""
        return _around(self.centreline(), self.minor_radius + 0.002 * self.major_radius)


class Post(Model):
    """Vertical cylinder without ends."""

    center: Annotated[Point2, Field(description="(x, y) of an upright post through all depths, m")]
    radius: Annotated[Positive, Field(description="radius, m")]

    def row(self) -> SolidRow:
        """Return the kind and the row for kernels (`netsp.world.scene.solids`)."""
        return kinds.POST, [*self.center, self.radius]

    def thickness(self) -> float:
        """Return the thickness of the thinnest part, metres; infinite for a half space."""
        return 2.0 * self.radius

    def box(self) -> Floats:
        """Return the bounding box (2, 3), metres; 0 along axes without end."""
        return _around([(*self.center, 0.0)], self.radius) * [1.0, 1.0, 0.0]


class Prism(Model):
    """Vertical prism without ends over a simple polygon, grown by `grow`."""

    polygon: Annotated[
        Annotated[tuple[Point2, ...], Field(min_length=3)],
        Field(description="corners (x, y) of an upright prism through all depths, m"),
    ]
    grow: Annotated[
        NonNegative,
        Field(description="length by which the solid is grown, with rounded corners, m"),
    ] = 0.0

    @model_validator(mode="after")
    def _simple(self) -> Self:
        Polygon(polygon=self.polygon)
        return self

    def row(self) -> SolidRow:
        """Return the kind and the row for kernels (`netsp.world.scene.solids`)."""
        return kinds.PRISM, [0.0, 0.0, self.grow]

    def thickness(self) -> float:
        """Return the thickness of the thinnest part, metres; infinite for a half space."""
        return polygon_thickness(self.polygon) + 2.0 * self.grow

    def box(self) -> Floats:
        """Return the bounding box (2, 3), metres; 0 along axes without end."""
        xy = np.array(self.polygon)
        flat = np.column_stack([xy, np.zeros(len(xy))])
        return _around(flat, self.grow) * [1.0, 1.0, 0.0]


class HalfSpace(Model):
    """Half space behind a plane: a sea floor or a wall."""

    point: Annotated[Point3, Field(description="(x, y, z) on its face, m")]
    normal: Annotated[Point3, Field(description="direction (x, y, z) out of the solid")] = (
        0.0,
        0.0,
        1.0,
    )

    @model_validator(mode="after")
    def _direction(self) -> Self:
        if math.hypot(*self.normal) < 1e-9:
            raise ValueError(f"normal: expected a direction, got {list(self.normal)}")
        return self

    def row(self) -> SolidRow:
        """Return the kind and the row for kernels (`netsp.world.scene.solids`)."""
        n = np.array(self.normal) / np.linalg.norm(self.normal)
        return kinds.HALF_SPACE, [*self.point, *n]

    def thickness(self) -> float:
        """Return the thickness of the thinnest part, metres; infinite for a half space."""
        return math.inf

    def box(self) -> None:
        """Return None, because a half space has no end."""
        return None


def _around(points: npt.ArrayLike, radius: float) -> Floats:
    p = np.asarray(points, dtype=float)
    return np.array([p.min(0) - radius, p.max(0) + radius])


Shape = Sphere | Capsule | Cylinder | Box | Torus | Post | Prism | HalfSpace

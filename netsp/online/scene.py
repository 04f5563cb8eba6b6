"""The scene: what stands in the water. Solids, a mesh, a cloud of points, or an NE-TSP problem.

Validated at the door like a problem; `netsp schema scene` prints the JSON Schema.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, model_validator

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.fields import Name, NonNegative, Number, Point2, Point3, Positive
from netsp.files import read_text
from netsp.models import read_model
from netsp.online import solids as kinds
from netsp.online.field import DistanceField
from netsp.problem import Circle, Polygon, Problem

_STRICT = ConfigDict(frozen=True, extra="forbid")

Row = tuple[int, list[float]]


class Sphere(BaseModel):
    """A ball."""

    model_config = _STRICT
    center: Point3
    radius: Positive

    def row(self) -> Row:
        return kinds.CAPSULE, [*self.center, *self.center, self.radius]

    def thickness(self) -> float:
        return 2.0 * self.radius

    def box(self) -> Floats:
        return _around([self.center], self.radius)


class Capsule(BaseModel):
    """All points within a radius of a segment: a pipe or a strut with round ends."""

    model_config = _STRICT
    a: Point3
    b: Point3
    radius: Positive

    def row(self) -> Row:
        return kinds.CAPSULE, [*self.a, *self.b, self.radius]

    def thickness(self) -> float:
        return 2.0 * self.radius

    def box(self) -> Floats:
        return _around([self.a, self.b], self.radius)


class Cylinder(BaseModel):
    """A solid cylinder with flat ends: a pipe, a flange."""

    model_config = _STRICT
    a: Point3
    b: Point3
    radius: Positive

    @model_validator(mode="after")
    def _long(self) -> Self:
        if math.dist(self.a, self.b) < 1e-9:
            raise ValueError("a and b: expected two different points")
        return self

    @property
    def length(self) -> float:
        return math.dist(self.a, self.b)

    def row(self) -> Row:
        axis = (np.array(self.b) - np.array(self.a)) / self.length
        return kinds.CYLINDER, [*self.a, *axis, self.radius, self.length]

    def thickness(self) -> float:
        return min(2.0 * self.radius, self.length)

    def box(self) -> Floats:
        axis = (np.array(self.b) - np.array(self.a)) / self.length
        reach = self.radius * np.sqrt(np.maximum(0.0, 1.0 - axis**2))
        ends = np.array([self.a, self.b])
        return np.array([ends.min(0) - reach, ends.max(0) + reach])


class Box(BaseModel):
    """A box of a full size, turned by angles in degrees about x, then y, then z."""

    model_config = _STRICT
    center: Point3
    size: tuple[Positive, Positive, Positive]
    rotation: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)

    def axes(self) -> Floats:
        """Rows: the axes of the box in the world."""
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_euler("xyz", self.rotation, degrees=True).as_matrix().T)

    def row(self) -> Row:
        half = [0.5 * s for s in self.size]
        return kinds.BOX, [*self.center, *half, *self.axes().ravel()]

    def thickness(self) -> float:
        return min(self.size)

    def box(self) -> Floats:
        reach = 0.5 * np.abs(self.axes()).T @ np.array(self.size)
        return np.array([np.array(self.center) - reach, np.array(self.center) + reach])


class Torus(BaseModel):
    """All points within `minor_radius` of an arc of `major_radius` about an axis, that begins in
    the direction `start` and turns by `angle` degrees: a ring, or an elbow of a pipe."""

    model_config = _STRICT
    center: Point3
    axis: Point3 = (0.0, 0.0, 1.0)
    major_radius: Positive
    minor_radius: Positive
    start: Point3 | None = None
    angle: Annotated[float, Field(gt=0.0, le=360.0)] = 360.0

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
        """Unit axis, start and their cross product."""
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        start = np.array(self.start if self.start is not None else np.eye(3)[np.abs(axis).argmin()])
        start = start - (start @ axis) * axis
        start /= np.linalg.norm(start)
        return axis, start, np.cross(axis, start)

    def row(self) -> Row:
        axis, start, _ = self.frame()
        return kinds.TORUS, [
            *self.center, *axis, *start, self.major_radius, self.minor_radius,
            math.radians(self.angle),
        ]  # fmt: skip

    def thickness(self) -> float:
        return 2.0 * self.minor_radius

    def centreline(self) -> Floats:
        """(k, 3) points of the arc."""
        _, start, across = self.frame()
        t = np.radians(np.linspace(0.0, self.angle, max(3, int(self.angle / 5.0) + 1)))[:, None]
        return self.center + self.major_radius * (np.cos(t) * start + np.sin(t) * across)

    def box(self) -> Floats:
        return _around(self.centreline(), self.minor_radius + 0.002 * self.major_radius)


class Post(BaseModel):
    """A vertical cylinder without ends."""

    model_config = _STRICT
    center: Point2
    radius: Positive

    def row(self) -> Row:
        return kinds.POST, [*self.center, self.radius]

    def thickness(self) -> float:
        return 2.0 * self.radius

    def box(self) -> Floats:
        return _around([(*self.center, 0.0)], self.radius) * [1.0, 1.0, 0.0]


class Prism(BaseModel):
    """A vertical prism without ends over a simple polygon, grown by `grow`."""

    model_config = _STRICT
    polygon: Annotated[tuple[Point2, ...], Field(min_length=3)]
    grow: NonNegative = 0.0

    @model_validator(mode="after")
    def _simple(self) -> Self:
        Polygon(polygon=self.polygon)
        return self

    def row(self) -> Row:
        return kinds.PRISM, [0.0, 0.0, self.grow]

    def thickness(self) -> float:
        import shapely

        shape = shapely.Polygon(self.polygon)
        low, high = 0.0, math.sqrt(shape.area)
        for _ in range(20):
            # an opening that keeps corners loses area only where the polygon is thin
            t = 0.5 * (low + high)
            opened = shape.buffer(-t / 2, join_style="mitre").buffer(t / 2, join_style="mitre")
            if shape.difference(opened).area < 1e-6 * shape.area:
                low = t
            else:
                high = t
        return low + 2.0 * self.grow

    def box(self) -> Floats:
        xy = np.array(self.polygon)
        flat = np.column_stack([xy, np.zeros(len(xy))])
        return _around(flat, self.grow) * [1.0, 1.0, 0.0]


class HalfSpace(BaseModel):
    """Everything behind a plane: a sea floor, a wall."""

    model_config = _STRICT
    point: Point3
    normal: Point3 = (0.0, 0.0, 1.0)

    @model_validator(mode="after")
    def _direction(self) -> Self:
        if math.hypot(*self.normal) < 1e-9:
            raise ValueError(f"normal: expected a direction, got {list(self.normal)}")
        return self

    def row(self) -> Row:
        n = np.array(self.normal) / np.linalg.norm(self.normal)
        return kinds.HALF_SPACE, [*self.point, *n]

    def thickness(self) -> float:
        return math.inf

    def box(self) -> None:
        return None


def _around(points: npt.ArrayLike, radius: float) -> Floats:
    p = np.asarray(points, dtype=float)
    return np.array([p.min(0) - radius, p.max(0) + radius])


Shape = Sphere | Capsule | Cylinder | Box | Torus | Post | Prism | HalfSpace

_KINDS = ("sphere", "capsule", "cylinder", "box", "torus", "post", "prism", "half_space")


class Solid(BaseModel):
    """One solid: exactly one of its shapes, and a name."""

    model_config = _STRICT
    name: Name | None = None
    sphere: Sphere | None = None
    capsule: Capsule | None = None
    cylinder: Cylinder | None = None
    box: Box | None = None
    torus: Torus | None = None
    post: Post | None = None
    prism: Prism | None = None
    half_space: HalfSpace | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        given = [k for k in _KINDS if getattr(self, k) is not None]
        if len(given) != 1:
            raise ValueError(f"expected one of {', '.join(_KINDS)}, got {given or 'none'}")
        return self

    @property
    def shape(self) -> Shape:
        """The shape it is."""
        shapes: list[Shape | None] = [getattr(self, k) for k in _KINDS]
        return next(s for s in shapes if s is not None)


class Source(BaseModel):
    """A mesh or cloud in a file beside the scene's.

    file : path, relative to the scene file. scale : metres per unit of the file. voxel : metres;
    size of a voxel, default 1/200 of the longest side.
    """

    model_config = _STRICT
    file: str
    scale: Positive = 1.0
    voxel: Positive | None = None


class Scene(BaseModel):
    """A scene: the union of its solids, its mesh, its cloud and the obstacles of its problem.

    Attributes
    ----------
    solids : exact shapes.
    mesh, cloud : files, turned into voxels (`netsp.online.voxels`).
    problem : an NE-TSP problem file, whose obstacles, grown by its clearance, stand from the sea
        floor to the surface.
    tether_radius : everything is grown by it for the tether.
    bounds : (xmin, ymin, zmin, xmax, ymax, zmax) that the robot stays in, or None.

    Raises
    ------
    InputError : from `load` and `field`, in one line.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", title="netsp scene")

    schema_version: Literal[1] = 1
    name: Name = "scene"
    units: Name = "m"
    solids: tuple[Solid, ...] = ()
    mesh: Source | None = None
    cloud: Source | None = None
    problem: str | None = None
    tether_radius: NonNegative = 0.0
    bounds: tuple[Number, Number, Number, Number, Number, Number] | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.bounds is not None and not all(
            a < b for a, b in zip(self.bounds[:3], self.bounds[3:], strict=True)
        ):
            raise ValueError(
                "bounds: expected (xmin, ymin, zmin, xmax, ymax, zmax) with min < max, got "
                f"{list(self.bounds)}"
            )
        return self

    @classmethod
    def from_json(cls, text: str | bytes, *, source: str = "scene") -> Self:
        """Parse and validate; `InputError` with one line for anything wrong."""
        return read_model(cls, text, source)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a scene file; file names in it become relative to the working directory."""
        scene = cls.from_json(read_text(path), source=str(path))
        folder = Path(path).parent
        changes: dict[str, Any] = {
            key: given.model_copy(update={"file": str(folder / given.file)})
            for key in ("mesh", "cloud")
            if (given := getattr(scene, key)) is not None
        }
        if scene.problem is not None:
            changes["problem"] = str(folder / scene.problem)
        return scene.model_copy(update=changes)

    @classmethod
    def from_problem(cls, problem: Problem) -> Self:
        """The obstacles of an NE-TSP problem as posts and prisms, grown by its clearance: offline
        and online share one world."""
        return cls(name=problem.name, units=problem.units, solids=_standing(problem))

    def all_solids(self) -> tuple[Solid, ...]:
        """The solids with those of the problem."""
        more = _standing(Problem.load(self.problem)) if self.problem is not None else ()
        return (*self.solids, *more)

    def field(
        self,
        *,
        voxel: float | None = None,
        memory_limit: float = 4.0,
        on_progress: Callable[[str, float], None] | None = None,
    ) -> DistanceField:
        """The distance field of the scene.

        Parameters
        ----------
        voxel : metres; overrides that of mesh and cloud.
        memory_limit : GiB; a grid that needs more is refused with a voxel size that does not.
        on_progress : is told (stage, fraction done) of long builds.

        Raises
        ------
        InputError : nothing in the scene, unreadable files, a grid that is too large.
        """
        solids = self.all_solids()
        if not solids and self.mesh is None and self.cloud is None:
            raise InputError(f"{self.name}: the scene is empty; expected solids, mesh or cloud")
        kind, rows, outline = encode(solids)
        grid = None
        for source, what in ((self.mesh, "mesh"), (self.cloud, "cloud")):
            if source is None:
                continue
            from netsp.online import voxels

            if grid is not None:
                raise InputError(f"{self.name}: mesh, cloud: expected one of them, got both")
            read = voxels.of_mesh if what == "mesh" else voxels.of_cloud_file
            grid = read(
                source.file,
                scale=source.scale,
                voxel=voxel or source.voxel,
                memory_limit=memory_limit,
                on_progress=on_progress,
            )
        boxes = [b for s in solids if (b := s.shape.box()) is not None]
        names = [s.name or f"solids[{k}]" for k, s in enumerate(solids)]
        thickness = [s.shape.thickness() for s in solids]
        return DistanceField.build(
            kind,
            rows,
            outline,
            boxes,
            grid,
            self.tether_radius,
            list(zip(names, thickness, strict=True)),
        )


def _standing(problem: Problem) -> tuple[Solid, ...]:
    out = []
    for i, o in enumerate(problem.obstacles):
        name = o.name or f"obstacles[{i}]"
        if isinstance(o, Circle):
            post = Post(center=o.center, radius=o.radius + problem.clearance)
            out.append(Solid(name=name, post=post))
        else:
            prism = Prism(polygon=o.polygon, grow=problem.clearance)
            out.append(Solid(name=name, prism=prism))
    return tuple(out)


def encode(solids: tuple[Solid, ...]) -> tuple[list[int], list[list[float]], Floats]:
    """Kinds, rows and polygon vertices for `netsp.online.sampling.of_solids`."""
    kind: list[int] = []
    rows: list[list[float]] = []
    outline: list[tuple[float, float]] = []
    for solid in solids:
        k, row = solid.shape.row()
        if isinstance(solid.shape, Prism):
            row = [len(outline), len(outline) + len(solid.shape.polygon), row[2]]
            outline += list(solid.shape.polygon)
        kind.append(k)
        rows.append(row)
    return kind, rows, np.array(outline, dtype=float).reshape(-1, 2)

"""Scene: the bodies in the water, as solids, a mesh, a cloud of points, or obstacles of a problem.

Scene files are validated like problems; `netsp schema scene` prints their JSON Schema.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict, Field, model_validator

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.field_types import Name, NonNegative, Number, Point2, Positive
from netsp.base.files import FileModel, read_text
from netsp.base.validated import Model
from netsp.model.problem import Circle, Problem
from netsp.world.scene.field import DistanceField
from netsp.world.scene.grid import VoxelGrid
from netsp.world.scene.mesh_body import MeshBody, Surface, body_of_mesh
from netsp.world.scene.readers import Placement, read_cloud_file, read_mesh_file
from netsp.world.scene.scene_policy import FloorPolicy, MeshPolicy, ScenePolicy
from netsp.world.scene.seams import seam_boxes
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
from netsp.world.scene.solids import BOX
from netsp.world.scene.tally import Tally

Triangles = tuple[Floats, npt.NDArray[np.int64]]

_KINDS = ("sphere", "capsule", "cylinder", "box", "torus", "post", "prism", "half_space")


class Solid(Model):
    """Solid of a scene: exactly one shape, and a name."""

    name: Annotated[Name | None, Field(description="name in pictures, reports and `inspect`")] = (
        None
    )
    sphere: Annotated[Sphere | None, Field(description="exactly one of these shapes")] = None
    capsule: Annotated[Capsule | None, Field(description="cylinder with rounded ends")] = None
    cylinder: Annotated[Cylinder | None, Field(description="cylinder with flat ends")] = None
    box: Annotated[Box | None, Field(description="box in any position")] = None
    torus: Annotated[Torus | None, Field(description="a ring, or a bend of a pipe")] = None
    post: Annotated[Post | None, Field(description="an upright cylinder without ends")] = None
    prism: Annotated[Prism | None, Field(description="an upright prism without ends")] = None
    half_space: Annotated[
        HalfSpace | None, Field(description="everything behind a plane: sea floor, wall")
    ] = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        given = [k for k in _KINDS if getattr(self, k) is not None]
        if len(given) != 1:
            raise ValueError(f"expected one of {', '.join(_KINDS)}, got {given or 'none'}")
        return self

    @property
    def shape(self) -> Shape:
        """Shape of the solid."""
        shapes: list[Shape | None] = [getattr(self, k) for k in _KINDS]
        return next(s for s in shapes if s is not None)


class Source(Model):
    """Mesh or cloud in a file that a scene file names."""

    file: Annotated[
        str,
        Field(
            description="mesh (STL, OBJ, PLY, GLB, glTF, DAE) or cloud (npz, npy, csv, txt, xyz, "
            "asc, PTS, PCD, PLY, LAS, LAZ), relative to the scene file"
        ),
    ]
    scale: Annotated[Positive, Field(description="factor from the file's units to metres")] = 1.0
    voxel: Annotated[
        Positive | None, Field(description="edge of the voxels, m; null for a choice by size")
    ] = None
    origin: Annotated[
        Point2, Field(description="(x, y) of the file that is (0, 0) here, in its units")
    ] = (0.0, 0.0)
    up: Annotated[
        Literal["x", "y", "z"] | None,
        Field(description="axis of the file that points upwards; null for its format's, or z"),
    ] = None
    rotate: Annotated[
        tuple[Number, Number, Number],
        Field(description="angles about the axes x, then y, then z of the scene, degrees"),
    ] = (0.0, 0.0, 0.0)

    @property
    def placement(self) -> Placement:
        """Place of the file in the scene."""
        return Placement(self.scale, self.up, self.origin, self.rotate)


class MeshSource(Source):
    """Mesh in a file that a scene file names."""

    surface: Annotated[
        Surface | None,
        Field(
            description="what open parts are: `solid`, whose holes are closed, or `sheet`, with "
            "water on both sides; null for a choice by their winding numbers"
        ),
    ] = None
    thickness: Annotated[
        Positive | None,
        Field(
            description="thickness of sheets and of parts thinner than a voxel, m; null for four "
            "voxels"
        ),
    ] = None


class Floor(Model):
    """Sea floor from a bathymetry grid in a file that a scene file names."""

    file: Annotated[
        str,
        Field(
            description="bathymetry grid (GeoTIFF, ASC, netCDF, BAG, table of x, y and z), "
            "relative to the scene file"
        ),
    ]
    scale: Annotated[Positive, Field(description="factor from the file's units to metres")] = 1.0
    voxel: Annotated[
        Positive | None, Field(description="edge of the voxels, m; null for a choice by size")
    ] = None
    origin: Annotated[
        Point2, Field(description="(x, y) of the file's map that is (0, 0) here, its units")
    ] = (0.0, 0.0)
    depths: Annotated[
        bool | None,
        Field(
            description="whether values are depths, which count downwards; null for what its "
            "band or column is called, else heights"
        ),
    ] = None


class Scene(FileModel):
    """Union of solids, a mesh, a cloud, a sea floor and the obstacles of a problem.

    Mesh, cloud and floor become voxels (`netsp.world.scene.voxels`), mesh and floor together.

    Attributes
    ----------
    solids : tuple of Solid
        Exact shapes.
    mesh : MeshSource or None
        File with a mesh.
    cloud : Source or None
        File with a cloud of points.
    floor : Floor or None
        File with a bathymetry grid.
    problem : str or None
        NE-TSP problem file whose obstacles, grown by its clearance, stand from the sea floor to the
        surface.
    tether_radius : float
        Length by which everything is grown for the tether, metres.
    bounds : (xmin, ymin, zmin, xmax, ymax, zmax) or None
        Box that the robot stays in, metres.

    Examples
    --------
    >>> scene = Scene(solids=[{"sphere": {"center": [0, 0, 0], "radius": 1}}])
    >>> scene.field().distance([(3, 0, 0)])
    array([2.])
    """

    file_kind: ClassVar[str] = "scene"

    model_config = ConfigDict(title="netsp scene")

    schema_version: Annotated[Literal[1], Field(description="version of the file format")] = 1
    name: Annotated[Name, Field(description="name of the scene")] = "scene"
    units: Annotated[Name, Field(description="name of the unit of length")] = "m"
    solids: Annotated[tuple[Solid, ...], Field(description="solids in the water")] = ()
    mesh: Annotated[MeshSource | None, Field(description="a triangle mesh; null for none")] = None
    cloud: Annotated[Source | None, Field(description="points on surfaces; null for none")] = None
    floor: Annotated[Floor | None, Field(description="the sea floor; null for none")] = None
    problem: Annotated[
        str | None,
        Field(description="problem file whose obstacles stand upright in the water; null for none"),
    ] = None
    tether_radius: Annotated[
        NonNegative, Field(description="length by which all solids are grown for the tether, m")
    ] = 0.0
    bounds: Annotated[
        tuple[Number, Number, Number, Number, Number, Number] | None,
        Field(description="[xmin, ymin, zmin, xmax, ymax, zmax] of the water, m; null for none"),
    ] = None

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
    def load(cls, path: str | Path) -> Self:
        """Return the scene in a file; file names in it become relative to the working directory.

        Raises
        ------
        InputError
            The file cannot be read or is not valid, in one line.
        """
        scene = cls.from_json(read_text(path), source=str(path))
        folder = Path(path).parent
        changes: dict[str, Any] = {
            key: given.model_copy(update={"file": str(folder / given.file)})
            for key in ("mesh", "cloud", "floor")
            if (given := getattr(scene, key)) is not None
        }
        if scene.problem is not None:
            changes["problem"] = str(folder / scene.problem)
        return scene.model_copy(update=changes)

    @classmethod
    def from_problem(cls, problem: Problem) -> Self:
        """Return the obstacles of an NE-TSP problem, grown by its clearance, as posts and
        prisms."""
        return cls(name=problem.name, units=problem.units, solids=_standing(problem))

    def all_solids(self) -> tuple[Solid, ...]:
        """Return the solids of the scene and of its problem.

        Raises
        ------
        InputError
            The problem file cannot be read.
        """
        more = _standing(Problem.load(self.problem)) if self.problem is not None else ()
        return (*self.solids, *more)

    def thickness(self) -> list[tuple[str, float]]:
        """Return the name and minimum thickness of each solid, metres; infinite for a half space.

        Raises
        ------
        InputError
            The problem file cannot be read.
        """
        return _thickness(self.all_solids())

    def field(
        self,
        *,
        voxel: float | None = None,
        memory_limit: float = 4.0,
        on_progress: Callable[[str, float], None] | None = None,
        policy: ScenePolicy | None = None,
    ) -> DistanceField:
        """Return the distance field of the scene.

        Parameters
        ----------
        voxel : float, optional
            Edge of a voxel, metres; by default that of the scene's files.
        memory_limit : float
            Maximum memory, GiB. If a grid needs more, the error suggests a voxel size.
        on_progress : callable, optional
            Called with (stage, fraction done) of long builds.
        policy : ScenePolicy, optional
            Policy of grids, fields and seams.

        Raises
        ------
        InputError
            The scene is empty, a file cannot be read, or the grid is too large.
        """
        solids = self.all_solids()
        if not solids and self.mesh is None and self.cloud is None and self.floor is None:
            raise InputError(
                f"{self.name}: the scene is empty; expected solids, mesh, cloud or floor"
            )
        grid = self.voxels(
            voxel=voxel, memory_limit=memory_limit, on_progress=on_progress, policy=policy
        )
        return self.field_with(solids, grid, policy)

    def field_with(
        self, solids: tuple[Solid, ...], grid: VoxelGrid | None, policy: ScenePolicy | None = None
    ) -> DistanceField:
        """Return the field of other solids with the same voxels.

        Parameters
        ----------
        solids : tuple of Solid
            Solids in place of the scene's.
        grid : VoxelGrid or None
            Result of `voxels`.
        policy : ScenePolicy, optional
            Policy of fields and seams.
        """
        kind, rows, outline = encode(solids)
        boxes = [b for s in solids if (b := s.shape.box()) is not None]
        policy = policy or ScenePolicy()
        seams = seam_boxes([s.shape for s in solids], policy.seams)
        return DistanceField.build(
            kind + [BOX] * len(seams),
            rows + [row for _, row in seams],
            outline,
            boxes,
            grid,
            self.tether_radius,
            thickness=_thickness(solids),
            seams=[owner for owner, _ in seams],
            policy=policy.distances,
        )

    def voxels(
        self,
        *,
        voxel: float | None = None,
        memory_limit: float = 4.0,
        on_progress: Callable[[str, float], None] | None = None,
        policy: ScenePolicy | None = None,
    ) -> VoxelGrid | None:
        """Return the distances to mesh, cloud and floor; None without them.

        Parameters
        ----------
        voxel : float, optional
            Edge of a voxel, metres; by default that of the scene's files.
        memory_limit : float
            Maximum memory, GiB.
        on_progress : callable, optional
            Called with (stage, fraction done) of long builds.
        policy : ScenePolicy, optional
            Policy of grids and of the sea floor.

        Raises
        ------
        InputError
            A file cannot be read, or the grid is too large.
        """
        if self.mesh is None and self.cloud is None and self.floor is None:
            return None
        from netsp.world.scene import voxels

        policy = policy or ScenePolicy()
        parts, points, notes = self._files(policy.floor)
        options: dict[str, Any] = {
            "voxel": voxel or self._voxel(),
            "memory_limit": memory_limit,
            "on_progress": on_progress,
            "source": self._source(),
            "policy": policy.grid,
        }
        if not parts:
            assert points is not None
            grid = voxels.grid_of_cloud(points, **options)
            return replace(grid, notes=(*notes, *grid.notes))
        bodies = self._bodies(parts, policy.mesh)
        if self.mesh is not None:
            notes += _file_notes(self.mesh.file, bodies["mesh"].notes)
        found = list(bodies.values())
        if points is not None:
            grid = voxels.grid_of_bodies_and_cloud(found, points, **options)
        else:
            region = self._water(parts) if "floor" in parts else None
            grid = voxels.grid_of_bodies(found, region=region, **options)
        return replace(grid, notes=(*notes, *grid.notes))

    def _bodies(
        self, parts: Mapping[str, Triangles], policy: MeshPolicy | None = None
    ) -> dict[str, MeshBody]:
        """Return the bodies of mesh and sea floor."""
        found = {
            name: body_of_mesh(*part, policy=policy)
            for name, part in parts.items()
            if name != "mesh"
        }
        if self.mesh is not None:
            self._check_size(parts["mesh"][0], policy or MeshPolicy())
            body = body_of_mesh(*parts["mesh"], surface=self.mesh.surface, policy=policy)
            notes = (*body.notes, *self._size_notes(parts["mesh"][0], policy or MeshPolicy()))
            body = replace(body, thickness=self.mesh.thickness, notes=notes)
            found = {"mesh": body, **found}
        return found

    def _size_notes(self, vertices: Floats, policy: MeshPolicy) -> list[str]:
        """Return a note on a size that a structure in metres seldom has."""
        assert self.mesh is not None
        size, scale = float(np.ptp(vertices, axis=0).max()), self.mesh.scale
        if policy.min_extent_m <= size <= policy.max_extent_m:
            return []
        if scale != 1.0:
            return [f"mesh.scale: {scale:g} makes the mesh {size:.4g} m across"]
        if size > policy.max_extent_m:
            hint = 'if the file is in millimetres, add "scale": 0.001'
        else:
            hint = 'if the file is not in metres, add "scale" with the metres of its unit'
        return [f"the mesh is {size:.4g} m across; {hint}"]

    def _check_size(self, vertices: Floats, policy: MeshPolicy) -> None:
        """Raise InputError if the scale makes the mesh so small or large that no robot inspects
        it."""
        assert self.mesh is not None
        size, scale = float(np.ptp(vertices, axis=0).max()), self.mesh.scale
        low, high = policy.min_allowed_extent_m, policy.max_allowed_extent_m
        if not low <= size <= high:
            hint = '; a file in millimetres needs "scale": 0.001' if scale == 1.0 < size else ""
            raise InputError(
                f"{self.mesh.file}: mesh.scale: {scale:g} makes the mesh {size:.3g} m across; "
                f"expected {low:g} to {high:g} m{hint}"
            )

    def mesh_bodies(self, policy: ScenePolicy | None = None) -> dict[str, MeshBody]:
        """Return the bodies of mesh and sea floor, by the names ``mesh`` and ``floor``.

        Raises
        ------
        InputError
            A file cannot be read.
        """
        return self._bodies(dict(self.meshes()), (policy or ScenePolicy()).mesh)

    def _water(self, parts: Mapping[str, Any]) -> Floats:
        """Return the box of water above a sea floor; nothing below or beside it is needed."""
        vertices = parts["floor"][0]
        top = vertices[: len(vertices) // 2]
        water = np.array([top.min(0), [*top.max(0)[:2], np.inf]])
        if "mesh" in parts:
            low, high = parts["mesh"][0].min(0), parts["mesh"][0].max(0)
            water = np.array([np.minimum(water[0], low), np.maximum(water[1], high)])
        return water

    def _voxel(self) -> float | None:
        """Return the smallest edge of voxels that the scene's files state, metres; None if none
        does."""
        given = [f.voxel for f in (self.floor, self.mesh, self.cloud) if f is not None and f.voxel]
        return min(given) if given else None

    def _source(self) -> str:
        files = [f.file for f in (self.mesh, self.cloud, self.floor) if f is not None]
        return files[0] if len(files) == 1 and self.floor is None else self.name

    def _files(
        self, policy: FloorPolicy | None = None
    ) -> tuple[dict[str, Triangles], Floats | None, list[str]]:
        """Read mesh, floor and cloud; return triangles by name, points, and notes on omissions."""
        parts: dict[str, Triangles] = {}
        points: Floats | None = None
        notes: list[str] = []
        if self.mesh is not None:
            mesh = read_mesh_file(self.mesh.file, self.mesh.placement)
            parts["mesh"] = mesh.vertices, mesh.faces
            notes += _file_notes(self.mesh.file, mesh.notes, mesh.tally)
        if self.floor is not None:
            from netsp.world.scene.floor import read_floor

            floor = read_floor(
                self.floor.file,
                scale=self.floor.scale,
                origin=self.floor.origin,
                depths=self.floor.depths,
                policy=policy,
            )
            parts["floor"] = floor.vertices, floor.faces
            notes += _file_notes(self.floor.file, floor.notes, floor.tally)
        if self.cloud is not None:
            cloud = read_cloud_file(self.cloud.file, self.cloud.placement)
            points = cloud.points
            notes += _file_notes(self.cloud.file, cloud.notes, cloud.tally)
        return parts, points, notes

    def reading_notes(self) -> list[str]:
        """Return notes on what was left out, turned or converted in the scene's files, one line
        each.

        Raises
        ------
        InputError
            A file cannot be read.
        """
        parts, _, notes = self._files()
        if self.mesh is not None:
            notes += _file_notes(self.mesh.file, self._bodies(parts)["mesh"].notes)
        return notes

    def meshes(self) -> list[tuple[str, Triangles]]:
        """Return mesh and sea floor as triangles.

        Returns
        -------
        list of (str, (ndarray, ndarray))
            ``mesh`` or ``floor``, with vertices (n, 3), metres, and faces (m, 3).

        Raises
        ------
        InputError
            A file cannot be read.
        """
        without = self.model_copy(update={"cloud": None})
        return list(without._files()[0].items())


def _file_notes(file: str, notes: Sequence[str], tally: Tally | None = None) -> list[str]:
    """Return the notes on a file, and how many of its parts are used if not all are."""
    used = tally.note if tally is not None else ""
    return [f"{file}: {note}" for note in (*notes, used) if note]


def _thickness(solids: tuple[Solid, ...]) -> list[tuple[str, float]]:
    return [(s.name or f"solids[{k}]", s.shape.thickness()) for k, s in enumerate(solids)]


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
    """Return kinds, rows and polygon corners for `netsp.world.scene.packing.pack_solids`."""
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


def scene_of(problem: Problem) -> Scene:
    """Return the scene of a problem.

    Because a scene needs a solid, a problem without obstacles gets one far below its base.
    """
    if problem.obstacles:
        return Scene.from_problem(problem)
    x, y, z = problem.base
    far = 1e3 * (problem.tether_length + problem.scale)
    stone = {"sphere": {"center": [x, y, z - far], "radius": problem.tether_length}}
    return Scene.model_validate({"schema_version": 1, "name": problem.name, "solids": [stone]})

"""Meshes and clouds of points from files, read by libraries that know their formats."""

from __future__ import annotations

import io
import math
import re
import warnings
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.errors import InputError, counted
from netsp.base.files import FilePolicy
from netsp.base.units import metres_per_unit
from netsp.world.scene.mesh_checks import binary_stl, collada_parts, gltf_parts, plain_obj
from netsp.world.scene.pcd import read_pcd
from netsp.world.scene.ply import read_ply
from netsp.world.scene.point_clouds import (
    TEXT_SUFFIXES,
    PointCloud,
    cloud_of_fields,
    coordinate_fields,
    read_las,
    read_text_cloud,
)
from netsp.world.scene.tally import Tally

Up = Literal["x", "y", "z"]
"""Axis of a file that points upwards."""

_TURNS = {
    "x": ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)),
    "y": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
}
"""Rotations to z upwards.

From y, (x, y, z) becomes (x, -z, y) (glTF 2.0, 3.4). From x, right is -y and inwards is z (COLLADA
1.4, up_axis).
"""


@dataclass(frozen=True)
class MeshReading:
    """Mesh of a file in a scene.

    Attributes
    ----------
    vertices
        Vertices (n, 3), metres, z upwards.
    faces
        Indices (m, 3) of the corners.
    notes
        Parts that were turned, converted or left out, one line each.
    tally
        Numbers of parts of the file that are used and left out.
    """

    vertices: Floats
    faces: npt.NDArray[np.int64]
    notes: tuple[str, ...]
    tally: Tally


@dataclass(frozen=True)
class CloudReading:
    """Cloud of a file in a scene.

    Attributes
    ----------
    points
        Points (n, 3), metres, z upwards.
    notes
        Points and columns that were left out or converted, one line each.
    tally
        Numbers of points of the file that are used and left out.
    """

    points: Floats
    notes: tuple[str, ...]
    tally: Tally


CLOUDS = ".npz, .npy, .csv, .txt, .xyz, .asc, .pts, .pcd, .ply, .las or .laz"


@dataclass(frozen=True)
class Placement:
    """Place of a file's mesh or cloud in a scene.

    Parameters
    ----------
    scale : float
        Metres per unit of the file.
    up : str, optional
        Axis of the file that points upwards; None for the axis of its format, or z.
    origin : (x, y)
        Point of the file, z upwards, that becomes (0, 0), in units of the file.
    rotate : (x, y, z)
        Degrees about the axes x, then y, then z of the scene, anticlockwise seen from their tips.
    """

    scale: float = 1.0
    up: Up | None = None
    origin: tuple[float, float] = (0.0, 0.0)
    rotate: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def apply(
        self,
        points: Floats,
        up: Up = "z",
        metres: tuple[float, float, float] = (1.0, 1.0, 1.0),
        source: str = "file",
    ) -> Floats:
        """Return points of a file in the scene.

        Parameters
        ----------
        points : ndarray, shape (n, 3)
            Points of the file.
        up : str
            Axis that points upwards by the file's format.
        metres : tuple of float
            Metres per unit of x, y and z by the file's format.
        source : str
            Name of the file, for messages.

        Raises
        ------
        InputError
            The file states a unit and the scene another.
        """
        if self.scale != 1.0 and metres != (1.0, 1.0, 1.0):
            raise InputError(
                f"{source}: scale: the file states its unit ({metres[0]:.7g} m) and is read in "
                f"metres; expected no scale, got {self.scale:g}"
            )
        turn = _TURNS.get(self.up or up)
        out = points if turn is None else points @ np.array(turn).T
        out = (out - [*self.origin, 0.0]) * (np.array(metres) * self.scale)
        for axis, degrees in enumerate(self.rotate):
            if degrees:
                c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
                a, b = (axis + 1) % 3, (axis + 2) % 3
                first, second = out[:, a].copy(), out[:, b].copy()
                out[:, a], out[:, b] = c * first - s * second, s * first + c * second
        return np.asarray(out)


def read_mesh_file(path: str | Path, placement: Placement | None = None) -> MeshReading:
    """Read a mesh file into a scene.

    Parameters
    ----------
    path : str or Path
        STL, OBJ, PLY, GLB, glTF, COLLADA, or another format that trimesh reads.
    placement : Placement, optional
        Place of the mesh in the scene.

    Raises
    ------
    InputError
        Not readable, no triangles, or coordinates that are not finite.
    """
    _exists(path)
    kind = Path(path).suffix.lower()
    try:
        raw = _mesh_parts(path, kind)
    except InputError:
        raise
    except Exception as error:  # trimesh's readers raise many kinds of exceptions
        raise InputError(f"{path}: cannot be read as a mesh: {_line(error)}") from None
    vertices, faces = np.asarray(raw.vertices, dtype=float), raw.faces
    if len(faces) == 0:
        raise InputError(f"{path}: expected a mesh with triangles, got none{_list(raw.left_out)}")
    wrong = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(wrong):
        raise InputError(
            f"{path}: vertex {wrong[0]} is {vertices[wrong[0]].tolist()}; expected finite numbers"
        )
    notes = [f"{counted(n, raw.part)} {reason}: left out" for reason, n in raw.left_out]
    chosen = placement or Placement()
    if chosen.up is None and raw.up != "z":
        notes.append(f"{raw.up} is up in this format: turned so that z is up")
    if raw.metres != 1.0:
        notes.append(f"in units of {raw.metres:.7g} m: converted to metres")
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = int((np.abs(area).max(axis=1) == 0.0).sum())
    if flat:
        notes.append(f"{counted(flat, 'face')} without area")
    used = raw.used if raw.used is not None else len(faces)
    tally = Tally(raw.part, used + sum(n for _, n in raw.left_out), used, tuple(raw.left_out))
    placed = chosen.apply(vertices, raw.up, (raw.metres,) * 3, str(path))
    return MeshReading(placed, faces, tuple(notes), tally)


@dataclass(frozen=True)
class _RawMesh:
    """Mesh in the axes and units of its file.

    The fields are vertices, faces, the axis that points upwards, metres per unit, the name of a
    part of the file, and the number of parts that are used (None: all faces) and left out, by
    reason.
    """

    vertices: Floats
    faces: npt.NDArray[np.int64]
    up: Up = "z"
    metres: float = 1.0
    part: str = "face"
    used: int | None = None
    left_out: list[tuple[str, int]] = field(default_factory=list)


def _mesh_parts(path: str | Path, kind: str) -> _RawMesh:
    if kind == ".ply":
        return _ply_mesh(path)
    if kind == ".stl" and (corners := binary_stl(path)) is not None:
        faces = np.arange(3 * len(corners), dtype=np.int64).reshape(-1, 3)
        return _RawMesh(corners.reshape(-1, 3), faces)
    if kind == ".dae":
        _collada()
        up, metres = _collada_axes(path)
        left_out = collada_parts(path)
        vertices, faces, used, _ = _by_trimesh(path)
        return _RawMesh(vertices, faces, up, metres, "part", used, left_out)
    if kind in (".glb", ".gltf"):
        used, left_out = gltf_parts(path)
        vertices, faces, _, _ = _by_trimesh(path)
        return _RawMesh(vertices, faces, "y", 1.0, "part", used, left_out)
    if kind == ".obj":
        obj = plain_obj(path)
        vertices, faces, _, _ = _by_trimesh(io.BytesIO(obj.text), "obj")
        if len(faces) != obj.triangles:
            raise InputError(
                f"{path}: expected {obj.triangles} triangles of its faces, got {len(faces)}"
            )
        return _RawMesh(vertices, faces, part="element", used=obj.faces, left_out=obj.left_out)
    vertices, faces, used, loaded = _by_trimesh(path)
    metres = 1.0
    if kind == ".3mf":
        metres = metres_per_unit(str(getattr(loaded, "units", None) or "mm")) or 1.0
    return _RawMesh(vertices, faces, metres=metres)


def _by_trimesh(
    file: Any, kind: str | None = None
) -> tuple[Floats, npt.NDArray[np.int64], int, Any]:
    """Return vertices, faces, the number of parts of faces, and what trimesh made of the file."""
    trimesh = _trimesh()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        source = file if kind else str(file)
        loaded = trimesh.load(source, file_type=kind, process=False)
        parts = list(getattr(loaded, "geometry", {"": loaded}).values())
        mesh = loaded.to_mesh() if hasattr(loaded, "to_mesh") else loaded
    faces = getattr(mesh, "faces", None)
    if faces is None:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64), 0, loaded
    used = sum(getattr(p, "faces", None) is not None for p in parts)
    return np.asarray(mesh.vertices, float), np.asarray(faces, np.int64), used, loaded


def _ply_mesh(path: str | Path) -> _RawMesh:
    read = read_ply(path)
    used = coordinate_fields(read.names, str(path), "vertex")
    vertices = np.column_stack([read.values[:, k] * column.factor for k, column in used]) + 0.0
    faces, short = read.triangles()
    left_out = [("of fewer than three corners", short)] if short else []
    left_out += [(f"of the kind {name}", count) for name, count in read.others.items()]
    return _RawMesh(
        vertices, faces, part="element", used=len(read.faces) - short, left_out=left_out
    )


def _list(left_out: Sequence[tuple[str, int]]) -> str:
    """Return what was left out, in brackets; empty for nothing."""
    return f" ({', '.join(f'{n} {reason}' for reason, n in left_out)})" if left_out else ""


def _collada_axes(path: str | Path) -> tuple[Up, float]:
    """Return the axis that points upwards and the metres per unit of a COLLADA file."""
    text = Path(path).read_text(encoding="utf-8", errors="replace")
    asset = re.search(r"<asset\b.*?</asset>", text, re.DOTALL)
    head = asset[0] if asset else ""
    axis = re.search(r"<up_axis>\s*([XYZ])_UP", head)
    unit = re.search(r"<unit\b[^>]*\bmeter\s*=\s*[\"']\s*([^\"']+?)\s*[\"']", head)
    names: dict[str, Up] = {"X": "x", "Y": "y", "Z": "z"}
    try:
        metres = float(unit[1]) if unit else 1.0
    except ValueError:
        metres = math.nan
    if not 0.0 < metres < math.inf:
        raise InputError(f"{path}: unit: expected a positive number of metres")
    return names[axis[1]] if axis else "y", metres  # COLLADA 1.4: Y_UP without an element


def read_cloud_file(path: str | Path, placement: Placement | None = None) -> CloudReading:
    """Read a cloud file into a scene.

    Parameters
    ----------
    path : str or Path
        npz, npy, csv, txt, xyz, asc, PTS, PCD, PLY, LAS or LAZ.
    placement : Placement, optional
        Place of the cloud in the scene.

    Raises
    ------
    InputError
        Not readable, no points, in degrees, or ambiguous columns.
    """
    _exists(path)
    kind = Path(path).suffix.lower()
    try:
        cloud = _cloud(path, kind)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path}: cannot be read as a cloud: {_line(error)}") from None
    points = cloud.points
    tally = cloud.tally or Tally("point", len(points), len(points))
    if len(points) == 0:
        raise InputError(f"{path}: expected points, got none{_list(tally.left_out)}")
    chosen = placement or Placement()
    placed = chosen.apply(points, "z", cloud.metres, str(path))
    return CloudReading(placed, cloud.notes, tally)


def _cloud(path: str | Path, kind: str) -> PointCloud:
    if kind == ".npz":
        with np.load(path, allow_pickle=False) as data:
            names = list(data)
            name = "points" if "points" in names else names[0] if len(names) == 1 else ""
            if not name:
                raise InputError(
                    f"{path}: expected an array of the name points, got {', '.join(names)[:80]}"
                )
            return _cloud_of_array(data[name], path)
    if kind == ".npy":
        return _cloud_of_array(np.load(path, allow_pickle=False), path)
    if kind in TEXT_SUFFIXES:
        return read_text_cloud(path)
    if kind in (".las", ".laz"):
        return read_las(path)
    if kind == ".pcd":
        return read_pcd(path)
    if kind == ".ply":
        read = read_ply(path)
        cloud = cloud_of_fields(read.names, read.values, str(path), where="vertex")
        others = {**({"face": len(read.faces)} if read.faces else {}), **read.others}
        notes = [f"{counted(n, name)} not used: points only" for name, n in others.items()]
        return replace(cloud, notes=(*cloud.notes, *notes))
    raise InputError(f"{path}: expected a cloud in {CLOUDS}, got {kind!r}")


def _cloud_of_array(array: Any, path: str | Path) -> PointCloud:
    """Return the cloud of an array (n, 3), or of records with fields x, y and z."""
    if array.dtype.names:
        names = [name for name in array.dtype.names if array.dtype[name].shape == ()]
        values = np.column_stack([np.asarray(array[name], dtype=float).ravel() for name in names])
        return cloud_of_fields(names, values, str(path))
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{path}: expected points of three coordinates, got {array.shape}")
    return cloud_of_fields(("x", "y", "z"), np.asarray(array, dtype=float), str(path))


def _exists(path: str | Path) -> None:
    if not Path(path).is_file():
        raise InputError(f"{path}: cannot be read: no such file")
    size = Path(path).stat().st_size
    if size > FilePolicy.max_bytes:
        raise InputError(
            f"{path}: cannot be read: {size / 2**20:.4g} MiB; expected at most "
            f"{FilePolicy.max_bytes / 2**20:g} MiB"
        )
    if Path(path).suffix.lower() == ".npz":
        try:
            with zipfile.ZipFile(path) as archive:
                unpacked = sum(part.file_size for part in archive.infolist())
        except zipfile.BadZipFile:
            raise InputError(f"{path}: cannot be read: not an npz file") from None
        if unpacked > 4 * FilePolicy.max_bytes:
            raise InputError(
                f"{path}: unpacks to more than {4 * FilePolicy.max_bytes / 2**20:g} MiB"
            )


def _line(error: Exception) -> str:
    return (str(error) or type(error).__name__).splitlines()[0][:120]


def _trimesh() -> Any:
    try:
        import trimesh
    except ImportError:
        raise InputError("meshes need trimesh: pip install 'netsp[online]'") from None
    return trimesh


def _collada() -> Any:
    try:
        import collada
    except ImportError:
        raise InputError("COLLADA meshes need pycollada: pip install 'netsp[online]'") from None
    return collada

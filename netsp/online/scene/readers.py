"""Meshes and clouds of points from files, by libraries that know their formats."""

from __future__ import annotations

import math
import re
import warnings
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from netsp.arrays import Floats
from netsp.axes import metres_per_unit
from netsp.errors import InputError, counted
from netsp.files import MOST_BYTES
from netsp.online.scene.point_clouds import (
    TEXT_SUFFIXES,
    PointCloud,
    read_las,
    read_pcd,
    read_text_cloud,
)

Up = Literal["x", "y", "z"]
"""Axis of a file that points upwards."""

_TURNS = {
    "x": ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)),
    "y": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
}
"""Rotations to z upwards. Of y: (x, y, z) is (x, -z, y) here (glTF 2.0, 3.4). Of x: right is -y and
inwards is z (COLLADA 1.4, up_axis)."""

CLOUDS = ".npz, .npy, .csv, .txt, .xyz, .asc, .pts, .pcd, .ply, .las or .laz"


@dataclass(frozen=True)
class Placement:
    """Place of a file's mesh or cloud in a scene.

    Parameters
    ----------
    scale : float
        Metres per unit of the file.
    up : str, optional
        Axis of the file that points upwards; None for what its format says, or z.
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
        self, points: Floats, up: Up = "z", metres: tuple[float, float, float] = (1.0, 1.0, 1.0),
        source: str = "file",
    ) -> Floats:  # fmt: skip
        """Return points of a file in the scene.

        Parameters
        ----------
        points : ndarray, shape (n, 3)
            Points of the file.
        up : str
            Axis that points upwards by its format.
        metres : tuple of float
            Metres per unit by its format.
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


def read_mesh(path: str | Path) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Vertices (n, 3), metres, z upwards, and faces (m, 3) of a mesh file. InputError if there are
    none, or coordinates are not finite."""
    vertices, faces, _ = load_mesh(path)
    return vertices, faces


def load_mesh(
    path: str | Path, placement: Placement | None = None
) -> tuple[Floats, npt.NDArray[np.int64], tuple[str, ...]]:
    """Read a mesh file into a scene.

    Parameters
    ----------
    path : str or Path
        STL, OBJ, PLY, GLB, glTF, COLLADA, or what else trimesh reads.
    placement : Placement, optional
        Where it stands.

    Returns
    -------
    vertices : ndarray, shape (n, 3)
        Metres, z upwards.
    faces : ndarray, shape (m, 3)
        Indices of their corners.
    notes : tuple of str
        What was turned, converted or left out, one line each.

    Raises
    ------
    InputError
        Not readable, no triangles, or coordinates that are not finite.
    """
    trimesh = _trimesh()
    _exists(path)
    kind = Path(path).suffix.lower()
    if kind == ".dae":
        _collada()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            loaded = trimesh.load(str(path))
            parts = list(getattr(loaded, "geometry", {"": loaded}).values())
            others = [p for p in parts if getattr(p, "faces", None) is None]
            mesh = loaded.to_mesh() if hasattr(loaded, "to_mesh") else loaded
    except Exception as error:  # whatever its many readers raise
        raise InputError(f"{path}: cannot be read as a mesh: {_line(error)}") from None
    faces = getattr(mesh, "faces", None)
    if faces is None or len(faces) == 0:
        raise InputError(f"{path}: expected a mesh with triangles, got none")
    vertices = np.asarray(mesh.vertices, dtype=float)
    wrong = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(wrong):
        raise InputError(
            f"{path}: vertex {wrong[0]} is {vertices[wrong[0]].tolist()}; expected finite numbers"
        )
    faces = np.asarray(faces, dtype=np.int64)
    notes = []
    if others:
        notes.append(f"{counted(len(others), 'part')} of points or lines, not of faces: left out")
    if kind == ".obj" and (lines := _obj_lines(Path(path))):
        notes.append(f"{counted(lines, 'element')} of points or lines, not of faces: left out")
    up, unit = _mesh_axes(Path(path), kind, loaded)
    chosen = placement or Placement()
    if chosen.up is None and up != "z":
        notes.append(f"{up} is up in this format: turned so that z is up")
    if unit != 1.0:
        notes.append(f"in units of {unit:.7g} m: converted to metres")
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = int((np.abs(area).max(axis=1) == 0.0).sum())
    if flat:
        notes.append(f"{counted(flat, 'face')} without area")
    return chosen.apply(vertices, up, (unit,) * 3, str(path)), faces, tuple(notes)


def _obj_lines(path: Path) -> int:
    """Return the number of elements of an OBJ file that trimesh passes over: points and lines."""
    return len(re.findall(rb"^[lp][ \t]", path.read_bytes(), re.MULTILINE))


def _mesh_axes(path: Path, kind: str, loaded: Any) -> tuple[Up, float]:
    """Return the axis that points upwards and the metres per unit by a mesh's format."""
    if kind in (".glb", ".gltf"):
        return "y", 1.0
    if kind == ".dae":
        text = path.read_text(encoding="utf-8", errors="replace")
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
    if kind == ".3mf":
        return "z", metres_per_unit(str(getattr(loaded, "units", None) or "mm")) or 1.0
    return "z", 1.0


def read_cloud(path: str | Path) -> Floats:
    """Points (n, 3) of a cloud file, metres, z upwards. InputError if there are none."""
    return load_cloud(path)[0]


def load_cloud(
    path: str | Path, placement: Placement | None = None
) -> tuple[Floats, tuple[str, ...]]:
    """Read a cloud file into a scene.

    Parameters
    ----------
    path : str or Path
        npz, npy, csv, txt, xyz, asc, PTS, PCD, PLY, LAS or LAZ.
    placement : Placement, optional
        Where it stands.

    Returns
    -------
    points : ndarray, shape (n, 3)
        Metres, z upwards.
    notes : tuple of str
        What was left out or converted, one line each.

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
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise InputError(f"{path}: expected points of three coordinates, got {points.shape}")
    chosen = placement or Placement()
    return chosen.apply(points, "z", cloud.metres, str(path)), cloud.notes


def _cloud(path: str | Path, kind: str) -> PointCloud:
    if kind == ".npz":
        with np.load(path, allow_pickle=False) as data:
            name = "points" if "points" in data else next(iter(data), "")
            return PointCloud(np.asarray(data[name], dtype=float))
    if kind == ".npy":
        return PointCloud(np.asarray(np.load(path, allow_pickle=False), dtype=float))
    if kind in TEXT_SUFFIXES:
        return read_text_cloud(path)
    if kind in (".las", ".laz"):
        return read_las(path)
    if kind == ".pcd":
        return read_pcd(path)
    if kind == ".ply":
        return PointCloud(np.asarray(_trimesh().load(str(path)).vertices, dtype=float))
    raise InputError(f"{path}: expected a cloud in {CLOUDS}, got {kind!r}")


def _exists(path: str | Path) -> None:
    if not Path(path).is_file():
        raise InputError(f"{path}: cannot be read: no such file")
    size = Path(path).stat().st_size
    if size > MOST_BYTES:
        raise InputError(
            f"{path}: cannot be read: {size / 2**20:.4g} MiB; expected at most "
            f"{MOST_BYTES / 2**20:g} MiB"
        )
    if Path(path).suffix.lower() == ".npz":
        try:
            with zipfile.ZipFile(path) as archive:
                unpacked = sum(part.file_size for part in archive.infolist())
        except zipfile.BadZipFile:
            raise InputError(f"{path}: cannot be read: not an npz file") from None
        if unpacked > 4 * MOST_BYTES:
            raise InputError(f"{path}: unpacks to more than {4 * MOST_BYTES / 2**20:g} MiB")


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

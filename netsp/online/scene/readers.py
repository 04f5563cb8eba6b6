"""Meshes and clouds of points from files, by libraries that know their formats."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.files import MOST_BYTES


def read_mesh(path: str | Path) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Vertices (n, 3) and faces (m, 3) of a mesh file. InputError if there are none, or
    coordinates are not finite."""
    trimesh = _trimesh()
    _exists(path)
    try:
        mesh = trimesh.load(str(path), force="mesh")
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
    return vertices, np.asarray(faces, dtype=np.int64)


def read_cloud(path: str | Path) -> Floats:
    """Points (n, 3) of a cloud file. InputError if there are none."""
    _exists(path)
    kind = Path(path).suffix.lower()
    try:
        if kind == ".npz":
            with np.load(path, allow_pickle=False) as data:
                name = "points" if "points" in data else next(iter(data), "")
                points = np.asarray(data[name], dtype=float)
        elif kind == ".npy":
            points = np.asarray(np.load(path, allow_pickle=False), dtype=float)
        elif kind in (".csv", ".txt", ".xyz"):
            text = Path(path).read_text(encoding="utf-8").replace(",", " ").splitlines()
            rows = [line.split()[:3] for line in text if line.strip()]
            if rows and not _numeric(rows[0]):
                rows = rows[1:]
            points = np.array([[float(v) for v in row] for row in rows]).reshape(-1, 3)
        elif kind in (".las", ".laz"):
            points = np.asarray(_laspy().read(str(path)).xyz, dtype=float)
        elif kind == ".ply":
            points = np.asarray(_trimesh().load(str(path)).vertices, dtype=float)
        else:
            raise InputError(
                f"{path}: expected a cloud in .npz, .npy, .csv, .txt, .xyz, .ply, .las or .laz, "
                f"got {kind!r}"
            )
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path}: cannot be read as a cloud: {_line(error)}") from None
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise InputError(f"{path}: expected points of three coordinates, got {points.shape}")
    return points


def _numeric(row: list[str]) -> bool:
    try:
        [float(v) for v in row]
    except ValueError:
        return False
    return True


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


def _laspy() -> Any:
    try:
        import laspy
    except ImportError:
        raise InputError("LAS clouds need laspy: pip install 'netsp[online]'") from None
    return laspy

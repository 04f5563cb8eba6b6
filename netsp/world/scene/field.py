"""Signed distance field of a scene: the distance to the nearest solid, negative inside."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.bounded_work import end_if_abandoned
from netsp.base.errors import InputError
from netsp.world.scene import packing
from netsp.world.scene.grid import VoxelGrid
from netsp.world.scene.sampling import Field, are_clear, sample_many
from netsp.world.scene.scene_policy import FieldPolicy

FILE_VERSION = 4
"""Format of the files that `DistanceField.save` writes."""


def finite_point(value: npt.ArrayLike, name: str) -> tuple[float, float, float]:
    """Return three finite coordinates; raise InputError, which names them, for anything else."""
    try:
        x, y, z = (float(v) for v in np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected three finite coordinates, got {value!r}") from None
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        raise InputError(f"{name}: expected three finite coordinates, got {value!r}")
    return x, y, z


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Distance, gradient and lines of sight in a scene.

    Parameters
    ----------
    arrays : Field
        Arrays for kernels (`netsp.world.scene.sampling.Field`).
    voxel : float, optional
        Size of a voxel, metres; None without voxels, where all distances are exact.
    notes : tuple of str
        Assumptions about meshes and clouds, one line each.
    thickness : tuple of (str, float)
        Name and thickness of each part, metres.
    seams : tuple of int
        For each solid at the end that fills a seam between two others (`netsp.world.scene.seams`),
        the index of one of the two.
    policy : FieldPolicy
        Policy of fields.
    """

    arrays: Field
    voxel: float | None = None
    notes: tuple[str, ...] = ()
    thickness: tuple[tuple[str, float], ...] = ()
    seams: tuple[int, ...] = ()
    policy: FieldPolicy = dataclass_field(default_factory=FieldPolicy)

    @classmethod
    def build(
        cls,
        kinds: list[int],
        rows: list[list[float]],
        outline: npt.ArrayLike,
        boxes: Sequence[Floats],
        grid: VoxelGrid | None,
        offset: float,
        thickness: Sequence[tuple[str, float]] = (),
        seams: Sequence[int] = (),
        policy: FieldPolicy | None = None,
    ) -> DistanceField:
        """Return the field of encoded solids, their bounding boxes and voxels.

        Parameters
        ----------
        kinds : list of int
            Kind of each solid (`netsp.world.scene.solids`).
        rows : list of list of float
            Numbers of each solid.
        outline : array_like, shape (n, 2)
            Corners of all prisms.
        boxes : sequence of ndarray
            Bounding box (2, 3) of each solid that has one.
        grid : VoxelGrid or None
            Voxels.
        offset : float
            Length by which everything is grown, metres.
        thickness : sequence of (str, float)
            Name and thickness of each part, metres.
        seams : sequence of int
            As the attribute.
        policy : FieldPolicy, optional
            Policy of fields.
        """
        policy = policy or FieldPolicy()
        data = packing.pack_solids(kinds, rows, outline)
        if len(kinds) > policy.max_solids_without_lookup and boxes:
            low = np.min([b[0] for b in boxes], axis=0)
            high = np.max([b[1] for b in boxes], axis=0)
            room = 0.25 * float((high - low).max()) + 1e-9
            low, high = low - room, high + room
            size = float((high - low).max()) / policy.lookup_cells
            data = packing.add_lookup(data, low, high, size)
        voxels = np.empty(0, dtype=np.float32)
        if grid is not None:
            data, voxels = packing.add_voxels(data, grid), grid.values
        return cls(
            Field(data, voxels, float(offset)),
            grid.voxel if grid is not None else None,
            grid.notes if grid is not None else (),
            tuple(thickness),
            tuple(seams),
            policy,
        )

    def distance(self, points: npt.ArrayLike) -> Floats:
        """Return the distances of points, negative inside a solid.

        Distances are exact outside of solids, and trilinear between voxels. Inside overlapping
        solids, they are those to the nearest of their surfaces.

        Parameters
        ----------
        points : array_like, shape (..., 3)
            Points, metres.
        """
        p = self._points(points)
        rows, out = p.reshape(-1, 3), np.empty(p.shape[:-1])
        chunk = self.policy.chunk_points
        for first in range(0, len(rows), chunk):
            end_if_abandoned()
            part = slice(first, first + chunk)
            out.reshape(-1)[part] = sample_many(self.arrays, rows[part])[:, 0]
        return out

    def gradient(self, points: npt.ArrayLike) -> Floats:
        """Return the unit gradients of the distance, which point away from the nearest solid.

        Parameters
        ----------
        points : array_like, shape (..., 3)
            Points, metres.
        """
        p = self._points(points)
        return np.asarray(sample_many(self.arrays, p.reshape(-1, 3))[:, 1:4].reshape(p.shape))

    def nearest(self, points: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """Return the index of the solid nearest to each point, -1 for voxels.

        Parameters
        ----------
        points : array_like, shape (..., 3)
            Points, metres.
        """
        p = self._points(points)
        found = sample_many(self.arrays, p.reshape(-1, 3))[:, 4].astype(np.int64)
        if self.seams:
            first = int(self.arrays.data[packing.COUNT]) - len(self.seams)
            inside = found >= first
            found[inside] = np.array(self.seams)[found[inside] - first]
        return np.asarray(found.reshape(p.shape[:-1]))

    def line_of_sight(self, a: npt.ArrayLike, b: npt.ArrayLike, depth: float = 0.0) -> bool:
        """Return whether no point of a segment is deeper inside a solid than `depth`.

        The answer is right to within a thousandth of the segment's length, or a tenth of a voxel.

        Parameters
        ----------
        a, b : array_like, shape (3,)
            Ends, metres.
        depth : float
            Depth that is allowed, metres.
        """
        return self.lines_of_sight(np.asarray(a)[None], np.asarray(b)[None], depth)

    def lines_of_sight(self, a: npt.ArrayLike, b: npt.ArrayLike, depth: float = 0.0) -> bool:
        """Return whether no point of any of several segments is deeper inside a solid than `depth`,
        as `line_of_sight`.

        Parameters
        ----------
        a, b : array_like, shape (n, 3)
            Ends, metres.
        depth : float
            Depth that is allowed, metres.
        """
        p, q = self._points(a), self._points(b)
        steps = np.maximum(1e-3 * np.sqrt(((q - p) ** 2).sum(axis=1)), 1e-9)
        if self.voxel is not None:
            steps = np.minimum(steps, 0.1 * self.voxel)
        if depth:
            steps = np.minimum(steps, depth)
        return bool(are_clear(self.arrays, p, q, np.maximum(steps, 1e-9), -max(depth, 1e-9)))

    def free_point(self, value: npt.ArrayLike, name: str, depth: float = 1e-6) -> Floats:
        """Return a point as floats, after checking that it is free.

        Parameters
        ----------
        value : array_like, shape (3,)
            Point, metres.
        name : str
            Name of the point in messages.
        depth : float
            Depth inside a solid that is allowed, metres.

        Raises
        ------
        InputError
            The point is not three finite numbers, or is deeper inside a solid.
        """
        point = np.array(finite_point(value, name))
        d = float(sample_many(self.arrays, point[None])[0, 0])
        if d < -depth:
            shown = ", ".join(f"{v:g}" for v in point)
            raise InputError(f"{name}: ({shown}) lies {-d:.3g} inside a solid")
        return point

    def thinner_than(self, thickness: float) -> tuple[str, ...]:
        """Return one line for each part of the scene that is thinner than a thickness in metres."""
        lines = [
            f"{name} is {t:.3g} thick, thinner than {thickness:.3g}"
            for name, t in self.thickness
            if t + 2.0 * self.arrays.offset < thickness
        ]
        share = self._thin_share(thickness) if self.voxel is not None else 0.0
        if share > 0.005:
            lines.append(
                f"{100 * share:.0f} % of the solid voxels belong to parts thinner than "
                f"{thickness:.3g}"
            )
        return tuple(lines)

    def _thin_share(self, thickness: float) -> float:
        """Return the share of solid voxels that no ball of this diameter inside the solid
        covers."""
        from scipy.ndimage import distance_transform_edt

        size, reach = self._size, 0.5 * thickness + 1.74 * self._size
        depth = 0.5 * thickness - 0.87 * size
        data = self.arrays.data
        if not data[packing.BLOCKS]:
            counts = data[packing.SHAPE : packing.SHAPE + 3].astype(int)
            grid = self.arrays.grid.reshape(counts) - self.arrays.offset
            solid, deep = grid < 0.0, grid <= -depth
            if not deep.any():
                return float(solid.any())
            far = distance_transform_edt(~deep) * size
            return float((far[solid] > reach).mean())
        samples = packing.sample_block_points(
            data, self.arrays.grid, self.arrays.offset, self.policy.max_thin_samples
        )
        if not len(samples):
            return 0.0
        steps = np.linspace(-reach, reach, 9)
        ball = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
        ball = ball[np.linalg.norm(ball, axis=1) <= reach]
        deepest = np.array([self.distance(p + ball).min() for p in samples])
        return float((deepest > -depth).mean())

    @cached_property
    def _size(self) -> float:
        return self.voxel or math.nan

    def grown(self, by: float) -> DistanceField:
        """Return the field of the same scene with everything grown.

        Parameters
        ----------
        by : float
            Growth, metres.
        """
        arrays = self.arrays._replace(offset=float(self.arrays.offset) + by)
        return replace(self, arrays=arrays)

    @property
    def voxels(self) -> VoxelGrid | None:
        """Voxels, for use in another field; None without voxels."""
        return packing.unpack_voxels(self.arrays.data, self.arrays.grid, self.notes)

    @property
    def box(self) -> Floats | None:
        """Bounding box (2, 3) of the voxels' solid part; None without voxels."""
        if self.voxel is None:
            return None
        begin = packing.PLACE + 4
        return self.arrays.data[begin : begin + 6].reshape(2, 3).copy()

    def _points(self, points: npt.ArrayLike) -> Floats:
        p = np.asarray(points, dtype=float, order="C")  # each memory order compiles a kernel again
        if p.shape[-1:] != (3,):
            raise InputError(f"points: expected shape (..., 3), got {p.shape}")
        if not np.isfinite(p).all():
            raise InputError("points: expected finite coordinates")
        return p

    def save(self, path: str | Path) -> None:
        """Write the field, voxels and solids, to an .npz file.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        try:
            np.savez_compressed(
                path,
                version=FILE_VERSION,
                voxel=np.nan if self.voxel is None else self.voxel,
                notes=np.array(self.notes, dtype=str),
                parts=np.array([n for n, _ in self.thickness], dtype=str),
                thickness=np.array([t for _, t in self.thickness]),
                seams=np.array(self.seams, dtype=np.int64),
                **dict(self.arrays._asdict().items()),
            )
        except OSError as error:
            raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None

    @classmethod
    def load(cls, path: str | Path) -> DistanceField:
        """Read a field that `save` wrote.

        Raises
        ------
        InputError
            The file cannot be read or holds something else.
        """
        try:
            with open(path, "rb") as file, np.load(file, allow_pickle=False) as data:
                if int(data["version"]) != FILE_VERSION:
                    raise InputError(f"{path}: a distance field of another version")
                arrays = Field(**{k: data[k] for k in Field._fields})
                arrays = arrays._replace(offset=float(arrays.offset))
                voxel = float(data["voxel"])
                return cls(
                    arrays,
                    None if math.isnan(voxel) else voxel,
                    tuple(str(n) for n in data["notes"]),
                    tuple(
                        (str(n), float(t))
                        for n, t in zip(data["parts"], data["thickness"], strict=True)
                    ),
                    tuple(data["seams"].tolist()),
                )
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
        except (KeyError, ValueError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise InputError(f"{path}: not a distance field of netsp: {error}") from None


def pushed_out(
    field: DistanceField, points: npt.ArrayLike, clearance: float, rounds: int = 20
) -> npt.NDArray[np.float64]:
    """Return points (n, 3) moved along the distance's gradient until they keep the clearance.

    No point is moved to where its distance is smaller. A point that cannot be moved far enough
    stays where it is.
    """
    p = np.array(points, dtype=float).reshape(-1, 3)
    d = field.distance(p)
    for _ in range(rounds):
        short = d < clearance - 1e-6
        if not short.any():
            break
        step = np.where(short, clearance - d, 0.0)[:, None]
        moved = p + step * field.gradient(p)
        after = field.distance(moved)
        better = after > d
        if not (better & short).any():
            break
        p[better], d[better] = moved[better], after[better]
    return p

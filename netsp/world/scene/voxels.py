"""Grids of signed distances from meshes and clouds of points, true to a fraction of a voxel.

Distances: every grid point near a surface measures its nearest triangle or point. Sweeps in the
eight diagonal directions pass the site on to neighbours, which measure their own distance to it (a
closest point transform). Signs: points around which a closed surface winds are solid, so
overlapping parts are united; the holes of open meshes are closed first
(`netsp.world.scene.mesh_body`). A sheet or a cloud has no inside, so water floods the grid from its
border, and points that it does not reach are solid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Singles
from netsp.base.bounded_work import end_if_abandoned
from netsp.base.errors import InputError, counted
from netsp.world.scene.face_tree import FaceTree
from netsp.world.scene.grid import SIDE, VoxelGrid
from netsp.world.scene.lattice import Dense, Lattice, OnStage, report_stage, sparse_near
from netsp.world.scene.mesh_body import MeshBody, body_of_mesh, percent
from netsp.world.scene.scene_policy import GridPolicy
from netsp.world.scene.sites import point_sites, triangle_sites


def grid_of_bodies(
    bodies: list[MeshBody],
    *,
    voxel: float | None = None,
    memory_limit: float = 4.0,
    on_progress: OnStage = None,
    region: Floats | None = None,
    source: str = "mesh",
    policy: GridPolicy | None = None,
) -> VoxelGrid:
    """Return the distance grid of the bodies of several meshes together.

    Parameters
    ----------
    bodies : list of MeshBody
        Bodies (`netsp.world.scene.mesh_body`).
    voxel : float, optional
        Edge of a voxel, metres.
    memory_limit : float
        Maximum memory, GiB.
    on_progress : callable, optional
        Called with (stage, fraction done).
    region : ndarray, shape (2, 3), optional
        Box outside of which distances need not be exact, metres.
    source : str
        Name of the mesh, for messages.
    policy : GridPolicy, optional
        Policy of grids.

    Raises
    ------
    InputError
        The grid is too large, or sheets are too thin for its voxels.
    """
    mesh = _Triangles.from_bodies(bodies)
    policy = policy or GridPolicy()
    thickness = _thickness(bodies, source)
    size = _size(mesh.low, mesh.high, voxel, source, policy, thickness)
    shell = _shell(thickness, size, source, policy)
    sized_by = thickness if voxel is None else None
    place = _Place(mesh.low, mesh.high, size, memory_limit, source, sized_by)
    triangles = None if mesh.has_sheet or len(mesh.loose) else mesh.solid
    half = shell / size if mesh.has_sheet else 0.0
    lattice = _lattice(place, mesh.sites, policy, shell=half, triangles=triangles, region=region)
    values, notes, grow = mesh.values(lattice, on_progress, source, shell, policy.max_hidden_share)
    report_stage(on_progress, "distances", 1.0)
    box = np.array([mesh.low - grow, mesh.high + grow])
    return lattice.grid(values, box, tuple(notes))


def grid_of_triangles(
    vertices: npt.ArrayLike,
    faces: npt.ArrayLike,
    *,
    voxel: float | None = None,
    thickness: float | None = None,
    memory_limit: float = 4.0,
    on_progress: OnStage = None,
    region: Floats | None = None,
    source: str = "mesh",
    policy: GridPolicy | None = None,
) -> VoxelGrid:
    """Return the distance grid of triangles with vertices (n, 3) and faces (m, 3).

    Its notes name the defects of the mesh.
    """
    v, f = np.asarray(vertices, dtype=float), np.asarray(faces, dtype=np.int64)
    if f.size == 0:
        raise InputError(f"{source}: expected a mesh with triangles, got none")
    if v.ndim != 2 or v.shape[1] != 3 or f.ndim != 2 or f.shape[1] != 3:
        raise InputError(
            f"{source}: expected vertices (n, 3) and faces (m, 3), got {v.shape} and {f.shape}"
        )
    if f.min() < 0 or f.max() >= len(v):
        raise InputError(f"{source}: a face has a corner that is none of the {len(v)} vertices")
    if not np.isfinite(v).all():
        raise InputError(f"{source}: a vertex is not finite")
    body = replace(body_of_mesh(v, f), thickness=thickness)
    grid = grid_of_bodies(
        [body],
        voxel=voxel,
        memory_limit=memory_limit,
        on_progress=on_progress,
        region=region,
        source=source,
        policy=policy,
    )
    return replace(grid, notes=(*body.notes, *grid.notes))


@dataclass
class _Triangles:
    """Triangles (m, 3, 3) about solids, about solids whose edges do not meet, and of sheets, their
    sites in this order, the corners (3,) of their box, and the number of parts that were inside
    out."""

    solid: Floats
    loose: Floats
    sheet: Floats
    sites: Floats
    low: Floats
    high: Floats
    turned: int

    @classmethod
    def from_bodies(cls, bodies: list[MeshBody]) -> _Triangles:
        solid = np.concatenate([b.vertices[b.solid] for b in bodies])
        sheet = np.concatenate([b.vertices[b.sheet] for b in bodies])
        end_if_abandoned()
        loose = np.concatenate([b.vertices[b.loose] for b in bodies])
        every = np.concatenate([solid, loose, sheet])
        turned = sum(b.turned for b in bodies)
        low, high = every.min((0, 1)), every.max((0, 1))
        return cls(solid, loose, sheet, triangle_sites(every), low, high, turned)

    @property
    def surface(self) -> Floats:
        """Triangles about solids."""
        return np.concatenate([self.solid, self.loose]) if len(self.loose) else self.solid

    @property
    def has_sheet(self) -> bool:
        """Sheets are among the triangles."""
        return len(self.sheet) > 0

    def values(
        self,
        lattice: Lattice,
        on_progress: OnStage,
        source: str,
        shell: float,
        max_hidden_share: float,
    ) -> tuple[Singles, list[str], float]:
        """Return the signed distances at the points of a lattice, notes on what was assumed, and
        growth beyond the triangles' box, metres."""
        size, notes = lattice.size, []
        _check_voxel("mesh", size, self.low, self.high, source)
        values = lattice.closest(self.sites, on_progress, with_owners=False)[0]
        grow = 0.0
        surface = self.surface
        if not len(surface):
            self._check_shell(shell, size, source)
            values -= np.float32(shell)
            grow = shell
        else:
            sheet = self.sites[len(surface) :]
            if len(sheet):
                solid_sites = self.sites[: len(surface)]
                values = lattice.closest(solid_sites, None, with_owners=False)[0]
            notes += self._turn_inside(lattice, values)
            thin = self._thin(lattice, values)
            if thin.any():
                share = float(_double_areas(surface[thin]).sum())
                share /= float(_double_areas(surface).sum())
                notes.append(
                    f"{percent(share)} of the surface is of parts thinner than a voxel of "
                    f"{size:.3g}: made {2 * shell:.3g} thick; smaller voxels show them as they are"
                )
                sheet = np.concatenate([sheet, self.sites[: len(surface)][thin]])
            if len(sheet):
                self._check_shell(shell, size, source)
                below = np.abs(values) + np.float32(shell)
                near = lattice.closest(sheet, None, with_owners=False, below=below)[0]
                values = np.minimum(values, near - np.float32(shell))
                grow = shell
        if self.has_sheet:
            notes.append(f"sheets are {2 * shell:.3g} thick")
            share = self._hidden_share(lattice, values, shell)
            if share > max_hidden_share:
                notes.append(
                    f"{percent(share)} of the surface is sides of sheets within the thickness of "
                    f"others: taken as solid; voxels smaller than {size:.3g} show more of them"
                )
        end_if_abandoned()
        enclosed = lattice.unreached(values)
        if enclosed.any():
            values[enclosed] = -np.abs(values[enclosed])
            notes.append("closed cavities count as solid")
        return values, notes, grow

    def _hidden_share(self, lattice: Lattice, values: Singles, shell: float) -> float:
        """Return the share of the surface that is sides of sheets in something solid."""
        normals = np.cross(self.sheet[:, 1] - self.sheet[:, 0], self.sheet[:, 2] - self.sheet[:, 0])
        double_areas = np.linalg.norm(normals, axis=1)
        normals /= np.maximum(double_areas, 1e-300)[:, None]
        hidden = 0.0
        for weights in _SPREAD:
            places = np.einsum("k,mkd->md", weights, self.sheet)
            for side in (shell + lattice.size, -shell - lattice.size):
                at = places + side * normals
                hidden += float(double_areas[lattice.minimum_nearby(values, at, 0) < 0.0].sum())
        area = 2.0 * float(double_areas.sum())
        if len(self.surface):
            area += float(_double_areas(self.surface).sum())
        return hidden / (len(_SPREAD) * area)

    def _check_shell(self, shell: float, size: float, source: str) -> None:
        """Raise InputError if sheets are thicker than the mesh is across."""
        side = float((self.high - self.low).max())
        if 2.0 * shell > side * (1.0 + 1e-9):
            raise InputError(
                f"{source}: mesh.voxel: {size:.3g} makes sheets and thin parts {2 * shell:.3g} "
                f"thick, more than the mesh is across, {side:.3g}; expected at most "
                f"{_rounded_down(0.5 * side * size / shell)}"
            )

    def _turn_inside(self, lattice: Lattice, values: Singles) -> list[str]:
        """Negate the values inside the solid; return notes on its parts."""
        max_winding = lattice.turn_inside(values, self.solid) if len(self.solid) else 0
        if len(self.loose):
            lattice.turn_wound(values, FaceTree.build(self.loose))
        if self.turned:
            return [f"{counted(self.turned, 'part')} inside out, or a cavity: taken as solid"]
        return ["parts of the mesh overlap: taken as their union"] if max_winding > 1 else []

    def _thin(self, lattice: Lattice, values: Singles) -> Bools:
        """Return which triangles (m,) about the solid are the faces of parts thinner than a
        voxel."""
        surface = self.surface
        thin = np.zeros(len(surface), dtype=bool)
        normals = np.cross(surface[:, 1] - surface[:, 0], surface[:, 2] - surface[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        off = 1e-3 * lattice.size
        tree: FaceTree | None = None
        tried = np.einsum("tk,mkd->tmd", _TRIED, surface)
        minima = lattice.minimum_nearby(values, tried.reshape(-1, 3), 1).reshape(len(_TRIED), -1)
        for places, lowest in zip(tried, minima, strict=True):
            thin |= lowest > 0.0
            # behind a flat face of a thick part, some point is half a voxel deep
            shallow = np.flatnonzero(~thin & (lowest > -0.5 * lattice.size))
            if len(shallow):
                tree = tree or FaceTree.build(surface)
                inwards = -normals[shallow]
                lengths = tree.ray_lengths(places[shallow] + off * inwards, inwards)
                thin[shallow[lengths < lattice.size]] = True
        return thin


_SPREAD = np.array([[i, j, 7 - i - j] for i in range(1, 6) for j in range(1, 7 - i)]) / 7.0
"""Places spread over a triangle at which the sides of sheets are looked at, by weights of its
corners."""

_TRIED = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""Tolerance of the search for thin parts: the places of a triangle, by weights of its corners."""


def _thickness(bodies: list[MeshBody], source: str) -> float | None:
    """Return the largest thickness that bodies state for sheets, metres; None if none does.

    InputError if it is more than the mesh is across.
    """
    stated = [b for b in bodies if b.thickness is not None]
    for body in stated:
        side = float(np.ptp(body.vertices, axis=0).max())
        if body.thickness is not None and body.thickness > side > 0.0:
            raise InputError(
                f"{source}: mesh.thickness: {body.thickness:.3g} is more than the mesh is across, "
                f"{side:.3g}; expected at most {_rounded_down(side)}"
            )
    return max((b.thickness for b in stated if b.thickness is not None), default=None)


def _shell(thickness: float | None, size: float, source: str, policy: GridPolicy) -> float:
    """Return half the thickness of sheets, metres."""
    if thickness is None:
        return policy.sheet_voxels * size
    if not thickness >= 2.0 * policy.sheet_voxels * size * (1.0 - 1e-9):
        raise InputError(
            f"{source}: mesh.thickness: {thickness:.3g} is less than {2 * policy.sheet_voxels:g} "
            f"voxels of {size:.3g}; expected more, or voxels of at most "
            f"{0.5 * thickness / policy.sheet_voxels:.3g}"
        )
    return 0.5 * thickness


def _check_voxel(kind: str, size: float, low: Floats, high: Floats, source: str) -> None:
    """Raise InputError if voxels are larger than a mesh or cloud in the box from low to high."""
    side = float((high - low).max())
    if size > side:
        raise InputError(
            f"{source}: {kind}.voxel: {size:.3g} is larger than the {kind}, {side:.3g} across; "
            f"expected at most {_rounded_down(0.25 * side)}"
        )


def _rounded_down(number: float) -> str:
    """Return a positive number with two digits, never more than it is."""
    unit = 10.0 ** (math.floor(math.log10(number)) - 1)
    return f"{math.floor(number / unit + 1e-9) * unit:.2g}"


def _double_areas(triangles: Floats) -> Floats:
    """Return twice the areas (m,) of triangles."""
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return np.asarray(np.linalg.norm(np.cross(u, v), axis=1))


def grid_of_cloud(
    points: npt.ArrayLike,
    *,
    voxel: float | None = None,
    memory_limit: float = 4.0,
    on_progress: OnStage = None,
    source: str = "cloud",
    policy: GridPolicy | None = None,
) -> VoxelGrid:
    """Return the distance grid of a cloud (n, 3) that lies on the surface of something solid.

    The cloud is closed: balls about the points, of a radius r that shuts the gaps between
    neighbours, keep the water out. What the water does not reach is then eroded by r again. So the
    surface passes through the points and bridges gaps of up to about 2 r. Where nothing solid would
    be left, as of a sheet of points, the solid is the points, thickened on both sides.
    """
    p = _points(points, source)
    low, high = p.min(0), p.max(0)
    policy = policy or GridPolicy()
    size = _size(low, high, voxel, source, policy)
    ball = _ball(p, size)
    sites = point_sites(p)
    place = _Place(low, high, size, memory_limit, source)
    lattice = _lattice(place, sites, policy, extra=_spacing(p), has_cloud=True)
    values, notes, grow = _cloud_values(
        lattice, p, sites, ball, on_progress, source, policy.sheet_voxels
    )
    report_stage(on_progress, "distances", 1.0)
    return lattice.grid(values, np.array([low - grow, high + grow]), tuple(notes))


def _points(points: npt.ArrayLike, source: str) -> Floats:
    p = np.asarray(points, dtype=float)
    if p.ndim != 2 or p.shape[1] != 3:
        raise InputError(f"{source}: expected points of three coordinates, got shape {p.shape}")
    if len(p) < 4:
        raise InputError(f"{source}: expected at least 4 points, got {len(p)}")
    if not np.isfinite(p).all():
        raise InputError(f"{source}: a point is not finite")
    return p


def _ball(p: Floats, size: float) -> float:
    """Return the radius of the balls about points that keep the water out, metres."""
    from scipy.spatial import cKDTree

    near, _ = cKDTree(p).query(p, k=min(7, len(p)))
    return max(1.5 * size, float(np.quantile(near[:, -1], 0.95)))


def _cloud_values(
    lattice: Lattice,
    p: Floats,
    sites: Floats,
    ball: float,
    on_progress: OnStage,
    source: str,
    sheet_voxels: float,
) -> tuple[Singles, list[str], float]:
    """Return the signed distances at the points of a lattice, notes, and growth beyond the points'
    box."""
    size = lattice.size
    distances, owner = lattice.closest(sites, on_progress)
    report_stage(on_progress, "flood", 0.5)
    values = distances - np.float32(ball)
    end_if_abandoned()
    filled = lattice.unreached(values) | (values <= 0.0)
    # the distance to the water's edge: balls about grid points in the water that just touch it
    edge = ~filled & (values <= 1.8 * size)
    if not edge.any() or not filled.any():
        raise InputError(f"{source}: no solid at voxels of {size:.3g}; expected smaller voxels")
    at, which = lattice.positions(edge)
    weighted = point_sites(at, values[which])
    to_water = lattice.closest(weighted, with_owners=False)[0]
    out = np.where(filled, ball - to_water, distances).astype(np.float32)
    notes = [f"gaps of up to {2 * ball:.3g} between points are closed"]
    # points with nothing solid around them
    loose = lattice.minimum_nearby(out, p, 2) > -size
    grow = 0.0
    if loose.any():
        half = sheet_voxels * size
        out = np.where(loose[owner], np.minimum(out, distances - np.float32(half)), out)
        grow = half
        if loose.mean() > 0.01:
            notes.append(
                f"{100 * loose.mean():.0f} % of the points enclose nothing: taken as a sheet, "
                f"{2 * half:.3g} thick"
            )
    return out, notes, grow


def grid_of_bodies_and_cloud(
    bodies: list[MeshBody],
    points: npt.ArrayLike,
    *,
    voxel: float | None = None,
    memory_limit: float = 4.0,
    on_progress: OnStage = None,
    source: str = "scene",
    policy: GridPolicy | None = None,
) -> VoxelGrid:
    """Return the distance grid of meshes and a cloud of points together.

    Both are measured at the points of one lattice. Outside of their union the smaller distance is
    the distance to it; inside, it is no deeper than the truth.

    Parameters
    ----------
    bodies : list of MeshBody
        Bodies of the meshes.
    points : ndarray, shape (k, 3)
        Points of the cloud.
    voxel : float, optional
        Edge of a voxel, metres.
    memory_limit : float
        Maximum memory, GiB.
    on_progress : callable, optional
        Called with (stage, fraction done).
    source : str
        Name of the scene, for messages.
    policy : GridPolicy, optional
        Policy of grids.

    Raises
    ------
    InputError
        As `grid_of_bodies` and `grid_of_cloud` raise it.
    """
    p = _points(points, source)
    mesh = _Triangles.from_bodies(bodies)
    low = np.minimum(mesh.low, p.min(0))
    high = np.maximum(mesh.high, p.max(0))
    policy = policy or GridPolicy()
    thickness = _thickness(bodies, source)
    size = _size(low, high, voxel, source, policy, thickness)
    shell = _shell(thickness, size, source, policy)
    extra = _spacing(p)
    flat = triangle_sites(np.repeat(p[:, None], 3, axis=1))  # as triangles, to place blocks
    lattice = _lattice(
        _Place(low, high, size, memory_limit, source, thickness if voxel is None else None),
        np.vstack([mesh.sites, flat]),
        policy,
        shell=shell / size if mesh.has_sheet else 0.0,
        extra=extra,
        has_cloud=True,
    )
    values, notes, mesh_grow = mesh.values(
        lattice, on_progress, source, shell, policy.max_hidden_share
    )
    cloud, cloud_notes, grow = _cloud_values(
        lattice, p, point_sites(p), _ball(p, size), None, source, policy.sheet_voxels
    )
    grow = max(grow, mesh_grow)
    report_stage(on_progress, "distances", 1.0)
    box = np.array([low - grow, high + grow])
    return lattice.grid(np.minimum(values, cloud), box, (*notes, *cloud_notes))


@dataclass(frozen=True)
class _Place:
    """Box (corners `low` and `high`) of a grid, edge of its voxels, memory in GiB, and the name of
    its source for messages. If the thickness of sheets decided the edge, `thickness` states it."""

    low: Floats
    high: Floats
    size: float
    memory_limit: float
    source: str
    thickness: float | None = None


def _lattice(
    place: _Place,
    sites: Floats,
    policy: GridPolicy,
    *,
    shell: float = 0.0,
    extra: float = 0.0,
    has_cloud: bool = False,
    triangles: Floats | None = None,
    region: Floats | None = None,
) -> Lattice:
    """Return the points at which the grid is built; InputError if there are too many.

    Parameters
    ----------
    shell : float
        Half thickness of an open mesh, voxels.
    extra : float
        Room around the solid in addition to that of the policy, metres.
    has_cloud : bool
        Whether a cloud needs memory, too.
    """
    low, high, size = place.low, place.high, place.size
    memory = place.memory_limit * 2**30
    pad = policy.border_voxels * size + 2.0 * extra
    counts = np.ceil((high - low + 2.0 * pad) / size) + 1
    # an odd fraction of a voxel, so that no row of the grid runs along an edge of the mesh
    off = size * np.array([0.0123457, 0.0271828, 0.0314159])
    points = np.prod(counts)
    if points <= policy.max_dense_points and points * policy.bytes_per_voxel <= memory:
        return Dense(low - pad + off, size, (int(counts[0]), int(counts[1]), int(counts[2])))
    side = SIDE * size
    pad = policy.border_cells * side + 2.0 * extra
    cells = np.ceil((high - low + 2.0 * pad) / side)
    need = float(np.prod(cells + 1)) * policy.bytes_per_cell
    if need <= memory:
        lattice = sparse_near(
            low - pad + off,
            size,
            (int(cells[0]), int(cells[1]), int(cells[2])),
            sites,
            policy,
            shell=shell * size + extra,
            triangles=triangles,
            region=region,
        )
        block = policy.bytes_per_cloud_block if has_cloud else policy.bytes_per_mesh_block
        need += len(lattice.blocks) * block
        if need <= memory:
            return lattice
    # blocks lie along surfaces, cells fill the box
    better = size * math.sqrt(need / memory) * 1.05
    if place.thickness is not None:
        raise InputError(
            f"{place.source}: mesh.thickness: {place.thickness:.3g} needs voxels of {size:.3g}, "
            f"which need {need / 2**30:.3g} GiB, more than {place.memory_limit:g}; expected "
            f"{better / size * place.thickness:.2g} or more"
        )
    raise InputError(
        f"{place.source}: voxels of {size:.3g} need {need / 2**30:.3g} GiB, more than "
        f"{place.memory_limit:g}; expected voxels of {better:.2g} or more"
    )


def _size(
    low: Floats,
    high: Floats,
    voxel: float | None,
    source: str,
    policy: GridPolicy,
    thickness: float | None = None,
) -> float:
    """Return the edge of a voxel, metres: as stated, or to show the thickness of sheets."""
    if voxel is not None and not 0.0 < voxel < math.inf:
        raise InputError(f"{source}: voxel: expected a positive length, got {voxel!r}")
    side = float((high - low).max())
    if side <= 0.0:
        raise InputError(f"{source}: all points are the same")
    if voxel is not None:
        return voxel
    if thickness is None:
        return side / policy.default_voxels
    return 0.5 * thickness / policy.sheet_voxels


def _spacing(points: Floats) -> float:
    """Return a rough distance between neighbours, for the room around a cloud, metres."""
    from scipy.spatial import cKDTree

    samples = points[:: max(1, len(points) // 2000)]
    far, _ = cKDTree(points).query(samples, k=min(7, len(points)))
    return float(np.quantile(far[:, -1], 0.95))

"""Grids of signed distances from meshes and clouds of points, true to a fraction of a voxel.

Distances: every grid point near a surface measures its nearest triangle or point. Sweeps in the
eight diagonal directions pass the site on to neighbours, which measure their own distance to it (a
closest point transform). Signs: points around which a closed mesh winds are solid, so overlapping
parts are united. An open mesh or a cloud has no inside, so water floods the grid from its border,
and points that it does not reach are solid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Singles
from netsp.base.bounded_work import end_if_abandoned
from netsp.base.errors import InputError
from netsp.world.scene.grid import SIDE, VoxelGrid
from netsp.world.scene.lattice import Dense, Lattice, OnStage, report_stage, sparse_near
from netsp.world.scene.scene_policy import GridPolicy
from netsp.world.scene.sites import point_sites, triangle_sites


def grid_of_meshes(
    parts: list[tuple[Floats, npt.NDArray[np.int64]]],
    *,
    voxel: float | None = None,
    memory_limit: float = 4.0,
    on_progress: OnStage = None,
    region: Floats | None = None,
    source: str = "mesh",
    policy: GridPolicy | None = None,
) -> VoxelGrid:
    """Return the distance grid of several meshes together: vertices (n, 3) and faces (m, 3) of
    each."""
    first = np.cumsum([0, *(len(v) for v, _ in parts)])
    return grid_of_triangles(
        np.vstack([v for v, _ in parts]),
        np.vstack([f + n for (_, f), n in zip(parts, first, strict=False)]),
        voxel=voxel,
        memory_limit=memory_limit,
        on_progress=on_progress,
        region=region,
        source=source,
        policy=policy,
    )


def grid_of_triangles(
    vertices: npt.ArrayLike,
    faces: npt.ArrayLike,
    *,
    voxel: float | None = None,
    memory_limit: float = 4.0,
    on_progress: OnStage = None,
    region: Floats | None = None,
    source: str = "mesh",
    policy: GridPolicy | None = None,
) -> VoxelGrid:
    """Return the distance grid of triangles with vertices (n, 3) and faces (m, 3)."""
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
    mesh = _Triangles.from_mesh(v, f)
    low, high = mesh.triangles.min((0, 1)), mesh.triangles.max((0, 1))
    policy = policy or GridPolicy()
    half = policy.sheet_voxels if mesh.open_edges else 0.0
    place = _Place(low, high, _size(low, high, voxel, source, policy), memory_limit, source)
    triangles = None if mesh.open_edges else mesh.triangles
    lattice = _lattice(place, mesh.sites, policy, shell=half, triangles=triangles, region=region)
    values, notes = mesh.values(lattice, on_progress, source, policy.sheet_voxels)
    grow = half * lattice.size
    report_stage(on_progress, "distances", 1.0)
    return lattice.grid(values, np.array([low - grow, high + grow]), tuple(notes))


@dataclass
class _Triangles:
    """Triangles (m, 3, 3) of a mesh, their sites, and counts of edges and parts with defects."""

    triangles: Floats
    sites: Floats
    open_edges: int
    uneven: int
    turned: int

    @classmethod
    def from_mesh(cls, v: Floats, f: npt.NDArray[np.int64]) -> _Triangles:
        open_edges, uneven = _edges(f, v)
        turned = 0
        if not open_edges:
            f, turned = _outward(f, v)
        triangles = v[f]
        end_if_abandoned()
        return cls(triangles, triangle_sites(triangles), open_edges, uneven, turned)

    def values(
        self, lattice: Lattice, on_progress: OnStage, source: str, sheet_voxels: float
    ) -> tuple[Singles, list[str]]:
        """Return the signed distances at the points of a lattice, and notes on what was assumed."""
        size, notes = lattice.size, []
        values = lattice.closest(self.sites, on_progress, with_owners=False)[0]
        if self.open_edges:
            shell = sheet_voxels * size
            notes.append(
                f"the mesh is open ({self.open_edges} edges have one triangle only): taken as a "
                f"shell, {2 * shell:.3g} thick; spaces that water cannot reach count as solid"
            )
            values -= np.float32(shell)
        else:
            max_winding = lattice.turn_inside(values, self.triangles)
            if self.uneven:
                notes.append(
                    f"faces at {self.uneven} edges have opposite orientations: taken as solid "
                    "wherever the winding number is not zero"
                )
            if self.turned:
                notes.append(f"{self.turned} parts are inside out, or cavities: taken as solid")
            elif max_winding > 1:
                notes.append("parts of the mesh overlap: taken as their union")
        end_if_abandoned()
        enclosed = lattice.unreached(values)
        if enclosed.any():
            values[enclosed] = -np.abs(values[enclosed])
            if not self.open_edges:
                notes.append("closed cavities count as solid")
        if not (values < 0.0).any():
            raise InputError(f"{source}: no solid at voxels of {size:.3g}; expected smaller voxels")
        return values, notes


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


def grid_of_meshes_and_cloud(
    parts: list[tuple[Floats, npt.NDArray[np.int64]]],
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
    parts : list of (ndarray, ndarray)
        Vertices (n, 3) and faces (m, 3) of each mesh.
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
        As `grid_of_triangles` and `grid_of_cloud` raise it.
    """
    p = _points(points, source)
    first = np.cumsum([0, *(len(v) for v, _ in parts)])
    v = np.vstack([v for v, _ in parts])
    f = np.vstack([f + n for (_, f), n in zip(parts, first, strict=False)])
    mesh = _Triangles.from_mesh(v, f)
    low = np.minimum(mesh.triangles.min((0, 1)), p.min(0))
    high = np.maximum(mesh.triangles.max((0, 1)), p.max(0))
    policy = policy or GridPolicy()
    half = policy.sheet_voxels if mesh.open_edges else 0.0
    size = _size(low, high, voxel, source, policy)
    extra = _spacing(p)
    flat = triangle_sites(np.repeat(p[:, None], 3, axis=1))  # as triangles, to place blocks
    lattice = _lattice(
        _Place(low, high, size, memory_limit, source),
        np.vstack([mesh.sites, flat]),
        policy,
        shell=half,
        extra=extra,
        has_cloud=True,
    )
    values, notes = mesh.values(lattice, on_progress, source, policy.sheet_voxels)
    cloud, cloud_notes, grow = _cloud_values(
        lattice, p, point_sites(p), _ball(p, size), None, source, policy.sheet_voxels
    )
    if mesh.open_edges:
        grow = max(grow, half * lattice.size)
    report_stage(on_progress, "distances", 1.0)
    box = np.array([low - grow, high + grow])
    return lattice.grid(np.minimum(values, cloud), box, (*notes, *cloud_notes))


@dataclass(frozen=True)
class _Place:
    """Box (corners `low` and `high`) of a grid, edge of its voxels, memory in GiB, and the name of
    its source for messages."""

    low: Floats
    high: Floats
    size: float
    memory_limit: float
    source: str


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
    raise InputError(
        f"{place.source}: voxels of {size:.3g} need {need / 2**30:.3g} GiB, more than "
        f"{place.memory_limit:g}; expected voxels of {better:.2g} or more"
    )


def _size(low: Floats, high: Floats, voxel: float | None, source: str, policy: GridPolicy) -> float:
    """Return the edge of a voxel, metres."""
    if voxel is not None and not 0.0 < voxel < math.inf:
        raise InputError(f"{source}: voxel: expected a positive length, got {voxel!r}")
    side = float((high - low).max())
    if side <= 0.0:
        raise InputError(f"{source}: all points are the same")
    return voxel if voxel is not None else side / policy.default_voxels


def _edges(faces: npt.NDArray[np.int64], vertices: Floats) -> tuple[int, int]:
    """Return the numbers of open edges, and of edges at which the triangles disagree on the
    outside.

    Vertices at the same place count as one, because STL files repeat them.
    """
    _, same = np.unique(np.round(vertices, 9), axis=0, return_inverse=True)
    f = same.ravel()[faces]
    f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])]
    directed = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])
    turned = directed[:, 0] > directed[:, 1]
    undirected, index = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True)
    uses = np.bincount(index.ravel(), minlength=len(undirected))
    balance = np.bincount(index.ravel(), np.where(turned, 1, -1), minlength=len(undirected))
    return int((uses % 2 == 1).sum()), int(((uses % 2 == 0) & (balance != 0)).sum())


def _outward(faces: npt.NDArray[np.int64], vertices: Floats) -> tuple[npt.NDArray[np.int64], int]:
    """Return the faces with every connected part of positive volume, and the number of parts
    turned.

    So overlapping parts never cancel, and cavities are solid.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, same = np.unique(np.round(vertices, 9), axis=0, return_inverse=True)
    f = same.ravel()[faces]
    links = coo_array((np.ones(2 * len(f)), (np.r_[f[:, 0], f[:, 1]], np.r_[f[:, 1], f[:, 2]])))
    count = int(f.max()) + 1
    links.resize((count, count))
    _, part = connected_components(links, directed=False)
    part = part[f[:, 0]]
    a, b, c = (vertices[faces[:, k]] - vertices.mean(0) for k in range(3))
    volume = np.bincount(part, np.einsum("ij,ij->i", a, np.cross(b, c)))
    wrong = volume[part] < 0.0
    return np.where(wrong[:, None], faces[:, ::-1], faces), int((volume < 0.0).sum())


def _spacing(points: Floats) -> float:
    """Return a rough distance between neighbours, for the room around a cloud, metres."""
    from scipy.spatial import cKDTree

    samples = points[:: max(1, len(points) // 2000)]
    far, _ = cKDTree(points).query(samples, k=min(7, len(points)))
    return float(np.quantile(far[:, -1], 0.95))

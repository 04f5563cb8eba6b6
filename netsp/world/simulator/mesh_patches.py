"""Patches of a mesh: the sides of its faces that have water before them."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Bools, Floats, Ints
from netsp.world.scene.field import DistanceField
from netsp.world.scene.mesh_body import MeshBody
from netsp.world.scene.scene_policy import MeshPolicy


def facing_triangles(body: MeshBody) -> Floats:
    """Return the triangles (n, 3, 3) of a mesh that water may be before, normals into the water.

    A sheet has two, one for each side; fans that close holes have none.
    """
    solid = body.vertices[body.solid[: len(body.solid) - body.fans]]
    loose, sheet = body.vertices[body.loose], body.vertices[body.sheet]
    return np.concatenate([solid, loose, sheet, sheet[:, ::-1]])


def unit_normals(triangles: Floats) -> Floats:
    """Return the unit normals (n, 3) of triangles; 0 without area."""
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normals = np.cross(u, v)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(length > 0.0, length, 1.0))


def face_patches(
    field: DistanceField, body: MeshBody, triangles: Floats, size: float, seed: int
) -> tuple[Floats, Floats, Floats]:
    """Return centres (n, 3), normals (n, 3) and areas (n,) of the patches that triangles make.

    Each patch is seen or not by a random point of its area, so shares are right on average however
    narrow the strips are that other faces hide. Triangles inside the union of overlapping parts
    make no patch.

    Parameters
    ----------
    field : DistanceField
        Field of the scene.
    body : MeshBody
        Body of the mesh.
    triangles : ndarray, shape (m, 3, 3)
        Triangles of `facing_triangles`, small ones.
    size : float
        Edge of the cubes in which patches are merged, metres.
    seed : int
        Seed of the random points.
    """
    rng = np.random.default_rng(seed)
    u, v = np.sqrt(rng.random(len(triangles))), rng.random(len(triangles))
    weights = np.column_stack([1.0 - u, u * (1.0 - v), u * v])
    places, normals = np.einsum("nk,nkd->nd", weights, triangles), unit_normals(triangles)
    deep = np.flatnonzero(-field.distance(places) > _max_error(field))
    buried = deep[_are_buried(body, places[deep], normals[deep])]
    areas = triangle_areas(triangles)
    places, normals, areas = (np.delete(part, buried, axis=0) for part in (places, normals, areas))
    # the first of exponential times is that of each triangle as often as its share of the area
    ranks = rng.exponential(size=len(areas)) / areas
    chosen, _, summed = merged(places, normals, areas, size, ranks=ranks)
    return places[chosen], normals[chosen], summed


def mesh_patches(
    field: DistanceField, body: MeshBody, triangles: Floats, size: float, max_depth: float
) -> tuple[Floats, Floats, Floats]:
    """Return centres (n, 3), normals (n, 3) and areas (n,) of the patches that triangles make.

    Sheets and thin parts are thicker in the field than in the mesh, so their patches move along
    their normals to the surface. Triangles inside the union of overlapping parts make no patch.

    Parameters
    ----------
    field : DistanceField
        Field of the scene.
    body : MeshBody
        Body of the mesh.
    triangles : ndarray, shape (m, 3, 3)
        Triangles of `facing_triangles`, small ones.
    size : float
        Edge of the cubes in which patches are merged, metres.
    max_depth : float
        Largest depth of a face below the surface, metres. A deeper one is inside another solid.
    """
    middles, normals = triangles.mean(axis=1), unit_normals(triangles)
    depths = -field.distance(middles)
    places = middles + np.maximum(depths, 0.0)[:, None] * normals
    for _ in range(2):
        places = places - field.distance(places)[:, None] * field.gradient(places)
    moved = np.linalg.norm(places - middles, axis=1)
    good = np.flatnonzero((depths <= max_depth) & (moved <= 2.0 * max_depth))
    below = depths[good] > _max_error(field)
    areas = triangle_areas(triangles[good])
    first, _, summed = merged(places[good], normals[good], areas, size, below)
    chosen = good[first]
    deep = np.flatnonzero(below[first])
    buried = deep[_are_buried(body, middles[chosen[deep]], normals[chosen[deep]])]
    chosen, summed = np.delete(chosen, buried), np.delete(summed, buried)
    return places[chosen], normals[chosen], summed


_MAX_ERROR_VOXELS = 0.25
"""Tolerance of the distance at the surface of a mesh, voxels."""


def _max_error(field: DistanceField) -> float:
    """Return the tolerance of the distance at the surface of a mesh, metres."""
    return _MAX_ERROR_VOXELS * (field.voxel or 0.0)


def _are_buried(body: MeshBody, places: Floats, normals: Floats) -> Bools:
    """Return the mask (n,) of faces of a mesh whose points just before them are inside the mesh;
    places (n, 3) and normals (n, 3) are those of the faces."""
    diagonal = float(np.linalg.norm(np.ptp(body.vertices, axis=0)))
    return np.asarray(body.holds(places + MeshPolicy().side_share * diagonal * normals))


def triangle_areas(triangles: Floats) -> Floats:
    """Return the areas (n,) of triangles (n, 3, 3)."""
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return np.asarray(0.5 * np.linalg.norm(np.cross(u, v), axis=1))


def merged(
    centres: Floats,
    normals: Floats,
    areas: Floats,
    size: float,
    kinds: Bools | None = None,
    ranks: Floats | None = None,
) -> tuple[Ints, Ints, Floats]:
    """Merge patches in a cube of space that face the same of six directions.

    Parameters
    ----------
    centres, normals : ndarray, shape (n, 3)
        Centres, metres, and unit normals of the patches.
    areas : ndarray, shape (n,)
        Areas of the patches.
    size : float
        Edge of the cubes, metres.
    kinds : ndarray of bool, shape (n,), optional
        Kinds of patches that are not merged with one another.
    ranks : ndarray, shape (n,), optional
        Ranks of the patches. The lowest of each cube and direction is chosen; by default, the one
        in the middle.

    Returns
    -------
    chosen : ndarray, shape (k,)
        Number of the patch that is chosen in each cube and direction.
    which : ndarray, shape (n,)
        Number in `chosen` of the patch that stands for each.
    summed : ndarray, shape (k,)
        Sum of the areas.
    """
    count = len(areas)
    axis = np.abs(normals).argmax(axis=1)
    facing = 2 * axis + (normals[np.arange(count), axis] > 0.0)
    cells = np.floor(centres / size).astype(np.int64)
    key = np.column_stack([cells, facing if kinds is None else 6 * kinds + facing])
    _, which = np.unique(key, axis=0, return_inverse=True)
    which = which.ravel()
    if ranks is None:
        counts = np.bincount(which)
        middles = np.column_stack([np.bincount(which, c) for c in centres.T]) / counts[:, None]
        ranks = np.linalg.norm(centres - middles[which], axis=1)
    order = np.lexsort((ranks, which))
    chosen = order[np.r_[True, np.diff(which[order]) > 0]]
    return chosen, which, np.bincount(which, areas).astype(float)

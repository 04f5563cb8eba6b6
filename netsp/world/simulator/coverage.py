"""Coverage: the patches of a structure's surface that a camera has seen.

As Amer et al. 2025 (section VI-A) count it, a patch is seen if its centre is within the camera's
range, its surface faces the camera and it lies within the field of view. They ignore occlusion;
here both are counted, with and without occlusion.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Bools, ComparesArrays, Floats, Ints
from netsp.base.compiled.interpretation import interprets
from netsp.base.compiled.kernel import kernel
from netsp.base.errors import InputError
from netsp.base.validated import shown_names
from netsp.world.mission.equipment import Camera
from netsp.world.scene.field import DistanceField
from netsp.world.scene.mesh_body import MeshBody
from netsp.world.scene.sampling import Field, lowest_along, lowest_along_each
from netsp.world.scene.scene import Scene
from netsp.world.scene.scene_policy import GridPolicy
from netsp.world.scene.shapes import HalfSpace
from netsp.world.scene.surfaces import drawn_points, extent, surface_of
from netsp.world.simulator.environment_policy import CoveragePolicy
from netsp.world.simulator.face_sight import FaceSight
from netsp.world.simulator.mesh_patches import (
    face_patches,
    facing_triangles,
    mesh_patches,
    triangle_areas,
)
from netsp.world.simulator.outer_water import OuterWater, exposed


@dataclass(frozen=True, eq=False)
class Patches(ComparesArrays):
    """Patches of a surface.

    Attributes
    ----------
    centres, normals
        (n, 3), normals outward.
    areas
        (n,).
    sides
        Pairs (m, 2) of patches that are the two sides of a sheet. The sheet is seen if either side
        is; the area of the second side is 0.
    sight
        Sight past the faces of the scene's mesh; None where the field of the scene decides.
    """

    centres: Floats
    normals: Floats
    areas: Floats
    sides: Ints
    sight: FaceSight | None = dataclass_field(default=None, compare=False)


def surface_patches(
    scene: Scene,
    field: DistanceField,
    size: float,
    places: Floats,
    inspect: tuple[str, ...] | None = None,
    policy: CoveragePolicy = CoveragePolicy(),
    *,
    clearance: float = 0.0,
) -> Patches:
    """Return the surface of a scene as patches with sides of about `size`, metres.

    Parts inside another solid are left out. Of a mesh, the outsides of its solids and both sides of
    its sheets count (`netsp.world.scene.mesh_body`). Its faces are where the file has them, unless
    the scene states a thickness of sheets.

    Parameters
    ----------
    places : ndarray, shape (k, 3)
        Positions around which unbounded surfaces are cut off, metres.
    inspect : tuple of str, optional
        Names of the solids to be seen; by default all but half spaces and the sea floor.
    policy : CoveragePolicy
        Policy of patches.
    clearance : float
        Distance that the robot keeps from solids, metres. Sides of a mesh that it cannot face from
        where it gets to do not count.

    Raises
    ------
    InputError
        `inspect` names no solid, or no surface is left to be seen.
    """
    groups = list(_solid_groups(scene, field, size, places, inspect, policy))
    bodies = _mesh_bodies(scene, inspect)
    sight = None
    if scene.mesh is not None and scene.mesh.thickness is None:
        sight = FaceSight.build(scene, bodies["mesh"], field.voxel)
    for name, body in bodies.items():
        if name in (("mesh",) if inspect is None else inspect):  # the floor only by name
            faces = sight if name == "mesh" else None
            groups.append(_mesh_group(field, body, faces, size, places, policy, clearance))
    pairs = np.zeros((0, 2), dtype=np.int64)
    if scene.cloud is not None and (inspect is None or "cloud" in inspect):
        first = sum(len(group.areas) for group in groups)
        points = drawn_points(scene)
        sheet = field.distance(points) < -0.5 * (field.voxel or 0.0)
        for k, side in enumerate(cloud_sides(field, points)):
            chosen = sheet if k else np.ones(len(points), dtype=bool)
            areas = np.full(int(chosen.sum()), 1.0 - k)
            groups.append(_Group(side[chosen], field.gradient(side[chosen]), areas, field))
        pairs = np.flatnonzero(sheet)[:, None] + first
        pairs = np.hstack([pairs, first + len(points) + np.arange(len(pairs))[:, None]])
    bare = [g.field.distance(g.centres + 0.1 * size * g.normals) > 0.0 for g in groups]
    kept = np.concatenate([np.zeros(0, dtype=bool), *bare])
    if not any(g.areas[b].any() for g, b in zip(groups, bare, strict=True)):
        raise InputError(
            "scene: there is no surface to be seen (half spaces and sea floors do not count); "
            "expected solids, a mesh or a cloud, and if `inspect` names some, one with a surface"
        )
    place = np.cumsum(kept) - 1
    return Patches(
        np.vstack([g.centres for g in groups])[kept],
        np.vstack([g.normals for g in groups])[kept],
        np.concatenate([g.areas for g in groups])[kept],
        place[pairs[kept[pairs].all(axis=1)]],
        sight,
    )


class _Group(NamedTuple):
    """Centres (n, 3), normals (n, 3) and areas (n,) of patches, and the field of the solids that
    may cover them."""

    centres: Floats
    normals: Floats
    areas: Floats
    field: DistanceField


def _solid_groups(
    scene: Scene,
    field: DistanceField,
    size: float,
    places: Floats,
    inspect: tuple[str, ...] | None,
    policy: CoveragePolicy,
) -> Iterator[_Group]:
    """Yield the patches of each solid to be seen."""
    for vertices, faces, own_field in _surfaces(scene, field, places, inspect):
        triangles = divided_triangles(vertices[faces], size, policy.max_patches)
        areas = triangle_areas(triangles)
        good = areas > 0.5e-12
        middle = triangles[good].mean(axis=1)
        if len(middle):
            # facets of round solids lie a little inside
            outward = own_field.gradient(middle)
            centres = middle - own_field.distance(middle)[:, None] * outward
            yield _Group(centres, outward, areas[good], field)


def _surfaces(
    scene: Scene, field: DistanceField, places: Floats, inspect: tuple[str, ...] | None
) -> list[tuple[Floats, Ints, DistanceField]]:
    """Return vertices, faces and distance field of each solid to be seen."""
    low, high = extent(scene, places)
    solids = scene.all_solids()
    named = [n for n in ("mesh", "cloud", "floor") if getattr(scene, n) is not None]
    named += [s.name for s in solids if s.name]
    for name in inspect or ():
        if name not in named:
            raise InputError(
                f"inspect: expected names of solids, got {name!r}; there are {shown_names(named)}"
            )
    return [
        (*surface_of(s.shape, low, high), Scene(solids=(s,)).field())
        for s in solids
        if not isinstance(s.shape, HalfSpace) and (inspect is None or s.name in inspect)
    ]


def _mesh_bodies(scene: Scene, inspect: tuple[str, ...] | None) -> dict[str, MeshBody]:
    """Return the bodies of the mesh, which may block sight, and of a sea floor to be seen."""
    if scene.mesh is None and not (scene.floor is not None and "floor" in (inspect or ())):
        return {}
    return scene.mesh_bodies()


def _mesh_group(
    field: DistanceField,
    body: MeshBody,
    sight: FaceSight | None,
    size: float,
    places: Floats,
    policy: CoveragePolicy,
    clearance: float,
) -> _Group:
    """Return the patches of a mesh: of its faces as the file has them if there is sight past them,
    else of its surface in the field."""
    triangles = divided_triangles(facing_triangles(body), size, policy.max_patches)
    triangles = triangles[triangle_areas(triangles) > 0.5e-12]
    voxel = field.voxel or 0.0
    merged_size = policy.mesh_patch_ratio * size
    if sight is not None:
        c, n, a = face_patches(field, body, triangles, merged_size, policy.sample_seed)
        off, around = sight.off, sight.others
    else:
        thickness = body.thickness or 2.0 * GridPolicy().sheet_voxels * voxel
        c, n, a = mesh_patches(field, body, triangles, merged_size, 0.5 * thickness + voxel)
        off, around = 0.5 * voxel, field
    if len(c):
        water = OuterWater.about(field, body, clearance, places, policy)
        shown = exposed(body, water, c, n, clearance, off, policy)
        c, n, a = c[shown], n[shown], a[shown]
    return _Group(c, n, a, around)


def cloud_sides(field: DistanceField, points: Floats) -> tuple[Floats, Floats]:
    """Return points (n, 3) of a cloud moved to the surface, and to its other side.

    The points of a sheet lie in its middle.
    """
    normals = field.gradient(points)
    out = []
    for sign in (1.0, -1.0):
        # start beside the middle, where the nearer side is clear
        side = points + sign * 0.5 * (field.voxel or 0.0) * normals
        for _ in range(3):
            side = side - field.distance(side)[:, None] * field.gradient(side)
        out.append(side)
    return out[0], out[1]


def divided_triangles(triangles: Floats, size: float, max_patches: int) -> Floats:
    """Return triangles (n, 3, 3) halved across their longest sides until none is longer than
    `size`."""
    done = []
    while len(triangles):
        sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        small = sides.max(axis=1) <= size
        done.append(triangles[small])
        large = triangles[~small]
        if len(large) > max_patches:
            raise InputError(
                f"camera.patch: {size:g} makes more than {max_patches} patches; expected larger "
                "ones"
            )
        k = sides[~small].argmax(axis=1)
        row = np.arange(len(large))
        a, b, c = large[row, k], large[row, (k + 1) % 3], large[row, (k + 2) % 3]
        m = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, m, c], axis=1), np.stack([m, b, c], axis=1)])
    return np.concatenate(done) if done else np.zeros((0, 3, 3))


class PatchArrays(NamedTuple):
    """Patches for the kernel: centres and normals (n, 3), and shares of the area (n,)."""

    centres: Floats
    normals: Floats
    shares: Floats


class CameraView(NamedTuple):
    """View of a camera for the kernel.

    Attributes
    ----------
    eye
        (3,) position, metres.
    yaw, pitch
        Direction, rad.
    half
        Tangent of half the field of view, which is a square pyramid.
    reach
        Range, metres.
    off
        Distance from a patch at which sight of it is tested, metres.
    """

    eye: Floats
    yaw: float
    pitch: float
    half: float
    reach: float
    off: float


class Coverage:
    """Coverage of a structure so far.

    Attributes
    ----------
    seen, seen_through
        Masks (n,) of the patches seen, with and without occlusion.
    share, share_through
        Shares of the area; the second is the paper's.
    """

    def __init__(self, patches: Patches, field: DistanceField, camera: Camera) -> None:
        self.patches, self.field, self.camera = patches, field, camera
        self.seen = np.zeros(len(patches.areas), dtype=bool)
        self.seen_through = self.seen.copy()
        self.share = self.share_through = 0.0
        self._shares = patches.areas / patches.areas.sum()
        self._latest: tuple[Floats, Floats] | None = None

    def look(self, eye: Floats, yaw: float) -> None:
        """Mark the patches that the camera sees from a place (3,) at a yaw, rad.

        The camera tilts towards the nearest patch as far as it can.
        """
        near = self._nearest(eye)
        max_tilt = math.radians(self.camera.tilt)
        pitch = min(max(math.atan2(near[2], math.hypot(near[0], near[1])), -max_tilt), max_tilt)
        half = math.tan(math.radians(0.5 * self.camera.field_of_view))
        sight = self.patches.sight
        field = self.field if sight is None else sight.others
        before = self.seen.copy()
        open_, through = mark_visible(
            field.arrays,
            PatchArrays(self.patches.centres, self.patches.normals, self._shares),
            self.seen,
            self.seen_through,
            CameraView(eye, yaw, pitch, half, self.camera.range, 0.1 * self.camera.patch),
        )
        self.share_through += through
        if sight is None:
            self.share += open_
        else:
            new = np.flatnonzero(self.seen & ~before)
            places, normals = self.patches.centres[new], self.patches.normals[new]
            is_open = sight.is_open(eye, places, normals)
            self.seen[new[~is_open]] = False
            self.share += _in_order(self._shares[new[is_open]])
        if len(self.patches.sides):
            a, b = self.patches.sides.T
            for seen in (self.seen, self.seen_through):
                seen[a] = seen[b] = seen[a] | seen[b]
            self.share = float(self._shares @ self.seen)
            self.share_through = float(self._shares @ self.seen_through)

    def heading(self, eye: Floats, before: float) -> float:
        """Return the horizontal direction of the nearest patch, rad; `before` if the patch is
        straight above or below."""
        near = self._nearest(eye)
        if math.hypot(near[0], near[1]) < 0.2 * float(np.linalg.norm(near)):
            return before
        return math.atan2(near[1], near[0])

    def _nearest(self, eye: Floats) -> Floats:
        """Return the vector from a place to the nearest patch."""
        # cached, because `heading` and `look` use the same place in turn
        if self._latest is None or not np.array_equal(self._latest[0], eye):
            at = nearest_point(self.patches.centres, eye)
            self._latest = (np.array(eye), np.asarray(self.patches.centres[at] - eye))
        return self._latest[1]


@kernel
def nearest_point(centres: Floats, eye: Floats) -> int:
    """Return the index of the nearest of some points (n, 3)."""
    best, at = math.inf, 0
    for i in range(len(centres)):
        d = (
            (centres[i, 0] - eye[0]) ** 2
            + (centres[i, 1] - eye[1]) ** 2
            + (centres[i, 2] - eye[2]) ** 2
        )
        if d < best:
            best, at = d, i
    return at


@interprets(nearest_point)
def _nearest_in_numpy(centres: Floats, eye: Floats) -> int:
    """Vectorise `nearest_point` over all points."""
    x, y, z = (centres[:, axis] - eye[axis] for axis in range(3))
    return int(np.argmin(x * x + y * y + z * z)) if len(centres) else 0


@kernel
def mark_visible(
    field: Field, surface: PatchArrays, seen: Bools, seen_through: Bools, view: CameraView
) -> tuple[float, float]:
    """Mark the patches in view; return the new shares, with and without occlusion."""
    centres, normals, shares = surface.centres, surface.normals, surface.shares
    eye, yaw, pitch, half = view.eye, view.yaw, view.pitch, view.half
    reach, off = view.reach, view.off
    new, new_through = 0.0, 0.0
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    for i in range(len(centres)):
        if seen[i]:
            continue
        x, y, z = centres[i, 0] - eye[0], centres[i, 1] - eye[1], centres[i, 2] - eye[2]
        if x * x + y * y + z * z > reach * reach:
            continue
        if x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2] >= 0.0:
            continue
        ahead = cp * (cy * x + sy * y) + sp * z
        left = cy * y - sy * x
        up = cp * z - sp * (cy * x + sy * y)
        if ahead <= 0.0 or abs(left) > half * ahead or abs(up) > half * ahead:
            continue
        if not seen_through[i]:
            seen_through[i] = True
            new_through += shares[i]
        tx = centres[i, 0] + off * normals[i, 0]
        ty = centres[i, 1] + off * normals[i, 1]
        tz = centres[i, 2] + off * normals[i, 2]
        low, _ = lowest_along(field, eye[0], eye[1], eye[2], tx, ty, tz, 0.5 * off)
        if low > -0.5 * off:
            seen[i] = True
            new += shares[i]
    return new, new_through


@interprets(mark_visible)
def _mark_in_numpy(
    field: Field, surface: PatchArrays, seen: Bools, seen_through: Bools, view: CameraView
) -> tuple[float, float]:
    """Vectorise `mark_visible` over all patches."""
    at = np.flatnonzero(~seen)
    x, y, z = (surface.centres[at, axis] - view.eye[axis] for axis in range(3))
    nx, ny, nz = (surface.normals[at, axis] for axis in range(3))
    near = ~(x * x + y * y + z * z > view.reach * view.reach)
    near &= ~(x * nx + y * ny + z * nz >= 0.0)
    at, x, y, z = at[near], x[near], y[near], z[near]
    cy, sy = math.cos(view.yaw), math.sin(view.yaw)
    cp, sp = math.cos(view.pitch), math.sin(view.pitch)
    ahead = cp * (cy * x + sy * y) + sp * z
    left = cy * y - sy * x
    up = cp * z - sp * (cy * x + sy * y)
    wide = view.half * ahead
    at = at[~((ahead <= 0.0) | (abs(left) > wide) | (abs(up) > wide))]
    fresh = at[~seen_through[at]]
    seen_through[fresh] = True
    targets = surface.centres[at] + view.off * surface.normals[at]
    eyes = np.broadcast_to(view.eye, targets.shape)
    lowest = lowest_along_each(field, eyes, targets, 0.5 * view.off)
    open_ = at[lowest > -0.5 * view.off]
    seen[open_] = True
    return _in_order(surface.shares[open_]), _in_order(surface.shares[fresh])


def _in_order(shares: Floats) -> float:
    """Return the sum of shares, added in order as `mark_visible` does; np.sum adds pairwise."""
    return float(np.add.accumulate(shares)[-1]) if len(shares) else 0.0

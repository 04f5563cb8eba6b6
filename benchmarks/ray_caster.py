"""An independent count of what a camera sees of a mesh: rays of Embree against its triangles.

It shares no code with netsp, and takes from it neither what is solid nor which sides count. This
rule decides which sides count. It was written down as a whole before any result was compared with
it; its first half, with the same numbers, was in use before, beside twelve meshes:

    Points are spread over the triangles by area, and each has two sides. A side counts if it is
    outside and can be seen.

    - Outside: of random paths that start at the side and are reflected by the mesh at random (by
      the cosine of the angle to the normal), at least half leave the mesh within six reflections.
      Light fills a vessel with a wide mouth, but not the inside of a scan with small holes.
    - Can be seen: at least one of random rays from the side, within the greatest angle to the
      normal at which the camera looks, meets free water within the camera's range and before it
      meets the mesh. Water is free where a ball with the clearance as radius fits between the
      triangles and gets there from beyond the mesh.

A side that counts is seen if a look has it within range, field of view and angle, and the ray from
the side to the camera meets no triangle.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

SAMPLES, WALKS, BOUNCES = 6_000, 32, 6
"""Points on the mesh; paths from each side; reflections of a path."""

LIT = 0.5
"""Share of the paths that leave the mesh from a side that counts as outside."""

SIGHTS, SIGHTS_PER_ROUND = 256, 16
"""Random rays from each side that look for free water; those cast at a time."""

CELLS_PER_CLEARANCE = 6
"""Fineness of the grid of free water."""

GRID_SAMPLES = 200_000
"""Points on the mesh from which the distances of the grid are taken."""


class RayCaster:
    """Samples on triangles (m, 3, 3), and what has been seen of their outsides.

    camera : of the robot. clearance : distance that the robot keeps, metres. incidence : greatest
    angle to the normal at which it looks, degrees.

    places, normals : (n, 3) of the sides that count. seen : (n,) mask.
    """

    def __init__(
        self, triangles: Any, camera: Any, clearance: float, incidence: float, seed: int = 0
    ) -> None:
        try:
            from embreex import rtcore_scene
            from embreex.mesh_construction import TriangleMesh
        except ImportError:
            raise SystemExit(
                "the ray caster needs embreex; expected it installed: pip install netsp[bench]"
            ) from None
        self.size = float(np.linalg.norm(np.ptp(triangles.reshape(-1, 3), axis=0)))
        cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        areas = 0.5 * np.linalg.norm(cross, axis=1)
        self.face_normals = cross / np.maximum(2.0 * areas, 1e-300)[:, None]
        self.scene = rtcore_scene.EmbreeScene()
        TriangleMesh(self.scene, np.ascontiguousarray(triangles, dtype=np.float32))
        self.rng = np.random.default_rng(seed)
        at, face = self._spread(triangles, areas, SAMPLES)
        places = np.vstack([at, at])
        normals = np.vstack([self.face_normals[face], -self.face_normals[face]])
        counts = self.escaping(places, normals) >= LIT
        water = FreeWater(self._spread(triangles, areas, GRID_SAMPLES)[0], clearance)
        outside = np.flatnonzero(counts)
        counts[outside] = self.visible(
            places[outside], normals[outside], water, camera.range, incidence
        )
        self.places, self.normals = places[counts], normals[counts]
        self.area = float(areas.sum() / SAMPLES * counts.sum())
        self.seen = np.zeros(len(self.places), dtype=bool)

    def _spread(self, triangles: Any, areas: Any, count: int) -> tuple[Any, Any]:
        """Return random points on triangles, by area, and the triangle of each."""
        face = self.rng.choice(len(triangles), count, p=areas / areas.sum())
        u, v = np.sqrt(self.rng.random(count)), self.rng.random(count)
        weights = np.column_stack([1.0 - u, u * (1.0 - v), u * v])
        return np.einsum("nk,nkd->nd", weights, triangles[face]), face

    def lengths(self, starts: Any, ahead: Any) -> tuple[Any, Any]:
        """Return the distances to the first hit, infinite without one, and the faces hit."""
        found = self.scene.run(
            np.ascontiguousarray(starts, dtype=np.float32),
            np.ascontiguousarray(ahead, dtype=np.float32),
            output=1,
        )
        far = np.where(found["primID"] < 0, np.inf, found["tfar"])
        return far, found["primID"]

    def escaping(self, places: Any, normals: Any) -> Any:
        """Return the share of random paths from each side that leave the mesh."""
        owner = np.repeat(np.arange(len(places)), WALKS)
        at, normal = places[owner], normals[owner]
        out = np.zeros(len(places))
        for _ in range(BOUNCES + 1):
            ahead = self.rng.normal(size=at.shape)
            ahead /= np.linalg.norm(ahead, axis=1)[:, None]
            ahead += normal * (1.0 + 1e-6)  # by the cosine of the angle to the normal
            ahead /= np.linalg.norm(ahead, axis=1)[:, None]
            start = at + 2e-5 * self.size * normal
            far, face = self.lengths(start, ahead)
            gone = np.isinf(far)
            out += np.bincount(owner[gone], minlength=len(places))
            owner, face = owner[~gone], face[~gone]
            at = start[~gone] + far[~gone, None] * ahead[~gone]
            normal = self.face_normals[face]
            normal = np.where(((normal * ahead[~gone]).sum(1) > 0.0)[:, None], -normal, normal)
        return out / WALKS

    def visible(
        self, places: Any, normals: Any, water: FreeWater, reach: float, incidence: float
    ) -> Any:
        """Return which sides see free water within reach."""
        out = np.zeros(len(places), dtype=bool)
        steps = np.arange(water.size, reach + 0.5 * water.size, water.size)
        low = math.cos(math.radians(incidence))
        for _ in range(SIGHTS // SIGHTS_PER_ROUND):
            owner = np.repeat(np.flatnonzero(~out), SIGHTS_PER_ROUND)
            if not len(owner):
                break
            normal = normals[owner]
            level = np.cross(normal, self.rng.normal(size=normal.shape))
            level /= np.linalg.norm(level, axis=1)[:, None]
            up = self.rng.uniform(low, 1.0, len(owner))[:, None]  # even over the cone
            ahead = up * normal + np.sqrt(1.0 - up * up) * level
            start = places[owner] + 2e-5 * self.size * normal
            far, _ = self.lengths(start, ahead)
            for step in steps:
                left = (step < far) & ~out[owner]
                owner, start, ahead, far = owner[left], start[left], ahead[left], far[left]
                if not len(owner):
                    break
                out[owner[water.is_free(start + step * ahead)]] = True
        return out

    def look(self, eye: Any, yaw: float, camera: Any, incidence: float = 90.0) -> None:
        """Mark what a camera sees from a place at a yaw; it tilts towards the nearest sample.

        incidence : largest angle to the normal, degrees.
        """
        to = self.places - eye
        far = np.linalg.norm(to, axis=1)
        near = to[far.argmin()]
        most = math.radians(camera.tilt)
        pitch = min(max(math.atan2(near[2], math.hypot(near[0], near[1])), -most), most)
        half = math.tan(math.radians(0.5 * camera.field_of_view))
        cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
        level = cy * to[:, 0] + sy * to[:, 1]
        ahead, left = cp * level + sp * to[:, 2], cy * to[:, 1] - sy * to[:, 0]
        up = cp * to[:, 2] - sp * level
        facing = -(to * self.normals).sum(axis=1)
        chosen = ~self.seen & (far <= camera.range) & (facing > 0.0) & (ahead > 0.0)
        chosen &= (np.abs(left) <= half * ahead) & (np.abs(up) <= half * ahead)
        chosen &= facing >= math.cos(math.radians(incidence)) * far
        at = np.flatnonzero(chosen)
        if not len(at):
            return
        start = self.places[at] + 2e-5 * self.size * self.normals[at]
        ray = eye - start
        length = np.linalg.norm(ray, axis=1)
        hit, _ = self.lengths(start, ray / length[:, None])
        self.seen[at[hit >= length * (1.0 - 1e-6)]] = True

    @property
    def share(self) -> float:
        """Return the share of the sides that count that has been seen."""
        return float(self.seen.mean()) if len(self.seen) else 0.0


class FreeWater:
    """Grid of the places where a ball fits between points of a mesh, and gets to from beyond it."""

    def __init__(self, points: Any, clearance: float) -> None:
        from scipy.ndimage import label
        from scipy.spatial import cKDTree

        self.size = clearance / CELLS_PER_CLEARANCE
        room = clearance + 2.0 * self.size
        self.low = points.min(axis=0) - room
        counts = np.ceil((np.ptp(points, axis=0) + 2.0 * room) / self.size).astype(int) + 1
        axes = [self.low[k] + self.size * np.arange(counts[k]) for k in range(3)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        far, _ = cKDTree(points).query(grid.reshape(-1, 3), distance_upper_bound=clearance)
        parts, _ = label(np.isinf(far).reshape(counts))
        self.free = parts == parts[0, 0, 0]  # the corner is beyond the mesh

    def is_free(self, places: Any) -> Any:
        """Return whether each place is in free water; all places beyond the grid are."""
        at = np.rint((places - self.low) / self.size).astype(int)
        inside = ((at >= 0) & (at < self.free.shape)).all(axis=1)
        out = np.ones(len(places), dtype=bool)
        out[inside] = self.free[tuple(at[inside].T)]
        return out

"""An independent count of what a camera sees of a mesh: rays of Embree against its triangles.

It shares no code with netsp: samples on the triangles, sides that light from outside gets to, and
one ray for each sample and look.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

SAMPLES, WALKS, BOUNCES = 6_000, 32, 6
"""Points on the mesh; paths from each side; reflections of a path."""

LIT = 0.5
"""Share of the paths that leave the mesh from a side that counts as outside. From the inside of a
scan few do, through its holes."""


class RayCaster:
    """Samples on triangles (m, 3, 3), and what has been seen of their outsides.

    places, normals : (n, 3) of the sides that count. seen : (n,) mask.
    """

    def __init__(self, triangles: Any, seed: int = 0) -> None:
        try:
            from embreex import rtcore_scene
            from embreex.mesh_construction import TriangleMesh
        except ImportError:
            raise SystemExit("the ray caster needs embreex: pip install embreex") from None
        self.size = float(np.linalg.norm(np.ptp(triangles.reshape(-1, 3), axis=0)))
        cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        areas = 0.5 * np.linalg.norm(cross, axis=1)
        self.face_normals = cross / np.maximum(2.0 * areas, 1e-300)[:, None]
        self.scene = rtcore_scene.EmbreeScene()
        TriangleMesh(self.scene, np.ascontiguousarray(triangles, dtype=np.float32))
        self.rng = np.random.default_rng(seed)
        face = self.rng.choice(len(triangles), SAMPLES, p=areas / areas.sum())
        u, v = np.sqrt(self.rng.random(SAMPLES)), self.rng.random(SAMPLES)
        weights = np.column_stack([1.0 - u, u * (1.0 - v), u * v])
        at = np.einsum("nk,nkd->nd", weights, triangles[face])
        places = np.vstack([at, at])
        normals = np.vstack([self.face_normals[face], -self.face_normals[face]])
        outside = self.escaping(places, normals) >= LIT
        area = areas.sum() / SAMPLES
        self.places, self.normals = places[outside], normals[outside]
        self.area = float(area * outside.sum())
        self.seen = np.zeros(len(self.places), dtype=bool)

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
        """Return the share of the outsides that has been seen."""
        return float(self.seen.mean()) if len(self.seen) else 0.0

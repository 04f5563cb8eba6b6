"""Water that a robot gets to, and the patches of a mesh that it may see from there.

Slits between parts and the insides of shells have surfaces, too, but no robot ever faces them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.world.scene.face_tree import FaceTree
from netsp.world.scene.field import DistanceField
from netsp.world.scene.mesh_body import MeshBody, sphere_points
from netsp.world.simulator.environment_policy import CoveragePolicy


@dataclass(frozen=True)
class OuterWater:
    """Cells of water that a robot gets to.

    Parameters
    ----------
    low : ndarray, shape (3,)
        Point of the first cell, metres.
    size : float
        Distance between the points of cells, metres.
    is_outer : ndarray of bool, shape (nx, ny, nz)
        Whether the robot gets to each cell.
    """

    low: Floats
    size: float
    is_outer: Bools

    @classmethod
    def about(
        cls,
        field: DistanceField,
        body: MeshBody,
        clearance: float,
        places: Floats,
        policy: CoveragePolicy = CoveragePolicy(),
    ) -> OuterWater:
        """Return the water about a mesh that a robot gets to from afar, or from its places.

        Parameters
        ----------
        field : DistanceField
            Field of the scene.
        body : MeshBody
            Body of the mesh.
        clearance : float
            Distance that the robot keeps from solids, metres.
        places : ndarray, shape (n, 3)
            Places where the robot is, metres.
        policy : CoveragePolicy
            Fineness of the cells.
        """
        from scipy.ndimage import label

        low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
        size = max(0.5 * clearance, float((high - low).max()) / policy.max_water_cells)
        room = 2.0 * (clearance + size)
        counts = np.ceil((high - low + 2.0 * room) / size).astype(int) + 1
        low = low - room
        axes = [low[k] + size * np.arange(counts[k]) for k in range(3)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        # between two cells, a path may be nearer to solids by half a cell
        parts, count = label(field.distance(points) >= max(clearance - 0.5 * size, 0.0))
        is_outer = np.zeros(count + 1, dtype=bool)
        for axis in range(3):
            for end in (0, -1):
                is_outer[np.unique(parts.take(end, axis))] = True
        at = np.rint((places - low) / size).astype(int)
        inside = ((at >= 0) & (at < counts)).all(axis=1)
        is_outer[parts[tuple(at[inside].T)]] = True
        is_outer[0] = False
        return cls(low, size, np.asarray(is_outer[parts]))

    def holds(self, places: Floats) -> Bools:
        """Return whether each place (n, 3) is in this water; all places beyond the cells are."""
        at = np.rint((places - self.low) / self.size).astype(int)
        inside = ((at >= 0) & (at < self.is_outer.shape)).all(axis=1)
        out = np.ones(len(places), dtype=bool)
        out[inside] = self.is_outer[tuple(at[inside].T)]
        return out


def exposed(
    body: MeshBody,
    water: OuterWater,
    centres: Floats,
    normals: Floats,
    clearance: float,
    off: float,
    policy: CoveragePolicy = CoveragePolicy(),
) -> Bools:
    """Return which patches (n,) a robot may face, however far its camera sees.

    A ray from such a patch meets water that the robot gets to before it meets the mesh.

    Parameters
    ----------
    body : MeshBody
        Body of the mesh.
    water : OuterWater
        Water that the robot gets to.
    centres, normals : ndarray, shape (n, 3)
        Centres, metres, and unit normals of the patches.
    clearance : float
        Distance that the robot keeps from solids, metres.
    off : float
        Distance from a patch at which its rays begin, metres: the error of its place.
    policy : CoveragePolicy
        Rays from each patch.
    """
    tree = FaceTree.build(body.triangles)
    starts = centres + off * normals
    first = max(clearance, water.size)
    steps = first * policy.sight_growth ** np.arange(policy.sight_steps)
    # directions from the middle of a ball that touches the patch lean up to a right angle; a
    # longer normal keeps them within the maximum angle
    lean = 1.0 / math.sin(math.radians(policy.max_sight_deg))
    out = np.zeros(len(centres), dtype=bool)
    for ahead in np.vstack([np.zeros((1, 3)), sphere_points(policy.sight_rays)]):
        left = np.flatnonzero(~out)
        if not len(left):
            break
        directions = ahead + lean * normals[left]
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        lengths = tree.ray_lengths(starts[left], directions)
        for far in steps:
            reached = np.flatnonzero(far < lengths)
            places = starts[left[reached]] + far * directions[reached]
            out[left[reached]] |= water.holds(places)
    return out

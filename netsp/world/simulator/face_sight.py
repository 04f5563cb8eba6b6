"""Sight past the faces of a mesh.

In a distance field, sheets and thin parts of a mesh are as thick as voxels need, and hide what lies
behind their rims and beside their seams. A camera sees past the faces as they are in the file.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Bools, Floats
from netsp.world.scene.face_tree import FaceTree
from netsp.world.scene.field import DistanceField
from netsp.world.scene.mesh_body import MeshBody
from netsp.world.scene.scene import Scene
from netsp.world.scene.scene_policy import MeshPolicy


@dataclass(frozen=True, eq=False)
class FaceSight:
    """Sight in a scene with a mesh.

    Parameters
    ----------
    tree : FaceTree
        Faces of the mesh, with the fans that close its holes.
    others : DistanceField
        Field of the scene without the mesh.
    off : float
        Distance from a face at which lines of sight end, metres: more than the error of rounding.
    """

    tree: FaceTree
    others: DistanceField
    off: float

    @classmethod
    def build(cls, scene: Scene, body: MeshBody, voxel: float | None) -> FaceSight:
        """Return the sight past the mesh of a scene.

        Parameters
        ----------
        scene : Scene
            Scene with the mesh.
        body : MeshBody
            Body of the mesh.
        voxel : float, optional
            Edge of the voxels of sea floor and cloud, metres.
        """
        rest = scene.model_copy(update={"mesh": None})
        has_voxels = rest.floor is not None or rest.cloud is not None
        grid = rest.voxels(voxel=voxel) if has_voxels else None
        diagonal = float(np.linalg.norm(np.ptp(body.vertices, axis=0)))
        others = rest.field_with(rest.all_solids(), grid)
        return cls(FaceTree.build(body.triangles), others, MeshPolicy().side_share * diagonal)

    def is_open(self, eye: Floats, places: Floats, normals: Floats) -> Bools:
        """Return whether no face lies between a point (3,) and places (n, 3) with normals."""
        return ~self.tree.blocks(eye, places + self.off * normals)

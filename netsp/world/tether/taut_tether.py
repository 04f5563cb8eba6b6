"""Public tethers: immutable states with nodes, length and contacts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import ComparesArrays, Floats
from netsp.world.tether.strand import EXTRA, NX, NZ, PART, REACH0, REACH1, USED, WIDTH


@dataclass(frozen=True)
class Contact:
    """Stretch of a tether that rests on one part of the scene.

    Parameters
    ----------
    first, last : int
        First and last node of the stretch.
    part : int
        Index of the solid in the scene, -1 for voxels.
    length : float
        Length of the tether between the two nodes along the surface, metres.
    """

    first: int
    last: int
    part: int
    length: float


@dataclass(frozen=True, eq=False)
class Tether(ComparesArrays):
    """Tether at rest, from its anchor to the robot.

    Parameters
    ----------
    strand : ndarray, shape (n, 19)
        Rows of the nodes (`netsp.world.tether.strand`). They are never changed in place, so a state
        can be kept, compared and continued from.
    length : float
        Length along the surfaces on which the tether rests, metres.
    residual : float
        Motion of a node in the last round of pulling, metres.

    Examples
    --------
    >>> from netsp.world import GeodesicTether, Scene
    >>> scene = Scene(solids=[{"capsule": {"a": [0, 0, -5], "b": [0, 0, 5], "radius": 0.5}}])
    >>> tether = GeodesicTether(scene.field()).start(anchor=(-2, 1, 0), robot=(2, 1, 0))
    >>> tether.robot, round(tether.length, 2)
    (array([2., 1., 0.]), 4.0)
    """

    strand: Floats
    length: float
    residual: float = 0.0

    @property
    def nodes(self) -> Floats:
        """Nodes (n, 3) from the anchor to the robot, metres.

        In the geodesic model, all nodes between them rest on surfaces.
        """
        return self.strand[:, :3]

    @property
    def anchor(self) -> Floats:
        """Position of the anchor (3,)."""
        return self.strand[0, :3]

    @property
    def robot(self) -> Floats:
        """Position of the robot (3,)."""
        return self.strand[-1, :3]

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """Contacts with parts of the scene, from the anchor on."""
        resting = np.any(self.strand[:, NX : NZ + 1] != 0.0, axis=1)
        resting[[0, -1]] = False
        edges = np.linalg.norm(np.diff(self.nodes, axis=0), axis=1) + self.strand[:-1, EXTRA]
        found: list[Contact] = []
        for i in np.flatnonzero(resting):
            part = int(self.strand[i, PART])
            last = found[-1] if found else None
            # the edge between lies on the surface where it is bent over it or is short
            if (
                last is not None
                and last.last == i - 1
                and last.part == part
                and (self.strand[i - 1, EXTRA] > 0.0 or part >= 0)
            ):
                found[-1] = Contact(last.first, int(i), part, last.length + float(edges[i - 1]))
            else:
                found.append(Contact(int(i), int(i), part, 0.0))
        return tuple(found)


def new_strand(nodes: npt.ArrayLike) -> Floats:
    """Return a strand through nodes (n, 3) of which only the positions are known."""
    points = np.asarray(nodes, dtype=float).reshape(-1, 3)
    strand = np.zeros((len(points), WIDTH))
    strand[:, :3] = points
    strand[:, PART] = -1.0
    strand[:, [REACH0, REACH1]] = 1.0
    strand[:, USED] = np.inf
    return strand

"""The tether as its users see it: an immutable state with nodes, length and contacts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import ComparesArrays, Floats
from netsp.world.tether.strand import EXTRA, NX, NZ, PART, REACH0, REACH1, USED, WIDTH


@dataclass(frozen=True)
class Contact:
    """A stretch of the tether that rests on one part of the scene.

    Parameters
    ----------
    first : int
        First node of the tether.
    last : int
        Last node, included.
    part : int
        Index of the solid in the scene, -1 for voxels.
    length : float
        Metres of tether between the two nodes, along the surface.
    """

    first: int
    last: int
    part: int
    length: float


@dataclass(frozen=True, eq=False)
class Tether(ComparesArrays):
    """A tether at rest, from its anchor to the robot.

    Parameters
    ----------
    strand : ndarray, shape (n, 19)
        What the model keeps of each node (`netsp.world.tether.strand`); never changed in place, so
        a state can be kept, compared and continued from.
    length : float
        Metres, along the surface where the tether rests on it.
    residual : float
        Metres by which a node still moved when the model stopped.
    """

    strand: Floats
    length: float
    residual: float = 0.0

    @property
    def nodes(self) -> Floats:
        """(n, 3) from the anchor to the robot; all between rest on something (geodesic model)."""
        return self.strand[:, :3]

    @property
    def anchor(self) -> Floats:
        """(3,) where the tether starts."""
        return self.strand[0, :3]

    @property
    def robot(self) -> Floats:
        """(3,) where it ends."""
        return self.strand[-1, :3]

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """Which stretches touch which parts of the scene, from the anchor on."""
        rests = np.any(self.strand[:, NX : NZ + 1] != 0.0, axis=1)
        rests[[0, -1]] = False
        edges = np.linalg.norm(np.diff(self.nodes, axis=0), axis=1) + self.strand[:-1, EXTRA]
        found: list[Contact] = []
        for i in np.flatnonzero(rests):
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


def strand_of(nodes: npt.ArrayLike) -> Floats:
    """A strand through given nodes about which nothing else is known."""
    points = np.asarray(nodes, dtype=float).reshape(-1, 3)
    strand = np.zeros((len(points), WIDTH))
    strand[:, :3] = points
    strand[:, PART] = -1.0
    strand[:, [REACH0, REACH1]] = 1.0
    strand[:, USED] = np.inf
    return strand

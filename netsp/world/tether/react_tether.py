"""`react`: Algorithm 1 of Amer et al. 2025, so that the paper can be compared with.

Where the paper leaves room:

- Listing and text differ. The listing stops at the first node that is out of sight (``break``); the
  text lets j go on to the preceding node "until a collision-free line of sight is found". Both are
  here (`reading`); the text's jumps over solids and so unwinds a tether from a pipe.
- ``checkLineOfSight(M, P_tether)`` is given no pair of nodes: taken as (i, j).
- ``pullNode(P[j], end, delta)`` is listed for nodes in collision, and told of "each node" in the
  text: here each node is moved by up to delta towards the tether's end, when its two edges stay
  free and the tether gets shorter.
- "Until convergence": until a pass shortens the tether by less than 1e-5 m, as in the authors'
  public code, which also uses delta = 0.5 m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.compiled.dynamic_array import write_rows
from netsp.base.compiled.kernel import kernel
from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.world.scene.field import DistanceField
from netsp.world.scene.sampling import Field, distance
from netsp.world.tether.strand import see
from netsp.world.tether.taut_tether import Tether, strand_of

READINGS = ("listing", "text")


@dataclass(frozen=True)
class ReactTether:
    """The tether model of the REACT paper; the same methods as `GeodesicTether`.

    Source: Amer et al. 2025, section III.

    Parameters
    ----------
    field : DistanceField
        The scene.
    delta : float
        Metres between nodes.
    reading : str
        Which reading of the paper: its `listing` or its `text`.
    clearance : float
        Metres; sight passes no solid closer than this.
    tolerance : float
        Metres; the passes end when a node moves less.
    passes : int
        At most so many in one update.
    """

    field: DistanceField
    delta: float = 0.1
    reading: str = "listing"
    clearance: float = 0.0
    tolerance: float = 1e-5
    passes: int = 50

    name = "react"

    def __post_init__(self) -> None:
        if not 0.0 < self.delta < np.inf:
            raise InputError(f"delta: expected a positive length, got {self.delta!r}")
        if self.reading not in READINGS:
            raise InputError(f"reading: expected listing or text, got {self.reading!r}")

    def start(self, anchor: npt.ArrayLike, robot: npt.ArrayLike) -> Tether:
        """A tether along the line of sight.

        Parameters
        ----------
        anchor : array_like, shape (3,)
            Where it is fixed, metres.
        robot : array_like, shape (3,)
            Where it ends, metres.

        Returns
        -------
        Tether
            The straight tether.

        Raises
        ------
        InputError
            As of `GeodesicTether.start`.
        """
        a, r = self.field.free_point(anchor, "anchor"), self.field.free_point(robot, "robot")
        if not self.field.line_of_sight(a, r, depth=0.01 * self.delta):
            raise InputError("robot: is not in sight of the anchor; lay the tether along a path")
        return self.update(_tether(np.array([a, a])), r)

    def lay(self, path: npt.ArrayLike) -> Tether:
        """A tether laid along a path.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            From the anchor to the robot, metres.

        Returns
        -------
        Tether
            The tether.
        """
        points = np.asarray(path, dtype=float).reshape(-1, 3)
        if len(points) < 2:
            raise InputError(f"path: expected at least two points, got {len(points)}")
        first = self.field.free_point(points[0], "path[0]")
        return self.drive(_tether(np.array([first, first])), points[1:])[0]

    def update(
        self, tether: Tether, robot: npt.ArrayLike, anchor: npt.ArrayLike | None = None
    ) -> Tether:
        """The tether after a motion of the robot, of the anchor, or both.

        Parameters
        ----------
        tether : Tether
            Before; it is not changed.
        robot : array_like, shape (3,)
            New position of the robot, metres.
        anchor : array_like, shape (3,), optional
            New position of the anchor, metres; None where it was.

        Returns
        -------
        Tether
            After.
        """
        nodes = tether.nodes
        text = self.reading == "text"
        ends = [(True, robot)] if anchor is None else [(False, anchor), (True, robot)]
        for end, target in ends:
            point = self.field.free_point(
                target, "robot" if end else "anchor", depth=0.25 * self.delta
            )
            if not end:
                nodes = nodes[::-1]
            nodes = tighten(
                self.field.arrays, np.vstack([nodes, point]), self.delta, self.clearance, text,
                self.tolerance, self.passes,
            )  # fmt: skip
            if not end:
                nodes = nodes[::-1]
        return _tether(nodes)

    def drive(self, tether: Tether, path: npt.ArrayLike) -> tuple[Tether, Floats]:
        """The tether after the robot has followed a path.

        Parameters
        ----------
        tether : Tether
            Before; it is not changed.
        path : array_like, shape (k, 3)
            Points that the robot passes, metres.

        Returns
        -------
        tether : Tether
            At the last point.
        lengths : ndarray, shape (k,)
            Length at each point, metres.
        """
        lengths = []
        for point in np.asarray(path, dtype=float).reshape(-1, 3):
            tether = self.update(tether, point)
            lengths.append(tether.length)
        return tether, np.array(lengths)


def _tether(nodes: Floats) -> Tether:
    return Tether(strand_of(nodes), polylines.length(nodes))


@kernel
def tighten(
    field: Field,
    nodes: Floats,
    delta: float,
    clearance: float,
    text: bool,
    tolerance: float,
    passes: int,
) -> Floats:
    """Algorithm 1 after ``appendPath``: shortcut and pull until nothing changes."""
    slack = 0.01 * delta
    before = _length(nodes)
    for _ in range(passes):
        nodes = _shortcut(field, nodes, delta, clearance, text, slack)
        _pull_nodes(field, nodes, delta, clearance, slack)
        after = _length(nodes)
        if before - after < tolerance:
            break
        before = after
    return nodes


@kernel
def _sees(field: Field, nodes: Floats, i: int, j: int, clearance: float, slack: float) -> bool:
    return see(
        field, nodes[i, 0], nodes[i, 1], nodes[i, 2], nodes[j, 0], nodes[j, 1], nodes[j, 2],
        slack - clearance, slack,
    )  # fmt: skip


@kernel
def _shortcut(
    field: Field, nodes: Floats, delta: float, clearance: float, text: bool, slack: float
) -> Floats:
    out = np.empty((16, 3))
    out[0] = nodes[-1]
    size, i = 1, len(nodes) - 1
    while i > 0:
        j = i - 1
        for k in range(i - 2, -1, -1):
            if _sees(field, nodes, i, k, clearance, slack):
                j = k
            elif not text:
                break
        length = math.sqrt(((nodes[i] - nodes[j]) ** 2).sum())
        pieces = max(1, math.ceil(length / delta))
        while size + pieces > len(out):
            more = np.empty((2 * len(out), 3))
            write_rows(more, out, size)
            out = more
        for p in range(1, pieces + 1):
            out[size] = nodes[i] + (nodes[j] - nodes[i]) * (p / pieces)
            size += 1
        i = j
    return out[:size][::-1].copy()


@kernel
def _pull_nodes(field: Field, nodes: Floats, delta: float, clearance: float, slack: float) -> None:
    last = len(nodes) - 1
    for j in range(1, last):
        v = nodes[last] - nodes[j]
        far = math.sqrt((v * v).sum())
        if far == 0.0:
            continue
        old = nodes[j].copy()
        was = _edge(nodes, j - 1) + _edge(nodes, j)
        step = min(delta, far)
        for _ in range(6):
            nodes[j] = old + v * (step / far)
            if (
                _edge(nodes, j - 1) + _edge(nodes, j) < was - 1e-9
                and distance(field, nodes[j, 0], nodes[j, 1], nodes[j, 2]) >= clearance - slack
                and _sees(field, nodes, j - 1, j, clearance, slack)
                and _sees(field, nodes, j, j + 1, clearance, slack)
            ):
                break
            nodes[j] = old
            step *= 0.5


@kernel
def _edge(nodes: Floats, i: int) -> float:
    return math.sqrt(((nodes[i + 1] - nodes[i]) ** 2).sum())


@kernel
def _length(nodes: Floats) -> float:
    total = 0.0
    for i in range(len(nodes) - 1):
        total += _edge(nodes, i)
    return total

"""`react`: Algorithm 1 of Amer et al. 2025, for comparison with the paper.

The paper leaves these choices:

- Listing and text differ. The listing stops at the first node that is out of sight (``break``); the
  text lets j go on to the preceding node "until a collision-free line of sight is found". Both are
  implemented (`reading`). The text's version jumps over solids, and so unwinds a tether from a
  pipe.
- ``checkLineOfSight(M, P_tether)`` is given no pair of nodes; the pair is taken as (i, j).
- ``pullNode(P[j], end, delta)`` is listed for nodes in collision, but the text speaks of "each
  node". Here each node moves by up to delta towards the tether's end, where its two edges stay free
  and the tether becomes shorter.
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
from netsp.world.tether.strand import is_segment_free
from netsp.world.tether.taut_tether import Tether, new_strand

READINGS = ("listing", "text")


@dataclass(frozen=True)
class ReactTether:
    """Tether model of the REACT paper, with the methods of `GeodesicTether`.

    Source: Amer et al. 2025, section III.

    Parameters
    ----------
    field : DistanceField
        Distance field of the scene.
    delta : float
        Distance between nodes, metres.
    reading : str
        Reading of the paper: its `listing` or its `text`.
    clearance : float
        Distance that lines of sight keep from solids, metres.
    tolerance : float
        Reduction of the length, metres, below which the passes end.
    passes : int
        Maximum number of passes in one update.
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
        """Return a tether along the line of sight.

        Parameters
        ----------
        anchor : array_like, shape (3,)
            Position of the anchor, metres.
        robot : array_like, shape (3,)
            Position of the robot, metres.

        Raises
        ------
        InputError
            `GeodesicTether.start` would raise it.
        """
        a, r = self.field.free_point(anchor, "anchor"), self.field.free_point(robot, "robot")
        if not self.field.line_of_sight(a, r, depth=0.01 * self.delta):
            raise InputError("robot: is not in sight of the anchor; lay the tether along a path")
        return self.update(_tether(np.array([a, a])), r)

    def lay(self, path: npt.ArrayLike) -> Tether:
        """Return a tether laid along a path (k, 3), metres, from the anchor to the robot."""
        points = np.asarray(path, dtype=float).reshape(-1, 3)
        if len(points) < 2:
            raise InputError(f"path: expected at least two points, got {len(points)}")
        first = self.field.free_point(points[0], "path[0]")
        return self.drive(_tether(np.array([first, first])), points[1:])[0]

    def update(
        self, tether: Tether, robot: npt.ArrayLike, anchor: npt.ArrayLike | None = None
    ) -> Tether:
        """Return the tether after a motion of the robot, the anchor, or both."""
        nodes = tether.nodes
        is_text = self.reading == "text"
        ends = [(True, robot)] if anchor is None else [(False, anchor), (True, robot)]
        for end, target in ends:
            point = self.field.free_point(
                target, "robot" if end else "anchor", depth=0.25 * self.delta
            )
            if not end:
                nodes = nodes[::-1]
            nodes = tighten(
                self.field.arrays,
                np.vstack([nodes, point]),
                self.delta,
                self.clearance,
                is_text,
                self.tolerance,
                self.passes,
            )
            if not end:
                nodes = nodes[::-1]
        return _tether(nodes)

    def drive(self, tether: Tether, path: npt.ArrayLike) -> tuple[Tether, Floats]:
        """Return the tether after the robot has followed a path, and its lengths on the way.

        Parameters
        ----------
        tether : Tether
            Tether before the motion; it is not changed.
        path : array_like, shape (k, 3)
            Points that the robot passes, metres.

        Returns
        -------
        tether : Tether
            Tether at the last point.
        lengths : ndarray, shape (k,)
            Length at each point, metres.
        """
        lengths = []
        for point in np.asarray(path, dtype=float).reshape(-1, 3):
            tether = self.update(tether, point)
            lengths.append(tether.length)
        return tether, np.array(lengths)


def _tether(nodes: Floats) -> Tether:
    return Tether(new_strand(nodes), polylines.length(nodes))


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
    """Shorten a tether after ``appendPath`` of Algorithm 1: shortcut and pull until nothing
    changes."""
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
    ax, ay, az = nodes[i, 0], nodes[i, 1], nodes[i, 2]
    bx, by, bz = nodes[j, 0], nodes[j, 1], nodes[j, 2]
    return is_segment_free(field, ax, ay, az, bx, by, bz, slack - clearance, slack)


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

"""`geodesic`: a tether that is the locally shortest curve of its homotopy class.

Our own model. What it promises, and why, is told in `netsp.online.tether.pull` and docs/tether.md:
it passes through nothing thicker than 1.8 delta, and its length is that of the curve and not of
its chords. Where the shortest curve of a class is unique (among vertical prisms always), it depends
on the robot's position and the class alone, so driving back undoes driving. Elsewhere a class may
have several locally shortest curves (a tether that could slip off the end of a pipe): the tether
keeps to the one it was driven to as long as there is one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.online.scene.field import DistanceField, finite_point
from netsp.online.tether.pull import drive, follow, pull
from netsp.online.tether.resolution import THINNEST
from netsp.online.tether.strand import strand_length
from netsp.online.tether.tether import Tether, strand_of


@dataclass(frozen=True)
class GeodesicTether:
    """Parameters of the model; `start`, then `update` with every new position of the robot.

    field : the scene.
    delta : metres; resolution. Edges over a surface dip into it by at most delta / 8 (their length
        is corrected for it), and solids thinner than 1.8 delta may be lost.
    precision : metres; the rounds end when no node has farther to go, or the tether would get
        shorter by less than 0.4 of it. Default delta / 200.
    rounds : at most so many in one update, and one more for every delta / 5 that the robot moved.
        Where the tether slips over an edge it may take a few updates to come to rest; until then
        its length is too long, and `Tether.residual` above `precision`.

    >>> from netsp.online import Scene
    >>> scene = Scene(solids=[{"capsule": {"a": [0, 0, -5], "b": [0, 0, 5], "radius": 0.5}}])
    >>> model = GeodesicTether(scene.field())
    >>> tether = model.start(anchor=(-2, 0.6, 0), robot=(2, 0.6, 0))
    >>> tether = model.update(tether, (2, -1, 0))
    >>> len(tether.contacts), round(tether.length, 2)
    (1, 4.37)
    """

    field: DistanceField
    delta: float = 0.1
    precision: float | None = None
    rounds: int = 3

    name = "geodesic"

    def __post_init__(self) -> None:
        if not 0.0 < self.delta < np.inf:
            raise InputError(f"delta: expected a positive length, got {self.delta!r}")

    @cached_property
    def _settings(self) -> tuple[float, float, float, int, float]:
        precision = self.precision if self.precision is not None else 5e-3 * self.delta
        voxel = self.field.voxel
        # normals of voxels are true at the scale of a voxel only, and never to better than a few
        # per cent
        spread = 0.1 * self.delta if voxel is None else max(0.1 * self.delta, voxel)
        return self.delta, spread, 1e-6 if voxel is None else 0.02, self.rounds, precision

    def start(self, anchor: npt.ArrayLike, robot: npt.ArrayLike) -> Tether:
        """A tether along the line of sight from the anchor to the robot.

        Raises
        ------
        InputError : anchor or robot inside a solid or not finite, or no line of sight: then `lay`
            a tether along a path.
        """
        a, r = self.field.free_point(anchor, "anchor"), self.field.free_point(robot, "robot")
        if not self.field.line_of_sight(a, r, depth=0.125 * self.delta):
            raise InputError(
                f"robot: {_show(r)} is not in sight of the anchor {_show(a)}; lay the tether along "
                "a path"
            )
        return self._taut(strand_of([a, r]))

    def lay(self, path: npt.ArrayLike) -> Tether:
        """A tether laid along a path (k, 3) from the anchor on, then pulled taut.

        Raises
        ------
        InputError : a point inside a solid or not finite, fewer than two points.
        """
        points = np.asarray(path, dtype=float).reshape(-1, 3)
        if len(points) < 2:
            raise InputError(f"path: expected at least two points, got {len(points)}")
        for k, point in enumerate(points):
            self.field.free_point(point, f"path[{k}]")
        tether = self._taut(strand_of(np.array([points[0], points[0]])))
        return self.refine(self.drive(tether, points[1:])[0])

    def relaxed(self, path: npt.ArrayLike, rounds: int) -> Tether:
        """A tether that lies along a free path (k, 3), pulled for so many rounds: faster than `lay`
        where the way matters more than the last millimetre."""
        return self._taut(strand_of(path), rounds)

    def _taut(self, strand: Floats, rounds: int | None = None) -> Tether:
        delta, spread, flat, usual, precision = self._settings
        strand, count, residual = pull(
            self.field.arrays, strand, len(strand), delta, spread, flat, rounds or usual, precision
        )
        return _state(strand, count, residual)

    def update(
        self, tether: Tether, robot: npt.ArrayLike, anchor: npt.ArrayLike | None = None
    ) -> Tether:
        """The tether after the robot (and the anchor, on a ship) has moved in a straight line.

        Long motions are followed in steps as short as the scene asks for; any is allowed.

        Raises
        ------
        InputError : robot or anchor not finite, or deeper than delta / 4 inside a solid.
        """
        strand, length, residual = tether.strand, tether.length, tether.residual
        ends = [(True, robot)] if anchor is None else [(False, anchor), (True, robot)]
        for last, target in ends:
            name = "robot" if last else "anchor"
            x, y, z = finite_point(target, name)
            strand, residual, length, depth = follow(
                self.field.arrays, strand, last, x, y, z, *self._settings
            )
            if depth > 0.25 * self.delta:
                self.field.free_point(target, name, 0.25 * self.delta)
        return Tether(strand, length, residual)

    def drive(self, tether: Tether, path: npt.ArrayLike) -> tuple[Tether, Floats]:
        """The tether after the robot has followed a path (k, 3), and its length at each point:
        look-ahead in one call. Points inside solids are the caller's to avoid: the tether follows
        to them as well as it can."""
        points = np.ascontiguousarray(path, dtype=float).reshape(-1, 3)
        if not np.isfinite(points).all():
            raise InputError("path: expected finite coordinates")
        strand, count, residual, lengths = drive(
            self.field.arrays, tether.strand.copy(), len(tether.strand), points, *self._settings
        )
        return _state(strand, count, residual), lengths

    def refine(self, tether: Tether) -> Tether:
        """The same tether, every contact looked at afresh, pulled until nothing moves or for 5000
        rounds (`Tether.residual` tells); after a change of the scene, too."""
        return self.relaxed(tether.nodes, rounds=5000)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What in the scene is too thin for this delta."""
        return self.field.thinner_than(THINNEST * self.delta)


def _state(strand: Floats, count: int, residual: float) -> Tether:
    return Tether(strand[:count].copy(), float(strand_length(strand, count)), float(residual))


def _show(point: Floats) -> str:
    return "(" + ", ".join(f"{v:g}" for v in point) + ")"

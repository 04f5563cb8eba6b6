"""`geodesic`: a tether that is the locally shortest curve of its homotopy class.

Our own model. What it promises, and why, is told in `netsp.world.tether.pull` and docs/tether.md:
it passes through nothing thicker than 1.8 delta, and its length is that of the curve and not of
its chords. Where the shortest curve of a class is unique (among vertical prisms always), it depends
on the robot's position and the class alone, so driving back undoes driving. Elsewhere a class may
have several locally shortest curves (a tether that could slip off the end of a pipe): the tether
keeps to the one it was driven to as long as there is one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.clock import end_if_abandoned
from netsp.base.errors import InputError
from netsp.world.scene.field import DistanceField, finite_point
from netsp.world.tether.drive import drive, follow
from netsp.world.tether.load import Load, drive_under
from netsp.world.tether.measure import cut_off
from netsp.world.tether.pull import MORE_ROUNDS, PullSettings, pull
from netsp.world.tether.resolution import THINNEST
from netsp.world.tether.strand import strand_length
from netsp.world.tether.taut_tether import Tether, strand_of
from netsp.world.tether.tips import MOST_NUDGE


@dataclass(frozen=True)
class GeodesicTether:
    """A taut tether over the solids of a scene: shortest in its homotopy class.

    These are the parameters of the model; `start` gives a tether, `update` moves it on with every
    new position of the robot.

    Parameters
    ----------
    field : DistanceField
        The scene.
    delta : float
        Resolution, metres. Edges over a surface dip into it by at most delta / 8 (their length is
        corrected for it), and solids thinner than 1.8 delta may be lost. A delta finer than the
        voxels of a scene is taken as their size (or as fine as its other solids need), for voxels
        know nothing of a surface's shape below that: the tether would cling to their corners.
    precision : float, optional
        Metres; the rounds end when no node has farther to go, or the tether would get shorter by
        less than 0.4 of it. By default delta / 200.
    rounds : int
        At most so many in one update, and one more for every delta / 5 that the robot moved. Where
        the tether slips over an edge it may take a few updates to come to rest; until then its
        length is not the least, and `Tether.residual` above `precision`.

    Examples
    --------
    >>> from netsp.world import Scene
    >>> scene = Scene(solids=[{"capsule": {"a": [0, 0, -5], "b": [0, 0, 5], "radius": 0.5}}])
    >>> model = GeodesicTether(scene.field())
    >>> tether = model.start(anchor=(-2, 0.6, 0), robot=(2, 0.6, 0))
    >>> tether = model.update(tether, (2, -1, 0))
    >>> len(tether.contacts), round(tether.length, 2)
    (1, 4.53)
    """

    field: DistanceField
    delta: float = 0.1
    precision: float | None = None
    rounds: int = 3

    name = "geodesic"

    def __post_init__(self) -> None:
        if not 0.0 < self.delta < np.inf:
            raise InputError(f"delta: expected a positive length, got {self.delta!r}")
        thinnest = min((t for _, t in self.field.thickness), default=np.inf) / (1.05 * THINNEST)
        coarsest = min(self.field.voxel or 0.0, thinnest)
        object.__setattr__(self, "delta", max(self.delta, coarsest))

    @cached_property
    def _settings(self) -> PullSettings:
        precision = self.precision if self.precision is not None else 5e-3 * self.delta
        voxel = self.field.voxel
        # normals of voxels are true at the scale of a voxel only, and never to better than a few
        # per cent
        spread = 0.1 * self.delta if voxel is None else max(0.1 * self.delta, voxel)
        flat = 1e-6 if voxel is None else 0.02
        return PullSettings(self.delta, spread, flat, self.rounds, precision)

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
            Anchor or robot inside a solid or not finite, or no line of sight: then `lay` a tether
            along a path.
        """
        a, r = self.field.free_point(anchor, "anchor"), self.field.free_point(robot, "robot")
        if not self.field.line_of_sight(a, r, depth=0.125 * self.delta):
            raise InputError(
                f"robot: {_show(r)} is not in sight of the anchor {_show(a)}; lay the tether along "
                "a path"
            )
        return self._taut(strand_of([a, r]))

    def lay(self, path: npt.ArrayLike) -> Tether:
        """A tether laid along a path, then pulled taut.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            From the anchor to the robot, metres.

        Returns
        -------
        Tether
            The taut tether.

        Raises
        ------
        InputError
            A point or a piece inside a solid, or not finite; fewer than two points.
        """
        points = _points(path)
        if len(points) < 2:
            raise InputError(f"path: expected at least two points, got {len(points)}")
        for k, point in enumerate(points):
            self.field.free_point(point, f"path[{k}]")
        for k, (a, b) in enumerate(pairwise(points)):
            if not self.field.line_of_sight(a, b, depth=0.25 * self.delta):
                raise InputError(
                    f"path[{k}] to path[{k + 1}]: passes through a solid; expected a free path"
                )
        tether = self._taut(strand_of(np.array([points[0], points[0]])))
        return self.refine(self.drive(tether, points[1:])[0])

    def relaxed(self, path: npt.ArrayLike, rounds: int) -> Tether:
        """A tether along a free path, pulled for some rounds only.

        Faster than `lay` where its class matters more than the last millimetre.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            From the anchor to the robot, metres; not checked.
        rounds : int
            Rounds of pulling.

        Returns
        -------
        Tether
            The tether; `residual` tells how far from taut.
        """
        return self._taut(strand_of(path), rounds)

    def pulled(self, path: npt.ArrayLike, rounds: int) -> Floats:
        """The nodes of `relaxed` alone: its length is not measured.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            From the anchor to the robot, metres; not checked.
        rounds : int
            Rounds of pulling.

        Returns
        -------
        ndarray, shape (n, 3)
            The path, pulled, metres.
        """
        strand, count, _ = self._pull(strand_of(path), rounds)
        return strand[:count, :3].copy()

    def _taut(self, strand: Floats, rounds: int | None = None) -> Tether:
        return self._state(*self._pull(strand, rounds or self.rounds))

    def _pull(self, strand: Floats, rounds: int) -> tuple[Floats, int, float]:
        end_if_abandoned()
        return pull(
            self.field.arrays, strand, len(strand), self._settings, rounds, 0,
            MOST_NUDGE if rounds >= MORE_ROUNDS else 1,
        )  # fmt: skip

    def update(
        self, tether: Tether, robot: npt.ArrayLike, anchor: npt.ArrayLike | None = None
    ) -> Tether:
        """The tether after the robot (and the anchor, on a ship) has moved in a straight line.

        Long motions are followed in steps as short as the scene asks for; any is allowed.

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

        Raises
        ------
        InputError
            Robot or anchor not finite, or deeper than delta / 4 inside a solid.
        """
        strand, length, residual = tether.strand, tether.length, tether.residual
        ends = [(True, robot)] if anchor is None else [(False, anchor), (True, robot)]
        for last, target in ends:
            name = "robot" if last else "anchor"
            x, y, z = finite_point(target, name)
            strand, residual, length, depth = follow(
                self.field.arrays, strand, last, x, y, z, self._settings
            )
            if depth > 0.25 * self.delta:
                self.field.free_point(target, name, 0.25 * self.delta)
        return Tether(strand, length, residual)

    def drive(
        self, tether: Tether, path: npt.ArrayLike, floor: float = 0.0
    ) -> tuple[Tether, Floats]:
        """The tether after the robot has followed a path: look-ahead in one call.

        That the robot's own path is free is the caller's to see to, as by `field.line_of_sight`:
        through a solid the tether follows as well as it can, and its length means nothing.

        Parameters
        ----------
        tether : Tether
            Before; it is not changed.
        path : array_like, shape (k, 3)
            Points that the robot passes, metres.
        floor : float
            Metres. What edges cut off of the corners of voxels (about a hundredth at most) is added
            to lengths from this one on, and to the last: for callers who ask whether a tether stays
            below a limit.

        Returns
        -------
        tether : Tether
            At the last point.
        lengths : ndarray, shape (k,)
            Length at each point, metres.
        """
        end_if_abandoned()
        points = _points(path)
        strand, count, residual, lengths = drive(
            self.field.arrays, tether.strand.copy(), len(tether.strand), points, self._settings,
            floor,
        )  # fmt: skip
        last = lengths[-1] if len(lengths) else None
        return self._state(strand, count, residual, last), lengths

    def drive_under(
        self, tether: Tether, path: npt.ArrayLike, load: Load
    ) -> tuple[Tether, Floats, Floats]:
        """As `drive`, with what must be out under a load.

        Parameters
        ----------
        tether : Tether
            Before; it is not changed.
        path : array_like, shape (k, 3)
            Points that the robot passes, metres.
        load : Load
            What acts on the tether.

        Returns
        -------
        tether : Tether
            At the last point.
        payouts : ndarray, shape (k,)
            Length that must be out at each point, metres.
        turnings : ndarray, shape (k,)
            Sum of turning angles at each point, radians.
        """
        points = np.ascontiguousarray(path, dtype=float).reshape(-1, 3)
        strand, count, residual, payouts, turnings = drive_under(
            self.field.arrays, tether.strand.copy(), len(tether.strand), points, self._settings,
            load,
        )  # fmt: skip
        return self._state(strand, count, residual), payouts, turnings

    def refine(self, tether: Tether) -> Tether:
        """The same tether, every contact looked at afresh, pulled until nothing moves.

        For use after a change of the scene, too. It ends after 5000 rounds (`Tether.residual`
        tells).

        Parameters
        ----------
        tether : Tether
            Before; it is not changed.

        Returns
        -------
        Tether
            The taut tether.
        """
        return self.relaxed(tether.nodes, rounds=5000)

    def _state(
        self, strand: Floats, count: int, residual: float, length: float | None = None
    ) -> Tether:
        if length is None:
            more = cut_off(self.field.arrays, strand, count, self._settings)
            length = strand_length(strand, count) + more
        return Tether(strand[:count].copy(), float(length), float(residual))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What in the scene is too thin for this delta."""
        return self.field.thinner_than(THINNEST * self.delta)


def _show(point: Floats) -> str:
    return "(" + ", ".join(f"{v:g}" for v in point) + ")"


def _points(path: npt.ArrayLike) -> Floats:
    """(k, 3) a path; InputError if it has another shape or is not finite."""
    try:
        points = np.ascontiguousarray(path, dtype=float)
    except (TypeError, ValueError):
        raise InputError("path: expected points of three coordinates each") from None
    if points.shape == (3,):
        points = points[None]
    if points.size == 0:
        return points.reshape(0, 3)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"path: expected shape (k, 3), got {points.shape}")
    if not np.isfinite(points).all():
        raise InputError("path: expected finite coordinates")
    return points

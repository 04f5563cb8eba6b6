"""`geodesic`: a tether that is the locally shortest curve of its homotopy class.

Where the distance field is 1-Lipschitz, the tether passes through nothing thicker than 1.8 delta;
`netsp.world.tether.pull` and docs/theory/tether say why. Interpolated fields, as of meshes, may be
steeper: for them this is observed, not proven. The tether's length is that of the curve, not of its
chords. Where the shortest curve of a class is unique, as among vertical prisms, it depends only on
the robot's position and the class, so driving back undoes driving. Elsewhere a class may have
several locally shortest curves, for example if the tether could slip off the end of a pipe. Then
the tether stays on the curve to which it was driven for as long as that curve exists.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats
from netsp.base.bounded_work import end_if_abandoned
from netsp.base.errors import InputError
from netsp.world.scene.field import DistanceField, finite_point
from netsp.world.tether.drive import drive, follow
from netsp.world.tether.load import Load, drive_under
from netsp.world.tether.measure import corner_excess
from netsp.world.tether.pull import pull
from netsp.world.tether.strand import strand_length
from netsp.world.tether.taut_tether import Tether, new_strand
from netsp.world.tether.tether_policy import THINNEST, PullSettings, TetherPolicy, pull_settings


@dataclass(frozen=True)
class GeodesicTether:
    """Model of a taut tether that is the shortest curve of its homotopy class.

    An object holds the parameters of the model. `start` returns a tether, `update` the tether after
    a motion of the robot.

    Parameters
    ----------
    field : DistanceField
        Distance field of the scene.
    delta : float
        Resolution, metres. Edges dip into surfaces by at most delta / 8, for which lengths are
        corrected, and the tether may pass through solids thinner than 1.8 delta. A delta finer than
        the voxels of the scene is replaced by their size, or by what its other solids need: below a
        voxel, the shape of a surface is unknown, and the tether would cling to the corners.
    precision : float, optional
        Distance, metres: rounds end when no node has farther to go, or when the tether would become
        shorter by less than 0.4 of it. Default: delta / 200.
    rounds : int
        Maximum number of rounds in one update, besides one for every delta / 5 that the robot
        moved. A tether that slips over an edge may need several updates to come to rest. Until then
        its length is not the least, and `Tether.residual` is above `precision`.
    policy : TetherPolicy
        Other numbers of the model.

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
    policy: TetherPolicy = dataclass_field(default_factory=TetherPolicy)

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
        return pull_settings(
            self.policy,
            delta=self.delta,
            spread=spread,
            flat=flat,
            rounds=self.rounds,
            precision=precision,
        )

    def start(self, anchor: npt.ArrayLike, robot: npt.ArrayLike) -> Tether:
        """Return a straight tether along the line of sight.

        Parameters
        ----------
        anchor : array_like, shape (3,)
            Position of the anchor, metres.
        robot : array_like, shape (3,)
            Position of the robot, metres.

        Raises
        ------
        InputError
            A position is inside a solid or not finite, or there is no line of sight; use `lay` to
            lay the tether along a path.
        """
        a, r = self.field.free_point(anchor, "anchor"), self.field.free_point(robot, "robot")
        if not self.field.line_of_sight(a, r, depth=0.125 * self.delta):
            raise InputError(
                f"robot: {_show(r)} is not in sight of the anchor {_show(a)}; lay the tether along "
                "a path"
            )
        return self._taut(new_strand([a, r]))

    def lay(self, path: npt.ArrayLike) -> Tether:
        """Return a tether laid along a path and pulled taut.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            Path from the anchor to the robot, metres.

        Raises
        ------
        InputError
            A point or segment is inside a solid or not finite, or there are fewer than two points.
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
        tether = self._taut(new_strand(np.array([points[0], points[0]])))
        return self.refine(self.drive(tether, points[1:])[0])

    def relaxed(self, path: npt.ArrayLike, rounds: int) -> Tether:
        """Return a tether along a free path, pulled for some rounds only.

        This is faster than `lay` where the class matters more than the last millimetre.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            Path from the anchor to the robot, metres; it is not checked.
        rounds : int
            Number of rounds.
        """
        return self._taut(new_strand(path), rounds)

    def pulled(self, path: npt.ArrayLike, rounds: int) -> Floats:
        """Return the nodes of `relaxed` (n, 3), without measuring the length.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            Path from the anchor to the robot, metres; it is not checked.
        rounds : int
            Number of rounds.
        """
        strand, count, _ = self._pull(new_strand(path), rounds)
        return strand[:count, :3].copy()

    def _taut(self, strand: Floats, rounds: int | None = None) -> Tether:
        return self._state(*self._pull(strand, rounds or self.rounds))

    def _pull(self, strand: Floats, rounds: int) -> tuple[Floats, int, float]:
        end_if_abandoned()
        is_thorough = rounds >= self.policy.max_extra_rounds
        steps = self.policy.max_sidesteps if is_thorough else 1
        return pull(self.field.arrays, strand, len(strand), self._settings, rounds, 0, steps)

    def update(
        self, tether: Tether, robot: npt.ArrayLike, anchor: npt.ArrayLike | None = None
    ) -> Tether:
        """Return the tether after the robot, or also the anchor, has moved in a straight line.

        Long motions are divided into steps as short as the scene needs.

        Parameters
        ----------
        tether : Tether
            Tether before the motion; it is not changed.
        robot : array_like, shape (3,)
            New position of the robot, metres.
        anchor : array_like, shape (3,), optional
            New position of the anchor, metres; None if it has not moved.

        Raises
        ------
        InputError
            A position is not finite, or deeper than delta / 4 inside a solid.
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
        """Return the tether after the robot has followed a path, and its lengths on the way.

        The caller must make sure that the path of the robot itself is free, such as by
        `DistanceField.line_of_sight`. Through a solid, the tether follows as well as it can, and
        its length means nothing.

        Parameters
        ----------
        tether : Tether
            Tether before the motion; it is not changed.
        path : array_like, shape (k, 3)
            Points that the robot passes, metres.
        floor : float
            Length from which on lengths are corrected for the corners of voxels that edges cut,
            metres. The correction is at most about a hundredth. The last length is always
            corrected. Callers that compare lengths with a limit pass a value below it.

        Returns
        -------
        tether : Tether
            Tether at the last point.
        lengths : ndarray, shape (k,)
            Length at each point, metres.
        """
        end_if_abandoned()
        points = _points(path)
        strand, count = tether.strand.copy(), len(tether.strand)
        strand, count, residual, lengths = drive(
            self.field.arrays, strand, count, points, self._settings, floor
        )
        last = lengths[-1] if len(lengths) else None
        return self._state(strand, count, residual, last), lengths

    def drive_under(
        self, tether: Tether, path: npt.ArrayLike, load: Load
    ) -> tuple[Tether, Floats, Floats]:
        """Return the tether after the robot has followed a path, with payout and turning under a
        load.

        Parameters
        ----------
        tether : Tether
            Tether before the motion; it is not changed.
        path : array_like, shape (k, 3)
            Points that the robot passes, metres.
        load : Load
            Forces on the tether.

        Returns
        -------
        tether : Tether
            Tether at the last point.
        payouts : ndarray, shape (k,)
            Payout at each point, metres.
        turnings : ndarray, shape (k,)
            Sum of turning angles at each point, radians.
        """
        points = np.ascontiguousarray(path, dtype=float).reshape(-1, 3)
        strand, count = tether.strand.copy(), len(tether.strand)
        strand, count, residual, payouts, turnings = drive_under(
            self.field.arrays, strand, count, points, self._settings, load
        )
        return self._state(strand, count, residual), payouts, turnings

    def refine(self, tether: Tether) -> Tether:
        """Return the tether after pulling until nothing moves, with every contact sampled again.

        It also serves after a change of the scene. Pulling ends after 5000 rounds; then
        `Tether.residual` is above the precision.

        Parameters
        ----------
        tether : Tether
            Tether before; it is not changed.
        """
        return self.relaxed(tether.nodes, rounds=5000)

    def _state(
        self, strand: Floats, count: int, residual: float, length: float | None = None
    ) -> Tether:
        if length is None:
            more = corner_excess(self.field.arrays, strand, count, self._settings)
            length = strand_length(strand, count) + more
        return Tether(strand[:count].copy(), float(length), float(residual))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Parts of the scene that are too thin for this delta, one line each."""
        return self.field.thinner_than(THINNEST * self.delta)


def _show(point: Floats) -> str:
    return "(" + ", ".join(f"{v:g}" for v in point) + ")"


def _points(path: npt.ArrayLike) -> Floats:
    """Return a path as an array (k, 3); raise InputError if its shape is wrong or it is not
    finite."""
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

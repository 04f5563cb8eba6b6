"""Bracket of a hanging tether: the lengths that it has at least and at most.

Where a tether may slip off the end of a body, its class has several locally shortest curves. The
taut tether leaves one for another where the first ceases to exist. A cable may leave it earlier,
because something shakes it, or later, because friction holds it. Friction also makes a cable longer
where nothing slips: it does not slide sideways at once. The two ends of the bracket
(docs/theory/tether):

- at most: the longest of several tethers that are driven beside the taut one with frictions up to
  the largest that is assumed (`netsp.world.tether.tether_policy.TetherPolicy.hold_friction`). More
  friction does not always make a tether longer, so one tether would not do;
- at least: the shortest of them and of tethers that slip at once. A taut tether never becomes
  shorter by more than its ends travel, except when it slips. So each larger fall is a slip, and the
  tether after it is driven back along the path, for as long as it is shorter.

Where nothing bends the tether, both ends are the taut length.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.number_ranges import check_not_negative
from netsp.world.tether.geodesic import GeodesicTether
from netsp.world.tether.load import Load
from netsp.world.tether.taut_tether import Tether


@dataclass(frozen=True)
class BracketPolicy:
    """Policy of the bracket of a tether. No number is negative.

    Attributes
    ----------
    hold_friction
        Largest coefficient of friction between the cable and what it hangs on.
    n_frictions
        Number of tethers with friction that are driven beside the taut one, at equal steps of
        friction up to the largest.
    n_planned_frictions
        Number of such tethers where planners, limits and the judge count the friction that a
        mission states: fewer, because planners drive many tethers.
    min_slip_share
        Share of the length by which a tether must become shorter than its ends explain to count as
        slipping, and by which two tethers differ at least. The default is half of what reports
        show.
    min_slip
        The same in units of delta, for short tethers.
    points_per_piece
        Number of points that a shorter tether is driven at a time, before it is compared with the
        taut tether.
    rest_rounds
        Maximum number of rounds in which a shortest path is pulled taut. Pulling ends when nothing
        moves, usually after about ten.
    min_shown_share
        Share of the taut length by which both ends of the bracket differ where reports show them.
    """

    hold_friction: float = 0.4
    n_frictions: int = 4
    n_planned_frictions: int = 2
    min_slip_share: float = 0.005
    min_slip: float = 0.2
    points_per_piece: int = 32
    rest_rounds: int = 300
    min_shown_share: float = 0.01

    def __post_init__(self) -> None:
        check_not_negative(self)


@dataclass(frozen=True, eq=False)
class HangingTether(Tether):
    """Tether that may hang otherwise than the taut one, because friction holds it.

    Its strand is that of the taut tether; its length is the length that it has at most.

    Parameters
    ----------
    taut_length : float
        Length of the taut tether, metres.
    held : tuple of Tether
        Tethers with friction, one for each friction of the model.
    """

    taut_length: float = 0.0
    held: tuple[Tether, ...] = ()


@dataclass(frozen=True, eq=False)
class LengthBracket:
    """Lengths of a tether along a path, each of shape (k,), metres.

    Attributes
    ----------
    lower
        Length that the tether has at least: it slips as soon as a shorter curve can be reached.
    taut
        Length of the taut tether.
    upper
        Length that the tether has at most, with any friction up to the largest.
    """

    lower: Floats
    taut: Floats
    upper: Floats


@dataclass(frozen=True)
class HoldingTether(GeodesicTether):
    """Model of a taut tether whose length is the one that it has at most.

    That is the longest of the taut tether and of those with friction.

    Parameters
    ----------
    bracket : BracketPolicy
        Friction, and what counts as slipping.

    Examples
    --------
    >>> import numpy as np
    >>> from netsp.world import Scene
    >>> scene = Scene(solids=[{"capsule": {"a": [-3, 0, 0], "b": [0, 0, 0], "radius": 0.2}}])
    >>> model = HoldingTether(scene.field(), 0.05)
    >>> tether = model.lay([(-0.3, -1.5, -1), (-1.5, -1.5, 1.5), (-1.5, 1.5, 1.5), (0, 1.5, -1)])
    >>> tether, _ = model.drive(tether, [(x, 1.5, -1) for x in np.arange(0.05, 0.55, 0.05)])
    >>> isinstance(tether, HangingTether), tether.length > 1.2 * tether.taut_length
    (True, True)
    """

    bracket: BracketPolicy = dataclass_field(default_factory=BracketPolicy)

    @cached_property
    def _holding(self) -> tuple[GeodesicTether, ...]:
        count, largest = self.bracket.n_frictions, self.bracket.hold_friction
        return tuple(
            GeodesicTether(
                self.field,
                self.delta,
                self.precision,
                self.rounds,
                replace(self.policy, hold_friction=largest * (k + 1) / count),
            )
            for k in range(count)
        )

    def _slack(self, length: float) -> float:
        """Return the difference of two lengths from which on they count as different, metres."""
        return max(self.bracket.min_slip_share * length, self.bracket.min_slip * self.delta)

    def _with_friction(self, tether: Tether) -> list[tuple[GeodesicTether, Tether]]:
        """Return the models with friction and their tethers; those of a taut tether are itself."""
        held = held_tethers(tether) or (tether,) * len(self._holding)
        return list(zip(self._holding, held, strict=True))

    def update(
        self, tether: Tether, robot: npt.ArrayLike, anchor: npt.ArrayLike | None = None
    ) -> Tether:
        """Return the tether after the robot, or also the anchor, has moved in a straight line.

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
            As `GeodesicTether.update`.
        """
        taut = super().update(tether, robot, anchor)
        held = [m.update(h, robot, anchor) for m, h in self._with_friction(tether)]
        return _hanging(taut, held)

    def drive(
        self, tether: Tether, path: npt.ArrayLike, floor: float = 0.0
    ) -> tuple[Tether, Floats]:
        """Return the tether after the robot has followed a path, and its length at each point.

        Parameters
        ----------
        tether : Tether
            Tether before the motion; it is not changed.
        path : array_like, shape (k, 3)
            Points that the robot passes, metres.
        floor : float, optional
            Length below which lengths need not be exact, metres.

        Raises
        ------
        InputError
            As `GeodesicTether.drive`.
        """
        taut, lengths = super().drive(tether, path, floor)
        if len(lengths) == 0:
            return tether, lengths
        driven = [m.drive(h, path, floor) for m, h in self._with_friction(tether)]
        upper = np.max([lengths, *(found for _, found in driven)], axis=0)
        return _hanging(taut, [held for held, _ in driven]), upper

    def drive_under(
        self, tether: Tether, path: npt.ArrayLike, load: Load
    ) -> tuple[Tether, Floats, Floats]:
        """Return the tether, payouts and turnings of `GeodesicTether.drive_under`, the last two as
        the largest of all tethers at each point."""
        taut, payouts, turnings = super().drive_under(tether, path, load)
        if len(payouts) == 0:
            return tether, payouts, turnings
        driven = [m.drive_under(h, path, load) for m, h in self._with_friction(tether)]
        payouts = np.max([payouts, *(d[1] for d in driven)], axis=0)
        turnings = np.max([turnings, *(d[2] for d in driven)], axis=0)
        return _hanging(taut, [d[0] for d in driven]), payouts, turnings

    def refine(self, tether: Tether) -> Tether:
        """Return the tether after pulling until nothing moves, with its held tethers at rest.

        Parameters
        ----------
        tether : Tether
            Tether before; it is not changed.
        """
        taut = super().refine(tether)
        if not held_tethers(tether):
            return taut
        return _hanging(taut, [m.refine(h) for m, h in self._with_friction(tether)])

    def along(
        self,
        tether: Tether,
        path: npt.ArrayLike,
        *,
        stops: Sequence[int] = (),
        shorter: Mapping[int, Tether] | None = None,
    ) -> LengthBracket:
        """Return the bracket of the tether's length along a path.

        Parameters
        ----------
        tether : Tether
            Tether where the path begins; its held tethers are left out.
        path : array_like, shape (k, 3)
            Points that the robot passes, metres, at steps that are fine beside delta.
        stops : sequence of int, optional
            Indices of points at which the tether is also refined at half of delta, to find out
            whether a shorter one can be reached.
        shorter : mapping of int to Tether, optional
            Other tethers of the same class at points of the path, by their indices.

        Raises
        ------
        InputError
            As `GeodesicTether.drive`.

        Examples
        --------
        >>> import numpy as np
        >>> from netsp.world import Scene
        >>> post = {"capsule": {"a": [0, 0, -5], "b": [0, 0, 5], "radius": 0.5}}
        >>> model = HoldingTether(Scene(solids=[post]).field(), 0.1)
        >>> path = [(2, y, 0) for y in np.arange(0.6, -1, -0.1)]
        >>> found = model.along(model.start((-2, 0.6, 0), (2, 0.6, 0)), path)
        >>> bool(np.allclose(found.lower, found.upper, rtol=1e-4))
        True
        """
        points = np.ascontiguousarray(path, dtype=float).reshape(-1, 3)
        tether = Tether(tether.strand, taut_length(tether), tether.residual)
        taut = GeodesicTether.drive(self, tether, points)[1]
        lengths = [taut, *(m.drive(tether, points)[1] for m in self._holding)]
        upper, lower = np.max(lengths, axis=0), np.min(lengths, axis=0)
        candidates = list((shorter or {}).items())
        for _, k in self._slips(tether, points, taut):
            state = GeodesicTether.drive(self, tether, points[: k + 1])[0]
            self._lower_on(self.refine(state), points, np.arange(k - 1, -1, -1), lower)
        finer = GeodesicTether(self.field, 0.5 * self.delta)
        state, at = tether, 0
        for k in sorted(stops):
            state, at = GeodesicTether.drive(self, state, points[at : k + 1])[0], k + 1
            candidates.append((k, finer.refine(state)))
        for k, candidate in candidates:
            self._lower_along(candidate, points, k, lower)
        return LengthBracket(lower, taut, upper)

    def _slips(self, tether: Tether, points: Floats, lengths: Floats) -> list[tuple[int, int]]:
        """Return where the taut tether slips: the number of points driven before, and the index of
        the point at which it has become too short."""
        if len(points) == 0:
            return []
        start = taut_length(tether)
        steps = np.linalg.norm(np.diff(np.vstack([tether.robot, points]), axis=0), axis=1)
        # without slipping, length and distance travelled never fall in sum
        total = np.concatenate([[start], lengths]) + np.concatenate([[0.0], np.cumsum(steps)])
        slips, highest, is_falling = [], 0, False
        for k in range(1, len(total)):
            if total[k] >= total[highest] or is_falling:
                is_falling = total[k] < total[highest]
                highest = k
            elif total[highest] - total[k] > self._slack(float(lengths[k - 1])):
                slips.append((highest, k - 1))
                highest, is_falling = k, True
        return slips

    def _lower_along(self, tether: Tether, points: Floats, k: int, lower: Floats) -> None:
        """Drive a shorter tether at point k along the path to both sides, while it is shorter."""
        gain = float(lower[k]) - tether.length
        lower[k] = min(float(lower[k]), tether.length)
        if gain <= self._slack(tether.length):
            return
        for order in (np.arange(k - 1, -1, -1), np.arange(k + 1, len(points))):
            self._lower_on(tether, points, order, lower)

    def _lower_on(self, tether: Tether, points: Floats, order: Ints, lower: Floats) -> None:
        """Drive a shorter tether through points in an order, while it is shorter."""
        for begin in range(0, len(order), self.bracket.points_per_piece):
            piece = order[begin : begin + self.bracket.points_per_piece]
            tether, lengths = GeodesicTether.drive(self, tether, points[piece])
            for at, length in zip(piece, lengths, strict=True):
                if length >= lower[at] - 1e-9:
                    return
                lower[at] = length


def _hanging(taut: Tether, held: Sequence[Tether]) -> Tether:
    """Return the taut tether with its tethers with friction, if anything bends one of them."""
    if not held or all(len(t.strand) == 2 for t in (taut, *held)):
        return taut
    longest = max(taut.length, *(h.length for h in held))
    return HangingTether(taut.strand, longest, taut.residual, taut.length, tuple(held))


def taut_length(tether: Tether) -> float:
    """Return the length of the taut tether, metres, whatever may hold it.

    Parameters
    ----------
    tether : Tether
        The tether.

    Examples
    --------
    >>> from netsp.world.tether.taut_tether import new_strand
    >>> taut_length(HangingTether(new_strand([(0, 0, 0), (1, 0, 0)]), 1.5, taut_length=1.0))
    1.0
    """
    return tether.taut_length if isinstance(tether, HangingTether) else tether.length


def held_tethers(tether: Tether) -> tuple[Tether, ...]:
    """Return the tethers with friction, by friction; none if nothing bends the tether.

    Parameters
    ----------
    tether : Tether
        The tether.

    Examples
    --------
    >>> from netsp.world.tether.taut_tether import new_strand
    >>> held_tethers(Tether(new_strand([(0, 0, 0), (1, 0, 0)]), 1.0))
    ()
    """
    return tether.held if isinstance(tether, HangingTether) else ()

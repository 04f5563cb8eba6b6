"""Looking ahead: does the tether stay within its limit while the robot follows a path?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.world.mission.anchor_track import Track
from netsp.world.mission.mission import Mission
from netsp.world.planner.planner_policy import PreviewPolicy
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.tether.load import Load, payout, turning

CONTACT_DEPTH = 0.2
"""Tolerance of contacts, as a multiple of delta: how deep a robot may be in a solid, because the
tether model's nodes let paths dip in."""


@dataclass(frozen=True)
class Ahead:
    """The tether along paths that are not followed yet.

    Parameters
    ----------
    mission : Mission
        What is flown.
    model : GeodesicTether
        The tether model, with the map.
    load : Load or None
        What acts on the tether; None where its taut length is all that counts.
    track : Track or None
        Where the anchor goes, if it still moves.
    now : float
        Seconds since the start of the mission.
    policy : PreviewPolicy
        Steps and margins.
    """

    mission: Mission
    model: GeodesicTether
    load: Load | None
    track: Track | None
    now: float
    policy: PreviewPolicy = PreviewPolicy()

    def follow(
        self, tether: Tether, path: Floats, limit: float, staying: float
    ) -> tuple[float, Tether]:
        """How far along a path the tether stays within the limit, and how it lies there.

        Parameters
        ----------
        tether : Tether
            Where the path begins.
        path : ndarray, shape (k, 3)
            The path, metres.
        limit : float
            Metres of tether that may be out; as much as is out now may be at least.
        staying : float
            Seconds that the robot stays at its end: there too, the tether must last.

        Returns
        -------
        far : float
            Metres; infinite where it lasts to the end, and as long as the robot stays there.
        tether : Tether
            At the end then; else somewhere on the way.
        """
        if self._meets_solid(path):
            return 0.0, tether
        if self.track is not None:
            return self._by_the_clock(self.track, tether, path, limit, staying)
        if self.load is not None:
            return self._under_load(self.load, tether, path, limit)
        return self._taut(tether, path, limit)

    def fits(self, tether: Tether, path: Floats, limit: float, staying: float) -> bool:
        """Whether it stays so to the end; as `follow`."""
        return math.isinf(self.follow(tether, path, limit, staying)[0])

    def _taut(self, tether: Tether, path: Floats, limit: float) -> tuple[float, Tether]:
        """A taut tether gets longer by at most the path of its end. So as far as what is left of
        the limit the robot may go at once, and where little is left in small steps."""
        most = max(limit, tether.length + 1e-6)
        s, length = 0.0, polylines.length(path)
        while s < length:
            until = min(length, s + max(self._fine, most - tether.length))
            part = polylines.part(path, s, until)[1:]
            tether, lengths = self.model.drive(tether, part, floor=self.policy.floor_share * most)
            if lengths.max() > most:
                return s, tether
            s = until
        return math.inf, tether

    @property
    def _fine(self) -> float:
        """Metres between two places where little of the limit is left."""
        return max(0.5 * self.mission.delta, 0.02)

    def _meets_solid(self, path: Floats) -> bool:
        """Whether a path, pulled over points of a tether that lies in a crease, say, leads into a
        solid: as deep as ends a flight."""
        points = polylines.dense(path, self.mission.delta)
        depth = CONTACT_DEPTH * self.mission.delta
        return bool(len(points) and self.model.field.distance(points).min() < -depth)

    def _under_load(
        self, load: Load, tether: Tether, path: Floats, limit: float
    ) -> tuple[float, Tether]:
        """What slack and sag add has no such bound as in `_taut`: a contact that is lost joins two
        spans. So all steps are small. The sum of turning angles has its limit, too."""
        points = polylines.dense(path, self._fine)
        if not len(points):
            return math.inf, tether
        end, payouts, turnings = self.model.drive_under(tether, points, load)
        over = payouts > max(limit, payout(tether, load) + 1e-6)
        over |= turnings > self._most_turning(tether)
        if not over.any():
            return math.inf, end
        return float(polylines.along(np.vstack([path[:1], points]))[over.argmax()]), end

    def _by_the_clock(
        self, track: Track, tether: Tether, path: Floats, limit: float, staying: float
    ) -> tuple[float, Tether]:
        """Both ends of the tether are on their way, the anchor also while the robot stays at its
        end. A taut tether gets longer by at most what both travel."""
        most, turns = max(limit, self._payout(tether) + 1e-6), self._most_turning(tether)
        speed, far = self.mission.speed, polylines.length(path)
        whole, at, out = far / speed + staying, 0.0, self._payout(tether)
        while at < whole - 1e-9:
            step = self.policy.min_step_s
            if self.load is None:
                step = max(step, (most - out) / (speed + track.speed))
            until = min(whole, at + step)
            for place in track.between(self.now + at, self.now + until)[1:]:
                tether = self.model.update(tether, tether.robot, place)
            if speed * at < far:
                part = polylines.part(path, speed * at, min(far, speed * until))
                tether, _ = self.model.drive(tether, part[1:])
            at, out = until, self._payout(tether)
            if out > most or turning(tether, self.mission.delta) > turns:
                return 0.0, tether  # nearer by, it would have to last as long: that was not asked
        return math.inf, tether

    def _payout(self, tether: Tether) -> float:
        return tether.length if self.load is None else payout(tether, self.load)

    def _most_turning(self, tether: Tether) -> float:
        """Sum of turning angles that plans may use, radians: what it is now if that is more."""
        most = self.mission.tether.max_turning
        if math.isinf(most):
            return most
        return max(most, turning(tether, self.mission.delta) + 1e-6)

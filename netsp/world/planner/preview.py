"""Preview: simulates whether the tether stays within its limit while the robot follows a path."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.world.mission.anchor_track import AnchorTrack
from netsp.world.mission.mission import Mission
from netsp.world.paths.standoff import are_in_sight
from netsp.world.planner.planner_policy import PreviewPolicy
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.tether.load import Load, payout, turning

CONTACT_DEPTH = 0.2
"""Tolerance for the depth of a robot in a solid, as a multiple of delta: between the nodes of the
tether model, paths may cut into solids."""


@dataclass(frozen=True)
class TetherPreview:
    """Preview of the tether along paths that the robot may follow.

    Parameters
    ----------
    mission : Mission
        The mission.
    model : GeodesicTether
        The tether model, with the map.
    load : Load or None
        Load on the tether; None if only the taut length counts.
    track : Track or None
        Track of the anchor, if it still moves.
    now : float
        Time since the start of the mission, s.
    policy : PreviewPolicy
        Steps and margins.
    max_depth : float, optional
        Depth to which a path may lead into solids, metres, more than 0; by default `CONTACT_DEPTH`
        times delta, at which the robot would be stopped.
    """

    mission: Mission
    model: GeodesicTether
    load: Load | None
    track: AnchorTrack | None
    now: float
    policy: PreviewPolicy = PreviewPolicy()
    max_depth: float | None = None

    def follow(
        self, tether: Tether, path: Floats, limit: float, stay_s: float
    ) -> tuple[float, Tether]:
        """Return how far along a path the tether stays within the limit, and the tether there.

        Parameters
        ----------
        tether : Tether
            The tether where the path begins.
        path : ndarray, shape (k, 3)
            The path, metres.
        limit : float
            Maximum payout, metres; at least the payout now.
        stay_s : float
            Time that the robot stays at the end, s; the tether must last for it, too.

        Returns
        -------
        distance : float
            Length along the path, metres; infinite if the tether lasts to the end and for the stay.
        tether : Tether
            Tether at the end if it lasts; otherwise a tether on the way.
        """
        if self.meets_solid(path):
            return 0.0, tether
        if self.track is not None:
            return self._with_moving_anchor(self.track, tether, path, limit, stay_s)
        if self.load is not None:
            return self._under_load(self.load, tether, path, limit)
        return self._taut(tether, path, limit)

    def fits(self, tether: Tether, path: Floats, limit: float, stay_s: float) -> bool:
        """Return whether the tether stays within the limit to the end; see `follow`."""
        return math.isinf(self.follow(tether, path, limit, stay_s)[0])

    def _taut(self, tether: Tether, path: Floats, limit: float) -> tuple[float, Tether]:
        """Follow a path with a taut tether.

        A taut tether grows by at most the distance that its end moves, so a step may be as long as
        the rest of the limit.
        """
        max_length = max(limit, tether.length + 1e-6)
        start, length = 0.0, polylines.length(path)
        while start < length:
            stop = min(length, start + max(self._fine, max_length - tether.length))
            part = polylines.part(path, start, stop)[1:]
            tether, lengths = self.model.drive(
                tether, part, floor=self.policy.floor_share * max_length
            )
            if lengths.max() > max_length:
                return start, tether
            start = stop
        return math.inf, tether

    @property
    def _fine(self) -> float:
        """Distance between two simulated places if little of the limit is left, metres."""
        return max(0.5 * self.mission.delta, 0.02)

    def meets_solid(self, path: Floats) -> bool:
        """Return whether a path (k, 3) leads deeper into a solid than `max_depth` and than it
        begins.

        Between the places that are tested, the path is at most half as deep again.
        """
        if not len(path):
            return False
        field, delta = self.model.field, self.mission.delta
        depth = CONTACT_DEPTH * delta if self.max_depth is None else self.max_depth
        begin = -float(field.distance(path[0]))
        if len(path) < 2:
            return begin > depth
        depth = max(depth, 1.01 * begin)
        return not bool(are_in_sight(field.arrays, path[:-1], path[1:], depth).all())

    def _under_load(
        self, load: Load, tether: Tether, path: Floats, limit: float
    ) -> tuple[float, Tether]:
        """Follow a path with a tether under load.

        All steps are small: slack and sag may jump where a lost contact joins two spans, so the
        bound of `_taut` does not hold. The sum of turning angles has a limit, too.
        """
        points = polylines.dense(path, self._fine)
        if not len(points):
            return math.inf, tether
        end, payouts, turnings = self.model.drive_under(tether, points, load)
        over = payouts > max(limit, payout(tether, load) + 1e-6)
        over |= turnings > self._max_turning(tether)
        if not over.any():
            return math.inf, end
        return float(polylines.along(np.vstack([path[:1], points]))[over.argmax()]), end

    def _with_moving_anchor(
        self, track: AnchorTrack, tether: Tether, path: Floats, limit: float, stay_s: float
    ) -> tuple[float, Tether]:
        """Follow a path while the anchor moves, also during the stay at the end.

        A taut tether grows by at most the distance that both of its ends move.
        """
        max_payout, max_turning = max(limit, self._payout(tether) + 1e-6), self._max_turning(tether)
        speed, path_length = self.mission.speed, polylines.length(path)
        duration, elapsed, current = path_length / speed + stay_s, 0.0, self._payout(tether)
        while elapsed < duration - 1e-9:
            step = self.policy.min_step_s
            if self.load is None:
                step = max(step, (max_payout - current) / (speed + track.speed))
            until = min(duration, elapsed + step)
            for place in track.between(self.now + elapsed, self.now + until)[1:]:
                tether = self.model.update(tether, tether.robot, place)
            if speed * elapsed < path_length:
                part = polylines.part(path, speed * elapsed, min(path_length, speed * until))
                tether, _ = self.model.drive(tether, part[1:])
            elapsed, current = until, self._payout(tether)
            if current > max_payout or turning(tether, self.mission.delta) > max_turning:
                return 0.0, tether  # not tested for a shorter path
        return math.inf, tether

    def _payout(self, tether: Tether) -> float:
        return tether.length if self.load is None else payout(tether, self.load)

    def _max_turning(self, tether: Tether) -> float:
        """Return the largest sum of turning angles of plans, rad: the limit, or the present sum."""
        limit = self.mission.tether.max_turning
        if math.isinf(limit):
            return limit
        return max(limit, turning(tether, self.mission.delta) + 1e-6)

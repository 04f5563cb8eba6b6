"""`predictive`: simulates the tether along the coming path before the robot moves.

So the limit is never exceeded on the path that was planned. A waypoint is left out only when no
path to it is found on which the tether fits; since going back to the anchor along the tether and
then the shortest path is among those that are tried, that does not happen to a waypoint whose own
shortest tether fits (but for the clearance that the robot keeps, and the margin).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from netsp.arrays import Floats
from netsp.geometry import polylines
from netsp.online.paths.tree import homotopic, taut
from netsp.online.planner.base import NORMAL, RECOVERY, Planner
from netsp.online.scene.field import pushed_out
from netsp.online.tether import GeodesicTether, Tether

MARGIN = 0.004
"""Share of the tether that is kept in reserve for what the simulation does not know."""

PIVOTS = 24
"""At most so many places along the tether to turn at."""

COARSE = 10.0
"""The tether is first looked at this much farther apart."""

ENOUGH_ROUNDS = 10, 100
"""Few rounds tell that a tether is short enough, many that it is not."""


@dataclass
class PredictivePlanner(Planner):
    """`Planner` with look-ahead."""

    _planned: int = field(default=-1)
    _warned: int = field(default=-1)

    name = "predictive"

    def plan(self, robot: Floats, tether: Tether) -> bool:
        """One path per waypoint, planned when the robot sets out for it."""
        if self._planned == self.index and len(self.path) and not self._surprised(tether):
            return False
        self._planned = self.index
        limit = self.mission.tether_length * (1.0 - MARGIN)
        target = self.target
        for end in (target, self._near_enough(robot, target)):
            straight = np.array([robot, end])
            if self.is_free(straight) and self._fits(tether, straight, limit):
                self.path, self.mode = straight[1:], NORMAL
                return True
        path = self._shortest_feasible(robot, tether, limit)
        if path is None:
            own = self._own_tether(target)
            self.give_up(
                "no free path to it" if own is None else
                f"out of reach: its shortest tether is {own:.3g} of "
                f"{self.mission.tether_length:g}"
            )  # fmt: skip
            return True
        better = self.refined(path)
        if better is not path and self._fits(tether, better, limit):
            path = better
        self.path, self.mode = path[1:], RECOVERY
        return True

    def _surprised(self, tether: Tether) -> bool:
        """Whether half of the reserve is used up, as in a current: said once for each waypoint."""
        if (
            self._warned == self.index
            or tether.length <= (1.0 - 0.5 * MARGIN) * self.mission.tether_length
        ):
            return False
        self._warned = self.index
        return True

    def _near_enough(self, robot: Floats, target: Floats) -> Floats:
        """Where on the straight path the waypoint counts as visited: the tether may fit there only.
        A fifth of the reach is left for a vehicle that does not stop on the spot."""
        path = target - robot
        far = float(np.linalg.norm(path))
        return target - path * min(1.0, 0.8 * self.mission.reach / max(far, 1e-12))

    @property
    def _model(self) -> GeodesicTether:
        assert isinstance(self.tethers, GeodesicTether)
        return self.tethers

    def warm_up(self, robot: Floats, tether: Tether) -> None:
        """See `Planner`."""
        self._shortest_feasible(robot, tether, self.mission.tether_length)

    def _fits(self, tether: Tether, path: Floats, limit: float) -> bool:
        """Whether the tether stays within the limit all along a path.

        A taut tether gets longer by at most the path of its end. So between points h apart, with
        lengths a and b, it is at most (a + b + h) / 2 long, and only where that is too much need
        one look closer.
        """
        most = max(limit, tether.length + 1e-6)
        fine = max(0.5 * self.mission.delta, 0.02)
        points = polylines.dense(path, COARSE * fine)
        _, lengths = self.tethers.drive(tether, points)
        if lengths.max(initial=0.0) > most:
            return False
        corners = np.vstack([path[:1], points])
        steps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
        close = np.r_[tether.length, lengths[:-1]] + lengths + steps > 2.0 * most
        if not close.any():
            return True
        state = tether
        for k, near in enumerate(close[: np.flatnonzero(close)[-1] + 1]):
            stops = polylines.dense(corners[k : k + 2], fine) if near else points[k : k + 1]
            state, lengths = self.tethers.drive(state, stops)
            if lengths.max() > most:
                return False
        return True

    def _shortest_feasible(self, robot: Floats, tether: Tether, limit: float) -> Floats | None:
        """The shortest path on which the tether fits: on from the robot, or back along the tether
        to a pivot and on from there. One tree serves all pivots.

        What a pivot decides is the class of the tether at the target, and with it its length there.
        Pivots in a row that lead to one class are taken together; classes over the limit need no
        more. For the others the path is pulled taut as a whole, the part back along the tether too:
        there is none shorter in its class. Where the tether is over the limit on that path, as much
        of the part back along the tether as need be is left as it is.
        """
        # the tether back from the robot, finely, off the surfaces; some of its points are pivots
        nodes = tether.nodes[::-1]
        along = polylines.along(nodes)
        back = polylines.points_along(nodes, self.mission.cell)
        places = np.linspace(0.0, along[-1], len(back))
        back[1:] = pushed_out(self.scene, back[1:], self.mission.clearance)
        pivots = np.unique(np.linspace(0, len(back) - 1, PIVOTS + 1).round().astype(int))
        tree = self.paths(back[pivots])
        onward = {int(i): tree.path(n) for n, i in enumerate(pivots)}

        def taken_back(i: int) -> Floats:
            """The tether when the robot has followed it back to point i."""
            passed = int(np.searchsorted(along, places[i] - 1e-9, side="right"))
            return np.vstack([tether.nodes[: max(1, len(nodes) - passed)], back[i]])

        whole: list[tuple[float, Floats, int, int]] = []
        for first, last in self._classes(back, onward):
            on = onward[last]
            assert on is not None
            if self._over_the_limit(np.vstack([taken_back(last), on[1:]]), limit):
                continue
            path = self.pulled(np.vstack([back[: last + 1], on[1:]]))
            whole.append((polylines.length(path), path, first, last))
        best: Floats | None = None
        least = np.inf
        for length, path, first, last in sorted(whole, key=lambda w: w[0]):
            if length >= least:
                break
            if self._fits(tether, path, limit):
                return path if length < least else best
            # the more of the tether is taken back, the sooner the rest fits
            kept: Floats | None = None
            row = [int(i) for i in pivots if first <= i <= last]
            while row:
                i = row[(len(row) - 1) // 2]
                on = onward[i]
                assert on is not None
                on = self.pulled(on)
                if self._fits(self._model.relaxed(taken_back(i), ENOUGH_ROUNDS[0]), on, limit):
                    kept = np.vstack([back[: i + 1], on[1:]])
                    row = [j for j in row if j < i]
                else:
                    row = [j for j in row if j > i]
            if (
                kept is not None
                and polylines.length(kept) < least
                and self._fits(tether, kept, limit)
            ):
                best, least = kept, polylines.length(kept)
        return best

    def _classes(self, back: Floats, onward: Mapping[int, Floats | None]) -> list[tuple[int, int]]:
        """Pivots in a row often lead to paths of one class: the first and last of each such row."""
        out: list[tuple[int, int]] = []
        first: int | None = None
        pivots = list(onward)
        for i, j in zip(pivots, [*pivots[1:], None], strict=True):
            path, after = onward[i], None if j is None else onward[j]
            if path is None:
                first = None
                continue
            first = i if first is None else first
            if (
                j is None
                or after is None
                or not homotopic(
                    self.scene, path, np.vstack([back[i : j + 1], after[1:]]), self.grid.cell
                )
            ):
                out.append((first, i))
                first = None
        return out

    def _over_the_limit(self, line: Floats, limit: float) -> bool:
        """Whether a tether that lies along a line is over the limit even when it is taut."""
        return all(self._model.relaxed(line, rounds).length > limit for rounds in ENOUGH_ROUNDS)

    def _own_tether(self, target: Floats) -> float | None:
        """Length of the shortest tether from the anchor to a place."""
        tree = self.paths(np.array([self.mission.anchor]))
        path = tree.path(0)
        return (
            None
            if path is None
            else polylines.length(taut(self.scene, path, 0.0, self.mission.delta))
        )

"""`predictive`: simulates the tether along each path before the robot follows it.

The limit is never exceeded on a planned path. A waypoint is left out only if the shortest tether
to it, in every class found, is over the limit, or if even the path back to the anchor and out along
that tether exceeds it; the reason states which, and by how much.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.geometry import polylines
from netsp.world.mission.mission import MissionWaypoint
from netsp.world.paths.standoff import move_off_surfaces
from netsp.world.paths.tree import are_homotopic, pull_in_stages, pull_roughly_taut
from netsp.world.planner.planner import HOME, NORMAL, RECOVERY, WAIT, Planner, Tethers
from netsp.world.planner.planner_policy import PredictivePolicy
from netsp.world.planner.preview import CONTACT_DEPTH, TetherPreview
from netsp.world.scene.field import DistanceField
from netsp.world.tether import GeodesicTether, Tether


class Candidate(NamedTuple):
    """Candidate class of the tether at the waypoint.

    It has a tether of the class (k, 3), a path that leads to it (m, 3), and that path roughly
    pulled taut (n, 3).
    """

    tether: Floats
    path: Floats
    rough: Floats


@dataclass
class PredictivePlanner(Planner):
    """Planner that simulates the tether ahead."""

    _planned: int = field(default=-1)
    _warned: int = field(default=-1)
    _home_steps: int = 0
    _homes: int = 0
    _is_sure_of_home: bool = False
    _preview_count: int = 0
    _previewed_length: float = 0.0
    _checked: float = 0.0
    _rest_checked: float = 0.0
    _is_retreating: bool = False
    _may_cut: bool = False
    _has_met_solid: bool = False
    _shortest: Tether | None = None
    _previous_excess: float = 0.0
    _candidates: list[Candidate] = field(default_factory=list)

    name = "predictive"

    @property
    def predictive(self) -> PredictivePolicy:
        """Policy of the simulation ahead."""
        return self.policy.predictive

    def plan(self, robot: Floats, tether: Tether) -> bool:
        """Plan the path to a waypoint once, when the robot sets out for it."""
        if (
            self._planned == self.index
            and len(self.path)
            and not self._has_used_half_reserve(tether)
            and not self._is_overtaken(robot, tether)
            and not self._is_longer_than_planned(robot, tether)
        ):
            return False
        retreat = None if self.is_anchor_moving else self._path_to_shorten(tether)
        if retreat is not None:
            is_gone = np.linalg.norm(self.path[-1:] - robot) <= self.mission.reach
            if not self._is_retreating or not len(self.path) or is_gone:
                self.path, self.mode, self._is_retreating = retreat[1:], RECOVERY, True
                return True
            return False
        self._is_retreating = False
        first = self._planned != self.index
        self._planned, self._checked, self._may_cut = self.index, self.now, False
        limit = self.limit
        leg = self._leg(robot, tether) if first else None
        if leg is not None and self._fits(tether, leg, limit):
            self.path, self.mode = leg[1:], NORMAL
            return True
        straight = self._straight(robot, tether, limit)
        if straight is not None:
            self.path, self.mode = straight[1:], NORMAL
            return True
        path, mode = self._detour(robot, tether, limit)
        if path is None and self.is_anchor_moving:
            self._wait(robot, tether, limit)
            return True
        if path is None:
            self._leave_out_of_reach(limit)
            return True
        better = self.refined(path)
        if better is not path and self._fits(tether, better, limit):
            path = better
        self.path, self.mode = path[1:], mode
        return True

    def _leg(self, robot: Floats, tether: Tether) -> Floats | None:
        """Return the leg of the mission's tour if robot and tether are at its beginning and it is
        free."""
        leg, meant = self._planned_leg()
        tolerance = self.predictive.tour_tolerance
        if (
            leg is None
            or np.linalg.norm(leg[0] - robot) > tolerance * self.mission.reach
            or abs(tether.length - (tether.length if meant is None else meant))
            > tolerance * (self.mission.reach + self.mission.delta)
        ):
            return None
        # the robot may be short of the end of the previous leg, and cut the corner
        for path in (np.vstack([robot, leg[1:]]), np.vstack([robot, leg])):
            if self.is_free(path[:2]) and self.is_clear_of_solids(path):
                return path
        return None

    def _planned_leg(self) -> tuple[Floats | None, float | None]:
        """Return the tour's leg to the waypoint, and the tether length at its beginning, None if
        the mission begins there."""
        tour = self.mission.tour
        if tour is None or self.track is not None:
            return None, None
        leg = np.array(tour.home) if self.is_homeward else tour.leg(self.index)
        before = min(self.index, len(tour.stops)) - 1
        return leg, None if before < 0 else tour.stops[before].tether_length

    def add_waypoint(self, waypoint: MissionWaypoint) -> None:
        """See `Planner`."""
        super().add_waypoint(waypoint)
        self._planned = -1

    def try_left_out_again(self) -> None:
        """See `Planner`."""
        if self.left_out and self.is_homeward and not self.is_done:
            self._planned = -1
        super().try_left_out_again()

    def cancel_waypoint(self, number: int) -> int | None:
        """See `Planner`; drop the tour, because its legs lead to other waypoints."""
        k = super().cancel_waypoint(number)
        if k is not None:
            self._planned = -1
            self._drop_visit(k)
        return k

    def update_limit(self, limit: float) -> None:
        """See `Planner`; if the payout is larger, the robot first goes back along its tether."""
        shorter = limit < self.mission.tether_length
        super().update_limit(limit)
        if shorter:
            self.path, self._planned = self.path[:0], -1

    def _path_to_shorten(self, tether: Tether) -> Floats | None:
        """Return the path back along a tether until it is within the limit; None if it is
        already."""
        over = self.payout(tether) - self.limit
        if over <= 0.0 or self.payout(tether) <= self.mission.tether_length:
            return None
        return polylines.part(self.back_along(tether), 0.0, over + self.mission.reach)

    def _drop_visit(self, k: int) -> None:
        """Drop the tour, because its legs would lead to other waypoints."""
        del k
        self.mission = self.mission.model_copy(update={"tour": None})

    @property
    def limit(self) -> float:
        """Length of tether that plans may use, metres."""
        margin = self.policy.preview.limit_margin
        return self.mission.tether_length * (1.0 - margin) - self._reserved

    @property
    def _reserved(self) -> float:
        """Length of tether in reserve for positions, a moving anchor and what is not on the map,
        metres."""
        unknown = 0.0 if self.mission.range_sensor is None else self.predictive.unmapped_reserve
        return self.reserve + self._anchor_reserve + self.excess_payout + unknown

    @property
    def _anchor_reserve(self) -> float:
        """Length of tether in reserve for a moving anchor, metres."""
        if self.track is None or not self.is_anchor_moving:
            return 0.0
        return self.predictive.anchor_lag_s * self.track.speed

    @property
    def _reserve_words(self) -> str:
        return f", of which {self._reserved:.2f} m are kept in reserve" if self._reserved else ""

    def _has_used_half_reserve(self, tether: Tether) -> bool:
        """Return whether half of the reserve is used up, for example by a current; true at most
        once for each waypoint."""
        margin = self.policy.preview.limit_margin
        if (
            self._warned == self.index
            or self.payout(tether) + 0.5 * self.reserve
            <= (1.0 - 0.5 * margin) * self.mission.tether_length
        ):
            return False
        self._warned = self.index
        return True

    def _is_overtaken(self, robot: Floats, tether: Tether) -> bool:
        """Return whether a moving anchor requires another plan.

        The check runs at intervals. It is true if the robot waits, or if the tether no longer lasts
        for the rest of the path.
        """
        if self.mode == WAIT and not self.is_anchor_moving:
            return True
        if not self.is_anchor_moving or self.now < self._checked + self.predictive.anchor_check_s:
            return False
        self._checked = self.now
        limit = self.limit + 0.5 * self._anchor_reserve
        return self.mode == WAIT or not self._fits(tether, np.vstack([robot, self.path]), limit)

    def _is_longer_than_planned(self, robot: Floats, tether: Tether) -> bool:
        """Return whether the tether no longer fits on the rest of the path.

        A tether may hang on an edge that it slips off in the plan, for example because the vehicle
        is beside its path. The check runs at intervals, and only near the limit: a tether grows by
        at most the distance that the robot moves.
        """
        policy = self.predictive
        if self.is_anchor_moving or self.now < self._rest_checked + policy.rest_check_s:
            return False
        self._rest_checked = self.now
        rest, limit = np.vstack([robot, self.path]), self.limit
        growth = min(polylines.length(rest), self.mission.speed * policy.rest_warning_s)
        if self.payout(tether) + growth <= limit:
            return False
        return not self._fits(tether, rest, limit)

    def _wait(self, robot: Floats, tether: Tether, limit: float) -> None:
        """Wait for an anchor that comes nearer.

        The robot holds its place while the tether lasts. Otherwise it goes back along the tether,
        which shortens it faster than the anchor can stretch it.
        """
        self.path, self.mode = robot[None], WAIT
        wait_s = 2.0 * self.predictive.anchor_check_s
        if not self._fits(tether, np.array([robot, robot]), limit, wait_s):
            distance = wait_s * self.mission.speed
            self.path = polylines.part(self.back_along(tether), 0.0, distance)[1:]

    def _visit_point(self, robot: Floats, waypoint: Floats) -> Floats:
        """Return the point on the straight path at which the waypoint counts as visited.

        The tether may fit there but not at the waypoint. A fifth of the reach is left for the
        stopping distance of the vehicle.
        """
        path = waypoint - robot
        distance = float(np.linalg.norm(path))
        return waypoint - path * min(1.0, 0.8 * self.mission.reach / max(distance, 1e-12))

    def update_map(
        self, scene: DistanceField, tethers: Tethers, box: Floats, robot: Floats, tether: Tether
    ) -> None:
        """See `Planner`; also drop a path on which the tether no longer fits."""
        super().update_map(scene, tethers, box, robot, tether)
        self._is_sure_of_home = False
        if len(self.path) and not self._fits(tether, np.vstack([robot, self.path]), self.limit):
            self.path = self.path[:0]

    def on_excess_payout(self, more: float, trail: Floats) -> None:
        """See `Planner`; drop a path that was planned for less payout."""
        if more > self._previous_excess + self.predictive.snag_tolerance:
            self._previous_excess = more
            self.path = self.path[:0]
        self._previous_excess = min(self._previous_excess, more)
        super().on_excess_payout(more, trail)

    @property
    def _model(self) -> GeodesicTether:
        assert isinstance(self.tethers, GeodesicTether)
        return self.tethers

    def warm_up(self, robot: Floats, tether: Tether) -> None:
        """See `Planner`."""
        self.prepare()
        self._shortest_feasible(robot, tether, self.limit)

    @property
    def _preview(self) -> TetherPreview:
        """Preview with the current map and time."""
        return TetherPreview(
            self.mission,
            self._model,
            self.load if self.has_load else None,
            self.track if self.is_anchor_moving else None,
            self.now,
            self.policy.preview,
            None if self._may_cut else self.policy.preview.max_cut * self.mission.delta,
        )

    @property
    def _stay_s(self) -> float:
        """Time that the robot stays at the end of the planned path, s."""
        if self.is_homeward:
            return 0.0
        waypoint = self.mission.waypoints[self.index]
        return waypoint.dwell + (0.0 if waypoint.heading is None else self.policy.max_turn_s)

    def _fits(
        self, tether: Tether, path: Floats, limit: float, stay_s: float | None = None
    ) -> bool:
        """Return whether the tether stays within the limit all along a path, and at its end."""
        preview = self._preview
        if preview.meets_solid(path):
            self._has_met_solid = True
            return False
        self._preview_count += 1
        self._previewed_length += polylines.length(path)
        return preview.fits(tether, path, limit, self._stay_s if stay_s is None else stay_s)

    def _straight(self, robot: Floats, tether: Tether, limit: float) -> Floats | None:
        """Return the straight path to the waypoint, or to where it counts as visited, if the tether
        fits."""
        far = None
        for end in (self.waypoint, self._visit_point(robot, self.waypoint)):
            path = np.array([robot, end])
            if not self.is_free(path):
                continue
            if far is None or self.is_anchor_moving:
                far, _ = self._preview.follow(tether, path, limit, self._stay_s)
            if polylines.length(path) <= far:
                return path
        return None

    def _detour(self, robot: Floats, tether: Tether, limit: float) -> tuple[Floats | None, str]:
        """Return a path on which the tether fits, and its mode: a short one, or one by the anchor.

        Only if every such path cuts into a solid, the path may, by less than would stop the robot.
        The tether may lie between solids that leave no room for the robot.
        """
        for self._may_cut in (False, True):
            self._has_met_solid = False
            path, mode = self._shortest_feasible(robot, tether, limit)
            if path is None and not self.is_anchor_moving:
                path = self._path_by_anchor(tether, limit)
            if path is not None or not self._has_met_solid:
                break
        return path, mode

    def _shortest_feasible(
        self, robot: Floats, tether: Tether, limit: float
    ) -> tuple[Floats | None, str]:
        """Return the shortest path on which the tether fits, and its mode.

        It leads on from the robot, or back along the tether to a pivot and on from there. One tree
        serves all pivots. The pivot decides the class of the tether at the waypoint, and thus its
        length there. Consecutive pivots that lead to one class are merged, and classes over the
        limit are skipped. In each other class, the whole path is pulled taut, including the part
        back along the tether: it is the shortest path of its class. If the tether is over the limit
        on it, as much of the part back along the tether as necessary is kept.
        """
        # the path back along the tether, finely divided and off surfaces; pivots are among its
        # points
        nodes = tether.nodes[::-1]
        along = polylines.along(nodes)
        retreat = polylines.points_along(nodes, self.grid.cell)
        places = np.linspace(0.0, along[-1], len(retreat))
        retreat = move_off_surfaces(
            self.scene, retreat, self.mission.clearance, self.policy.paths.standoff
        )
        pivots = np.linspace(0, len(retreat) - 1, self.predictive.max_pivots + 1)
        pivots = np.unique(pivots.round().astype(int))
        tree = self.paths(retreat[pivots])
        onward = {int(i): tree.path(n) for n, i in enumerate(pivots)}

        def taken_back(i: int) -> Floats:
            """Return the tether after the robot has followed it back to point i."""
            passed = int(np.searchsorted(along, places[i] - 1e-9, side="right"))
            return np.vstack([tether.nodes[: max(1, len(nodes) - passed)], retreat[i]])

        self._preview_count, self._previewed_length, self._candidates = 0, 0.0, []
        if onward[0] is not None:
            # if the tether fits on the shortest path of all, try no other
            path = self.pull_taut(onward[0])
            direct = Candidate(np.vstack([tether.nodes, path[1:]]), path, path)
            self._candidates.append(direct)
            if not self._exceeds_at_end(direct, limit) and self._fits(tether, path, limit):
                return path, NORMAL
        classes = []
        for last in self._classes(retreat, onward):
            on = onward[last]
            assert on is not None
            path = np.vstack([retreat[: last + 1], on[1:]])
            end_tether = np.vstack([taken_back(last), on[1:]])
            classes.append(Candidate(end_tether, path, self._roughly_pulled(path)))
        self._candidates += classes
        best: Floats | None = None
        min_length = np.inf
        for candidate in sorted(classes, key=lambda c: polylines.length(c.rough)):
            expected = self.predictive.min_pull_ratio * polylines.length(candidate.rough)
            if expected >= min_length or (best is not None and self._has_previewed_enough):
                break
            if self._exceeds_at_end(candidate, limit):
                continue
            path = self.pull_taut(candidate.rough)
            length = polylines.length(path)
            if length >= min_length:
                continue
            if self._fits(tether, path, limit):
                best, min_length = path, length
                continue
            found = self._tautest(tether, candidate.path, limit, min_length)
            if found is not None:
                best, min_length = found, polylines.length(found)
        return best, RECOVERY

    def _exceeds_at_end(self, candidate: Candidate, limit: float) -> bool:
        """Return whether the taut tether at the end of a path exceeds the limit less slack, even
        with the anchor as near as it can be by then."""
        if self.track is not None and self.is_anchor_moving:
            distance = polylines.length(candidate.rough) / self.mission.speed
            limit += self.track.distance_between(self.now, self.now + distance)
        return self._exceeds(candidate.tether, limit / (1.0 + self.mission.tether.slack))

    def _while_in_time(self, paths: Iterator[Floats]) -> Iterator[Floats]:
        """Yield paths until enough was simulated."""
        for path in paths:
            if self.options.clock is not None and self.options.clock.is_up:
                raise KeyboardInterrupt
            yield path

    @property
    def _has_previewed_enough(self) -> bool:
        """True if enough was simulated, and the best path so far is taken.

        The limits are numbers of simulations and metres, so plans are the same on every machine.
        """
        return (
            self._preview_count >= self.options.looks
            or self._previewed_length >= self.options.metres
        )

    def _tautest(
        self, tether: Tether, line: Floats, limit: float, max_length: float = np.inf
    ) -> Floats | None:
        """Return the tautest path in the class of a line on which the tether fits, by bisection.

        The candidates are ever tauter paths; the tether is the more likely to fit the less taut the
        path is. Return None if no path is shorter than `max_length`.
        """
        best = None
        paths = [
            p
            for p in self._while_in_time(self._pull_in_stages(line))
            if polylines.length(p) < max_length
        ]
        while paths and not (
            self._has_previewed_enough and (best is not None or max_length < np.inf)
        ):
            middle = len(paths) // 2
            if self._fits(tether, paths[middle], limit):
                best, paths = paths[middle], paths[middle + 1 :]
                max_length = polylines.length(best)
            else:
                paths = paths[:middle]
            min_saving = self.predictive.min_saving * max_length
            if paths and max_length - polylines.length(paths[-1]) < min_saving:
                break
        return best

    def plan_home(self, robot: Floats, tether: Tether) -> bool:
        """Plan the shortest path home on which the tether fits and comes free.

        It is in the class of the path back along the tether, and pulled as taut as both allow.
        """
        if (
            len(self.path)
            and not self._is_tether_lost(robot, tether)
            and not self._is_overtaken(robot, tether)
        ):
            return False
        self._checked, self._may_cut = self.now, False
        if self.excess_payout > self.predictive.snag_tolerance:
            back = polylines.points_along(self.trail[::-1], self.fine_spacing)
            back = np.vstack([back, self.home_tether.nodes[1:]])
            if self.scene.distance(back).min() > CONTACT_DEPTH * self.mission.delta:
                self.path, self.mode, self._is_sure_of_home = back[1:], HOME, False
                return True
        path = self._leg_home(robot, tether)
        if path is None:
            path = self._direct_home(robot, tether)
        self._is_sure_of_home = path is not None
        if path is None:
            path = self._home_along(tether)
            if self._is_narrow(path):
                as_it_came = self._home_as_it_came(robot, tether)
                path = path if as_it_came is None else as_it_came
        self.path, self.mode = path[1:], HOME
        return True

    def _leg_home(self, robot: Floats, tether: Tether) -> Floats | None:
        """Return the tour's path home, if it leads to the start of this mission, and the tether
        fits on it and comes free."""
        leg = self._leg(robot, tether)
        if leg is None or math.dist(leg[-1], self.mission.start) > self.mission.reach:
            return None
        far, end = self._preview.follow(tether, leg, self.limit, 0.0)
        return leg if np.isinf(far) and self._is_free(end) else None

    def _direct_home(self, robot: Floats, tether: Tether) -> Floats | None:
        """Return the shortest path home of all classes, if the tether comes free on it."""
        path = self.paths(robot[None]).path(0)
        if path is None:
            return None
        path = self.pull_taut(path)
        if self._exceeds(np.vstack([tether.nodes, path[1:]]), self._free_length):
            return None
        far, end = self._preview.follow(tether, path, self.limit, 0.0)
        return path if np.isinf(far) and self._is_free(end) else None

    def _home_along(self, tether: Tether) -> Floats:
        """Return the path back along the tether, pulled as far as the tether fits and comes
        free."""
        line = self.back_along(tether)
        path = self.pull_taut(line)
        for self._may_cut in (False, True):
            self._has_met_solid = self._preview.meets_solid(path)
            far, end = self._preview.follow(tether, path, self.limit, 0.0)
            if np.isinf(far):
                self._is_sure_of_home = self._is_free(end)
                break
            found = self._tautest(tether, line, self.limit)
            if found is not None or not self._has_met_solid:
                path = line if found is None else found
                self._is_sure_of_home = self._comes_free(tether, path)
                break
        else:
            path, self._is_sure_of_home = line, self._comes_free(tether, line)
        if not self._is_sure_of_home and path is not line:
            path, self._is_sure_of_home = line, self._comes_free(tether, line)
        return path

    def _home_as_it_came(self, robot: Floats, tether: Tether) -> Floats | None:
        """Return the robot's own path so far back home, pulled as far as the tether fits and comes
        free.

        A tether may hang in a gap that is too narrow for the robot, and so may a path back along
        it. Where the robot has been, it had room.

        Returns
        -------
        ndarray, shape (k, 3), or None
            The path, metres; None if it does not begin at the start of the mission, comes as near
            to solids, or does not free the tether.
        """
        if math.dist(self._places[0], self.mission.start) > self.mission.reach:
            return None
        line = np.vstack([robot, *self._places[::-1], self.home_position])
        for path in (self._tautest(tether, line, self.limit), line):
            if path is None or self._is_narrow(path):
                continue
            far, end = self._preview.follow(tether, path, self.limit, 0.0)
            if np.isinf(far) and self._is_free(end):
                self._is_sure_of_home = True
                return path
        return None

    def _is_narrow(self, path: Floats) -> bool:
        """Return whether a path comes nearer to solids than a path home should
        (`PredictivePolicy.min_home_room`)."""
        distances = self.scene.distance(polylines.points_along(path, self.fine_spacing))
        room = min(self.mission.clearance, float(distances[0]), float(distances[-1]))
        return float(distances.min()) < self.predictive.min_home_room * room

    def _is_tether_lost(self, robot: Floats, tether: Tether) -> bool:
        """Return whether the tether no longer comes free on the rest of the path home, for example
        because the vehicle cut a corner. The check runs at intervals."""
        self._home_steps += 1
        if self._home_steps % self.predictive.home_check_steps or not self._is_sure_of_home:
            return False
        return not self._comes_free(tether, np.vstack([robot, self.path]))

    def may_end(self, tether: Tether) -> bool:
        """Return whether the tether is free at home; if not, the robot goes back along it and comes
        home again."""
        policy, max_attempts = self.predictive, self.predictive.max_home_attempts
        if self.excess_payout > policy.snag_tolerance and self._homes < max_attempts:
            self._homes += 1
            return False
        home_tether = self._model.update(self.home_tether, tether.robot)
        length = self._model.relaxed(tether.nodes, policy.release_rounds).length
        free_length = home_tether.length + self.policy.free_tolerance * self.mission.delta
        if length <= free_length or self._homes >= max_attempts:
            return True
        self._homes += 1
        return False

    def _comes_free(self, tether: Tether, path: Floats) -> bool:
        """Return whether the tether lies at the end of a path as at the start of the mission."""
        points = polylines.dense(path, 5.0 * self.grid.cell)
        return self._is_free(self._model.drive(tether, points)[0])

    def _is_free(self, tether: Tether) -> bool:
        """Return whether a tether at home comes to lie as at the start of the mission."""
        rounds = self.predictive.release_rounds
        return self._model.relaxed(tether.nodes, rounds).length <= self._free_length

    @property
    def _free_length(self) -> float:
        """Length up to which a tether is free at home, metres."""
        return self.home_tether.length + self.policy.free_tolerance * self.mission.delta

    def _roughly_pulled(self, path: Floats) -> Floats:
        mission = self.mission
        return pull_roughly_taut(
            self.scene, path, mission.clearance, mission.delta, self.policy.paths
        )

    def _pull_in_stages(self, path: Floats) -> Iterator[Floats]:
        mission = self.mission
        return pull_in_stages(self.scene, path, mission.clearance, mission.delta, self.policy.paths)

    def _classes(self, retreat: Floats, onward: Mapping[int, Floats | None]) -> list[int]:
        """Return the last pivot of each run of pivots that lead to paths of one class."""
        out: list[int] = []
        pivots = list(onward)
        for i, j in zip(pivots, [*pivots[1:], None], strict=True):
            path, after = onward[i], None if j is None else onward[j]
            if path is not None and (
                j is None
                or after is None
                or not are_homotopic(
                    self.scene, path, np.vstack([retreat[i : j + 1], after[1:]]), self.grid.cell
                )
            ):
                out.append(i)
        return out

    def _exceeds(self, line: Floats, limit: float) -> bool:
        """Return whether a tether along a line probably exceeds a limit even when taut.

        The prediction assumes that each pull shortens the tether by less than the one before.
        """
        policy = self.predictive
        tether = self._model.relaxed(line, policy.pull_rounds)
        length, decrease = tether.length, np.inf
        for _ in range(policy.max_pulls):
            if length <= limit:
                return False
            tether = self._model.relaxed(tether.nodes, policy.pull_rounds)
            before, decrease, length = decrease, length - tether.length, tether.length
            ratio = min(decrease / before, 0.95) if before > 0.0 else 0.0
            if length - policy.pull_allowance * decrease * ratio / (1.0 - ratio) > limit:
                break
        return length > limit

    def _path_by_anchor(self, tether: Tether, limit: float) -> Floats | None:
        """Return a path back to the anchor and on beside the shortest known tether to the waypoint;
        None if the tether does not fit on it either."""
        shortest, near = self._shortest_tether(limit), 0.8 * self.mission.reach
        self._shortest = shortest
        if shortest is None or self.payout(shortest) - near > limit:
            return None
        path = np.vstack(
            [self.off_surfaces(tether.nodes[::-1]), self.off_surfaces(shortest.nodes)[1:]]
        )
        for short in (0.0, near):
            part = polylines.part(path, 0.0, polylines.length(path) - short)
            if self._fits(tether, part, limit):
                return part
        return None

    def _leave_out_of_reach(self, limit: float) -> None:
        """Leave out the waypoint after `_detour` has found no path, with the reason."""
        if self._shortest is None:
            self.leave_out("no free path to it")
            return
        needs = self.payout(self._shortest)
        limits = f"the limit is {self.mission.tether_length:g} m{self._reserve_words}"
        self.leave_out(
            f"out of reach: it needs {needs:.2f} m of tether, {limits}"
            if needs - 0.8 * self.mission.reach > limit
            else f"no path found on which the tether fits, though {needs:.2f} m would do; {limits}"
        )

    def _shortest_tether(self, limit: float) -> Tether | None:
        """Return the shortest tether at the waypoint among the classes of the last search."""
        found: list[Tether] = []
        policy = self.predictive
        for candidate in self._candidates:
            roughly = self._model.relaxed(candidate.tether, policy.max_pulls * policy.pull_rounds)
            is_far_over = roughly.length > policy.max_overrun * limit and bool(found)
            found.append(roughly if is_far_over else self._model.refine(roughly))
        return min(found, key=lambda t: t.length, default=None)

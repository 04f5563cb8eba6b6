"""Planner `repair`: flies the planned tour in space, and repairs it when the map changes.

The rest of the tour still holds if its paths keep off solids, the tether fits on them, and it comes
home free. If not, `netsp.online.execute.repair_rule` decides what is done. In the same order the
robot takes the shortest paths around the obstacles.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError, LimitReachedError, is_interrupt
from netsp.base.field_types import Point3
from netsp.base.geometry import polylines
from netsp.online.execute.repair_rule import BY_LEGS, KEPT, choose_repair
from netsp.plan.space.mission_policy import MissionPolicy
from netsp.plan.space.planning_context import DIP_RATIO, drive_step
from netsp.plan.space.space_plan import SpacePlan, plan
from netsp.world.mission.mission import Mission, MissionState, MissionWaypoint
from netsp.world.mission.planned_tour import PlannedTour, PlannedVisit, thinned_path
from netsp.world.paths.tree import ShortestTree
from netsp.world.planner.planner import HOLD, Command, Tethers
from netsp.world.planner.predictive import PredictivePlanner
from netsp.world.scene.field import DistanceField, pushed_out
from netsp.world.tether import Tether


@dataclass(frozen=True)
class Repair:
    """Repair of the rest of a tour.

    Attributes
    ----------
    time
        Seconds since the start.
    waypoint
        Number of the next waypoint.
    response
        Response: kept, local, replan or legs.
    reason
        Reason for it.
    length
        Planned length of the rest, metres; 0 if no tour was found.
    planning_s
        CPU seconds that the repair took.
    """

    time: float
    waypoint: int
    response: str
    reason: str
    length: float
    planning_s: float


def _name_gaps(found: SpacePlan) -> str:
    """Return words for the gaps that the grid of a plan does not show."""
    gaps = found.context.unresolved_gaps
    if not gaps:
        return ""
    named = ", ".join(str(gap) for gap in gaps)
    return f"; no tour through gaps that the cells do not show was considered: {named}"


@dataclass
class _RemainingTour:
    """Rest of a tour by the present map.

    Attributes
    ----------
    legs
        Path and tether length at its end of each leg, the path home last.
    visited, blocked
        Numbers of the waypoints that it visits, and of waypoints with solids on them.
    is_complete
        Whether all legs are known.
    planned_length
        Length of the rest as planned, metres.
    reason
        Reason why the planned tour does not hold; None if it does.
    """

    legs: list[tuple[Floats, float]] = field(default_factory=list)
    visited: list[int] = field(default_factory=list)
    blocked: list[int] = field(default_factory=list)
    is_complete: bool = True
    planned_length: float = 0.0
    reason: str | None = None

    @property
    def length(self) -> float:
        """Return the length of the legs, metres."""
        return float(sum(polylines.length(leg) for leg, _ in self.legs))


@dataclass
class RepairPlanner(PredictivePlanner):
    """`PredictivePlanner` that plans the rest of a tour as a whole."""

    repairs: list[Repair] = field(default_factory=list)
    mission_policy: MissionPolicy = field(default_factory=MissionPolicy)
    _must_check: bool = False
    _hold_until_s: float = -np.inf
    # positions of the robot since the last visit
    _walked_on_leg: list[Floats] = field(default_factory=list)
    # number of the waypoint to which a repaired leg leads, and its path from where it was repaired
    _first_leg: tuple[int, Floats] | None = None
    # reason for a new plan that visits more waypoints than the tour; None if there is none
    _more_to_visit: str | None = None
    # mission in the order of its file
    _as_given: Mission | None = None

    name = "repair"

    def __post_init__(self) -> None:
        """See `Planner`."""
        super().__post_init__()
        self._as_given = self.mission

    def update_map(
        self, scene: DistanceField, tethers: Tethers, box: Floats, robot: Floats, tether: Tether
    ) -> None:
        """See `Planner`."""
        super().update_map(scene, tethers, box, robot, tether)
        self._must_check = self.mission.tour is not None

    def step(self, robot: Floats, tether: Tether) -> Command:
        """See `Planner`. The robot holds its place until a plan is due, even if it is ready
        earlier, so that the same seed gives the same flight."""
        self._walked_on_leg.append(np.array(robot))
        if self._must_check and not self.is_done and self._path_to_shorten(tether) is None:
            self._must_check = False
            begin = time.process_time()
            try:
                self._check_and_repair(robot, tether)
            except Exception as error:  # never leave a vehicle without a command
                if is_interrupt(error):
                    raise KeyboardInterrupt from error
                return self._hold(robot, error, time.process_time() - begin)
            spent = time.process_time() - begin
            if self.now < self._hold_until_s:
                return Command(robot[None], HOLD, spent)
        if self.now < self._hold_until_s:
            return Command(robot[None], HOLD)
        return super().step(robot, tether)

    def add_waypoint(self, waypoint: MissionWaypoint) -> None:
        """See `Planner`."""
        super().add_waypoint(waypoint)
        if self.mission.tour is not None:
            self._must_check = True
            self._more_to_visit = f"waypoint #{max(self.given)} was added"

    def try_left_out_again(self) -> None:
        """See `Planner`."""
        if self.left_out and not self.is_done and self.mission.tour is not None:
            numbers = ", ".join(f"#{self.given[k]}" for k, _ in self.left_out)
            self._must_check = True
            self._more_to_visit = f"waypoints that were left out may be in reach now: {numbers}"
        super().try_left_out_again()

    def _drop_visit(self, k: int) -> None:
        """Join the legs before and after a visit that is left out, pulled taut in their class."""
        tour = self.mission.tour
        if tour is None or k >= len(tour.stops):
            return
        stops, path = list(tour.stops), np.array(tour.stops[k].path)
        if self._first_leg is not None and self._first_leg[0] == k:
            path = self._first_leg[1]
        del stops[k]
        onward = tour.home if k == len(stops) else stops[k].path
        leg = thinned_path(self.pull_taut(np.vstack([path, np.array(onward)])))
        self._first_leg = (k, np.array(leg)) if k == self.index else self._first_leg
        home = tour.home
        if k == len(stops):
            home = leg
        else:
            stops[k] = stops[k].model_copy(update={"path": leg})
        self.mission = self.mission.model_copy(
            update={"tour": tour.model_copy(update={"stops": tuple(stops), "home": home})}
        )
        self._must_check = True

    def update_limit(self, limit: float) -> None:
        """See `Planner`."""
        super().update_limit(limit)
        self._must_check = self.mission.tour is not None

    def on_push(self) -> None:
        """See `Planner`."""
        super().on_push()
        self._must_check, self._planned = self.mission.tour is not None, -1

    def _next(self) -> None:
        super()._next()
        self._walked_on_leg = self._walked_on_leg[-1:]

    def _check_and_repair(self, robot: Floats, tether: Tether) -> None:
        """Check the rest of the tour, and repair it if it no longer holds."""
        begin = time.process_time()
        rest = self._remaining_tour(robot, tether)
        if rest is None:
            return
        if self._more_to_visit is not None:
            rest.reason = self._more_to_visit
        if rest.reason is None:
            self._note(KEPT, "the rest of the tour still holds", rest.length, begin)
            return
        min_worthwhile_length = (
            rest.planned_length + self.options.planning_limit * self.mission.speed
        )
        added, self._more_to_visit = self._more_to_visit is not None, None
        is_worthwhile = added or not rest.is_complete or rest.length > min_worthwhile_length
        is_worthwhile &= not self.is_homeward
        response, chosen = choose_repair(
            rest if rest.is_complete else None,
            lambda: self._replan(robot, tether, rest, added) if is_worthwhile else None,
            BY_LEGS,
        )
        if isinstance(chosen, SpacePlan):
            self._follow_plan(chosen)
            self._note(response, f"{rest.reason}{_name_gaps(chosen)}", chosen.length, begin)
        elif chosen is not None:
            self._follow_rest(chosen)
            self._note(response, rest.reason, chosen.length, begin)
        else:
            self._note(response, f"{rest.reason}, and no tour was found", 0.0, begin)

    def _note(self, response: str, reason: str, length: float, begin: float) -> None:
        """Record a repair."""
        spent = time.process_time() - begin
        self.repairs.append(Repair(self.now, self.index, response, reason, length, spent))

    def _remaining_tour(self, robot: Floats, tether: Tether) -> _RemainingTour | None:
        """Return the rest of the tour by the map, with paths around obstacles; None beyond the
        tour."""
        tour = self.mission.tour
        assert tour is not None
        if self.index > len(tour.stops):
            return None  # only waypoints that the tour leaves out remain
        rest, place = _RemainingTour(), robot
        for k in range(self.index, len(tour.stops) + 1):
            is_home = k == len(tour.stops)
            name = "the way home" if is_home else f"the way to waypoint #{k}"
            planned = np.array(tour.home if is_home else tour.stops[k].path)
            rest.planned_length += polylines.length(planned)
            if not is_home and self._is_lost(k):
                rest.reason = rest.reason or f"a solid stands on waypoint #{k}"
                rest.blocked.append(k)
                continue
            leg: Floats | None = np.vstack([place, planned])
            if k == self.index:
                leg = np.vstack([robot, self.path]) if len(self.path) else self._leg(robot, tether)
            tether_after, obstacle = self._drive_leg(tether, leg, name)
            if tether_after is None:
                rest.reason = rest.reason or obstacle
                leg = self._path_around(place, planned[-1])
                tether_after, _ = self._drive_leg(tether, leg, name)
            if tether_after is not None and is_home and not self._is_free(tether_after):
                rest.reason = rest.reason or "the tether would not be free at home"
                leg = self.pull_taut(self.back_along(tether))
                tether_after, _ = self._drive_leg(tether, leg, name)
                if tether_after is not None and not self._is_free(tether_after):
                    tether_after = None
            if tether_after is None or leg is None:
                rest.is_complete = False
                break
            tether, place = tether_after, leg[-1]
            rest.legs.append((leg, tether.length))
            rest.visited += [] if is_home else [k]
        return rest

    def _path_around(self, begin: Floats, end: Floats) -> Floats | None:
        """Return the shortest path by the map, pulled taut; None if there is none."""
        path = ShortestTree(self.grid, end, begin[None]).path(0)
        return None if path is None else self.pull_taut(path)

    def _drive_leg(
        self, tether: Tether, leg: Floats | None, name: str
    ) -> tuple[Tether | None, str]:
        """Return the tether at the end of a leg; None, and the reason, if the robot cannot follow
        it."""
        if leg is None or not self.is_clear_of_solids(leg):
            return None, f"{name} is blocked"
        step = drive_step(self.mission, self.mission_policy.tether_share)
        tether_after, lengths = self._model.drive(tether, polylines.dense(leg, step))
        longest = float(lengths.max(initial=0.0))
        if longest > self.limit:
            return None, (
                f"on {name} {longest:.2f} m of tether would be out, of "
                f"{self.mission.tether_length:g}"
            )
        return tether_after, ""

    def _replan(
        self, robot: Floats, tether: Tether, rest: _RemainingTour, added: bool
    ) -> SpacePlan | None:
        """Return a new tour of the rest that visits more waypoints or is shorter; None if none is
        found."""
        self._hold_until_s = self.now + self.options.planning_limit
        if all(self._is_lost(k) for k in self._left):
            return None
        try:
            found = self._plan_rest(robot, tether)
        except (InputError, LimitReachedError):
            return None
        visits_more = added and len(found.order) > len(rest.visited)
        return (
            None if rest.is_complete and rest.length <= found.length and not visits_more else found
        )

    def _plan_rest(self, robot: Floats, tether: Tether) -> SpacePlan:
        """Plan a tour from the robot's position through the remaining waypoints, by the map."""
        mission = self.mission
        free_place = pushed_out(self.scene, robot[None], 1e-3)[0] if self._inside(robot) else robot
        line = np.vstack([tether.nodes[:-1], free_place])
        state = MissionState(position=thinned_path(free_place[None])[0], tether=thinned_path(line))
        rest_of_mission = mission.model_copy(
            update={
                "state": state,
                "tour": None,
                "waypoints": tuple(
                    mission.waypoints[k] for k in self._left if not self._is_lost(k)
                ),
                "tether_length": self.limit,
            }
        )
        return plan(
            rest_of_mission,
            field=self.scene,
            grid=self.grid,
            time_limit=self.options.planning_limit,
            seed=self.options.seed,
            policy=self.mission_policy,
        )

    def _inside(self, place: Floats) -> bool:
        """Return whether a place is inside a solid, or touches one."""
        return float(self.scene.distance(place)) < DIP_RATIO * self.mission.delta

    @property
    def _left(self) -> range:
        """Return the numbers of the remaining waypoints."""
        return range(self.index, len(self.mission.waypoints))

    def _is_lost(self, k: int) -> bool:
        """Return whether a solid stands on a waypoint."""
        return self._inside(self.mission.places[k])

    def _follow_plan(self, found: SpacePlan) -> None:
        """Follow a new tour; the remaining waypoints come in its order from now on."""
        planned_mission = found.to_mission(seed=self.options.seed)
        assert planned_mission.tour is not None
        free_waypoints = [k for k in self._left if not self._is_lost(k)]
        lost = [k for k in self._left if self._is_lost(k)]
        remaining = [*(free_waypoints[n] for n in found.all_waypoints), *lost]
        waypoints = (*planned_mission.waypoints, *(self.mission.waypoints[k] for k in lost))
        self._splice(
            planned_mission.tour,
            planned_mission.tour.stops,
            planned_mission.tour.home,
            waypoints,
            remaining,
        )

    def _follow_rest(self, rest: _RemainingTour) -> None:
        """Follow the same tour, around the obstacles."""
        tour = self.mission.tour
        assert tour is not None
        visits = tuple(
            tour.stops[k].model_copy(update={"path": thinned_path(path), "tether_length": length})
            for k, (path, length) in zip(rest.visited, rest.legs, strict=False)
        )
        beyond = range(max(self.index, len(tour.stops)), len(self.mission.waypoints))
        remaining = [*rest.visited, *rest.blocked, *beyond]
        waypoints = tuple(self.mission.waypoints[k] for k in remaining)
        self._splice(tour, visits, thinned_path(rest.legs[-1][0]), waypoints, remaining)

    def _splice(
        self,
        tour: PlannedTour,
        stops: tuple[PlannedVisit, ...],
        home: tuple[Point3, ...],
        waypoints: tuple[MissionWaypoint, ...],
        left: list[int],
    ) -> None:
        """Replace the rest of the tour by visits of the waypoints whose present numbers are `left`.

        In the file of the tour, the first leg begins at the last visit.
        """
        old_tour, begin = self.mission.tour, self.index
        file = self._as_given
        assert file is not None
        assert file.tour is not None
        numbers = dict(enumerate(stop.given_as for stop in file.tour.stops))
        self.given = [*self.given[:begin], *(self.given[k] for k in left)]
        assert old_tour is not None
        stops = tuple(
            stop.model_copy(update={"given_as": numbers.get(self.given[begin + k])})
            for k, stop in enumerate(stops)
        )
        self._first_leg = (begin, np.array(stops[0].path if stops else home))
        walked = thinned_path(np.vstack([np.array(self._walked_on_leg), self._first_leg[1]]))
        if stops:
            stops = (stops[0].model_copy(update={"path": walked}), *stops[1:])
        else:
            home = walked
        self.mission = self.mission.model_copy(
            update={
                "waypoints": (*self.mission.waypoints[:begin], *waypoints),
                "tour": tour.model_copy(
                    update={"stops": (*old_tour.stops[:begin], *stops), "home": home}
                ),
            }
        )
        self.path, self._planned = self.path[:0], -1

    def _planned_leg(self) -> tuple[Floats | None, float | None]:
        if self._first_leg is not None and self._first_leg[0] == self.index:
            return self._first_leg[1], None
        return super()._planned_leg()

    def summary_fields(self) -> dict[str, Any]:
        """See `Planner`: all repairs, and the original numbers of the waypoints."""
        return {"repairs": [asdict(r) for r in self.repairs], "given_as": self.given}

    @property
    def flown(self) -> Mission:
        """See `Planner`: the mission without a tour that its waypoints do not lie on, as when
        waypoints were left out before the tour was planned again."""
        m = self.mission if self.mission.waypoints else self._as_given
        assert m is not None
        if m.tour is not None and m.tour.mismatch(m.begin, m.start, m.places, m.reach):
            return m.model_copy(update={"tour": None})
        if m.tour is not None and self.repairs and self._first_leg is not None:
            return m.model_copy(update={"tour": m.tour.without_bounds()})
        return m

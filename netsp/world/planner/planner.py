"""Base of all planners: the waypoints, the progress of the robot, and the path that it follows."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.clock import Clock
from netsp.base.compiled.kernel import runs_compiled
from netsp.base.deprecated import deprecated_method
from netsp.base.errors import is_interrupt
from netsp.base.geometry import polylines
from netsp.world.mission.anchor_track import AnchorTrack
from netsp.world.mission.mission import Mission, MissionWaypoint
from netsp.world.paths.refine import RefineParams, refined, stepped
from netsp.world.paths.sampled import SampledPaths
from netsp.world.paths.standoff import move_off_surfaces
from netsp.world.paths.tree import Grid, Paths, ShortestTree, grow, pull_taut
from netsp.world.planner.planner_policy import PlannerPolicy
from netsp.world.scene.field import DistanceField
from netsp.world.tether import GeodesicTether, ReactTether, Tether
from netsp.world.tether.load import Load, payout, payout_along
from netsp.world.tether.tether_policy import THINNEST

Tethers = GeodesicTether | ReactTether

# modes of a planner, see `Command`
NORMAL = "normal"
RECOVERY = "recovery"
WAIT = "wait"
DWELL = "dwell"
HOME = "home"
HOLD = "hold"
DONE = "done"


@dataclass(frozen=True)
class Command:
    """Command of a planner to the robot.

    Parameters
    ----------
    path : ndarray, shape (k, 3)
        Points to pass in this order, metres.
    mode : {"normal", "recovery", "wait", "dwell", "home", "hold", "done"}
        Activity of the robot.
    replan_s : float
        CPU time of planning in this step, s.
    """

    path: Floats
    mode: str
    replan_s: float = 0.0


@dataclass(frozen=True)
class PlannerOptions:
    """Options of the search for paths.

    Parameters
    ----------
    paths : str
        ``tree``, or one of OMPL's planners (`netsp.world.paths.sampled`).
    refine : {"none", "paper", "gradient"}, optional
        Refinement of paths, see `netsp.world.paths.refine`; by default `paper` for the paper's
        planners and `none` for the others, whose paths keep the clearance from the start.
    seed : int
        Seed of sampling and refinement.
    refine_params : RefineParams
        Options of the paper's refinement.
    pivot_spacing : float, optional
        Distance between pivots along a tether for the paper's planners, metres; more than 0. By
        default 0.25 m, or one cell if a cell is larger.
    looks : int
        Maximum number of simulations ahead for one plan of `predictive`, which then takes the best
        path so far, or, if there is none, the next that it finds.
    metres : float
        Maximum total length of the paths of these simulations, metres, with the same effect.
    planning_limit : float
        Time that `repair` may take to plan the rest of a tour, s, while the robot holds its place.
    prepared : bool
        Whether to find shortest paths to all waypoints before the mission, which takes seconds if
        there are many. Otherwise, and if kernels are interpreted, each is found when needed.
    clock : Clock, optional
        Clock that ends planning and the mission when it is up, as Ctrl-C does.
    policy : PlannerPolicy
        Thresholds of the planners.
    """

    paths: str = "tree"
    refine: str | None = None
    seed: int = 0
    refine_params: RefineParams = field(default_factory=RefineParams)
    pivot_spacing: float | None = None
    looks: int = 10
    metres: float = 15.0
    planning_limit: float = 10.0
    prepared: bool = True
    clock: Clock | None = None
    policy: PlannerPolicy = PlannerPolicy()


@dataclass
class Planner:
    """Planner that follows the waypoints of a mission, and base of all others.

    Parameters
    ----------
    mission : Mission
        The mission, with the events so far.
    scene : DistanceField
        The map.
    tethers : TetherModel
        The planner's tether model.
    grid : Grid
        The grid on which paths are searched.
    options : PlannerOptions
        Options of path search.
    laid : Tether
        The tether when the mission began.
    index : int
        Index of the next waypoint; the number of waypoints on the way home.
    mode : str
        See `Command`.
    path : ndarray, shape (k, 3)
        The path that is followed.
    left_out : list of (int, str)
        Waypoints left out, with the reason.
    defects : list of str
        Errors of planning that should never happen.
    reached : list of int
        Waypoints visited.
    home : bool
        Whether the robot is back at the start.
    home_failure : str or None
        Reason why the robot cannot get home.
    now : float
        Time since the start, s; the simulator updates it.
    excess_payout : float
        Length of tether that is out beyond what the map explains, metres.
    trail : ndarray, shape (n, 3)
        Line along which the tether was laid, metres, if known.
    given : list of int
        Number of each waypoint in the original mission; waypoints that were added follow.
    """

    mission: Mission
    scene: DistanceField
    tethers: Tethers
    grid: Grid
    options: PlannerOptions = field(default_factory=PlannerOptions)
    laid: Tether | None = None
    index: int = 0
    mode: str = NORMAL
    path: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    left_out: list[tuple[int, str]] = field(default_factory=list)
    defects: list[str] = field(default_factory=list)
    reached: list[int] = field(default_factory=list)
    home: bool = False
    home_failure: str | None = None
    now: float = 0.0
    excess_payout: float = 0.0
    trail: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    given: list[int] = field(default_factory=list)
    _held: int = 0
    # places where the robot has been, half a cell apart
    _places: list[Floats] = field(default_factory=list)

    name = "none"
    refine = "none"

    @property
    def policy(self) -> PlannerPolicy:
        """Thresholds of the planner."""
        return self.options.policy

    @cached_property
    def load(self) -> Load:
        """Load on the tether: the steady current, and gusts of three standard deviations from any
        side."""
        load = self.mission.tether.load(np.array(self.mission.current))
        return load._replace(gusts=3.0 * self.mission.gusts)

    @cached_property
    def reserve(self) -> float:
        """Length of tether kept for errors of the position, metres."""
        return self.mission.sensor.reserve(self.mission.speed)

    @property
    def has_load(self) -> bool:
        """True if the tether needs more than its taut length, or has a limit of turning."""
        physics = self.mission.tether
        return physics.slack > 0.0 or physics.diameter > 0.0 or math.isfinite(physics.max_turning)

    def payout(self, tether: Tether) -> float:
        """Return the payout of a tether, metres: the length that must be out. The limit applies to
        it."""
        if not self.has_load:
            return tether.length
        if isinstance(self.tethers, GeodesicTether):
            return payout(tether, self.load)
        return payout_along(tether.nodes, self.load)

    def __post_init__(self) -> None:
        """Number the waypoints."""
        self.given = list(range(len(self.mission.waypoints)))

    def add_waypoint(self, waypoint: MissionWaypoint) -> None:
        """Add a waypoint, to be visited after all others."""
        if self.is_done:
            return
        if self.is_homeward:
            self.path, self.mode = self.path[:0], NORMAL
        self.given.append(max(self.given, default=-1) + 1)
        waypoints = (*self.mission.waypoints, waypoint)
        self.mission = self.mission.model_copy(update={"waypoints": waypoints})

    def cancel_waypoint(self, number: int) -> int | None:
        """Cancel a waypoint by the number it was given, if it is still to be visited.

        Returns
        -------
        int or None
            The waypoint's present number; None if the robot has been there.
        """
        # a waypoint that was left out and is tried again occurs twice
        k = max((k for k, given in enumerate(self.given) if given == number), default=-1)
        if k < self.index or self.is_done:
            return None
        del self.given[k]
        waypoints = (*self.mission.waypoints[:k], *self.mission.waypoints[k + 1 :])
        self.mission = self.mission.model_copy(update={"waypoints": waypoints})
        if k == self.index:
            self.path, self.mode = self.path[:0], NORMAL
        return k

    def update_limit(self, limit: float) -> None:
        """Set the limit of the tether, metres, from now on.

        With a longer tether, waypoints that were left out are tried again.
        """
        is_longer = limit > self.mission.tether_length
        self.mission = self.mission.model_copy(update={"tether_length": limit})
        if is_longer:
            self.try_left_out_again()

    def try_left_out_again(self) -> None:
        """Visit the waypoints that were left out after all others, because the map or the limit has
        changed to their advantage.

        They keep the numbers that they were given. Nothing happens once the robot is home.
        """
        if self.is_done or not self.left_out:
            return
        again = [k for k, _ in self.left_out]
        if self.is_homeward:
            self.path, self.mode = self.path[:0], NORMAL
        self.left_out = []
        self.given += [self.given[k] for k in again]
        waypoints = (*self.mission.waypoints, *(self.mission.waypoints[k] for k in again))
        self.mission = self.mission.model_copy(update={"waypoints": waypoints})

    def on_push(self) -> None:
        """Forget the path, because the robot was carried off it."""
        self.path = self.path[:0]

    @property
    def flown(self) -> Mission:
        """The mission as it was flown, for a file."""
        return self.mission

    def summary_fields(self) -> dict[str, Any]:
        """Return what the planner adds to the summary of a run."""
        changed = self.given != list(range(len(self.given)))
        return {"given_as": self.given} if changed else {}

    @property
    def waypoint(self) -> Floats:
        """Position (3,) of the next waypoint, or of home."""
        return self.home_position if self.is_homeward else self.mission.places[self.index]

    @cached_property
    def track(self) -> AnchorTrack | None:
        """Track of a moving anchor."""
        return AnchorTrack.for_mission(self.mission)

    @property
    def is_anchor_moving(self) -> bool:
        """True if the anchor still moves."""
        return self.track is not None and self.now < self.track.end

    @property
    def home_position(self) -> Floats:
        """Position (3,) of home, metres: the start, unless the anchor moves.

        With a moving anchor, home keeps the distance from the anchor that the start had, if it is
        in free water and in sight of the anchor; otherwise home is at the anchor.
        """
        start = np.array(self.mission.start)
        if self.track is None:
            return start
        anchor = self.track(self.now)
        home = anchor + start - np.array(self.mission.anchor)
        room = min(self.mission.clearance, float(self.scene.distance(start)))
        free = self.scene.distance(home) >= room and self.scene.line_of_sight(anchor, home)
        return home if free else anchor

    @property
    def home_tether(self) -> Tether:
        """The tether as it should lie at home."""
        assert self.laid is not None
        if self.track is None:
            return self.laid
        return self.tethers.start(self.track(self.now), self.home_position)

    @property
    def is_homeward(self) -> bool:
        """True if all waypoints are visited or left out, so that only the path home remains."""
        return self.index >= len(self.mission.waypoints)

    @property
    def is_done(self) -> bool:
        """True if the robot is home, or cannot get there."""
        return self.index > len(self.mission.waypoints)

    def step(self, robot: Floats, tether: Tether) -> Command:
        """Return the next command for a robot at a position (3,) with the modelled tether.

        The method never raises. If no plan is found, the robot holds its place, or leaves out the
        waypoint and logs the reason.
        """
        if not self._places or math.dist(robot, self._places[-1]) >= 0.5 * self.grid.cell:
            self._places.append(np.array(robot))
        self._advance(robot, tether)
        self._follow_home(robot)
        if self.is_done:
            return Command(np.array([robot]), DONE)
        begin = time.process_time()
        planned, before = False, -1
        while not self.is_done and before < len(self.left_out):
            before = len(self.left_out)
            try:
                plan = self.plan_home if self.is_homeward else self.plan
                planned = plan(robot, tether) or planned
            except Exception as error:  # a vehicle in the water must not be left without a command
                if is_interrupt(error):
                    raise KeyboardInterrupt from error
                return self._hold(robot, error, time.process_time() - begin)
        spent = time.process_time() - begin if planned else 0.0
        if self.is_done:
            return Command(np.array([robot]), DONE, spent)
        return Command(self.path if len(self.path) else np.array([robot]), self.mode, spent)

    def update_map(
        self, scene: DistanceField, tethers: Tethers, box: Floats, robot: Floats, tether: Tether
    ) -> None:
        """Set the map from now on, and drop the path if it is no longer clear of solids.

        Parameters
        ----------
        scene, tethers : DistanceField, TetherModel
            The map, and the tether model in it.
        box : ndarray, shape (2, 3)
            Box that contains all changes of the map, metres.
        robot : ndarray, shape (3,)
            Position of the robot, metres.
        tether : Tether
            The tether in the new map.
        """
        del tether
        self.scene, self.tethers, self.grid = scene, tethers, self.grid.with_changed_box(scene, box)
        if len(self.path) and not self.is_clear_of_solids(np.vstack([robot, self.path])):
            self.path = self.path[:0]

    def is_clear_of_solids(self, path: Floats) -> bool:
        """Return whether a path (k, 3) from the robot is clear of all solids of the map.

        It must keep most of the clearance, or of the distance that its ends have.
        """
        line = polylines.dense(path, 0.5 * self.grid.cell)
        room = min(self.mission.clearance, float(self.scene.distance(path[[0, -1]]).min()))
        needed = self.policy.min_clearance_share * room
        return not len(line) or bool(self.scene.distance(line).min() >= needed)

    def on_excess_payout(self, more: float, trail: Floats) -> None:
        """Note that more tether is out than the map explains, because something unmapped has caught
        it.

        Parameters
        ----------
        more : float
            Excess length, metres.
        trail : ndarray, shape (n, 3)
            Line from the anchor to the robot along which the tether was laid: going back along it
            frees the tether.
        """
        self.excess_payout, self.trail = more, trail

    @property
    def _author(self) -> str:
        """Name of the program to which a defect is put down: netsp, or a planner of somebody
        else."""
        is_ours = type(self).__module__.partition(".")[0] == "netsp"
        return "netsp" if is_ours else f"planner {self.name!r}"

    def _hold(self, robot: Floats, error: Exception, spent: float) -> Command:
        """Return a command to stay and try again; leave the waypoint out after a while."""
        self._held += 1
        self.defects.append(f"{type(error).__name__}: {error}")
        if self._held > self.policy.max_holds:
            self.leave_out(f"a defect of {self._author} ended planning ({self.defects[-1]})")
        return Command(np.array([robot]), HOLD, spent)

    def warm_up(self, robot: Floats, tether: Tether) -> None:
        """Load compiled kernels, so that the first plan takes no longer than the others."""
        del tether
        self.prepare()
        path = self.paths(robot[None]).path(0)
        if path is not None:
            self.pull_taut(path)

    def prepare(self) -> None:
        """Find the shortest paths to all waypoints, and home, before the mission.

        Do nothing if kernels are interpreted: finding only the paths that are needed is faster.
        """
        if self.options.paths == "tree" and self.options.prepared and runs_compiled(grow):
            home = [] if self.track is not None else [np.array(self.mission.start)]
            self.grid.prepare([*self.mission.places, *home])

    def plan(self, robot: Floats, tether: Tether) -> bool:
        """Set `path` and `mode`; this base class goes straight to the waypoint and ignores the
        tether.

        Returns
        -------
        bool
            Whether anything had to be planned.
        """
        del tether
        return False if len(self.path) else self.plan_direct(robot)

    def plan_home(self, robot: Floats, tether: Tether) -> bool:
        """Set `path` and `mode` after the last waypoint; this base class goes straight to the
        start.

        Returns
        -------
        bool
            Whether anything had to be planned.
        """
        del tether
        if len(self.path):
            return False
        planned = self.plan_direct(robot)
        self.mode = HOME
        return planned

    def may_end(self, tether: Tether) -> bool:
        """Return whether the mission may end now that the robot is home; otherwise the path home is
        planned again."""
        del tether
        return True

    def back_along(self, tether: Tether) -> Floats:
        """Return the path (k, 3) back along a tether to the anchor, and along the first tether to
        the start. At its end the tether is free."""
        return self.off_surfaces(np.vstack([tether.nodes[::-1], self.home_tether.nodes[1:]]))

    def off_surfaces(self, line: Floats) -> Floats:
        """Return a finely divided line (k, 3) moved off surfaces to the clearance."""
        points = polylines.points_along(line, self.fine_spacing)
        standoff = self.policy.paths.standoff
        return move_off_surfaces(self.scene, points, self.mission.clearance, standoff)

    @property
    def fine_spacing(self) -> float:
        """Distance between points of a path back along a tether, metres; the tether model may miss
        solids that are thinner than twice this distance."""
        return min(self.grid.cell, 0.5 * THINNEST * self.mission.delta)

    def plan_direct(self, robot: Floats) -> bool:
        """Plan a straight path to the waypoint, or the shortest path around solids in between.

        Returns
        -------
        bool
            Whether a path had to be searched.
        """
        straight = np.array([robot, self.waypoint])
        if self.is_free(straight):
            self.path = straight[1:]
            return False
        path = self.paths(robot[None]).path(0)
        if path is None:
            self.leave_out("no free path to it")
        else:
            self.path = self.refined(self.pull_taut(path))[1:]
        return True

    def paths(self, points: Floats) -> Paths:
        """Return short paths to the waypoint from points (n, 3)."""
        if self.options.paths == "tree":
            return ShortestTree(self.grid, self.waypoint, points)
        seed = 1000 * self.options.seed + self.index
        name, policy = self.options.paths, self.policy.paths
        return SampledPaths(name, self.grid, self.waypoint, points, seed, policy)

    def refined(self, path: Floats) -> Floats:
        """Return a path (k, 3) after the refinement of the options."""
        name = self.options.refine or self.refine
        if name == "none":
            return path
        rng = np.random.default_rng([self.options.seed, self.index])
        even = polylines.points_along(path, self.grid.cell)
        params = self.options.refine_params
        return refined(name, self.scene, even, self.mission.clearance, rng, params)

    def refined_once(self, path: Floats, number: int) -> Floats:
        """Return a path after one round of refinement, even if the result is not free.

        The result differs from `refined` for the refinement `paper` only.

        Parameters
        ----------
        number : int
            Number of the path, which seeds the random moves.
        """
        if (self.options.refine or self.refine) != "paper" or len(path) < 3:
            return self.refined(path)
        rng = np.random.default_rng([self.options.seed, self.index, number])
        even = polylines.points_along(path, self.grid.cell)
        params = self.options.refine_params
        return stepped(self.scene, even, self.mission.clearance, rng, params)

    @property
    def pivot_spacing(self) -> float:
        """Distance between pivots along a tether, metres."""
        return self.options.pivot_spacing or max(self.grid.cell, self.policy.min_pivot_spacing)

    def pull_taut(self, path: Floats) -> Floats:
        """Return a path (k, 3) pulled taut in its class, at the clearance."""
        mission = self.mission
        return pull_taut(self.scene, path, mission.clearance, mission.delta, self.policy.paths)

    def is_free(self, path: Floats) -> bool:
        """Return whether a straight path (2, 3) keeps the clearance, or as much as its ends
        have."""
        ends = float(self.scene.distance(path).min())
        room = min(self.mission.clearance, ends) - 1e-3
        return self.scene.grown(max(0.0, room)).line_of_sight(path[0], path[1], depth=1e-3)

    def _advance(self, robot: Floats, tether: Tether) -> None:
        """Go on to the next waypoint if this one is reached at the end of the path."""
        reach = self.mission.reach
        if self.is_done or self.mode == WAIT or len(self.path) > 1:
            return
        if np.linalg.norm(self.waypoint - robot) <= reach:
            if self.is_homeward:
                if not self.may_end(tether):
                    self.path = self.path[:0]
                    return
                self.home = True
            else:
                self.reached.append(self.index)
            self._next()

    def _follow_home(self, robot: Floats) -> None:
        """Extend the path home to the current position of home; drop the path if that is not
        free."""
        if not self.is_homeward or self.track is None or not len(self.path):
            return
        last = np.array([self.path[-2] if len(self.path) > 1 else robot, self.waypoint])
        self.path = np.vstack([self.path[:-1], last[1:]]) if self.is_free(last) else self.path[:0]

    def _next(self) -> None:
        self.index += 1
        self.path, self.mode, self._held = np.zeros((0, 3)), NORMAL, 0

    def drop_passed(self, count: int) -> None:
        """Remove points that the robot has passed from the path; the last point stays."""
        self.path = self.path[min(count, max(0, len(self.path) - 1)) :]

    def leave_out(self, reason: str) -> None:
        """Leave out the next waypoint and log the reason; on the way home, end the mission."""
        if self.is_homeward:
            self.home_failure = reason
        else:
            self.left_out.append((self.index, reason))
        self._next()

    hear_of_payout = deprecated_method("hear_of_payout", "on_excess_payout")
    take_map = deprecated_method("take_map", "update_map")
    take_limit = deprecated_method("take_limit", "update_limit")
    carried_off = deprecated_method("carried_off", "on_push")
    keeps_off = deprecated_method("keeps_off", "is_clear_of_solids")
    ends_here = deprecated_method("ends_here", "may_end")
    laid_now = deprecated_method("laid_now", "home_tether")
    homeward = deprecated_method("homeward", "is_homeward")
    anchor_moves = deprecated_method("anchor_moves", "is_anchor_moving")
    told = deprecated_method("told", "summary_fields")
    home_now = deprecated_method("home_now", "home_position")
    not_home = deprecated_method("not_home", "home_failure")
    loaded = deprecated_method("loaded", "has_load")
    caught = deprecated_method("caught", "excess_payout")
    pulled = deprecated_method("pulled", "pull_taut")
    fine = deprecated_method("fine", "fine_spacing")
    done = deprecated_method("done", "is_done")
    go_on = deprecated_method("go_on", "plan_direct")
    passed = deprecated_method("passed", "drop_passed")

"""Simulation of a mission: planner, vehicle and tether, step by step, with a log."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.deprecated import deprecated_names
from netsp.base.errors import InputError, is_interrupt
from netsp.base.registry import blame_plugins
from netsp.world.mission.anchor_track import AnchorTrack
from netsp.world.mission.mission import Mission, MissionWaypoint
from netsp.world.mission.mission_limits import check_bounds, check_names, check_size, check_tether
from netsp.world.mission.mission_tether import mission_tether
from netsp.world.mission.run_log import LogRow, Run
from netsp.world.paths.path_policy import PathPolicy
from netsp.world.paths.tree import Grid
from netsp.world.planner import PLANNERS, Command, Planner, PlannerOptions, make_planner
from netsp.world.planner.planner import DONE, DWELL, WAIT
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Scene
from netsp.world.scene.surfaces import extent
from netsp.world.simulator.coverage import Coverage, surface_patches
from netsp.world.simulator.current import Water
from netsp.world.simulator.laid_tether import first_tether, present_tether
from netsp.world.simulator.sensing import Positions
from netsp.world.simulator.simulation import Simulation
from netsp.world.simulator.simulation_policy import SimulationPolicy
from netsp.world.simulator.stalls import Stalls
from netsp.world.simulator.summary import summarise
from netsp.world.simulator.surprises import SceneSurprises
from netsp.world.simulator.surroundings import Surroundings
from netsp.world.tether import TETHERS, make_tether
from netsp.world.vehicle import VEHICLES, VehicleFactory, make_vehicle
from netsp.world.vehicle.kinematic import wrapped_angle


def mission_grid(
    mission: Mission, scene: Scene, field: DistanceField, policy: PathPolicy = PathPolicy()
) -> Grid:
    """Return the grid of path search: over the bounds of the scene, or all of it with a margin.

    Raises
    ------
    InputError
        The grid would take too much memory, or its cells are larger than the site.
    """
    low, high, cell = mission_grid_box(mission, scene, policy)
    return Grid(field, low, high, cell, mission.clearance, policy)


def mission_grid_box(
    mission: Mission, scene: Scene, policy: PathPolicy = PathPolicy()
) -> tuple[Floats, Floats, float]:
    """Return the corners (3,) and the cell size of `mission_grid`, metres.

    Raises
    ------
    InputError
        The cells are larger than the site.
    """
    cell = mission.cell or policy.cell
    if scene.bounds is not None:
        low, high = np.array(scene.bounds[:3]), np.array(scene.bounds[3:])
    else:
        low, high = extent(scene, mission.every_place)
        room = 5.0 * cell + mission.clearance
        low, high = low - room, high + room
    if cell > (widest := float((high - low).max())):
        raise InputError(
            f"cell: {cell:g} is more than the whole site, {widest:.4g} across; expected far less"
        )
    if mission.cell is None:
        volume = np.prod(np.maximum(high - low, policy.cell))
        cell = max(policy.cell, float(volume / policy.max_default_cells) ** (1.0 / 3.0))
    return low, high, cell


@blame_plugins(planner=PLANNERS, vehicle=VEHICLES, tether=TETHERS)
def simulate(
    mission: Mission,
    planner: str | Callable[..., Planner] = "predictive",
    *,
    vehicle: str | VehicleFactory = "kinematic",
    tether: str | Callable[[DistanceField, float], Any] = "geodesic",
    options: PlannerOptions | None = None,
    scene: Scene | None = None,
    field: DistanceField | None = None,
    snap: bool = False,
    surprises: SceneSurprises | None = None,
    seed: int = 0,
    on_step: Callable[[LogRow, Planner], None] | None = None,
    policy: SimulationPolicy = SimulationPolicy(),
) -> Run:
    """Simulate a mission.

    Parameters
    ----------
    planner : str or callable
        Name (`netsp.world.planner.PLANNERS`) or factory of a planner, such as a class derived from
        `Planner`.
    vehicle : str or callable
        Name of a vehicle (`netsp.world.vehicle.VEHICLES`), or factory that is called with a place
        and a speed.
    tether : str or callable
        The planner's tether model: `geodesic`, `react`, or a callable that makes a
        `netsp.world.tether.TetherModel` of a field and a resolution. The log has the geodesic one.
    options : PlannerOptions, optional
        Options of path search.
    scene, field : Scene, DistanceField, optional
        Scene of the mission and its field; loaded if None.
    snap : bool
        Whether waypoints inside solids are moved out.
    surprises : SceneSurprises, optional
        Differences between water and map, and events.
    seed : int
        Seed of the gusts and of the sensors' noise.
    on_step : callable, optional
        Called with each row and the planner. If it raises KeyboardInterrupt, the run ends and is
        returned.
    policy : SimulationPolicy
        Steps and thresholds of the simulation.

    Raises
    ------
    InputError
        Before the first step: a name is unknown, a waypoint lies inside a solid, anchor and start
        are in different parts of the water, or the tether is shorter than the path between them.

    Examples
    --------
    >>> from netsp.world.mission.mission import Mission
    >>> run = simulate(Mission.load("missions/basin.json"), "none")  # doctest: +SKIP
    >>> run.summary["visited"], round(run.summary["longest_tether"], 1)  # doctest: +SKIP
    (97, 17.8)
    """
    check_names(planner, vehicle, tether)
    check_size(mission, policy)
    options = options or PlannerOptions()
    track = AnchorTrack.for_mission(mission)
    if surprises is not None and tether != "geodesic":
        raise InputError(f"surprises: tether model {tether!r} has one map only; expected geodesic")
    if track is not None and tether != "geodesic":
        raise InputError(f"track: tether model {tether!r} cannot follow it; expected geodesic")
    scene = scene or mission.load_scene()
    check_bounds(mission, scene)
    field = field or scene.field()
    mission = mission.checked_waypoints(field, snap=snap)
    tethers = mission_tether(mission, field)
    grid = mission_grid(mission, scene, field, options.policy.paths)
    laid = first_tether(mission, field, tethers, grid)
    taut = present_tether(mission, field, tethers, grid)
    if surprises is not None:
        surprises.check(scene, "", len(mission.waypoints))
    if track is not None:
        track.check(field, mission.delta)
    check_tether(mission, taut.length)
    robot = make_vehicle(vehicle, np.array(mission.begin), mission.speed)
    believed = None if tether == "geodesic" else make_tether(tether, field, mission.delta)
    chosen = make_planner(planner, mission, field, believed or tethers, grid, options)
    chosen.laid = laid
    coverage = _coverage(mission, scene, field, policy)
    water = Water(mission.current, mission.gusts, seed, policy.gusts)
    chosen.warm_up(robot.position, taut)
    positions = Positions(mission.sensor, field, robot.position, seed, policy)
    if believed is None and not positions.exact:
        believed = tethers
    world = Simulation(mission, field, robot, tethers, taut, water, coverage, believed)
    world.positions, world.track, world.policy = positions, track, policy
    if believed is not None:
        world.believed = present_tether(mission, field, believed, grid)
    surroundings = None
    if surprises is not None:
        line = np.vstack([taut.nodes, robot.position])
        surroundings = Surroundings(mission, scene, field.voxels, surprises, line, seed, policy)
        world.model, world.believed, world.kept_tethers = tethers, taut, [(0, taut)]
    name = planner if isinstance(planner, str) else chosen.name
    return _MissionRun(world, chosen, surroundings, on_step).run(name)


def _coverage(
    mission: Mission, scene: Scene, field: DistanceField, policy: SimulationPolicy
) -> Coverage | None:
    """Return the coverage at the beginning; None without a camera."""
    if mission.camera is None:
        return None
    size, places = mission.camera.patch, mission.every_place
    patches = surface_patches(
        scene, field, size, places, mission.inspect, policy.coverage, clearance=mission.clearance
    )
    return Coverage(patches, field, mission.camera)


@dataclass
class _MissionRun:
    """Mission in progress.

    Attributes
    ----------
    world, planner, surroundings
        Simulated robot, planner, and changes of the scene, None if there can be none.
    on_step
        See `simulate`.
    """

    world: Simulation
    planner: Planner
    surroundings: Surroundings | None
    on_step: Callable[[LogRow, Planner], None] | None
    stalls: Stalls = field(default_factory=Stalls)
    _since: tuple[float, int] = (0.0, -1)

    def run(self, name: str) -> Run:
        """Simulate to the end, or to an interrupt; `name` is that of the planner."""
        stopped, begin = False, time.perf_counter()
        try:
            while self._step():
                pass
        except (KeyboardInterrupt, SystemError) as error:
            if not is_interrupt(error):
                raise
            stopped = True
        wall = time.perf_counter() - begin
        world, planner, surroundings = self.world, self.planner, self.surroundings
        summary = summarise(planner.mission, planner, world, wall, stopped)
        summary |= planner.summary_fields()
        summary["stalls"] = self.stalls.found
        summary["surprises"] = None if surroundings is None else surroundings.summary_fields()
        return Run(
            planner.flown,
            name,
            tuple(world.log),
            world.tether,
            summary,
            None if surroundings is None else surroundings.scene_now,
            tuple(world.kept_tethers),
        )

    def _step(self) -> bool:
        """Take one step; return False at the end of the mission."""
        world, planner = self.world, self.planner
        before, planner.now = planner.index, world.now
        if self.surroundings is not None:
            self.surroundings.update(world, planner)
        command = planner.step(world.robot, world.believed or world.tether)
        row = world.log_state(planner, command)
        if self.on_step is not None:
            self.on_step(row, planner)
        if command.mode == DONE:
            return False
        if planner.reached and planner.index > before and planner.reached[-1] == before:
            stay(world, planner, planner.mission.waypoints[before], self.on_step)
            if planner.is_anchor_moving and world.now > row.time:
                planner.path = planner.path[:0]  # planned for an earlier position of the anchor
                return True
        max_s = world.policy.max_waypoint_s
        if self._since[1] != planner.index or command.mode == WAIT:
            self._since = (world.now, planner.index)
        elif world.now - self._since[0] > max_s:
            planner.leave_out(f"not reached in {max_s:g} s")
            return True
        if self.stalls.check(world, planner, command):
            planner.leave_out(self.stalls.reason)
            return True
        fresh = before != planner.index or command.replan_s > 0.0 or not world.now
        passed, moved = world.step(command.path, fresh, planner.is_homeward)
        if moved:
            planner.drop_passed(passed)
        else:
            planner.leave_out("the path to it leads through a solid")
        return True


def stay(
    world: Simulation,
    planner: Planner,
    waypoint: MissionWaypoint,
    on_step: Callable[[LogRow, Planner], None] | None = None,
) -> None:
    """Turn to the heading of a waypoint, for at most `max_turn_s`, and stay for its dwell.

    The planner has already advanced to the next waypoint.
    """
    heading = None if waypoint.heading is None else math.radians(waypoint.heading)
    if heading is None and waypoint.dwell == 0.0:
        return
    tolerance = math.radians(world.policy.heading_tolerance_deg)
    position, since, arrived = world.vehicle.position, world.now, None
    while arrived is None or world.now < arrived + waypoint.dwell - 1e-9:
        world.step(position[None], world.now == since, heading=heading)
        row = world.log_state(planner, Command(position[None], DWELL))
        if on_step is not None:
            on_step(row, planner)
        error = 0.0 if heading is None else abs(wrapped_angle(heading - world.vehicle.yaw))
        if arrived is None and (
            error <= tolerance or world.now - since >= planner.policy.max_turn_s
        ):
            arrived = world.now


__getattr__ = deprecated_names(globals(), grid_of="mission_grid", grid_box="mission_grid_box")

"""Runs a mission: planner, vehicle and tether, step by step, with a log that tells all."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from netsp.arrays import Floats
from netsp.errors import InputError
from netsp.geometry import polylines
from netsp.online.coverage import Coverage, patches_of
from netsp.online.log import LogRow, Run
from netsp.online.mission import Mission, MissionWaypoint
from netsp.online.paths.tree import Grid, ShortestTree
from netsp.online.paths.tree import taut as taut_path
from netsp.online.planner import PLANNERS, Command, Planner, PlannerOptions, make_planner
from netsp.online.planner.base import DONE, DWELL, FREE, HOLD, HOME, Tethers
from netsp.online.scene.field import DistanceField
from netsp.online.scene.scene import Scene
from netsp.online.scene.surfaces import extent
from netsp.online.sensing import Positions
from netsp.online.tether import TETHERS, GeodesicTether, Tether, make_tether
from netsp.online.tether.load import Load, payout, pull_on_robot, turning
from netsp.online.vehicle import VEHICLES, Vehicle, make_vehicle
from netsp.online.vehicle.kinematic import turned
from netsp.online.water import Water

STEP = 0.1
"""Seconds between two decisions of the planner."""

CELL, MOST_CELLS = 0.2, 2_000_000
"""Cells of the grid that paths are sought on, metres, where a mission does not say; larger ones
where there would be more than so many, so that planning takes no longer than a second."""

FRAME = 2
"""Steps between two pictures of the camera."""

HEADING_REACH, TURN_TIME = math.radians(5.0), 30.0
"""A heading this near counts as taken, and so many seconds are given to turn to it."""

LEAST_COURSE = 0.05
"""m/s: slower motion through the water asks for no heading."""

STALL, PROGRESS = 30.0, 0.05
"""A robot has stalled when in so many seconds it has not come so many metres nearer."""

STUCK = 600.0
"""Seconds at one waypoint after which it is left out."""


def grid_of(mission: Mission, scene: Scene, field: DistanceField) -> Grid:
    """The grid that paths are sought on: the scene's bounds, or all there is and some room.

    Parameters
    ----------
    mission : Mission
        Its cell, waypoints and clearance count.
    scene : Scene
        Its bounds count.
    field : DistanceField
        The scene's field.

    Returns
    -------
    Grid
        The grid.

    Raises
    ------
    InputError
        It would take too much memory; says which cell would not.
    """
    cell = mission.cell or CELL
    if scene.bounds is not None:
        low, high = np.array(scene.bounds[:3]), np.array(scene.bounds[3:])
    else:
        low, high = extent(scene, mission.every_place)
        room = 5.0 * cell + mission.clearance
        low, high = low - room, high + room
    if mission.cell is None:
        cell = max(CELL, float(np.prod(np.maximum(high - low, CELL)) / MOST_CELLS) ** (1.0 / 3.0))
    return Grid(field, low, high, cell, mission.clearance)


def first_tether(mission: Mission, field: DistanceField, model: Tethers, grid: Grid) -> Tether:
    """The tether when a mission begins: straight, or along the shortest path from the anchor to a
    start that it does not see.

    Parameters
    ----------
    mission : Mission
        Its anchor and start count.
    field : DistanceField
        The scene's field.
    model : TetherModel
        The model of the tether.
    grid : Grid
        That paths are sought on.

    Returns
    -------
    Tether
        The tether.

    Raises
    ------
    InputError
        Anchor or start inside a solid, or in different parts of the water.
    """
    anchor = field.free_point(mission.anchor, "anchor")
    start = field.free_point(mission.start, "start")
    if field.line_of_sight(anchor, start, depth=0.125 * mission.delta):
        return model.start(anchor, start)
    path = ShortestTree(grid, start, anchor[None]).path(0)
    if path is None:
        raise InputError(
            f"start: no path in the water leads from the anchor {_shown(anchor)} to "
            f"{_shown(start)} at the clearance {mission.clearance:g}"
        )
    path = taut_path(field, path, 0.0, mission.delta)
    return model.drive(model.start(anchor, anchor), path[1:])[0]


def _shown(point: Floats) -> str:
    return f"({', '.join(f'{v:g}' for v in point)})"


@dataclass
class Simulation:
    """A robot on a tether in a scene, moved on step by step.

    Parameters
    ----------
    mission : Mission
        What is flown.
    scene : DistanceField
        The map.
    vehicle : Vehicle
        The robot.
    tethers : GeodesicTether
        The model of the taut tether.
    tether : Tether
        The taut tether, by the geodesic model.
    water : callable
        Velocity of the water (3,), m/s, at a time in seconds.
    coverage : Coverage, optional
        What the camera has seen.
    model : TetherModel, optional
        Another model, that the planner believes in.
    believed : Tether, optional
        Its tether.
    positions : Positions, optional
        What the planner is told of the robot's position.
    thought : ndarray, shape (3,), optional
        Where it thinks that the robot is, metres.
    now : float
        Seconds since the start.
    log : list of LogRow
        One row per step.
    """

    mission: Mission
    scene: DistanceField
    vehicle: Vehicle
    tethers: GeodesicTether
    tether: Tether
    water: Callable[[float], Floats]
    coverage: Coverage | None = None
    model: Tethers | None = None
    believed: Tether | None = None
    positions: Positions | None = None
    thought: Floats | None = None
    now: float = 0.0
    log: list[LogRow] = field(default_factory=list)
    _was: Floats | None = None

    def _course(self, path: Floats, yaw: float) -> float:
        """Heading (rad) along the way through the water: a vehicle is fastest ahead."""
        leg = path[0] - self.vehicle.position
        far = float(np.linalg.norm(leg))
        if far < 1e-6:
            return yaw
        x, y, _ = leg * (self.mission.speed / far) - self.water(self.now)
        return math.atan2(y, x) if math.hypot(x, y) > LEAST_COURSE else yaw

    def _pull(self) -> dict[str, Floats]:
        """The tether's force on a vehicle that is to feel it."""
        physics = self.mission.tether
        if not physics.pulls_vehicle:
            return {}
        here, delta = self.vehicle.position, self.tethers.delta
        velocity = np.zeros(3) if self._was is None else (here - self._was) / STEP
        return {"pull": pull_on_robot(self.tether, self.load, physics.friction, velocity, delta)}

    @property
    def load(self) -> Load:
        """What acts on the tether now."""
        return self.mission.tether.load(self.water(self.now))

    def note(self, planner: Planner, command: Command) -> LogRow:
        """Write down where things are.

        Parameters
        ----------
        planner : Planner
            Its waypoint and mode are logged.
        command : Command
            What it asked for.

        Returns
        -------
        LogRow
            The row.
        """
        x, y, z = (float(v) for v in self.vehicle.position)
        seen = self.coverage
        if seen is not None and len(self.log) % FRAME == 0 and command.mode != HOME:
            seen.look(self.vehicle.position, self.vehicle.yaw)
        row = LogRow(
            round(self.now, 6), x, y, z, self.vehicle.yaw, planner.index, command.mode,
            self.tether.length, payout(self.tether, self.load),
            turning(self.tether, self.tethers.delta),
            seen.share if seen else 0.0, seen.share_through if seen else 0.0,
            command.replan_s,
        )  # fmt: skip
        self.log.append(row)
        return row

    def go(
        self, path: Floats, fresh: bool, homeward: bool = False, heading: float | None = None
    ) -> tuple[int, bool]:
        """Take one step along a path; a vehicle that runs into a solid is stopped where it was.

        Parameters
        ----------
        path : ndarray, shape (k, 3)
            Points to pass, metres.
        fresh : bool
            Whether the path does not continue the one before.
        homeward : bool
            Whether the inspection is over: the camera then no longer asks for a heading.
        heading : float, optional
            To turn to, radians, whatever the camera asks for.

        Returns
        -------
        count : int
            How many points of the path are behind the robot.
        moved : bool
            Whether the vehicle could move.
        """
        robot, yaw = self.vehicle.position, self.vehicle.yaw
        pull = self._pull()
        self._was = robot
        if heading is not None:
            yaw = heading
        elif self.coverage is not None and not homeward:
            yaw = self.coverage.heading(robot, yaw)
        elif self.coverage is None:
            yaw = self._course(path, yaw)
        points, passed = self.vehicle.go(path, STEP, yaw, self.water(self.now), fresh, **pull)
        self.now += STEP
        if self.scene.distance(np.array(points)).min() < -0.2 * self.tethers.delta:
            self.vehicle.stop_at(robot)
            return passed, False
        for point in points:
            self.tether = self.tethers.update(self.tether, point)
        told = points
        if self.positions is not None and not self.positions.exact:
            self.thought = self.positions(self.vehicle.position)
            told = [self.thought]
        if self.model is not None and self.believed is not None:
            for point in told:
                self.believed = self.model.update(self.believed, point)
        return passed, True

    @property
    def robot(self) -> Floats:
        """(3,) where the planner thinks that the robot is."""
        return self.vehicle.position if self.thought is None else self.thought


FARTHEST = 1000.0
"""A waypoint may be so many tether lengths from the anchor."""

MOST_STEPS, MOST_NODES = 5_000_000, 200_000
"""Steps of a run, and nodes of a tether, beyond which a mission is taken for a mistake of units."""


MOST_CURRENT = 20.0
"""m/s: no sea is faster; rather a mistake of units."""

MOST_SAG_RATIO = 20.0
"""Drag on a whole tether over its tension, beyond which a current is taken for a mistake."""


def check_names(planner: object, vehicle: object, tether: object) -> None:
    """Refuse a name that no record has, before a scene is read, which takes longer.

    Parameters
    ----------
    planner, vehicle, tether : str or callable
        As of `simulate`.

    Raises
    ------
    InputError
        No record has that name.
    """
    for known, name in ((PLANNERS, planner), (VEHICLES, vehicle), (TETHERS, tether)):
        if not callable(name):
            known.named(name)


def _check_size(mission: Mission) -> None:
    """InputError for a mission that would take for ever."""
    places = mission.every_place[1:]
    far = float(np.abs(places - np.array(mission.anchor)).max())
    if far > FARTHEST * mission.tether_length:
        raise InputError(
            f"waypoints: one is {far:g} from the anchor; expected at most {FARTHEST:g} times the "
            f"tether_length {mission.tether_length:g}: mixed units?"
        )
    steps = polylines.length(places) / (mission.speed * STEP)
    if steps > MOST_STEPS:
        raise InputError(
            f"speed: {mission.speed:g} takes {steps:.2g} steps of {STEP:g} s for the waypoints; "
            f"expected at most {MOST_STEPS:g}"
        )
    stays = sum(w.dwell for w in mission.waypoints) / STEP
    if stays > MOST_STEPS:
        raise InputError(
            f"waypoints: dwell takes {stays:.2g} steps of {STEP:g} s in all; expected at most "
            f"{MOST_STEPS:g}"
        )
    sensor = mission.sensor
    reserve = 3.0 * sensor.noise + sensor.delay * mission.speed
    if reserve > 0.5 * mission.tether_length:
        raise InputError(
            f"sensor: noise {sensor.noise:g} and delay {sensor.delay:g} ask for {reserve:.3g} m of "
            f"tether in reserve; expected at most half of the tether_length "
            f"{mission.tether_length:g}"
        )
    load = mission.tether.load(np.array(mission.current))
    speed = float(np.linalg.norm(mission.current)) + 3.0 * mission.gusts
    if speed > MOST_CURRENT:
        raise InputError(
            f"current, gusts: water of {speed:g} m/s; expected at most {MOST_CURRENT:g}: mixed "
            "units?"
        )
    sag = load.drag * speed**2 * mission.tether_length / load.tension
    if sag > MOST_SAG_RATIO:
        raise InputError(
            f"current: {speed:g} m/s pulls on {mission.tether_length:g} m of tether with {sag:.3g} "
            f"times its tension of {load.tension:g} N; expected at most {MOST_SAG_RATIO:g}: mixed "
            "units?"
        )
    if mission.tether_length / mission.delta > MOST_NODES:
        raise InputError(
            f"delta: {mission.delta:g} makes {mission.tether_length / mission.delta:.2g} nodes of "
            f"a tether; expected at most {MOST_NODES:g}"
        )


def simulate(
    mission: Mission,
    planner: str | Callable[..., Planner] = "predictive",
    *,
    vehicle: str = "kinematic",
    tether: str | Callable[[DistanceField, float], Any] = "geodesic",
    options: PlannerOptions | None = None,
    scene: Scene | None = None,
    field: DistanceField | None = None,
    snap: bool = False,
    seed: int = 0,
    on_step: Callable[[LogRow, Planner], None] | None = None,
) -> Run:
    """Run a mission.

    Parameters
    ----------
    mission : Mission
        What is flown.
    planner : str or callable
        A name (`netsp.online.planner.PLANNERS`), or a callable that makes one, such as a class
        derived from `Planner`.
    vehicle : str
        A name (`netsp.online.vehicle.VEHICLES`).
    tether : str or callable
        The model that the planner believes: `geodesic`, `react`, or a callable that makes a
        `netsp.online.tether.TetherModel` of a field and a resolution; what is logged is the
        geodesic one.
    options : PlannerOptions, optional
        How the planner finds paths.
    scene : Scene, optional
        When it is at hand.
    field : DistanceField, optional
        When it is at hand.
    snap : bool
        Move waypoints out of solids.
    seed : int
        Of the gusts.
    on_step : callable, optional
        Called with every row and the planner; a KeyboardInterrupt ends the run, and what was done
        till then is returned.

    Returns
    -------
    Run
        What came of it.

    Raises
    ------
    InputError
        Before the first step: unknown names, waypoints inside solids, anchor and start in different
        parts of the water, a tether that is shorter than the path between them.
    """
    check_names(planner, vehicle, tether)
    _check_size(mission)
    scene = scene or mission.load_scene()
    field = field or scene.field()
    mission = mission.checked_waypoints(field, snap=snap)
    tethers = GeodesicTether(field, mission.delta)
    grid = grid_of(mission, scene, field)
    taut = first_tether(mission, field, tethers, grid)
    if taut.length > mission.tether_length:
        raise InputError(
            f"tether_length: {mission.tether_length:g} is shorter than the path from anchor to "
            f"start, {taut.length:.4g}"
        )
    robot = make_vehicle(vehicle, np.array(mission.start), mission.speed)
    believed = None if tether == "geodesic" else make_tether(tether, field, mission.delta)
    chosen = make_planner(planner, mission, field, believed or tethers, grid, options)
    chosen.laid = taut
    coverage = None
    if mission.camera is not None:
        patches = patches_of(
            scene, field, mission.camera.patch, mission.every_place, mission.inspect
        )
        coverage = Coverage(patches, field, mission.camera)
    water = Water(mission.current, mission.gusts, seed)
    chosen.warm_up(robot.position, taut)
    positions = Positions(mission.sensor, field, robot.position, STEP, seed)
    if believed is None and not positions.exact:
        believed = tethers
    world = Simulation(mission, field, robot, tethers, taut, water, coverage, believed)
    world.positions = positions
    if believed is not None:
        world.believed = first_tether(mission, field, believed, grid)
    since, interrupted, stalls = (0.0, -1), False, Stalls()
    begin = time.perf_counter()
    try:
        while True:
            before = chosen.index
            command = chosen.step(world.robot, world.believed or world.tether)
            row = world.note(chosen, command)
            if on_step is not None:
                on_step(row, chosen)
            if command.mode == DONE:
                break
            if chosen.reached and chosen.index > before and chosen.reached[-1] == before:
                stay(world, chosen, mission.waypoints[before], on_step)
            if since[1] != chosen.index:
                since = (world.now, chosen.index)
            elif world.now - since[0] > STUCK:
                chosen.leave_out(f"not reached in {STUCK:g} s")
                continue
            if stalls.seen(world, chosen, command):
                chosen.leave_out(stalls.reason)
                continue
            fresh = before != chosen.index or command.replan_s > 0.0 or not world.now
            passed, moved = world.go(command.path, fresh, chosen.homeward)
            if moved:
                chosen.passed(passed)
            else:
                chosen.leave_out("the path to it leads through a solid")
    except KeyboardInterrupt:
        interrupted = True
    wall = time.perf_counter() - begin
    summary = summarise(mission, chosen, world, wall, interrupted)
    summary["stalls"] = stalls.found
    return Run(
        mission,
        planner if isinstance(planner, str) else chosen.name,
        tuple(world.log),
        world.tether,
        summary,
    )


@dataclass
class Stalls:
    """Watches whether the robot gets on: in a strong current it may not.

    Parameters
    ----------
    found : list of dict
        Time (s), waypoint and place of each stall.
    reason : str
        Of the last one, in a line.
    """

    found: list[dict[str, Any]] = field(default_factory=list)
    reason: str = ""
    _index: int = -1
    _least: float = math.inf
    _since: float = 0.0

    def seen(self, world: Simulation, planner: Planner, command: Command) -> bool:
        """Whether what is left of the path has not become shorter for `STALL` seconds.

        Parameters
        ----------
        world : Simulation
            As it is.
        planner : Planner
            Its waypoint counts.
        command : Command
            Its path counts; a path that has been planned anew starts the clock again.

        Returns
        -------
        bool
            Whether the robot has stalled; it is then noted.
        """
        here = world.vehicle.position
        left = polylines.length(np.vstack([here, command.path]))
        if planner.index != self._index or command.replan_s > 0.0 or left < self._least - PROGRESS:
            self._index, self._least, self._since = planner.index, left, world.now
            return False
        if world.now - self._since < STALL or command.mode == HOLD:
            return False
        water = float(np.linalg.norm(world.water(world.now)))
        self.reason = f"stalled: no progress in {STALL:g} s, in water of {water:.2f} m/s"
        self.found.append({"time": world.now, "waypoint": planner.index, "position": here.tolist()})
        self._index = -1
        return True


def stay(
    world: Simulation,
    planner: Planner,
    waypoint: MissionWaypoint,
    on_step: Callable[[LogRow, Planner], None] | None = None,
) -> None:
    """At a waypoint: turn to its heading, for `TURN_TIME` at most, then stay as long as it asks.

    Parameters
    ----------
    world : Simulation
        It is moved on.
    planner : Planner
        Already on its way to what is next.
    waypoint : MissionWaypoint
        The waypoint.
    on_step : callable, optional
        As of `simulate`.
    """
    heading = None if waypoint.heading is None else math.radians(waypoint.heading)
    if heading is None and waypoint.dwell == 0.0:
        return
    here, since, arrived = world.vehicle.position, world.now, None
    while arrived is None or world.now < arrived + waypoint.dwell - 1e-9:
        world.go(here[None], world.now == since, heading=heading)
        row = world.note(planner, Command(here[None], DWELL))
        if on_step is not None:
            on_step(row, planner)
        off = 0.0 if heading is None else abs(turned(heading - world.vehicle.yaw))
        if arrived is None and (off <= HEADING_REACH or world.now - since >= TURN_TIME):
            arrived = world.now


def summarise(
    mission: Mission, planner: Planner, world: Simulation, wall: float, interrupted: bool
) -> dict[str, Any]:
    """The numbers of a run, as the papers give them.

    `exceedance_s` is the time in which more tether must be out than there is: the taut length and
    what slack and sag add to it (`longest_payout`). `stops` tells of each waypoint visited, with
    the sum of turning angles and the factor e^(mu theta) that friction multiplies the tension by.
    `recovery_s` is the time to come back to the anchor afterwards, by retracing the tether, or the
    whole path (the paper does not say which). Both, `path` and what was seen are of the inspection;
    `home` tells of the leg back to the start that follows it: whether it was `reached` with the
    tether free, how much longer the tether is there than when the mission began (`left`, m), and
    how long it took.

    Parameters
    ----------
    mission : Mission
        What was flown.
    planner : Planner
        As it is at the end.
    world : Simulation
        As it is at the end.
    wall : float
        Seconds that the run took.
    interrupted : bool
        Whether it was stopped.

    Returns
    -------
    dict
        The numbers by name.
    """
    log = world.log
    # the inspection ends with the row in which the last waypoint is behind the robot
    before = [
        n for n, r in enumerate(log) if r.waypoint < len(mission.waypoints) or r.mode == DWELL
    ]
    last = before[-1] + 1 if before else 0
    inspected = log[: last + 1]
    lengths = np.array([r.tether for r in log])
    payouts = np.array([r.payout for r in log])
    turnings = np.array([r.turning for r in log])
    places = np.array([[r.x, r.y, r.z] for r in inspected])
    planned = [r.replan_s for r in log if r.replan_s > 0.0]
    walked = polylines.length(places)
    inspection = inspected[-1].time if log else 0.0
    control = world.vehicle.control_s
    by_tether = inspected[-1].tether / mission.speed if log else 0.0
    by_path = walked / mission.speed
    return {
        "mission": mission.name,
        "planner": planner.name,
        "status": "interrupted" if interrupted else "done",
        "inspection_s": inspection,
        "recovery_s": {"tether": by_tether, "path": by_path},
        "total_s": {"tether": inspection + by_tether, "path": inspection + by_path},
        "path": walked,
        "tether_length": mission.tether_length,
        "longest_tether": float(lengths.max(initial=0.0)),
        "longest_payout": float(payouts.max(initial=0.0)),
        "exceedance_s": float((payouts > mission.tether_length * (1 + 1e-9)).sum() * STEP),
        "friction": _friction(mission, turnings),
        "visited": len(planner.reached),
        "waypoints": len(mission.waypoints),
        "left_out": [{"waypoint": k, "reason": why} for k, why in planner.left_out],
        "stops": _stops(mission, planner, log),
        "home": _home(planner, world, inspection),
        "defects": len(planner.defects),
        "replans": len(planned),
        "replan_median_s": float(np.median(planned)) if planned else 0.0,
        "replan_worst_s": max(planned, default=0.0),
        "coverage": log[-1].coverage if world.coverage and log else None,
        "coverage_through": log[-1].coverage_through if world.coverage and log else None,
        "control_median_s": float(np.median(control)) if control else 0.0,
        "control_worst_s": max(control, default=0.0),
        "wall_s": wall,
    }


def _home(planner: Planner, world: Simulation, since: float) -> dict[str, Any]:
    """How the mission ended: `left` is asked once the tether has come to rest."""
    assert planner.laid is not None
    model, delta = world.tethers, world.tethers.delta
    as_laid = model.refine(model.update(planner.laid, world.vehicle.position)).length
    left = max(0.0, model.refine(world.tether).length - as_laid)
    return {
        "reached": planner.home,
        "tether_free": planner.home and left <= FREE * delta,
        "left": left,
        "seconds": world.now - since,
        "reason": planner.not_home,
    }


def _stops(mission: Mission, planner: Planner, log: list[LogRow]) -> list[dict[str, Any]]:
    """The tether at each waypoint visited."""
    arrival: dict[int, LogRow] = {}
    passed, visited = 0, set(planner.reached)
    for row in log:
        for index in range(passed, row.waypoint):
            if index in visited:
                arrival[index] = row
        passed = max(passed, row.waypoint)
    mu = mission.tether.friction
    return [
        {
            "waypoint": k,
            "tether": r.tether,
            "payout": r.payout,
            "turning_deg": math.degrees(r.turning),
            "tension_ratio": math.exp(mu * r.turning),
        }
        for k, r in arrival.items()
    ]


def _friction(mission: Mission, turnings: Floats) -> dict[str, float] | None:
    """Turning and tension ratio where they were greatest, and seconds over the limit; None without
    friction."""
    physics = mission.tether
    if physics.friction == 0.0:
        return None
    most = float(turnings.max(initial=0.0))
    return {
        "most_turning_deg": math.degrees(most),
        "most_tension_ratio": math.exp(physics.friction * most),
        "over_s": float((turnings > physics.max_turning * (1 + 1e-9)).sum() * STEP),
    }

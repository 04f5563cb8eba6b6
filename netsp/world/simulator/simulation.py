"""State of a simulated robot on a tether in a scene."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from netsp.base.arrays import Floats
from netsp.world.mission.anchor_track import AnchorTrack
from netsp.world.mission.mission import Mission
from netsp.world.mission.run_log import LogRow
from netsp.world.planner import Command, Planner
from netsp.world.planner.planner import HOME, Tethers
from netsp.world.planner.preview import CONTACT_DEPTH
from netsp.world.scene.field import DistanceField, pushed_out
from netsp.world.simulator.coverage import Coverage
from netsp.world.simulator.sensing import Positions
from netsp.world.simulator.simulation_policy import SimulationPolicy
from netsp.world.tether import GeodesicTether, Tether
from netsp.world.tether.load import Load, payout, pull_on_robot, turning
from netsp.world.tether.tether_bracket import taut_length
from netsp.world.vehicle import Vehicle


@dataclass
class Simulation:
    """Robot on a tether in a scene, moved step by step.

    Parameters
    ----------
    mission : Mission
        The mission.
    scene : DistanceField
        True scene.
    vehicle : Vehicle
        The robot.
    tethers : GeodesicTether
        Model of the taut tether.
    tether : Tether
        The taut tether.
    water : callable
        Velocity of the water (3,), m/s, at a time in seconds.
    coverage : Coverage, optional
        Coverage by the camera so far; None without a camera.
    model : TetherModel, optional
        Tether model of the planner, if it is another one.
    believed : Tether, optional
        Tether by the model of the planner.
    positions : Positions, optional
        Sensor of the robot's position.
    estimated_position : ndarray, shape (3,), optional
        Estimated position of the robot, metres.
    track : Track, optional
        Track of the anchor.
    now : float
        Time since the start, s.
    contacts : int
        Number of contacts of the robot with solids.
    shortening : bool
        Whether the tether is being shortened, because the limit was lowered below it.
    kept_tethers : list of (int, Tether)
        Indices of rows of the log and the tethers there, at intervals, if the scene changes.
    log : list of LogRow
        One row per step.
    policy : SimulationPolicy
        Steps and thresholds.
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
    estimated_position: Floats | None = None
    track: AnchorTrack | None = None
    now: float = 0.0
    contacts: int = 0
    shortening: bool = False
    kept_tethers: list[tuple[int, Tether]] = field(default_factory=list)
    log: list[LogRow] = field(default_factory=list)
    policy: SimulationPolicy = SimulationPolicy()
    _was: Floats | None = None

    def _course(self, path: Floats, yaw: float) -> float:
        """Return the heading, radians, along the velocity through the water, because a vehicle is
        fastest straight ahead."""
        leg = path[0] - self.vehicle.position
        far = float(np.linalg.norm(leg))
        if far < 1e-6:
            return yaw
        x, y, _ = leg * (self.mission.speed / far) - self.water(self.now)
        return math.atan2(y, x) if math.hypot(x, y) > self.policy.min_course_speed else yaw

    def _pull(self) -> dict[str, Floats]:
        """Return the force of the tether on the vehicle, if the mission considers it."""
        physics = self.mission.tether
        if not physics.pulls_vehicle:
            return {}
        position, delta = self.vehicle.position, self.tethers.delta
        velocity = np.zeros(3) if self._was is None else (position - self._was) / self.policy.step_s
        return {"pull": pull_on_robot(self.tether, self.load, physics.friction, velocity, delta)}

    @property
    def load(self) -> Load:
        """Load on the tether now."""
        return self.mission.tether.load(self.water(self.now))

    def log_state(self, planner: Planner, command: Command) -> LogRow:
        """Log the current state with the planner's waypoint and the mode of its command."""
        x, y, z = (float(v) for v in self.vehicle.position)
        seen = self.coverage
        if (
            seen is not None
            and len(self.log) % self.policy.camera_steps == 0
            and command.mode != HOME
        ):
            seen.look(self.vehicle.position, self.vehicle.yaw)
        limit, out = self.mission.tether_length, payout(self.tether, self.load)
        self.shortening = self.shortening and out > limit
        row = LogRow(
            round(self.now, 6),
            x,
            y,
            z,
            self.vehicle.yaw,
            planner.index,
            command.mode,
            taut_length(self.tether),
            out,
            turning(self.tether, self.tethers.delta),
            seen.share if seen else 0.0,
            seen.share_through if seen else 0.0,
            command.replan_s,
            limit,
            self.shortening,
        )
        if self.kept_tethers and len(self.log) % self.policy.tether_steps == 0:
            self.kept_tethers.append((len(self.log), self.tether))
        self.log.append(row)
        return row

    def step(
        self, path: Floats, fresh: bool, is_homeward: bool = False, heading: float | None = None
    ) -> tuple[int, bool]:
        """Take one step along a path; a vehicle that meets a solid stops where it was before.

        Parameters
        ----------
        path : ndarray, shape (k, 3)
            Points to pass, metres.
        fresh : bool
            Whether the path does not continue the one before.
        is_homeward : bool
            Whether the inspection is over, so that the camera no longer determines the heading.
        heading : float, optional
            Heading to turn to, rad; None for the heading of the camera or the course.

        Returns
        -------
        count : int
            Number of points of the path that the robot has passed.
        moved : bool
            Whether the vehicle could move.
        """
        robot, yaw, moved = self.vehicle.position, self.vehicle.yaw, True
        pull = self._pull()
        self._was = robot
        if heading is not None:
            yaw = heading
        elif self.coverage is not None and not is_homeward:
            yaw = self.coverage.heading(robot, yaw)
        elif self.coverage is None:
            yaw = self._course(path, yaw)
        step_s = self.policy.step_s
        points, passed = self.vehicle.go(path, step_s, yaw, self.water(self.now), fresh, **pull)
        self.now += step_s
        anchor = None if self.track is None else self.track(self.now)
        if self.scene.distance(np.array(points)).min() < -CONTACT_DEPTH * self.tethers.delta:
            self.vehicle.stop_at(robot)
            points, passed, moved = [robot], 0, False
            self.contacts += 1
        for point in points:
            self.tether = self.tethers.update(self.tether, point, anchor)
        seen_points = points
        if self.positions is not None and not self.positions.exact:
            self.estimated_position = self.positions(self.vehicle.position)
            seen_points = [self.estimated_position]
        if self.model is not None and self.believed is not None:
            for point in seen_points:
                self.believed = self._believed_after(point, anchor)
        return passed, moved

    def _believed_after(self, point: Floats, anchor: Floats | None) -> Tether:
        """Return the tether of the planner's model after a step.

        Only the geodesic model has moving anchors.
        """
        assert self.model is not None
        assert self.believed is not None
        if isinstance(self.model, GeodesicTether):
            # a wrong map may have a solid at the robot
            point = pushed_out(self.model.field, point[None], 0.0)[0]
            return self.model.update(self.believed, point, anchor)
        return self.model.update(self.believed, point)

    @property
    def robot(self) -> Floats:
        """Position (3,) of the robot as the planner knows it, metres."""
        return self.vehicle.position if self.estimated_position is None else self.estimated_position

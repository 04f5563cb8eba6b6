"""Vehicle over a link, which `execute` drives by position targets, vertex by vertex.

ArduSub in GUIDED holds a position target for good, while one with a velocity times out; so only
positions are sent. Datagrams get lost, but the vehicle plans again for a target that is sent again,
and falls behind in depth: a target is sent again only if the vehicle echoes another one, or echoes
none and does not move towards it. ArduSub does not go above home, and interprets an altitude of 0
as "keep the current one" (`netsp.exchange.missions.mission_files`): targets are at least 0.1 m
deep.
"""

from __future__ import annotations

import math

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.field_types import Point3
from netsp.exchange.missions.mission_files import altitude
from netsp.online.execute.tour_execution import StopsFlightError
from netsp.online.fly.flight_policy import FlightPolicy
from netsp.online.fly.leg_corridor import LegCorridor
from netsp.online.guard.frozen_position import FrozenFlight
from netsp.online.guard.telemetry import Fix
from netsp.online.link.dialect import dialect
from netsp.online.link.mavlink_messages import AUTOPILOT
from netsp.online.link.modes import Mode, mode_name
from netsp.online.link.session import Session

POSITION_ONLY = 0x0DF8
"""Code POSITION_TARGET_TYPEMASK for targets without velocity, acceleration, yaw and yaw rate."""


class LinkedVehicle:
    """Vehicle over a link; see `netsp.world.vehicle.Vehicle`.

    Parameters
    ----------
    session : Session
        Session with a vehicle whose position is known.
    reach : float
        Distance at which a vertex is reached, m.
    policy : FlightPolicy
        Limits of the flight.
    """

    def __init__(
        self, session: Session, reach: float, policy: FlightPolicy = FlightPolicy()
    ) -> None:
        self.session, self.reach, self.policy = session, reach, policy
        self.control_s: list[float] = []
        self._begin = session.latest.time
        self._position = self._reported_position()
        self._target: Point3 | None = None
        self._sent = self._first_sent = -np.inf
        self.sent: list[tuple[float, Point3]] = []
        self._resends = 0
        self._progress = 0.0, math.inf
        self._vertex: Floats | None = None
        self._corridor: LegCorridor | None = None
        self._targets: list[Floats] = []
        self._freeze = FrozenFlight(policy.freeze)
        session.watch(_fault)

    def _reported_position(self) -> Floats:
        place = self.session.latest.position
        assert place is not None
        return np.array(place, dtype=float)

    @property
    def position(self) -> Floats:
        """Return the position that the vehicle reported last, shape (3,), m."""
        return self._position

    @property
    def yaw(self) -> float:
        """Return the heading, rad from the x axis."""
        heading = self.session.latest.heading
        return 0.0 if heading is None else float(np.radians(90.0 - heading))

    @property
    def time(self) -> float:
        """Return the seconds since the flight began, by the vehicle's clock."""
        return self.session.latest.time - self._begin

    def go(
        self,
        path: Floats,
        seconds: float,
        yaw: float,
        water: Floats,
        fresh: bool,
        pull: Floats | None = None,
    ) -> tuple[list[Floats], int]:
        """Follow a path for some seconds of the vehicle's clock.

        Only the path and the time have an effect.

        Parameters
        ----------
        path : ndarray, shape (k, 3)
            Vertices to pass, m.
        seconds : float
            Time, s.
        yaw, water, fresh, pull
            Not used: yaw is up to the pilot, and the rest is for simulated vehicles.

        Returns
        -------
        points : list of ndarray
            Positions that the vehicle reported meanwhile.
        count : int
            Number of vertices passed.

        Raises
        ------
        StopsFlightError
            The flight must not go on (`check`).
        """
        del yaw, water, fresh, pull
        until, passed = self.time + seconds, 0
        points: list[Floats] = self._new_positions()  # those that came while a plan was made
        while True:
            self.check()
            while passed < len(path) and self._is_at(path[passed]):
                passed += 1
            # the vehicle waits at the last vertex
            self._send(self._next_target(path[min(passed, len(path) - 1)]))
            if self.time >= until:
                break
            self.session.sleep(self.policy.poll_s)
            points += self._new_positions()
        return points or [self._position.copy()], passed

    def _new_positions(self) -> list[Floats]:
        """Return the new positions; stop the flight if they are off its path, or frozen."""
        reported, places = self.session.latest.velocity, self.session.new_places()
        velocity = None if reported is None else np.array(reported, dtype=float)
        for place in places:
            self._position = place
            self._freeze.observe(self.time, place, velocity)
            self._check_path()
        if places and self._target is not None:
            wait_s = 0.0 if self._is_echoed else self.policy.resend_s
            fault = self._freeze.fault(
                self.time, np.array(self._target), self._first_sent, 0.5 * self.reach, wait_s
            )
            if fault is not None:
                self.session.distrust(fault)
                raise StopsFlightError(f"the position is frozen: {fault}")
        return places

    def _is_at(self, vertex: Floats) -> bool:
        target = np.array([*vertex[:2], altitude(float(vertex[2]))])
        return float(np.linalg.norm(self._position - target)) <= self.reach

    def hold(self) -> None:
        """Hold the vehicle's place, if the flight may go on."""
        self.check()
        self.halt()

    def halt(self) -> None:
        """Stop the vehicle where it is, even if its estimate is unreliable."""
        self._position = self._reported_position()
        self._vertex, self._corridor = None, self._corridor_to(self._position)
        self._send(self._position)

    def keep(self) -> None:
        """Send the last target again if the vehicle may not have it."""
        if self._target is not None:
            self._position = self._reported_position()
            self._send(np.array(self._target))

    def stop_at(self, place: Floats) -> None:
        """Take a place, shape (3,), m, for the vehicle's position; nothing is sent."""
        self._position = np.array(place, dtype=float)

    def check(self) -> None:
        """Raise StopsFlightError if the flight must not go on."""
        session = self.session
        fault = session.fault or _fault(session.latest)
        if fault is not None:
            raise StopsFlightError(fault)
        if session.silent_s > self.policy.max_silence_s:
            raise StopsFlightError(f"the link is lost: no heartbeat for {session.silent_s:.0f} s")
        if session.position_age_s > self.policy.max_position_age_s:
            raise StopsFlightError(
                f"the link is lost or carries no position: none for {session.position_age_s:.0f} s"
            )
        if session.stalled_s > self.policy.max_clock_stall_s:
            raise StopsFlightError(
                f"the vehicle's clock stands still: its messages have had the same time for "
                f"{session.stalled_s:.0f} s"
            )
        aiding_fault = self.aiding_fault
        if aiding_fault is not None:
            raise StopsFlightError(f"the position estimate drifts: {aiding_fault}")

    @property
    def aiding_fault(self) -> str | None:
        """Return why nothing corrects the position estimate; None if something does."""
        policy = self.policy
        return self.session.aiding_fault(policy.min_source_loss_s, policy.max_gps_age_s)

    def _check_path(self) -> None:
        """Stop a vehicle that is off the path to its target: obstacles may lie between them.

        The plan and the depth are measured separately: on a sloping leg a vehicle may lag
        in depth.
        """
        if self._corridor is None:
            return
        self._corridor.observe(self._position)
        off = self._corridor.distance(self._position)
        if off > self.policy.max_path_error:
            raise StopsFlightError(f"the vehicle is {off:.1f} m off its path")
        off, side = self._corridor.depth_error(self._position)
        if off > self.policy.max_depth_error:
            raise StopsFlightError(f"the vehicle is {off:.1f} m {side} the depth of its path")

    def _corridor_to(self, vertex: Floats) -> LegCorridor:
        """Return the corridor from the vehicle to a vertex."""
        reported = self.session.latest.velocity
        velocity = np.zeros(3) if reported is None else np.array(reported, dtype=float)
        return LegCorridor(self._position, velocity, vertex, self.policy)

    def _next_target(self, vertex: Floats) -> Floats:
        """Return the next target on the path to a vertex.

        On a sloping leg, intermediate targets keep the vehicle at the depth of the leg.
        """
        if self._vertex is None or not np.array_equal(vertex, self._vertex):
            self._vertex = vertex.copy()
            end = np.array([*vertex[:2], altitude(float(vertex[2]))])
            self._corridor = self._corridor_to(end)
            self._targets = self._targets_to(vertex)
        while len(self._targets) > 1 and self._is_at(self._targets[0]):
            self._targets.pop(0)
        return self._targets[0]

    def _targets_to(self, vertex: Floats) -> list[Floats]:
        away = vertex - self._position
        if float(np.hypot(*away[:2])) <= 2.0 * self.reach:
            return [vertex]  # straight down: never off the leg
        count = max(1, math.ceil(abs(float(away[2])) / self.policy.max_depth_step))
        return [self._position + away * (k / count) for k in range(1, count)] + [vertex]

    def _send(self, place: Floats) -> None:
        x, y, z = (float(v) for v in place)
        target = (x, y, altitude(z))
        now = self.time
        if target != self._target:
            self.sent.append((now, target))
            self._resends, self._first_sent = 0, now
        elif not self._is_missed(now - self._sent):
            return
        self._target, self._sent = target, now
        self._progress = now, self._distance_left()
        self.session.link.send(target_message(self.session, target))

    @property
    def _is_echoed(self) -> bool:
        """Return whether the vehicle has echoed the target since it was sent.

        The depth of an echo may be from another level.
        """
        echo = self.session.echo
        if echo is None or self._target is None or echo[1] >= self.time - self._first_sent:
            return False
        off = np.array(echo[0][:2]) - self._target[:2]
        return float(np.linalg.norm(off)) <= self.policy.max_echo_error

    def _is_missed(self, waited_s: float) -> bool:
        """Return whether the vehicle does not have the last target, and should get it again."""
        if waited_s < self.policy.resend_s:
            return False
        assert self._target is not None
        echo = self.session.echo
        if echo is not None and echo[1] < waited_s:
            apart = np.array(echo[0]) - self._target
            off = float(np.hypot(*apart[:2]))
            if float(np.linalg.norm(apart)) <= self.policy.max_echo_error:
                return False
        else:
            off = 0.0
        if off > self.policy.max_echo_error:
            if self._resends >= self.policy.max_resends:
                raise StopsFlightError(
                    f"the vehicle does not accept its target: it goes to one {off:.1f} m away"
                )
            self._resends += 1
            return True
        # no echo, or one that differs in depth, which may be from another level
        if self.time - self._progress[0] < self.policy.resend_s:
            return False
        before, left = self._progress[1], self._distance_left()
        self._progress = self.time, left
        return left > self.reach and before - left < self.policy.min_approach

    def _distance_left(self) -> float:
        """Return the distance to the target, m."""
        return float(np.linalg.norm(self._position - np.array(self._target)))


def _fault(now: Fix) -> str | None:
    """Return why a flight must not go on; None if it may."""
    if now.estimate is False:
        return "the vehicle has lost its position estimate"
    if now.armed is False:
        return "the vehicle was disarmed"
    if now.mode != mode_name(Mode.GUIDED):
        return f"the pilot has taken over: the mode is {now.mode}"
    return None


def target_message(session: Session, target: Point3) -> object:
    """Return a target, m in the site, as SET_POSITION_TARGET_LOCAL_NED or _GLOBAL_INT."""
    m, frame = dialect(), session.frame
    boot, unused = int(session.latest.time * 1000.0) & 0xFFFFFFFF, (0.0,) * 8
    ids = session.system or 1, AUTOPILOT
    if frame.is_global:
        lat, lon, alt = frame.to_global(target)
        kind = m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        return m.MAVLink_set_position_target_global_int_message(
            boot, *ids, kind, POSITION_ONLY, lat, lon, alt, *unused
        )
    north, east, down = frame.to_local(target)
    return m.MAVLink_set_position_target_local_ned_message(
        boot, *ids, m.MAV_FRAME_LOCAL_NED, POSITION_ONLY, north, east, down, *unused
    )

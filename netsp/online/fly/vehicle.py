"""A vehicle at the other end of a link, as `execute` drives it: position targets, vertex by vertex.

ArduSub in GUIDED holds a position target for good, while one with a velocity times out; so only
positions are sent. Datagrams get lost, but a target that is sent again is planned for anew, and the
vehicle falls behind in depth: it is sent again only if the vehicle says, or shows, that it does not
have it. ArduSub does not go above home and has taken an altitude of 0 for "keep the present one"
(../export/write.py): targets are at least a decimetre deep.
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
from netsp.online.fly.stuck_position import StuckPosition
from netsp.online.guard.telemetry import Fix
from netsp.online.link.dialect import dialect
from netsp.online.link.modes import GUIDED, mode_name
from netsp.online.link.session import Session

POSITION_ONLY = 0x0DF8
"""Type mask: velocities, accelerations, yaw and its rate do not count."""

LOOK_S = 0.05
"""Seconds between two looks at what came."""


class LinkedVehicle:
    """Drives a vehicle over a link; see `netsp.world.vehicle.Vehicle`.

    Parameters
    ----------
    session : Session
        With a position.
    reach : float
        A vertex this near is reached, metres.
    policy : FlightPolicy, optional
        Limits of the flight; by default those of the class.
    """

    policy = FlightPolicy()

    def __init__(self, session: Session, reach: float, policy: FlightPolicy | None = None) -> None:
        self.session, self.reach = session, reach
        if policy is not None:
            self.policy = policy
        self.control_s: list[float] = []
        self._begin = session.now.time
        self._position = self._told()
        self._target: Point3 | None = None
        self._sent = self._first_sent = -np.inf
        self.sent: list[tuple[float, Point3]] = []
        self._resends = 0
        self._mark = 0.0, math.inf
        self._vertex: Floats | None = None
        self._corridor: LegCorridor | None = None
        self._stages: list[Floats] = []
        self._frozen = StuckPosition(self.policy)
        session.watch(_wrong)

    def _told(self) -> Floats:
        place = self.session.now.position
        assert place is not None
        return np.array(place, dtype=float)

    @property
    def position(self) -> Floats:
        """(3,) where it said last that it is, metres."""
        return self._position

    @property
    def yaw(self) -> float:
        """Heading, radians from the x axis."""
        heading = self.session.now.heading
        return 0.0 if heading is None else float(np.radians(90.0 - heading))

    @property
    def time(self) -> float:
        """Seconds since the flight began, by the vehicle's clock."""
        return self.session.now.time - self._begin

    def go(
        self, path: Floats, seconds: float, yaw: float, water: Floats, fresh: bool,
        pull: Floats | None = None,
    ) -> tuple[list[Floats], int]:  # fmt: skip
        """Follow a path for some seconds of the vehicle's clock.

        Parameters
        ----------
        path : ndarray, shape (k, 3)
            Vertices to pass, metres.
        seconds : float
            How long.
        yaw : float
            Has no effect: which way it looks is the pilot's.
        water : ndarray, shape (3,)
            Has no effect.
        fresh : bool
            Whether the path does not continue the one before.
        pull : ndarray, shape (3,), optional
            Has no effect.

        Returns
        -------
        points : list of ndarray
            Where it has said that it is meanwhile.
        count : int
            How many vertices are behind it.

        Raises
        ------
        StopsFlightError
            The link, the estimate, the mode or arming are not what they were.
        """
        del yaw, water, fresh, pull
        until, passed = self.time + seconds, 0
        points: list[Floats] = self._hear()  # while a plan was made
        while True:
            self.check()
            while passed < len(path) and self._at(path[passed]):
                passed += 1
            # the last one is held until it is told to go on
            self._send(self._stage(path[min(passed, len(path) - 1)]))
            if self.time >= until:
                break
            self.session.sleep(LOOK_S)
            points += self._hear()
        return points or [self._position.copy()], passed

    def _hear(self) -> list[Floats]:
        """Take the positions that have come, and stop the flight if one is off its path or none
        ever changes; return them."""
        velocity, places = self.session.now.velocity, self.session.places()
        moving = None if velocity is None else np.array(velocity, dtype=float)
        for place in places:
            self._position = place
            self._frozen.take(place, moving, self.time)
            self._check_path()
        if places and self._target is not None:
            fault = self._frozen.fault(
                self.time, np.array(self._target), self._first_sent, 0.5 * self.reach,
                self._is_echoed,
            )  # fmt: skip
            if fault is not None:
                self.session.distrust(fault)
                raise StopsFlightError(f"the position is frozen: {fault}")
        return places

    def _at(self, vertex: Floats) -> bool:
        there = np.array([*vertex[:2], altitude(float(vertex[2]))])
        return float(np.linalg.norm(self._position - there)) <= self.reach

    def hold(self) -> None:
        """Stay where it is, if it is still ours."""
        self.check()
        self.halt()

    def halt(self) -> None:
        """Stop the vehicle where it is, even if its estimate is unreliable."""
        self._position = self._told()
        self._vertex, self._corridor = None, self._corridor_to(self._position)
        self._send(self._position)

    def keep(self) -> None:
        """Send the last target again if the vehicle may not have it."""
        if self._target is not None:
            self._position = self._told()
            self._send(np.array(self._target))

    def stop_at(self, place: Floats) -> None:
        """Where a place differs from what it said, its estimate is off: that is not moved.

        Parameters
        ----------
        place : ndarray, shape (3,)
            Metres.
        """
        self._position = np.array(place, dtype=float)

    def check(self) -> None:
        """Whether the flight may go on.

        Raises
        ------
        StopsFlightError
            It may not.
        """
        session = self.session
        wrong = session.broken or _wrong(session.now)
        if wrong is not None:
            raise StopsFlightError(wrong)
        if session.silent_s > self.policy.max_silence_s:
            raise StopsFlightError(f"the link is lost: no heartbeat for {session.silent_s:.0f} s")
        if session.unplaced_s > self.policy.max_position_age_s:
            raise StopsFlightError(
                f"the link is lost or carries no position: none for {session.unplaced_s:.0f} s"
            )

        if session.stalled_s > self.policy.max_clock_stall_s:
            raise StopsFlightError(
                f"the vehicle's clock stands still: its messages have had the same time for "
                f"{session.stalled_s:.0f} s"
            )
        source = self.source_lost
        if source is not None:
            raise StopsFlightError(f"the position estimate drifts: {source}")

    @property
    def source_lost(self) -> str | None:
        """Fault of the sources of the position estimate; None if there is none."""
        policy = self.policy
        return self.session.source_lost(policy.min_source_loss_s, policy.max_gps_age_s)

    def _check_path(self) -> None:
        """Stop a vehicle that is not on the way to its target, because what lies between it and its
        target is not what was planned.

        The plan and the depth are measured separately: on a sloping leg a vehicle may lag in depth.
        """
        if self._corridor is None:
            return
        here = self._position
        self._corridor.take(here)
        off = self._corridor.distance(here)
        if off > self.policy.max_path_error:
            raise StopsFlightError(f"the vehicle is {off:.1f} m off its path")
        off, side = self._corridor.depth_error(here)
        if off > self.policy.max_depth_error:
            raise StopsFlightError(f"the vehicle is {off:.1f} m {side} the depth of its path")

    def _corridor_to(self, vertex: Floats) -> LegCorridor:
        """Return the corridor from where the vehicle is to a vertex."""
        velocity = self.session.now.velocity
        moving = np.zeros(3) if velocity is None else np.array(velocity, dtype=float)
        return LegCorridor(self._position, moving, vertex, self.policy)

    def _stage(self, vertex: Floats) -> Floats:
        """Return the next target on the way to a vertex: on a leg that slopes, intermediate ones
        keep the vehicle at the depth of the leg."""
        if self._vertex is None or not np.array_equal(vertex, self._vertex):
            self._vertex = vertex.copy()
            end = np.array([*vertex[:2], altitude(float(vertex[2]))])
            self._corridor = self._corridor_to(end)
            self._stages = self._stages_to(vertex)
        while len(self._stages) > 1 and self._at(self._stages[0]):
            self._stages.pop(0)
        return self._stages[0]

    def _stages_to(self, vertex: Floats) -> list[Floats]:
        away = vertex - self._position
        if float(np.hypot(*away[:2])) <= 2.0 * self.reach:
            return [vertex]  # straight down: nowhere off the leg
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
        self._mark = now, self._left()
        self.session.link.send(target_message(self.session, target))

    @property
    def _is_echoed(self) -> bool:
        """Return whether the vehicle has said, since it was sent the target, that it goes there.
        The depth of an echo may be told from another level."""
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
        # no echo, or one that differs in depth, which may be told from another level
        if self.time - self._mark[0] < self.policy.resend_s:
            return False
        before, left = self._mark[1], self._left()
        self._mark = self.time, left
        return left > self.reach and before - left < self.policy.min_approach

    def _left(self) -> float:
        """Return the distance to the target, metres."""
        return float(np.linalg.norm(self._position - np.array(self._target)))


def _wrong(now: Fix) -> str | None:
    """What a flight must not go on after."""
    if now.estimate is False:
        return "the vehicle has lost its position estimate"
    if now.armed is False:
        return "the vehicle was disarmed"
    if now.mode != mode_name(GUIDED):
        return f"the pilot has taken over: the mode is {now.mode}"
    return None


def target_message(session: Session, target: Point3) -> object:
    """A position target as it goes over the link.

    Parameters
    ----------
    session : Session
        The vehicle.
    target : (x, y, z)
        In the site, metres.

    Returns
    -------
    MAVLink_message
        SET_POSITION_TARGET_LOCAL_NED, or _GLOBAL_INT where the site knows where it is.
    """
    m, frame = dialect(), session.frame
    boot, rest = int(session.now.time * 1000.0) & 0xFFFFFFFF, (0.0,) * 8
    if frame.is_global:
        lat, lon, alt = frame.to_global(target)
        return m.MAVLink_set_position_target_global_int_message(
            boot, session.system or 1, 1, m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, POSITION_ONLY,
            lat, lon, alt, *rest,
        )  # fmt: skip
    north, east, down = frame.to_local(target)
    return m.MAVLink_set_position_target_local_ned_message(
        boot, session.system or 1, 1, m.MAV_FRAME_LOCAL_NED, POSITION_ONLY,
        north, east, down, *rest,
    )  # fmt: skip

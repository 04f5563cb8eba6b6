"""A fake ArduSub for tests: it talks MAVLink, flies and fails as the real one was seen to do.

What it does is held against recordings of the real one (`tests/test_autopilot_recordings.py`,
`tests/data/ardusub47`). With one set of numbers (`MotionParams`, `FilterParams`) it needs 2 % more
than the recorded time for the tour of the wharf, 1 % more for that of the pool, and within 5 % for
the mission in space, whose single legs differ by up to 15 %. Its speeds are within 0.04 m/s, and
its distance from the path within 0.05 m. Legs sag in depth within 0.1 m of the recording; on 30 m
out and 11 m down by 1.8 m against 2.0 m with repeated targets, and not at all without, where the
real one sagged by 0.5 m. At a right angle it overshoots by 0.50 to 0.63 m against 0.48 m. The drift
of a lost estimate (within 25 %) and the gate of a GPS that jumps come from one flight each. Above
0.5 m/s nothing was recorded.

It is a process of its own, so that a test meets it as it would meet a vehicle: over UDP. What the
vehicle believes goes out as telemetry; what is true is told on standard output, as lines of JSON;
what befalls it (a lost estimate, a push, the pilot's hand) comes in on standard input:

    {"do": "lose_estimate"}, {"do": "restore_estimate"}, {"do": "mode", "mode": 19},
    {"do": "arm"}, {"do": "disarm"}, {"do": "silence", "seconds": 5}, {"do": "jump", "by": [1, 0]},
    {"do": "gps_jump", "by": [0, 5.6]}, {"do": "push", "by": [1, 0, 0]},
    {"do": "current", "by": [0.5, 0]}, {"do": "freeze"}, {"do": "place", "at": [0, 0, -1]},
    {"do": "quit"}

``lose_estimate`` takes the GPS away, ``gps_jump`` moves it, and the filter deals with either as it
was recorded to do (`Estimate`); ``jump`` moves the estimate itself at once, and ``freeze`` stops it
where it is while it is still told. With ``"silent": true`` the lost GPS sends no GPS_RAW_INT any
more.

All durations are in simulated time, also those of failsafes: at a pace of 20 a ground station has
to be heard every 250 ms. The parameter FS_GCS_TIMEOUT loosens that, and FS_PILOT_INPUT = 2 makes
it want a pilot's input as well. A machine that is too slow for the pace slows the simulation down
and nothing else.

Inside, points are east, north, up; only messages have them as north, east, down.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import random
import selectors
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

if TYPE_CHECKING:
    import numpy as np

Vec = tuple[float, float, float]

STEP = 0.02
"""Seconds of a step of the simulation."""

BURST = 25
"""Steps that are made up for at once; a machine farther behind lets simulated time slip."""

RADIUS = 2.0
"""Metres about a waypoint within which it counts as reached (WPNAV_RADIUS)."""

STRAY_S, STRAY, MAX_STRAY = 4.0, 0.01, 0.02
"""Noise in the speed of the vehicle: seconds of memory, m/s of spread and at most."""

CREEP = 0.05
"""Speed at which a vehicle moves whose target with a velocity has timed out, m/s."""

SURFACING_SPEED = 0.3
"""Speed of ascent in the mode SURFACE, m/s."""

GCS_TIMEOUT_S = 5.0
"""Default of FS_GCS_TIMEOUT: seconds without a heartbeat of the ground station until it disarms."""

PILOT_TIMEOUT_S = 3.0
"""Default of FS_PILOT_TIMEOUT: seconds without a pilot's input until it disarms (if enabled)."""

VELOCITY_TIMEOUT_S = 3.0
"""Seconds after which a target with a velocity is dropped unless it is repeated."""

MAX_MISSION_ITEMS = 655
"""Items of a mission, home included; a longer one is refused with NO_SPACE."""

FENCE_STORAGE_BYTES = 672
"""Bytes of ArduPilot's storage for fences (160 + 256 + 256)."""

FENCE_HEADER_BYTES = 5
"""Bytes of that storage that no fence may use: four at its begin and one at its end."""

CIRCLE_BYTES = 13
"""Bytes of a circular fence: its type, its centre and its radius."""

POLYGON_BYTES, VERTEX_BYTES = 2, 8
"""Bytes of a polygonal fence beside its vertices (type and count), and of each vertex."""

TEST_PORTS = range(10_000, 14_000)
"""UDP ports on which tests listen, below the ports that systems choose themselves."""

DISARMED_BY_COMMAND, DISARMED_BY_GCS_FAILSAFE = 1, 18
"""Numbers of the methods of disarming in the vehicle's log (ARM.Method)."""

GROUND_STATION = 255

SURFACE_M = 0.0
"""Height of the water's surface, m: no thruster lifts the vehicle out of the water."""

STABILIZE, ALT_HOLD, AUTO, GUIDED, SURFACE, POSHOLD, MANUAL = 0, 2, 3, 4, 9, 16, 19
MODES = (STABILIZE, ALT_HOLD, AUTO, GUIDED, SURFACE, POSHOLD, MANUAL)
STEERED = (AUTO, GUIDED, POSHOLD)

POSITION_BITS, VELOCITY_BITS, YAW_BIT = 0x007, 0x038, 0x400
POSITION_ONLY = 0x0DF8
RELATIVE_FRAMES = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
ABSOLUTE_FRAMES = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
NAVIGATION = (
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM,
    mavlink.MAV_CMD_NAV_LOITER_TIME,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
)
FIRST_DO_COMMAND = 112
FENCE_POLYGONS = (
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
)
FENCE_CIRCLES = (
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
)
FENCE_INCLUSIONS = (FENCE_POLYGONS[0], FENCE_CIRCLES[0])

EKF_TIMED_OUT = (
    mavlink.EKF_ATTITUDE
    | mavlink.EKF_VELOCITY_HORIZ
    | mavlink.EKF_VELOCITY_VERT
    | mavlink.EKF_POS_VERT_ABS
)
EKF_LOST = EKF_TIMED_OUT | mavlink.EKF_CONST_POS_MODE
EKF_WELL = (
    EKF_TIMED_OUT
    | mavlink.EKF_POS_HORIZ_REL
    | mavlink.EKF_POS_HORIZ_ABS
    | mavlink.EKF_PRED_POS_HORIZ_REL
    | mavlink.EKF_PRED_POS_HORIZ_ABS
)
SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
)


# vectors


def plus(a: Vec, b: Vec, times: float = 1.0) -> Vec:
    return a[0] + times * b[0], a[1] + times * b[1], a[2] + times * b[2]


def minus(a: Vec, b: Vec) -> Vec:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(a: Vec, by: float) -> Vec:
    return a[0] * by, a[1] * by, a[2] * by


def size(a: Vec) -> float:
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def limited(a: Vec, most: float) -> Vec:
    length = size(a)
    return a if length <= most else scaled(a, most / length)


def ned(a: Vec) -> Vec:
    """North, east, down of east, north, up; and back."""
    return a[1], a[0], -a[2]


def rounded(a: Vec) -> list[float]:
    return [round(v, 4) for v in a]


class Earth:
    """The plane about the origin of the estimate, as ArduPilot lays it out."""

    METRES = 0.011131884502145034
    """Metres of 1e-7 degrees of latitude."""

    def __init__(self, latitude: float, longitude: float) -> None:
        self.latitude, self.longitude = round(latitude * 1e7), round(longitude * 1e7)

    def _narrowing(self, latitude: float) -> float:
        """Of a meridian: half way between the origin and a latitude."""
        return max(math.cos(math.radians(0.5e-7 * (self.latitude + latitude))), 0.01)

    def geographic(self, point: Vec) -> tuple[int, int]:
        north = point[1] / self.METRES
        east = point[0] / self.METRES / self._narrowing(self.latitude + north)
        return self.latitude + round(north), self.longitude + round(east)

    def local(self, latitude: int, longitude: int) -> tuple[float, float]:
        """Metres to the east and to the north."""
        east = (longitude - self.longitude) * self.METRES * self._narrowing(latitude)
        return east, (latitude - self.latitude) * self.METRES


# what the vehicle is and believes


@dataclass(frozen=True)
class Options:
    """How the vehicle is set up."""

    to: tuple[str, int]
    seed: int = 0
    pace: float = 1.0
    speed: float = 0.5
    noise: float = 0.0
    smooth: float = 0.0
    drift: float = 0.0
    origin: tuple[float, ...] = (55.5, 12.7)
    start: tuple[float, ...] = (0.0, 0.0, 0.0)
    current: tuple[float, ...] = (0.0, 0.0)
    sysid: int = 1
    estimate: bool = True
    echo: bool = True
    """Sends POSITION_TARGET_LOCAL_NED and _GLOBAL_INT when it is asked to."""

    kind: int = mavlink.MAV_TYPE_SUBMARINE
    autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    params: dict[str, float] = field(default_factory=dict)


class Wandering:
    """Noise with a memory (Ornstein-Uhlenbeck) of a spread that does not grow; without a memory
    it is white."""

    def __init__(self, chance: random.Random, spread: Vec, memory: float) -> None:
        self.chance, self.spread = chance, spread
        self.keep = math.exp(-STEP / memory) if memory > 0.0 else 0.0
        self.fresh = math.sqrt(1.0 - self.keep**2)
        self.value: Vec = (0.0, 0.0, 0.0)

    def step(self) -> Vec:
        if any(self.spread):
            gauss, (x, y, z), (a, b, c) = self.chance.gauss, self.value, self.spread
            self.value = (
                self.keep * x + self.fresh * gauss(0.0, a),
                self.keep * y + self.fresh * gauss(0.0, b),
                self.keep * z + self.fresh * gauss(0.0, c),
            )
        return self.value


@dataclass(frozen=True)
class FilterParams:
    """How the filter deals with a GPS that is lost or wrong, from `tests/data/ardusub47`.

    Parameters
    ----------
    no_fix_s : float
        Seconds from the loss until GPS_RAW_INT tells of no fix.
    timeout_s : float
        Seconds without an accepted position until EKF_STATUS_REPORT says that there is no
        horizontal position, and until a rejected one is accepted all the same.
    aiding_s : float
        Seconds without any until the filter stops aiding: LOCAL_POSITION_NED ends.
    velocity_error, acceleration_error : float
        Growth of the error of dead reckoning, m/s and m/s².
    gate, gate_growth : float
        A position farther off than this is rejected, m, and what the bound grows by, m/s.
    absorb_s : float
        Time constant in which an accepted position moves the estimate, s.
    glitch_s, glitch_ends_s : float
        Seconds from the first rejection until EKF_GPS_GLITCHING is set, and from acceptance until
        it is cleared.
    """

    no_fix_s: float = 0.4
    timeout_s: float = 7.2
    aiding_s: float = 15.2
    velocity_error: float = 0.025
    acceleration_error: float = 0.039
    gate: float = 3.75
    gate_growth: float = 0.255
    absorb_s: float = 0.35
    glitch_s: float = 1.5
    glitch_ends_s: float = 10.0


class Estimate:
    """Position that the vehicle believes in: the truth, noise, a slow drift and jumps.

    Without a GPS it is dead reckoning, whose error grows, until the filter gives up. A GPS that
    jumps is rejected for some seconds and then believed. Depth comes from pressure and is not
    touched by either.
    """

    def __init__(self, options: Options, chance: random.Random) -> None:
        n, d = options.noise, options.drift
        self.params, self.chance = FilterParams(), random.Random(options.seed + 1)
        self.noise = Wandering(chance, (n, n, n), options.smooth)
        self.drift = Wandering(chance, (d, d, 0.0), 60.0)
        self.jumped: Vec = (0.0, 0.0, 0.0)
        self.is_frozen = False
        self.has_gps = self.has_position = self.ever = options.estimate
        self.point: Vec = (0.0, 0.0, 0.0)
        self.velocity: Vec = (0.0, 0.0, 0.0)
        self.lost_at: float | None = None if options.estimate else -math.inf
        self.heading: Vec = (1.0, 0.0, 0.0)
        self.gps_error: Vec = (0.0, 0.0, 0.0)
        self.absorbed: Vec = (0.0, 0.0, 0.0)
        self.rejected_at: float | None = None
        self.accepted_at: float | None = None
        self.now = 0.0

    @property
    def lost_s(self) -> float:
        """Seconds since the GPS was lost; 0 while there is one."""
        return 0.0 if self.lost_at is None else self.now - self.lost_at

    @property
    def well(self) -> bool:
        """Tell whether the filter's flags say that there is a horizontal position."""
        return self.lost_s < self.params.timeout_s

    @property
    def has_fix(self) -> bool:
        return self.lost_s < self.params.no_fix_s

    @property
    def pending(self) -> Vec:
        """Return how far off the GPS is from the estimate, noise aside."""
        return minus(self.gps_error, self.absorbed)

    @property
    def innovation(self) -> float:
        """Return the distance of the GPS from the estimate over the bound of acceptance."""
        return size(self.pending) / self._gate if self.has_gps else 0.0

    @property
    def _gate(self) -> float:
        waited = 0.0 if self.rejected_at is None else self.now - self.rejected_at
        return self.params.gate + self.params.gate_growth * waited

    @property
    def flags(self) -> int:
        """Return the flags of EKF_STATUS_REPORT."""
        if not self.has_position:
            return EKF_LOST
        if not self.well:
            return EKF_TIMED_OUT
        glitching = self.rejected_at is not None and (
            self.now - self.rejected_at >= self.params.glitch_s
        )
        if self.accepted_at is not None and glitching:
            glitching = self.now - self.accepted_at < self.params.glitch_ends_s
        return EKF_WELL | (mavlink.EKF_GPS_GLITCHING if glitching else 0)

    def lose(self) -> None:
        """Take the GPS away."""
        if self.lost_at is None:
            self.lost_at, self.has_gps = self.now, False
            angle = self.chance.uniform(0.0, 2.0 * math.pi)
            self.heading = (math.cos(angle), math.sin(angle), 0.0)

    def restore(self) -> None:
        """Give the GPS back, and believe it at once."""
        self.lost_at, self.has_gps, self.is_frozen = None, True, False
        self.has_position = self.ever = True
        self.absorbed, self.rejected_at, self.accepted_at = self.gps_error, None, None

    def move_gps(self, by: Vec) -> None:
        """Have the GPS tell of other places from now on."""
        self.gps_error = plus(self.gps_error, by)
        self.rejected_at = self.accepted_at = None

    def update(self, body: Body, now: float) -> None:
        """Advance to a time."""
        self.now = now
        error = plus(plus(self.noise.step(), self.drift.step()), self.jumped)
        if self.is_frozen:
            self.velocity = (0.0, 0.0, 0.0)
            return
        if self.has_gps:
            self._absorb()
        elif self.ever and self.lost_s >= self.params.aiding_s:
            self.has_position = False
        if not self.has_position:
            self.velocity = (0.0, 0.0, 0.0)
            return
        wrong = self.params.velocity_error + self.params.acceleration_error * self.lost_s
        far = 0.5 * (self.params.velocity_error + wrong) * self.lost_s
        error = plus(plus(error, self.absorbed), self.heading, far)
        self.point = plus(body.point, error)
        self.velocity = plus(body.velocity, self.heading, 0.0 if self.has_gps else wrong)

    def _absorb(self) -> None:
        if not any(self.pending):
            return
        if self.rejected_at is None and size(self.pending) > self.params.gate:
            self.rejected_at = self.now
        if self.rejected_at is not None and self.accepted_at is None:
            late = self.now - self.rejected_at >= self.params.timeout_s
            if not late and size(self.pending) > self._gate:
                return
            self.accepted_at = self.now
        step = min(STEP / self.params.absorb_s, 1.0)
        self.absorbed = plus(self.absorbed, self.pending, step)
        if size(self.pending) < 1e-3:
            self.absorbed = self.gps_error


@dataclass(frozen=True)
class MotionParams:
    """How the vehicle is controlled, and how it answers.

    The controller's numbers are the recorded vehicle's parameters. The answer of the vehicle
    (`drive`, `drag` and `stray`) is one set for all recordings in `tests/data/ardusub47`.

    Parameters
    ----------
    acceleration, acceleration_z : float
        Bounds in the plan and in depth, m/s² (WPNAV_ACCEL, WPNAV_ACCEL_Z).
    jerk : float
        Bound, m/s³ (WPNAV_JERK).
    bend_s : float
        Seconds that the jerk itself takes to rise and fall while speed is gained or lost.
    up, down : float
        Bounds of the vertical speed, m/s (WPNAV_SPEED_UP, WPNAV_SPEED_DN).
    gain, gain_z : float
        Speed of correction for a metre off the reference, 1/s (PSC_POSXY_P, PSC_POSZ_P).
    slack : float
        Share of its speed by which the reference may outrun the vehicle before its time slows.
    push : float
        Acceleration in the plan over the square of the command, 1/m: thrusters answer with the
        square. The command is the speed that is missing and its integral, m/s.
    drive_z : float
        Acceleration in depth over the command, 1/s.
    trim, trim_z : float
        Growth of the integral for each m/s that the speed is off the wanted one, 1/s: in the plan
        PSC_VELXY_I over PSC_VELXY_P.
    drag : float
        Deceleration over the square of the speed through the water, 1/m: measured where the
        recorded vehicles were left to themselves.
    thrust : float
        Bound on the acceleration by thrust along each axis, m/s².
    lag_s : float
        Seconds from a command of thrust to thrust.
    """

    acceleration: float = 2.5
    acceleration_z: float = 1.0
    jerk: float = 1.0
    bend_s: float = 0.5
    up: float = 2.5
    down: float = 1.5
    gain: float = 1.0
    gain_z: float = 3.0
    slack: float = 0.05
    push: float = 12.0
    drive_z: float = 1.8
    trim: float = 0.083
    trim_z: float = 0.15
    drag: float = 3.6
    thrust: float = 14.0
    lag_s: float = 0.2


class Leg:
    """A straight line from rest to rest, with limited speed, acceleration and jerk."""

    def __init__(self, origin: Vec, goal: Vec, speed: float, params: MotionParams) -> None:
        self.origin, self.goal = origin, goal
        away = minus(goal, origin)
        self.length = size(away)
        self.along: Vec = scaled(away, 1.0 / self.length) if self.length > 1e-9 else (1.0, 0.0, 0.0)
        flat, rise = math.hypot(self.along[0], self.along[1]), self.along[2]
        vertical = params.up if rise > 0.0 else params.down
        top = min(speed / max(flat, 1e-9), vertical / max(abs(rise), 1e-9))
        most = min(
            params.acceleration / max(flat, 1e-9), params.acceleration_z / max(abs(rise), 1e-9)
        )
        self._plan(max(top, 1e-3), most, params)

    def _plan(self, top: float, most: float, params: MotionParams) -> None:
        """Find the highest speed that the length allows, and the times of its phases."""

        def rise_s(speed: float) -> float:
            """Return the seconds from rest to a speed."""
            if speed * params.jerk >= most * most:
                return speed / most + most / params.jerk + params.bend_s
            return 2.0 * math.sqrt(speed / params.jerk) + params.bend_s

        if top * rise_s(top) > self.length:
            low = 0.0
            for _ in range(30):
                middle = 0.5 * (low + top)
                low, top = (low, middle) if middle * rise_s(middle) > self.length else (middle, top)
        self.top, self.rise_s = top, rise_s(top)
        self.end_s = self.rise_s + self.length / top

    def _rise(self, t: float) -> tuple[float, float]:
        """Return distance and speed so many seconds after rest: jerk up, then as much down."""
        jerk = 4.0 * self.top / self.rise_s**2
        if t <= 0.5 * self.rise_s:
            return jerk * t**3 / 6.0, 0.5 * jerk * t * t
        left = self.rise_s - t
        return self.top * (0.5 * self.rise_s - left) + jerk * left**3 / 6.0, (
            self.top - 0.5 * jerk * left * left
        )

    def at(self, t: float) -> tuple[float, float]:
        """Return distance and speed at a time."""
        if t >= self.end_s:
            return self.length, 0.0
        if t <= self.rise_s:
            return self._rise(t)
        if t >= self.end_s - self.rise_s:
            distance, speed = self._rise(self.end_s - t)
            return self.length - distance, speed
        return 0.5 * self.top * self.rise_s + self.top * (t - self.rise_s), self.top


class Body:
    """The vehicle in the water, and the controller that has it follow a reference.

    The reference runs along a `Leg`; where the vehicle falls behind, the reference's time slows. A
    goal that is set on the way is planned for anew: from rest, at the point where the vehicle
    would come to a stop. In depth that point is nearer than in the plan, which is why legs that
    slope sag when their goal is sent again and again.
    """

    def __init__(
        self, point: Vec, chance: random.Random, current: Vec = (0.0, 0.0, 0.0),
        params: MotionParams | None = None,
    ) -> None:  # fmt: skip
        self.point, self.chance, self.current = point, chance, current
        self.params = params or MotionParams()
        self.velocity: Vec = (0.0, 0.0, 0.0)
        self.yaw, self.bearing = 0.0, 0.0
        self.speed = 0.5
        self.leg: Leg | None = None
        self.time, self.rate = 0.0, 1.0
        self.reference, self.pace = point, self.velocity
        self.goal: Vec | None = None
        self.following = False
        self.creeping: Vec | None = None
        self.trim: Vec = (0.0, 0.0, 0.0)
        self.command: Vec = (0.0, 0.0, 0.0)
        self.wander = Wandering(chance, (STRAY, STRAY, 0.6 * STRAY), STRAY_S)

    @property
    def arrived(self) -> bool:
        """Tell whether the reference is at the goal."""
        return (
            self.following and self.leg is not None and self.goal == self.leg.goal
            and self.time >= self.leg.end_s
        )  # fmt: skip

    def place(self, point: Vec) -> None:
        self.point, self.velocity = point, (0.0, 0.0, 0.0)
        self.let_go()

    def let_go(self) -> None:
        """Stop following: the next goal is planned for from where the vehicle is then."""
        self.following, self.leg, self.creeping = False, None, None
        self.command = self.trim = (0.0, 0.0, 0.0)

    def aim(self, goal: Vec, believed: Vec, moving: Vec) -> None:
        """Plan for a goal, also when it is the same as before.

        Parameters
        ----------
        goal : (e, n, u)
            Where to go, m.
        believed, moving : (e, n, u)
            Position and velocity that the vehicle believes to have, m and m/s.
        """
        done = self.following and self.leg is not None and self.time >= self.leg.end_s
        if done:
            origin = self.reference
        else:
            origin = self._stopping_point(believed, moving)
            self.trim = self.command  # thrust does not jump
        self.goal = goal
        self._begin(Leg(origin, goal, self.speed, self.params))

    def _begin(self, leg: Leg) -> None:
        self.following = True
        self.leg, self.time, self.rate = leg, 0.0, 1.0
        self.reference, self.pace = leg.origin, (0.0, 0.0, 0.0)

    def _stopping_point(self, believed: Vec, moving: Vec) -> Vec:
        p = self.params
        flat = math.hypot(moving[0], moving[1])
        share = stopping_distance(flat, p.gain, p.acceleration) / flat if flat > 1e-6 else 0.0
        sink = stopping_distance(abs(moving[2]), p.gain_z, p.acceleration_z)
        return (
            believed[0] + share * moving[0],
            believed[1] + share * moving[1],
            min(believed[2] + math.copysign(sink, moving[2]), SURFACE_M),
        )

    def follow(self, believed: Vec, moving: Vec) -> None:
        """Advance by a step under control; without a goal, to a stop."""
        if self.goal is not None and (self.leg is None or self.leg.goal != self.goal):
            self.aim(self.goal, believed, moving)
        elif self.leg is None:
            stop = self._stopping_point(believed, moving)
            self._begin(Leg(stop, stop, self.speed, self.params))
        self._advance(believed, moving)
        p = self.params
        off = minus(self.reference, believed)
        flat = math.hypot(off[0], off[1])
        share = 0.0
        if flat > 1e-9:
            share = min(correction(flat, p.gain, p.acceleration), self.speed) / flat
        sink = math.copysign(
            min(correction(abs(off[2]), p.gain_z, p.acceleration_z), p.down), off[2]
        )
        stray = limited(self.wander.step(), MAX_STRAY)
        self._drive((
            self.pace[0] + share * off[0] + stray[0],
            self.pace[1] + share * off[1] + stray[1],
            self.pace[2] + sink + stray[2],
        ), moving)  # fmt: skip
        turn = (self.bearing - self.yaw + math.pi) % (2.0 * math.pi) - math.pi
        self.yaw += max(-0.6 * STEP, min(0.6 * STEP, turn))

    def _advance(self, believed: Vec, moving: Vec) -> None:
        """Move the reference, slower where the vehicle lags behind."""
        leg, p = self.leg, self.params
        assert leg is not None
        if self.time >= leg.end_s:
            self.reference, self.pace = leg.goal, (0.0, 0.0, 0.0)
            return
        wanted = 1.0
        speed = size(self.pace)
        if speed > 0.0:
            off = minus(self.reference, believed)
            behind = sum(off[i] * leg.along[i] for i in range(3))
            made = sum(moving[i] * leg.along[i] for i in range(3))
            wanted = max(0.0, min(1.0, p.slack + (made - p.gain * behind) / speed))
        self.rate += (wanted - self.rate) * STEP * p.jerk / p.acceleration
        self.time += self.rate * STEP
        distance, speed = leg.at(self.time)
        self.reference = plus(leg.origin, leg.along, distance)
        self.pace = scaled(leg.along, speed)

    def _drive(self, wanted: Vec, moving: Vec) -> None:
        """Advance the vehicle by a step towards a velocity."""
        p = self.params
        missing = minus(wanted, moving)
        # an integral does not grow while the thrusters give all they have
        is_full = p.push * math.hypot(self.command[0], self.command[1]) ** 2 >= p.thrust
        would_grow = missing[0] * self.command[0] + missing[1] * self.command[1] > 0.0
        gain = 0.0 if is_full and would_grow else p.trim
        self.trim = (
            self.trim[0] + STEP * gain * missing[0],
            self.trim[1] + STEP * gain * missing[1],
            self.trim[2] + STEP * p.trim_z * missing[2],
        )
        keep = min(STEP / p.lag_s, 1.0)
        self.command = plus(self.command, minus(plus(missing, self.trim), self.command), keep)
        east, north, up = self.command
        flat = math.hypot(east, north)
        strength = min(p.push * flat, p.thrust / max(flat, 1e-9))
        lift = max(-p.thrust, min(p.thrust, p.drive_z * up))
        self._swim((strength * east, strength * north, lift))

    def _swim(self, thrust: Vec) -> None:
        """Advance by a step under thrust and drag, in the plan and in depth by themselves."""
        through = minus(self.velocity, self.current)
        flat = 1.0 + STEP * self.params.drag * math.hypot(through[0], through[1])
        deep = 1.0 + STEP * self.params.drag * abs(through[2])
        self._move((
            self.current[0] + (through[0] + STEP * thrust[0]) / flat,
            self.current[1] + (through[1] + STEP * thrust[1]) / flat,
            self.current[2] + (through[2] + STEP * thrust[2]) / deep,
        ))  # fmt: skip

    def creep(self) -> None:
        """Advance a vehicle that holds its speed at what it takes for none."""
        if self.creeping is None:
            angle = self.chance.uniform(0.0, 2.0 * math.pi)
            self.creeping = (CREEP * math.cos(angle), CREEP * math.sin(angle), 0.0)
        self.following, self.leg = False, None
        self._drive(self.creeping, self.velocity)

    def drift(self, rise: float = 0.0) -> None:
        """Advance a vehicle that is left to the water, or only rises."""
        self.let_go()
        lift = self.params.drive_z * (rise - self.velocity[2]) if rise else 0.0
        self._swim((0.0, 0.0, lift))

    def _move(self, velocity: Vec) -> None:
        self.velocity = velocity
        self.point = plus(self.point, velocity, STEP)
        if self.point[2] > SURFACE_M:
            self.point = (self.point[0], self.point[1], SURFACE_M)
            self.velocity = (velocity[0], velocity[1], min(velocity[2], 0.0))


def stopping_distance(speed: float, gain: float, deceleration: float) -> float:
    """Return the metres in which `correction` comes to a stop from a speed."""
    if speed < deceleration / gain:
        return speed / gain
    return 0.5 * (deceleration / gain**2 + speed * speed / deceleration)


def correction(off: float, gain: float, deceleration: float) -> float:
    """Return the speed of correction for a distance: proportional near, its root farther off."""
    bend = deceleration / gain**2
    if off <= bend:
        return gain * off
    return math.sqrt(2.0 * deceleration * (off - 0.5 * bend))


@dataclass(frozen=True)
class Target:
    """A target of GUIDED."""

    point: Vec
    yaw: float | None
    moving: bool
    """Came with a velocity, and so has to be repeated."""


class Item(NamedTuple):
    """An item of a mission or a fence."""

    frame: int
    command: int
    p1: float
    p2: float
    p3: float
    p4: float
    x: int
    y: int
    z: float


@dataclass
class Upload:
    """A list that is coming in."""

    kind: int
    count: int
    sender: tuple[int, int]
    items: list[Item] = field(default_factory=list)
    asked: float = 0.0
    tries: int = 0


@dataclass(frozen=True)
class Fence:
    """A polygon or a circle (with a radius) that the vehicle is to stay in, or out of."""

    inside: bool
    corners: list[tuple[float, float]]
    radius: float = 0.0

    def keeps(self, point: Vec) -> bool:
        return self._contains(point[0], point[1]) == self.inside

    def _contains(self, x: float, y: float) -> bool:
        if self.radius > 0.0:
            return math.dist(self.corners[0], (x, y)) <= self.radius
        within = False
        for i, (x1, y1) in enumerate(self.corners):
            x0, y0 = self.corners[i - 1]
            if (y0 > y) != (y1 > y) and x < x0 + (x1 - x0) * (y - y0) / (y1 - y0):
                within = not within
        return within


def fence_bytes(items: Sequence[Item]) -> int:
    """Return the bytes of storage that a list of fences takes."""
    count = FENCE_HEADER_BYTES
    corners = 0
    for item in items:
        if item.command in FENCE_CIRCLES:
            count += CIRCLE_BYTES
            continue
        count += VERTEX_BYTES
        corners += 1
        if corners >= item.p1:
            count += POLYGON_BYTES
            corners = 0
    return count


# the link


class Wire:
    """The UDP socket; everyone who was heard hears everything."""

    def __init__(self, to: tuple[str, int]) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        self.peers = {to}
        self.silent = False

    @property
    def port(self) -> int:
        return int(self.socket.getsockname()[1])

    def write(self, data: bytes) -> None:
        if not self.silent:
            for peer in self.peers:
                # a full buffer loses a message, as radio does
                with contextlib.suppress(OSError):
                    self.socket.sendto(data, peer)

    def messages(self) -> Iterator[Any]:
        """What has come in."""
        while True:
            try:
                data, peer = self.socket.recvfrom(65536)
            except OSError:
                return
            if self.silent:
                continue
            self.peers.add(peer)
            # a parser for every datagram: garbage in one must not swallow the next
            parser = mavlink.MAVLink(None)
            parser.robust_parsing = True
            yield from parser.parse_buffer(data) or []


class Nowhere:
    """A link with nobody at the other end, which keeps what is sent."""

    def __init__(self) -> None:
        self.silent = False
        self.data = bytearray()

    def write(self, data: bytes) -> None:
        if not self.silent:
            self.data += data

    def messages(self) -> list[Any]:
        """Return the messages that were sent since this was last asked."""
        parser = mavlink.MAVLink(None)
        parser.robust_parsing = True
        data, self.data = bytes(self.data), bytearray()
        return parser.parse_buffer(data) or []


def tell(t: float, **what: object) -> None:
    """A line to the test."""
    sys.stdout.write(json.dumps({"t": round(t, 3), **what}) + "\n")
    sys.stdout.flush()


@dataclass
class Stream:
    """A message that is sent again and again."""

    send: Callable[[], None]
    default: float
    """Seconds between two, 0 for never."""

    group: int
    interval: float = 0.0
    due: float = 0.0


class Vehicle:
    """The autopilot: its state, what it does in a step, and what it answers."""

    def __init__(
        self, options: Options, wire: Wire | Nowhere, tell: Callable[..., None] = tell
    ) -> None:
        self.options, self.wire, self.tell = options, wire, tell
        self.mav: Any = mavlink.MAVLink(wire, srcSystem=options.sysid, srcComponent=1)
        self.chance = random.Random(options.seed)
        self.earth = Earth(*options.origin)
        east, north, *_ = options.current
        self.body = Body(
            (options.start[0], options.start[1], options.start[2]), self.chance, (east, north, 0.0)
        )
        self.estimate = Estimate(options, self.chance)
        self.steps = 0
        self.estimate.update(self.body, self.t)
        self.home: Vec | None = self.estimate.point if self.estimate.well else None
        self.armed, self.mode = False, MANUAL
        self.heard = self.input = self.silent_until = 0.0
        self.params = {
            "WPNAV_SPEED": 100.0 * options.speed,
            "MAV_SYSID": float(options.sysid),
            "MAV_GCS_SYSID": float(GROUND_STATION),
            "ARMING_SKIPCHK": -1.0,
            "FS_GCS_ENABLE": 2.0,
            "FS_GCS_TIMEOUT": GCS_TIMEOUT_S,
            "FS_EKF_ACTION": 0.0,
            "FS_PILOT_INPUT": 0.0,
            "FS_PILOT_TIMEOUT": PILOT_TIMEOUT_S,
            "FENCE_ENABLE": 0.0,
            **options.params,
        }
        self._reset_speed()
        self.target: Target | None = None
        self.refreshed = 0.0
        self.released = self.telling = False
        self.items: list[Item] = []
        self.current, self.flown, self.complete = 1, False, False
        self.leg_begins = self.tick = 0.0
        self.held: float | None = None
        self.upload: Upload | None = None
        self.fence_items: list[Item] = []
        self.fences: list[Fence] = []
        self.breached = self.gps_silent = False
        self.gps_place = (0, 0, 0)
        self._make_streams()
        self._make_commands()

    @property
    def t(self) -> float:
        return self.steps * STEP

    @property
    def ms(self) -> int:
        return round(self.t * 1000.0)

    def event(self, name: str, **what: object) -> None:
        self.tell(self.t, event=name, **what)

    def say(self, text: str, severity: int = mavlink.MAV_SEVERITY_WARNING) -> None:
        self.mav.statustext_send(severity, text.encode()[:50])

    # a step

    def step(self) -> None:
        self.steps += 1
        self.wire.silent = self.t < self.silent_until
        self._watch()
        self._drop_stale_target()
        if self.mode == AUTO:
            self._fly_mission()
        self._move()
        self._update_estimate()
        self._watch_fences()
        self._repeat_request()
        for stream in self.streams.values():
            if stream.interval > 0.0 and self.t >= stream.due - 1e-9:
                stream.due = max(stream.due, self.t - stream.interval) + stream.interval
                stream.send()
        if self.steps % 10 == 0:
            self._row()

    def _row(self) -> None:
        goal = self.body.goal if self.target is not None or self.mode == AUTO else None
        self.tell(
            self.t,
            true=rounded(self.body.point),
            est=rounded(self.estimate.point),
            armed=self.armed,
            mode=self.mode,
            target=None if goal is None or not self.armed else rounded(goal),
        )

    def _update_estimate(self) -> None:
        was_well, had_position = self.estimate.well, self.estimate.has_position
        rejected, accepted = self.estimate.rejected_at, self.estimate.accepted_at
        self.estimate.update(self.body, self.t)
        if was_well and not self.estimate.well:
            self.event("estimate timed out")
        if had_position and not self.estimate.has_position:
            self.event("estimate stopped")
            self.say("EKF3 IMU0 stopped aiding", mavlink.MAV_SEVERITY_CRITICAL)
        if self.estimate.rejected_at not in (rejected, None):
            self.event("gps rejected")
        if self.estimate.accepted_at not in (accepted, None):
            self.event("gps accepted")

    @property
    def steered(self) -> bool:
        return self.mode in STEERED and self.estimate.has_position and not self.released

    def _move(self) -> None:
        if not self.armed:
            self.body.drift()
        elif self.steered:
            self.body.follow(self.estimate.point, self.estimate.velocity)
            if self.telling and self.body.arrived and self.mode == GUIDED:
                self.telling = False
                self.event("arrived")
        elif self.mode in STEERED and self.released:
            self.body.creep()
        else:
            up = self.mode == SURFACE and self.body.point[2] < -0.02
            self.body.drift(SURFACING_SPEED if up else 0.0)

    def _watch(self) -> None:
        """The failsafes."""
        if not self.armed:
            return
        lost = self.t - self.heard >= self.params["FS_GCS_TIMEOUT"]
        if lost and self.params["FS_GCS_ENABLE"] == 2.0:
            self.say("MYGCS: heartbeat lost", mavlink.MAV_SEVERITY_CRITICAL)
            self.disarm("no heartbeat of a ground station", DISARMED_BY_GCS_FAILSAFE)
            return
        idle = self.t - self.input >= self.params["FS_PILOT_TIMEOUT"]
        if idle and self.params["FS_PILOT_INPUT"] == 2.0:
            self.say("Lost manual control", mavlink.MAV_SEVERITY_CRITICAL)
            self.disarm("no input of a pilot")

    # arming and modes

    def arm(self, why: str) -> None:
        if self.armed:
            return
        self.armed = True
        self.heard = self.input = self.t
        self._stand()
        if self.estimate.well:
            self.home = self.estimate.point
        self.event("armed", by=why)
        self.say("Arming motors", mavlink.MAV_SEVERITY_INFO)
        self._send_home()
        self._send_heartbeat()

    def disarm(self, why: str, method: int | None = None) -> None:
        if not self.armed:
            return
        self.armed = False
        self._stand()
        self.tick = self.t + 1.0
        self.event("disarmed", why=why, method=method)
        self.say("Disarming motors", mavlink.MAV_SEVERITY_INFO)
        self._send_heartbeat()

    def _stand(self) -> None:
        """Forget what there was to do."""
        self.target, self.released, self.telling = None, False, False
        self.body.goal = None
        self.body.let_go()
        self.leg_begins, self.held = self.t, None

    def refusal(self, mode: int) -> str | None:
        """Why a mode is not entered."""
        if mode not in MODES:
            return "no such mode"
        if mode != self.mode and mode in STEERED and not self.estimate.well:
            return "Mode requires position"
        if mode == AUTO and len(self.items) < 2:
            return "Mode change to AUTO failed: no mission"
        return None

    def enter(self, mode: int, by: str) -> None:
        if mode == self.mode:
            return
        self.mode = mode
        self._stand()
        self._reset_speed()
        if mode == AUTO:
            if self.complete:
                self.current, self.complete = 1, False
            self.flown = False
            self.tick = self.t + 1.0
        self.event("mode", mode=mode, by=by)
        self._send_heartbeat()

    def _reset_speed(self) -> None:
        self.body.speed = self.params["WPNAV_SPEED"] / 100.0

    # GUIDED

    def _on_set_position_target_local_ned(self, m: Any) -> None:
        point = ned((m.x, m.y, m.z))
        why = None
        if m.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED:
            why = "frame"
        self._receive(m, point, why)

    def _on_set_position_target_global_int(self, m: Any) -> None:
        above = self.home[2] if self.home is not None else 0.0
        relative = m.coordinate_frame in RELATIVE_FRAMES
        point = (*self.earth.local(m.lat_int, m.lon_int), m.alt + (above if relative else 0.0))
        why = None
        if not relative and m.coordinate_frame not in ABSOLUTE_FRAMES:
            why = "frame"
        self._receive(m, point, why)

    def _receive(self, m: Any, point: Vec, why: str | None) -> None:
        """Take a target, or refuse it."""
        if m.type_mask & POSITION_BITS or not all(map(math.isfinite, point)):
            self.event("target refused", at=None, why="no position")
            return
        if not self.armed:
            why = "disarmed"
        elif self.mode != GUIDED:
            why = "not in GUIDED"
        elif not why and self._outside(point):
            why = "outside of the fence"
            self.say("Target outside fence")
        if why:
            self.event("target refused", at=rounded(point), why=why)
            return
        moving = m.type_mask & VELOCITY_BITS == 0
        yaw = None if m.type_mask & YAW_BIT else float(m.yaw)
        target = Target(point, yaw, moving)
        self._follow(target)
        self.refreshed = self.t
        self.event("target", at=rounded(point), velocity=moving)

    def _follow(self, target: Target) -> None:
        """Plan for a target, from anew if it is the same again."""
        again = self.target is not None and target.point == self.target.point
        self.target, self.released, self.telling = target, False, True
        self.body.aim(target.point, self.estimate.point, self.estimate.velocity)
        self._face(target.point, target.yaw)
        if not again:
            self.event("under way", at=rounded(target.point))

    def _drop_stale_target(self) -> None:
        stale = self.t - self.refreshed >= VELOCITY_TIMEOUT_S
        if self.target is not None and self.target.moving and stale and not self.released:
            self.released = True
            self.event("target timed out", at=rounded(self.target.point))

    def _face(self, point: Vec, yaw: float | None) -> None:
        east, north, _ = minus(point, self.estimate.point)
        if yaw is not None:
            self.body.bearing = yaw
        elif math.hypot(east, north) > 0.2:
            self.body.bearing = math.atan2(east, north)

    # AUTO

    def _fly_mission(self) -> None:
        if not self.armed:
            # it counts itself through its mission without moving
            if self.current < len(self.items) and self.t >= self.tick:
                self.tick = self.t + 1.0
                self._reach()
            return
        if not self.estimate.has_position or self.t < self.leg_begins:
            return
        while self.current < len(self.items) and self.body.goal is None:
            self._start_item(self.items[self.current])
        if self.current < len(self.items) and self._leg_done(self.items[self.current]):
            self.flown = True
            self.leg_begins, self.held = self.t, None
            self.body.goal = None
            self._reach()

    def _start_item(self, item: Item) -> None:
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            if item.p3 == 0.0:
                self._skip("Alt above home must be negative")
                return
            # the first leg sets the speed back to the parameter's
            if self.flown and item.p2 > 0.0:
                self.body.speed = item.p2
        if item.command >= FIRST_DO_COMMAND:
            self._reach()
            return
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            goal = self.home or self.estimate.point
        elif item.frame not in RELATIVE_FRAMES:
            self._skip("Bad alt frame")
            return
        elif item.z > 0.0:
            self._skip("Alt above home must be negative")
            return
        else:
            goal = self._point_of(item)
        self.body.goal = goal
        self._face(goal, None)

    def _point_of(self, item: Item) -> Vec:
        up = (self.home[2] if self.home is not None else 0.0) + item.z
        if item.x == 0 and item.y == 0:
            return self.estimate.point[0], self.estimate.point[1], up
        return (*self.earth.local(item.x, item.y), up)

    def _leg_done(self, item: Item) -> bool:
        if not self.body.arrived or item.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM:
            return False
        if size(minus(self.estimate.point, self.body.reference)) > RADIUS:
            return False
        if self.held is None:
            self.held = self.t
        waits = item.command != mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
        return self.t - self.held >= (item.p1 if waits else 0.0) - 1e-9

    def _skip(self, why: str) -> None:
        self.say(why)
        self.event("command refused", command=self.items[self.current].command, why=why)
        self._next()

    def _reach(self) -> None:
        self.event("item reached", seq=self.current, armed=self.armed)
        self.mav.mission_item_reached_send(self.current)
        self._next()

    def _next(self) -> None:
        self.current += 1
        if self.current >= len(self.items):
            self.complete = True
            self.event("mission complete", armed=self.armed)
            self.say("Mission complete", mavlink.MAV_SEVERITY_INFO)
        self._send_mission_current()

    # lists: missions and fences

    def _on_mission_count(self, m: Any) -> None:
        is_mission = m.mission_type == mavlink.MAV_MISSION_TYPE_MISSION
        if not is_mission and m.mission_type != mavlink.MAV_MISSION_TYPE_FENCE:
            self._acknowledge(m, mavlink.MAV_MISSION_UNSUPPORTED, m.mission_type)
        elif is_mission and m.count > MAX_MISSION_ITEMS:
            self.event("mission refused", items=m.count, why="no space")
            self._acknowledge(m, mavlink.MAV_MISSION_NO_SPACE, m.mission_type)
        else:
            sender = (m.get_srcSystem(), m.get_srcComponent())
            self.upload = Upload(m.mission_type, m.count, sender)
            self._ask_or_finish(self.upload)

    def _ask_or_finish(self, upload: Upload) -> None:
        if len(upload.items) < upload.count:
            upload.asked = self.t
            self.mav.mission_request_int_send(*upload.sender, len(upload.items), upload.kind)
            return
        self.upload = None
        if upload.kind == mavlink.MAV_MISSION_TYPE_FENCE:
            if fence_bytes(upload.items) > FENCE_STORAGE_BYTES:
                self.event("mission refused", items=upload.count, why="no space")
                no_space = mavlink.MAV_MISSION_NO_SPACE
                self.mav.mission_ack_send(*upload.sender, no_space, upload.kind)
                return
            self._take_fence(upload.items)
        else:
            self._take_mission(upload.items)
        self.mav.mission_ack_send(*upload.sender, mavlink.MAV_MISSION_ACCEPTED, upload.kind)

    def _take_mission(self, items: list[Item]) -> None:
        self.items = items
        self.current, self.complete, self.flown = 1, False, False
        self.tick = self.t + 1.0
        if self.mode == AUTO:
            self._stand()
        self.event("mission", items=len(items))

    def _repeat_request(self) -> None:
        upload = self.upload
        if upload is None or self.t - upload.asked < 1.0:
            return
        upload.tries += 1
        if upload.tries <= 8:
            self._ask_or_finish(upload)
        else:
            self.upload = None
            self.say("Mission upload timeout")
            cancelled = mavlink.MAV_MISSION_OPERATION_CANCELLED
            self.mav.mission_ack_send(*upload.sender, cancelled, upload.kind)

    def _on_mission_item(self, m: Any) -> None:
        self._take_item(m, round(m.x * 1e7), round(m.y * 1e7))

    def _on_mission_item_int(self, m: Any) -> None:
        self._take_item(m, m.x, m.y)

    def _take_item(self, m: Any, x: int, y: int) -> None:
        upload = self.upload
        if upload is None or m.mission_type != upload.kind:
            self._acknowledge(m, mavlink.MAV_MISSION_ERROR, m.mission_type)
            return
        if m.seq < len(upload.items):
            return  # asked for twice, sent twice
        if m.seq > len(upload.items):
            self._acknowledge(m, mavlink.MAV_MISSION_INVALID_SEQUENCE, m.mission_type)
            return
        if not self._known(upload.kind, m.command):
            self.upload = None
            self.event("mission refused", items=upload.count, why=f"command {m.command}")
            self._acknowledge(m, mavlink.MAV_MISSION_UNSUPPORTED, m.mission_type)
            return
        params = (m.param1, m.param2, m.param3, m.param4)
        upload.items.append(Item(m.frame, m.command, *params, x, y, m.z))
        upload.tries = 0
        self._ask_or_finish(upload)

    @staticmethod
    def _known(kind: int, command: int) -> bool:
        if kind == mavlink.MAV_MISSION_TYPE_FENCE:
            return command in FENCE_POLYGONS or command in FENCE_CIRCLES
        return command in NAVIGATION or FIRST_DO_COMMAND <= command < FENCE_POLYGONS[0]

    def _acknowledge(self, m: Any, result: int, kind: int) -> None:
        self.mav.mission_ack_send(m.get_srcSystem(), m.get_srcComponent(), result, kind)

    def _list(self, kind: int) -> list[Item]:
        if kind == mavlink.MAV_MISSION_TYPE_FENCE:
            return self.fence_items
        if kind != mavlink.MAV_MISSION_TYPE_MISSION or not self.items or self.home is None:
            return self.items if kind == mavlink.MAV_MISSION_TYPE_MISSION else []
        # item 0 is home, whatever was sent
        x, y = self.earth.geographic(self.home)
        home = Item(0, mavlink.MAV_CMD_NAV_WAYPOINT, 0.0, 0.0, 0.0, 0.0, x, y, self.home[2])
        return [home, *self.items[1:]]

    def _on_mission_request_list(self, m: Any) -> None:
        count = len(self._list(m.mission_type))
        sender = (m.get_srcSystem(), m.get_srcComponent())
        self.mav.mission_count_send(*sender, count, m.mission_type)

    def _on_mission_request_int(self, m: Any) -> None:
        items = self._list(m.mission_type)
        if m.seq >= len(items):
            self._acknowledge(m, mavlink.MAV_MISSION_INVALID_SEQUENCE, m.mission_type)
            return
        item = items[m.seq]
        self.mav.mission_item_int_send(
            m.get_srcSystem(), m.get_srcComponent(), m.seq, item.frame, item.command,
            int(m.seq == self.current), 1, *item[2:], m.mission_type,
        )  # fmt: skip

    _on_mission_request = _on_mission_request_int

    def _on_mission_clear_all(self, m: Any) -> None:
        self.upload = None
        if m.mission_type in (mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_ALL):
            self._take_fence([])
        if m.mission_type in (mavlink.MAV_MISSION_TYPE_MISSION, mavlink.MAV_MISSION_TYPE_ALL):
            self._take_mission([])
        self._acknowledge(m, mavlink.MAV_MISSION_ACCEPTED, m.mission_type)

    def _on_mission_set_current(self, m: Any) -> None:
        self._set_current(m.seq)

    def _set_current(self, seq: int) -> bool:
        if not 0 <= seq < len(self.items):
            return False
        self.current, self.complete = max(seq, 1), False
        if self.mode == AUTO:
            self._stand()
        self._send_mission_current()
        return True

    # fences

    def _take_fence(self, items: list[Item]) -> None:
        self.fence_items, self.fences, self.breached = items, [], False
        corners: list[tuple[float, float]] = []
        for item in items:
            inside = item.command in FENCE_INCLUSIONS
            corners.append(self.earth.local(item.x, item.y))
            if item.command in FENCE_CIRCLES:
                self.fences.append(Fence(inside, corners[-1:], item.p1))
                corners = []
            elif len(corners) >= item.p1:
                self.fences.append(Fence(inside, corners))
                corners = []
        self.event("fence", points=len(items))

    def _outside(self, point: Vec) -> bool:
        enabled = self.params["FENCE_ENABLE"] != 0.0
        return enabled and not all(fence.keeps(point) for fence in self.fences)

    def _watch_fences(self) -> None:
        """A breach is told, and nothing is done about it."""
        breached = self.armed and self.estimate.has_position and self._outside(self.estimate.point)
        if breached and not self.breached:
            self.say("Fence Breached")
            self.event("fence breached", at=rounded(self.estimate.point))
        self.breached = breached

    # commands

    def _make_commands(self) -> None:
        self.commands: dict[int, Callable[[Sequence[float]], int]] = {
            mavlink.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._do_arm,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._do_change_speed,
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: self._do_set_mission_current,
            mavlink.MAV_CMD_DO_FENCE_ENABLE: self._do_fence_enable,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._do_set_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._do_request_message,
            mavlink.MAV_CMD_GET_HOME_POSITION: self._do_get_home,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._do_get_version,
        }

    def _on_command_long(self, m: Any) -> None:
        do = self.commands.get(m.command)
        params = [getattr(m, f"param{i}") for i in range(1, 5)]
        result = mavlink.MAV_RESULT_UNSUPPORTED if do is None else do(params)
        if do is None:
            self.event("command refused", command=m.command, why="unsupported")
        sender = (m.get_srcSystem(), m.get_srcComponent())
        self.mav.command_ack_send(m.command, result, 0, 0, *sender)

    _on_command_int = _on_command_long

    def _refuse(self, command: int, why: str, result: int = mavlink.MAV_RESULT_DENIED) -> int:
        self.say(why)
        self.event("command refused", command=command, why=why)
        return result

    def _do_set_mode(self, p: Sequence[float]) -> int:
        wanted = int(p[1]) if int(p[0]) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED else -1
        why = self.refusal(wanted)
        if why:
            return self._refuse(mavlink.MAV_CMD_DO_SET_MODE, why)
        self.enter(wanted, "command")
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _on_set_mode(self, m: Any) -> None:
        # ArduPilot answers this message as if it were a command
        result = self._do_set_mode((m.base_mode, m.custom_mode))
        self.mav.command_ack_send(mavlink.MAVLINK_MSG_ID_SET_MODE, result)

    def _do_arm(self, p: Sequence[float]) -> int:
        if p[0] == 0.0:
            self.disarm("command", DISARMED_BY_COMMAND)
        elif self.mode in STEERED and not self.estimate.well:
            why, failed = "Arm: Mode requires position", mavlink.MAV_RESULT_FAILED
            return self._refuse(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, why, failed)
        else:
            self.arm("command")
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _do_change_speed(self, p: Sequence[float]) -> int:
        if p[2] == 0.0:
            why = "Alt above home must be negative"
            return self._refuse(mavlink.MAV_CMD_DO_CHANGE_SPEED, why)
        if p[1] > 0.0:
            self.body.speed = p[1]
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _do_set_mission_current(self, p: Sequence[float]) -> int:
        done = self._set_current(int(p[0]))
        return int(mavlink.MAV_RESULT_ACCEPTED if done else mavlink.MAV_RESULT_FAILED)

    def _do_fence_enable(self, p: Sequence[float]) -> int:
        self.params["FENCE_ENABLE"] = float(p[0] != 0.0)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _do_set_interval(self, p: Sequence[float]) -> int:
        stream = self.streams.get(int(p[0]))
        if stream is None:
            return int(mavlink.MAV_RESULT_FAILED)
        self._set_interval(stream, stream.default if p[1] == 0.0 else p[1] * 1e-6)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _do_request_message(self, p: Sequence[float]) -> int:
        if int(p[0]) == mavlink.MAVLINK_MSG_ID_HOME_POSITION:
            return self._do_get_home(p)
        if int(p[0]) == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            return self._do_get_version(p)
        stream = self.streams.get(int(p[0]))
        if stream is None:
            return int(mavlink.MAV_RESULT_FAILED)
        stream.send()
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _do_get_home(self, _: Sequence[float]) -> int:
        sent = self._send_home()
        return int(mavlink.MAV_RESULT_ACCEPTED if sent else mavlink.MAV_RESULT_FAILED)

    def _do_get_version(self, _: Sequence[float]) -> int:
        able = (
            mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        )
        version, nothing = 4 << 24 | 7 << 16, bytes(8)
        self.mav.autopilot_version_send(
            able, version, 0, 0, 0, nothing, nothing, nothing, 0, 0, self.options.sysid
        )
        return int(mavlink.MAV_RESULT_ACCEPTED)

    # other messages

    def receive(self, m: Any) -> None:
        addressed = getattr(m, "target_system", 0) in (0, self.options.sysid)
        handler = getattr(self, "_on_" + m.get_type().lower(), None)
        if addressed and handler is not None:
            handler(m)

    def _on_heartbeat(self, m: Any) -> None:
        if m.get_srcSystem() == GROUND_STATION:
            self.heard = self.t

    def _on_manual_control(self, m: Any) -> None:
        if getattr(m, "target", self.options.sysid) == self.options.sysid:
            self.input = self.t

    _on_rc_channels_override = _on_manual_control

    def _on_request_data_stream(self, m: Any) -> None:
        rate = float(m.req_message_rate) if m.start_stop else 0.0
        for stream in self.streams.values():
            if stream.group and m.req_stream_id in (mavlink.MAV_DATA_STREAM_ALL, stream.group):
                self._set_interval(stream, 1.0 / rate if rate > 0.0 else 0.0)

    def _set_interval(self, stream: Stream, interval: float) -> None:
        # negative for never; more than a message in a step there is not
        stream.interval = max(interval, STEP) if interval > 0.0 else 0.0
        stream.due = self.t + stream.interval

    def _on_param_request_read(self, m: Any) -> None:
        named = m.param_id if isinstance(m.param_id, str) else m.param_id.decode()
        known = list(self.params)
        name = known[m.param_index] if 0 <= m.param_index < len(known) else named
        if name in self.params:
            self._send_param(name)

    def _on_param_request_list(self, _: Any) -> None:
        for name in self.params:
            self._send_param(name)

    def _on_param_set(self, m: Any) -> None:
        name = m.param_id if isinstance(m.param_id, str) else m.param_id.decode()
        if name in self.params:
            self.params[name] = float(m.param_value)
            self.event("param", param=name, value=self.params[name])
            if name == "WPNAV_SPEED":
                self._reset_speed()
            self._send_param(name)

    def _send_param(self, name: str) -> None:
        known = list(self.params)
        kind = mavlink.MAV_PARAM_TYPE_REAL32
        value, index = self.params[name], known.index(name)
        self.mav.param_value_send(name.encode(), value, kind, len(known), index)

    # telemetry

    def _make_streams(self) -> None:
        position, status = mavlink.MAV_DATA_STREAM_POSITION, mavlink.MAV_DATA_STREAM_EXTENDED_STATUS
        attitude, rest = mavlink.MAV_DATA_STREAM_EXTRA1, mavlink.MAV_DATA_STREAM_EXTRA3
        self.streams: dict[int, Stream] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: Stream(self._send_heartbeat, 1.0, 0),
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: Stream(self._send_local, 0.1, position),
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: Stream(self._send_global, 0.1, position),
            mavlink.MAVLINK_MSG_ID_ATTITUDE: Stream(self._send_attitude, 0.1, attitude),
            mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: Stream(self._send_ekf, 0.5, rest),
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: Stream(self._send_time, 1.0, rest),
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: Stream(self._send_status, 1.0, status),
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: Stream(self._send_mission_current, 1.0, status),
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: Stream(self._send_gps, 1.0, status),
            mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: Stream(self._send_nav, 0.5, status),
        }
        if self.options.echo:
            self.streams[mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED] = Stream(
                self._send_local_target, 0.0, 0
            )
            self.streams[mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT] = Stream(
                self._send_global_target, 0.0, 0
            )
        for stream in self.streams.values():
            stream.interval = stream.default

    def _send_heartbeat(self) -> None:
        flags = (
            mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        )
        state = mavlink.MAV_STATE_STANDBY
        if self.armed:
            flags, state = flags | mavlink.MAV_MODE_FLAG_SAFETY_ARMED, mavlink.MAV_STATE_ACTIVE
        kind, autopilot = self.options.kind, self.options.autopilot
        self.mav.heartbeat_send(kind, autopilot, flags, self.mode, state)

    def _send_local(self) -> None:
        # until there is an origin there is nothing to send, nor without any position
        if self.estimate.has_position:
            point, velocity = ned(self.estimate.point), ned(self.estimate.velocity)
            self.mav.local_position_ned_send(self.ms, *point, *velocity)

    def _send_global(self) -> None:
        latitude, longitude, altitude, height = 0, 0, 0.0, 0.0
        if self.estimate.ever:
            latitude, longitude = self.earth.geographic(self.estimate.point)
            altitude = self.estimate.point[2]
            height = altitude - (self.home[2] if self.home is not None else 0.0)
        speeds = [round(100.0 * v) for v in ned(self.estimate.velocity)]
        heading = round(math.degrees(self.body.yaw) % 360.0 * 100.0) % 36000
        self.mav.global_position_int_send(
            self.ms, latitude, longitude, round(altitude * 1e3), round(height * 1e3),
            *speeds, heading,
        )  # fmt: skip

    def _send_nav(self) -> None:
        east, north, up = minus(self.body.goal or self.estimate.point, self.estimate.point)
        bearing, far = math.degrees(math.atan2(east, north)), math.hypot(east, north)
        self.mav.nav_controller_output_send(0.0, 0.0, 0, round(bearing), int(far), up, 0.0, 0.0)

    def _send_local_target(self) -> None:
        if self.target is not None and self.mode == GUIDED:
            frame, rest = mavlink.MAV_FRAME_LOCAL_NED, (0.0,) * 8
            self.mav.position_target_local_ned_send(
                self.ms, frame, POSITION_ONLY, *ned(self.target.point), *rest
            )

    def _send_global_target(self) -> None:
        if self.target is not None and self.mode == GUIDED:
            frame, rest = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, (0.0,) * 8
            where = self.earth.geographic(self.target.point)
            height = self.target.point[2] - (self.home[2] if self.home is not None else 0.0)
            self.mav.position_target_global_int_send(
                self.ms, frame, POSITION_ONLY, *where, height, *rest
            )

    def _send_attitude(self) -> None:
        yaw = (self.body.yaw + math.pi) % (2.0 * math.pi) - math.pi
        self.mav.attitude_send(self.ms, 0.0, 0.0, yaw, 0.0, 0.0, 0.0)

    def _send_ekf(self) -> None:
        innovation = max(0.01, self.estimate.innovation)
        self.mav.ekf_status_report_send(self.estimate.flags, 0.01, innovation, 0.05, 0.01, 0.0)

    def _send_gps(self) -> None:
        if self.estimate.lost_s > 0.0 and self.gps_silent:
            return
        if self.estimate.has_fix:
            at = plus(self.body.point, self.estimate.gps_error)
            self.gps_place = (*self.earth.geographic(at), round(1e3 * at[2]))
            fix, satellites = mavlink.GPS_FIX_TYPE_RTK_FIXED, 10
        else:
            fix, satellites = mavlink.GPS_FIX_TYPE_NO_FIX, 0
        east, north = self.body.velocity[:2]
        course = round(math.degrees(math.atan2(east, north)) % 360.0 * 100.0) % 36000
        self.mav.gps_raw_int_send(
            self.ms * 1000, fix, *self.gps_place, 121, 200,
            round(100.0 * math.hypot(east, north)), course, satellites,
        )  # fmt: skip

    def _send_time(self) -> None:
        self.mav.system_time_send(0, self.ms)

    def _send_status(self) -> None:
        link = (0, 0, 0, 0, 0, 0)
        self.mav.sys_status_send(SENSORS, SENSORS, SENSORS, 200, 15800, 500, 90, *link)

    def _send_mission_current(self) -> None:
        seq = max(min(self.current, len(self.items) - 1), 0)
        self.mav.mission_current_send(seq)

    def _send_home(self) -> bool:
        if self.home is None:
            return False
        latitude, longitude = self.earth.geographic(self.home)
        height = round(self.home[2] * 1e3)
        level, nothing = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        self.mav.home_position_send(
            latitude, longitude, height, *ned(self.home), level, *nothing, self.ms * 1000
        )
        return True

    # what befalls it

    def befall(self, line: bytes) -> bool:
        """Obey a line of the test; false when it is the last."""
        try:
            what = json.loads(line)
            return self._befall(what)
        except (ValueError, TypeError, KeyError, IndexError) as error:
            self.event("not understood", line=line.decode(errors="replace"), why=repr(error))
            return True

    def _befall(self, what: dict[str, Any]) -> bool:
        do = what["do"]
        if do == "quit":
            return False
        if do == "lose_estimate":
            self.gps_silent = bool(what.get("silent", False))
            self.estimate.lose()
            self.event("estimate lost")
        elif do == "restore_estimate":
            self.estimate.restore()
            self.estimate.update(self.body, self.t)
            self.home = self.home or self.estimate.point
            self.event("estimate restored")
            self.say("EKF3 is using GPS", mavlink.MAV_SEVERITY_INFO)
        elif do == "mode":
            why = self.refusal(what["mode"])
            if why:
                self.event("mode refused", mode=what["mode"], why=why)
            else:
                self.enter(what["mode"], "pilot")
        elif do == "arm":
            self.arm("pilot")
        elif do == "disarm":
            self.disarm("pilot")
        elif do == "silence":
            self.silent_until = self.t + float(what["seconds"])
            self.event("silence", seconds=float(what["seconds"]))
        else:
            self._shift(do, what)
        return True

    def _shift(self, do: str, what: dict[str, Any]) -> None:
        """Move the vehicle, or only its estimate."""
        if do == "jump":
            east, north = what["by"]
            self.estimate.jumped = plus(self.estimate.jumped, (east, north, 0.0))
        elif do == "gps_jump":
            east, north = what["by"]
            self.estimate.move_gps((east, north, 0.0))
        elif do == "freeze":
            self.estimate.is_frozen = True
        elif do == "current":
            east, north = what["by"]
            self.body.current = (east, north, 0.0)
        elif do == "push":
            east, north, up = what["by"]
            self.body.point = plus(self.body.point, (east, north, up))
        elif do == "place":
            east, north, up = what["at"]
            self.body.place((float(east), float(north), float(up)))
        else:
            raise ValueError(f"unknown: {do}")
        self.estimate.update(self.body, self.t)
        self.event(do, true=rounded(self.body.point), est=rounded(self.estimate.point))


def serve(vehicle: Vehicle, wire: Wire, pace: float) -> None:
    """Keep the simulation at its pace until standard input ends."""
    selector = selectors.DefaultSelector()
    selector.register(wire.socket, selectors.EVENT_READ)
    selector.register(0, selectors.EVENT_READ)
    rest = b""
    due = time.monotonic()
    while True:
        for key, _ in selector.select(max(0.0, due - time.monotonic())):
            if key.fileobj != 0:
                continue
            data = os.read(0, 65536)
            *lines, rest = (rest + data).split(b"\n")
            going = [vehicle.befall(line) for line in lines if line.strip()]
            if not data or not all(going):
                return
        # read before every step, or what was sent in time would seem to have come late
        now = time.monotonic()
        for _ in range(BURST):
            for message in wire.messages():
                vehicle.receive(message)
            if due > now:
                break
            vehicle.step()
            due += STEP / pace
        due = max(due, now)


def numbers(count: int) -> Callable[[str], tuple[float, ...]]:
    """Numbers of a command line, separated by commas."""

    def parse(text: str) -> tuple[float, ...]:
        values = tuple(float(v) for v in text.split(","))
        if len(values) != count:
            raise ValueError(text)
        return values

    return parse


def address(text: str) -> tuple[str, int]:
    host, port = text.rsplit(":", 1)
    return host, int(port)


def param(text: str) -> tuple[str, float]:
    name, value = text.split("=")
    return name, float(value)


def options_of(arguments: Sequence[str]) -> Options:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    add = parser.add_argument
    add("--to", type=address, required=True, metavar="HOST:PORT", help="the ground station")
    add("--seed", type=int, default=0)
    add("--pace", type=float, default=1.0, help="simulated seconds in a second")
    add("--speed", type=float, default=0.5, help="m/s")
    add("--noise", type=float, default=0.0, help="of the estimate: metres of spread")
    add("--smooth", type=float, default=0.0, help="seconds of memory of that noise; 0: white")
    add("--drift", type=float, default=0.0, help="of the estimate, slow: metres of spread")
    add("--origin", type=numbers(2), default=(55.5, 12.7), metavar="LAT,LON")
    add("--start", type=numbers(3), default=(0.0, 0.0, 0.0), metavar="E,N,U", help="--start=-1,0,0")
    add("--current", type=numbers(2), default=(0.0, 0.0), metavar="E,N", help="of the water, m/s")
    add("--sysid", type=int, default=1)
    add("--kind", type=int, default=mavlink.MAV_TYPE_SUBMARINE, help="MAV_TYPE of its heartbeats")
    add("--autopilot", type=int, default=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, help="MAV_AUTOPILOT")
    add("--no-echo", dest="echo", action="store_false", help="without POSITION_TARGET messages")
    add("--no-estimate", dest="estimate", action="store_false", help="without a position")
    add("--param", dest="params", type=param, action="append", default=[], metavar="NAME=VALUE")
    given = vars(parser.parse_args(arguments))
    return Options(**{**given, "params": dict(given["params"])})


def main(arguments: Sequence[str]) -> int:
    options = options_of(arguments)

    def end(*_: object) -> None:
        raise SystemExit(0)

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGINT, end)
    wire = Wire(options.to)
    vehicle = Vehicle(options, wire)
    vehicle.event("started", port=wire.port)
    with contextlib.suppress(BrokenPipeError):
        serve(vehicle, wire, options.pace)
    return 0


# for tests


class Simulation:
    """The vehicle on a clock of its own, without a process or a link: quick and deterministic.

    A ground station is heard at every step while ``beating``.
    """

    def __init__(self, *, params: dict[str, float] | None = None, **options: Any) -> None:
        self.rows: list[dict[str, Any]] = []
        self.events: list[dict[str, Any]] = []
        self.wire, self.beating = Nowhere(), True
        given = Options(("", 0), params=params or {}, **options)
        self.vehicle = Vehicle(given, self.wire, self._tell)

    def _tell(self, t: float, **what: Any) -> None:
        (self.events if "event" in what else self.rows).append({"t": t, **what})

    @property
    def now(self) -> float:
        return self.vehicle.t

    @property
    def believed(self) -> Vec:
        """Return where the vehicle believes to be."""
        return self.vehicle.estimate.point

    def do(self, **command: object) -> None:
        """Have something befall the vehicle, as `Autopilot.tell` does."""
        self.vehicle.befall(json.dumps(command).encode())

    def send(self, message: Any) -> None:
        """Hand the vehicle a message of the ground station."""
        message.pack(mavlink.MAVLink(None, srcSystem=GROUND_STATION, srcComponent=190))
        self.vehicle.receive(message)

    def fly(self, mode: int = GUIDED) -> None:
        """Arm, and enter a mode."""
        self.vehicle.arm("command")
        self.vehicle.enter(mode, "command")

    def go(self, point: Vec) -> None:
        """Send a position target."""
        frame, rest = mavlink.MAV_FRAME_LOCAL_NED, (0.0,) * 8
        self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, self.vehicle.options.sysid, 1, frame, POSITION_ONLY, *ned(point), *rest
            )
        )

    def step(self) -> None:
        if self.beating:
            self.vehicle.heard = self.vehicle.t
        self.vehicle.step()

    def advance(self, seconds: float) -> None:
        """Let time go by."""
        for _ in range(round(seconds / STEP)):
            self.step()

    def until(self, condition: Callable[[], Any], seconds: float = 600.0) -> Any:
        """Let time go by until something comes true."""
        end = self.now + seconds
        while not (found := condition()):
            assert self.now < end, f"waited in vain; events: {self.events[-10:]}"
            self.step()
        return found

    def event(self, name: str, since: float = 0.0, seconds: float = 600.0) -> dict[str, Any]:
        """Let time go by until an event, not before a time."""

        def found() -> dict[str, Any] | None:
            return next((e for e in self.events if e["event"] == name and e["t"] >= since), None)

        event: dict[str, Any] = self.until(found, seconds)
        return event

    def truth(self) -> np.ndarray:
        """Return time, east, north and up of where the vehicle really was, a row each."""
        import numpy as np

        return np.array([[r["t"], *r["true"]] for r in self.rows]).reshape(-1, 4)


class Autopilot:
    """The process, for a test: ``with Autopilot(pace=20) as a``.

    Options are those of the command line; ``params`` is a dictionary. The ground station listens
    on ``port``; ``own`` is the port of the vehicle itself.
    """

    def __init__(
        self,
        *,
        estimate: bool = True,
        params: dict[str, float] | None = None,
        **options: float | Sequence[float],
    ) -> None:
        self.reservation = reserve_port()
        self.port = int(self.reservation.getsockname()[1])
        self.rows: list[dict[str, Any]] = []
        self.events: list[dict[str, Any]] = []
        self.own = 0
        self.command = [sys.executable, str(Path(__file__)), f"--to=127.0.0.1:{self.port}"]
        for name, value in {"pace": 20.0, **options}.items():
            text = ",".join(map(str, value)) if isinstance(value, Sequence) else str(value)
            self.command.append(f"--{name}={text}")
        self.command += [f"--param={name}={value}" for name, value in (params or {}).items()]
        self.command += [] if estimate else ["--no-estimate"]

    def __enter__(self) -> Autopilot:
        self.process = subprocess.Popen(
            self.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()
        try:
            self.own = self.event("started")["port"]
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        try:
            with contextlib.suppress(OSError):
                self.process.stdin.close()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(3.0)
        finally:
            self.process.kill()
            self.process.wait()
            self.reader.join(10.0)
            self.process.stdout.close()
            self.reservation.close()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            row = json.loads(line)
            (self.events if "event" in row else self.rows).append(row)

    def tell(self, **command: object) -> None:
        """Send a line to the vehicle: ``tell(do="push", by=[1, 0, 0])``."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(command) + "\n")
        self.process.stdin.flush()

    def truth(self) -> np.ndarray:
        """Time, east, north and up of where the vehicle really was, a row each."""
        import numpy as np  # not by the process, which has no need of it

        return np.array([[r["t"], *r["true"]] for r in list(self.rows)]).reshape(-1, 4)

    @property
    def now(self) -> float:
        """Simulated seconds, to the last row."""
        return float(self.rows[-1]["t"]) if self.rows else 0.0

    def until(self, condition: Callable[[], Any], seconds: float = 30.0) -> Any:
        """Wait for something to come true; seconds are those of the wall."""
        end = time.monotonic() + seconds
        while True:
            found = condition()
            if found:
                return found
            assert self.process.poll() is None or self.reader.is_alive(), "the vehicle has ended"
            assert time.monotonic() < end, f"waited in vain; events: {self.events[-10:]}"
            time.sleep(0.004)

    def event(self, name: str, seconds: float = 30.0, since: float = 0.0) -> dict[str, Any]:
        """Wait for an event, not before a simulated time."""

        def found() -> dict[str, Any] | None:
            named = (e for e in list(self.events) if e["event"] == name and e["t"] >= since)
            return next(named, None)

        event: dict[str, Any] = self.until(found, seconds)
        return event

    def sleep(self, simulated: float) -> None:
        """Wait for simulated time to go by."""
        end = self.now + simulated
        self.until(lambda: self.now >= end, 30.0 + simulated)


def reserve_port() -> socket.socket:
    """Return a TCP socket whose port is free for UDP on loopback until the socket is closed.

    TCP and UDP number their ports apart, so the socket leaves the UDP port to the program under
    test. Other tests skip the port, because they cannot bind its TCP socket. The system skips it
    as well: it gives ports from `TEST_PORTS` to no socket that asks for any port.
    """
    for port in TEST_PORTS:
        reservation = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            reservation.bind(("127.0.0.1", port))
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.bind(("127.0.0.1", port))
        except OSError:
            reservation.close()
        else:
            return reservation
    raise OSError(f"no free UDP port from {TEST_PORTS[0]} to {TEST_PORTS[-1]}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

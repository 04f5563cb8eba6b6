"""Times of straight legs as ArduSub travels them.

ArduSub plans a leg from rest to rest with limited speed, acceleration and jerk (`SmoothMove`); the
slower of the plan and the depth decides. A reference runs along that curve and the vehicle follows.
Its thrust grows with the square of the missing speed, so that drag delays the vehicle until the
integral of the controller makes up for it. The time of the reference slows down meanwhile. On a leg
of 10 m at 0.5 m/s that takes 2 to 4 s, more after a turn, because the integral still pushes in the
direction of the previous leg.

In AUTO a waypoint is reached when the reference is at its end and the vehicle within the acceptance
radius; then comes the hold. In GUIDED the next target is sent as soon as the vehicle is within
reach of the last one, and the vehicle plans from the position where it would come to rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

from netsp.base.errors import InputError
from netsp.base.field_types import Point3

GRAVITY = 9.80665
"""Physical constant: standard gravity, m/s²."""

BISECTIONS = 40
"""Tolerance of bisections, as their number: the error is below 1e-12 of the upper limit."""

COINCIDENT = 1e-6
"""Tolerance of rounding: nearer waypoints are one, m, because their leg has no direction."""


@dataclass(frozen=True)
class VehicleMotion:
    """Motion control of ArduSub and the response of the vehicle. All numbers are positive.

    The controller's numbers are the defaults of ArduSub 4.7; the parameter's name is given. Thrust
    and drag are those of its simulator's vectored frame: thrust is 4 x 51.5 N on 10.5 kg, drag was
    measured where simulated vehicles were left to themselves.

    Attributes
    ----------
    max_acceleration
        Horizontal acceleration of the reference, m/s² (WPNAV_ACCEL, cm/s²).
    max_acceleration_z
        Vertical acceleration of the reference, m/s² (WPNAV_ACCEL_Z, cm/s²).
    max_jerk
        Jerk of the reference, m/s³ (WPNAV_JERK).
    input_time_s
        Half of the time in which the jerk rises and falls, s (ATC_INPUT_TC).
    max_ascent_speed
        Vertical speed of the reference upwards, m/s (WPNAV_SPEED_UP, cm/s).
    max_descent_speed
        Vertical speed of the reference downwards, m/s (WPNAV_SPEED_DN, cm/s).
    acceptance_radius
        Distance to a waypoint within which it counts as reached, m (WPNAV_RADIUS, cm).
    position_gain
        Horizontal speed for each metre off the reference, 1/s (PSC_POSXY_P).
    position_gain_z
        Vertical speed for each metre off the reference, 1/s (PSC_POSZ_P).
    velocity_gain
        Horizontal acceleration asked for each m/s that is missing, 1/s (PSC_VELXY_P).
    velocity_integral_gain
        Growth of that acceleration for each m/s that is missing, 1/s² (PSC_VELXY_I).
    max_lean
        Angle of lean that stands for full thrust, radians (ANGLE_MAX, 0.01 degrees).
    track_margin
        Share of its speed by which the reference may outrun the vehicle before its time slows.
    full_thrust
        Horizontal acceleration at full thrust, m/s². Thrust grows with the square of the command.
    drag
        Deceleration over the square of the speed, 1/m.
    thrust_gain_z
        Vertical acceleration for each m/s of vertical speed that is missing, 1/s.
    integral_rate_z
        Growth of the vertical command for each m/s that is missing, 1/s.
    thrust_lag_s
        Time constant between a command and its thrust, s.
    step_s
        Step of the integration, s; at most 0.1.
    max_followed_s
        Time on one leg after which the vehicle is taken to be at a steady speed until it brakes, s;
        and the longest time in which it settles at the end of a leg.
    """

    max_acceleration: float = 2.5
    max_acceleration_z: float = 1.0
    max_jerk: float = 1.0
    input_time_s: float = 0.15
    max_ascent_speed: float = 2.5
    max_descent_speed: float = 1.5
    acceptance_radius: float = 2.0
    position_gain: float = 1.0
    position_gain_z: float = 3.0
    velocity_gain: float = 6.0
    velocity_integral_gain: float = 0.5
    max_lean: float = math.radians(45.0)
    track_margin: float = 0.05
    full_thrust: float = 19.6
    drag: float = 3.6
    thrust_gain_z: float = 1.8
    integral_rate_z: float = 0.15
    thrust_lag_s: float = 0.2
    step_s: float = 0.02
    max_followed_s: float = 60.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (isinstance(value, float | int) and 0.0 < value < math.inf):
                raise InputError(f"{field.name}: expected a positive number, got {value!r}")
        if self.step_s > 0.1:
            raise InputError(f"step_s: expected at most 0.1, got {self.step_s!r}")


class SmoothMove:
    """Straight move from rest to rest with limited speed, acceleration and jerk.

    Acceleration rises and falls in straight ramps. A ramp to an acceleration a takes a / jerk plus
    the time in which the jerk itself rises and falls.

    Parameters
    ----------
    run : float
        Horizontal length, m.
    rise : float
        Vertical length, m, positive upwards.
    speed : float
        Limit of the horizontal speed, m/s.
    motion : VehicleMotion
        Other limits.
    """

    def __init__(self, run: float, rise: float, speed: float, motion: VehicleMotion) -> None:
        if math.hypot(run, rise) < COINCIDENT:
            run, rise = COINCIDENT, 0.0
        self.length = math.hypot(run, rise)
        flat, steep = run / self.length, abs(rise) / self.length
        vertical = motion.max_ascent_speed if rise > 0.0 else motion.max_descent_speed
        top = min(_over(speed, flat), _over(vertical, steep))
        self._limit = min(
            _over(motion.max_acceleration, flat), _over(motion.max_acceleration_z, steep)
        )
        self._jerk, self._bend_s = motion.max_jerk, 2.0 * motion.input_time_s
        if top * self._rise_s(top) > self.length:
            top = _bisected(lambda v: v * self._rise_s(v) < self.length, top)
        self.top_speed = top
        self.acceleration = self._peak_acceleration(top)
        self.ramp_s = self._ramp_s(self.acceleration)
        self.rise_s = self._rise_s(top)
        self.duration_s = self.length / top + self.rise_s

    def _ramp_s(self, acceleration: float) -> float:
        if acceleration >= self._jerk * self._bend_s:
            return acceleration / self._jerk + self._bend_s
        return 2.0 * math.sqrt(acceleration * self._bend_s / self._jerk)  # jerk below its limit

    def _peak_acceleration(self, top: float) -> float:
        """Return the acceleration with which a speed is reached soonest."""
        if self._limit * self._ramp_s(self._limit) <= top:
            return self._limit
        return _bisected(lambda a: a * self._ramp_s(a) < top, self._limit)

    def _rise_s(self, top: float) -> float:
        """Return the time from rest to a speed."""
        acceleration = self._peak_acceleration(top)
        return top / acceleration + self._ramp_s(acceleration)

    def at(self, t: float) -> tuple[float, float]:
        """Return distance and speed at a time after the start."""
        if t >= self.duration_s:
            return self.length, 0.0
        if t > 0.5 * self.duration_s:
            distance, speed = self.at(max(self.duration_s - t, 0.0))
            return self.length - distance, speed
        if t >= self.rise_s:
            return self.top_speed * (t - 0.5 * self.rise_s), self.top_speed
        ramp, peak = self.ramp_s, self.acceleration
        if t < ramp:
            return peak / ramp * t**3 / 6.0, 0.5 * peak / ramp * t * t
        left = self.rise_s - t
        if left > ramp:
            past = t - ramp
            return (
                peak * (ramp * ramp / 6.0 + 0.5 * past * (ramp + past)),
                peak * (0.5 * ramp + past),
            )
        return (
            self.top_speed * (0.5 * self.rise_s - left) + peak / ramp * left**3 / 6.0,
            self.top_speed - 0.5 * peak / ramp * left * left,
        )


class _Follower:
    """Vehicle that follows the reference; its state is kept from leg to leg."""

    def __init__(self, place: Point3, speed: float, motion: VehicleMotion) -> None:
        self.speed, self.motion = speed, motion
        self.place = place
        self.velocity = self.integral = self.command = (0.0, 0.0, 0.0)
        self.rate = 1.0
        self.clock_s = 0.0
        self._begin(place, place)

    def _begin(self, origin: Point3, goal: Point3) -> None:
        run, rise = math.dist(origin[:2], goal[:2]), goal[2] - origin[2]
        self.origin, self.goal = origin, goal
        self.move = SmoothMove(run, rise, self.speed, self.motion)
        length = self.move.length
        x, y, z = (b - a for a, b in zip(origin, goal, strict=True))
        self.along = (x / length, y / length, z / length)
        self.track_s = self.leg_s = self.reference_speed = 0.0
        self.reference = origin

    def go_on(self, goal: Point3) -> None:
        """Begin a leg at the end of the previous one."""
        self._begin(self.goal, goal)

    def plan_anew(self, goal: Point3) -> None:
        """Begin a leg where the vehicle would come to rest; the thrust does not jump."""
        gain, gain_z = self.motion.position_gain, self.motion.position_gain_z
        (x, y, z), (vx, vy, vz) = self.place, self.velocity
        self._begin((x + vx / gain, y + vy / gain, z + vz / gain_z), goal)
        self.integral, self.rate = self.command, 1.0

    def is_at(self, goal: Point3, radius: float) -> bool:
        """Return whether the vehicle is within a radius, or has had enough time to get there."""
        waited_s = self.track_s - self.move.duration_s
        return math.dist(self.place, goal) <= radius or waited_s > self.motion.max_followed_s

    @property
    def is_there(self) -> bool:
        """True if the reference is at its end and the vehicle in the acceptance radius."""
        return self.track_s >= self.move.duration_s and self.is_at(
            self.goal, self.motion.acceptance_radius
        )

    def step(self) -> None:
        """Advance by a step."""
        m, dt = self.motion, self.motion.step_s
        (x, y, z), (vx, vy, vz), (ux, uy, uz) = self.place, self.velocity, self.along
        rx, ry, rz = self.reference
        pace = self.reference_speed
        share = 1.0
        if pace > 0.0:
            behind = (rx - x) * ux + (ry - y) * uy + (rz - z) * uz
            made = vx * ux + vy * uy + vz * uz
            share = m.track_margin + (made - m.position_gain * behind) / pace
            share = max(0.0, min(1.0, share))
        self.rate += (share - self.rate) * min(1.0, dt * m.max_jerk / m.max_acceleration)
        self.track_s += self.rate * dt
        distance, pace = self.move.at(self.track_s)
        (ox, oy, oz), self.reference_speed = self.origin, pace
        rx, ry, rz = ox + ux * distance, oy + uy * distance, oz + uz * distance
        # missing speeds, their integrals, and commands to the thrusters
        ex = ux * pace + m.position_gain * (rx - x) - vx
        ey = uy * pace + m.position_gain * (ry - y) - vy
        ez = uz * pace + m.position_gain_z * (rz - z) - vz
        ix, iy, iz = self.integral
        cx, cy, cz = self.command
        flat = math.hypot(cx, cy)
        throttle = math.atan(m.velocity_gain * flat / GRAVITY) / m.max_lean
        if throttle < 1.0:  # an integral does not grow while thrust is at its limit
            grow = dt * m.velocity_integral_gain / m.velocity_gain
            ix, iy = ix + grow * ex, iy + grow * ey
        iz += dt * m.integral_rate_z * ez
        keep = min(dt / m.thrust_lag_s, 1.0)
        cx, cy = cx + keep * (ex + ix - cx), cy + keep * (ey + iy - cy)
        cz += keep * (ez + iz - cz)
        thrust = m.full_thrust * min(throttle, 1.0) ** 2 / max(flat, COINCIDENT)
        slow = 1.0 + dt * m.drag * math.hypot(vx, vy)
        vx, vy = (vx + dt * thrust * cx) / slow, (vy + dt * thrust * cy) / slow
        vz = (vz + dt * m.thrust_gain_z * cz) / (1.0 + dt * m.drag * abs(vz))
        self.place, self.velocity = (x + dt * vx, y + dt * vy, z + dt * vz), (vx, vy, vz)
        self.reference, self.integral, self.command = (rx, ry, rz), (ix, iy, iz), (cx, cy, cz)
        self.clock_s += dt
        self.leg_s += dt
        if self.leg_s >= m.max_followed_s:
            self._skip_steady()

    def _skip_steady(self) -> None:
        """Move on to where the reference brakes, at full speed or as fast as thrust allows."""
        self.leg_s = 0.0
        skipped = self.move.duration_s - self.move.rise_s - self.track_s
        if skipped <= 0.0:
            return
        distance = skipped * self.move.top_speed
        ux, uy, uz = self.along
        (x, y, z), (rx, ry, rz) = self.place, self.reference
        self.place = (x + distance * ux, y + distance * uy, z + distance * uz)
        self.reference = (rx + distance * ux, ry + distance * uy, rz + distance * uz)
        self.track_s += skipped
        steady = math.sqrt(self.motion.full_thrust / self.motion.drag) / self.move.top_speed
        self.clock_s += skipped / min(1.0, steady)


def leg_times(
    places: Sequence[Point3],
    holds: Sequence[float],
    speed: float,
    motion: VehicleMotion | None = None,
) -> list[float]:
    """Return the times of the legs of a mission in AUTO, s, each with the hold at its end.

    Parameters
    ----------
    places : sequence of (x, y, z)
        Waypoints, metres, z up; the vehicle is at rest at the first one.
    holds : sequence of float
        Hold at each waypoint, s; the hold at the first one is part of no leg.
    speed : float
        Horizontal speed, m/s.
    """
    motion = motion or VehicleMotion()
    vehicle = _Follower(places[0], speed, motion)
    times = []
    for place, hold_s in zip(places[1:], holds[1:], strict=True):
        begin = vehicle.clock_s
        vehicle.go_on(place)
        while not vehicle.is_there:
            vehicle.step()
        until = vehicle.clock_s + hold_s
        while vehicle.clock_s < until:
            vehicle.step()
        times.append(vehicle.clock_s - begin)
    return times


def target_times(
    places: Sequence[Point3],
    reach: float,
    speed: float,
    motion: VehicleMotion | None = None,
    *,
    notice_s: float = 0.0,
    repeat_s: float = math.inf,
) -> list[float]:
    """Return the times between targets that are sent in GUIDED, s.

    Parameters
    ----------
    places : sequence of (x, y, z)
        Targets, metres, z up; the vehicle is at rest at the first one.
    reach : float
        Distance to a target at which the next one is sent, m.
    speed : float
        Horizontal speed, m/s.
    notice_s : float
        Time from being within reach until the vehicle has the next target, s.
    repeat_s : float
        Time after which a target is sent again and the vehicle plans again, s.
    """
    motion = motion or VehicleMotion()
    vehicle = _Follower(places[0], speed, motion)
    times = []
    for place in places[1:]:
        begin = vehicle.clock_s
        if math.dist(vehicle.place, place) > reach:  # else the target is skipped
            vehicle.plan_anew(place)
            sent = vehicle.clock_s
            while not vehicle.is_at(place, reach):
                vehicle.step()
                if vehicle.clock_s - sent >= repeat_s:
                    vehicle.plan_anew(place)
                    sent = vehicle.clock_s
            until = vehicle.clock_s + notice_s
            while vehicle.clock_s < until:
                vehicle.step()
        times.append(vehicle.clock_s - begin)
    return times


def _over(limit: float, share: float) -> float:
    """Return the limit along a leg, of which a share lies in the limited direction."""
    return limit / share if share > 0.0 else math.inf


def _bisected(is_below: Callable[[float], bool], high: float) -> float:
    """Return the largest number up to a bound for which a monotone condition holds."""
    low = 0.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_below(middle) else (low, middle)
    return low

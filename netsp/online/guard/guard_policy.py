"""Policies of a guard: tracking, belief, lookahead, and alarms."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_not_negative, check_positive
from netsp.online.link.link_policy import LinkPolicy
from netsp.world.world_policy import WorldPolicy


@dataclass(frozen=True)
class FreezePolicy:
    """Policy that tells a frozen position from a robot at rest. All numbers are positive.

    The last three fields are for flights, which know where the vehicle is sent.

    Attributes
    ----------
    min_repeat_s
        Shortest time for which a position must repeat, s.
    min_reported_travel
        Distance that the reported velocities must add up to meanwhile, m; at rest they add up to
        less, even with noise.
    dead_stop_s
        Time for which a position must repeat after the robot moved if no velocity tells whether it
        still does, s.
    moving_share
        Share of the full speed above which the robot moved before.
    stopping_share
        Share of the full speed from which no robot stops between two estimates.
    max_periods
        Number of usual periods between changes after which a position is late, at least 1: the
        position of a slow sensor repeats in between.
    max_period_s
        Longest time between two changes that counts as a period of the sensor, s.
    memory
        Share of the past in running averages, and of the longest period, after one more estimate.
    min_changing_share
        Share of recent velocities that must have differed from the one before, above which a
        repeated velocity is evidence of a freeze: simulations without noise repeat it on straight
        lines.
    max_repeat_s
        Longest time for which the position may be the same to the last bit while the vehicle
        reports that it moves, or is sent elsewhere, s. Positions of a moving vehicle change within
        half a second.
    min_moving_speed
        Reported speed from which on the position must change, m/s; the same in depth.
    min_plan_share
        Share of the distance to the target that is horizontal, above which the position must change
        in the plan: on a steeper leg a vehicle may stay beside its target while it dives.
    """

    min_repeat_s: float = 1.0
    min_reported_travel: float = 0.25
    dead_stop_s: float = 3.0
    moving_share: float = 0.1
    stopping_share: float = 0.3
    max_periods: float = 3.0
    max_period_s: float = 5.0
    memory: float = 0.9
    min_changing_share: float = 0.5
    max_repeat_s: float = 1.5
    min_moving_speed: float = 0.1
    min_plan_share: float = 0.5

    def __post_init__(self) -> None:
        check_positive(self)
        if not self.max_periods >= 1.0:
            raise InputError(f"max_periods: expected 1 or more, got {self.max_periods!r}")


@dataclass(frozen=True)
class VelocityPolicy:
    """Policy that decides whether reported velocities are believed. All numbers are positive.

    Attributes
    ----------
    span_s
        Time over which the distance travelled is compared with the reported velocities, s.
    averaging_s
        Time over which positions are averaged at either end of the span, s.
    min_travel_share
        Share of the distance at full speed that the robot must have travelled before its velocities
        are tested.
    min_noise_deviations
        Standard deviations of the noise of the distance that it must have travelled at least.
    max_error_share
        Share of the full speed by which velocities may be wrong beyond what the noise explains.
    max_mismatch
        Share of the distance by which the summed velocities may miss it.
    max_pause_s
        Longest time without a velocity, s; after a longer one the test begins again.
    max_speed_factor
        Largest believable speed as a multiple of the full speed, beyond four deviations of `noise`.
    noise
        Standard deviation of one velocity, m/s, at ten a second. That of a Doppler log is a tenth
        of it, but a filter without one knows no better.
    """

    span_s: float = 4.0
    averaging_s: float = 1.0
    min_travel_share: float = 0.5
    min_noise_deviations: float = 4.0
    max_error_share: float = 0.25
    max_mismatch: float = 0.5
    max_pause_s: float = 2.0
    max_speed_factor: float = 1.5
    noise: float = 0.1

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class TrackPolicy:
    """Policy of the filter that makes a motion of position estimates. All numbers are positive.

    Attributes
    ----------
    acceleration
        Standard deviation of the robot's acceleration, m/s²: that of vehicles up to work class. A
        larger one follows turns sooner and smooths less.
    dropout_s
        Longest time without a position, s; after a longer one the track is lost.
    min_moving_share
        Share of the full speed below which the robot counts as at rest.
    restart_s
        Shortest time that a vehicle takes to restart, s; the robot may have moved meanwhile.
    max_velocity_deviations
        Largest deviation of a velocity from the expected one, in standard deviations; a single one
        beyond is as likely an error of the link, and ignored.
    turn_span_s
        Time over which a course is averaged, s: the courses of two spans in a row tell how fast the
        robot turns.
    short_turn_span_s
        Same time while velocities are believed, s.
    freeze
        Policy that tells a frozen position from a robot at rest.
    velocity
        Policy that decides whether reported velocities are believed.
    """

    acceleration: float = 0.15
    dropout_s: float = 2.0
    min_moving_share: float = 0.1
    restart_s: float = 10.0
    max_velocity_deviations: float = 4.0
    turn_span_s: float = 3.0
    short_turn_span_s: float = 2.0
    freeze: FreezePolicy = field(default_factory=FreezePolicy)
    velocity: VelocityPolicy = field(default_factory=VelocityPolicy)

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class BeliefPolicy:
    """Policy of the belief about the tether's class. All numbers are positive.

    Attributes
    ----------
    n_rings
        Number of rings of the hexagonal grid of offsets; 4 rings are 61 offsets. The time of an
        update grows with the square.
    grid_reach
        Radius of the grid in standard deviations of the drift: beyond 3.2 lie 0.6 % in the plan.
    placement_share
        Error of a position on the grid, as a share of its spacing.
    drift_time_s
        Time in which the drift forgets what it was, s.
    exchange_s
        Time between two steps of the drift's random walk, s.
    min_odds
        Smallest likelihood of a class that is kept, relative to the likeliest one.
    max_classes
        Maximum number of classes that are kept.
    """

    n_rings: int = 4
    grid_reach: float = 3.2
    placement_share: float = 0.4
    drift_time_s: float = 60.0
    exchange_s: float = 2.0
    min_odds: float = 1e-3
    max_classes: int = 16

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class LookaheadPolicy:
    """Policy of the lookahead: where the current motion leads. All numbers are positive.

    Attributes
    ----------
    horizon_s, turn_horizon_s
        Horizons for a straight and for a turning course, s: slightly longer than the earliest
        warnings of `AlarmPolicy`.
    step_s
        Approximate time between two places on the course, s.
    max_step_angle
        Largest turn between two places on the course, rad.
    surface_distance
        Smallest distance of these places from obstacles, m; more where the course turns, so that
        the straight step between two of them passes the obstacle, too.
    min_turn_rate
        Smallest rate at which a course counts as turning, rad/s; slower turns are noise.
    min_orbit_ratio
        Smallest ratio of the turn rate to that of the circle through the robot around an obstacle,
        at which the robot counts as circling it; the inverse is the largest ratio. The position
        determines the circle more precisely than the rate.
    min_orbit_tangency
        Share of the speed that must be at right angles to the direction of the obstacle.
    max_orbit_radius
        Largest radius of a circle about an obstacle, m.
    min_interval_s
        Shortest time between the beginnings of two lookaheads, s.
    """

    horizon_s: float = 36.0
    turn_horizon_s: float = 30.0
    step_s: float = 1.0
    max_step_angle: float = 0.5
    surface_distance: float = 1e-3
    min_turn_rate: float = 0.06
    min_orbit_ratio: float = 0.4
    min_orbit_tangency: float = 0.75
    max_orbit_radius: float = 10.0
    min_interval_s: float = 0.3

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class CoursePolicy:
    """Policy of warnings of a loop ahead, by how well the robot's course is known.

    Attributes
    ----------
    delay_per_noise
        Share by which a loop seems to close later for each metre of noise, 1/m, because a noisy
        course looks like a wider circle. Not negative.
    min_share
        Smallest share of the classes in which a loop must close for a warning, 0 to 1.
    min_likeliest_share
        Smallest share of the likeliest class for a warning, 0 to 1, unless a loop closes in nearly
        all classes: if the course of the tether is uncertain, so are loops.
    """

    delay_per_noise: float
    min_share: float
    min_likeliest_share: float

    def __post_init__(self) -> None:
        check_not_negative(self)


@dataclass(frozen=True)
class AlarmPolicy:
    """Policy that decides when the operator is warned. No number is negative.

    Attributes
    ----------
    notice_delay_s, caution_delay_s, warning_delay_s, alarm_delay_s
        Time for which there must be a reason before an alarm is raised to a level, s.
    max_absence_s
        Longest time for which the reason may be away meanwhile, s: with noise, what is ahead comes
        and goes.
    lowering_s
        Time without a reason after which an alarm is lowered, s.
    loop_caution_s, loop_warning_s
        Time until a straight course closes a loop from which on there is a caution, a warning, s.
    turn_caution_s, turn_warning_s
        Same times for a course that turns, s; it is less sure.
    short_caution_s, short_warning_s
        Time until the tether is too short from which on there is a caution, a warning, s. A robot
        that works at the end of its tether moves towards it all the time.
    slack_caution, slack_warning
        Share of the tether left from which on there is a caution, a warning.
    likely_share
        Share of the classes from which on something is stated without its likelihood.
    loop_alarm_share
        Share of the classes with a closed loop from which on there is an alarm.
    possible_share
        Share of the classes with a loop below which it is not mentioned.
    nearly_all_share
        Share of the classes that counts as nearly all.
    doubt_share
        Share of a second class from which on it is mentioned.
    max_names
        Maximum number of obstacles that a text names.
    course_of_positions, course_of_velocities
        Policies for a course that is known from positions alone, and from velocities, too.
    """

    notice_delay_s: float = 0.0
    caution_delay_s: float = 1.0
    warning_delay_s: float = 0.5
    alarm_delay_s: float = 0.3
    max_absence_s: float = 0.7
    lowering_s: float = 4.0
    loop_caution_s: float = 30.0
    loop_warning_s: float = 20.0
    turn_caution_s: float = 20.0
    turn_warning_s: float = 14.0
    short_caution_s: float = 10.0
    short_warning_s: float = 4.0
    slack_caution: float = 0.1
    slack_warning: float = 0.03
    likely_share: float = 0.8
    loop_alarm_share: float = 0.5
    possible_share: float = 0.05
    nearly_all_share: float = 0.95
    doubt_share: float = 0.05
    max_names: int = 3
    course_of_positions: CoursePolicy = CoursePolicy(1.3, 0.8, 0.6)
    course_of_velocities: CoursePolicy = CoursePolicy(0.6, 0.75, 0.0)

    def __post_init__(self) -> None:
        check_not_negative(self)


@dataclass(frozen=True)
class LoopPolicy:
    """Policy that decides what counts as a loop in space. All numbers are positive.

    Attributes
    ----------
    max_gap
        Largest distance between the ends of a closed piece of tether, m, or `max_gap_share` of its
        length: a robot that goes round a pile passes its own tether above or below.
    max_gap_share
        Share of the length of a piece.
    min_turn
        Smallest angle by which a loop turns, rad: more than a tether that comes back beside itself.
    sample_spacing
        Distance between the places of the tether that are compared, m.
    """

    max_gap: float = 0.25
    max_gap_share: float = 0.15
    min_turn: float = 1.1 * math.pi
    sample_spacing: float = 0.2

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class SitePolicy(WorldPolicy):
    """Policy of the geometry of a site. All numbers are positive.

    Attributes
    ----------
    lookahead_coarseness
        Resolution of the tether in a look ahead in the plane, as a multiple of the usual one: steps
        of half a metre take half as long, and three in a thousand looks see something else, most of
        them at their horizon.
    plane_steps_per_update, space_steps_per_update
        Maximum number of steps of looks ahead in one update, which should take 50 ms at most. With
        fewer, a look in several classes tells what was ahead a second ago.
    arc_segments
        Number of segments of a quarter circle on maps.
    loops
        Policy that decides what counts as a loop in space.
    """

    lookahead_coarseness: float = 2.0
    plane_steps_per_update: int = 60
    space_steps_per_update: int = 24
    arc_segments: int = 12
    loops: LoopPolicy = field(default_factory=LoopPolicy)


@dataclass(frozen=True)
class PacePolicy:
    """Policy of the intervals of a live guard. All numbers are positive.

    Attributes
    ----------
    update_s
        Shortest time between two updates, s: vehicles report their position 10, 25 or 50 times a
        second.
    silence_s
        Time without a position after which silence is reported, and period of these reports, s.
    save_s
        Time between two writes of the state file, s.
    heartbeat_s
        Time between two heartbeats to a vehicle that waits to be spoken to, s.
    publish_s
        Time between two publications of figures on the link, s.
    """

    update_s: float = 0.095
    silence_s: float = 0.5
    save_s: float = 1.0
    heartbeat_s: float = 1.0
    publish_s: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class PagePolicy:
    """Policy of the page of a guard. All numbers are positive.

    Attributes
    ----------
    max_body_bytes
        Largest request that a page may send, bytes.
    max_waiting_reports
        Maximum number of reports that wait for a slow page; older ones are dropped.
    max_waiting_inputs
        Maximum number of inputs of operators that wait; further ones are refused.
    """

    max_body_bytes: int = 1000
    max_waiting_reports: int = 50
    max_waiting_inputs: int = 20

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class RatePolicy:
    """Policy of the message rates that a guard needs. All numbers are positive.

    Attributes
    ----------
    position_hz
        Positions per second to request, Hz; the guard updates ten times a second.
    status_hz
        Messages per second to request about the filter, the heading and the sensors, Hz.
    min_position_hz
        Positions per second below which the guard reports the rate, Hz.
    span_s
        Time over which positions are counted, s.
    ask_s
        Time between two requests while the rate is too low, s.
    max_gap_s
        Longest time between two messages within one count, s; after a longer one, the vehicle may
        have restarted, so counting and requesting begin again.
    """

    position_hz: float = 10.0
    status_hz: float = 5.0
    min_position_hz: float = 8.0
    span_s: float = 5.0
    ask_s: float = 5.0
    max_gap_s: float = 30.0

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class RecordingPolicy:
    """Limits that decide whether a recording is damaged, implausible or out of order.

    Attributes
    ----------
    max_speed
        Largest plausible median speed between positions, m/s, positive. Tethered robots are slower.
    max_far_share
        Largest plausible share of positions beyond the tether's reach, 0 to 1.
    max_back_share
        Share of rows with an earlier time than the previous row from which on a table is sorted, 0
        to 1. A clock that is set goes back only once.
    min_back_count
        Minimum number of such rows for a table to be sorted, 1 or more.
    max_height
        Largest height above the water in a column of depths, m, 0 or more. If a value is higher,
        the reader checks whether the column holds heights instead.
    max_time_s
        Largest time of a vehicle's log, s; larger ones are damaged. Positive.
    max_value
        Bound on places and lengths (m) and velocities (m/s); larger ones are damaged. Positive.
    searched_bytes
        Bytes at the beginning of a vehicle's log that must hold a message; damaged bytes may
        precede it. Positive.
    max_message_gap_s
        Longest time between two messages in a row of a telemetry log, s; it tells messages of
        unknown dialects from chance. Positive.
    max_named_kinds
        Number of kinds of messages that a note names; all are counted. Positive.
    no_places
        Values that loggers write for a missing position, as both coordinates of a row.
    """

    max_speed: float = 20.0
    max_far_share: float = 0.5
    max_back_share: float = 0.3
    min_back_count: int = 2
    max_height: float = 0.5
    max_time_s: float = 1e9
    max_value: float = 1e9
    searched_bytes: int = 65_536
    max_message_gap_s: float = 86_400.0
    max_named_kinds: int = 6
    no_places: tuple[float, ...] = (-9999.0, -99999.0, -32768.0, -999999.0)

    def __post_init__(self) -> None:
        check_not_negative(self)
        for name in ("max_speed", "max_time_s", "max_value", "searched_bytes"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"{name}: expected more than 0, got {getattr(self, name)!r}")
        for name in ("max_far_share", "max_back_share"):
            if not getattr(self, name) <= 1.0:
                raise InputError(f"{name}: expected 0 to 1, got {getattr(self, name)!r}")
        if self.min_back_count < 1:
            raise InputError(f"min_back_count: expected 1 or more, got {self.min_back_count!r}")


@dataclass(frozen=True)
class GuardPolicy:
    """Policy of a guard. All numbers are positive.

    Attributes
    ----------
    noise_left
        Approximate share of the noise of an estimate that remains after smoothing.
    max_tethers
        Maximum number of classes whose tether is kept taut; the likeliest ones are. The time of an
        update grows with it.
    max_paid_out_factor
        Longest possible taut tether, as a multiple of the length that the winch reports; longer
        classes are excluded.
    max_state_age_s
        Largest age of a state file, s: after a longer time the robot may be anywhere.
    track
        Policy of the filter of positions.
    belief
        Policy of the belief about the tether's class.
    lookahead
        Policy of the lookahead.
    alarms
        Policy that decides when the operator is warned.
    site
        Policy of the geometry of the site.
    pace
        Policy of the intervals of a live guard.
    rates
        Policy of the message rates that a guard needs.
    link
        Policy of the link to the vehicle.
    """

    noise_left: float = 0.4
    max_tethers: int = 8
    max_paid_out_factor: float = 1.05
    max_state_age_s: float = 600.0
    track: TrackPolicy = field(default_factory=TrackPolicy)
    belief: BeliefPolicy = field(default_factory=BeliefPolicy)
    lookahead: LookaheadPolicy = field(default_factory=LookaheadPolicy)
    alarms: AlarmPolicy = field(default_factory=AlarmPolicy)
    site: SitePolicy = field(default_factory=SitePolicy)
    pace: PacePolicy = field(default_factory=PacePolicy)
    rates: RatePolicy = field(default_factory=RatePolicy)
    link: LinkPolicy = field(default_factory=LinkPolicy)

    def __post_init__(self) -> None:
        check_positive(self)

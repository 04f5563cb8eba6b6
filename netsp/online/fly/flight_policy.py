"""Limits of a flight: when it stops, what is sent, and how it ends."""

from __future__ import annotations

from dataclasses import dataclass, field

from netsp.base.number_ranges import check_positive
from netsp.online.guard.guard_policy import FreezePolicy


@dataclass(frozen=True)
class FlightPolicy:
    """Policy of a flight over MAVLink. All numbers are positive.

    Attributes
    ----------
    max_silence_s
        Longest time without a heartbeat, s of the vehicle; then the link is lost.
    max_position_age_s
        Longest time without a position, s of the vehicle, of ten that come in each second.
    min_source_loss_s
        Time for which a source of the position estimate (GPS, DVL, innovations of the filter) must
        be bad until the flight is stopped, s. The estimate drifts meanwhile.
    max_gps_age_s
        Longest time without a message of a GPS, s; three of its usual intervals if they are longer.
    max_clock_stall_s
        Longest time for which the vehicle's clock may stand still while messages come, s of ours.
    max_unaided_hold_s
        Time for which a vehicle without a source holds its place by its estimate, s, before it is
        put into ALT_HOLD: long enough to stop, and short of where the estimate leads it away.
    max_path_error
        Largest distance in the plan from the path to the target, m: from the straight leg, and
        after a bend from the triangle of the leg and the point where the vehicle came to rest.
        ArduSub keeps within 0.2; a larger distance means that the vehicle was carried off, or that
        its estimate was reset.
    max_depth_error
        Largest distance above or below the depths between which the leg runs, m. A vehicle
        that lags in depth on a sloping leg is between them, and is not stopped.
    stopping_s
        Longest stopping distance of a vehicle when its target changes, divided by its speed, s.
        ArduSub takes 1 s of its speed in still water (1 / PSC_POSXY_P), and nearly 2 in a current
        of 0.8 m/s.
    min_return
        Distance back towards the leg after which the vehicle has stopped beyond a bend, m.
    max_speed
        Largest reported speed that counts when the target changes, m/s; higher ones are capped.
    resend_s
        Time after which a target is sent again if the vehicle echoes another one, or neither echoes
        any nor moves towards it, s. A target that is sent again is planned for again: the vehicle
        falls behind in depth.
    max_resends
        Maximum number of times a target is resent to a vehicle that echoes another one.
    max_echo_error
        Largest distance between a target and its echo, m.
    min_approach
        Smallest distance by which a vehicle that echoes nothing approaches its target in `resend_s`
        if it has received it, m.
    max_depth_step
        Largest change of depth up to the next target on a sloping leg, m. Between targets a vehicle
        may lag in depth; at each target it is on the leg.
    max_unwatched_distance
        Largest straight distance between the last recorded place and the place where a flight is
        resumed, m: on a longer one the vehicle may have passed an obstacle on either side.
    max_home_offset
        Largest distance of the taut tether from the line between the waypoints home that are
        printed when a pilot takes over, as a share of the clearance: arcs around obstacles have a
        dozen corners within centimetres.
    min_class_odds
        Minimum ratio of the likelihoods of the likeliest and the next class in the state file of a
        guard.
    retry_s
        Time after which a question without an answer, or a mode that the vehicle does not have
        yet, is asked for again, s.
    notice_s
        Mean time from a position within reach of a vertex to the next target, s: positions come
        ten times a second and are read 20 times a second. Counts in predicted times only.
    max_answer_s
        Longest wait for the answer to a question, such as the value of a parameter, s.
    max_standby_silence_s
        Time without a heartbeat after which standby ends, once the flight has ended, s.
    failsafe_s
        Time without a ground station after which ArduSub acts if it does not report
        FS_GCS_TIMEOUT, s; the default of that parameter.
    poll_s, standby_poll_s
        Time between two looks at the messages of the vehicle, during a flight and before or after
        it, s.
    max_ready_wait_s
        Longest wait before a flight for a heartbeat, a position, or a mode, s.
    max_start_distance
        Largest distance of the vehicle from the start of the tour, m.
    min_reach
        Smallest distance at which a vertex counts as reached, m: targets are 0.1 m deep where the
        tour is at the surface, and the vehicle keeps to 0.13 m.
    max_line
        Longest line of events, characters or bytes; a longer one is read in pieces and refused.
    max_read_bytes
        Maximum number of bytes read from a stream of events at once.
    freeze
        Policy that tells a frozen position from a vehicle that holds still.
    """

    max_silence_s: float = 3.0
    max_position_age_s: float = 2.0
    min_source_loss_s: float = 0.6
    max_gps_age_s: float = 1.2
    max_clock_stall_s: float = 3.0
    max_unaided_hold_s: float = 2.0
    max_path_error: float = 1.0
    max_depth_error: float = 1.0
    stopping_s: float = 2.0
    min_return: float = 0.2
    max_speed: float = 3.0
    resend_s: float = 2.0
    max_resends: int = 3
    max_echo_error: float = 0.15
    min_approach: float = 0.1
    max_depth_step: float = 2.0
    max_unwatched_distance: float = 10.0
    max_home_offset: float = 0.1
    min_class_odds: float = 100.0
    retry_s: float = 0.5
    notice_s: float = 0.1
    max_answer_s: float = 2.0
    max_standby_silence_s: float = 60.0
    failsafe_s: float = 5.0
    poll_s: float = 0.05
    standby_poll_s: float = 0.1
    max_ready_wait_s: float = 10.0
    max_start_distance: float = 2.0
    min_reach: float = 0.15
    max_line: int = 100_000
    max_read_bytes: int = 65_536
    freeze: FreezePolicy = field(default_factory=FreezePolicy)

    def __post_init__(self) -> None:
        check_positive(self)
